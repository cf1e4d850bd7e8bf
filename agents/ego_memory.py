"""What a learned navigator remembers of the floor: two maps around the agent, made from posed depth.

The maps belong to the agent's observation, not to its network: GPS, compass and depth are enough to
draw them, so a small recurrent network need not learn to. Everything is done for many agents at once.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from agents.goal_wave import GoalWave, GoalWaveSettings, cell_centers, straight_distances, wave_seeds
from agents.way_out import AHEAD_OFFSETS, WayOutSettings, distances_ahead, prices
from anm_gym.actions import Action
from anm_gym.checks import check_at_least, check_positive, check_share
from anm_gym.geometry import CameraSpec

FREE: Final = np.uint8(1)
"""Bit of a cell over which a ray passed at the body's heights."""
OCCUPIED: Final = np.uint8(2)
"""Bit of a cell with a surface at the body's heights."""
VISITED: Final = np.uint8(4)
"""Bit of a cell in which the agent has stood."""
BLOCKED: Final = np.uint8(8)
"""Bit of a cell at which a forward step was cut short."""
FLAGS: Final = (FREE, OCCUPIED, VISITED, BLOCKED)
"""All bits."""


_NEIGHBOURS: Final = np.array([(x, z) for x in (-1, 0, 1) for z in (-1, 0, 1)], np.float32)
"""The agent's own cell may be blocked by the wall beside it, so its neighbours are looked at too."""


@dataclass(frozen=True)
class EgoMemorySettings:
    """Sizes of the maps (ours)."""

    cell_m: tuple[float, ...] = (0.1, 0.4)
    """Edge of a cell of each map, metres: the near one and the far one."""
    crop_cells: int = 32
    """Rows and columns of what the network sees of each."""
    behind_share: tuple[float, ...] = (0.3, 0.5)
    """Share of the rows of each map that lie behind the agent."""
    grid_cells: int = 256
    """Rows and columns that are kept; the map is a torus, farther places overwrite each other."""
    image_px: int = 64
    """Rows and columns of the depth image that are used."""
    body_m: tuple[float, float] = (0.1, 1.5)
    """Heights above the floor between which a surface is in the way, metres (the simulator's body)."""
    free_range_m: float = 4.0
    """Cells beyond this range are not marked free, metres: columns of the image lie too far apart."""
    ray_step_m: float = 0.1
    """Distance of the points at which free cells are marked along a ray, metres."""
    wave: GoalWaveSettings = field(default_factory=GoalWaveSettings)
    """How the distance to the goal spreads over what is remembered."""
    way_out: WayOutSettings = field(default_factory=WayOutSettings)
    """How a lost agent is led away."""
    contact_m: float = 0.15
    """Where the obstacle is taken to be when a step was cut short, metres ahead."""
    short_share: float = 0.5
    """A forward step was cut short if it went less than this share of its length."""

    def __post_init__(self) -> None:
        if len(self.behind_share) != len(self.cell_m):
            raise ValueError(
                f"`behind_share` must have one number for each of {len(self.cell_m)} maps, "
                f"got {self.behind_share}"
            )
        check_positive(self, "free_range_m", "ray_step_m", "contact_m")
        check_at_least(self, 1, "crop_cells", "grid_cells", "image_px")
        check_share(self, "short_share")
        if not self.cell_m or not all(cell_m > 0.0 for cell_m in self.cell_m):
            raise ValueError(f"`cell_m` must have numbers > 0, got {self.cell_m}")
        reach = 2 * (int(np.abs(AHEAD_OFFSETS).max() / self.cell_m[0]) + 2)
        if self.way_out.window_cells < reach:
            raise ValueError(
                f"`way_out.window_cells` must be >= {reach}, to hold the points ahead of an agent, "
                f"got {self.way_out.window_cells}"
            )
        widest = max(self.crop_cells, self.wave.window_cells, self.way_out.window_cells)
        if self.grid_cells & (self.grid_cells - 1) or self.grid_cells < widest:
            raise ValueError(
                f"`grid_cells` must be a power of two and at least {widest}, the widest window, "
                f"got {self.grid_cells}"
            )


@final
class EgoMemory:
    """Maps around each of N agents, remembered since their episode began.

    Args:
        num_agents: N.
        camera: The camera that all of them have, apart from its height.
        settings: Sizes.

    Source:
        Ours. The planes resemble the local maps of Active Neural SLAM (Chaplot et al., 2020).
    """

    def __init__(
        self, num_agents: int, camera: CameraSpec, settings: EgoMemorySettings | None = None
    ) -> None:
        self.settings = settings or EgoMemorySettings()
        size = self.settings.grid_cells
        self._edges_m = (*self.settings.cell_m, self.settings.wave.cell_m)
        self._cells = np.zeros((len(self._edges_m), num_agents, size, size), np.uint8)
        self._wave = GoalWave(num_agents, self.settings.wave)
        self._position_xz = np.full((num_agents, 2), np.nan, np.float32)
        self._rays = _Rays.of(camera, self.settings)
        self._agents = np.arange(num_agents)

    @property
    def crop_shape(self) -> tuple[int, int, int]:
        """Shape of the maps of one agent: (scales, rows, columns)."""
        return len(self.settings.cell_m), self.settings.crop_cells, self.settings.crop_cells

    def reset(self, index: int) -> None:
        """Forget what one agent has seen."""
        self._cells[:, index] = 0
        self._position_xz[index] = np.nan
        self._wave.forget(index)

    def keep(self, agents: Sequence[int]) -> None:
        """Go on with some of the agents only, in the order given."""
        self._cells = np.take(self._cells, agents, axis=1)  # contiguous, as `_mark` needs it
        self._position_xz = self._position_xz[agents]
        self._agents = np.arange(len(agents))
        self._wave.keep(agents)

    def update(
        self,
        depth_m: NDArray[np.float32],
        world_from_camera: NDArray[np.float32],
        sensor_height_m: NDArray[np.float32],
        actions: NDArray[np.integer],
        forward_step_m: NDArray[np.float32],
    ) -> None:
        """Add what the agents see.

        Args:
            depth_m: (N, H, W) or (N, H, W, 1) float32 planar depth, metres, 0 is empty.
            world_from_camera: (N, 4, 4) float32 poses of their cameras.
            sensor_height_m: (N,) heights of the cameras above the floor, metres.
            actions: (N,) actions that led here; anything but forward after a reset.
            forward_step_m: (N,) lengths of their forward steps, metres.
        """
        position_xz, ahead_xz = _places_of(world_from_camera)
        self._mark_image(depth_m.reshape(depth_m.shape[:3]), position_xz, ahead_xz, sensor_height_m)
        self._mark(self._agents, position_xz, VISITED)
        moved_m = np.linalg.norm(position_xz - self._position_xz, axis=1)
        is_short = (actions == int(Action.MOVE_FORWARD)) & (
            moved_m < self.settings.short_share * forward_step_m
        )
        contact_xz = position_xz + self.settings.contact_m * ahead_xz
        self._mark(self._agents[is_short], contact_xz[is_short], BLOCKED)
        self._position_xz = position_xz.copy()

    def crops(self, world_from_camera: NDArray[np.float32]) -> NDArray[np.uint8]:
        """Cut out what lies around the agents, ahead up.

        Args:
            world_from_camera: (N, 4, 4) float32 poses.

        Returns:
            (N, scales, rows, columns) uint8 of `FLAGS`; 0 is unknown.
        """
        settings = self.settings
        position_xz, ahead_xz = _places_of(world_from_camera)
        crops = []
        for scale, (cell_m, offsets) in enumerate(zip(settings.cell_m, self._lattices, strict=True)):
            points = _to_world(offsets, position_xz, ahead_xz)
            cells = np.floor(points / np.float32(cell_m)).astype(np.int32) & (settings.grid_cells - 1)
            crops.append(self._cells[scale][self._agents[:, None], cells[..., 1], cells[..., 0]])
        side = settings.crop_cells
        return np.stack(crops, axis=1).reshape(-1, len(crops), side, side)

    def waves(
        self, world_from_camera: NDArray[np.float32], goal_xz: NDArray[np.float32]
    ) -> NDArray[np.uint8]:
        """How much nearer to the goal than the agent every cell of its maps is, over what is remembered.

        Args:
            world_from_camera: (N, 4, 4) float32 poses.
            goal_xz: (N, 2) float32 goals, metres.

        Returns:
            (N, scales, rows, columns) uint8; 128 is as near as the agent, 255 nearer by `wave_extent_m`.
        """
        position_xz, ahead_xz = _places_of(world_from_camera)
        self._spread_waves(position_xz, goal_xz)
        around = self.settings.wave.cell_m * _NEIGHBOURS
        own_m = self._wave.at(position_xz[:, None] + around).min(axis=1, keepdims=True)
        side = self.settings.crop_cells
        planes = []
        for scale, offsets in enumerate(self._lattices):
            nearer_m = own_m - self._wave.at(_to_world(offsets, position_xz, ahead_xz))
            share = np.clip(nearer_m / wave_extent_m(self.settings, scale), -1.0, 1.0)
            planes.append(np.rint(127.5 + 127.5 * share).astype(np.uint8))
        return np.stack(planes, axis=1).reshape(-1, len(planes), side, side)

    def ahead(self, world_from_camera: NDArray[np.float32], agents: NDArray[np.int64]) -> NDArray[np.float32]:
        """How far the goal still is a little ahead of some agents, over what is remembered close around them.

        Args:
            world_from_camera: (K, 4, 4) float32 poses of their cameras.
            agents: (K,) which they are.

        Returns:
            (K, NUM_HEADINGS) float32 metres; the present heading first, the others to its left.
        """
        position_xz, ahead_xz = _places_of(world_from_camera)
        settings, cell_m = self.settings.way_out, np.float32(self.settings.cell_m[0])
        low = np.floor(position_xz / cell_m).astype(np.int64) - settings.window_cells // 2
        flags = self._window(0, agents, low, settings.window_cells)
        price_m = prices(
            (flags & OCCUPIED) > 0, (flags & BLOCKED) > 0, (flags & VISITED) > 0, float(cell_m), settings
        )
        centers = cell_centers(low, settings.window_cells, cell_m)
        rim_m = self._wave.at(centers.reshape(len(agents), settings.window_cells**2, 2), agents)
        straight_m = straight_distances(centers, self._wave.goals_of(agents))
        points = _to_world(AHEAD_OFFSETS, position_xz, ahead_xz)
        cells = np.floor(points / cell_m).astype(np.int64) - low[:, None]
        seeds_m = wave_seeds(straight_m, rim_m.reshape(price_m.shape), cell_m)
        return distances_ahead(seeds_m, price_m, cells, float(cell_m))

    def _spread_waves(self, position_xz: NDArray[np.float32], goal_xz: NDArray[np.float32]) -> None:
        agents = self._wave.due(goal_xz)
        low = self._wave.low_cells(agents, position_xz[agents])
        flags = self._window(-1, agents, low, self.settings.wave.window_cells)
        self._wave.spread(agents, low, (flags & (OCCUPIED | BLOCKED)) > 0, goal_xz[agents])

    def _window(
        self, scale: int, agents: NDArray[np.int64], low: NDArray[np.int64], count: int
    ) -> NDArray[np.uint8]:
        """(K, count, count) flags of one map of some agents, from (K, 2) lower corners on, in cells."""
        along = np.arange(count)
        columns, rows = ((low[:, axis, None] + along) & (self.settings.grid_cells - 1) for axis in (0, 1))
        flags = self._cells[scale][agents[:, None, None], rows[:, :, None], columns[:, None, :]]
        return np.asarray(flags)

    @cached_property
    def _lattices(self) -> tuple[NDArray[np.float32], ...]:
        """(rows * columns, 2) offsets to the right and ahead of each map's cells, metres."""
        return tuple(
            lattice_offsets(self.settings, scale).reshape(-1, 2) for scale in range(len(self.settings.cell_m))
        )

    def _mark_image(
        self,
        depth_m: NDArray[np.float32],
        position_xz: NDArray[np.float32],
        ahead_xz: NDArray[np.float32],
        sensor_height_m: NDArray[np.float32],
    ) -> None:
        rays, (low_m, high_m) = self._rays, self.settings.body_m
        depth = depth_m[:, rays.rows][:, :, rays.columns]
        height = sensor_height_m[:, None, None] + depth * rays.up[:, None]
        in_way = (depth > 0.0) & (height > low_m) & (height < high_m)
        agent, row, column = np.nonzero(in_way)
        along = depth[agent, row, column]
        offsets = np.stack([along * rays.right[column], along], axis=1)
        self._mark(agent, _to_world_each(offsets, position_xz[agent], ahead_xz[agent]), OCCUPIED)
        open_m = np.where(in_way, depth, np.inf).min(axis=1)
        is_open = rays.open_along < open_m[:, None] - self.settings.ray_step_m
        agent, point = np.nonzero(is_open.reshape(len(depth), -1))
        offsets = rays.open_offsets[point]
        self._mark(agent, _to_world_each(offsets, position_xz[agent], ahead_xz[agent]), FREE)

    def _mark(self, agent: NDArray[np.integer], points_xz: NDArray[np.float32], flag: np.uint8) -> None:
        size = self.settings.grid_cells
        first = agent.astype(np.int32) * (size * size)
        for flags, cell_m in zip(self._cells, self._edges_m, strict=True):
            cells = np.floor(points_xz / np.float32(cell_m)).astype(np.int32) & (size - 1)
            flags.reshape(-1)[first + size * cells[:, 1] + cells[:, 0]] |= flag


@dataclass(frozen=True, eq=False)
class _Rays:
    """The rays of the pixels that are used."""

    rows: NDArray[np.int64]
    """(R,) rows of the image."""
    columns: NDArray[np.int64]
    """(C,) columns of the image."""
    up: NDArray[np.float32]
    """(R,) rise per metre of depth."""
    right: NDArray[np.float32]
    """(C,) way to the right per metre of depth."""
    open_along: NDArray[np.float32]
    """(K, 1) depths of the points at which free cells are marked, metres."""
    open_offsets: NDArray[np.float32]
    """(K * C, 2) their offsets to the right and ahead, metres."""

    @classmethod
    def of(cls, camera: CameraSpec, settings: EgoMemorySettings) -> "_Rays":
        rows = spread_pixels(camera.height_px, min(camera.height_px, settings.image_px))
        columns = spread_pixels(camera.width_px, min(camera.width_px, settings.image_px))
        right = camera.directions[0, columns, 0].astype(np.float32)
        along = np.arange(0.0, settings.free_range_m, settings.ray_step_m, dtype=np.float32)[:, None]
        offsets = np.stack([along * right, np.broadcast_to(along, (len(along), len(right)))], axis=-1)
        up = camera.directions[rows, 0, 1].astype(np.float32)
        return cls(rows, columns, up, right, along, offsets.reshape(-1, 2))


def lattice_offsets(settings: EgoMemorySettings, scale: int) -> NDArray[np.float32]:
    """Offsets of the cells of one map from the agent.

    Returns:
        (rows, columns, 2) float32 metres to the right and ahead; row 0 is farthest ahead.
    """
    count, cell_m = settings.crop_cells, settings.cell_m[scale]
    ahead = (np.arange(count, 0, -1) - 0.5 - settings.behind_share[scale] * count) * cell_m
    right = (np.arange(count) + 0.5 - 0.5 * count) * cell_m
    return np.stack(np.broadcast_arrays(right[None, :], ahead[:, None]), axis=-1).astype(np.float32)


def wave_extent_m(settings: EgoMemorySettings, scale: int) -> float:
    """Difference of distances at which the wave of a map is cut off, metres."""
    return 0.6 * settings.crop_cells * settings.cell_m[scale]


def spread_pixels(available: int, wanted: int) -> NDArray[np.int64]:
    """Indices of `wanted` of `available` rows or columns, evenly spread; some twice if there are too few."""
    return np.asarray(((np.arange(wanted) + 0.5) * available / wanted).astype(np.int64))


def _places_of(
    world_from_camera: NDArray[np.float32],
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """(N, 2) where agents stand, metres, and (N, 2) the directions in which they look, of length 1."""
    return world_from_camera[:, [0, 2], 3], -world_from_camera[:, [0, 2], 2]


def _to_world(
    offsets: NDArray[np.float32], position_xz: NDArray[np.float32], ahead_xz: NDArray[np.float32]
) -> NDArray[np.float32]:
    """(N, K, 2) floor points of (K, 2) offsets to the right and ahead of N agents."""
    right_xz = np.stack([-ahead_xz[:, 1], ahead_xz[:, 0]], axis=1)
    axes = np.stack([right_xz, ahead_xz], axis=1)
    return np.asarray(offsets @ axes + position_xz[:, None], np.float32)


def _to_world_each(
    offsets: NDArray[np.float32], position_xz: NDArray[np.float32], ahead_xz: NDArray[np.float32]
) -> NDArray[np.float32]:
    """(K, 2) floor points of one offset to the right and ahead of each of K agents."""
    right, ahead = offsets[:, :1], offsets[:, 1:]
    right_xz = np.stack([-ahead_xz[:, 1], ahead_xz[:, 0]], axis=1)
    return np.asarray(position_xz + right * right_xz + ahead * ahead_xz)
