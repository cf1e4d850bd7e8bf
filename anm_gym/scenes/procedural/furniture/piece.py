"""What a piece of furniture is, and the small parts that many pieces share.

Local frame of a piece: x to its right, y up, z to the front. A piece for a wall has its back at z = 0
and is centred in x; a free-standing one is centred over the origin.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from anm_gym.scenes.procedural.palette import (
    BRASS,
    BRIGHTS,
    CERAMIC,
    LEAVES,
    LIGHT,
    PAPER,
    RGB,
    STEEL,
    RoomColors,
    pick,
    shade,
)
from anm_gym.scenes.procedural.primitives import (
    Solid,
    bar,
    block,
    box,
    cylinder,
    ellipsoid,
    join,
    lathe,
)

STEP_M = 0.09
"""What is lower does not stand in anybody's way."""
HEAD_M = 1.6
"""What is higher does not stand in anybody's way."""
TALL_M = 1.25
"""What is higher does not stand before a window."""


@dataclass(frozen=True)
class Style:
    """What a piece has to fit to."""

    colors: RoomColors
    """Colours of the room."""
    ceiling_m: float
    """Height of the room, metres."""


@dataclass(frozen=True, eq=False)
class Piece:
    """Furniture that is placed as a whole: a bed with its nightstands, a table with its chairs."""

    name: str
    """What it is."""
    parts: tuple[Solid, ...]
    """Its objects; each has a footprint of its own."""
    front_m: float = 0.0
    """Depth of the floor to keep free before it, metres."""

    @cached_property
    def solid(self) -> Solid:
        """All parts, without the faces on which they stand."""
        return join(self.parts).cut_off_below(0.0).without_faces_on(0.0)

    @cached_property
    def footprints(self) -> NDArray[np.float64]:
        """(K, 4) float64 x and z of the low and high corners of what stands in the way, metres."""
        standing = [part for part in self.parts if part.high[1] > STEP_M and part.low[1] < HEAD_M]
        return np.array([[*part.low[[0, 2]], *part.high[[0, 2]]] for part in standing]).reshape(-1, 4)

    @property
    def is_tall(self) -> bool:
        """Whether it would cover a window."""
        return float(self.solid.high[1]) > TALL_M

    @property
    def width_m(self) -> float:
        """Extent along x, metres."""
        return float(self.solid.high[0] - self.solid.low[0])


Maker = Callable[[np.random.Generator, Style], Piece]
"""Draws one piece of its kind."""


def legs(
    width: float, depth: float, height: float, color: RGB, radius: float = 0.025, splay: float = 0.0
) -> Solid:
    """Four round legs under a rectangle centred over the origin; `splay` moves their feet outwards."""
    x, z = width / 2 - 0.05, depth / 2 - 0.05
    feet = [
        bar((sx * (x + splay), 0.0, sz * (z + splay)), (sx * x, height, sz * z), radius, color, 4)
        for sx in (-1, 1)
        for sz in (-1, 1)
    ]
    return join(feet)


def fronts(width: float, low: float, high: float, at_z: float, columns: int, rows: int, color: RGB) -> Solid:
    """Doors or drawers with round knobs on the front of a cabinet that is centred in x."""
    cell_w, cell_h = width / columns, (high - low) / rows
    parts = []
    for column in range(columns):
        for row in range(rows):
            x, y = -width / 2 + column * cell_w, low + row * cell_h
            parts.append(
                box((x + 0.01, y + 0.01, at_z), (x + cell_w - 0.01, y + cell_h - 0.01, at_z + 0.018), color)
            )
            knob = ellipsoid((0.035, 0.035, 0.035), BRASS, 5, 2)
            side = 0.85 if column % 2 == 0 else 0.15
            parts.append(knob.moved(x + cell_w * (side if rows == 1 else 0.5), y + 0.5 * cell_h, at_z + 0.03))
    return join(parts)


def books(width: float, rng: np.random.Generator, height: float = 0.25) -> Solid:
    """A row of books from x = 0, some leaning, with a gap at the end."""
    parts, x = [], 0.0
    while True:
        thickness = float(rng.uniform(0.08, 0.22))
        if x + thickness > width * rng.uniform(0.75, 1.0):
            break
        tall, deep = height * rng.uniform(0.65, 1.0), rng.uniform(0.14, 0.2)
        parts.append(
            box(
                (x, 0.0, 0.0),
                (x + thickness - 0.004, tall, deep),
                shade(pick(BRIGHTS, rng), rng.uniform(0.6, 1.1)),
            )
        )
        x += thickness
    return join(parts) if parts else block(0.1, 0.05, 0.15, PAPER, (0.06, 0.0, 0.08))


def vase(rng: np.random.Generator, color: RGB) -> Solid:
    """A turned vase with a tuft of leaves."""
    height = float(rng.uniform(0.16, 0.28))
    body = lathe([(0.04, 0.0), (0.075, 0.35 * height), (0.03, 0.8 * height), (0.045, height)], color, 8)
    tuft = ellipsoid((0.16, 0.18, 0.16), pick(LEAVES, rng), 7, 3).moved(y=height - 0.03)
    return join([body, tuft])


def table_lamp(rng: np.random.Generator, color: RGB) -> Solid:
    """A lamp with a round base and a conical shade."""
    height = float(rng.uniform(0.32, 0.45))
    base = lathe([(0.08, 0.0), (0.07, 0.03), (0.015, 0.06), (0.015, height - 0.1)], color, 10)
    return join([base, cylinder(0.14, 0.18, LIGHT, 12, 0.08).moved(y=height - 0.15)])


def bowl(color: RGB) -> Solid:
    """A bowl of fruit."""
    dish = lathe([(0.05, 0.0), (0.12, 0.04), (0.15, 0.08), (0.13, 0.07), (0.05, 0.02)], color, 12)
    places = ((0.05, 0.0), (-0.04, 0.04), (-0.02, -0.05))
    fruit = [
        ellipsoid((0.08, 0.075, 0.08), BRIGHTS[i], 8, 3).moved(x, 0.035, z) for i, (x, z) in enumerate(places)
    ]
    return join([dish, *fruit])


def small_thing(rng: np.random.Generator, style: Style) -> Solid:
    """Something that lies about on a table, centred over the origin."""
    kind = int(rng.integers(6))
    if kind == 0:
        return vase(rng, pick(BRIGHTS, rng))
    if kind == 1:
        return bowl(CERAMIC)
    if kind == 2:
        stack = [
            block(0.22 - 0.02 * i, 0.03, 0.16, pick(BRIGHTS, rng), (0.0, 0.03 * i, 0.0)).turned(
                rng.uniform(-0.4, 0.4)
            )
            for i in range(3)
        ]
        return join(stack)
    if kind == 3:
        return lathe([(0.03, 0.0), (0.04, 0.1), (0.035, 0.1), (0.025, 0.01)], style.colors.accent, 8)
    if kind == 4:
        screen = block(0.32, 0.21, 0.012, (40, 42, 48)).turned(-0.3, "x").moved(0.0, 0.015, -0.1)
        return join([block(0.32, 0.015, 0.22, STEEL), screen])
    return lathe([(0.035, 0.0), (0.04, 0.16), (0.014, 0.22), (0.014, 0.28)], shade(pick(LEAVES, rng), 0.7), 8)


def scatter(
    width: float, depth: float, height: float, count: int, rng: np.random.Generator, style: Style
) -> list[Solid]:
    """Small things on a table top centred over the origin, in a row of slots so that none overlap."""
    slots = rng.permutation(max(count, int(width / 0.38)))[:count]
    pitch = width / max(count, int(width / 0.38))
    room = max(0.0, depth / 2 - 0.2)
    return [
        small_thing(rng, style)
        .turned(rng.uniform(-np.pi, np.pi))
        .moved(-width / 2 + (slot + 0.5) * pitch, height, rng.uniform(-room, room))
        for slot in slots
    ]
