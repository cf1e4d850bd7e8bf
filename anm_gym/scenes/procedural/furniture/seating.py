"""Things to sit on."""

# ruff: noqa: ARG001 - all makers have the signature of `Maker`, whatever they need of it

import numpy as np

from anm_gym.scenes.procedural.furniture.piece import Piece, Style, legs
from anm_gym.scenes.procedural.palette import BLACK, BRIGHTS, IRON, STEEL, pick, shade
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
    rounded,
)


def chair(style: Style, design: int) -> Solid:
    """A chair centred over the origin, its back at -z."""
    wood = style.colors.wood
    frame = [legs(0.42, 0.42, 0.44, wood, 0.018, 0.02 * (design % 2))]
    if design == 0:
        frame.append(rounded(0.43, 0.035, 0.43, 0.08, wood).moved(y=0.43))
        posts = [bar((x, 0.45, -0.18), (x, 0.9, -0.24), 0.016, wood, 4) for x in (-0.17, 0.17)]
        rails = [
            bar(
                (-0.18, y, -0.18 - 0.06 * (y - 0.45) / 0.45),
                (0.18, y, -0.18 - 0.06 * (y - 0.45) / 0.45),
                0.02,
                wood,
                4,
            )
            for y in (0.62, 0.76, 0.88)
        ]
        return join(frame + posts + rails)
    if design == 1:
        frame.append(cushion((0.45, 0.08, 0.44), style.colors.fabric, 0.4, 12, 4).moved(y=0.42))
        back = cushion((0.42, 0.44, 0.06), style.colors.fabric, 0.5, 12, 4).turned(-0.15, "x")
        return join([*frame, back.moved(0.0, 0.47, -0.2)])
    frame.append(lathe([(0.17, 0.0), (0.22, 0.02), (0.22, 0.05)], style.colors.accent, 14).moved(y=0.42))
    return join(
        [
            *frame,
            block(0.36, 0.3, 0.02, style.colors.accent).turned(-0.2, "x").moved(0.0, 0.5, -0.19),
            bar((0.0, 0.44, -0.15), (0.0, 0.6, -0.2), 0.02, IRON),
        ]
    )


def office_chair(rng: np.random.Generator, style: Style) -> Solid:
    """A swivel chair on a star base, centred over the origin, its back at -z."""
    color = shade(style.colors.fabric, 0.8)
    angles = np.arange(5) * (2 * np.pi / 5) + rng.uniform(0.0, 1.0)
    star = [bar((0.0, 0.1, 0.0), (0.28 * np.cos(a), 0.05, 0.28 * np.sin(a)), 0.02, BLACK) for a in angles]
    wheels = [
        ellipsoid((0.06, 0.06, 0.06), BLACK, 6, 3).moved(0.28 * np.cos(a), 0.0, 0.28 * np.sin(a))
        for a in angles
    ]
    column = cylinder(0.03, 0.34, STEEL, 8).moved(y=0.1)
    seat = cushion((0.5, 0.1, 0.48), color, 0.5, 12, 4).moved(y=0.44)
    back = cushion((0.44, 0.55, 0.09), color, 0.6, 12, 4).turned(-0.12, "x").moved(0.0, 0.52, -0.22)
    return join([*star, *wheels, column, seat, back])


def sofa(rng: np.random.Generator, style: Style) -> Piece:
    """A sofa with soft cushions, a low table and a rug before it; sometimes with a chaise longue."""
    seats = int(rng.integers(2, 4))
    width = 0.68 * seats + 0.4
    color = style.colors.fabric
    base = rounded(width, 0.26, 0.86, 0.06, shade(color, 0.85)).moved(0.0, 0.08, 0.45)
    feet = legs(width, 0.8, 0.08, style.colors.wood, 0.03).moved(z=0.45)
    back = cushion((width, 0.52, 0.24), color, 0.3, 16, 4).moved(0.0, 0.3, 0.13)
    arms = [
        cushion((0.2, 0.4, 0.86), color, 0.45, 12, 4).moved(x * (width / 2 - 0.1), 0.22, 0.45)
        for x in (-1, 1)
    ]
    pads = [
        cushion((0.67, 0.18, 0.66), shade(color, 1.08), 0.3, 12, 4).moved(
            (i - (seats - 1) / 2) * 0.68, 0.31, 0.54
        )
        for i in range(seats)
    ]
    throws = [
        cushion((0.42, 0.42, 0.14), style.colors.accent, 0.5, 12, 4)
        .turned(-0.35, "x")
        .turned(rng.uniform(-0.3, 0.3))
        .moved(x * (width / 2 - 0.38), 0.46, 0.36)
        for x in (-1, 1)
    ]
    whole = join([base, feet, back, *arms, *pads, *throws])
    parts = [whole]
    if rng.random() < 0.4:
        side = float(rng.choice([-1.0, 1.0]))
        chaise = [
            rounded(0.8, 0.28, 0.75, 0.08, shade(color, 0.85)),
            cushion((0.78, 0.18, 0.74), shade(color, 1.08), 0.3, 12, 4).moved(y=0.26),
        ]
        parts.append(join(chaise).moved(side * (width / 2 - 0.4), 0.03, 1.22))
    return Piece("sofa", tuple(parts))


def armchair(rng: np.random.Generator, style: Style) -> Piece:
    """A round upholstered chair."""
    color = style.colors.accent if rng.random() < 0.4 else style.colors.fabric
    seat = lathe([(0.34, 0.1), (0.38, 0.2), (0.37, 0.38), (0.2, 0.44)], shade(color, 1.05), 14)
    back = cushion((0.76, 0.6, 0.24), color, 0.7, 12, 4).moved(0.0, 0.3, -0.28)
    arms = [cushion((0.16, 0.34, 0.6), color, 0.7, 12, 4).moved(x * 0.34, 0.26, -0.02) for x in (-1, 1)]
    return Piece("armchair", (join([seat, back, *arms, legs(0.6, 0.6, 0.12, style.colors.wood, 0.022)]),))


def stool(rng: np.random.Generator, style: Style) -> Piece:
    """A round stool or a soft pouf."""
    if rng.random() < 0.5:
        return Piece("pouf", (cushion((0.5, 0.38, 0.5), style.colors.accent, 0.7, 12, 4),))
    seat = cylinder(0.17, 0.04, style.colors.wood, 12).moved(y=0.44)
    return Piece("stool", (join([seat, legs(0.28, 0.28, 0.45, style.colors.wood, 0.016, 0.05)]),))


def bean_bag(rng: np.random.Generator, style: Style) -> Piece:
    """A sack to sink into."""
    color = pick(BRIGHTS, rng)
    sack = lathe([(0.3, 0.0), (0.42, 0.14), (0.38, 0.32), (0.2, 0.58), (0.08, 0.68)], color, 14)
    return Piece("bean_bag", (sack.turned(0.1, "x").moved(y=0.02),))


def bench(rng: np.random.Generator, style: Style) -> Piece:
    """A narrow bench for a wall, with shoes under it."""
    width = float(rng.uniform(0.7, 1.1))
    top = box((-width / 2, 0.42, 0.0), (width / 2, 0.46, 0.3), style.colors.wood)
    cheeks = [
        box((x - 0.02, 0.0, 0.02), (x + 0.02, 0.42, 0.28), style.colors.wood)
        for x in (-width / 2 + 0.06, width / 2 - 0.06)
    ]
    shoes = [
        ellipsoid((0.1, 0.1, 0.26), pick(BRIGHTS, rng), 8, 3).moved(x, 0.0, 0.15)
        for x in np.arange(-width / 2 + 0.2, width / 2 - 0.15, 0.13)
    ]
    pad = cushion((width, 0.07, 0.3), style.colors.fabric, 0.3, 12, 3).moved(0.0, 0.46, 0.15)
    return Piece("bench", (join([top, *cheeks, *shoes, pad]),))
