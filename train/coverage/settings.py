"""Settings of the explorer as a learner, and the environments that they make."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal

import gymnasium as gym

from agents.roster import parse_agent
from anm_gym.checks import check_at_least, check_choices, check_positive, check_share
from anm_gym.wrappers.coverage_reward import CoverageRewardWrapper, CoverageWeights
from anm_gym.wrappers.moves_only import MovesOnlyWrapper
from anm_gym.wrappers.occupancy import OccupancyWrapper
from anm_gym.wrappers.policy_view import PolicyViewWrapper
from anm_gym.wrappers.scenes import ScenesWrapper
from train.command import split_list
from train.episodes import make_env

_RANGE: Final = re.compile(r"(?P<stem>home:\w+:)(?P<first>\d+)-(?P<last>\d+)")


@dataclass(frozen=True)
class ViewSettings:
    """What the policy looks at; see `PolicyViewWrapper` (ours)."""

    map_px: int = 48
    """Edge of the map around the agent, pixels; 0 for none."""
    pixel_m: float = 0.125
    """Edge of a pixel of the map, metres."""
    depth_px: int = 0
    """Edge of the depth image, pixels; 0 for none."""
    cell_m: float = 0.125
    """Edge of a cell of the occupancy grid that the map is cut from, metres."""

    def __post_init__(self) -> None:
        check_at_least(self, 0, "map_px", "depth_px")
        check_positive(self, "pixel_m", "cell_m")
        if self.map_px == 0 and self.depth_px == 0:
            raise ValueError("`map_px` or `depth_px` must be > 0, got 0 and 0")


@dataclass(frozen=True)
class LearnerSettings:
    """How Stable-Baselines3 learns (its defaults where nothing else is said)."""

    algorithm: Literal["ppo", "recurrent_ppo"] = "ppo"
    """PPO, or RecurrentPPO of sb3-contrib, which has a memory."""
    num_envs: int = 16
    """Environments side by side in this process."""
    rollout_steps: int = 200
    """Steps of each environment between two updates: an episode, so that every batch has all of it (ours)."""
    batch_size: int = 400
    """Transitions of a gradient step."""
    num_epochs: int = 4
    """Passes over a rollout."""
    learning_rate: float = 7e-4
    """Step size of Adam."""
    discount: float = 0.99
    """Weight of the next step's reward."""
    gae_lambda: float = 0.95
    """Weight of longer advantages."""
    entropy_weight: float = 0.003
    """Weight of the policy's entropy in the loss."""

    def __post_init__(self) -> None:
        check_choices(self)
        check_at_least(self, 1, "num_envs", "rollout_steps", "num_epochs")
        check_at_least(self, 2, "batch_size")  # advantages are normalised over a batch
        check_positive(self, "learning_rate")
        check_at_least(self, 0.0, "entropy_weight")
        check_share(self, "discount", "gae_lambda")
        if self.num_envs * self.rollout_steps % self.batch_size != 0:
            raise ValueError(
                "`batch_size` must divide `num_envs` times `rollout_steps`, got "
                f"{self.batch_size} of {self.num_envs * self.rollout_steps}"
            )


@dataclass(frozen=True)
class CoverageTraining:
    """A whole run: where it learns, where it is tested, for how long, and where it is written."""

    out: Path = Path("runs/coverage")
    """Folder of the run; started again, it goes on."""
    scenes: Sequence[str] | str = ("home:studio:100-163",)
    """Scenes to learn in, a list or a text with commas; `home:studio:100-163` stands for 64 homes."""
    eval_scenes: Sequence[str] | str = ("home:studio:900-915",)
    """Scenes to be tested in, which must not be among the others."""
    steps: int = 480_000
    """Steps of all environments together, rounded up to whole rounds."""
    round_updates: int = 10
    """Updates between two tests; each time a checkpoint is written and every episode begins anew."""
    episode_steps: int = 200
    """Budget of an episode."""
    scene_episodes: int = 5
    """Episodes of an environment in one scene before it draws the next: making one takes time."""
    seed: int = 0
    """Seeds weights, scenes, starts and actions."""
    baselines: Sequence[str] | str = ("random",)
    """Agents of the roster that are tested on the same starts, for comparison."""
    env: dict[str, Any] = field(
        default_factory=lambda: {"camera": {"width_px": 48, "height_px": 48}, "forward_step_m": 0.25}
    )
    """Arguments of the environment besides the scene."""
    reward: CoverageWeights = field(default_factory=CoverageWeights)
    """What a step is paid for."""
    view: ViewSettings = field(default_factory=ViewSettings)
    """What the policy looks at."""
    learner: LearnerSettings = field(default_factory=LearnerSettings)
    """How it learns."""

    def __post_init__(self) -> None:
        for name in ("scenes", "eval_scenes", "baselines"):
            if isinstance(words := getattr(self, name), str):
                object.__setattr__(self, name, tuple(split_list([words])))
        for agent in self.baselines:
            parse_agent(agent)
        check_at_least(self, 1, "steps", "round_updates", "episode_steps", "scene_episodes")
        check_at_least(self, 0, "seed")
        if self.env.get("reward", "area") != "area":
            raise ValueError(
                f"`env` must keep the reward of Explore, got {self.env['reward']!r}; it measures the coverage"
                ", and `reward.floor` 0 leaves it out of what is paid"
            )
        if seen := set(expand_scenes(self.scenes)) & set(expand_scenes(self.eval_scenes)):
            raise ValueError(f"`eval_scenes` must not be learned in, got {', '.join(sorted(seen))} in both")

    @classmethod
    def from_plain(cls, values: Mapping[str, Any]) -> "CoverageTraining":
        """Read settings from what JSON made of them."""
        stages = {
            "out": Path(values["out"]),
            "reward": CoverageWeights(**values["reward"]),
            "view": ViewSettings(**values["view"]),
            "learner": LearnerSettings(**values["learner"]),
        }
        return cls(**{**values, **stages})

    @property
    def round_steps(self) -> int:
        """Steps of all environments between two tests."""
        return self.round_updates * self.learner.rollout_steps * self.learner.num_envs

    @property
    def num_rounds(self) -> int:
        """Rounds of the whole run."""
        return -(-self.steps // self.round_steps)


def expand_scenes(names: Sequence[str]) -> list[str]:
    """Write ranges of homes out.

    Args:
        names: Scenes; ``home:studio:3-5`` stands for three homes.

    Raises:
        ValueError: If there is none, or a range is empty.

    Example:
        >>> expand_scenes(["flat.glb", "home:studio:3-5"])
        ['flat.glb', 'home:studio:3', 'home:studio:4', 'home:studio:5']
    """
    result = []
    for name in names:
        match = _RANGE.fullmatch(name)
        if match is None:
            result.append(name)
        else:
            first, last = int(match["first"]), int(match["last"])
            if first > last:
                raise ValueError(f"a range of `scenes` must rise, got {name!r}")
            result += [f"{match['stem']}{number}" for number in range(first, last + 1)]
    if not result:
        raise ValueError("`scenes` must name at least one, got none")
    return result


def make_explore(training: CoverageTraining, scenes: Sequence[str]) -> gym.Env:
    """Make the environment that learner and baselines share: Explore in several scenes, paid for coverage."""
    env = make_env(scenes[0], training.episode_steps, training.env)
    env = ScenesWrapper(env, scenes=scenes, episodes_each=training.scene_episodes)
    env = OccupancyWrapper(env, cell_m=training.view.cell_m)
    weights = training.reward
    return CoverageRewardWrapper(
        env, floor=weights.floor, known=weights.known, collision=weights.collision, slack=weights.slack
    )


def make_learner_env(training: CoverageTraining, scenes: Sequence[str]) -> gym.Env:
    """Make what the policy sees and does: three moves, a map around the agent, a small depth image."""
    env = MovesOnlyWrapper(make_explore(training, scenes))
    view = training.view
    return PolicyViewWrapper(env, map_px=view.map_px, pixel_m=view.pixel_m, depth_px=view.depth_px)
