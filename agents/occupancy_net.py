"""Networks that complete a floor raster beyond what was seen: UPEN's and OccAnt's U-Nets.

Both take and give (N, C, h, w) rasters around the agent; what the channels mean is their user's matter.
"""

from collections.abc import Callable
from itertools import pairwise
from typing import Final, final

import torch
from torch import Tensor, nn
from torch.nn import functional

from anm_gym.checks import check_known

EDGE_MULTIPLE: Final = 16
"""Edges of the rasters must be a multiple of this, as they are halved four times."""
MIN_RESIDUAL_WIDTH: Final = 8
"""Where a processor has AVX2 alone, PyTorch's kernel for the gradient of a 1 x 1 convolution with a stride
writes beyond its weights if there are fewer channels than this and they come last."""


@final
class ResidualUnet(nn.Module):
    """A U-Net with the first three stages of a ResNet18 as its encoder.

    Args:
        inputs: Channels in.
        outputs: Channels out, as logits.
        width: Channels of the first stage, at least `MIN_RESIDUAL_WIDTH`; 64 is the published network of 5.0
            million parameters.

    Raises:
        ValueError: If `width` is less.

    Source:
        UPEN's released code: stages of w, w, 2 w and 4 w channels, 1 x 1 lateral convolutions, a branch
        at full resolution. The unused rest of the ResNet is left out.
    """

    def __init__(self, inputs: int = 3, outputs: int = 3, width: int = 12) -> None:
        super().__init__()
        _check_width(width, MIN_RESIDUAL_WIDTH)
        w = width
        self.full = nn.Sequential(_conv(inputs, w), _conv(w, w))
        self.stem = _conv(inputs, w, size=7, stride=2)
        self.stages = nn.ModuleList(
            [
                nn.Sequential(nn.MaxPool2d(3, 2, 1), _Residual(w, w), _Residual(w, w)),
                nn.Sequential(_Residual(w, 2 * w, stride=2), _Residual(2 * w, 2 * w)),
                nn.Sequential(_Residual(2 * w, 4 * w, stride=2), _Residual(4 * w, 4 * w)),
            ]
        )
        self.laterals = nn.ModuleList([_conv(size, size, size=1) for size in (w, w, 2 * w, 4 * w)])
        self.decoder = nn.ModuleList([_conv(6 * w, 4 * w), _conv(5 * w, 4 * w), _conv(5 * w, 2 * w)])
        self.fuse = _conv(3 * w, w)
        self.head = nn.Conv2d(w, outputs, 1)

    def forward(self, raster: Tensor) -> Tensor:
        """Complete (N, inputs, h, w) rasters; returns (N, outputs, h, w) logits."""
        _check_size(raster)
        levels = [self.stem(raster)]
        for stage in self.stages:
            levels.append(stage(levels[-1]))
        beside = [lateral(level) for lateral, level in zip(self.laterals, levels, strict=True)]
        merged = beside.pop()
        for layer in self.decoder:
            merged = layer(torch.cat([_doubled(merged), beside.pop()], dim=1))
        fused = self.fuse(torch.cat([_doubled(merged), self.full(raster)], dim=1))
        logits: Tensor = self.head(fused)
        return logits


@final
class PlainUnet(nn.Module):
    """A U-Net of double convolutions with max-pooling.

    Args:
        inputs: Channels in.
        outputs: Channels out, as logits.
        width: Channels of the first level; 16 is the published network of 0.84 million parameters.

    Source:
        OccAnt's released code: w, 2 w, 4 w, 8 w and 8 w channels down, 4 w, 2 w, w and w up.
    """

    def __init__(self, inputs: int = 2, outputs: int = 2, width: int = 16) -> None:
        super().__init__()
        _check_width(width)
        down = [inputs, *(factor * width for factor in (1, 2, 4, 8, 8))]
        self.down = nn.ModuleList([_double(low, high) for low, high in pairwise(down)])
        up = [(16, 4), (8, 2), (4, 1), (2, 1)]
        self.up = nn.ModuleList([_double(low * width, high * width) for low, high in up])
        self.head = nn.Conv2d(width, outputs, 1)

    def forward(self, raster: Tensor) -> Tensor:
        """Complete (N, inputs, h, w) rasters; returns (N, outputs, h, w) logits."""
        _check_size(raster)
        levels = [self.down[0](raster)]
        for layer in list(self.down)[1:]:
            levels.append(layer(functional.max_pool2d(levels[-1], 2)))
        merged = levels.pop()
        for layer in self.up:
            merged = layer(torch.cat([_doubled(merged), levels.pop()], dim=1))
        logits: Tensor = self.head(merged)
        return logits


OCCUPANCY_NETS: Final[dict[str, Callable[[int, int, int], nn.Module]]] = {
    "residual": ResidualUnet,
    "plain": PlainUnet,
}
"""The networks by name."""


def occupancy_net(name: str, inputs: int, outputs: int, width: int) -> nn.Module:
    """Build a network by name.

    Args:
        name: One of `OCCUPANCY_NETS`.
        inputs: Channels in.
        outputs: Channels out, as logits.
        width: Channels of the first level.

    Raises:
        ValueError: If there is no such network, or the width is not positive.

    Example:
        >>> net = occupancy_net("residual", 3, 3, 8)
        >>> tuple(net(torch.zeros(1, 3, 80, 80)).shape)
        (1, 3, 80, 80)
    """
    check_known("network", name, OCCUPANCY_NETS)
    return OCCUPANCY_NETS[name](inputs, outputs, width)


def channels_last(net: nn.Module) -> nn.Module:
    """Lay weights out as convolutions of these shapes read them fastest, in place."""
    return net.to(memory_format=torch.channels_last)  # type: ignore[call-overload,no-any-return]


class _Residual(nn.Module):
    """Two convolutions beside a short cut, as in ResNet18."""

    def __init__(self, inputs: int, outputs: int, stride: int = 1) -> None:
        super().__init__()
        self.first = _conv(inputs, outputs, stride=stride)
        self.second = nn.Sequential(
            nn.Conv2d(outputs, outputs, 3, padding=1, bias=False), nn.BatchNorm2d(outputs)
        )
        is_same = inputs == outputs and stride == 1
        self.short = (
            nn.Identity()
            if is_same
            else nn.Sequential(nn.Conv2d(inputs, outputs, 1, stride, bias=False), nn.BatchNorm2d(outputs))
        )

    def forward(self, raster: Tensor) -> Tensor:
        return functional.relu(self.second(self.first(raster)) + self.short(raster))


def _conv(inputs: int, outputs: int, size: int = 3, stride: int = 1) -> nn.Sequential:
    conv = nn.Conv2d(inputs, outputs, size, stride, size // 2, bias=False)
    return nn.Sequential(conv, nn.BatchNorm2d(outputs), nn.ReLU(inplace=True))


def _double(inputs: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(_conv(inputs, outputs), _conv(outputs, outputs))


def _doubled(raster: Tensor) -> Tensor:
    return functional.interpolate(raster, scale_factor=2.0, mode="bilinear", align_corners=False)


def _check_width(width: int, least: int = 1) -> None:
    if width < least:
        raise ValueError(f"`width` must be >= {least}, got {width}")


def _check_size(raster: Tensor) -> None:
    if raster.ndim != 4 or raster.shape[2] % EDGE_MULTIPLE or raster.shape[3] % EDGE_MULTIPLE:
        raise ValueError(
            f"`raster` must be (N, C, h, w) with edges that are multiples of {EDGE_MULTIPLE}, "
            f"got {tuple(raster.shape)}"
        )
