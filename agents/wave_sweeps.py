"""Shortest ways over priced cells by sweeps along rows, columns and diagonals.

Along one line of cells the shortest way is a running minimum: of the distance at each cell, less the
price of the line up to there. So one sweep carries a wave along whole lines, and a way is found after
about as many rounds as it has bends; a wave that spreads cell by cell needs one for each of its cells.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

FAR_M: Final = 1e6
"""Distance where no wave begins, metres."""
TOLERANCE_M: Final = 0.01
"""Sweeps end when no distance falls by more, metres."""
_BARRIER_M: Final = 1e3
"""Price of a step from the end of one line to the start of the next, metres: there are two on such a way."""
_DIAGONAL: Final = np.float32(np.sqrt(2.0))
Lines = tuple[NDArray[np.float32], NDArray[np.float32]]
"""(cells, lines) views: distances, and prices of the lines up to there."""


def spread_wave(
    seeds_m: NDArray[np.float32], price_m: NDArray[np.float32], max_rounds: int
) -> NDArray[np.float32]:
    """Spread a wave over eight neighbours until no distance falls any more.

    A straight step costs the mean of its two cells. A diagonal one costs as the dearest of the four
    cells that it touches, so nothing slips between walls that meet at a corner.

    Args:
        seeds_m: (R, C) float32 distances at which the wave begins, metres; `FAR_M` where it does not.
        price_m: (R, C) float32 price of crossing a cell, metres. No shortest way may be dearer than 2 km.
        max_rounds: Rounds of sweeps, in all eight directions each.

    Returns:
        (R, C) float32 distances, metres, too long by some `TOLERANCE_M` at most.

    Source:
        Ours, after the fast sweeping method (Zhao, Mathematics of Computation, 2005).
    """
    flat_m, distance_m = _flat(seeds_m, FAR_M)
    lines = [*_straight_lines(distance_m, price_m), *_diagonal_lines(flat_m, price_m)]
    for _ in range(max_rounds):
        before = distance_m.copy()
        for distances, up_to_here in lines:
            _sweep(distances, up_to_here)
        if (before - distance_m).max(initial=0.0) <= TOLERANCE_M:
            break
    return distance_m.copy()


def _sweep(distance_m: NDArray[np.float32], up_to_here_m: NDArray[np.float32]) -> None:
    """Carry the wave along lines, forwards and then backwards."""
    beginning = distance_m - up_to_here_m
    np.minimum.accumulate(beginning, axis=0, out=beginning)
    beginning += up_to_here_m
    np.minimum(distance_m, beginning, out=distance_m)
    ending = distance_m + up_to_here_m
    from_the_end = ending[::-1]
    np.minimum.accumulate(from_the_end, axis=0, out=from_the_end)
    ending -= up_to_here_m
    np.minimum(distance_m, ending, out=distance_m)


def _straight_lines(distance_m: NDArray[np.float32], price_m: NDArray[np.float32]) -> list[Lines]:
    """Columns and rows."""
    lines = []
    for distances, prices in ((distance_m, price_m), (distance_m.T, price_m.T)):
        steps = np.zeros_like(prices)
        steps[1:] = 0.5 * (prices[1:] + prices[:-1])
        lines.append((distances, np.cumsum(steps, axis=0)))
    return lines


def _diagonal_lines(flat_m: NDArray[np.float32], price_m: NDArray[np.float32]) -> list[Lines]:
    """Both kinds of diagonals: cells of a flat array that are a row and one more, or one less, apart."""
    dearer = np.maximum(price_m[:-1], price_m[1:])
    steps = _DIAGONAL * np.maximum(dearer[:, :-1], dearer[:, 1:])
    lines = []
    for side, columns in ((1, np.s_[1:]), (-1, np.s_[:-1])):
        entered = np.full_like(price_m, _BARRIER_M)
        entered[1:, columns] = steps
        flat_steps, _ = _flat(entered, _BARRIER_M)
        apart = price_m.shape[1] + 1 + side
        end = len(flat_m) // apart * apart
        distances, prices = (flat[:end].reshape(-1, apart) for flat in (flat_m, flat_steps))
        lines.append((distances, np.cumsum(prices, axis=0)))
    return lines


def _flat(values: NDArray[np.float32], rest: float) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """A raster as a flat array, with a column that parts its rows and two more rows; a view of the cells."""
    rows, columns = values.shape
    padded = np.full((rows + 2, columns + 1), rest, np.float32)
    cells = padded[:rows, :columns]
    cells[:] = values
    return padded.reshape(-1), cells
