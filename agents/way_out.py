"""Where a lost agent is led: along a finer wave close around it, through gaps that the wide wave shuts.

The wide wave has cells so large that furniture half a metre apart shuts a way. Around an agent that does
not get away from a spot, or comes no nearer for long, another one is spread over the cells of its near map;
at the rim it takes the distances of the wide one.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from agents.goal_wave import spread_wave
from anm_gym.checks import check_at_least, check_positive

NUM_HEADINGS: Final = 36
"""Headings in which an agent may be led: as far apart as a turn goes."""
_LEFT_RAD: Final = np.linspace(0.0, 2.0 * np.pi, NUM_HEADINGS, endpoint=False)
_STRIDE_M: Final = 0.09
_AHEAD_M: Final = tuple(_STRIDE_M * count for count in range(1, 6))
_CROSS: Final = ndimage.generate_binary_structure(2, 1)[None]
AHEAD_OFFSETS: Final = np.array(
    [(-along_m * np.sin(left), along_m * np.cos(left)) for left in _LEFT_RAD for along_m in _AHEAD_M],
    np.float32,
)
"""(NUM_HEADINGS * 5, 2) points a little ahead in each heading, closer than cells; the present heading first,
the others to its left: offsets to the right and ahead, metres."""


@dataclass(frozen=True)
class WayOutSettings:
    """Sizes and prices of the fine wave (ours)."""

    window_cells: int = 192
    """Rows and columns around the agent."""
    blocked_cost: float = 200.0
    """Price of a metre through occupied cells."""
    contact_cost: float = 10.0
    """Price where a step was cut short: something is there, but a gap may be beside it."""
    beside_cost: float = 3.0
    """Price beside occupied cells, which the body may touch."""

    def __post_init__(self) -> None:
        check_at_least(self, 1, "window_cells")
        check_positive(self, "blocked_cost", "contact_cost", "beside_cost")


def prices(
    occupied: NDArray[np.bool_],
    touched: NDArray[np.bool_],
    visited: NDArray[np.bool_],
    cell_m: float,
    settings: WayOutSettings,
) -> NDArray[np.float32]:
    """Price of crossing each cell.

    Args:
        occupied: (K, rows, columns) where a surface was seen.
        touched: (K, rows, columns) where a step was cut short.
        visited: (K, rows, columns) where the agent has stood: there is room, whatever was seen.
        cell_m: Edge of a cell, metres.
        settings: Prices.

    Returns:
        (K, rows, columns) float32 metres.
    """
    is_beside = ndimage.binary_dilation(occupied, _CROSS)
    cost = np.select(
        [visited, occupied, touched, is_beside],
        [1.0, settings.blocked_cost, settings.contact_cost, settings.beside_cost],
        1.0,
    )
    return (cell_m * cost).astype(np.float32)


def distances_ahead(
    seeds_m: NDArray[np.float32],
    price_m: NDArray[np.float32],
    cells: NDArray[np.int64],
    cell_m: float,
) -> NDArray[np.float32]:
    """How long the way to the goal is that goes straight ahead at first, in each heading.

    Args:
        seeds_m: (K, rows, columns) float32 where waves begin, metres.
        price_m: (K, rows, columns) float32 `prices`, metres.
        cells: (K, NUM_HEADINGS * 5, 2) cells (x, z) of `AHEAD_OFFSETS` in the windows.
        cell_m: Edge of a cell, metres.

    Returns:
        (K, NUM_HEADINGS) float32 metres, the mean over the points at which the way may bend; the present
        heading first, the others to its left.
    """
    ahead_m = np.empty((len(cells), NUM_HEADINGS), np.float32)
    for agent, (seeds, price, (columns, rows)) in enumerate(
        zip(seeds_m, price_m, np.moveaxis(cells, -1, 1), strict=True)
    ):
        beyond_m = spread_wave(seeds, price)[rows, columns]
        crossed_m = price[rows, columns] * np.float32(_STRIDE_M / cell_m)
        shape = NUM_HEADINGS, len(_AHEAD_M)
        ahead_m[agent] = (beyond_m.reshape(shape) + crossed_m.reshape(shape).cumsum(axis=1)).mean(axis=1)
    return ahead_m
