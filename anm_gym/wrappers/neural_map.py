"""Learn a neural map while an episode goes on."""

from typing import Any, final

import gymnasium
import numpy as np
from gymnasium.utils import RecordConstructorArgs

from anm_gym.envs.mesh_env import Observation
from anm_gym.map.neural_map import NeuralMap
from anm_gym.map.presets import map_settings
from anm_gym.map.settings import MapSettings
from anm_gym.map.update import MapUpdate
from anm_gym.wrappers.needs import require_exploration


@final
class NeuralMapWrapper(
    gymnasium.Wrapper[Observation, np.int64, Observation, np.int64], RecordConstructorArgs
):
    """Train a `NeuralMap` on every observation.

    ## Observation, action, reward, episode end
    Unchanged.

    ## Information
    Adds `is_keyframe` (bool), `map_iterations` (int), and the weighted terms of the map's loss
    `distance_loss`, `eikonal_loss`, `normal_loss` (float). The map itself is reached by
    ``env.get_wrapper_attr("neural_map")``, CPU time by module by ``compute_ms``.

    ## Needs
    Observations of `ANM/Explore-v0`.

    Args:
        env: An exploration environment.
        preset: A preset of `anm_gym.map.presets.map_settings`.
        seed: Seeds the map's weights and draws, together with the seed of `reset`; without one there, each
            episode has a map of its own all the same.
        device: Where the map is trained.
        settings: Effective settings instead of a preset.

    Source:
        Active Neural Mapping, Sec. 4.1.

    Example:
        >>> import gymnasium
        >>> env = gymnasium.make("anm_gym:ANM/Explore-v0", scene="home:studio:0")
        >>> env = NeuralMapWrapper(env, preset="fast")
        >>> observation, info = env.reset(seed=0)
        >>> env.neural_map.sdf(observation["world_from_camera"][None, :3, 3]).shape
        (1,)

    ## Version history
    - v0: first version.
    """

    def __init__(
        self,
        env: gymnasium.Env[Observation, np.int64],
        *,
        preset: str = "best",
        seed: int = 0,
        device: str = "cpu",
        settings: MapSettings | None = None,
    ) -> None:
        RecordConstructorArgs.__init__(self, preset=preset, seed=seed, device=device, settings=settings)
        super().__init__(env)
        require_exploration(env)
        self.settings = settings or map_settings(preset)
        self._seed, self._device = seed, device
        self._map_seeds = np.random.SeedSequence([seed])
        self.neural_map = self._new_map(seed)
        """The map of the current episode."""
        self.updates: list[MapUpdate] = []
        """What each step did to the map."""

    @property
    def compute_ms(self) -> dict[str, float]:
        """Total CPU milliseconds by module of the map."""
        return self.neural_map.stopwatch.compute_ms

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode with an empty map."""
        observation, info = self.env.reset(seed=seed, options=options)
        if seed is None:
            self._map_seeds = self._map_seeds.spawn(1)[0]
        else:
            self._map_seeds = np.random.SeedSequence([self._seed, seed])
        self.neural_map = self._new_map(int(self._map_seeds.generate_state(1)[0]))
        self.updates = []
        return observation, self._learn(observation, info)

    def step(self, action: np.int64) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Act, then learn from what is seen."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        return observation, float(reward), terminated, truncated, self._learn(observation, info)

    def _new_map(self, seed: int) -> NeuralMap:
        return NeuralMap(self.settings, self.get_wrapper_attr("camera"), seed=seed, device=self._device)

    def _learn(self, observation: Observation, info: dict[str, Any]) -> dict[str, Any]:
        update = self.neural_map.integrate(
            observation["depth"][..., 0], observation["world_from_camera"].astype(np.float64)
        )
        self.updates.append(update)
        added = {
            "is_keyframe": update.is_keyframe,
            "map_iterations": update.iterations,
            "distance_loss": update.distance_loss,
            "eikonal_loss": update.eikonal_loss,
            "normal_loss": update.normal_loss,
        }
        return {**info, **added}
