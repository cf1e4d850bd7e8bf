"""How much of the reachable floor the depth camera has shown: the reward of exploration."""

import numpy as np
from numpy.typing import NDArray

from anm_gym.envs.largest_part import LARGEST
from anm_gym.geometry import CameraSpec, forward_xz
from anm_gym.sim.simulator import AgentState
from anm_gym.sim.traversable import TraversableGrid

STRIDE = 2
"""Every second cell along rows and columns is looked for: 10 cm apart with the default grid."""
SLACK_M = 0.2
"""What a pixel shows may lie so much before a place and still be the place, metres: hardly more than what
parts the floor on the two sides of a thin wall."""


class SeenFloor:
    """The floor that an agent could stand on, and which of it has been seen.

    A place has been seen when the pixel that it falls on shows nothing nearer, and nothing higher above
    the floor than what the body steps over. Looked up in the image rather than ray cast, this takes a
    fraction of a millisecond.

    Args:
        grid: Where the body fits; only its largest part counts.
        camera: The depth camera.

    Source:
        Ours. Rewarding the area that is newly seen is common for learned exploration.
    """

    def __init__(self, grid: TraversableGrid, camera: CameraSpec) -> None:
        reachable = grid.component[::STRIDE, ::STRIDE] == LARGEST
        self.is_seen = np.zeros(reachable.shape, np.bool_)
        """(rows, columns) bool: which cells have been seen, at `STRIDE` times the grid's edge."""
        self.total_m2 = grid.component_areas_m2[LARGEST - 1]
        """Area that there is to see, square metres."""
        self._cells = np.flatnonzero(reachable)
        rows_columns = STRIDE * np.argwhere(reachable)
        self._points_xz = grid.frame.centers_of(rows_columns).astype(np.float32)
        self._num_cells = max(1, len(self._cells))
        self._camera = camera
        self._floor_m = floor_m = _floor_depth(camera)
        higher = max(0.0, 1.0 - grid.body.climb_m / camera.sensor_height_m)
        self._least_m = np.multiply(higher, floor_m, out=np.zeros_like(floor_m), where=floor_m < np.inf)

    @property
    def fraction(self) -> float:
        """Share of the area that has been seen, 0 to 1."""
        return 1.0 - len(self._cells) / self._num_cells

    @property
    def area_m2(self) -> float:
        """Area that has been seen, square metres."""
        return self.fraction * self.total_m2

    def look(self, depth_m: NDArray[np.float32], agent: AgentState) -> float:
        """Take an image into account.

        Args:
            depth_m: (H, W) float32 planar depth, metres; 0 is empty.
            agent: Where it was taken.

        Returns:
            The area that had not been seen before, square metres.
        """
        near = self._cells_in_range(agent)
        seen = near.start + self._visible(self._points_xz[near], depth_m, agent)
        if len(seen) == 0:
            return 0.0
        self.is_seen.reshape(-1)[self._cells[seen]] = True
        self._cells = np.delete(self._cells, seen)
        self._points_xz = np.delete(self._points_xz, seen, axis=0)
        return self.total_m2 * len(seen) / self._num_cells

    def _cells_in_range(self, agent: AgentState) -> slice:
        """The unseen cells whose z is within the camera's range; cells are in the order of z."""
        reach_m = self._camera.max_depth_m / np.cos(0.5 * np.deg2rad(self._camera.hfov_deg))
        limits = agent.position_xz[1] + np.array([-reach_m, reach_m])
        return slice(*np.searchsorted(self._points_xz[:, 1], limits).tolist())

    def _visible(
        self, points_xz: NDArray[np.float32], depth_m: NDArray[np.float32], agent: AgentState
    ) -> NDArray[np.int64]:
        """Indices of the floor points whose pixel shows the floor."""
        camera, ahead_xz = self._camera, forward_xz(agent.heading_rad).astype(np.float32)
        delta = points_xz - agent.position_xz.astype(np.float32)
        ahead_m = delta @ ahead_xz
        nearest_m = 2.0 * camera.focal_px * camera.sensor_height_m / camera.height_px
        inside = np.flatnonzero((ahead_m > nearest_m) & (ahead_m < camera.max_depth_m))
        ahead_m, delta = ahead_m[inside], delta[inside]
        right_m = delta[:, 1] * ahead_xz[0] - delta[:, 0] * ahead_xz[1]
        columns = np.floor(0.5 * camera.width_px + camera.focal_px * right_m / ahead_m).astype(np.int64)
        rows = (0.5 * camera.height_px + camera.focal_px * camera.sensor_height_m / ahead_m).astype(np.int64)
        framed = np.flatnonzero((columns >= 0) & (columns < camera.width_px) & (rows < camera.height_px))
        rows = rows[framed]
        shown_m = depth_m[rows, columns[framed]]
        is_low = (shown_m > 0.0) & (shown_m >= self._least_m[rows])
        # A row of pixels covers more floor the farther off: where it shows its floor, it shows all of that.
        is_there = shown_m >= np.minimum(ahead_m[framed], self._floor_m[rows]) - SLACK_M
        return np.asarray(inside[framed[is_low & is_there]])


def _floor_depth(camera: CameraSpec) -> NDArray[np.float32]:
    """(H,) planar depth of an endless floor in each row, metres; infinite from the horizon up."""
    below_px = np.arange(camera.height_px) + 0.5 - 0.5 * camera.height_px
    depth_m = np.full(camera.height_px, np.inf)
    np.divide(camera.sensor_height_m * camera.focal_px, below_px, out=depth_m, where=below_px > 0.0)
    return depth_m.astype(np.float32)
