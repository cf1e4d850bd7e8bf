"""Watch the neural map while an episode goes on, without disturbing it.

`train.recorder` scores an episode; this recorder hands every step to traces, each of which gathers what one
figure needs.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Protocol

import gymnasium as gym
import numpy as np
import torch
from numpy.typing import NDArray
from scipy import ndimage
from torch import Tensor, nn

from anm_gym.geometry import CameraSpec, heading_of
from anm_gym.map.frames import FrameStore, PixelBatch
from anm_gym.map.losses import distance_bound, distance_loss
from anm_gym.map.neural_map import NeuralMap
from anm_gym.map.numerics import flushed_subnormals
from anm_gym.map.sampling import RayBatch, sample_rays
from anm_gym.map.volume import UNKNOWN
from anm_gym.map.zero_crossings import Lattice, SignedDistance, ZeroCrossings, zero_crossings_within
from anm_gym.scenes.scene import Scene
from train.runner import Recorder

CHUNK_POINTS: Final = 16384
REACH_M: Final = 1.0
"""How far into unseen space predicted surface is followed, metres, as far as the view planner does."""
BELOW_M: Final = 0.4
"""How far under the floor and over the ceiling it is followed, metres."""

Numbers = dict[str, Any]
"""Plain values and arrays by name."""


@dataclass(frozen=True, eq=False)
class Moment:
    """The state of an episode after a step; step 0 is the first look, before any action."""

    step: int
    """Actions taken so far."""
    env: gym.Env
    """The agent's environment with its wrappers."""
    policy: Any
    """The agent's policy."""
    observation: dict[str, Any]
    """What the step showed."""
    info: dict[str, Any]
    """The step's `info`."""

    @property
    def neural_map(self) -> NeuralMap:
        """The map as it goes on learning; ask a `still_copy` whatever draws or caches."""
        neural_map = self.env.get_wrapper_attr("neural_map")
        assert isinstance(neural_map, NeuralMap)
        return neural_map

    @property
    def scene(self) -> Scene:
        """The true scene."""
        scene = self.env.get_wrapper_attr("scene")
        assert isinstance(scene, Scene)
        return scene

    @property
    def camera(self) -> CameraSpec:
        """The agent's camera."""
        camera = self.env.get_wrapper_attr("camera")
        assert isinstance(camera, CameraSpec)
        return camera

    @property
    def pose(self) -> NDArray[np.float64]:
        """(4, 4) `world_from_camera`."""
        return np.asarray(self.observation["world_from_camera"], np.float64)

    @property
    def heading_rad(self) -> float:
        """Where the agent looks, radians."""
        return heading_of(self.pose)


class Drawing(Protocol):
    """A figure that is ready to be drawn."""

    def numbers(self) -> Numbers:
        """Plain values and arrays behind the picture."""
        ...

    def draw(self, path: Path) -> Path:
        """Write the PNG."""
        ...


class Trace(ABC):
    """What one figure gathers during an episode."""

    @abstractmethod
    def take(self, moment: Moment) -> None:
        """Take note of a moment; called once for step 0 and after every step."""

    @abstractmethod
    def finish(self, moment: Moment) -> Drawing:
        """Make the figure of what was gathered, given the last moment."""


class MapProbe(Recorder):
    """Hand every moment of an episode to traces."""

    def __init__(
        self, traces: Sequence[Trace], policy: Any, progress: Callable[[Moment], None] | None = None
    ) -> None:
        """Listen to one episode.

        Args:
            traces: Each is given every moment, in this order.
            policy: The agent's policy, part of every moment.
            progress: Told after each step.
        """
        self._traces, self._policy, self._progress = traces, policy, progress
        self._last: Moment | None = None

    @property
    def last(self) -> Moment:
        """The latest moment."""
        assert self._last is not None
        return self._last

    def start(self, env: gym.Env, observation: Any, info: dict[str, Any]) -> None:
        """Hand on the first look."""
        self._hand_on(Moment(0, env, self._policy, observation, info))

    def step(self, action: int, observation: Any, info: dict[str, Any]) -> None:  # noqa: ARG002
        """Hand on what a step led to."""
        last = self.last
        self._hand_on(Moment(last.step + 1, last.env, self._policy, observation, info))
        if self._progress is not None:
            self._progress(self.last)

    def _hand_on(self, moment: Moment) -> None:
        self._last = moment
        for trace in self._traces:
            trace.take(moment)


def still_copy(neural_map: NeuralMap) -> NeuralMap:
    """Copy a map, so that whatever is asked of the copy leaves the episode as it would have been."""
    return deepcopy(neural_map)


def frozen(field: nn.Module) -> nn.Module:
    """Copy a field, or the network in it, as it is now."""
    return deepcopy(field).requires_grad_(False)


@torch.no_grad()
def predict(field: Callable[[Tensor], Tensor], points: Tensor) -> Tensor:
    """Predict the signed distance of (N, 3) points with a field, (N,) float32 metres, at full precision."""
    with flushed_subnormals():
        return torch.cat([field(chunk).float() for chunk in points.split(CHUNK_POINTS)])


def surface_around_observed(
    neural_map: NeuralMap, voxel_m: float, sdf: SignedDistance | None = None, reach_m: float = REACH_M
) -> ZeroCrossings:
    """Extract the predicted surface of the observed space and of what lies around it, unseen.

    Args:
        neural_map: A map that has seen at least one frame.
        voxel_m: Spacing of the lattice, metres.
        sdf: What predicts, if not the map as a whole.
        reach_m: How far into unseen space zero-crossings are followed, metres.

    Returns:
        The zero-crossings.
    """
    margin = np.array([reach_m, BELOW_M, reach_m])
    bounds = neural_map.cloud.bounds(0.001) + np.stack([-margin, margin])
    lattice = Lattice.with_spacing(bounds, voxel_m)
    is_seen = (neural_map.volume.state_at(lattice.points) != UNKNOWN).reshape(lattice.shape)
    nearby = ndimage.binary_dilation(is_seen, iterations=round(reach_m / voxel_m))
    return zero_crossings_within(sdf or neural_map.sdf, lattice, nearby)


def draw_rays(frames: FrameStore, index: int, rays: int, seed: int) -> RayBatch:
    """Sample rays of one stored frame, always the same for a seed.

    Args:
        frames: The stored frames.
        index: Which one.
        rays: Pixels drawn; those without depth or normal drop out.
        seed: Seeds pixels and samples.
    """
    generator = torch.Generator(frames.device).manual_seed(seed)
    window = torch.tensor([index], device=frames.device)
    return sample_rays(frames.sample_pixels(window, rays, generator), frames.sampling, generator)


def join_rays(batches: Sequence[RayBatch]) -> RayBatch:
    """Join batches of rays in their order."""
    pixels = [batch.pixels for batch in batches]
    joined = PixelBatch(
        slots=torch.cat([each.slots for each in pixels]),
        depth_m=torch.cat([each.depth_m for each in pixels]),
        origins=torch.cat([each.origins for each in pixels]),
        directions=torch.cat([each.directions for each in pixels]),
        normals=torch.cat([each.normals for each in pixels]),
    )
    return RayBatch(
        joined,
        torch.cat([batch.points for batch in batches]),
        torch.cat([batch.ray_bound_m for batch in batches]),
    )


def ray_loss(neural_map: NeuralMap, rays: RayBatch, prediction: Tensor) -> float:
    """Mean distance loss of predictions on rays, against what is known of the surface now.

    Args:
        neural_map: Its settings say what is supervised how; its cloud is the surface seen so far.
        rays: (R, S) samples.
        prediction: (R * S,) signed distances at `rays.points`, metres.

    Returns:
        The loss; not a number if there is no ray.

    Source:
        Active Neural Mapping, Sec. 4.1: the distance term of the map's loss, without the gradient terms.
    """
    settings = neural_map.settings.loss
    bound = distance_bound(rays, settings.distance_target, neural_map.cloud.distance)
    return float(distance_loss(prediction.reshape(bound.shape), bound, settings).mean())
