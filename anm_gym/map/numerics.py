"""Floating point set-up of the map's training: subnormal numbers and bfloat16.

A softplus network decays towards subnormal numbers, on which CPUs are several times slower. The
flag that flushes them belongs to each thread, and threads inherit it from the one that starts them.
It must not stay set in the main thread: scipy's `cKDTree` splits cells by the next representable
number, and recurses without end where that number is flushed to the old one.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import torch

PARALLEL_SIZE = 1 << 20
"""Elements of a tensor that every worker thread of torch takes a part of."""


@contextmanager
def flushed_subnormals() -> Iterator[None]:
    """Flush subnormal numbers to zero inside a ``with`` block, in this thread and in all it starts."""
    was_flushing = not bool((torch.tensor([1e-40]) * 1.0).count_nonzero())
    torch.set_flush_denormal(True)
    try:
        yield
    finally:
        torch.set_flush_denormal(was_flushing)


def workers_flush_subnormals() -> bool:
    """Start torch's pool of threads if need be, and tell whether all of it flushes subnormal numbers.

    Returns:
        False if the pool had been started outside of `flushed_subnormals`; training then works, but
        several times slower.
    """
    with flushed_subnormals():
        return not bool((torch.full((PARALLEL_SIZE,), 1e-40) * 1.0).count_nonzero())


def has_fast_bfloat16(device: torch.device) -> bool:
    """Tell whether matrix products in bfloat16 are faster than in float32 on a device."""
    if device.type == "cpu":
        return bool(torch.cpu._is_avx512_bf16_supported() or torch.cpu._is_amx_tile_supported())
    return bool(torch.cuda.is_bf16_supported())


def usable_device(name: str) -> torch.device:
    """Look up a device.

    Raises:
        ValueError: If it is unknown, or not to be had here.
    """
    try:
        device = torch.device(name)
    except RuntimeError as error:
        raise ValueError(
            f"`device` must be one that torch knows, such as 'cpu' or 'cuda', got {name!r}"
        ) from error
    if device.type == "cuda" and not torch.cuda.is_available():
        raise ValueError(f"`device` must be one of this machine's, got {name!r} without a CUDA device")
    if device.type == "cuda" and (device.index or 0) >= torch.cuda.device_count():
        raise ValueError(
            f"`device` must be one of this machine's {torch.cuda.device_count()} CUDA devices, got {name!r}"
        )
    return device
