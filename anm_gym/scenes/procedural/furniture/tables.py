"""Tables, with what stands around and on them."""

import numpy as np

from anm_gym.scenes.procedural.furniture.decor import pendant
from anm_gym.scenes.procedural.furniture.piece import Piece, Style, books, fronts, legs, scatter, table_lamp
from anm_gym.scenes.procedural.furniture.seating import chair, office_chair
from anm_gym.scenes.procedural.palette import BLACK, CERAMIC, GLASS, IRON, STEEL
from anm_gym.scenes.procedural.primitives import (
    Solid,
    bar,
    block,
    box,
    cylinder,
    ellipsoid,
    join,
    lathe,
    rounded,
)

_TABLE_M = 0.74


def dining_set(rng: np.random.Generator, style: Style) -> Piece:
    """A table with its chairs and a lamp over it."""
    return _round_set(rng, style) if rng.random() < 0.4 else _long_set(rng, style, int(rng.integers(2, 4)))


def small_dining_set(rng: np.random.Generator, style: Style) -> Piece:
    """A table for two to four."""
    return _round_set(rng, style, 0.42) if rng.random() < 0.5 else _long_set(rng, style, 1)


def _round_set(rng: np.random.Generator, style: Style, radius: float = 0.55) -> Piece:
    wood = style.colors.wood
    top = cylinder(radius, 0.035, wood, 24).moved(y=_TABLE_M - 0.035)
    foot = lathe([(0.28, 0.0), (0.24, 0.04), (0.06, 0.08), (0.05, _TABLE_M - 0.03)], wood, 12)
    count, design = (3 if radius < 0.5 else 4), int(rng.integers(3))
    turns = np.arange(count) * (2 * np.pi / count) + rng.uniform(0.0, np.pi)
    seats = [
        chair(style, design).moved(z=-radius - rng.uniform(0.05, 0.2)).turned(turn + rng.uniform(-0.15, 0.15))
        for turn in turns
    ]
    things = scatter(radius, 0.4, _TABLE_M, 1, rng, style)
    lamp = pendant(rng, style).parts
    return Piece("round_table", (join([top, foot, *things]), *seats, *lamp))


def _long_set(rng: np.random.Generator, style: Style, pairs: int) -> Piece:
    length, depth = 0.62 * pairs + rng.uniform(0.25, 0.45), float(rng.uniform(0.78, 0.92))
    top = rounded(length, 0.04, depth, 0.04, style.colors.wood).moved(y=_TABLE_M - 0.04)
    table = [top, legs(length, depth, _TABLE_M - 0.03, style.colors.wood, 0.03)]
    table += scatter(length - 0.2, depth, _TABLE_M, pairs, rng, style)
    design = int(rng.integers(3))
    seats = []
    for side in (0.0, np.pi):
        for index in range(pairs):
            out = depth / 2 + rng.uniform(-0.05, 0.2)
            seat = (
                chair(style, design)
                .turned(rng.uniform(-0.2, 0.2))
                .moved((index - (pairs - 1) / 2) * 0.62, 0.0, -out)
            )
            seats.append(seat.turned(side))
    return Piece("dining_table", (join(table), *seats, *pendant(rng, style).parts))


def wall_table(rng: np.random.Generator, style: Style) -> Piece:
    """A small table at a wall with a chair at each free side."""
    width, depth = float(rng.uniform(0.75, 0.95)), 0.65
    top = rounded(width, 0.035, depth, 0.06, style.colors.wood).moved(0.0, _TABLE_M - 0.035, depth / 2)
    stand = legs(width, depth, _TABLE_M - 0.03, style.colors.wood, 0.024).moved(z=depth / 2)
    things = [thing.moved(z=depth / 2) for thing in scatter(width - 0.2, 0.2, _TABLE_M, 1, rng, style)]
    design = int(rng.integers(3))
    beside = [
        chair(style, design)
        .turned(-side * np.pi / 2 + rng.uniform(-0.2, 0.2))
        .moved(side * (width / 2 + rng.uniform(0.0, 0.15)), 0.0, depth / 2)
        for side in (-1, 1)
    ]
    before = (
        chair(style, design)
        .turned(np.pi + rng.uniform(-0.2, 0.2))
        .moved(0.0, 0.0, depth + rng.uniform(0.0, 0.2))
    )
    seats = beside[: int(rng.integers(1, 3))] + ([before] if rng.random() < 0.5 else [])
    return Piece("wall_table", (join([top, stand, *things]), *seats))


def coffee_table(rng: np.random.Generator, style: Style) -> Piece:
    """A low table on legs, oval or rectangular, with things on it."""
    if rng.random() < 0.5:
        plate = cylinder(0.4, 0.03, style.colors.wood, 20).moved(y=0.38)
        body = [plate, legs(0.55, 0.55, 0.39, IRON, 0.014, 0.04)]
    else:
        body = [
            rounded(0.95, 0.04, 0.55, 0.12, style.colors.wood).moved(y=0.38),
            legs(0.85, 0.5, 0.39, style.colors.wood),
        ]
    return Piece("coffee_table", (join([*body, *scatter(0.6, 0.3, 0.41, 1, rng, style)]),))


def side_table(rng: np.random.Generator, style: Style) -> Piece:
    """A small round table with a lamp."""
    foot = lathe([(0.15, 0.0), (0.13, 0.02), (0.02, 0.05), (0.02, 0.5)], IRON, 10)
    top = cylinder(0.22, 0.025, style.colors.wood, 16).moved(y=0.5)
    return Piece("side_table", (join([foot, top, table_lamp(rng, style.colors.accent).moved(y=0.525)]),))


def desk(rng: np.random.Generator, style: Style) -> Piece:
    """A desk with drawers, a screen, a lamp, books and a swivel chair."""
    width, wood = float(rng.uniform(1.2, 1.6)), style.colors.wood
    top = box((-width / 2, 0.71, 0.0), (width / 2, 0.74, 0.65), wood)
    chest = [
        box((-0.2, 0.0, 0.04), (0.2, 0.71, 0.6), style.colors.wood),
        fronts(0.4, 0.08, 0.7, 0.6, 1, 3, style.colors.linen),
    ]
    side = float(rng.choice([-1.0, 1.0]))
    stand = [
        bar((-side * (width / 2 - 0.05), 0.0, z), (-side * (width / 2 - 0.05), 0.72, z), 0.022, IRON)
        for z in (0.06, 0.59)
    ]
    shelf = books(0.35, rng).moved(side * (width / 2 - 0.2) - 0.17, 0.74, 0.05)
    lamp = table_lamp(rng, style.colors.accent).moved(-side * (width / 2 - 0.18), 0.74, 0.16)
    body = join(
        [
            top,
            join(chest).moved(x=side * (width / 2 - 0.22)),
            *stand,
            shelf,
            lamp,
            screen().moved(0.0, 0.74, 0.2),
        ]
    )
    seat = office_chair(rng, style).turned(np.pi + rng.uniform(-0.5, 0.5)).moved(-side * 0.1, 0.0, 0.85)
    return Piece("desk", (body, seat))


def screen() -> Solid:
    """A computer screen with a keyboard before it."""
    foot = [cylinder(0.11, 0.015, BLACK, 12), bar((0.0, 0.0, 0.0), (0.0, 0.2, 0.0), 0.02, STEEL)]
    panel = [
        block(0.56, 0.33, 0.03, BLACK, (0.0, 0.13, 0.02)),
        block(0.53, 0.3, 0.004, GLASS, (0.0, 0.145, 0.037)),
    ]
    mouse = ellipsoid((0.06, 0.035, 0.1), BLACK, 8, 3).moved(0.32, 0.0, 0.24)
    return join([*foot, *panel, block(0.42, 0.02, 0.14, CERAMIC, (0.0, 0.0, 0.24)), mouse])


def console(rng: np.random.Generator, style: Style) -> Piece:
    """A narrow table for the wall of a corridor."""
    width = float(rng.uniform(0.7, 1.0))
    top = rounded(width, 0.03, 0.28, 0.05, style.colors.wood).moved(0.0, 0.8, 0.14)
    stand = legs(width, 0.28, 0.81, IRON, 0.013).moved(z=0.14)
    things = [thing.moved(z=0.14) for thing in scatter(width - 0.2, 0.1, 0.83, 1, rng, style)]
    return Piece("console", (join([top, stand, *things]),))
