"""What OccAnt's global policy sees: a two-channel map of the floor, at two scales around the agent.

The map itself is `anm_gym.map.grid_fusion`'s; this adds where the agent has been, what a policy is shown
of it, and which floor point each of its goals is. All is in the frame of the start (x to the right, z
backwards, heading 0 ahead), so that the walls of a home have no preferred direction.
"""

from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from anm_gym.checks import check_at_least, check_positive
from anm_gym.geometry import forward_xz
from anm_gym.map.grid_fusion import FloorPose, RunningAverageGrid, centred_frame, ego_frame, to_registered
from anm_gym.metrics.pooling import pooled
from anm_gym.sim.grid import GridFrame

OCCUPIED: Final = 0
"""Channel of the probability that a cell is occupied."""
EXPLORED: Final = 1
"""Channel of the probability that a cell is known."""
VIEW_CHANNELS: Final = 9
"""Occupied, explored and visited near the agent, the same far, and how near, ahead and aside a goal is."""
NEARNESS_M: Final = 3.0
"""Distance at which the nearness of a goal has fallen to 1 / e, metres."""


@dataclass(frozen=True)
class LayoutSettings:
    """Sizes of the map and of what the policy sees of it."""

    cell_m: float = 0.1
    """Edge of a cell, metres (5 cm in the paper's code)."""
    map_cells: int = 480
    """Rows and columns of the map: 48 m with the start in the middle, as in the paper's code."""
    patch_cells: int = 64
    """Rows and columns of what one look adds; the agent is under the middle of the last row."""
    view_cells: int = 48
    """Rows and columns of what the policy is shown (240 in the paper's code)."""
    pool: int = 4
    """Cells along a cell of the far view."""
    visited_m: float = 0.15
    """Around each place where the agent has stood the floor counts as visited, metres."""

    def __post_init__(self) -> None:
        check_positive(self, "cell_m", "visited_m")
        check_at_least(self, 1, "map_cells", "patch_cells", "view_cells", "pool")
        if self.view_cells % 2:
            raise ValueError(f"`view_cells` must be even, got {self.view_cells}")

    @property
    def num_goals(self) -> int:
        """Number of goals that the policy chooses from: the cells of the far view."""
        return self.view_cells**2

    @property
    def patch(self) -> GridFrame:
        """Where the cells of a look lie, in the frame of the agent."""
        return ego_frame(self.patch_cells, self.cell_m, is_centred=False)


@final
class LayoutMemory:
    """The map of one episode.

    Args:
        settings: Sizes.

    Source:
        Occupancy Anticipation, Ramakrishnan et al., 2020, and its code. The far view moves with the agent,
        so that homes of any size fit and goals are near enough to be told apart, and the policy is told
        where a goal lies from the agent instead of which cell the agent is in (ours).
    """

    def __init__(self, settings: LayoutSettings | None = None) -> None:
        self.settings = settings or LayoutSettings()
        self._patch = self.settings.patch
        self.frame = centred_frame((0.0, 0.0), self.settings.map_cells, self.settings.cell_m)
        self._offsets_m = _goal_offsets(self.settings)
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self.grid = RunningAverageGrid(self.frame)
        self.visited = np.zeros(self.frame.shape, np.float32)
        """(rows, columns) float32: 1 where the agent has been."""

    def add(self, patches: NDArray[np.float32], poses: NDArray[np.float64]) -> None:
        """Average what N looks show into the map.

        Args:
            patches: (N, 2, V, V) float32 probabilities ahead of the agent: occupied, explored.
            poses: (N, 3) x, z in metres and heading in radians.
        """
        for patch, (x, z, heading_rad) in zip(patches, poses, strict=True):
            pose = FloorPose((float(x), float(z)), float(heading_rad))
            window, values = to_registered(patch, self._patch, self.frame, pose, 0.0)
            self.grid.fuse(window, values)

    def visit(self, positions_xz: NDArray[np.float64]) -> None:
        """Take note of (N, 2) places where the agent has been, metres; beyond the map they are left out."""
        reach = round(self.settings.visited_m / self.settings.cell_m)
        around = np.arange(-reach, reach + 1)
        cells = self.frame.cells_of(positions_xz)
        cells = cells[self.frame.contains(cells)]
        rows = np.clip(cells[:, 0, None, None] + around[:, None], 0, self.frame.shape[0] - 1)
        columns = np.clip(cells[:, 1, None, None] + around, 0, self.frame.shape[1] - 1)
        self.visited[rows, columns] = 1.0

    def view(self, pose: NDArray[np.float64]) -> NDArray[np.float32]:
        """Show the map to the policy.

        Args:
            pose: (3,) x, z in metres and heading in radians.

        Returns:
            (9, G, G) float32 in [0, 1]: around the agent occupied, explored and visited, the same at the
            scale of the goals, and each goal's nearness, cosine and sine of its bearing, halved and raised.
        """
        settings, size = self.settings, self.settings.view_cells * self.settings.pool
        far = self._crop(pose, size)
        skipped = (size - settings.view_cells) // 2
        near = far[:, skipped : skipped + settings.view_cells, skipped : skipped + settings.view_cells]
        return np.concatenate([near, pooled(np.maximum, far, settings.pool), self._bearings(float(pose[2]))])

    def goal_xz(self, goal: int, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        """(2,) floor point of a goal, metres; goals are the far view's cells in row order."""
        return np.asarray(self._center_xz(pose) + self._offsets_m.reshape(-1, 2)[goal])

    def _crop(self, pose: NDArray[np.float64], size: int) -> NDArray[np.float32]:
        """(3, size, size) of occupied, explored and visited around the agent; 0 beyond the map."""
        low = self._center_cell(pose) - size // 2
        first = np.clip(low, 0, self.frame.shape)
        last = np.clip(low + size, 0, self.frame.shape)
        crop = np.zeros((3, size, size), np.float32)
        source = np.s_[first[0] : last[0], first[1] : last[1]]
        target = np.s_[first[0] - low[0] : last[0] - low[0], first[1] - low[1] : last[1] - low[1]]
        crop[:2, *target] = self.grid.probabilities[:, *source]
        crop[2, *target] = self.visited[source]
        return crop

    def _bearings(self, heading_rad: float) -> NDArray[np.float32]:
        """(3, G, G) nearness, and cosine and sine of the bearing, of every goal."""
        distance_m = np.linalg.norm(self._offsets_m, axis=2)
        ahead = self._offsets_m @ forward_xz(heading_rad) / distance_m
        left = self._offsets_m @ forward_xz(heading_rad + np.pi / 2.0) / distance_m
        nearness = np.exp(-distance_m / NEARNESS_M)
        return np.stack([nearness, 0.5 + 0.5 * ahead, 0.5 + 0.5 * left]).astype(np.float32)

    def _center_cell(self, pose: NDArray[np.float64]) -> NDArray[np.int64]:
        """The cell whose lower corner is nearest to the agent: the middle of the views."""
        return np.asarray(self.frame.cells_of(pose[:2] + 0.5 * self.frame.cell_m)[0])

    def _center_xz(self, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        corner = self.frame.centers_of(self._center_cell(pose))[0] - 0.5 * self.frame.cell_m
        return np.asarray(corner)


def _goal_offsets(settings: LayoutSettings) -> NDArray[np.float64]:
    """(G, G, 2) x and z of each goal from the middle of the far view, metres."""
    along = (np.arange(settings.view_cells) + 0.5 - 0.5 * settings.view_cells) * settings.pool
    x, z = np.meshgrid(along, along)
    return settings.cell_m * np.stack([x, z], axis=2)


def start_poses(poses: ArrayLike, start: ArrayLike) -> NDArray[np.float64]:
    """Take (N, 3) poses (x, z, heading) from the world's frame to that of a start (3,)."""
    origin, world = np.asarray(start, np.float64), np.atleast_2d(np.asarray(poses, np.float64))
    sin, cos = np.sin(origin[2]), np.cos(origin[2])
    x, z = (world[:, :2] - origin[:2]).T
    return np.stack([cos * x - sin * z, sin * x + cos * z, world[:, 2] - origin[2]], axis=1)


def points_to_world(points_xz: ArrayLike, start: ArrayLike) -> NDArray[np.float64]:
    """Take (N, 2) floor points from the frame of a start (x, z, heading) to the world's."""
    origin = np.asarray(start, np.float64)
    sin, cos = np.sin(origin[2]), np.cos(origin[2])
    x, z = np.atleast_2d(np.asarray(points_xz, np.float64)).T
    return np.stack([origin[0] + cos * x + sin * z, origin[1] - sin * x + cos * z], axis=1)
