"""PointNav as a vectorised environment of Stable-Baselines3: images of all agents are made together."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any, final

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env.base_vec_env import VecEnv, VecEnvObs, VecEnvStepReturn

from anm_gym.envs.lockstep import Lockstep
from anm_gym.envs.pointnav import PointNavEnv
from anm_gym.envs.pointnav_vector import stack_observations

Options = Callable[[int], dict[str, Any] | None]


@final
class PointNavVecEnv(VecEnv):
    """Many agents; every one does what it would do alone under a `TimeLimit`, bit for bit.

    As Stable-Baselines3 has it, an episode begins in the step that ends the one before, whose last
    observation is in `info["terminal_observation"]`.

    Args:
        envs: Bare environments with the same spaces; steps and cameras may differ in other ways.
        max_episode_steps: Steps after which an episode is truncated, for all or for each; None for never.
        options_of: Gives the options of `PointNavEnv.reset` for the next episode of an environment.

    Raises:
        ValueError: If there is no environment.

    Example:
        >>> venv = PointNavVecEnv([PointNavEnv("home:studio:0", camera={"width_px": 16, "height_px": 16})])
        >>> venv.reset()["depth"].shape
        (1, 16, 16, 1)
    """

    def __init__(
        self,
        envs: Sequence[PointNavEnv],
        max_episode_steps: int | Sequence[int] | None = None,
        options_of: Options | None = None,
    ) -> None:
        if not envs:
            raise ValueError("`envs` must have at least one environment, got none")
        self.render_mode = envs[0].render_mode
        self.envs: tuple[PointNavEnv, ...] = tuple(envs)
        self._lockstep = Lockstep(envs, max_episode_steps)
        self._options_of = options_of
        self._everyone = range(len(envs))
        super().__init__(len(envs), envs[0].observation_space, envs[0].action_space)

    def reset(self) -> VecEnvObs:
        """Begin an episode everywhere, with the seeds and options that were set."""
        observations = []
        for index in self._everyone:
            options = self._options[index] or self._next_options(index)
            transition = self._lockstep.reset(index, self._seeds[index], options)
            self.reset_infos[index] = transition.info or {}
            observations.append(transition.observation)
        self._reset_seeds()
        self._reset_options()
        return stack_observations(observations)

    def step_async(self, actions: NDArray[np.integer]) -> None:
        """Take the actions; `step_wait` carries them out."""
        self._actions = np.asarray(actions).reshape(-1)

    def step_wait(self) -> VecEnvStepReturn:
        """Step everywhere; begin an episode where one has ended."""
        transitions = self._lockstep.step(self._everyone, self._actions)
        observations = [transition.observation for transition in transitions]
        infos = [dict(transition.info or {}) for transition in transitions]
        for index, transition in enumerate(transitions):
            infos[index]["TimeLimit.truncated"] = transition.truncated and not transition.terminated
            if transition.has_ended:
                infos[index]["terminal_observation"] = observations[index]
                first = self._lockstep.reset(index, options=self._next_options(index))
                observations[index], self.reset_infos[index] = first.observation, first.info or {}
        rewards = np.array([transition.reward for transition in transitions], np.float32)
        dones = np.array([transition.has_ended for transition in transitions])
        return stack_observations(observations), rewards, dones, infos

    def close(self) -> None:
        """Do nothing: there are no processes."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Read an attribute of some environments."""
        return [getattr(env, attr_name) for env in self._chosen(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of some environments."""
        for env in self._chosen(indices):
            setattr(env, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Call a method of some environments."""
        return [getattr(env, method_name)(*args, **kwargs) for env in self._chosen(indices)]

    def env_is_wrapped(self, wrapper_class: type[Any], indices: Any = None) -> list[bool]:  # noqa: ARG002 - none is
        """Tell that the environments are bare."""
        return [False for _ in self._chosen(indices)]

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """Draw every environment."""
        return [env.render() for env in self.envs]

    def _next_options(self, index: int) -> dict[str, Any] | None:
        return None if self._options_of is None else self._options_of(index)

    def _chosen(self, indices: int | Iterable[int] | None) -> list[PointNavEnv]:
        return [self.envs[index] for index in self._get_indices(indices)]
