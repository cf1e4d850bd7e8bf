"""How well a score of doubt sorts what is wrong from what is right: rank statistics, nothing of maps."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True, eq=False)
class Reliability:
    """Predicted against true errors, in bins of equally many points, the surest first."""

    predicted_std_m: NDArray[np.float64]
    """(B,) root mean square of the predicted standard deviations of each bin, metres."""
    rms_error_m: NDArray[np.float64]
    """(B,) root of the mean squared error of each bin, metres."""
    counts: NDArray[np.int64]
    """(B,) points of each bin."""


def auroc(scores: ArrayLike, positive: ArrayLike) -> float:
    """Chance that a positive scores higher than a negative; ties count half.

    Args:
        scores: (N,) scores, higher for what is thought positive.
        positive: (N,) bool, what is positive.

    Returns:
        Area under the receiver operating characteristic in [0, 1]; NaN if a class is empty.

    Raises:
        ValueError: If the two lengths differ.

    Source:
        Mann and Whitney's rank statistic.

    Example:
        >>> auroc([0.1, 0.4, 0.4, 0.9], [False, False, True, True])
        0.875
    """
    values, is_positive = np.asarray(scores, np.float64), np.asarray(positive, bool)
    _check_lengths("positive", values, is_positive)
    num_positive = int(is_positive.sum())
    num_negative = len(values) - num_positive
    if num_positive == 0 or num_negative == 0:
        return float("nan")
    _, group, sizes = np.unique(values, return_inverse=True, return_counts=True)
    mean_rank = np.cumsum(sizes) - 0.5 * (sizes - 1)
    rank_sum = mean_rank[group[is_positive]].sum()
    wins = rank_sum - 0.5 * num_positive * (num_positive + 1)
    return float(wins / (num_positive * num_negative))


def ause(scores: ArrayLike, errors: ArrayLike) -> float:
    """Area between the sparsification curves by the score and by the error itself.

    A sparsification curve is the mean error of what is left when more and more of the points with the
    highest score are taken away. Points of equal score leave in random order, on average.

    Args:
        scores: (N,) scores, higher where the error is thought large.
        errors: (N,) true errors, not negative.

    Returns:
        The area in units of the mean error of all points: 0 is a perfect order. NaN without any error.

    Raises:
        ValueError: If the two lengths differ.

    Source:
        Ilg et al., Uncertainty Estimates and Multi-Hypotheses Networks for Optical Flow (AUSE).

    Example:
        >>> ause([1.0, 2.0, 3.0], [0.0, 0.5, 4.0])
        0.0
    """
    values, true_errors = np.asarray(scores, np.float64), np.asarray(errors, np.float64)
    _check_lengths("errors", values, true_errors)
    if len(values) == 0 or not true_errors.mean() > 0.0:
        return float("nan")
    gap = _sparsification(values, true_errors) - _sparsification(true_errors, true_errors)
    return float(gap.mean() / true_errors.mean())


def reliability(predicted_std_m: ArrayLike, error_m: ArrayLike, bins: int = 10) -> Reliability:
    """Compare predicted standard deviations with true errors, bin by bin.

    Args:
        predicted_std_m: (N,) predicted standard deviations, metres.
        error_m: (N,) true errors, of any sign, metres.
        bins: Quantile bins; fewer points than bins make one bin each.

    Returns:
        One entry per bin that holds a point.

    Raises:
        ValueError: If the two lengths differ or `bins` is less than 1.
    """
    std, error = np.asarray(predicted_std_m, np.float64), np.asarray(error_m, np.float64)
    _check_lengths("error_m", std, error)
    if bins < 1:
        raise ValueError(f"`bins` must be >= 1, got {bins}")
    parts = [part for part in np.array_split(np.argsort(std, kind="stable"), bins) if len(part)]
    return Reliability(
        np.array([np.sqrt((std[part] ** 2).mean()) for part in parts], np.float64),
        np.array([np.sqrt((error[part] ** 2).mean()) for part in parts], np.float64),
        np.array([len(part) for part in parts], np.int64),
    )


def _sparsification(scores: NDArray[np.float64], errors: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) mean error of the N - k points that are left without the k of highest score."""
    _, group, sizes = np.unique(scores, return_inverse=True, return_counts=True)
    group_means = np.bincount(group, errors) / sizes
    left = np.cumsum(np.repeat(group_means, sizes))
    return np.asarray((left / np.arange(1, len(scores) + 1))[::-1])


def _check_lengths(name: str, scores: NDArray[np.float64], other: NDArray[np.generic]) -> None:
    if scores.ndim != 1 or scores.shape != other.shape:
        raise ValueError(
            f"`{name}` must have one entry per score, got shapes {other.shape} and {scores.shape}"
        )
