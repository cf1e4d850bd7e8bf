"""The residual network of DD-PPO: half width, group normalisation."""

from typing import Final, final

import torch
from torch import Tensor, nn

GROUPS: Final = 16
"""Groups of the normalisation (DD-PPO)."""
EXPANSION: Final = 4
"""Output channels of a bottleneck per inner channel."""
BLOCKS: Final = {"resnet18": (2, 2, 2, 2), "resnet50": (3, 4, 6, 3)}
"""Blocks of the four stages."""
COMPRESSED_SIZE: Final = 2048
"""Numbers that an image is compressed to before the last linear layer."""


@final
class Bottleneck(nn.Module):
    """1 x 1, 3 x 3 and 1 x 1 convolutions beside a shortcut."""

    def __init__(self, channels: int, inner: int, stride: int) -> None:
        super().__init__()
        outer = EXPANSION * inner
        self.body = nn.Sequential(
            *_conv_norm(channels, inner, 1),
            nn.ReLU(),
            *_conv_norm(inner, inner, 3, stride),
            nn.ReLU(),
            *_conv_norm(inner, outer, 1),
        )
        is_same = stride == 1 and channels == outer
        self.shortcut = nn.Identity() if is_same else nn.Sequential(*_conv_norm(channels, outer, 1, stride))

    def forward(self, values: Tensor) -> Tensor:
        """Map (B, C, H, W) to (B, 4 * inner, H / stride, W / stride)."""
        return torch.relu(self.body(values) + self.shortcut(values))


@final
class BasicBlock(nn.Module):
    """Two 3 x 3 convolutions beside a shortcut."""

    def __init__(self, channels: int, inner: int, stride: int) -> None:
        super().__init__()
        self.body = nn.Sequential(
            *_conv_norm(channels, inner, 3, stride), nn.ReLU(), *_conv_norm(inner, inner, 3)
        )
        is_same = stride == 1 and channels == inner
        self.shortcut = nn.Identity() if is_same else nn.Sequential(*_conv_norm(channels, inner, 1, stride))

    def forward(self, values: Tensor) -> Tensor:
        """Map (B, C, H, W) to (B, inner, H / stride, W / stride)."""
        return torch.relu(self.body(values) + self.shortcut(values))


@final
class DepthResNet(nn.Module):
    """Encode a depth image.

    Args:
        kind: One of `BLOCKS`.
        image_px: Rows and columns of the image; it is averaged to half of them first.
        width: Channels of the first stage.
        features: Size of the output.

    Source:
        Wijmans et al., DD-PPO, ICLR 2020: width 32 is half of the usual one.
    """

    def __init__(self, kind: str, image_px: int, width: int = 32, features: int = 512) -> None:
        super().__init__()
        if kind not in BLOCKS:
            raise ValueError(f"`kind` must be one of {', '.join(BLOCKS)}, got {kind!r}")
        layers: list[nn.Module] = [nn.AvgPool2d(2), *_conv_norm(1, width, 7, 2), nn.ReLU()]
        layers.append(nn.MaxPool2d(3, 2, 1))
        channels = width
        for stage, count in enumerate(BLOCKS[kind]):
            inner = width * 2**stage
            for index in range(count):
                stride = 2 if stage > 0 and index == 0 else 1
                if kind == "resnet50":
                    layers.append(Bottleneck(channels, inner, stride))
                    channels = EXPANSION * inner
                else:
                    layers.append(BasicBlock(channels, inner, stride))
                    channels = inner
        side = -(-(image_px // 2) // 32)
        compressed = max(1, round(COMPRESSED_SIZE / side**2))
        layers += [nn.Conv2d(channels, compressed, 3, padding=1, bias=False), nn.GroupNorm(1, compressed)]
        layers += [nn.ReLU(), nn.Flatten(), nn.Linear(compressed * side**2, features), nn.ReLU()]
        self.layers = nn.Sequential(*layers)

    def forward(self, depth: Tensor) -> Tensor:
        """Map (B, 1, H, W) depth in [0, 1] to (B, features)."""
        encoded: Tensor = self.layers(depth)
        return encoded


def _conv_norm(channels: int, outer: int, kernel: int, stride: int = 1) -> tuple[nn.Module, nn.Module]:
    conv = nn.Conv2d(channels, outer, kernel, stride, padding=kernel // 2, bias=False)
    return conv, nn.GroupNorm(GROUPS, outer)
