"""The upper bound of exploration: a planner that knows the mesh and what every pose would cover.

It chooses poses only; driving there is the business of a navigator. What counts as covered is what the
episode's own frames have covered, by the rule of the completion ratio.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from anm_gym.actions import FORWARD_STEP_M, TURN_STEP_DEG
from anm_gym.geometry import CameraSpec
from anm_gym.metrics.completion import THRESHOLD_M
from anm_gym.metrics.depth_view import depth_view
from anm_gym.metrics.nearest_observed import NearestObserved
from anm_gym.metrics.sample_blocks import SampleBlocks
from anm_gym.metrics.view_table import ViewTable, pack
from anm_gym.sim.geodesic import GeodesicTree, GridGraph, nearest_free_cell
from anm_gym.sim.traversable import TraversableGrid


@dataclass(frozen=True)
class OracleSettings:
    """How the planner weighs gain against cost."""

    overhead_steps: float = 3.0
    """Added to the cost of every pose, so that tiny gains next door do not win, steps."""
    num_refined: int = 48
    """Poses whose way is planned in full, the best ones by gain per straight cost."""
    waypoint_m: float = 0.4
    """Spacing at which what is seen on the way is counted, metres."""
    forward_step_m: float = FORWARD_STEP_M
    """Length of a forward step, metres."""
    turn_step_rad: float = float(np.deg2rad(TURN_STEP_DEG))
    """Angle of a turn, radians."""


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


@dataclass(frozen=True, eq=False)
class _Way:
    """A planned way to a pose."""

    cost_steps: float
    bits: NDArray[np.uint64]


class GreedyCoverage:
    """Choose, at each decision, the pose with the most newly covered samples per step of its way.

    What would be covered on the way and while turning counts as well. A pose that was reached is not
    proposed again, even where the table promised more than the frames kept.

    Source:
        Ours: greedy maximum coverage with travel cost, as a bound for planners that do not know the mesh.
    """

    def __init__(
        self, table: ViewTable, grid: TraversableGrid, settings: OracleSettings | None = None
    ) -> None:
        """Start with nothing covered.

        Args:
            table: What each pose covers.
            grid: The true traversable grid, on which ways are planned.
            settings: Weights.
        """
        self.settings = settings or OracleSettings()
        self._table, self._grid = table, grid
        self._graph = GridGraph(grid.navigable, grid.frame.cell_m)
        self._cells = grid.frame.cells_of(table.positions_xz)
        self._positions = cKDTree(table.positions_xz)
        self._blocks = SampleBlocks(table.points)
        self.reset()

    def reset(self) -> None:
        """Forget what was covered and tried."""
        self._nearest = NearestObserved(self._blocks, THRESHOLD_M)
        self._is_open = np.ones(self._table.bits.shape[:2], bool)

    @property
    def covered_pct(self) -> float:
        """Share of the reachable-visible samples that the frames so far covered, per cent."""
        visible = self._table.visible
        return float(100.0 * self._nearest.covered[visible].mean()) if visible.any() else 100.0

    def mark_seen(
        self, depth_m: NDArray[np.float32], camera: CameraSpec, world_from_camera: NDArray[np.floating]
    ) -> None:
        """Account for a frame of the episode.

        Args:
            depth_m: (H, W) or (H, W, 1) float32 planar depth, metres.
            camera: The camera that took it.
            world_from_camera: (4, 4) pose.
        """
        self._nearest.observe(depth_view(depth_m, camera, world_from_camera))

    def give_up(self, goal: GoalPose, radius_m: float = 0.0) -> None:
        """Never propose a pose again: it was reached, or it cannot be.

        Args:
            goal: A pose that `next_goal` proposed.
            radius_m: Give up every position this near as well, with all its headings; 0 for the pose alone.
        """
        self._is_open[goal.position_index, goal.heading_index] = False
        if radius_m > 0.0:
            self._is_open[self._positions.query_ball_point(goal.position_xz, radius_m)] = False

    def next_goal(self, position_xz: ArrayLike, heading_rad: float) -> GoalPose | None:
        """Choose the next pose.

        Args:
            position_xz: (2,) where the agent is, metres.
            heading_rad: Where it looks, radians.

        Returns:
            The best pose by gain per step; None if no reachable pose covers anything new.
        """
        position = np.asarray(position_xz, np.float64)
        tree = self._tree_from(position)
        if tree is None:
            return None
        missing = pack(~self._nearest.covered)
        gains = np.bitwise_count(self._table.bits & missing).sum(axis=-1, dtype=np.int64)
        gains[~self._is_open] = 0
        costs = self._direct_costs(tree, position, heading_rad)
        utility = np.where(gains > 0, gains / (costs + self.settings.overhead_steps), 0.0)
        order = np.argsort(-utility, axis=None, kind="stable")[: self.settings.num_refined]
        poses = [divmod(int(flat), utility.shape[1]) for flat in order if utility.flat[flat] > 0.0]
        ways = [self._way(tree, position, heading_rad, pose) for pose in poses]
        if not ways:
            return None
        best = int(np.argmax([self._rate(way, missing) for way in ways]))
        (row, column), way = poses[best], ways[best]
        heading = float(self._table.headings_rad[column])
        gain = int(gains[row, column])
        return GoalPose(self._table.positions_xz[row], heading, row, column, gain, way.cost_steps)

    def _rate(self, way: _Way, missing: NDArray[np.uint64]) -> float:
        gain = int(np.bitwise_count(way.bits & missing).sum())
        return gain / (way.cost_steps + self.settings.overhead_steps)

    def _tree_from(self, position_xz: NDArray[np.float64]) -> GeodesicTree | None:
        cell = self._grid.frame.cells_of(position_xz)[0]
        start = nearest_free_cell(self._grid.navigable, cell, 10)
        return None if start is None else self._graph.tree_from(start)

    def _direct_costs(
        self, tree: GeodesicTree, position_xz: NDArray[np.float64], heading_rad: float
    ) -> NDArray[np.float64]:
        """Steps to each pose (P, K) with the turns of a straight way."""
        distance_m = tree.distance_m[self._cells[:, 0], self._cells[:, 1]]
        delta = self._table.positions_xz - position_xz
        is_here = distance_m < self.settings.forward_step_m
        bearing = np.where(is_here, heading_rad, np.arctan2(-delta[:, 0], -delta[:, 1]))
        turns = np.abs(_wrapped(bearing - heading_rad))[:, None]
        turns = turns + np.abs(_wrapped(self._table.headings_rad - bearing[:, None]))
        return np.asarray(
            distance_m[:, None] / self.settings.forward_step_m + turns / self.settings.turn_step_rad
        )

    def _way(
        self, tree: GeodesicTree, position_xz: NDArray[np.float64], heading_rad: float, pose: tuple[int, int]
    ) -> _Way:
        """Plan the way to a pose: its steps, and the samples covered along it and at its end."""
        row, column = pose
        goal_heading = float(self._table.headings_rad[column])
        points = self._waypoints(tree, position_xz, row)
        legs = np.diff(points, axis=0)
        lengths_m = np.linalg.norm(legs, axis=1)
        legs, stops = legs[lengths_m > 1e-9], points[1:][lengths_m > 1e-9]
        bearings = np.arctan2(-legs[:, 0], -legs[:, 1])
        turns = np.abs(_wrapped(np.diff(np.concatenate([[heading_rad], bearings, [goal_heading]]))))
        rows, columns = self._views(stops, bearings, row, goal_heading, heading_rad)
        bits = np.bitwise_or.reduce(self._table.bits[rows, columns], axis=0)
        cost = lengths_m.sum() / self.settings.forward_step_m + turns.sum() / self.settings.turn_step_rad
        return _Way(float(cost), bits)

    def _waypoints(
        self, tree: GeodesicTree, position_xz: NDArray[np.float64], row: int
    ) -> NDArray[np.float64]:
        cells = tree.path_to(self._cells[row])
        assert cells is not None, "poses without a path have no utility"
        stride = max(1, int(self.settings.waypoint_m / self._grid.frame.cell_m))
        inner = self._grid.frame.centers_of(cells[stride:-1:stride].reshape(-1, 2))
        return np.concatenate([position_xz[None], inner, self._table.positions_xz[row][None]])

    def _views(
        self,
        stops: NDArray[np.float64],
        bearings: NDArray[np.float64],
        row: int,
        goal_heading_rad: float,
        heading_rad: float,
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Nearest poses of the table along a way and while turning at its end."""
        last = bearings[-1] if len(bearings) else heading_rad
        turn = float(_wrapped(np.asarray(goal_heading_rad - last)))
        pitch = 2.0 * np.pi / len(self._table.headings_rad)
        sweep = last + turn * np.linspace(0.0, 1.0, 1 + int(np.ceil(abs(turn) / pitch)))
        on_way = self._positions.query(stops)[1] if len(stops) else np.zeros(0, np.int64)
        rows = np.concatenate([on_way, np.full(len(sweep), row)]).astype(np.int64)
        headings = np.concatenate([bearings, sweep])
        columns = np.rint(headings / pitch).astype(np.int64) % len(self._table.headings_rad)
        return rows, columns


def _wrapped(angles_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray((angles_rad + np.pi) % (2.0 * np.pi) - np.pi)
