"""The 2-D twin of exploration in which OccAnt's global policy learns: one action is one goal.

Nothing is rendered: a home is a raster of heights, and a look marks the cells that a camera would see.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Literal, final, get_args

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from agents.layout_memory import (
    EXPLORED,
    OCCUPIED,
    VIEW_CHANNELS,
    LayoutMemory,
    LayoutSettings,
    points_to_world,
    start_poses,
)
from anm_gym.map.projection import ProjectionSettings, seen_masks
from train.occant.twin_walker import TwinWalker, WalkSettings
from train.occant.twin_world import FanSettings, RayFan, TwinWorld

Anticipator = Callable[[NDArray[np.float32]], NDArray[np.float32]]
"""Completes (N, 2, V, V) looks: occupied, explored."""
Reward = Literal["map_accuracy", "area_seen"]
REWARD_PER_M2: Final = 0.04
"""The paper's code pays 1e-4 for a cell of 5 cm."""
KNOWN: Final = 0.5
"""Probability over which a cell counts as known, and as occupied, in scores."""


@dataclass(frozen=True)
class TwinSettings:
    """An episode, and what it pays."""

    layout: LayoutSettings
    """The agent's map, and what the policy sees of it."""
    projection: ProjectionSettings
    """How looks become masks."""
    reward: Reward = "map_accuracy"
    """Pay the area that is anticipated rightly, or the area that is seen (paper: both, the former as AR)."""
    goals: int = 10
    """Goals of an episode: about 1000 steps (20 in the paper's code)."""
    steps_per_goal: int = 96
    """Actions spent on a goal: as far as the 25 steps of 25 cm in the paper's code. On a way of 25 short
    steps the agent hardly gets anywhere, so that all goals pay nearly the same."""
    look_every_steps: int = 5
    """Looks are taken after so many actions: 33 cm, about a step of the paper."""
    walk: WalkSettings = field(default_factory=WalkSettings)
    """How goals are walked to."""
    fan: FanSettings = field(default_factory=FanSettings)
    """The camera's rays."""

    def __post_init__(self) -> None:
        if self.reward not in get_args(Reward):
            raise ValueError(f"`reward` must be one of {', '.join(get_args(Reward))}, got {self.reward!r}")


@final
class OccAntTwinEnv(gymnasium.Env[NDArray[np.float32], np.int64]):
    """Choose goals in a home seen from above.

    ## Description
    The agent's map is empty at first. Each action is a goal for the next 96 steps of 6.5 cm or 10 degrees;
    a planner that takes unseen floor for free walks there, and turns on the spot once it has arrived.

    ## Action Space
    `Discrete(G * G)`: cells of the policy's far view, in row order.

    ## Observation Space
    `Box(0, 1, (9, G, G), float32)`: see `LayoutMemory.view`.

    ## Rewards
    `map_accuracy`: 0.04 per square metre of layout that the map newly holds known and rightly free or
    occupied, less what it no longer does. `area_seen`: the same for layout that was newly seen.

    ## Starting State
    A world, a navigable cell and a heading, all uniform.

    ## Episode End
    Truncated after `goals` actions.

    ## Information
    | key | type | meaning |
    |---|---|---|
    | `seen_m2` | float | layout seen so far, square metres |
    | `seen_share` | float | the same as a share of the layout |
    | `accurate_m2` | float | layout that the map holds rightly, square metres (only with `map_accuracy`) |

    ## Arguments
    `worlds`, `settings`, and `anticipator`, without which the map holds what was seen.

    ## Version History
    - v0: first version.
    """

    def __init__(
        self, worlds: Sequence[TwinWorld], settings: TwinSettings, anticipator: Anticipator | None = None
    ) -> None:
        if not worlds:
            raise ValueError("`worlds` must hold at least one world, got none")
        self.worlds, self.settings, self._anticipator = list(worlds), settings, anticipator
        size = settings.layout.view_cells
        self.observation_space = spaces.Box(0.0, 1.0, (VIEW_CHANNELS, size, size), np.float32)
        self.action_space = spaces.Discrete(settings.layout.num_goals)
        self.memory = LayoutMemory(settings.layout)
        self._eyes = TwinEyes(settings)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode; the option `world` is the index of a world."""
        super().reset(seed=seed)
        drawn = int(self.np_random.integers(len(self.worlds)))
        self.world = self.worlds[(options or {}).get("world", drawn)]
        cell = self.world.starts[self.np_random.integers(len(self.world.starts))]
        heading_rad = self.np_random.uniform(-np.pi, np.pi)
        self._start = np.append(self.world.frame.centers_of(cell)[0], heading_rad)
        self.walker = TwinWalker(self.world, self._start, self.settings.walk)
        self.memory.reset()
        self.is_seen = np.zeros(self.world.frame.shape, bool)
        self._truth: _Truth | None = None
        self._goals = 0
        self._look(self.walker.pose[None])
        self.memory.visit(np.zeros((1, 2)))
        self._paid = self._score()
        return self._observe(), self._info()

    def step(self, action: np.int64) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Spend the steps of one goal."""
        settings = self.settings
        local_xz = self.memory.goal_xz(int(action), start_poses(self.walker.pose, self._start)[0])
        goal_xz = points_to_world(local_xz, self._start)[0]
        poses = self.walker.walk(goal_xz, self.is_seen, settings.steps_per_goal)
        self._look(poses[settings.look_every_steps - 1 :: settings.look_every_steps])
        self.memory.visit(start_poses(poses, self._start)[:, :2])
        self._goals += 1
        score = self._score()
        reward, self._paid = REWARD_PER_M2 * (score - self._paid), score
        return self._observe(), reward, False, self._goals >= settings.goals, self._info()

    def _look(self, poses: NDArray[np.float64]) -> None:
        """Add what is seen from (N, 3) poses to the map."""
        patches = self._eyes.look(self.world, poses, self.is_seen)
        if self._anticipator is not None:
            patches = self._anticipator(patches)
        self.memory.add(patches, start_poses(poses, self._start))

    def _score(self) -> float:
        return self.accurate_m2 if self.settings.reward == "map_accuracy" else self.seen_m2

    @property
    def seen_m2(self) -> float:
        """Layout that was seen, square metres."""
        return float(np.count_nonzero(self.is_seen & self.world.layout) * self.world.frame.cell_m**2)

    @property
    def accurate_m2(self) -> float:
        """Layout that the map holds rightly, square metres."""
        self._truth = self._truth or _Truth.of(self.world, self.memory, self._start)
        return self._truth.accurate_m2(self.memory)

    def _observe(self) -> NDArray[np.float32]:
        return self.memory.view(start_poses(self.walker.pose, self._start)[0])

    def _info(self) -> dict[str, Any]:
        info = {"seen_m2": self.seen_m2, "seen_share": self.seen_m2 / self.world.layout_m2}
        if self.settings.reward == "map_accuracy":
            info["accurate_m2"] = self._paid
        return info


class TwinEyes:
    """A camera in worlds of heights.

    Args:
        settings: Rays, and the raster of a look.
    """

    def __init__(self, settings: TwinSettings) -> None:
        self.fan = RayFan(settings.fan)
        self._projection, self._size = settings.projection, settings.layout.patch_cells
        points = np.stack([self.fan.right_m, -self.fan.ahead_m], axis=-1).reshape(-1, 2)
        cells = settings.layout.patch.cells_of(points)
        self._is_inside = settings.layout.patch.contains(cells)
        self._flat = np.where(self._is_inside, cells[:, 0] * self._size + cells[:, 1], 0)

    def look(
        self, world: TwinWorld, poses: NDArray[np.float64], is_seen: NDArray[np.bool_] | None = None
    ) -> NDArray[np.float32]:
        """Look from some poses.

        Args:
            world: Where.
            poses: (N, 3) x, z in metres and heading in radians, world frame.
            is_seen: (rows, columns) cells of the world; those that are seen are marked.

        Returns:
            (N, 2, V, V) float32 masks: occupied, explored.
        """
        points = self.fan.points_xz(poses)
        tops_m = world.tops_at(points)
        visible = self.fan.visible(tops_m)
        if is_seen is not None:
            cells = world.frame.cells_of(points[visible])
            cells = cells[world.frame.contains(cells)]
            is_seen[cells[:, 0], cells[:, 1]] = True
        flat = visible.reshape(len(poses), -1) & self._is_inside
        is_high = (tops_m > 0.0).reshape(len(poses), -1)
        masks = [self._masks(seen, high) for seen, high in zip(flat, is_high, strict=True)]
        return np.stack(masks).astype(np.float32)

    def _masks(self, is_seen: NDArray[np.bool_], is_high: NDArray[np.bool_]) -> NDArray[np.bool_]:
        area = self._size**2
        parts = [np.bincount(self._flat[is_seen & kind], minlength=area) for kind in (is_high, ~is_high)]
        return seen_masks(
            np.stack(parts).reshape(2, self._size, self._size).astype(np.int32), self._projection
        )


@dataclass(frozen=True, eq=False)
class _Truth:
    """The true layout in the frame of the agent's map."""

    cells: NDArray[np.int64]
    """(K,) flat cells of the map that belong to the layout."""
    is_occupied: NDArray[np.bool_]
    """(K,) whether they are occupied."""

    @classmethod
    def of(cls, world: TwinWorld, memory: LayoutMemory, start: NDArray[np.float64]) -> "_Truth":
        corners = world.frame.centers_of(
            [(r, c) for r in (0, world.frame.shape[0]) for c in (0, world.frame.shape[1])]
        )
        ends = memory.frame.cells_of(start_poses(np.pad(corners, ((0, 0), (0, 1))), start)[:, :2])
        low = np.clip(ends.min(axis=0), 0, memory.frame.shape)
        high = np.clip(ends.max(axis=0) + 1, 0, memory.frame.shape)
        around = np.indices(high - low).reshape(2, -1).T + low
        cells = world.frame.cells_of(points_to_world(memory.frame.centers_of(around), start))
        inside = world.frame.contains(cells)
        row, column = cells[inside].T
        chosen = world.layout[row, column]
        flat = (around[:, 0] * memory.frame.shape[1] + around[:, 1])[inside]
        return cls(flat[chosen], (world.top_m > 0.0)[row, column][chosen])

    def accurate_m2(self, memory: LayoutMemory) -> float:
        probabilities = memory.grid.probabilities.reshape(2, -1)[:, self.cells]
        is_right = (probabilities[OCCUPIED] > KNOWN) == self.is_occupied
        return float((is_right & (probabilities[EXPLORED] > KNOWN)).sum() * memory.frame.cell_m**2)
