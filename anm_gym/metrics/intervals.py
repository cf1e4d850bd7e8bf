"""Means with their confidence intervals, and paired differences between two agents."""

from collections import defaultdict
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

Pair = TypeVar("Pair", bound=tuple[Any, ...])
"""What two agents have in common: a scene first, then a seed or the like."""


@dataclass(frozen=True)
class Interval:
    """A mean and half the width of its confidence interval."""

    mean: float
    """Mean of the values; not a number without any."""
    half_width: float
    """Half the width of the interval; not a number for fewer than two values."""
    count: int
    """Number of values."""

    @property
    def low(self) -> float:
        """Lower end."""
        return self.mean - self.half_width

    @property
    def high(self) -> float:
        """Upper end."""
        return self.mean + self.half_width


def mean_interval(
    values: ArrayLike, confidence: float = 0.95, clusters: Sequence[Hashable] | None = None
) -> Interval:
    """Estimate a mean with Student's t interval; values that are not finite are left out.

    Args:
        values: Any number of independent values.
        confidence: Coverage of the interval, between 0 and 1.
        clusters: What each value belongs to, such as its scene, where values of one cluster are alike: then
            the means of the clusters are what is independent. Within a single cluster the values are.

    Returns:
        The interval.

    Raises:
        ValueError: If `confidence` is not between 0 and 1.

    Example:
        >>> interval = mean_interval([1.0, 2.0, 3.0])
        >>> round(interval.mean, 2), round(interval.half_width, 2)
        (2.0, 2.48)
    """
    _check_confidence(confidence)
    finite = np.asarray(values, np.float64).ravel()
    is_finite = np.isfinite(finite)
    finite = finite[is_finite]
    if clusters is not None:
        means = _cluster_means(finite, [clusters[index] for index in np.flatnonzero(is_finite).tolist()])
        if len(means) > 1:
            return replace(mean_interval(means, confidence), count=len(finite))
    count = len(finite)
    if count < 2:
        return Interval(float(finite[0]) if count else float("nan"), float("nan"), count)
    quantile = float(stats.t.ppf(0.5 + confidence / 2.0, count - 1))
    half_width = quantile * float(finite.std(ddof=1)) / count**0.5
    return Interval(float(finite.mean()), half_width, count)


def _cluster_means(values: NDArray[np.float64], clusters: Sequence[Hashable]) -> list[float]:
    by_cluster: dict[Hashable, list[float]] = defaultdict(list)
    for value, cluster in zip(values, clusters, strict=True):
        by_cluster[cluster].append(float(value))
    return [float(np.mean(members)) for members in by_cluster.values()]


def wilson_interval(successes: int, trials: int, confidence: float = 0.95) -> tuple[float, float]:
    """Estimate a probability; unlike a mean's interval, it is not empty where all trials succeed.

    Args:
        successes: How many succeeded.
        trials: Out of how many.
        confidence: Coverage of the interval, between 0 and 1.

    Returns:
        Lower and upper end; 0 and 1 without any trial.

    Raises:
        ValueError: If there are more successes than trials, or less than none, or `confidence` is no share.

    Source:
        Wilson, 1927.

    Example:
        >>> low, high = wilson_interval(50, 50)
        >>> round(low, 3), high
        (0.929, 1.0)
    """
    _check_confidence(confidence)
    if not 0 <= successes <= trials:
        raise ValueError(f"`successes` must be in [0, {trials}], got {successes}")
    if trials == 0:
        return 0.0, 1.0
    z = float(stats.norm.ppf(0.5 + confidence / 2.0))
    share = successes / trials
    center = share + z**2 / (2.0 * trials)
    spread = z * (share * (1.0 - share) / trials + z**2 / (4.0 * trials**2)) ** 0.5
    scale = 1.0 + z**2 / trials
    low, high = (center - spread) / scale, (center + spread) / scale
    return (0.0 if successes == 0 else low), (1.0 if successes == trials else high)


def paired_difference(
    first: Mapping[Pair, float], second: Mapping[Pair, float], confidence: float = 0.95
) -> Interval:
    """Estimate how much higher the first agent's values are, pair by pair.

    Args:
        first: Values by what makes a pair, as (scene, seed); pairs of one scene are a cluster.
        second: Values of the other agent; keys that only one has are left out.
        confidence: Coverage of the interval.

    Returns:
        Interval of the mean difference first - second.
    """
    shared = [key for key in first if key in second]
    differences = [first[key] - second[key] for key in shared]
    return mean_interval(differences, confidence, [key[0] for key in shared])


def _check_confidence(confidence: float) -> None:
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"`confidence` must be between 0 and 1, got {confidence}")
