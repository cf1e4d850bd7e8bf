"""Noise of actuation and depth; everything is off by default, as in the paper."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class NoiseSpec:
    """Independent Gaussian noise of each step.

    Poses are reported exactly as they became: noise disturbs what the agent does, not what it knows
    of where it is.

    Raises:
        ValueError: If a standard deviation is negative or not finite.

    Source:
        Ours. Active Neural Mapping assumes exact actuation and depth.
    """

    forward_std_m: float = 0.0
    """Standard deviation of the length of a forward step, metres."""
    turn_std_deg: float = 0.0
    """Standard deviation of the angle of a turn, degrees."""
    depth_std_fraction: float = 0.0
    """Standard deviation of each depth pixel, as a fraction of its depth."""

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0.0 <= value < np.inf:
                raise ValueError(f"`{name}` must be >= 0 and finite, got {value}")

    def draw_actuation(self, rng: np.random.Generator) -> tuple[float, float]:
        """Draw what is added to a forward step, metres, and to a turn, radians."""
        if self.forward_std_m == 0.0 and self.turn_std_deg == 0.0:
            return 0.0, 0.0
        forward, turn = rng.standard_normal(2).tolist()
        return self.forward_std_m * forward, float(np.deg2rad(self.turn_std_deg * turn))

    def disturb(
        self, depth_m: NDArray[np.float32], max_depth_m: float, rng: np.random.Generator
    ) -> NDArray[np.float32]:
        """Disturb a depth image; empty pixels stay empty.

        Args:
            depth_m: (H, W) float32 planar depth, metres; 0 is empty.
            max_depth_m: The largest depth that comes out, metres.
            rng: Where the noise is drawn.

        Returns:
            (H, W) float32 metres: the image itself without noise, otherwise a new one.
        """
        if self.depth_std_fraction == 0.0:
            return depth_m
        factor = 1.0 + self.depth_std_fraction * rng.standard_normal(depth_m.shape, dtype=np.float32)
        return np.asarray(np.clip(depth_m * factor, 0.0, max_depth_m), np.float32)
