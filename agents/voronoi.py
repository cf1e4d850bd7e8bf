"""Exploration over the Voronoi graph of the floor, in the manner of Active Neural Mapping at Scale."""

from dataclasses import dataclass, field
from typing import Final, final

import gymnasium
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from numpy.typing import NDArray

from anm_gym.checks import check_at_least, check_known, check_share
from anm_gym.envs.mesh_env import Observation
from anm_gym.geometry import wrap_angle
from anm_gym.map.neural_map import NeuralMap
from anm_gym.map.variable_surface import VariableSurface
from anm_gym.map.view_planner import PlannerSettings, ViewPlanner
from anm_gym.map.views import expected_visibility, gains_by_heading, rank_views, sector_of, view_costs
from anm_gym.map.voronoi_graph import VoronoiGraph, VoronoiSettings, voronoi_graph
from anm_gym.sim.grid_planning import line_is_free
from anm_gym.wrappers.goal import Goal, GoalLimits, GoalWrapper

REASON: Final = "vertex"
LIMITS: Final = GoalLimits(arrival_m=0.3, timeout_steps=250, review_steps=10)
BESIDE_M: Final = 0.5
"""Vertices nearer than this to the goal under way are no other goals, metres (ours)."""
"""Ours."""


@dataclass(frozen=True)
class VoronoiGoalSettings:
    """What is worth a look, from which vertices, and which comes first."""

    planning: PlannerSettings = field(default_factory=PlannerSettings)
    """Which surface is worth looking at, and what a view of it costs."""
    graph: VoronoiSettings = field(default_factory=VoronoiSettings)
    """The graph."""
    anchor_share: float = 0.5
    """A point is anchored to the nearest vertex that sees it at least this well, relative to the best."""
    min_gain: float = 0.5
    """Views of less anchored surface are not worth a way, points of full weight."""
    by_classes: bool = False
    """Choose by classes of vertices and then the nearest; else the most anchored surface per step of cost."""
    visited_m: float = 0.975
    """Vertices this close to the trail have been visited, metres (`by_classes`)."""
    horizon_m: float = 3.0
    """Vertices this close and in line of sight are in the local horizon, metres (`by_classes`)."""
    deferred_m: float = 13.0
    """Vertices farther than this come last, metres: 200 steps (`by_classes`)."""

    def __post_init__(self) -> None:
        check_share(self, "anchor_share")
        check_at_least(self, 0.0, "min_gain", "visited_m", "horizon_m", "deferred_m")


PRESETS: Final = {
    "best": VoronoiGoalSettings(),
    "fast": VoronoiGoalSettings(),
    "scale": VoronoiGoalSettings(by_classes=True),
}
"""`best` and `fast` name the preset of the map and choose by gain over cost (ours); `scale` chooses by the
classes of Active Neural Mapping at Scale, on the map of `best`."""
MAP_PRESETS: Final = {"best": "best", "fast": "fast", "scale": "best"}
"""Preset of the neural map under each of `PRESETS`."""


@dataclass(frozen=True, eq=False)
class _Views:
    """What places show: a goal under way, if there is one, then the vertices, then the agent's own place."""

    positions_xz: NDArray[np.float64]
    """(P, 2) floor points, metres."""
    lengths_m: NDArray[np.float64]
    """(P,) length of the way to each, metres."""
    gains: NDArray[np.float64]
    """(P, H) weight of anchored surface in view by heading."""


@final
class VoronoiGoalWrapper(GoalWrapper):
    """Go to the vertex of the Voronoi graph with most variable surface anchored to it, for its cost.

    See `GoalWrapper` for observation and information.

    ## Needs
    A `NeuralMapWrapper` below it.

    Args:
        env: An environment under a `NeuralMapWrapper`.
        preset: One of `PRESETS`.
        seed: Seeds what is drawn.
        settings: Effective settings instead of the preset's.

    Raises:
        ValueError: If the preset is unknown or there is no neural map below.

    Source:
        Active Neural Mapping at Scale, 2024; anchoring point by point and gain over cost are ours.

    Example:
        >>> import gymnasium
        >>> from anm_gym.wrappers.neural_map import NeuralMapWrapper
        >>> env = gymnasium.make("anm_gym:ANM/Explore-v0", scene="home:studio:0")
        >>> env = VoronoiGoalWrapper(NeuralMapWrapper(env, preset="fast"), preset="fast")
        >>> observation, info = env.reset(seed=0)
        >>> env.goal.reason
        'sweep'
    """

    def __init__(
        self,
        env: gymnasium.Env[Observation, np.int64],
        *,
        preset: str = "best",
        seed: int = 0,
        settings: VoronoiGoalSettings | None = None,
    ) -> None:
        RecordConstructorArgs.__init__(self, preset=preset, seed=seed, settings=settings)
        check_known("Voronoi preset", preset, PRESETS)
        if not env.has_wrapper_attr("neural_map"):
            raise ValueError("`env` must have a neural map; wrap it in NeuralMapWrapper first")
        self.settings = settings or PRESETS[preset]
        super().__init__(env, limits=LIMITS, seed=seed)

    def _begin_episode(self) -> None:
        self.look_round()
        self._planner = ViewPlanner(self.settings.planning.for_steps(*self.step_sizes))

    def _see(self, observation: Observation) -> None:  # noqa: ARG002 - the map below has learned it
        with self.stopwatch("goal"):
            self._planner.note_view(self.position_xz, self.heading_rad)

    def _propose_goal(self) -> Goal | None:
        views = self._views(None)
        if views is None:
            return None
        return self._first_by_class(views) if self.settings.by_classes else self._best(views, None)

    def _review_goal(self, goal: Goal) -> Goal | None:
        if self.settings.by_classes:
            return goal
        current = goal if goal.reason == REASON else None
        views = self._views(current)
        return goal if views is None else self._best(views, current) or goal

    def _views(self, current: Goal | None) -> _Views | None:
        """Anchor the variable surface to places; a goal under way replaces the vertices beside it."""
        graph = voronoi_graph(self.occupancy, self.position_xz, self.settings.graph)
        if graph is None:
            return None
        positions, lengths_m = self._places(graph, current)
        planning, neural_map = self._planner.settings, self._neural_map
        surface = self._planner.variable_surface(neural_map, self.position_xz, self.heading_rad, self.rng)
        camera_y_m = neural_map.occupancy.floor_y_m + neural_map.camera.sensor_height_m
        centers = np.insert(positions, 1, camera_y_m, axis=1)
        visibility = expected_visibility(centers, surface.points, neural_map.volume, planning.views)
        anchored = visibility * self._anchors(centers, surface, visibility)
        gains = gains_by_heading(
            centers, surface.points, surface.weights, anchored, neural_map.camera, planning.views
        )
        gains[self._planner.taken.among(positions, gains.shape[1])] = 0.0
        gains[gains < self.settings.min_gain] = 0.0
        gains[self.near_failure(positions, planning.failure_radius_m)] = 0.0
        return _Views(positions, lengths_m, gains)

    def _places(
        self, graph: VoronoiGraph, current: Goal | None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The goal under way, the vertices and the agent's own place, and the way to each."""
        positions, lengths_m = graph.positions_xz, graph.distances_from(self.position_xz)
        if current is not None:
            gaps = np.linalg.norm(positions - current.position_xz, axis=1)
            length_m = lengths_m[gaps.argmin()] + gaps.min()
            beside = gaps < min(0.5 * self.settings.graph.spacing_m, BESIDE_M)
            positions = np.concatenate([current.position_xz[None], positions[~beside]])
            lengths_m = np.append(length_m, lengths_m[~beside])
        return np.concatenate([positions, self.position_xz[None]]), np.append(lengths_m, 0.0)

    def _anchors(
        self, centers: NDArray[np.float64], surface: VariableSurface, visibility: NDArray[np.float32]
    ) -> NDArray[np.bool_]:
        """(P, N) which place each point is anchored to: the nearest that sees it well."""
        if len(surface.points) == 0:
            return np.zeros(visibility.shape, bool)
        gaps = np.linalg.norm(centers[:, None] - surface.points[None], axis=2)
        sees = visibility >= np.maximum(self.settings.anchor_share * visibility.max(axis=0), 1e-6)
        nearest = np.where(sees, gaps, np.inf).argmin(axis=0)
        return np.asarray((np.arange(len(centers))[:, None] == nearest) & sees)

    def _best(self, views: _Views, current: Goal | None) -> Goal | None:
        """The view with the most anchored surface per step, or the goal under way if it still serves."""
        planning = self._planner.settings
        costs = view_costs(
            views.positions_xz, views.lengths_m, self.position_xz, self.heading_rad, planning.views
        )
        best, utilities = rank_views(views.positions_xz, views.gains, costs, planning.views)
        if best.utility <= 0.0:
            return None
        if current is not None and current.heading_rad is not None:
            sector = sector_of(current.heading_rad, utilities.shape[1])
            if utilities[0, sector] >= planning.keep_share * best.utility:
                return current
        return Goal(best.position_xz, best.heading_rad, REASON)

    def _first_by_class(self, views: _Views) -> Goal | None:
        """What is left to look at here; then the nearest vertex of the best class."""
        if views.gains[-1].max() > 0.0:
            return _look(views, len(views.gains) - 1)
        positions, settings = views.positions_xz[:-1], self.settings
        gaps = np.linalg.norm(positions[:, None] - np.stack(self._trail_xz)[None], axis=2).min(axis=1)
        is_far = views.lengths_m[:-1] > settings.deferred_m
        failed = self.near_failure(positions, settings.planning.failure_radius_m)
        score = 3 * (gaps > settings.visited_m) + 2 * self._in_horizon(positions)
        score = score + (views.gains[:-1].max(axis=1) > 0.0) - 6 * failed - 12 * is_far
        reached = np.array([self.is_reached(Goal(place, None, "")) for place in positions])
        if reached.all():
            return None
        score = np.where(reached, score.min() - 1, score)
        candidates = np.flatnonzero(score == score.max())
        return _look(views, int(candidates[views.lengths_m[candidates].argmin()]))

    def _in_horizon(self, positions: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(P,) which places are near and in line of sight on the floor."""
        grid = self.occupancy
        cells = (np.concatenate([positions, self.position_xz[None]]) - grid.frame.origin_xz) / grid.cell_m
        is_near = np.linalg.norm(positions - self.position_xz, axis=1) <= self.settings.horizon_m
        return np.asarray(is_near & line_is_free(grid.occupied, cells[:-1, ::-1], cells[-1, ::-1]))

    @property
    def _neural_map(self) -> NeuralMap:
        neural_map = self.env.get_wrapper_attr("neural_map")
        assert isinstance(neural_map, NeuralMap)
        return neural_map


def _look(views: _Views, index: int) -> Goal:
    """Go to a place and look at most of what is anchored to it, if anything is."""
    gains = views.gains[index]
    heading_rad = wrap_angle(2.0 * np.pi * int(gains.argmax()) / len(gains)) if gains.max() > 0.0 else None
    return Goal(views.positions_xz[index], heading_rad, REASON)
