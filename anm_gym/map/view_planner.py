"""The next best view of variable surface, planned on the map alone (ours).

1. Surface that nobody has seen is collected and scored by neural variability, see
   `anm_gym.map.variable_surface`.
2. The reachable floor is searched, and places near much variable surface are kept.
3. Each place and heading is ranked by what it would show per step of cost: variable surface, and space that
   nobody has seen, where surface may be that the map does not imagine.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from anm_gym.actions import NEAREST_STEPS, STRAIGHT_TURNS
from anm_gym.checks import check_at_least, check_positive
from anm_gym.map.cloud import SurfaceCloud
from anm_gym.map.neural_map import NeuralMap
from anm_gym.map.reach import ReachableSpace, ReachSettings, reachable_space
from anm_gym.map.unseen_volume import UnseenSettings, unseen_volume
from anm_gym.map.variable_surface import (
    SurfaceSettings,
    VariableSurface,
    weigh_by_variability,
    worthwhile_points,
)
from anm_gym.map.views import (
    TakenViews,
    View,
    ViewSettings,
    expected_visibility,
    gains_by_heading,
    in_image,
    rank_views,
    sector_of,
    view_costs,
)


@dataclass(frozen=True)
class PlannerSettings:
    """All settings of a `ViewPlanner` (ours)."""

    views: ViewSettings = field(default_factory=ViewSettings)
    """Ranges, counts and costs."""
    surface: SurfaceSettings = field(default_factory=SurfaceSettings)
    """Which surface is worth looking at."""
    unseen: UnseenSettings = field(default_factory=lambda: UnseenSettings(decay_m=3.0))
    """Which rays look for unseen space; their headings are those of `views`."""
    unseen_worth: float = 16.0
    """Worth of a cubic metre of unseen space in view, in points of surface; 0 counts surface alone. It holds
    for the density of points that blocks of 20 cm give."""
    reach: ReachSettings = field(default_factory=ReachSettings)
    """What counts as passable."""
    keep_share: float = 0.8
    """A view under way is kept while it has this share of the best one's utility."""
    place_spacing_m: float = 0.4
    """Spacing of the candidate places, metres."""
    failure_radius_m: float = 0.4
    """Places this close to one that failed are left out, metres."""
    taken_radius_m: float = 0.3
    """Views from this close to where one was taken show nothing new, metres; no less than what counts as
    arrival, or else a view that shows nothing may be reached and chosen again without a step."""
    taken_angle_deg: float = 10.0
    """How far the directions of such views may differ, degrees; no less than what counts as arrival."""

    def __post_init__(self) -> None:
        check_positive(self, "place_spacing_m")
        check_at_least(self, 0.0, "unseen_worth", "keep_share")
        check_at_least(self, 0.0, "failure_radius_m", "taken_radius_m", "taken_angle_deg")

    def for_steps(self, forward_step_m: float, turn_step_rad: float) -> "PlannerSettings":
        """The same for an agent with other steps."""
        views = replace(self.views, forward_step_m=forward_step_m, turn_step_rad=turn_step_rad)
        arrival_deg = float(np.rad2deg(STRAIGHT_TURNS * turn_step_rad))
        return replace(
            self,
            views=views,
            taken_radius_m=max(self.taken_radius_m, NEAREST_STEPS * forward_step_m),
            taken_angle_deg=max(self.taken_angle_deg, arrival_deg),
        )


class ViewPlanner:
    """Choose where to go and where to look, within one episode.

    Surface that should be in the image but is not seen there was imagined; the planner remembers it, and the
    views that were taken, so as not to look for the same again.

    Args:
        settings: What to look at, from where, at which cost.
    """

    def __init__(self, settings: PlannerSettings | None = None) -> None:
        self.settings = settings or PlannerSettings()
        self._doubted = SurfaceCloud(voxel_m=0.1)
        self.taken = TakenViews(self.settings.taken_radius_m, np.deg2rad(self.settings.taken_angle_deg))

    def note_view(self, position_xz: NDArray[np.float64], heading_rad: float) -> None:
        """Take note of where the agent is, (2,) metres, and where it looks, radians; for every frame."""
        self.taken.add(position_xz, heading_rad)

    def plan(
        self,
        neural_map: NeuralMap,
        position_xz: NDArray[np.float64],
        heading_rad: float,
        rng: np.random.Generator,
        *,
        current: View | None = None,
        excluded_xz: NDArray[np.float64] | None = None,
    ) -> View | None:
        """Plan the next view.

        Args:
            neural_map: The map.
            position_xz: (2,) where the agent stands, metres.
            heading_rad: Where it looks, radians.
            rng: Draws the surface points that are scored.
            current: A view under way, kept unless another is clearly better.
            excluded_xz: (N, 2) places that failed.

        Returns:
            The view, or None if no view from a reachable place is expected to show anything.
        """
        space = reachable_space(neural_map.occupancy, position_xz, self.settings.reach)
        surface = self.variable_surface(neural_map, position_xz, heading_rad, rng)
        if space is None:
            return None
        camera_y_m = neural_map.occupancy.floor_y_m + neural_map.camera.sensor_height_m
        positions, distances = self._candidates(space, surface, position_xz, current, excluded_xz)
        centers = np.insert(positions, 1, camera_y_m, axis=1)
        gains = self.expected_gains(neural_map, surface, centers)
        gains[self.taken.among(positions, gains.shape[1])] = 0.0
        costs = view_costs(positions, distances, position_xz, heading_rad, self.settings.views)
        best, utilities = rank_views(positions, gains, costs, self.settings.views)
        if best.utility <= 0.0:
            return None
        if current is not None and self._still_serves(current, utilities, best):
            return current
        return best

    def variable_surface(
        self,
        neural_map: NeuralMap,
        position_xz: NDArray[np.float64],
        heading_rad: float,
        rng: np.random.Generator,
    ) -> VariableSurface:
        """Find what is worth a look and weigh it; see `plan` for the arguments."""
        camera_y_m = neural_map.occupancy.floor_y_m + neural_map.camera.sensor_height_m
        center = np.insert(position_xz, 1, camera_y_m)
        surface = self._believable(
            worthwhile_points(neural_map, self.settings.surface), neural_map, center, heading_rad
        )
        if len(surface.points) == 0:
            return surface
        surface = self._subsample(surface, rng)
        return weigh_by_variability(neural_map, surface, self.settings.surface)

    def expected_gains(
        self, neural_map: NeuralMap, surface: VariableSurface, centers: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Estimate what views would newly show: variable surface, and the worth of unseen space.

        Args:
            neural_map: The map.
            surface: From `variable_surface`.
            centers: (P, 3) camera centres, metres, world frame.

        Returns:
            (P, H) gains, in points of surface; heading h is ``2 pi h / H`` radians.
        """
        views, volume, camera = self.settings.views, neural_map.volume, neural_map.camera
        visibility = expected_visibility(centers, surface.points, volume, views)
        gains = gains_by_heading(centers, surface.points, surface.weights, visibility, camera, views)
        if self.settings.unseen_worth > 0.0:
            unseen = replace(self.settings.unseen, num_headings=views.num_headings)
            floor_y_m = neural_map.occupancy.floor_y_m
            gains += self.settings.unseen_worth * unseen_volume(volume, centers, floor_y_m, camera, unseen)
        return gains

    def _believable(
        self, surface: VariableSurface, neural_map: NeuralMap, center: NDArray[np.float64], heading_rad: float
    ) -> VariableSurface:
        """Drop surface that this or an earlier image should have shown but did not."""
        settings = self.settings.surface
        shown = surface.points[in_image(center, heading_rad, surface.points, neural_map.camera)]
        visibility = expected_visibility(center[None], shown, neural_map.volume, self.settings.views)[0]
        missed = visibility > settings.doubt_visibility
        if missed.any():
            self._doubted.add(shown[missed])
        if len(self._doubted) == 0:
            return surface
        keep = ~self._doubted.is_near(surface.points, settings.doubt_m)
        return VariableSurface(surface.points[keep], surface.weights[keep])

    def _subsample(self, surface: VariableSurface, rng: np.random.Generator) -> VariableSurface:
        """Keep at most `max_points` points."""
        count = len(surface.points)
        if count <= self.settings.views.max_points:
            return surface
        chosen = rng.choice(count, self.settings.views.max_points, replace=False)
        share = np.float32(len(chosen) / count)
        return VariableSurface(surface.points[chosen], surface.weights[chosen] / share)

    def _candidates(
        self,
        space: ReachableSpace,
        surface: VariableSurface,
        position_xz: NDArray[np.float64],
        current: View | None,
        excluded_xz: NDArray[np.float64] | None,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Places that promise most if nothing stood in the way, and their path costs.

        The place of the view under way comes first, the agent's own after it.
        """
        cells = np.argwhere(space.reachable)
        stride = max(1, round(self.settings.place_spacing_m / space.frame.cell_m))
        cells = cells[(cells % stride == 0).all(axis=1)]
        positions = space.frame.centers_of(cells) if len(cells) else np.empty((0, 2))
        distances = space.cost_m[cells[:, 0], cells[:, 1]]
        if excluded_xz is not None and len(excluded_xz) and len(positions):
            gaps = np.linalg.norm(positions[:, None] - excluded_xz[None], axis=2).min(axis=1)
            far = gaps > self.settings.failure_radius_m
            positions, distances = positions[far], distances[far]
        promise = self._promise(positions, surface)
        views = self.settings.views
        rate = promise / (distances / views.forward_step_m + views.fixed_cost_steps)
        best = np.argsort(-rate, kind="stable")[: views.max_places]
        first = [] if current is None else [current.position_xz]
        first_cost = [space.cost_to(place, self.settings.place_spacing_m) for place in first]
        return (
            np.concatenate([np.array([*first, position_xz]), positions[best]]),
            np.concatenate([np.array([*first_cost, 0.0]), distances[best]]),
        )

    def _promise(self, positions: NDArray[np.float64], surface: VariableSurface) -> NDArray[np.float64]:
        """Weight of the surface within range of each place."""
        offsets = surface.points[None][..., [0, 2]] - positions[:, None].astype(np.float32)
        near = (offsets**2).sum(axis=2) < self.settings.views.max_range_m**2
        return np.asarray(near @ surface.weights, np.float64)

    def _still_serves(self, current: View, utilities: NDArray[np.float64], best: View) -> bool:
        """The view under way, which is the first candidate, is nearly as good as the best."""
        heading = sector_of(current.heading_rad, self.settings.views.num_headings)
        return bool(utilities[0, heading] >= self.settings.keep_share * best.utility)
