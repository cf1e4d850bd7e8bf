"""Wardrobes, shelves and cabinets: what stands along walls and hides what is behind."""

# ruff: noqa: ARG001 - all makers have the signature of `Maker`, whatever they need of it

import numpy as np

from anm_gym.scenes.procedural.furniture.piece import Piece, Style, books, fronts, scatter, small_thing, vase
from anm_gym.scenes.procedural.palette import (
    BLACK,
    BRIGHTS,
    IRON,
    MIRROR,
    PAPER,
    TERRACOTTA,
    WHITE,
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
    rounded,
)


def wardrobe(rng: np.random.Generator, style: Style) -> Piece:
    """A tall closet with doors, sometimes with a mirror."""
    doors = int(rng.integers(2, 4))
    width, height = 0.5 * doors, float(rng.uniform(1.95, min(2.3, style.ceiling_m - 0.15)))
    color = style.colors.wood if rng.random() < 0.6 else WHITE
    body = [box((-width / 2, 0.0, 0.0), (width / 2, height, 0.58), color)]
    body.append(fronts(width, 0.08, height - 0.04, 0.58, doors, 1, shade(color, 1.06)))
    body.append(
        box((-width / 2 - 0.02, height, 0.0), (width / 2 + 0.02, height + 0.04, 0.62), shade(color, 0.9))
    )
    if rng.random() < 0.4:
        body.append(box((-0.2, 0.5, 0.598), (0.2, 1.7, 0.604), MIRROR))
    return Piece("wardrobe", (join(body),), 0.45)


def bookshelf(rng: np.random.Generator, style: Style) -> Piece:
    """An open shelf with books and small things."""
    width, depth = float(rng.uniform(0.7, 1.2)), 0.3
    levels = int(rng.integers(4, 7))
    pitch = 0.34
    height = levels * pitch + 0.06
    color = style.colors.wood
    frame = _rack(width, depth, height, [0.06 + index * pitch for index in range(levels)], color)
    filling = []
    for index in range(levels):
        y = 0.08 + index * pitch
        if rng.random() < 0.75:
            filling.append(books(width - 0.06, rng).moved(-width / 2 + 0.03, y, 0.04))
        else:
            filling.append(vase(rng, pick(BRIGHTS, rng)).moved(rng.uniform(-0.2, 0.2), y, 0.15))
    return Piece("bookshelf", (join([frame, *filling]),), 0.3)


def divider(rng: np.random.Generator, style: Style) -> Piece:
    """A shelf that is open to both sides and stands free in the room."""
    width, depth = float(rng.uniform(1.0, 1.5)), 0.34
    levels = [0.06 + index * 0.37 for index in range(5)]
    frame = _rack(width, depth, 1.9, levels, style.colors.wood, has_back=False)
    filling = []
    for y in levels:
        filling.append(books(width * rng.uniform(0.3, 0.6), rng).moved(-width / 2 + 0.04, y + 0.02, 0.07))
        filling.append(small_thing(rng, style).moved(width / 2 - 0.2, y + 0.02, depth / 2))
    return Piece("divider", (join([frame, *filling]).moved(z=-depth / 2),))


def rack(rng: np.random.Generator, style: Style) -> Piece:
    """A storage rack with boxes, jars and rolls."""
    width, depth = float(rng.uniform(0.8, 1.3)), 0.42
    heights = [0.08, 0.55, 1.02, 1.5]
    frame = _rack(width, depth, 1.9, heights, IRON, has_back=False)
    filling = [
        _stored(rng).moved(float(x), y + 0.02, depth / 2)
        for y in heights
        for x in np.arange(-width / 2 + 0.22, width / 2 - 0.15, 0.38)
    ]
    return Piece("rack", (join([frame, *filling]),), 0.3)


def _rack(
    width: float,
    depth: float,
    height: float,
    levels: list[float],
    color: tuple[int, int, int],
    has_back: bool = True,
) -> Solid:
    posts = [box((x - 0.012, 0.0, 0.0), (x + 0.012, height, depth), color) for x in (-width / 2, width / 2)]
    if not has_back:
        posts = [
            bar((x, 0.0, z), (x, height, z), 0.016, color)
            for x in (-width / 2, width / 2)
            for z in (0.02, depth - 0.02)
        ]
    boards = [
        box((-width / 2, y, 0.005), (width / 2, y + 0.02, depth - 0.005), color)
        for y in [*levels, height - 0.02]
    ]
    back = [box((-width / 2, 0.03, 0.0), (width / 2, height, 0.008), shade(color, 0.85))] if has_back else []
    return join(posts + boards + back)


def _stored(rng: np.random.Generator) -> Solid:
    kind = int(rng.integers(3))
    if kind == 0:
        return carton(rng, 0.3)
    if kind == 1:
        return cylinder(0.1, float(rng.uniform(0.2, 0.32)), pick(BRIGHTS, rng), 8)
    jars = [
        ellipsoid((0.12, 0.2, 0.12), shade(TERRACOTTA, rng.uniform(0.7, 1.2)), 7, 3).moved(x)
        for x in (-0.08, 0.08)
    ]
    return join(jars)


def carton(rng: np.random.Generator, size: float) -> Solid:
    """A cardboard box, a little turned, with a strip of tape."""
    width, height, depth = (float(rng.uniform(0.7, 1.0)) * size for _ in range(3))
    body = block(width, height, depth, (178, 142, 98))
    tape = block(0.05, 0.002, depth, PAPER, (0.0, height, 0.0))
    return join([body, tape]).turned(rng.uniform(-0.25, 0.25))


def sideboard(rng: np.random.Generator, style: Style) -> Piece:
    """A low cabinet on feet with things on it."""
    width, height, depth = float(rng.uniform(1.1, 1.7)), 0.72, 0.42
    body = [box((-width / 2, 0.12, 0.0), (width / 2, height, depth), style.colors.wood)]
    body.append(fronts(width, 0.15, height - 0.03, depth, 3, 1, shade(style.colors.wood, 1.12)))
    feet = [
        bar((x, 0.0, z), (x, 0.13, z), 0.02, IRON)
        for x in (-width / 2 + 0.1, width / 2 - 0.1)
        for z in (0.08, depth - 0.08)
    ]
    things = [thing.moved(z=depth / 2) for thing in scatter(width - 0.2, 0.2, height, 2, rng, style)]
    return Piece("sideboard", (join([*body, *feet, *things]),), 0.3)


def television(rng: np.random.Generator, style: Style) -> Piece:
    """A low board with a television, two speakers and a box."""
    width = float(rng.uniform(1.4, 1.9))
    board = [box((-width / 2, 0.1, 0.0), (width / 2, 0.45, 0.4), style.colors.wood)]
    board.append(fronts(width, 0.12, 0.43, 0.4, 2, 1, WHITE))
    board.append(box((-width / 2 + 0.05, 0.0, 0.05), (width / 2 - 0.05, 0.1, 0.35), IRON))
    panel = [
        block(1.15, 0.66, 0.05, BLACK, (0.0, 0.53, 0.16)),
        block(0.4, 0.02, 0.2, BLACK, (0.0, 0.45, 0.18)),
    ]
    panel.append(bar((0.0, 0.46, 0.16), (0.0, 0.55, 0.16), 0.03, BLACK))
    speakers = [cylinder(0.07, 0.3, IRON, 10).moved(x * (width / 2 - 0.1), 0.45, 0.2) for x in (-1, 1)]
    return Piece("television", (join([*board, *panel, *speakers]),), 0.4)


def dresser(rng: np.random.Generator, style: Style) -> Piece:
    """A chest of drawers with a round mirror above it."""
    width = float(rng.uniform(0.8, 1.1))
    body = [box((-width / 2, 0.05, 0.0), (width / 2, 0.85, 0.45), style.colors.wood)]
    body.append(fronts(width, 0.08, 0.82, 0.45, 2, 3, shade(style.colors.wood, 1.1)))
    body.append(box((-width / 2 + 0.05, 0.0, 0.04), (width / 2 - 0.05, 0.05, 0.4), BLACK))
    glass = cylinder(0.3, 0.025, MIRROR, 20).turned(np.pi / 2, "x").moved(0.0, 1.35, 0.01)
    thing = small_thing(rng, style).moved(rng.uniform(-0.25, 0.25), 0.85, 0.22)
    return Piece("dresser", (join([*body, glass, thing]),), 0.35)


def shoe_cabinet(rng: np.random.Generator, style: Style) -> Piece:
    """A flat cabinet for corridors."""
    width = float(rng.uniform(0.6, 0.9))
    body = [
        box((-width / 2, 0.05, 0.0), (width / 2, 0.95, 0.2), WHITE),
        fronts(width, 0.08, 0.92, 0.2, 1, 3, PAPER),
    ]
    return Piece("shoe_cabinet", (join([*body, small_thing(rng, style).moved(0.0, 0.95, 0.1)]),))


def coat_rack(rng: np.random.Generator, style: Style) -> Piece:
    """Coats on pegs over a board on the wall."""
    board = box((-0.45, 1.6, 0.0), (0.45, 1.7, 0.02), style.colors.wood)
    pegs = [bar((x, 1.65, 0.0), (x, 1.68, 0.09), 0.012, IRON) for x in (-0.3, 0.0, 0.3)]
    coats = [
        rounded(0.3, 0.85, 0.12, 0.05, shade(pick(BRIGHTS, rng), 0.75), 2).moved(x, 0.78, 0.075)
        for x in (-0.3, 0.3)
        if rng.random() < 0.8
    ]
    return Piece("coat_rack", (join([board, *pegs, *coats]),))


def toy_shelf(rng: np.random.Generator, style: Style) -> Piece:
    """A low shelf with coloured bins."""
    frame = _rack(1.0, 0.36, 0.8, [0.05, 0.42], WHITE)
    bins = [
        rounded(0.28, 0.22, 0.28, 0.05, pick(BRIGHTS, rng), 2).moved(x, y, 0.18)
        for y in (0.07, 0.44)
        for x in (-0.32, 0.0, 0.32)
    ]
    bear = [
        ellipsoid((0.2, 0.24, 0.18), (164, 118, 76), 10, 5),
        ellipsoid((0.15, 0.14, 0.14), (178, 132, 90), 8, 4).moved(y=0.2),
    ]
    return Piece("toy_shelf", (join([frame, *bins, join(bear).moved(0.2, 0.82, 0.18)]),), 0.3)
