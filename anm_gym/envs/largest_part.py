"""The largest navigable part of a storey, where episodes take place.

Apart from `mesh_env`, which refuses other places, as `pointnav_episodes` moves places onto it.
"""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from anm_gym.sim.traversable import TraversableGrid

LARGEST: Final = 1
"""Its label in `TraversableGrid.component`."""


def nearest_place(grid: TraversableGrid, position_xz: ArrayLike) -> NDArray[np.float64] | None:
    """Find the cell of the largest part that is nearest to a floor point.

    Args:
        grid: Where the body fits.
        position_xz: (2,) the floor point, metres; anywhere.

    Returns:
        (2,) centre of the cell, metres; None if the body fits nowhere.
    """
    cells_xz = grid.frame.centers_of(np.argwhere(grid.component == LARGEST))
    if len(cells_xz) == 0:
        return None
    return np.asarray(cells_xz[np.linalg.norm(cells_xz - np.asarray(position_xz), axis=1).argmin()])


def is_open_between(grid: TraversableGrid, from_xz: ArrayLike, to_xz: ArrayLike) -> bool:
    """Tell whether a straight line meets no obstacle, but the one that it may begin in.

    Args:
        grid: Where the obstacles are.
        from_xz: (2,) where the line begins, metres; inside the raster.
        to_xz: (2,) where it ends, metres; inside the raster.
    """
    begin_xz, end_xz = np.array([from_xz, to_xz], np.float64)
    parts = int(4.0 * np.linalg.norm(end_xz - begin_xz) / grid.frame.cell_m) + 1
    cells = grid.frame.cells_of(np.linspace(begin_xz, end_xz, parts + 1))
    occupied = grid.occupied[cells[:, 0], cells[:, 1]]
    return not bool((occupied[1:] & ~occupied[:-1]).any())
