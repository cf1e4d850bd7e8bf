"""The loss landscape of a true and of a false surface point, and the way of the weights over it (Fig. 2).

Where grids refine the network, it is the network alone that is looked at: its weights are what gradient
descent moves.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.func import functional_call

from anm_gym.errors import AnmError
from anm_gym.geometry import backproject
from anm_gym.map.neural_map import NeuralMap
from anm_gym.map.volume import FREE, UNKNOWN
from anm_gym.metrics.distance import MeshDistance
from train.figures.map_probe import (
    Moment,
    Numbers,
    Trace,
    frozen,
    predict,
    still_copy,
    surface_around_observed,
)
from train.plots import save_figure

SNAPSHOTS: Final = 60
"""Weights kept on the way, besides the first and the last."""
GRID: Final = 49
"""Weights along each side of the landscape."""
MARGIN: Final = 0.15
"""Margin around what is drawn, as a share of it."""
FALSE_AT: Final = (0.2, 0.3, 0.4, 0.5)
"""Shares of the episode at which false zero-crossings are looked for; the paper's is t = 200 of 1000."""
MIN_FALSE_M: Final = 0.3
"""A false zero-crossing is at least this far from the true surface, metres."""
VOXEL_M: Final = 0.15
"""Lattice on which zero-crossings are looked for, metres."""
LEVELS_CM: Final = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0)
"""Contours of the landscape, centimetres: a basin of a few millimetres and a ridge of a metre."""
COLORS: Final = (
    *("#fde725", "#bddf26", "#7ad151", "#44bf70", "#22a884"),
    *("#21918c", "#2a788e", "#355f8d", "#414487", "#440154"),
)
"""Viridis from the lowest loss to what is above the last contour."""
WAY: Final = "#e7298a"
"""Colour of what belongs to the weights' way."""


class NoFalsePointError(AnmError):
    """An episode had no zero-crossing in unseen space that was later seen to be free."""


@dataclass(frozen=True, eq=False)
class Plane:
    """The plane through three weights, spanned by two orthonormal directions.

    Source:
        Active Neural Mapping, Sec. 4.1 and its third footnote.
    """

    origin: Tensor
    """(P,) the first weights."""
    axes: Tensor
    """(2, P) orthonormal."""

    @classmethod
    def through(cls, first: Tensor, second: Tensor, third: Tensor) -> "Plane":
        """Lay the plane through three weights; the first axis points from the first to the third.

        Raises:
            ValueError: If the three lie on one line.
        """
        u = torch.nn.functional.normalize((third - first).double(), dim=0)
        other = (second - first).double()
        across = other - (other @ u) * u
        if not across.norm() > 1e-9 * max(float(other.norm()), 1e-12):
            raise ValueError("`first`, `second` and `third` must not lie on one line; take more steps")
        return cls(first, torch.stack([u, across / across.norm()]))

    def project(self, weights: Tensor) -> NDArray[np.float64]:
        """Coordinates (u, v) of (N, P) weights, (N, 2)."""
        return np.asarray(((weights - self.origin).double() @ self.axes.T).cpu().numpy())

    def at(self, u: float, v: float) -> Tensor:
        """Weights (P,) at coordinates of the plane."""
        return self.origin + (u * self.axes[0] + v * self.axes[1]).float()

    def explained_share(self, weights: Tensor) -> float:
        """Share of the squared distances of (N, P) weights from the origin that lies in the plane."""
        total = float((weights - self.origin).double().square().sum())
        return float((self.project(weights) ** 2).sum()) / max(total, 1e-300)


@dataclass(frozen=True)
class FalsePoints:
    """Zero-crossings in unseen space at one step."""

    step: int
    """When they were predicted."""
    points: NDArray[np.float32]
    """(N, 3) float32 metres, world frame."""


@dataclass(frozen=True, eq=False)
class Landscape:
    """The figure: |f(x; theta(u, v))| for a true point x+ and a false one x-."""

    points: NDArray[np.float64]
    """(2, 3) x+ and x-, metres, world frame."""
    false_step: int
    """Step at which x- was a zero-crossing."""
    false_distance_m: float
    """Distance of x- from the true surface, metres."""
    u: NDArray[np.float64]
    """(G,) first coordinate of the plane."""
    v: NDArray[np.float64]
    """(G,) second coordinate."""
    plane_m: NDArray[np.float64]
    """(2, G, G) prediction f, whose magnitude is the loss; rows along v, metres."""
    steps: NDArray[np.int64]
    """(N,) steps of the snapshots."""
    path: NDArray[np.float64]
    """(N, 2) where they lie in the plane."""
    twin: NDArray[np.float64]
    """(2,) where the twin's last weights lie in the plane."""
    actual_m: NDArray[np.float64]
    """(2, N) prediction f of the snapshots themselves, metres."""
    explained_share: float
    """Share of the weights' way that lies in the plane."""

    def numbers(self) -> Numbers:
        """Plain values and arrays behind the picture."""
        return {**vars(self)}

    def draw(self, path: Path) -> Path:
        """Draw both landscapes from above, and below them what was really predicted on the way."""
        return _draw(self, path)


class LandscapeTrace(Trace):
    """Keep the weights on the way, train a twin from the same start, and look for false zero-crossings.

    The twin starts as a copy of the map after the first frame and learns from the same frames with other
    draws; it gives the plane its third point.
    """

    def __init__(self, steps: int, seed: int) -> None:
        self._rng = np.random.default_rng(seed)
        self._stride = max(1, steps // SNAPSHOTS)
        self._snapshots: dict[int, nn.Module] = {}
        self._false: list[FalsePoints] = []
        self._false_at = {max(1, round(share * steps)) for share in FALSE_AT}

    def take(self, moment: Moment) -> None:
        """Keep weights every few steps; let the twin learn at each."""
        neural_map = moment.neural_map
        if moment.step == 0:
            self._begin(moment)
        else:
            self._twin.integrate(moment.observation["depth"][..., 0], moment.pose)
        if moment.step in self._false_at:
            self._false.append(FalsePoints(moment.step, unseen_zero_crossings(neural_map)))
        if moment.step % self._stride == 0 or moment.step in self._false_at:
            self._snapshots[moment.step] = frozen(neural_map.field.network)

    def finish(self, moment: Moment) -> Landscape:
        """Choose the points and evaluate the landscape."""
        self._snapshots[moment.step] = frozen(moment.neural_map.field.network)
        chosen = choose_false_point(self._false, moment)
        points = np.stack([self._true_point, chosen.points[0]]).astype(np.float64)
        inputs = torch.tensor(points, dtype=torch.float32, device=moment.neural_map.device)
        weights = torch.stack([weights_of(field) for field in self._snapshots.values()])
        twin_weights = weights_of(self._twin.field.network)
        plane = Plane.through(weights[0], twin_weights, weights[-1])
        path, twin = plane.project(weights), plane.project(twin_weights[None])
        u, v = square_extent(np.concatenate([path, twin]))
        actual = torch.stack([predict(field, inputs) for field in self._snapshots.values()], dim=1)
        return Landscape(
            points=points,
            false_step=chosen.step,
            false_distance_m=float(MeshDistance(moment.scene.mesh).distance_m(points[1:])[0]),
            u=u,
            v=v,
            plane_m=landscape(self._snapshots[moment.step], plane, u, v, inputs),
            steps=np.array(list(self._snapshots)),
            path=path,
            twin=twin[0],
            actual_m=actual.cpu().numpy().astype(np.float64),
            explained_share=plane.explained_share(weights),
        )

    def _begin(self, moment: Moment) -> None:
        seen = backproject(moment.observation["depth"], moment.camera, moment.pose)
        self._true_point = seen[self._rng.integers(len(seen))]
        self._twin = still_copy(moment.neural_map)
        self._twin.variability(seen[:1])  # a draw of its own: from here on its batches are others


def weights_of(field: nn.Module) -> Tensor:
    """All parameters of a field as one vector, (P,)."""
    return nn.utils.parameters_to_vector(field.parameters()).detach()


def predict_at(field: nn.Module, weights: Tensor, points: Tensor) -> Tensor:
    """Predict (N, 3) points with (P,) weights in the place of the field's own, (N,) metres."""
    named, pieces, start = dict(field.named_parameters()), {}, 0
    for name, parameter in named.items():
        pieces[name] = weights[start : start + parameter.numel()].view_as(parameter)
        start += parameter.numel()
    return predict(lambda chunk: functional_call(field, pieces, (chunk,)), points)


def landscape(
    field: nn.Module, plane: Plane, u: NDArray[np.float64], v: NDArray[np.float64], points: Tensor
) -> NDArray[np.float64]:
    """Predict f(x; theta(u, v)) for (N, 3) points over a grid, (N, len(v), len(u)) metres."""
    rows = [[predict_at(field, plane.at(x, y), points) for x in u] for y in v]
    values = torch.stack([torch.stack(row) for row in rows])
    return np.asarray(values.permute(2, 0, 1).cpu().numpy(), np.float64)


def square_extent(path: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lay a square grid around (N, 2) points of the plane; (GRID,) coordinates along u and v."""
    low, high = path.min(axis=0), path.max(axis=0)
    half = (0.5 + MARGIN) * float((high - low).max())
    u, v = (np.linspace(middle - half, middle + half, GRID) for middle in 0.5 * (low + high))
    return u, v


def unseen_zero_crossings(neural_map: NeuralMap) -> NDArray[np.float32]:
    """Zero-crossings of the network around the observed space, where nothing was seen yet, (N, 3) metres."""

    def sdf(points: NDArray[np.float32]) -> NDArray[np.float32]:
        asked = torch.tensor(points, device=neural_map.device)
        return np.asarray(predict(neural_map.field.network, asked).cpu().numpy(), np.float32)

    vertices = surface_around_observed(neural_map, VOXEL_M, sdf).vertices
    return np.asarray(vertices[neural_map.volume.state_at(vertices) == UNKNOWN])


def choose_false_point(found: Sequence[FalsePoints], moment: Moment) -> FalsePoints:
    """Choose the zero-crossing that turned out to be farthest from any surface, of the earliest step.

    Args:
        found: Zero-crossings in unseen space, by step.
        moment: The end of the episode: what was seen to be free by then.

    Returns:
        The one point with its step.

    Raises:
        NoFalsePointError: If none is in free space.
    """
    volume, truth = moment.neural_map.volume, MeshDistance(moment.scene.mesh)
    for candidates in sorted(found, key=lambda each: each.step):
        points = candidates.points[volume.state_at(candidates.points) == FREE]
        distance_m = truth.distance_m(points.astype(np.float64))
        if len(points) and distance_m.max() > MIN_FALSE_M:
            return FalsePoints(candidates.step, points[[int(distance_m.argmax())]])
    steps = ", ".join(str(each.step) for each in found)
    raise NoFalsePointError(
        f"a zero-crossing in unseen space must turn out to be free and {MIN_FALSE_M} m from any surface, got "
        f"none at the steps {steps or 'of this episode'}; give more `--steps` or another `--scene`"
    )


def _draw(result: Landscape, path: Path) -> Path:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.figure import Figure

    sheet = Figure(figsize=(10.0, 7.2), layout="constrained")
    grid = sheet.add_gridspec(2, 2, height_ratios=(3.4, 1.0))
    titles = (
        "true surface point $x^+$, seen at step 0",
        f"false zero-crossing $x^-$, predicted at step {result.false_step}",
    )
    axes = [sheet.add_subplot(grid[0, column]) for column in range(2)]
    for index, axis in enumerate(axes):
        _draw_landscape(axis, result, index)
        axis.set_title(titles[index], fontsize=11)
        _draw_actual(sheet.add_subplot(grid[1, index]), result, index)
    axes[0].set_ylabel("$v$ (norm of the change of weights)")
    bar = sheet.colorbar(
        ScalarMappable(BoundaryNorm(LEVELS_CM, len(COLORS), extend="max"), ListedColormap(COLORS)),
        ax=axes,
        shrink=0.9,
        pad=0.02,
        ticks=LEVELS_CM,
    )
    bar.set_label("$|f(x; θ(u, v))|$ (cm)")
    bar.ax.set_yticklabels([f"{level:g}" for level in LEVELS_CM])
    handles, labels = axes[0].get_legend_handles_labels()
    sheet.legend(handles, labels, loc="outside upper center", ncols=len(labels), frameon=False)
    return save_figure(sheet, path)


def _draw_landscape(axis: Any, result: Landscape, index: int) -> None:
    """Fill between contours of the signed prediction: its magnitude has a kink where contours would fray."""
    levels = [*(-level for level in LEVELS_CM[:0:-1]), *LEVELS_CM[1:]]
    colors = [*COLORS[:0:-1], *COLORS]
    values_cm = 100.0 * result.plane_m[index]
    axis.contourf(result.u, result.v, values_cm, levels=levels, colors=colors, extend="both")
    axis.contour(
        result.u,
        result.v,
        values_cm,
        levels=levels,
        colors="white",
        linewidths=0.5,
        linestyles="-",
        alpha=0.5,
    )
    axis.plot(*result.path.T, color=WAY, linewidth=1.8, linestyle=(0, (1.5, 1)), zorder=3, label="weights")
    middle = int(np.argmin(np.abs(result.steps - result.false_step)))
    places = (
        (result.path[0], "o", "step 0"),
        (result.path[middle], "D", f"step {result.false_step}"),
        (result.path[-1], "s", f"step {result.steps[-1]}"),
        (result.twin, "^", "a twin from the same start"),
    )
    for place, marker, label in places:
        axis.scatter(*place, marker=marker, s=52, color=WAY, edgecolor="black", zorder=4, label=label)
    axis.set_aspect("equal")
    axis.set_xlabel("$u$ (norm of the change of weights)")


def _draw_actual(axis: Any, result: Landscape, index: int) -> None:
    axis.grid(True, color="#e5e5e5", linewidth=0.8)
    axis.spines[["top", "right"]].set_visible(False)
    axis.axvline(result.false_step, color="#999999", linewidth=1.0, linestyle=":")
    axis.plot(result.steps, 100.0 * np.abs(result.actual_m[index]), color=WAY, linewidth=1.8)
    axis.set_ylim(0.0, 105.0 * max(float(np.abs(result.actual_m).max()), 0.05))
    axis.set_xlim(0, int(result.steps[-1]))
    axis.set_xlabel("step $t$")
    if index == 0:
        axis.set_ylabel("$|f(x; θ^t)|$ (cm)")
