"""The vector form of PointNav: many agents, one call of the renderer per scene."""

from collections.abc import Sequence
from copy import deepcopy
from typing import Any, ClassVar, final

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from anm_gym.envs.lockstep import Lockstep, Transition
from anm_gym.envs.mesh_env import Observation
from anm_gym.envs.options import DEFAULT_SCENE, read_names
from anm_gym.envs.pointnav import PointNavEnv
from anm_gym.registration import POINTNAV_STEPS

Batch = dict[str, NDArray[Any]]


@final
class PointNavVectorEnv(VectorEnv[Batch, NDArray[np.int64], NDArray[Any]]):
    """`ANM/PointNav-v0` for many agents, in one scene or in several.

    ## Description
    Every agent does what it would do alone, bit for bit; only the images are made together. An
    episode that has ended begins anew at the next step, whose action is ignored.

    ## Observation, action, rewards, episode end, information
    Those of `ANM/PointNav-v0`, with a first axis for the agents.

    ## Arguments
    Those of `ANM/PointNav-v0`, and:

    | name | default | meaning |
    |---|---|---|
    | `num_envs` | 1 | number of agents |
    | `scenes` | None | scenes handed out to the agents in turn; None puts all into `scene` |
    | `max_episode_steps` | 500 | steps after which an episode is truncated; None or -1 for never |

    >>> import gymnasium
    >>> envs = gymnasium.make_vec(
    ...     "anm_gym:ANM/PointNav-v0",
    ...     num_envs=2,
    ...     vectorization_mode="vector_entry_point",
    ...     scene="home:studio:0",
    ...     camera={"width_px": 32, "height_px": 32},
    ... )
    >>> observations, info = envs.reset(seed=0)
    >>> observations["depth"].shape
    (2, 32, 32, 1)

    ## Version History
    - v0: first version.
    """

    metadata: ClassVar[dict[str, Any]] = {**PointNavEnv.metadata, "autoreset_mode": AutoresetMode.NEXT_STEP}  # type: ignore[misc]

    def __init__(
        self,
        num_envs: int = 1,
        scene: str = DEFAULT_SCENE,
        *,
        scenes: Sequence[str] | None = None,
        max_episode_steps: int | None = POINTNAV_STEPS,
        render_mode: str | None = None,
        **settings: Any,
    ) -> None:
        if num_envs < 1:
            raise ValueError(f"`num_envs` must be >= 1, got {num_envs}")
        names = read_names("scenes", scenes) if scenes else [scene]
        envs = [
            PointNavEnv(names[index % len(names)], render_mode=render_mode, **settings)
            for index in range(num_envs)
        ]
        self.num_envs, self.render_mode = num_envs, render_mode
        self.single_observation_space = envs[0].observation_space
        self.single_action_space = envs[0].action_space
        self.observation_space = batch_space(envs[0].observation_space, num_envs)
        self.action_space = batch_space(envs[0].action_space, num_envs)
        self._lockstep = Lockstep(envs, max_episode_steps)
        self._has_ended = np.zeros(num_envs, bool)

    @property
    def envs(self) -> tuple[PointNavEnv, ...]:
        """The environments, to look into."""
        return self._lockstep.envs  # type: ignore[return-value]

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Batch, dict[str, Any]]:
        """Begin an episode everywhere.

        Args:
            seed: Seeds of the environments, or a number that is counted up from; None goes on.
            options: Options of `PointNavEnv.reset` for all of them.
        """
        seeds: list[int | None]
        if seed is None or isinstance(seed, Sequence):
            seeds = [None] * self.num_envs if seed is None else list(seed)
        else:
            seeds = [seed + index for index in range(self.num_envs)]
        if len(seeds) != self.num_envs:
            raise ValueError(f"`seed` must have {self.num_envs} numbers, got {len(seeds)}")
        self._has_ended[:] = False
        return self._batch(
            [self._lockstep.reset(index, number, deepcopy(options)) for index, number in enumerate(seeds)]
        )

    def step(
        self, actions: NDArray[np.int64]
    ) -> tuple[Batch, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Step the agents whose episode goes on; begin one where it has ended."""
        actions = np.asarray(actions)
        if actions.shape != (self.num_envs,):
            raise ValueError(f"`actions` must have shape ({self.num_envs},), got {actions.shape}")
        going = np.flatnonzero(~self._has_ended).tolist()
        results = dict(zip(going, self._lockstep.step(going, actions[going]), strict=True))
        for index in np.flatnonzero(self._has_ended).tolist():
            results[index] = self._lockstep.reset(index)
        transitions = [results[index] for index in range(self.num_envs)]
        self._has_ended = np.array([transition.has_ended for transition in transitions])
        observations, info = self._batch(transitions)
        return (
            observations,
            np.array([transition.reward for transition in transitions], np.float64),
            np.array([transition.terminated for transition in transitions]),
            np.array([transition.truncated for transition in transitions]),
            info,
        )

    def render(self) -> tuple[Any, ...] | None:
        """Draw what every environment draws."""
        return tuple(env.render() for env in self.envs)

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Call a method of every environment, or read an attribute; see `gymnasium.vector.SyncVectorEnv`."""
        found = [env.get_wrapper_attr(name) for env in self.envs]
        return tuple(each(*args, **kwargs) if callable(each) else each for each in found)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """Read an attribute of every environment; as there, a method is called."""
        return self.call(name)

    def set_attr(self, name: str, values: Any) -> None:
        """Set an attribute of every environment.

        Args:
            name: Which.
            values: A list or tuple of one value for each, or a single value for all.

        Raises:
            ValueError: If there are not as many values as environments.
        """
        each = list(values) if isinstance(values, list | tuple) else [values] * self.num_envs
        if len(each) != self.num_envs:
            raise ValueError(
                f"`values` must have {self.num_envs} entries, one per environment, got {len(each)}"
            )
        for env, value in zip(self.envs, each, strict=True):
            env.set_wrapper_attr(name, value)

    def _batch(self, transitions: Sequence[Transition]) -> tuple[Batch, dict[str, Any]]:
        info: dict[str, Any] = {}
        for index, transition in enumerate(transitions):
            info = self._add_info(info, transition.info or {}, index)
        return stack_observations([transition.observation for transition in transitions]), info


def stack_observations(observations: Sequence[Observation]) -> Batch:
    """Stack observations of several environments key by key; a first axis is added."""
    return {key: np.stack([observation[key] for observation in observations]) for key in observations[0]}
