"""Divide a rectangle among requested rooms: corridors first, then blocks of rooms by slices and corners.

Lengths are whole multiples of `GRID_CM`, so neighbouring rooms share their walls exactly.
"""

from dataclasses import dataclass

import numpy as np

from anm_gym.scenes.procedural.plan import Rect
from anm_gym.scenes.procedural.tiers import CORRIDOR, ROOM_TYPES

GRID_CM = 10
"""Raster of the plan, centimetres."""
_ARRANGEMENTS = 20
_MIN_ARM_CM = 150
_MIN_BLOCK_CM = 240


@dataclass(frozen=True)
class Cell:
    """A requested room and the rectangles that it got, the largest first."""

    kind: str
    rects: tuple[Rect, ...]


def subdivide(
    block: Rect,
    kinds: tuple[str, ...],
    corridor_from: int,
    rng: np.random.Generator,
    across: bool | None = None,
) -> list[Cell]:
    """Divide a block among rooms, with a corridor through it while there are many of them.

    Args:
        block: What is to be divided.
        kinds: Requested rooms.
        corridor_from: Number of rooms from which a corridor is put between two halves.
        rng: Source of chance.
        across: Whether the corridor runs along z; None runs it along the longer side. A corridor at
            right angles to the one before meets it.

    Returns:
        One cell for each request and for each corridor.
    """
    width_cm = int(rng.integers(11, 15)) * GRID_CM
    along_z = block.depth_cm > block.width_cm if across is None else across
    room_for_corridor = (block.width_cm if along_z else block.depth_cm) - width_cm >= 2 * _MIN_BLOCK_CM
    if len(kinds) < corridor_from or not room_for_corridor:
        return _best_arrangement(block, kinds, rng)
    first, second = _halves(kinds, rng)
    low, strip, high = _cut_with_corridor(block, along_z, width_cm, _share(first, second))
    return [
        Cell(CORRIDOR, (strip,)),
        *subdivide(low, first, corridor_from, rng, not along_z),
        *subdivide(high, second, corridor_from, rng, not along_z),
    ]


def misfit(cells: list[Cell]) -> float:
    """Score how badly rooms are shaped: 0 when all are wide enough and none is a long strip."""
    return sum(_room_misfit(cell) for cell in cells if cell.kind != CORRIDOR)


def _room_misfit(cell: Cell) -> float:
    sides = sorted((cell.rects[0].width_cm, cell.rects[0].depth_cm))
    wanted = ROOM_TYPES[cell.kind].min_side_cm
    narrow = max(0.0, wanted - sides[0]) / wanted
    return 10.0 * narrow + max(0.0, sides[1] / max(sides[0], 1) - 2.0)


def _best_arrangement(block: Rect, kinds: tuple[str, ...], rng: np.random.Generator) -> list[Cell]:
    arrangements = (_arrange(block, kinds, rng) for _ in range(_ARRANGEMENTS if len(kinds) > 1 else 1))
    return min(arrangements, key=misfit)


def _arrange(block: Rect, kinds: tuple[str, ...], rng: np.random.Generator) -> list[Cell]:
    if len(kinds) == 1:
        return [Cell(kinds[0], (block,))]
    if len(kinds) == 2 and rng.random() < 0.6:
        corner = _carve_corner(block, kinds, rng)
        if corner is not None:
            return corner
    first, second = _halves(kinds, rng)
    along_z = (block.width_cm > block.depth_cm) == (rng.random() < 0.85)
    low, _, high = _cut_with_corridor(block, along_z, 0, _share(first, second))
    return _arrange(low, first, rng) + _arrange(high, second, rng)


def _halves(kinds: tuple[str, ...], rng: np.random.Generator) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Shuffle the requests and part them near the middle of their area."""
    shuffled = tuple(kinds[index] for index in rng.permutation(len(kinds)))
    areas = np.cumsum([ROOM_TYPES[kind].area_m2 for kind in shuffled])
    split = 1 + int(np.argmin(np.abs(areas[:-1] / areas[-1] - rng.uniform(0.4, 0.6))))
    return shuffled[:split], shuffled[split:]


def _share(first: tuple[str, ...], second: tuple[str, ...]) -> float:
    area, rest = (sum(ROOM_TYPES[kind].area_m2 for kind in kinds) for kinds in (first, second))
    return area / (area + rest)


def _cut_with_corridor(block: Rect, along_z: bool, width_cm: int, share: float) -> tuple[Rect, Rect, Rect]:
    """Cut a block by a strip (of no width: by a line) so that the first part has a share of the rest."""
    length = block.width_cm if along_z else block.depth_cm
    first = round((length - width_cm) * share / GRID_CM) * GRID_CM
    first = min(max(first, GRID_CM), length - width_cm - GRID_CM)
    if along_z:
        a, b = block.x0 + first, block.x0 + first + width_cm
        return (
            Rect(block.x0, block.z0, a, block.z1),
            Rect(a, block.z0, b, block.z1),
            Rect(b, block.z0, block.x1, block.z1),
        )
    a, b = block.z0 + first, block.z0 + first + width_cm
    return (
        Rect(block.x0, block.z0, block.x1, a),
        Rect(block.x0, a, block.x1, b),
        Rect(block.x0, b, block.x1, block.z1),
    )


def _carve_corner(block: Rect, kinds: tuple[str, ...], rng: np.random.Generator) -> list[Cell] | None:
    """Give the smaller of two rooms a corner, so that the larger becomes an L; None where it does not fit."""
    small, large = sorted(kinds, key=lambda kind: ROOM_TYPES[kind].area_m2)
    area_cm2 = block.width_cm * block.depth_cm * _share((small,), (large,))
    width = round(np.sqrt(area_cm2 * rng.uniform(0.7, 1.45)) / GRID_CM) * GRID_CM
    depth = round(area_cm2 / max(width, GRID_CM) / GRID_CM) * GRID_CM
    if min(block.width_cm - width, block.depth_cm - depth) < _MIN_ARM_CM:
        return None
    at_x1, at_z1 = rng.random(2) < 0.5
    x = block.x1 - width if at_x1 else block.x0
    z = block.z1 - depth if at_z1 else block.z0
    corner = Rect(x, z, x + width, z + depth)
    beside = Rect(block.x0 if at_x1 else corner.x1, z, corner.x0 if at_x1 else block.x1, corner.z1)
    rest = Rect(block.x0, block.z0 if at_z1 else corner.z1, block.x1, corner.z0 if at_z1 else block.z1)
    parts = sorted((beside, rest), key=lambda rect: -rect.area_m2)
    return [Cell(small, (corner,)), Cell(large, tuple(parts))]
