"""Goals of Occupancy Anticipation, and of Active Neural SLAM, which is the same without anticipation."""

import math
from dataclasses import dataclass
from typing import Final, final

import gymnasium
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from numpy.typing import NDArray

from agents.layout_memory import LayoutMemory, points_to_world, start_poses
from agents.occant_model import OccAntModel, OccAntSettings, load_model
from agents.weights_identity import WeightsIdentity
from anm_gym.actions import FORWARD_STEP_M, TURN_STEP_DEG
from anm_gym.checks import check_at_least, check_known, check_positive
from anm_gym.envs.mesh_env import Observation
from anm_gym.geometry import wrap_angle
from anm_gym.map.projection import count_hits, project_depth, seen_masks
from anm_gym.map.reach import ReachableSpace, ReachSettings, reachable_space
from anm_gym.sim.geodesic import nearest_free_cell
from anm_gym.wrappers.goal import Goal, GoalLimits, GoalWrapper

PAPER_STEP_M: Final = 0.25
"""Length of a forward step of the paper's agent, metres; it is 6.5 cm here."""
PAPER_INTERVAL_STEPS: Final = 25
"""Steps that a goal stands in the paper."""
LOOK_ROUND_REASON: Final = "look round"
LOOK_ROUND_RAD: Final = 2.0 * np.pi / 3.0
"""Turn that is asked for at once while the agent waits at a goal, radians."""
TRIES: Final = 40
"""Goals that are tried, the best first, until one is not near a recent failure."""
RECENT_FAILURES: Final = 5
THROUGH_UNKNOWN: Final = ReachSettings(through_unknown=True)
"""Unknown floor counts as free (paper)."""


@dataclass(frozen=True)
class OccAntGoalSettings:
    """When the global policy decides, and how its answer is read."""

    interval_steps: int = PAPER_INTERVAL_STEPS
    """A goal stands for this many steps at most."""
    interval_m: float = float("inf")
    """A goal stands for this much of a walk at most, metres."""
    waits: bool = True
    """Turn on the spot at a goal that is reached early (paper's code); else decide at once."""
    samples: bool = False
    """Draw the goal by its probability; else take the likeliest."""
    blacklist_m: float = 0.5
    """Goals this near to one of the last failures are passed over, metres (ours)."""
    arrival_m: float = 0.3
    """Distance at which a goal is reached, metres."""

    def __post_init__(self) -> None:
        check_at_least(self, 1, "interval_steps")
        check_positive(self, "interval_m", "arrival_m")
        check_at_least(self, 0.0, "blacklist_m")


PRESETS: Final = {
    "steps": OccAntGoalSettings(),
    "metres": OccAntGoalSettings(
        interval_steps=150, interval_m=PAPER_INTERVAL_STEPS * PAPER_STEP_M, waits=False, samples=True
    ),
}
"""`steps`: a goal every 25 steps, as published, although these are a quarter as long here; `metres`: every
6.25 m, as far as 25 steps of the paper's agent reach, on arrival, and after 150 steps, most of them turns."""


@final
class OccAntGoalWrapper(GoalWrapper):
    """Let a learned policy choose goals on an anticipated map.

    See `GoalWrapper` for observation, information and needs.

    Args:
        env: An exploration environment.
        preset: One of `PRESETS`.
        seed: Seeds what is drawn.
        anticipation: Complete what is seen; without it this is Active Neural SLAM, with its own weights.
        settings: Effective settings instead of the preset's.
        weights: A file of `agents.occant_model` instead of the shipped one.

    Raises:
        ValueError: If the preset is unknown, or the weights do not fit `anticipation`.
        PolicyError: If there are no weights.

    Source:
        Occupancy Anticipation, Ramakrishnan et al., 2020; Active Neural SLAM, Chaplot et al., 2020. Ways are
        planned on the suite's own map of what was seen, not on the anticipated one.
    """

    def __init__(
        self,
        env: gymnasium.Env[Observation, np.int64],
        *,
        preset: str = "metres",
        seed: int = 0,
        anticipation: bool = True,
        settings: OccAntGoalSettings | None = None,
        weights: str | None = None,
    ) -> None:
        RecordConstructorArgs.__init__(
            self, preset=preset, seed=seed, anticipation=anticipation, settings=settings, weights=weights
        )
        check_known("OccAnt preset", preset, PRESETS)
        self.settings = settings or PRESETS[preset]
        self._model: OccAntModel = load_model(weights or ("occant" if anticipation else "ans"))
        self.model_settings: OccAntSettings = self._model.settings
        if self.model_settings.anticipates != anticipation:
            raise ValueError(
                f"`weights` must be of a model with anticipation {anticipation}, got {not anticipation}"
            )
        self.model_identity: WeightsIdentity = self._model.identity
        self.memory = LayoutMemory(self.model_settings.layout)
        limits = GoalLimits(arrival_m=self.settings.arrival_m, timeout_steps=2**31, review_steps=1)
        super().__init__(env, limits=limits, seed=seed)

    def _begin_episode(self) -> None:
        self.memory.reset()
        self._start = np.append(self.position_xz, self.heading_rad)
        self._last_xz = self.position_xz
        self._num_frames, self._look_every = 0, self._steps_between_looks()
        self._goal_age, self._goal_walk_m, self._num_failures = 0, 0.0, 0

    def _see(self, observation: Observation) -> None:
        pose = self._local_pose
        self.memory.visit(pose[None, :2])
        self._goal_age += 1
        self._goal_walk_m += float(np.linalg.norm(self.position_xz - self._last_xz))
        self._last_xz = self.position_xz
        if self._num_frames % self._look_every == 0:
            with self.stopwatch("anticipate"):
                self.memory.add(self._look_at(observation["depth"]), pose[None])
        self._num_frames += 1

    def _propose_goal(self) -> Goal | None:
        has_failed = len(self.failures) > self._num_failures
        self._num_failures = len(self.failures)
        if self.goals and not has_failed and self.settings.waits and not self._is_due():
            heading_rad = wrap_angle(self.heading_rad + LOOK_ROUND_RAD)
            return Goal(self.position_xz, heading_rad, LOOK_ROUND_REASON)
        self._goal_age, self._goal_walk_m = 0, 0.0
        return self._choose()

    def _review_goal(self, goal: Goal) -> Goal | None:
        return None if self._is_due() else goal

    def _steps_between_looks(self) -> int:
        """As many as the model was trained with, or fewer if steps or turns are wider than the usual ones."""
        forward_m, turn_rad = self.step_sizes
        widening = max(1.0, forward_m / FORWARD_STEP_M, math.degrees(turn_rad) / TURN_STEP_DEG)
        return math.ceil(round(self.model_settings.look_every_steps / widening, 6))

    @property
    def _local_pose(self) -> NDArray[np.float64]:
        """(3,) pose in the frame of the start."""
        return np.asarray(start_poses(np.append(self.position_xz, self.heading_rad), self._start)[0])

    def _is_due(self) -> bool:
        return self._goal_age >= self.settings.interval_steps or self._goal_walk_m >= self.settings.interval_m

    def _look_at(self, depth_m: NDArray[np.float32]) -> NDArray[np.float32]:
        """What an image adds to the map, (1, 2, V, V)."""
        model = self.model_settings
        hits = project_depth(depth_m, self.get_wrapper_attr("camera"), model.projection)
        look = seen_masks(count_hits(hits, model.layout.patch), model.projection)[None].astype(np.float32)
        return look if self._model.anticipator is None else self._model.anticipator(look)

    def _choose(self) -> Goal | None:
        """The best of the policy's goals, moved to the nearest place that may be reached.

        Where the agent is caught they are left where they are, since all would be moved to where it stands.
        """
        space = reachable_space(self.occupancy, self.position_xz, THROUGH_UNKNOWN)
        if space is None:
            return None
        pose = self._local_pose
        scores = self._model.score_goals(self.memory.view(pose))
        if self.settings.samples:
            scores = scores + self.rng.gumbel(size=scores.shape).astype(np.float32)
        is_caught = space.area_m2 < THROUGH_UNKNOWN.pocket_m2
        for goal in np.argsort(-scores, kind="stable")[:TRIES]:
            point_xz = points_to_world(self.memory.goal_xz(int(goal), pose), self._start)[0]
            place_xz = point_xz if is_caught else _nearest_place(space, point_xz)
            if not self.near_failure(place_xz, self.settings.blacklist_m, RECENT_FAILURES).any():
                return Goal(place_xz, None, "policy")
        return None


def _nearest_place(space: ReachableSpace, point_xz: NDArray[np.float64]) -> NDArray[np.float64]:
    """(2,) the reachable place nearest to a floor point, metres."""
    cell = space.frame.cells_of(point_xz)[0]
    near = nearest_free_cell(space.reachable, cell, 4 * max(space.frame.shape))
    assert near is not None, "the agent's own place is reachable"
    return np.asarray(space.frame.centers_of(near)[0])
