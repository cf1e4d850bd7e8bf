"""Pooling of images to squares of pixels."""

from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray


def pooled(unite: np.ufunc, image: NDArray[Any], edge_px: int) -> NDArray[Any]:
    """Unite the pixels of squares; the last ones of a row or column may be smaller.

    Args:
        unite: What makes one of two and does not mind to meet a pixel twice, such as `np.minimum`.
        image: (..., H, W) of any dtype.
        edge_px: Edge of a square, pixels.

    Returns:
        (..., ceil(H / edge_px), ceil(W / edge_px)) of the same dtype.
    """
    missing = [(0, 0)] * (image.ndim - 2) + [(0, -side % edge_px) for side in image.shape[-2:]]
    whole = np.pad(image, missing, mode="edge") if any(after for _, after in missing) else image
    # Slices, as numpy reduces short axes slowly.
    rows = reduce(unite, (whole[..., first::edge_px, :] for first in range(edge_px)))
    return np.asarray(reduce(unite, (rows[..., first::edge_px] for first in range(edge_px))))
