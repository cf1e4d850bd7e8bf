"""Neural variability on true and on predicted surface, beside what had been seen by then (Fig. 3)."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from anm_gym.geometry import forward_xz
from anm_gym.map.neural_map import NeuralMap
from anm_gym.mesh import TriangleMesh
from anm_gym.scenes.scene import Scene
from train.figures.map_probe import Moment, Numbers, Trace, still_copy, surface_around_observed
from train.figures.view import OpenView, Sight
from train.plots import save_figure
from train.reconstruction import CUT_ABOVE_FLOOR_M

MOMENT: Final = 0.2
"""Share of the episode at which the map is looked at: enough is seen, enough is not."""
VOXEL_M: Final = 0.08
"""Lattice of the predicted surface, metres."""
SEEN_M: Final = 0.1
"""Surface this close to an observed point counts as seen, metres."""
MARGIN_M: Final = 0.5
"""Margin around the true scene, metres."""
EDGES_M: Final = (0.0, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 6.4)
"""Distances from the observed surface between which variability is averaged, metres."""
UNSEEN_COLOR: Final = (0.90, 0.90, 0.89)
SEEN_COLORS: Final = ((0.56, 0.80, 0.90), (0.08, 0.30, 0.55))
"""Seen surface at the floor, and at the height of the cut."""
BLUR_PX: Final = 4.0
"""Width at which the boundary of the seen is drawn: specks say nothing, pixels."""
TRAIL_COLOR: Final = "#00c2a8"


@dataclass(frozen=True, eq=False)
class Surface:
    """The figure.

    Variability is given as a spread in centimetres: the standard deviation of the prediction, or its mean
    absolute change, whichever the map's settings say.
    """

    step: int
    """Actions taken by then."""
    view: OpenView
    """The common frame of the three pictures."""
    truth: Sight
    """The true scene."""
    truth_distance_m: NDArray[np.float64]
    """(N,) distance of each pixel of `truth` from the observed surface, metres."""
    truth_spread_cm: NDArray[np.float64]
    """(N,) variability there."""
    predicted: Sight
    """The predicted surface."""
    predicted_spread_cm: NDArray[np.float64]
    """(M,) variability there."""
    trail: NDArray[np.float64]
    """(T, 3) positions on the floor so far, metres."""
    heading_rad: float
    """Where the agent looks."""
    floor_y_m: float
    """Height of the floor, metres."""

    def numbers(self) -> Numbers:
        """Variability by distance from the observed surface, over pixels of the true scene."""
        return {
            "step": self.step,
            "edges_m": EDGES_M,
            "median_spread_cm": medians_by_distance(self.truth_distance_m, self.truth_spread_cm),
            "pixels": np.histogram(self.truth_distance_m, EDGES_M)[0],
            "seen_share": float((self.truth_distance_m <= SEEN_M).mean()),
            "predicted_quantiles_cm": np.quantile(self.predicted_spread_cm, np.linspace(0.0, 1.0, 11))
            if len(self.predicted_spread_cm)
            else [],
            "trail": self.trail,
        }

    def draw(self, path: Path) -> Path:
        """Draw what was seen, and variability on true and on predicted surface."""
        return _draw(self, path)


class SurfaceTrace(Trace):
    """Keep a copy of the map from the middle of the episode."""

    def __init__(self, steps: int, seed: int) -> None:  # noqa: ARG002
        self._wanted = max(1, round(MOMENT * steps))
        self._trail: list[NDArray[np.float64]] = []
        self._kept: tuple[int, NeuralMap, float] | None = None

    def take(self, moment: Moment) -> None:
        """Keep the trail until the moment of the picture."""
        if self._kept is None:
            self._trail.append(moment.pose[:3, 3] * [1.0, 0.0, 1.0] + [0.0, moment.scene.floor_y_m, 0.0])
        if moment.step == self._wanted:
            self._keep(moment)

    def finish(self, moment: Moment) -> Surface:
        """Look at the true and at the predicted surface from the same place."""
        if self._kept is None:
            self._keep(moment)
        assert self._kept is not None
        step, neural_map, heading_rad = self._kept
        view = view_of(moment.scene)
        truth = view.see(moment.scene.storey_mesh)
        surface = surface_around_observed(neural_map, VOXEL_M)
        predicted = (
            _nothing(truth) if len(surface) == 0 else view.see(as_mesh(surface.vertices, surface.faces))
        )
        spread_cm = spread_of(neural_map, np.concatenate([truth.points, predicted.points]))
        count = len(truth.points)
        return Surface(
            step=step,
            view=view,
            truth=truth,
            truth_distance_m=neural_map.cloud.distance_of(truth.points).astype(np.float64),
            truth_spread_cm=spread_cm[:count],
            predicted=predicted,
            predicted_spread_cm=spread_cm[count:],
            trail=np.array(self._trail),
            heading_rad=heading_rad,
            floor_y_m=moment.scene.floor_y_m,
        )

    def _keep(self, moment: Moment) -> None:
        self._kept = moment.step, still_copy(moment.neural_map), moment.heading_rad


def as_mesh(vertices: NDArray[np.floating], faces: NDArray[np.integer]) -> TriangleMesh:
    """Make a mesh of zero-crossings."""
    return TriangleMesh(np.asarray(vertices, np.float64), np.asarray(faces, np.int32))


def view_of(scene: Scene) -> OpenView:
    """Look into a storey that is cut open under its ceiling."""
    bounds = scene.storey_mesh.bounds + MARGIN_M * np.array([[-1.0, 0.0, -1.0], [1.0, 0.0, 1.0]])
    cut_y_m = min(float(bounds[1, 1]), scene.floor_y_m + CUT_ABOVE_FLOOR_M)
    return OpenView(
        np.array([[bounds[0, 0], scene.floor_y_m, bounds[0, 2]], [bounds[1, 0], cut_y_m, bounds[1, 2]]])
    )


def spread_of(neural_map: NeuralMap, points: NDArray[np.floating]) -> NDArray[np.float64]:
    """Neural variability of (N, 3) points as a length, (N,) centimetres; all share the same draws."""
    scores = neural_map.variability(points).astype(np.float64)
    is_variance = neural_map.settings.variability.statistic == "variance"
    return np.asarray(100.0 * (np.sqrt(np.maximum(scores, 0.0)) if is_variance else scores))


def medians_by_distance(
    distance_m: NDArray[np.float64], spread_cm: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Median spread between each two of `EDGES_M`; NaN where there is no point."""
    place = np.digitize(distance_m, EDGES_M) - 1
    groups = [spread_cm[place == index] for index in range(len(EDGES_M) - 1)]
    return np.array([float(np.median(group)) if len(group) else np.nan for group in groups])


def _nothing(like: Sight) -> Sight:
    return Sight(np.zeros_like(like.is_hit), np.zeros((0, 3), np.float32), np.zeros(0))


def _draw(result: Surface, path: Path) -> Path:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator

    height_px, width_px = result.truth.is_hit.shape
    sheet = Figure(figsize=(14.0, 14.0 / 3.25 * height_px / width_px + 0.6), layout="constrained")
    axes = sheet.subplots(1, 3)
    spread = np.concatenate([result.truth_spread_cm, result.predicted_spread_cm])
    low, high = np.quantile(spread, [0.02, 0.98])
    colors = ScalarMappable(LogNorm(max(low, 1e-6), max(high, 2e-6)), "inferno")
    pictures = (
        (
            f"the scene: seen by step {result.step} (blue), and the rest",
            result.truth.image(_seen_colors(result)),
        ),
        (
            "variability at the true surface",
            result.truth.image(colors.to_rgba(result.truth_spread_cm)[:, :3]),
        ),
        (
            "variability at the predicted surface",
            result.predicted.image(colors.to_rgba(result.predicted_spread_cm)[:, :3]),
        ),
    )
    for axis, (title, picture) in zip(axes, pictures, strict=True):
        axis.imshow(picture, interpolation="bilinear")
        axis.set_title(title, fontsize=11)
        axis.set_axis_off()
        _draw_trail(axis, result)
    for axis in axes[1:]:
        _draw_boundary(axis, result)
    bar = sheet.colorbar(colors, ax=axes, shrink=0.8, pad=0.01, extend="both")
    bar.set_label("neural variability: spread of the prediction (cm)")
    bar.ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    bar.ax.yaxis.set_major_formatter("{x:g}")
    bar.ax.yaxis.set_minor_formatter("")
    return save_figure(sheet, path)


def _seen_colors(result: Surface) -> NDArray[np.float64]:
    """Colour seen surface by height, leave the rest grey."""
    share = np.clip((result.truth.points[:, 1:2] - result.floor_y_m) / CUT_ABOVE_FLOOR_M, 0.0, 1.0)
    low, high = np.array(SEEN_COLORS)
    is_seen = result.truth_distance_m <= SEEN_M
    return np.where(is_seen[:, None], low + share * (high - low), np.array(UNSEEN_COLOR))


def _draw_boundary(axis: Any, result: Surface) -> None:
    """Draw where the seen part of the true surface ends."""
    image = np.full(result.truth.is_hit.shape, np.nan)
    image[result.truth.is_hit] = result.truth_distance_m <= SEEN_M
    known = ndimage.gaussian_filter(np.isfinite(image).astype(float), BLUR_PX)
    seen = ndimage.gaussian_filter(np.nan_to_num(image), BLUR_PX)
    share = np.divide(seen, known, out=np.full(image.shape, np.nan), where=result.truth.is_hit)
    axis.contour(share, levels=[0.5], colors="white", linewidths=1.0, linestyles="--")


def _draw_trail(axis: Any, result: Surface) -> None:
    places = result.view.project(result.trail)
    axis.plot(*places.T, color=TRAIL_COLOR, linewidth=1.6)
    ahead = forward_xz(result.heading_rad)
    tip = result.trail[-1] + 0.45 * np.array([ahead[0], 0.0, ahead[1]])
    axis.annotate(
        "",
        xy=result.view.project(tip[None])[0],
        xytext=places[-1],
        arrowprops={"arrowstyle": "-|>", "color": TRAIL_COLOR, "linewidth": 2.0, "mutation_scale": 14},
    )
