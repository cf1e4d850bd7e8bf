"""Many scenes in one environment: each episode, or each few of them, in another one."""

from collections.abc import Sequence
from typing import Any, Final, final

import gymnasium
import numpy as np
from gymnasium.utils import RecordConstructorArgs

from anm_gym.envs.mesh_env import Observation
from anm_gym.envs.options import read_names

_SCENES: Final = 1
"""Tells the draws of scenes from those of the environment, which has the same seed."""


@final
class ScenesWrapper(gymnasium.Wrapper[Observation, np.int64, Observation, np.int64], RecordConstructorArgs):
    """Draw the scene of an episode from a list.

    ## Observation, action, reward, episode end, information
    Unchanged.

    ## Needs
    An environment whose `reset` takes the option `scene`; a `scene` that is given there goes first.

    Args:
        env: The environment.
        scenes: Names as for `anm_gym.scenes.catalog.make_scene`.
        episodes_each: Episodes in a scene before the next one is drawn: making a scene takes longer
            than many steps. A seed draws anew.

    Raises:
        TypeError: If `scenes` is a single text.
        ValueError: If there are no scenes, or no episodes in each.

    Example:
        >>> env = gymnasium.make("anm_gym:ANM/Explore-v0", scene="home:studio:0")
        >>> env = ScenesWrapper(env, scenes=["home:studio:1", "home:studio:2"])
        >>> observation, info = env.reset(seed=0)
        >>> env.get_wrapper_attr("scene").name in {"home:studio:1", "home:studio:2"}
        True

    ## Version history
    - v0: first version.
    """

    def __init__(
        self, env: gymnasium.Env[Observation, np.int64], *, scenes: Sequence[str], episodes_each: int = 1
    ) -> None:
        names = read_names("scenes", scenes)
        RecordConstructorArgs.__init__(self, scenes=names, episodes_each=episodes_each)
        super().__init__(env)
        if not names or episodes_each < 1:
            raise ValueError(
                "`scenes` must name at least one and `episodes_each` must be >= 1, "
                f"got {len(names)} scenes and {episodes_each}"
            )
        self._scenes, self._episodes_each = names, episodes_each
        self._rng, self._scene, self._num_left = np.random.default_rng(), "", 0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode in the scene whose turn it is."""
        if seed is not None:
            self._rng, self._num_left = np.random.default_rng([_SCENES, seed]), 0
        if options and "scene" in options:
            return self.env.reset(seed=seed, options=options)
        if self._num_left == 0:
            self._scene = self._scenes[self._rng.integers(len(self._scenes))]
            self._num_left = self._episodes_each
        self._num_left -= 1
        return self.env.reset(seed=seed, options={**(options or {}), "scene": self._scene})
