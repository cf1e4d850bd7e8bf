import torch
from torch import Tensor, nn

from anm_gym.map.frames import PixelBatch
from anm_gym.map.keyframes import explained_share
from anm_gym.map.settings import KeyframeSettings, SamplingSettings


class Wall(nn.Module):
    """A wall at z = -2, moved by an offset where x > 0."""

    def __init__(self, offset_m: float) -> None:
        super().__init__()
        self.offset_m = offset_m

    def forward(self, points: Tensor) -> Tensor:
        return points[:, 2] + 2.0 + self.offset_m * (points[:, 0] > 0.0)


def frontal_pixels(count: int = 400) -> PixelBatch:
    x = torch.linspace(-0.9, 0.9, count)
    directions = torch.stack([x, torch.zeros(count), -torch.ones(count)], dim=1)
    normals = torch.tensor([0.0, 0.0, 1.0]).expand(count, 3)
    return PixelBatch(
        torch.zeros(count, dtype=torch.int64), torch.full((count,), 2.0), torch.zeros(count, 3),
        directions, normals,
    )  # fmt: skip


def shares(offset_m: float, generator: torch.Generator) -> list[float]:
    return [
        explained_share(
            Wall(offset_m), frontal_pixels(), KeyframeSettings(test=test), SamplingSettings(), generator
        )
        for test in ("render", "surface")
    ]


def test_exact_map_explains_every_ray(generator: torch.Generator) -> None:
    assert shares(0.0, generator) == [1.0, 1.0]


def test_map_with_half_of_the_wall_moved_explains_half(generator: torch.Generator) -> None:
    for share in shares(0.6, generator):
        assert abs(share - 0.5) < 0.05


def test_frame_without_pixels_teaches_nothing(generator: torch.Generator) -> None:
    pixels = frontal_pixels(0)
    share = explained_share(Wall(0.0), pixels, KeyframeSettings(), SamplingSettings(), generator)
    assert share == 1.0
