"""The continually learned signed distance map.

`NeuralMap.integrate` is the paper's mapping step; what the map predicts and how sure it is of that
are asked through `sdf`, `gradient` and `variability`.
"""

from copy import deepcopy
from dataclasses import replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from anm_gym.errors import MapError
from anm_gym.geometry import CameraSpec
from anm_gym.map.cloud import SurfaceCloud
from anm_gym.map.frame_input import checked_frame
from anm_gym.map.frames import FrameStore
from anm_gym.map.hybrid_field import make_field
from anm_gym.map.keyframes import explained_share
from anm_gym.map.losses import LossTerms, distance_bound, map_loss
from anm_gym.map.numerics import (
    flushed_subnormals,
    has_fast_bfloat16,
    usable_device,
    workers_flush_subnormals,
)
from anm_gym.map.occupancy import OccupancyGrid
from anm_gym.map.optimizer_state import load_moments, moments
from anm_gym.map.perturbation import perturbations, variability
from anm_gym.map.sampling import RayBatch, sample_rays
from anm_gym.map.settings import MapSettings, VariabilitySettings
from anm_gym.map.update import MapUpdate
from anm_gym.map.volume import ObservedVolume
from anm_gym.map.zero_crossings import EMPTY, Lattice, ZeroCrossings, zero_crossings_within
from anm_gym.stopwatch import Stopwatch

CLOUD_STRIDE_PX = 2
CHUNK_POINTS = 16384
POSTERIOR_SEED = 0
"""Seeds the draws of `NeuralMap.posterior_std`."""


class NeuralMap:
    """A signed distance network trained on a stream of posed depth images.

    Nothing of the true scene is needed: the encoding is centred on the first camera, the extent of
    every extraction comes from what was observed.

    Args:
        settings: One of `anm_gym.map.presets.PRESETS`, or your own.
        camera: The camera of every frame.
        seed: Seeds the weights and every draw.
        device: Where the network lives, such as ``"cpu"`` or ``"cuda"``.

    Raises:
        ValueError: If there is no such device here.

    Source:
        Active Neural Mapping, Sec. 4.1.

    Example:
        >>> from anm_gym.map.presets import map_settings
        >>> neural_map = NeuralMap(map_settings("fast"), CameraSpec(width_px=32, height_px=32))
        >>> update = neural_map.integrate(np.full((32, 32), 2.0, np.float32), np.eye(4))
        >>> neural_map.sdf(np.zeros((1, 3), np.float32)).shape
        (1,)
    """

    @torch.inference_mode(False)  # else nothing could be learned later
    def __init__(
        self, settings: MapSettings, camera: CameraSpec, *, seed: int = 0, device: str = "cpu"
    ) -> None:
        workers_flush_subnormals()
        self.settings, self.camera, self.device = settings, camera, usable_device(device)
        self.stopwatch = Stopwatch()
        self.num_frames, self.num_keyframes = 0, 0
        self.cloud, self.volume = SurfaceCloud(), ObservedVolume(camera)
        with torch.random.fork_rng(devices=[]):  # layers draw from torch's own generator before we do
            field = make_field(settings.field, torch.Generator().manual_seed(int(seed)))
        self.field = field.to(self.device)
        self.frames = FrameStore(camera, settings.sampling, self.device)
        self._generator = torch.Generator(self.device).manual_seed(int(seed) + 1)
        self._optimizer = torch.optim.AdamW(
            self.field.network.parameters(),
            lr=settings.schedule.learning_rate,
            weight_decay=settings.schedule.weight_decay,
        )
        self._autocast = settings.schedule.bfloat16 and has_fast_bfloat16(self.device)
        self._frozen = deepcopy(self.field)
        self._frames_since_keyframe = 0
        self._weight_change = torch.zeros_like(self._weights())
        self._occupancy: OccupancyGrid | None = None

    @torch.inference_mode(False)
    def __deepcopy__(self, memo: dict[int, Any]) -> "NeuralMap":
        memo[id(self)] = copied = self.__class__.__new__(self.__class__)
        vars(copied).update({name: deepcopy(value, memo) for name, value in vars(self).items()})
        return copied

    @property
    def occupancy(self) -> OccupancyGrid:
        """The top-down log of free and occupied floor.

        Raises:
            MapError: Before the first frame.
        """
        if self._occupancy is None:
            raise MapError("the map must have seen a frame; call `integrate` first")
        return self._occupancy

    @torch.inference_mode(False)
    @torch.enable_grad()
    def integrate(self, depth_m: NDArray[np.float32], world_from_camera: NDArray[np.floating]) -> MapUpdate:
        """Learn from one posed depth image.

        Args:
            depth_m: (H, W) or (H, W, 1) float32 planar depth, metres; 0 is empty.
            world_from_camera: (4, 4) pose.

        Returns:
            What was done, with the loss terms of the last iteration.

        Raises:
            ValueError: If the image does not fit the camera or is not in metres, or the pose is not rigid or
                not level; the map is as it was.

        Source:
            Active Neural Mapping, Sec. 4.1, Eq. 3.
        """
        depth_m, world_from_camera = checked_frame(depth_m, world_from_camera, self.camera)
        with self.stopwatch("observe"):
            is_keyframe = self._admit(depth_m, world_from_camera)
            self._log(depth_m, world_from_camera)
        with self.stopwatch("learn"), flushed_subnormals():
            before, done, terms = self._begin_update(), 0, None
            for _ in range(self._iterations(is_keyframe)):
                window = self.frames.window(self._generator)
                rays = self._draw_rays(window)
                if len(rays.points):
                    bound = self._bound(rays)
                    terms = self._loss(rays, bound, is_keyframe)
                    self._descend(terms)
                    self._show(rays, bound)
                    self.frames.record_losses(window, rays.pixels.slots[: len(terms.per_ray)], terms.per_ray)
                    done += 1
            self._fill_in()
            self._weight_change = self._weights() - before
            if is_keyframe or self.num_frames == 1:
                self._frozen.load_state_dict(self.field.state_dict())
        return MapUpdate.of(is_keyframe, done, terms)

    def sdf(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """Predict the signed distance of (N, 3) points, (N,) float32 metres, positive in free space."""
        with torch.no_grad(), flushed_subnormals(), self._precision():
            chunks = self._tensor(points).split(CHUNK_POINTS)
            return np.concatenate([_array(self.field(chunk)) for chunk in chunks])

    @torch.inference_mode(False)
    @torch.enable_grad()
    def gradient(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """Differentiate the signed distance at (N, 3) points, (N, 3) float32, not normalised."""
        gradients = []
        for chunk in self._tensor(points).split(CHUNK_POINTS):
            (gradient,) = torch.autograd.grad(self.field(chunk.requires_grad_()).sum(), chunk)
            gradients.append(_array(gradient))
        return np.concatenate(gradients)

    def variability(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """Score (N, 3) points by their neural variability, (N,) float32; see `anm_gym.map.perturbation`.

        It draws from the map's own generator, so that what is learned afterwards depends on how often it was
        asked; ask a `deepcopy` of the map, or `posterior_std`, where nothing may change.

        Source:
            Active Neural Mapping, Sec. 4.2, Eq. 4.
        """
        return self._variability(points, self.settings.variability, self._generator)

    def posterior_std(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """Standard deviation of predictions at (N, 3) points by the Laplace family, (N,) float32 metres.

        Its draws are its own, so that asking changes nothing that the map learns later.
        """
        settings = replace(self.settings.variability, family="laplace", draws=128, statistic="variance")
        generator = torch.Generator(self.device).manual_seed(POSTERIOR_SEED)
        return np.sqrt(self._variability(points, settings, generator))

    def mesh(self, voxel_m: float = 0.06, crop_m: float = 0.25) -> ZeroCrossings:
        """Reconstruct the scene: zero-crossings within `crop_m` of an observed point that are well known.

        Args:
            voxel_m: Spacing of the lattice, metres.
            crop_m: Farthest from an observed point, metres.

        Raises:
            ValueError: If `voxel_m` is not positive or `crop_m` negative.
        """
        if not (voxel_m > 0.0 and crop_m >= 0.0):
            raise ValueError(f"`voxel_m` must be > 0 and `crop_m` >= 0, got {voxel_m} and {crop_m}")
        if len(self.cloud) == 0:
            return EMPTY
        diagonal_m = np.sqrt(3.0) * voxel_m
        margin_m = crop_m + diagonal_m
        lattice = Lattice.with_spacing(self.cloud.bounds() + np.array([[-margin_m], [margin_m]]), voxel_m)
        surface = zero_crossings_within(self.sdf, lattice, lattice.near(self.cloud.points, margin_m))
        kept = self.cloud.distance_of(surface.vertices) <= crop_m
        limit_m = self.settings.reconstruction_std_m
        if limit_m is not None and kept.any():
            kept[kept] = self.posterior_std(surface.vertices[kept]) <= limit_m
        return surface.keep_vertices(kept, whole_faces=False)

    @torch.inference_mode(False)
    def state(self) -> dict[str, Tensor]:
        """Copies of the tensors from which `load_state` restores the map, all but its occupancy grid."""
        parts = {
            "field": self.field.state_dict(),
            "frozen": self._frozen.state_dict(),
            "frames": self.frames.state(),
            "optimizer": moments(self._optimizer, self.field.network),
        }
        flat = {f"{part}.{name}": tensor for part, state in parts.items() for name, tensor in state.items()}
        counts = [self.num_frames, self.num_keyframes, self._frames_since_keyframe]
        others = {
            "cloud": torch.from_numpy(self.cloud.points),
            "volume.states": torch.from_numpy(self.volume.states),
            "volume.low_index": torch.from_numpy(self.volume.low_index),
            "weight_change": self._weight_change,
            "generator": self._generator.get_state(),
            "counts": torch.tensor(counts),
        }
        return _copies(flat | others)

    @torch.inference_mode(False)
    def load_state(self, state: dict[str, Tensor]) -> None:
        """Restore what `state` returned; the occupancy grid begins anew with the next frame.

        Raises:
            KeyError: If a tensor is missing.
            RuntimeError: If a tensor has another shape.
        """
        state = _copies(state)
        self.field.load_state_dict(_part(state, "field"))
        self._frozen.load_state_dict(_part(state, "frozen"))
        self.frames.load_state(_part(state, "frames"))
        load_moments(self._optimizer, self.field.network, _part(state, "optimizer"))
        self.cloud.restore(state["cloud"].cpu().numpy())
        self.volume.states = state["volume.states"].cpu().numpy()
        self.volume.low_index = state["volume.low_index"].cpu().numpy()
        self._weight_change = state["weight_change"]
        saved = state["generator"].cpu()
        if len(saved) == len(self._generator.get_state()):  # another kind of device has another generator
            self._generator.set_state(saved)
        self.num_frames, self.num_keyframes, self._frames_since_keyframe = state["counts"].tolist()
        self._occupancy = None

    def _variability(
        self, points: NDArray[np.floating], settings: VariabilitySettings, generator: torch.Generator
    ) -> NDArray[np.float32]:
        evidence = self._evidence(settings.evidence_points, generator)
        draws = perturbations(self.field, settings, self._weight_change, evidence, generator)
        return _array(variability(self.field, self._tensor(points), draws, settings, self._weight_change))

    def _admit(self, depth_m: NDArray[np.float32], world_from_camera: NDArray[np.floating]) -> bool:
        """Store the frame; it replaces the last one unless that one has become a keyframe."""
        depth = torch.as_tensor(depth_m, device=self.device).reshape(self.camera.height_px, -1)
        pose = torch.as_tensor(world_from_camera, dtype=torch.float32, device=self.device)
        if self.num_frames == 0:
            self.field.network.encoding.center_m.copy_(pose[:3, 3])
        is_keyframe = self.num_frames > 0 and self._explains_too_little()
        if is_keyframe or self.num_frames == 0:
            self.frames.append(depth, pose)
            self._frames_since_keyframe = 0
        else:
            self.frames.replace_last(depth, pose)
            self._frames_since_keyframe += 1
        self.num_keyframes += is_keyframe
        self.num_frames += 1
        return is_keyframe

    def _explains_too_little(self) -> bool:
        """Ask the copy frozen at the last keyframe how much of the last stored frame it knew."""
        settings = self.settings.keyframes
        if self._frames_since_keyframe >= settings.max_interval:
            return True
        last = torch.tensor([len(self.frames) - 1], device=self.device)
        pixels = self.frames.sample_pixels(last, settings.rays, self._generator)
        share = explained_share(self._frozen, pixels, settings, self.settings.sampling, self._generator)
        return share < settings.explained_share

    def _log(self, depth_m: NDArray[np.float32], world_from_camera: NDArray[np.floating]) -> None:
        """Keep what the frame shows beside the network: cloud, volume and floor."""
        if self._occupancy is None:
            self._occupancy = OccupancyGrid.below(self.camera, world_from_camera)
        self._occupancy.integrate(depth_m.reshape(self.camera.height_px, -1), self.camera, world_from_camera)
        self.volume.integrate(depth_m, world_from_camera)
        self.cloud.add(_array(self.frames.points(len(self.frames) - 1, CLOUD_STRIDE_PX)))

    def _iterations(self, is_keyframe: bool) -> int:
        schedule = self.settings.schedule
        if self.num_frames == 1:
            return schedule.first_iterations
        return schedule.keyframe_iterations if is_keyframe else schedule.iterations

    def _draw_rays(self, window: Tensor) -> RayBatch:
        """Draw pixels from each frame of a window and points along their rays."""
        sampling = self.settings.sampling
        pixels = self.frames.sample_pixels(window, sampling.rays_of_each(len(window)), self._generator)
        return sample_rays(pixels, sampling, self._generator)

    def _fill_in(self) -> None:
        """Show the grids those pixels of the newest frame whose surface the finest of them knows least."""
        sampling, grids = self.settings.sampling, self.field.grids()
        if not grids:
            return
        newest = torch.tensor([len(self.frames) - 1], device=self.device)
        drawn = sampling.fill_in_candidates * sampling.fill_in_rays
        pixels = self.frames.sample_pixels(newest, drawn, self._generator)
        known = grids[-1].known_share(grids[-1].corners(pixels.surface))
        least = known.topk(min(sampling.fill_in_rays, len(known)), largest=False).indices
        rays = sample_rays(pixels.take(least), replace(sampling, stratified=0), self._generator)
        self._show(rays, self._bound(rays))

    def _bound(self, rays: RayBatch) -> Tensor:
        return distance_bound(rays, self.settings.loss.distance_target, self.cloud.distance)

    def _show(self, rays: RayBatch, bound: Tensor) -> None:
        self.field.observe(rays.points.reshape(-1, 3), bound.reshape(-1))

    def _loss(self, rays: RayBatch, bound: Tensor, is_keyframe: bool) -> LossTerms:
        """Loss of the network on its share of the rays."""
        settings, schedule = self.settings.loss, self.settings.schedule
        count = max(1, round(settings.network_share * len(bound)))
        rays, bound = rays.first(count), bound[:count]
        std = schedule.keyframe_output_noise if is_keyframe else schedule.output_noise
        noise = None
        if std > 0.0:
            noise = std * torch.randn(bound.shape, generator=self._generator, device=self.device)
        with self._precision():
            return map_loss(self.field.network, rays, bound, settings, noise, self._dropout)

    @property
    def _dropout(self) -> torch.Generator | None:
        return self._generator if self.settings.field.dropout > 0.0 else None

    def _descend(self, terms: LossTerms) -> None:
        self._optimizer.zero_grad(set_to_none=True)
        terms.total.backward()
        self._optimizer.step()

    def _precision(self) -> torch.autocast:
        return torch.autocast(self.device.type, torch.bfloat16, enabled=self._autocast)

    @torch.no_grad()
    def _evidence(self, count: int, generator: torch.Generator) -> Tensor:
        """Draw observed surface points from all stored frames, (E, 3)."""
        everything = torch.arange(len(self.frames), device=self.device)
        per_frame = -(-count // max(1, len(self.frames)))
        return self.frames.sample_pixels(everything, per_frame, generator).surface[:count]

    def _begin_update(self) -> Tensor:
        """Return the network's weights, and let the grids count their changes from here."""
        for grid in self.field.grids():
            grid.begin_update()
        return self._weights()

    def _weights(self) -> Tensor:
        return torch.nn.utils.parameters_to_vector(self.field.network.parameters()).detach()

    def _tensor(self, points: NDArray[np.floating]) -> Tensor:
        points = np.asarray(points)
        if points.ndim != 2 or points.shape[1] != 3:
            raise ValueError(f"`points` must have shape (N, 3), got {points.shape}")
        return torch.from_numpy(np.array(points, np.float32)).to(self.device)


def _part(state: dict[str, Tensor], name: str) -> dict[str, Tensor]:
    """The tensors of one part, without its name."""
    prefix = name + "."
    return {key.removeprefix(prefix): tensor for key, tensor in state.items() if key.startswith(prefix)}


def _copies(state: dict[str, Tensor]) -> dict[str, Tensor]:
    """The same tensors, sharing no memory."""
    return {name: tensor.detach().clone() for name, tensor in state.items()}


def _array(tensor: Tensor) -> NDArray[np.float32]:
    return np.asarray(tensor.detach().cpu().numpy(), np.float32)
