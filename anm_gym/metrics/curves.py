"""What is read off the course of an episode: path length, and the area under a curve of progress."""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def path_length_m(positions_xz: ArrayLike) -> NDArray[np.float64]:
    """Length of the path up to each of its points.

    Args:
        positions_xz: (T, 2) floor points, metres.

    Returns:
        (T,) float64 metres, from 0.

    Raises:
        ValueError: If the points have another shape.
    """
    positions = np.asarray(positions_xz, np.float64)
    if positions.ndim != 2 or positions.shape[1] != 2 or len(positions) == 0:
        raise ValueError(f"`positions_xz` must have shape (T, 2) with T > 0, got {positions.shape}")
    steps_m = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps_m)])


def auc(x: ArrayLike, y: ArrayLike, budget: float | None = None) -> float:
    """Mean over [0, budget] of a staircase that jumps to y[i] at x[i] and keeps its last value.

    Equal x stand for progress that cost nothing, as turns do on an axis of metres: the last one counts.
    Before x[0] the curve is 0.

    Args:
        x: (T,) steps or metres, not descending, from 0 or more.
        y: (T,) values.
        budget: End of the axis; by default the last x. A curve that ends before it is held at its last
            value; one that goes beyond is cut.

    Returns:
        The mean, in the unit of `y`.

    Raises:
        ValueError: If the curve is empty, the lengths differ, `x` descends or is negative, or the budget
            is not positive.

    Example:
        >>> auc([0, 1, 2], [10.0, 20.0, 40.0], budget=4)
        27.5
    """
    edges, values = np.asarray(x, np.float64), np.asarray(y, np.float64)
    if edges.ndim != 1 or edges.shape != values.shape or len(edges) == 0:
        raise ValueError(f"`x` and `y` must be equally long and not empty, got {edges.shape}, {values.shape}")
    if edges[0] < 0.0 or (np.diff(edges) < 0.0).any():
        raise ValueError("`x` must be 0 or more and not descend, got a negative or descending value")
    end = float(edges[-1]) if budget is None else float(budget)
    if not end > 0.0:
        raise ValueError(f"`budget` must be > 0, got {end}")
    widths = np.diff(np.minimum(np.append(edges, end), end))
    return float((values * widths).sum() / end)


def auc_over_steps(curve: ArrayLike, budget_steps: int) -> float:
    """Mean over a budget of steps of a curve with one value per frame, the first that of the start.

    Args:
        curve: (T + 1,) value after 0, 1, … T steps.
        budget_steps: Steps of the budget.

    Returns:
        The mean, in the unit of the curve.
    """
    return auc(np.arange(len(np.asarray(curve))), curve, budget_steps)


def auc_over_metres(curve: ArrayLike, path_m: ArrayLike, budget_m: float) -> float:
    """Mean over a budget of metres of a curve with one value per frame.

    Args:
        curve: (T,) value at each frame.
        path_m: (T,) length of the path up to each frame, metres, see `path_length_m`.
        budget_m: Length of the budget, metres.

    Returns:
        The mean, in the unit of the curve.
    """
    return auc(path_m, curve, budget_m)
