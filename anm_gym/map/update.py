"""What a step of mapping did."""

from dataclasses import dataclass

from anm_gym.map.losses import LossTerms


@dataclass(frozen=True)
class MapUpdate:
    """What one call of `NeuralMap.integrate` did."""

    is_keyframe: bool
    """Whether the frame before this one was kept for replay."""
    iterations: int
    """Optimiser steps taken."""
    distance_loss: float
    """Weighted mean distance term of the last iteration (Eq. 3)."""
    eikonal_loss: float
    """Weighted mean eikonal term of the last iteration (Eq. 3)."""
    normal_loss: float
    """Weighted mean normal term of the last iteration (Eq. 3)."""

    @classmethod
    def of(cls, is_keyframe: bool, iterations: int, terms: LossTerms | None) -> "MapUpdate":
        """Read the terms of the last iteration; all are 0 where there was none."""
        if terms is None:
            return cls(is_keyframe, 0, 0.0, 0.0, 0.0)
        return cls(is_keyframe, iterations, terms.distance.item(), terms.eikonal.item(), terms.normal.item())
