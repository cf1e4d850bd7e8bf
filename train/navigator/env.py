"""Where navigators learn: agents in ever new generated homes, seen as the network sees them."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final, final

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn, VecEnvWrapper

from agents.navigation_observer import NavigationObserver
from agents.navigator_net import NavigatorNetSettings
from agents.teacher import GeodesicTeacher
from anm_gym.actions import Action
from anm_gym.checks import check_at_least
from anm_gym.envs.pointnav import PointNavEnv
from anm_gym.scenes.procedural.tiers import TIERS
from train.navigator.hardware import Hardware
from train.navigator.vec_env import PointNavVecEnv

FIRST_TRAINING_SEED: Final = 100_000
"""Homes with smaller seeds are never trained on, so that they stay for evaluation."""
LIMIT_M: Final = 125.0
"""Way that fits into the step limit of an episode, metres: Habitat's 500 steps of 0.25 m."""


@dataclass(frozen=True)
class DomainSettings:
    """What varies between the agents and the homes of training (ours)."""

    tiers: dict[str, float] = field(
        default_factory=lambda: {"studio": 0.15, "flat": 0.4, "house": 0.35, "maze": 0.1}
    )
    """Shares of the tiers of generated homes; layouts, doors and clutter differ from home to home."""
    forward_step_m: tuple[float, ...] = (0.25, 0.065, 0.25, 0.13)
    """Forward steps, dealt to the agents in turn, metres."""
    sensor_height_m: tuple[float, ...] = (1.25, 1.25, 1.1, 1.4)
    """Heights of the cameras, dealt to four agents at a time in turn, metres."""
    episodes_per_home: int = 8
    """Episodes that an agent has in a home before it moves to another."""
    max_steps: int = 1000
    """No episode is longer, even if the way would fit into the limit."""

    def __post_init__(self) -> None:
        shares = self.tiers.values()
        if not all(share >= 0.0 for share in shares) or not sum(shares) > 0.0:
            raise ValueError(f"`tiers` must have shares >= 0 with a positive sum, got {self.tiers}")
        if unknown := [tier for tier in self.tiers if tier not in TIERS]:
            raise ValueError(f"unknown tier {unknown[0]!r} in `tiers`; choose among: {', '.join(TIERS)}")
        for name in ("forward_step_m", "sensor_height_m"):
            values = getattr(self, name)
            if not values or not all(value > 0.0 for value in values):
                raise ValueError(f"`{name}` must have numbers > 0, got {values}")
        check_at_least(self, 1, "episodes_per_home", "max_steps")


@final
class HomeDealer:
    """Deal homes to agents: each stays for some episodes, then gets one that nobody has seen.

    Args:
        settings: How long, and from which tiers.
        num_agents: Number of agents.
        seed: Seeds the order.
    """

    def __init__(self, settings: DomainSettings, num_agents: int, seed: int) -> None:
        self._settings = settings
        self._rngs = [np.random.default_rng([seed, index]) for index in range(num_agents)]
        self._homes = [""] * num_agents
        self._left = [0] * num_agents

    def __call__(self, index: int) -> dict[str, Any]:
        """Options of the next episode of an agent."""
        if self._left[index] == 0:
            rng, shares = self._rngs[index], self._settings.tiers
            tier = rng.choice(list(shares), p=np.array(list(shares.values())) / sum(shares.values()))
            self._homes[index] = f"home:{tier}:{FIRST_TRAINING_SEED + int(rng.integers(10**8))}"
            self._left[index] = self._settings.episodes_per_home
        self._left[index] -= 1
        return {"scene": self._homes[index]}


@final
class NavigationVecEnv(VecEnvWrapper):
    """Agents in generated homes, with the network's observations.

    Args:
        net: Sizes of the network, which decide what it is shown.
        domain: What varies.
        num_agents: Number of agents.
        seed: Seeds homes, starts and goals.
        hardware: What casts the rays, and where.
    """

    def __init__(
        self,
        net: NavigatorNetSettings,
        domain: DomainSettings | None = None,
        num_agents: int = 16,
        seed: int = 0,
        hardware: Hardware | None = None,
    ) -> None:
        domain, hardware = domain or DomainSettings(), hardware or Hardware()
        self.teachers: list[GeodesicTeacher | None] = [None] * num_agents
        dealer = HomeDealer(domain, num_agents, seed)
        envs = [_make_env(net, domain, index, hardware) for index in range(num_agents)]
        limits = [min(domain.max_steps, step_limit(env.settings.forward_step_m)) for env in envs]
        agents = PointNavVecEnv(envs, limits, dealer)
        agents.seed(seed)
        self.agents: tuple[PointNavEnv, ...] = agents.envs
        self.observer = NavigationObserver(
            num_agents,
            envs[0].camera,
            np.array([env.camera.sensor_height_m for env in envs], np.float32),
            np.array([env.settings.forward_step_m for env in envs], np.float32),
            net,
        )
        super().__init__(agents, observation_space=observation_space(self.observer))

    def reset(self) -> VecEnvObs:
        """Begin an episode everywhere."""
        observations = self.venv.reset()
        for index in range(self.num_envs):
            self._begin(index)
        return self._show(observations)

    def step_async(self, actions: NDArray[np.integer]) -> None:
        """Take the actions."""
        self.observer.note(np.asarray(actions).reshape(-1))
        self.venv.step_async(actions)

    def step_wait(self) -> VecEnvStepReturn:
        """Step everywhere; the time limit ends an episode for good, as in DD-PPO."""
        observations, rewards, dones, infos = self.venv.step_wait()
        for index in np.flatnonzero(dones).tolist():
            # No episode is cut short, so nobody needs its last image, which is not as the network sees it.
            for name in ("TimeLimit.truncated", "terminal_observation"):
                infos[index].pop(name)
            self._begin(index)
        return self._show(observations), rewards, dones, infos

    def teacher_actions(self) -> NDArray[np.int64]:
        """(N,) what the teacher would do now."""
        return np.array([self._teacher_action(index) for index in range(self.num_envs)], np.int64)

    def _teacher_action(self, index: int) -> Action:
        env, teacher = self.agents[index], self.teachers[index]
        simulator = env.simulator
        if teacher is None:
            teacher = GeodesicTeacher(
                simulator.grid, env.goal_xz, simulator.forward_step_m, simulator.turn_step_rad
            )
            self.teachers[index] = teacher
        return teacher(simulator.state.position_xz, simulator.state.heading_rad)

    def _begin(self, index: int) -> None:
        self.observer.begin_episode(index)
        self.teachers[index] = None

    def _show(self, observations: Any) -> dict[str, NDArray[Any]]:
        return self.observer.observe(
            observations["depth"],
            observations["world_from_camera"],
            observations["pointgoal_with_gps_compass"],
        )


def observation_space(observer: NavigationObserver) -> spaces.Dict:
    """The space of the network's observations."""
    boxes: dict[str, spaces.Space[Any]] = {}
    for key, (shape, dtype) in observer.shapes().items():
        low, high = (0, 255) if dtype is np.uint8 else (-np.inf, np.inf)
        boxes[key] = spaces.Box(low, high, shape, dtype)
    return spaces.Dict(boxes)


def step_limit(forward_step_m: float) -> int:
    """Steps of an episode: as much way as Habitat's limit allows."""
    return round(LIMIT_M / forward_step_m)


def _make_env(
    net: NavigatorNetSettings, domain: DomainSettings, index: int, hardware: Hardware
) -> PointNavEnv:
    steps: Sequence[float] = domain.forward_step_m
    heights: Sequence[float] = domain.sensor_height_m
    height_m = heights[(index // len(steps)) % len(heights)]
    return PointNavEnv(
        "home:studio:0",
        camera={"width_px": net.image_px, "height_px": net.image_px, "sensor_height_m": height_m},
        forward_step_m=steps[index % len(steps)],
        backend=hardware.backend,
        device=hardware.camera_device,
    )
