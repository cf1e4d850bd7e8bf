"""Posed depth frames kept for training: the newest ones and the keyframes that are replayed."""

from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor

from anm_gym.errors import MapError
from anm_gym.geometry import CameraSpec
from anm_gym.map.settings import SamplingSettings

MIN_IMAGE_PX: Final = 3
"""Pixels along each side of the smallest image that has normals."""


@dataclass(frozen=True)
class PixelBatch:
    """Pixels drawn from several frames; R of them had a valid depth and normal."""

    slots: Tensor
    """(R,) int64 position of each pixel's frame in the window."""
    depth_m: Tensor
    """(R,) float32 planar depth, metres."""
    origins: Tensor
    """(R, 3) float32 camera centres, metres, world frame."""
    directions: Tensor
    """(R, 3) float32 rays scaled to unit depth, world frame."""
    normals: Tensor
    """(R, 3) float32 unit surface normals towards the camera, world frame."""

    def first(self, count: int) -> "PixelBatch":
        """The first pixels."""
        return self.take(slice(count))

    def take(self, chosen: Tensor | slice) -> "PixelBatch":
        """Some of the pixels."""
        columns = (self.slots, self.depth_m, self.origins, self.directions, self.normals)
        return PixelBatch(*(column[chosen] for column in columns))

    @property
    def surface(self) -> Tensor:
        """(R, 3) float32 observed surface points, metres, world frame."""
        return self.origins + self.directions * self.depth_m[:, None]


class FrameStore:
    """Frames of one episode; the last one is provisional until the next keyframe.

    Args:
        camera: The camera of every frame.
        sampling: Depth limits and the window.
        device: Where the frames are kept.
    """

    def __init__(self, camera: CameraSpec, sampling: SamplingSettings, device: torch.device) -> None:
        if min(camera.height_px, camera.width_px) < MIN_IMAGE_PX:
            raise ValueError(
                f"`camera` must have at least {MIN_IMAGE_PX} x {MIN_IMAGE_PX} pixels, as normals are "
                f"differences of neighbours, got {camera.height_px} x {camera.width_px}"
            )
        self.camera, self.sampling, self.device = camera, sampling, device
        self._directions = torch.tensor(camera.directions, device=device).reshape(-1, 3)
        self._depths = torch.zeros((4, camera.height_px * camera.width_px), device=device)
        self._poses = torch.zeros((4, 4, 4), device=device)
        self._losses = torch.zeros(4, device=device)
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def append(self, depth_m: Tensor, world_from_camera: Tensor) -> None:
        """Keep the frame before this one and add this one.

        Args:
            depth_m: (H, W) float32 planar depth, metres; 0 is empty.
            world_from_camera: (4, 4) float32 pose.
        """
        if self._count == len(self._depths):
            self._grow()
        self._count += 1
        self.replace_last(depth_m, world_from_camera)

    def replace_last(self, depth_m: Tensor, world_from_camera: Tensor) -> None:
        """Put a frame in the place of the last one; arguments as in `append`."""
        settings, flat = self.sampling, depth_m.reshape(-1)
        valid = (flat >= settings.min_depth_m) & (flat <= settings.max_depth_m)
        last = self._count - 1
        self._depths[last] = torch.where(valid, flat, 0.0)
        self._poses[last] = world_from_camera
        self._losses[last] = self._losses[:last].mean() if last else 1.0

    def record_losses(self, window: Tensor, slots: Tensor, per_ray: Tensor) -> None:
        """Remember each frame's mean loss for weighted replay.

        Args:
            window: (K,) int64 frames of the iteration.
            slots: (R,) int64 frame of each ray, as a position in the window.
            per_ray: (R,) float32 losses.
        """
        zeros = torch.zeros(len(window), device=self.device)
        rays = zeros.index_add(0, slots, torch.ones_like(per_ray))
        means = zeros.index_add(0, slots, per_ray) / rays.clamp(min=1.0)
        self._losses[window] = torch.where(rays > 0.0, means, self._losses[window])

    def window(self, generator: torch.Generator) -> Tensor:
        """Draw the frames of one iteration: the two newest and replayed ones.

        Returns:
            (K,) int64 indices, K at most `window_frames`.

        Raises:
            MapError: If there is no frame.

        Source:
            iSDF's replay, as used by Active Neural Mapping, Sec. 4.1.
        """
        if self._count == 0:
            raise MapError("no keyframe to replay; call `integrate` with a first frame")
        size = self.sampling.window_frames
        if self._count <= (2 if self.sampling.replay == "none" else size):
            return torch.arange(self._count, device=self.device)
        newest = torch.arange(self._count - 2, self._count, device=self.device)
        if self.sampling.replay == "none":
            return newest
        weights = self._losses[: self._count - 2].clamp(min=1e-6)
        if self.sampling.replay == "uniform":
            weights = torch.ones_like(weights)
        replayed = torch.multinomial(weights, size - 2, generator=generator)
        return torch.cat([replayed, newest])

    def sample_pixels(self, window: Tensor, rays_per_frame: int, generator: torch.Generator) -> PixelBatch:
        """Draw pixels uniformly from each frame of a window; those without depth or normal drop out.

        The frames take turns, so that any leading share of the batch holds all of them evenly.
        """
        count = len(window)
        pixels = torch.randint(
            self._depths.shape[1], (rays_per_frame, count), generator=generator, device=self.device
        )
        slots = torch.arange(count, device=self.device).expand_as(pixels)
        frames = window[slots]
        depth = self._depths[frames, pixels]
        normals, has_normal = self._camera_normals(frames, pixels, depth)
        kept = torch.nonzero((has_normal & (depth > 0.0)).reshape(-1))[:, 0]
        poses = self._poses[frames.reshape(-1)[kept]]
        directions = self._directions[pixels.reshape(-1)[kept]]
        return PixelBatch(
            slots=slots.reshape(-1)[kept],
            depth_m=depth.reshape(-1)[kept],
            origins=poses[:, :3, 3],
            directions=torch.einsum("nij,nj->ni", poses[:, :3, :3], directions),
            normals=torch.einsum("nij,nj->ni", poses[:, :3, :3], normals.reshape(-1, 3)[kept]),
        )

    def points(self, index: int, stride: int) -> Tensor:
        """Back-project every `stride`-th row and column of a frame, (N, 3) float32 metres, world frame."""
        height, width = self.camera.height_px, self.camera.width_px
        depth = self._depths[index].reshape(height, width)[::stride, ::stride].reshape(-1, 1)
        rays = self._directions.reshape(height, width, 3)[::stride, ::stride].reshape(-1, 3)
        seen = depth[:, 0] > 0.0
        pose = self._poses[index]
        return (rays[seen] * depth[seen]) @ pose[:3, :3].T + pose[:3, 3]

    def state(self) -> dict[str, Tensor]:
        """The store's own tensors, not copies, from which `load_state` restores another."""
        return {
            "depths": self._depths[: self._count],
            "poses": self._poses[: self._count],
            "losses": self._losses[: self._count],
        }

    def load_state(self, state: dict[str, Tensor]) -> None:
        """Restore what `state` returned; the tensors become the store's own.

        Raises:
            MapError: If the depth images do not fit the camera.
        """
        depths = state["depths"].to(self.device)
        expected = self.camera.height_px * self.camera.width_px
        if depths.ndim != 2 or depths.shape[1] != expected:
            raise MapError(f"stored frames must have {expected} pixels, got shape {tuple(depths.shape)}")
        self._depths, self._count = depths, len(depths)
        self._poses = state["poses"].to(self.device)
        self._losses = state["losses"].to(self.device)

    def _camera_normals(self, frames: Tensor, pixels: Tensor, depth: Tensor) -> tuple[Tensor, Tensor]:
        """Cross the shorter horizontal with the shorter vertical difference of neighbouring points."""
        height, width, reach = self.camera.height_px, self.camera.width_px, 2
        row, column = pixels // width, pixels % width
        center = self._directions[pixels] * depth[..., None]

        def difference(d_row: int, d_column: int) -> tuple[Tensor, Tensor]:
            other_row, other_column = row + d_row, column + d_column
            inside = (other_row >= 0) & (other_row < height) & (other_column >= 0) & (other_column < width)
            other = other_row.clamp(0, height - 1) * width + other_column.clamp(0, width - 1)
            other_depth = self._depths[frames, other]
            edge = self._directions[other] * other_depth[..., None] - center
            length = torch.where(inside & (other_depth > 0.0), edge.norm(dim=-1), torch.inf)
            return edge, length

        def shorter(d_row: int, d_column: int) -> tuple[Tensor, Tensor]:
            ahead, ahead_length = difference(d_row, d_column)
            behind, behind_length = difference(-d_row, -d_column)
            first = (ahead_length <= behind_length)[..., None]
            return torch.where(first, ahead, -behind), torch.minimum(ahead_length, behind_length)

        right, right_length = shorter(0, reach)
        down, down_length = shorter(reach, 0)
        normal = torch.linalg.cross(down, right)
        length = normal.norm(dim=-1, keepdim=True)
        facing_away = (normal * self._directions[pixels]).sum(-1, keepdim=True) > 0.0
        normal = torch.where(facing_away, -normal, normal) / length.clamp(min=1e-12)
        return normal, torch.isfinite(right_length + down_length) & (length[..., 0] > 1e-12)

    def _grow(self) -> None:
        more = max(4, len(self._depths))

        def grown(rows: Tensor) -> Tensor:
            return torch.cat([rows, rows.new_zeros((more, *rows.shape[1:]))])

        self._depths, self._poses, self._losses = grown(self._depths), grown(self._poses), grown(self._losses)
