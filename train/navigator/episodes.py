"""Point-goal episodes played by navigators: learned ones many at a time, the others one by one."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from agents.learned_policy import LearnedPolicy
from agents.navigation_observer import NavigationObserver
from agents.navigator_net import NavigatorNet
from anm_gym.envs.lockstep import Lockstep, Transition
from anm_gym.envs.pointnav import PointNavEnv
from train.navigator.env import step_limit

RESULTS: Final = ("is_success", "spl", "soft_spl", "collisions", "step", "distance_to_goal_m")
"""What is kept of the last info of an episode."""


@dataclass(frozen=True)
class NavigationEpisode:
    """One episode: the same start and goal for every navigator."""

    scene: str
    """Name or path of the scene."""
    seed: int
    """Seeds start and goal."""
    step_m: float
    """Length of a forward step, metres."""
    scene_options: tuple[tuple[str, Any], ...] = ()
    """Keywords for a mesh file, such as its unit; see `anm_gym.scenes.load.load_scene`."""


def play_learned(
    net: NavigatorNet,
    episodes: Sequence[NavigationEpisode],
    *,
    deterministic: bool,
    num_agents: int = 16,
) -> list[dict[str, Any]]:
    """Play episodes of one step length, as many at a time as there are agents.

    Args:
        net: The network.
        episodes: What to play; those of a scene should be neighbours.
        deterministic: Take the likeliest action instead of drawing one.
        num_agents: Episodes that are played side by side; which they are changes none of them.

    Returns:
        `RESULTS` of each episode, in their order.

    Raises:
        ValueError: If there are no episodes or their steps differ.
    """
    steps = {episode.step_m for episode in episodes}
    if len(steps) != 1:
        raise ValueError(f"`episodes` must have one length of a step, got {sorted(steps)}")
    count = min(num_agents, len(episodes))
    envs = [make_pointnav(episodes[index], net.settings.image_px) for index in range(count)]
    lockstep = Lockstep(envs, step_limit(steps.pop()))
    policy = LearnedPolicy(net, count, deterministic=deterministic)
    table = _Table(lockstep, net, policy)
    waiting = iter(enumerate(episodes))
    playing = [table.deal(agent, next(waiting)) for agent in range(count)]
    results: dict[int, dict[str, Any]] = {}
    while playing:
        ended = table.step()
        for agent in ended:
            results[playing[agent]] = table.result(agent)
        staying = list(range(len(playing)))
        for agent in ended:
            following = next(waiting, None)
            if following is None:
                staying.remove(agent)
            else:
                playing[agent] = table.deal(agent, following)
        if len(staying) < len(playing):
            playing = [playing[agent] for agent in staying]
            table.keep(staying)
    return [results[index] for index in range(len(episodes))]


class _Table:
    """Agents that each play an episode."""

    def __init__(self, lockstep: Lockstep, net: NavigatorNet, policy: LearnedPolicy) -> None:
        envs: Any = lockstep.envs
        self._lockstep, self._seats = lockstep, list(range(len(envs)))
        self._last: list[Transition | None] = [None] * len(envs)
        self._policy = policy
        self._observer = NavigationObserver(
            len(envs),
            envs[0].camera,
            envs[0].camera.sensor_height_m,
            envs[0].settings.forward_step_m,
            net.settings.at_work(),
        )

    def deal(self, agent: int, numbered: tuple[int, NavigationEpisode]) -> int:
        """Begin an episode; returns its number."""
        number, episode = numbered
        seat, options = self._seats[agent], {"scene": episode.scene}
        self._last[agent] = self._lockstep.reset(seat, episode.seed, options)
        self._observer.begin_episode(agent)
        self._policy.begin(agent, episode.seed)
        return number

    def keep(self, agents: Sequence[int]) -> None:
        """Go on with some of the agents only; the others find no more to play."""
        self._seats = [self._seats[agent] for agent in agents]
        self._last = [self._last[agent] for agent in agents]
        self._policy.keep(agents)
        self._observer.keep(agents)

    def step(self) -> list[int]:
        """Step all agents; returns those whose episode has ended."""
        agents = range(len(self._seats))
        observations = [self._transition(agent).observation for agent in agents]
        pose, goal = (
            _stack(observations, key) for key in ("world_from_camera", "pointgoal_with_gps_compass")
        )
        shown = self._observer.observe(_stack(observations, "depth"), pose, goal)
        actions = self._policy.act(shown, self._observer.allowed(pose, goal))
        self._observer.note(actions)
        self._last = [*self._lockstep.step(self._seats, actions)]
        return [agent for agent in agents if self._transition(agent).has_ended]

    def result(self, agent: int) -> dict[str, Any]:
        """What an episode came to."""
        info = self._transition(agent).info or {}
        return {key: info[key] for key in RESULTS}

    def _transition(self, agent: int) -> Transition:
        transition = self._last[agent]
        assert transition is not None, "every agent has been dealt an episode"
        return transition


def make_pointnav(episode: NavigationEpisode, image_px: int) -> PointNavEnv:
    """Make the environment that an episode is played in."""
    return PointNavEnv(
        episode.scene,
        camera={"width_px": image_px, "height_px": image_px},
        forward_step_m=episode.step_m,
        scene_options=dict(episode.scene_options),
    )


def episodes_of(
    scenes: Iterable[str],
    num_episodes: int,
    step_m: float,
    scene_options: Mapping[str, Any] | None = None,
) -> list[NavigationEpisode]:
    """Spread a number of episodes over scenes; the same ones for every navigator."""
    names, options = list(scenes), tuple((scene_options or {}).items())
    shares = [len(part) for part in np.array_split(np.arange(num_episodes), len(names))]
    return [
        NavigationEpisode(name, seed, step_m, options)
        for name, share in zip(names, shares, strict=True)
        for seed in range(share)
    ]


def _stack(observations: Sequence[dict[str, NDArray[Any]]], key: str) -> NDArray[np.float32]:
    return np.stack([observation[key] for observation in observations])
