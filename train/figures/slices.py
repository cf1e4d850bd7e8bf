"""Horizontal slices of the signed distance at several times of an episode (Fig. 4)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from anm_gym.geometry import forward_xz
from anm_gym.map.neural_map import NeuralMap
from anm_gym.map.targets import PAPER_TARGETS, propose_target_views
from anm_gym.map.volume import UNKNOWN
from anm_gym.mesh import TriangleMesh
from train.figures.map_probe import Moment, Numbers, Trace, still_copy
from train.plots import save_figure
from train.recorder import find_attribute

SHARES: Final = (0.0, 0.25, 0.5, 1.0)
"""Shares of the episode at which a slice is taken."""
CELL_M: Final = 0.06
"""Spacing of the points of a slice, metres."""
MARGIN_M: Final = 0.4
"""Margin around the true scene, metres."""
TARGETS: Final = replace(PAPER_TARGETS, resolution=50, min_cluster_share=0.02)
"""How the target views that are drawn are proposed, whatever the agent's own source of goals; the paper's
way, on a coarser lattice and without the smallest clusters."""
LIMIT_M: Final = 1.0
"""Distance of the strongest colours, metres."""
AGENT: Final = "#ff8c00"
TARGET: Final = "#1a9641"
CHOSEN: Final = "#e31a1c"


@dataclass(frozen=True, eq=False)
class Slice:
    """The map at one time."""

    step: int
    """Actions taken."""
    sdf_m: NDArray[np.float32]
    """(rows, columns) predicted distance at camera height, metres; rows along z, columns along x."""
    is_seen: NDArray[np.bool_]
    """(rows, columns) whether a ray has passed or hit the place."""
    trail_xz: NDArray[np.float64]
    """(T, 2) positions so far, metres."""
    heading_rad: float
    """Where the agent looks."""
    targets_xz: NDArray[np.float64]
    """(N, 2) target views that the map proposes, metres."""
    goal_xz: NDArray[np.float64]
    """(2,) the place that the agent is going to, metres."""


@dataclass(frozen=True, eq=False)
class Slices:
    """The figure."""

    x_m: NDArray[np.float64]
    """(columns,) of the points, metres."""
    z_m: NDArray[np.float64]
    """(rows,) of the points, metres."""
    height_y_m: float
    """Height of the slice, metres, world frame."""
    walls_xz: NDArray[np.float64]
    """(S, 2, 2) pieces of the true surface at that height, metres."""
    slices: Sequence[Slice]
    """In the order of time."""

    def numbers(self) -> Numbers:
        """Plain values and arrays behind the picture, distances to the millimetre."""
        slices = [{**vars(each), "sdf_m": np.round(each.sdf_m.astype(float), 3)} for each in self.slices]
        return {**vars(self), "slices": slices}

    def draw(self, path: Path) -> Path:
        """Draw the slices side by side, with the zero level, the trail and the target views."""
        return _draw(self, path)


class SlicesTrace(Trace):
    """Take a slice at several times."""

    def __init__(self, steps: int, seed: int) -> None:  # noqa: ARG002
        self._wanted = {round(share * steps) for share in SHARES}
        self._trail: list[NDArray[np.float64]] = []
        self._slices: list[Slice] = []

    def take(self, moment: Moment) -> None:
        """Keep the trail, and the map where a slice is due."""
        self._trail.append(moment.pose[[0, 2], 3])
        if moment.step == 0:
            low, high = moment.scene.storey_mesh.bounds
            self._x_m = np.arange(low[0] - MARGIN_M, high[0] + MARGIN_M, CELL_M)
            self._z_m = np.arange(low[2] - MARGIN_M, high[2] + MARGIN_M, CELL_M)
            self._y_m = float(moment.pose[1, 3])
        if moment.step in self._wanted:
            self._slices.append(self._slice(moment))

    def finish(self, moment: Moment) -> Slices:
        """Add the end of an episode that ended early."""
        if self._slices[-1].step != moment.step:
            self._slices.append(self._slice(moment))
        walls = cross_section(moment.scene.storey_mesh, self._y_m)
        return Slices(self._x_m, self._z_m, self._y_m, walls, self._slices)

    def _slice(self, moment: Moment) -> Slice:
        neural_map = still_copy(moment.neural_map)
        z, x = np.meshgrid(self._z_m, self._x_m, indexing="ij")
        points = np.stack([x, np.full_like(x, self._y_m), z], axis=-1).reshape(-1, 3).astype(np.float32)
        return Slice(
            step=moment.step,
            sdf_m=neural_map.sdf(points).reshape(x.shape),
            is_seen=(neural_map.volume.state_at(points) != UNKNOWN).reshape(x.shape),
            trail_xz=np.array(self._trail),
            heading_rad=moment.heading_rad,
            targets_xz=_targets(neural_map),
            goal_xz=np.asarray(find_attribute(moment.env, "goal").position_xz, np.float64),
        )


def cross_section(mesh: TriangleMesh, height_y_m: float) -> NDArray[np.float64]:
    """Cut a mesh by a horizontal plane.

    Args:
        mesh: The surface.
        height_y_m: Height of the plane, metres.

    Returns:
        (S, 2, 2) ends (x, z) of the pieces in which triangles meet the plane, metres.
    """
    above = mesh.triangles[..., 1] > height_y_m
    cut = mesh.triangles[above.any(axis=1) & ~above.all(axis=1)]
    above = cut[..., 1] > height_y_m
    is_alone = above == (above.sum(axis=1, keepdims=True) == 1)
    first = is_alone.argmax(axis=1)
    rows = np.arange(len(cut))
    apex = cut[rows, first]
    ends = []
    for turn in (1, 2):
        other = cut[rows, (first + turn) % 3]
        share = (height_y_m - apex[:, 1]) / (other[:, 1] - apex[:, 1])
        ends.append((apex + share[:, None] * (other - apex))[:, [0, 2]])
    return np.stack(ends, axis=1)


def _targets(neural_map: NeuralMap) -> NDArray[np.float64]:
    views = propose_target_views(neural_map, TARGETS)
    return np.array([view.position[[0, 2]] for view in views]).reshape(-1, 2)


def _draw(result: Slices, path: Path) -> Path:
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    extent = np.array([np.ptp(result.x_m), np.ptp(result.z_m)])
    columns = 2 if extent[0] > 1.4 * extent[1] else len(result.slices)
    rows = -(-len(result.slices) // columns)
    width_in = 13.0
    height_in = rows * (width_in / columns * extent[1] / extent[0] + 0.35) + 0.5
    sheet = Figure(figsize=(width_in, height_in), layout="constrained")
    axes = sheet.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for axis, each in zip(axes.ravel(), result.slices, strict=False):
        image = _draw_slice(axis, result, each)
    for axis in axes[-1]:
        axis.set_xlabel("x (m)")
    for axis in axes[:, 0]:
        axis.set_ylabel("z (m)")
    bar = sheet.colorbar(image, ax=axes, shrink=0.8, pad=0.01, extend="both")
    bar.set_label("signed distance at camera height (m)")
    handles, labels = axes.ravel()[0].get_legend_handles_labels()
    handles.append(Patch(facecolor="#c4d3e0", label="pale: not seen yet"))
    labels.append("pale: not seen yet")
    sheet.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False, fontsize=10)
    return save_figure(sheet, path)


def _draw_slice(axis: Any, result: Slices, each: Slice) -> Any:
    from matplotlib.collections import LineCollection

    x_m, z_m = result.x_m, result.z_m
    image = axis.pcolormesh(x_m, z_m, each.sdf_m, cmap="RdBu", vmin=-LIMIT_M, vmax=LIMIT_M, shading="nearest")
    veil = np.where(each.is_seen, np.nan, 1.0)
    axis.pcolormesh(x_m, z_m, veil, cmap="Greys_r", vmin=0.0, vmax=1.0, alpha=0.55, shading="nearest")
    axis.add_collection(LineCollection(list(result.walls_xz), colors="#777777", linewidths=0.8))
    axis.plot([], [], color="#777777", linewidth=0.8, label="true surface")
    axis.contour(x_m, z_m, each.sdf_m, levels=[0.0], colors="black", linewidths=1.3)
    axis.plot([], [], color="black", linewidth=1.3, label="zero level of the map")
    axis.plot(*each.trail_xz.T, color=AGENT, linewidth=1.5, label="trail")
    axis.scatter(*each.targets_xz.T, s=26, color=TARGET, edgecolor="white", zorder=4, label="target views")
    axis.scatter(*each.goal_xz, s=36, color=CHOSEN, edgecolor="white", zorder=7, label="chosen goal")
    ahead = forward_xz(each.heading_rad)
    axis.quiver(
        *each.trail_xz[-1],
        *ahead,
        color=AGENT,
        edgecolor="black",
        linewidth=0.8,
        zorder=6,
        angles="xy",
        scale_units="xy",
        scale=1.6,
        width=0.016,
        headwidth=4,
        headlength=4.5,
        headaxislength=4.5,
    )
    axis.set_title(f"step {each.step}", fontsize=11)
    axis.set_aspect("equal")
    axis.set_xlim(x_m[0], x_m[-1])
    axis.set_ylim(z_m[-1], z_m[0])
    return image
