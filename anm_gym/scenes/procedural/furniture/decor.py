"""Lamps, plants, rugs, pictures, curtains, radiators, open door leaves and clutter on the floor."""

# ruff: noqa: ARG001 - all makers have the signature of `Maker`, whatever they need of it

import numpy as np

from anm_gym.scenes.procedural.furniture.piece import Piece, Style
from anm_gym.scenes.procedural.furniture.storage import carton
from anm_gym.scenes.procedural.palette import (
    BRASS,
    BRIGHTS,
    IRON,
    LEAVES,
    LIGHT,
    PAPER,
    SOIL,
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
    cushion,
    cylinder,
    ellipsoid,
    join,
    lathe,
    tube,
    wavy_sheet,
)


def floor_lamp(rng: np.random.Generator, style: Style) -> Piece:
    """A standing lamp: upright with a shade, or a long arc."""
    foot = cylinder(0.15, 0.025, IRON, 14)
    if rng.random() < 0.6:
        pole = bar((0.0, 0.0, 0.0), (0.0, 1.5, 0.0), 0.013, IRON)
        return Piece("floor_lamp", (join([foot, pole, cylinder(0.22, 0.28, LIGHT, 14, 0.14).moved(y=1.38)]),))
    angles = np.linspace(0.0, 0.75 * np.pi, 8)
    path = np.stack([np.zeros(8), 1.25 + 0.45 * np.sin(angles), 0.3 - 0.3 * np.cos(angles)], axis=1)
    pole = tube(np.concatenate([[[0.0, 0.0, 0.0]], path]), 0.014, BRASS)
    head = ellipsoid((0.26, 0.18, 0.26), LIGHT, 12, 5).moved(0.0, 1.4, 0.51)
    return Piece("arc_lamp", (join([foot, pole, head]),))


def pendant(rng: np.random.Generator, style: Style) -> Piece:
    """A lamp that hangs from the ceiling, above every head."""
    bottom = style.ceiling_m - float(rng.uniform(0.55, 0.65))
    cord = bar((0.0, bottom + 0.15, 0.0), (0.0, style.ceiling_m, 0.0), 0.006, IRON, 5)
    color = style.colors.accent if rng.random() < 0.5 else LIGHT
    if rng.random() < 0.5:
        shape = ellipsoid((0.36, 0.3, 0.36), color, 10, 5).moved(y=bottom)
    else:
        shape = lathe([(0.22, 0.0), (0.18, 0.1), (0.06, 0.2), (0.02, 0.22)], color, 14).moved(y=bottom)
    return Piece("pendant", (join([cord, shape]),))


def ceiling_light(rng: np.random.Generator, style: Style) -> Piece:
    """A flat round light on the ceiling."""
    return Piece(
        "ceiling_light",
        (lathe([(0.1, -0.09), (0.19, -0.06), (0.2, 0.0)], LIGHT, 12).moved(y=style.ceiling_m),),
    )


def plant(rng: np.random.Generator, style: Style) -> Piece:
    """A plant in a pot: a bush, a small tree or long leaves."""
    size = float(rng.uniform(0.8, 1.3))
    color = pick(LEAVES, rng)
    pot = lathe(
        [(0.11, 0.0), (0.16, 0.26), (0.17, 0.28), (0.14, 0.28)],
        TERRACOTTA if rng.random() < 0.5 else WHITE,
        12,
    )
    soil = cylinder(0.14, 0.01, SOIL, 12).moved(y=0.265)
    kind = int(rng.integers(3))
    if kind == 0:
        green = [ellipsoid((0.42 * size, 0.5 * size, 0.42 * size), color, 10, 4).moved(y=0.26)]
    elif kind == 1:
        balls = [(rng.uniform(-0.12, 0.12), 0.7 * size + 0.2 * i, rng.uniform(-0.12, 0.12)) for i in range(3)]
        green = [
            ellipsoid((0.36, 0.3, 0.36), shade(color, 0.85 + 0.12 * i), 9, 4).moved(*at)
            for i, at in enumerate(balls)
        ]
        green.append(bar((0.0, 0.27, 0.0), (0.0, 0.75 * size + 0.3, 0.0), 0.02, SOIL))
    else:
        green = [
            _leaf(turn + rng.uniform(-0.2, 0.2), 0.7 * size * rng.uniform(0.7, 1.1), color)
            for turn in np.arange(9) * 0.7
        ]
    return Piece("plant", (join([pot, soil, *green]),))


def _leaf(turn: float, length: float, color: tuple[int, int, int]) -> Solid:
    along = np.linspace(0.0, 1.0, 4)
    path = np.stack([np.zeros(4), 0.27 + length * np.sin(1.4 * along), 0.3 * along**2], axis=1)
    return tube(path, 0.022, color, 3).turned(turn)


def rug(rng: np.random.Generator, style: Style) -> Piece:
    """A flat rug, round or rectangular, with a border."""
    if rng.random() < 0.35:
        radius = float(rng.uniform(0.7, 1.1))
        disks = [
            cylinder(radius, 0.012, shade(style.colors.accent, 0.9), 28),
            cylinder(0.8 * radius, 0.016, style.colors.linen, 28),
        ]
        return Piece("rug", (join(disks),))
    width, depth = rng.uniform(1.5, 2.2), rng.uniform(1.0, 1.5)
    return Piece(
        "rug",
        (
            join(
                [
                    block(width, 0.012, depth, shade(style.colors.fabric, 0.8)),
                    block(width - 0.24, 0.016, depth - 0.24, style.colors.linen),
                ]
            ),
        ),
    )


def runner(rng: np.random.Generator, style: Style) -> Piece:
    """A long narrow rug."""
    length = float(rng.uniform(1.6, 2.6))
    return Piece(
        "runner",
        (
            join(
                [
                    block(length, 0.01, 0.6, style.colors.fabric),
                    block(length - 0.1, 0.013, 0.5, style.colors.linen),
                ]
            ),
        ),
    )


def picture(rng: np.random.Generator, style: Style) -> Piece:
    """A framed picture, a group of two or a round clock, hung high."""
    if rng.random() < 0.2:
        face = cylinder(0.16, 0.03, IRON, 12).turned(np.pi / 2, "x").moved(0.0, 1.75, 0.005)
        dial = cylinder(0.14, 0.01, PAPER, 12).turned(np.pi / 2, "x").moved(0.0, 1.75, 0.03)
        return Piece("clock", (join([face, dial]),))
    count = int(rng.integers(1, 3))
    frames = []
    for index in range(count):
        width, height = rng.uniform(0.35, 0.7), rng.uniform(0.35, 0.6)
        x = (index - (count - 1) / 2) * 0.85
        frames.append(block(width, height, 0.03, style.colors.wood, (x, 1.7 - height / 2, 0.02)))
        frames.append(block(width - 0.07, height - 0.07, 0.004, PAPER, (x, 1.735 - height / 2, 0.036)))
        frames.append(
            block(0.5 * width, 0.5 * height, 0.004, pick(BRIGHTS, rng), (x, 1.7 - height / 4, 0.039))
        )
    return Piece("picture", (join(frames),))


def folding_screen(rng: np.random.Generator, style: Style) -> Piece:
    """A screen of three panels that stands in a zigzag."""
    turn = float(rng.uniform(0.3, 0.6))
    reach = 0.5 * np.cos(turn)
    panels = [
        block(0.52, 1.7, 0.025, style.colors.fabric if i == 1 else style.colors.linen)
        .turned((-1) ** i * turn)
        .moved((i - 1) * reach)
        for i in range(3)
    ]
    posts = [
        bar((x * reach, 0.0, z), (x * reach, 1.75, z), 0.02, style.colors.wood)
        for x, z in (
            (-1.5, 0.25 * np.sin(turn)),
            (-0.5, -0.25 * np.sin(turn)),
            (0.5, 0.25 * np.sin(turn)),
            (1.5, -0.25 * np.sin(turn)),
        )
    ]
    return Piece("folding_screen", (join([*panels, *posts]),))


def column(rng: np.random.Generator, style: Style) -> Piece:
    """A round pillar from floor to ceiling."""
    top, radius = style.ceiling_m, float(rng.uniform(0.13, 0.2))
    profile = [
        (radius + 0.05, 0.0),
        (radius + 0.05, 0.12),
        (radius, 0.16),
        (radius, top - 0.12),
        (radius + 0.04, top),
    ]
    return Piece("column", (lathe(profile, WHITE, 16),))


def clutter(rng: np.random.Generator, style: Style) -> Piece:
    """Something left on the floor: a ball, a carton, a basket, a bag, a bin."""
    kind = int(rng.integers(5))
    if kind == 0:
        size = float(rng.uniform(0.16, 0.3))
        return Piece("ball", (ellipsoid((size, size, size), pick(BRIGHTS, rng), 12, 7),))
    if kind == 1:
        return Piece("carton", (carton(rng, float(rng.uniform(0.3, 0.5))),))
    if kind == 2:
        basket = lathe([(0.15, 0.0), (0.2, 0.3), (0.18, 0.3), (0.12, 0.05)], style.colors.wood, 12)
        return Piece(
            "basket", (join([basket, ellipsoid((0.28, 0.2, 0.28), style.colors.linen, 10, 4).moved(y=0.16)]),)
        )
    if kind == 3:
        bag = cushion((0.42, 0.34, 0.2), shade(pick(BRIGHTS, rng), 0.8), 0.6, 12, 5)
        angles = np.linspace(0.0, np.pi, 7)
        grip = tube(
            np.stack([0.1 * np.cos(angles), 0.3 + 0.14 * np.sin(angles), np.zeros(7)], axis=1), 0.012, IRON, 5
        )
        return Piece("bag", (join([bag, grip]),))
    return Piece("bin", (lathe([(0.1, 0.0), (0.14, 0.32), (0.125, 0.32), (0.09, 0.02)], IRON, 12),))


def toys(rng: np.random.Generator, style: Style) -> Piece:
    """Building blocks and a cone on the floor, low enough to step over or not."""
    blocks = [
        block(0.09, 0.08, 0.09, pick(BRIGHTS, rng))
        .turned(rng.uniform(0, 1.5))
        .moved(rng.uniform(-0.3, 0.3), 0.0, rng.uniform(-0.2, 0.2))
        for _ in range(5)
    ]
    cone = lathe([(0.08, 0.0), (0.06, 0.12), (0.01, 0.22)], pick(BRIGHTS, rng), 10)
    return Piece("toys", (join(blocks), cone))


def curtains(width_m: float, top_m: float, style: Style) -> Piece:
    """Two folded curtains on a rod, at the sides of a window."""
    rod = bar((-width_m / 2 - 0.3, top_m + 0.06, 0.06), (width_m / 2 + 0.3, top_m + 0.06, 0.06), 0.012, IRON)
    drop = top_m - 0.75
    sheets = [
        wavy_sheet(0.32, drop, style.colors.fabric, 2, 0.025).moved(
            side * (width_m / 2 + 0.06), top_m + 0.04 - drop, 0.05
        )
        for side in (-1, 1)
    ]
    return Piece("curtains", (*sheets, rod))


def sill(width_m: float, bottom_m: float, recess_m: float) -> Piece:
    """A sill and a cross of bars in the recess of a window; the wall's face is at z = 0."""
    board = box((-width_m / 2 - 0.05, bottom_m - 0.03, -0.001), (width_m / 2 + 0.05, bottom_m, 0.06), WHITE)
    ledge = box((-width_m / 2, bottom_m, -recess_m), (width_m / 2, bottom_m + 0.02, 0.0), WHITE)
    return Piece("sill", (join([board, ledge]),))


def window_bars(width_m: float, bottom_m: float, top_m: float, recess_m: float) -> Piece:
    """The frame of a window before its pane; the wall's face is at z = 0."""
    back, front, half = -recess_m, -recess_m + 0.04, width_m / 2
    uprights = [
        box((x - 0.025, bottom_m, back), (x + 0.025, top_m, front), WHITE)
        for x in (-half + 0.025, 0.0, half - 0.025)
    ]
    across = [
        box((-half, y - 0.025, back), (half, y + 0.025, front), WHITE)
        for y in (bottom_m + 0.025, top_m - 0.025)
    ]
    handle = bar(
        (0.03, (bottom_m + top_m) / 2, front + 0.02),
        (0.03, (bottom_m + top_m) / 2 + 0.1, front + 0.02),
        0.01,
        BRASS,
    )
    return Piece("window_bars", (join([*uprights, *across, handle]),))


def radiator(width_m: float) -> Piece:
    """A ribbed radiator for the wall under a window."""
    count = max(3, int(width_m / 0.13))
    ribs = [block(0.08, 0.5, 0.07, WHITE, ((i - (count - 1) / 2) * 0.13, 0.14, 0.07)) for i in range(count)]
    pipe = bar((-count * 0.065, 0.2, 0.07), (count * 0.065, 0.2, 0.07), 0.012, WHITE)
    return Piece("radiator", (join([*ribs, pipe]),))


def door_leaf(width_m: float, height_m: float, wood: tuple[int, int, int]) -> Piece:
    """A door leaf that hangs at the origin and reaches along +x, with handles on both sides."""
    leaf = box((0.0, 0.008, -0.02), (width_m, height_m - 0.01, 0.02), shade(wood, 1.1))
    panels = [
        box((0.14, low, -0.026), (width_m - 0.14, high, 0.026), wood)
        for low, high in ((0.2, 0.9), (1.15, height_m - 0.2))
    ]
    handles = [
        bar((width_m - 0.07, 1.03, side * 0.05), (width_m - 0.19, 1.03, side * 0.05), 0.011, BRASS)
        for side in (-1, 1)
    ]
    knobs = [
        bar((width_m - 0.07, 1.03, 0.0), (width_m - 0.07, 1.03, side * 0.05), 0.011, BRASS)
        for side in (-1, 1)
    ]
    return Piece("door_leaf", (join([leaf, *panels, *handles, *knobs]),))
