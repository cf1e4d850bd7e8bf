"""The upper bound of exploration: a planner that knows the mesh and what every pose would cover.

It chooses poses only; driving there is the business of a navigator. What counts as covered is what the
episode's own frames have covered, by the rule of the completion ratio.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from anm_gym.actions import FORWARD_STEP_M, TURN_STEP_DEG
from anm_gym.checks import check_at_least, check_positive
from anm_gym.geometry import CameraSpec
from anm_gym.metrics.completion import THRESHOLD_M
from anm_gym.metrics.depth_view import depth_view
from anm_gym.metrics.nearest_observed import NearestObserved
from anm_gym.metrics.sample_blocks import SampleBlocks
from anm_gym.metrics.tours import Pose, Tour, TourSearch
from anm_gym.metrics.view_table import ViewTable, pack
from anm_gym.metrics.ways import Place, Way, WayPlanner
from anm_gym.registration import EXPLORE_STEPS
from anm_gym.sim.traversable import TraversableGrid


@dataclass(frozen=True)
class OracleSettings:
    """How far and how hard the planner looks ahead."""

    forward_step_m: float = FORWARD_STEP_M
    """Length of the agent's forward step, metres."""
    turn_step_rad: float = float(np.deg2rad(TURN_STEP_DEG))
    """Angle of its turn, radians."""
    overhead_steps: float = 3.0
    """Added to the cost of every pose, so that tiny gains next door do not win, steps."""
    num_refined: int = 48
    """Positions to which the way is planned in full at each leg, the best by gain per straight cost."""
    first_trials: int = 1500
    """Changes of the greedy tour that are tried at the start of an episode."""
    later_trials: int = 150
    """Changes that are tried at each later decision."""
    tour_stride: int = 4
    """Tours count every n-th word of 64 samples."""

    def __post_init__(self) -> None:
        check_positive(self, "forward_step_m", "turn_step_rad")
        check_at_least(self, 1, "num_refined", "tour_stride")
        check_at_least(self, 0, "overhead_steps", "first_trials", "later_trials")


@dataclass(frozen=True, eq=False)
class GoalPose:
    """Where to go and where to look on arrival."""

    position_xz: NDArray[np.float64]
    """(2,) floor point, metres."""
    heading_rad: float
    """Heading on arrival, radians."""
    position_index: int
    """Row of the view table."""
    heading_index: int
    """Column of the view table."""
    gain_samples: int
    """Samples that the pose itself would newly cover."""
    cost_steps: float
    """Estimated steps to get there and turn."""


class GreedyCoverage:
    """Propose poses that cover the surface in few steps, from tours over the whole remaining budget.

    A greedy tour takes, leg by leg, the way with the most newly covered samples per step; what is covered
    on the way counts. Local search betters it, and at each decision the tour that is being followed.
    A pose that was given up is not proposed again, even where the table promised more than frames kept.

    Source:
        Ours: greedy maximum coverage with travel costs and local search, as a bound for planners that
        do not know the mesh.
    """

    def __init__(
        self,
        table: ViewTable,
        grid: TraversableGrid,
        settings: OracleSettings | None = None,
        seed: int = 0,
        *,
        horizon_steps: int = EXPLORE_STEPS,
    ) -> None:
        """Start with nothing covered.

        Args:
            table: What each pose covers.
            grid: The true traversable grid, on which ways are planned.
            settings: How far and how hard to look ahead.
            seed: Seed of the local search.
            horizon_steps: Budget of the episode; tours reach to its end.

        Raises:
            ValueError: If `horizon_steps` is less than 1.
        """
        if horizon_steps < 1:
            raise ValueError(f"`horizon_steps` must be >= 1, got {horizon_steps}")
        self.settings = settings or OracleSettings()
        self._table, self._seed, self._horizon_steps = table, seed, horizon_steps
        self._ways = WayPlanner(
            table,
            grid,
            forward_step_m=self.settings.forward_step_m,
            turn_step_rad=self.settings.turn_step_rad,
        )
        self._blocks = SampleBlocks(table.points)
        self._tour_bits = np.ascontiguousarray(table.bits[:, :, :: self.settings.tour_stride])
        self.reset()

    def reset(self) -> None:
        """Forget what was covered, given up and planned."""
        self._nearest = NearestObserved(self._blocks, THRESHOLD_M)
        self._is_open = np.ones(self._table.bits.shape[:2], bool)
        self._rng = np.random.default_rng(self._seed)
        self._tour: Tour | None = None
        self._known_ways: dict[tuple[Pose, Pose], Way] = {}
        self._num_frames = 0

    @property
    def covered_pct(self) -> float:
        """Share of the reachable-visible samples that the frames so far covered, per cent."""
        visible = self._table.visible
        return float(100.0 * self._nearest.covered[visible].mean()) if visible.any() else 100.0

    def mark_seen(
        self, depth_m: NDArray[np.float32], camera: CameraSpec, world_from_camera: NDArray[np.floating]
    ) -> None:
        """Account for a frame of the episode; call it once a step.

        Args:
            depth_m: (H, W) or (H, W, 1) float32 planar depth, metres.
            camera: The camera that took it.
            world_from_camera: (4, 4) pose.
        """
        self._nearest.observe(depth_view(depth_m, camera, world_from_camera))
        self._num_frames += 1

    def newly_covered(self, positions: NDArray[np.integer]) -> NDArray[np.int64]:
        """Count what views would add to what the frames so far covered.

        Args:
            positions: (P,) rows of the view table.

        Returns:
            (P, K) samples that the pose at each of the table's headings would newly cover.
        """
        missing = pack(~self._nearest.covered)
        newly = np.bitwise_count(self._table.bits[positions] & missing)
        return np.asarray(newly.sum(axis=-1, dtype=np.int64))

    def give_up(self, goal: GoalPose, radius_m: float = 0.0) -> None:
        """Never propose a pose again: it was reached, or it cannot be.

        Args:
            goal: A pose that `next_goal` proposed.
            radius_m: Give up every position this near as well, with all its headings; 0 for the pose alone.
        """
        self._is_open[goal.position_index, goal.heading_index] = False
        if radius_m > 0.0:
            self._is_open[self._ways.positions_within(goal.position_xz, radius_m)] = False

    def next_goal(self, position_xz: ArrayLike, heading_rad: float) -> GoalPose | None:
        """Choose the next pose.

        Args:
            position_xz: (2,) where the agent is, metres.
            heading_rad: Where it looks, radians.

        Returns:
            The first pose of the best tour; None if no reachable pose covers anything new.
        """
        place = self._ways.place(np.asarray(position_xz, np.float64), heading_rad)
        if place is None:
            return None
        missing = pack(~self._nearest.covered)
        self._tour = self._best_tour(place, missing[:: self.settings.tour_stride])
        if self._tour:
            return self._goal(place, self._tour[0], missing)
        ways = self._best_ways(place, missing, self._table.bits)
        return self._goal(place, ways[0].pose, missing) if ways else None

    def _goal(self, place: Place, pose: tuple[int, int], missing: NDArray[np.uint64]) -> GoalPose:
        row, column = pose
        gain = int(np.bitwise_count(self._table.bits[row, column] & missing).sum())
        cost = float(self._ways.direct_costs(place)[row, column])
        heading = float(self._table.headings_rad[column])
        return GoalPose(self._table.positions_xz[row], heading, row, column, gain, cost)

    def _best_tour(self, place: Place, missing: NDArray[np.uint64]) -> Tour:
        """Better the greedier of two tours: the one that is being followed, and a new greedy one."""
        budget = max(100.0, float(self._horizon_steps - self._num_frames))
        search = TourSearch(
            self._ways, self._tour_bits, self._known_ways, place, missing, self._is_open, budget
        )
        trials = self.settings.first_trials if self._tour is None else self.settings.later_trials
        kept = search.prospect(search.allowed(self._tour or ()))
        greedy = search.prospect(self._greedy_tour(place, missing, budget))
        best = kept if kept.value > greedy.value else greedy
        return search.improved(best, trials, self._rng).tour

    def _greedy_tour(self, place: Place, missing: NDArray[np.uint64], budget_steps: float) -> Tour:
        tour: list[Pose] = []
        while budget_steps > 0.0:
            ways = self._best_ways(place, missing, self._tour_bits)
            if not ways:
                break
            tour.append(ways[0].pose)
            budget_steps -= ways[0].cost_steps + self.settings.overhead_steps
            missing, place = missing & ~ways[0].bits, self._ways.place_at(ways[0].pose)
        return tuple(tour)

    def _best_ways(self, place: Place, missing: NDArray[np.uint64], bits: NDArray[np.uint64]) -> list[Way]:
        """Plan ways to the most useful positions, each with its best heading; most gain per step first."""
        gains = np.bitwise_count(bits & missing).sum(axis=-1, dtype=np.int64)
        gains[~self._is_open] = 0
        utility = gains / (self._ways.direct_costs(place) + self.settings.overhead_steps)
        columns = utility.argmax(axis=1)
        best = utility[np.arange(len(utility)), columns]
        rows = np.argsort(-best, kind="stable")[: self.settings.num_refined]
        poses = [(int(row), int(columns[row])) for row in rows if best[row] > 0.0]
        ways = [self._ways.way(place, pose, bits) for pose in poses]
        return sorted(ways, key=lambda way: -self._rate(way, missing))

    def _rate(self, way: Way, missing: NDArray[np.uint64]) -> float:
        gain = int(np.bitwise_count(way.bits & missing).sum())
        return gain / (way.cost_steps + self.settings.overhead_steps)
