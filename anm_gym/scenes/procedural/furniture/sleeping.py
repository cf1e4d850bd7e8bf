"""Beds."""

# ruff: noqa: ARG001 - all makers have the signature of `Maker`, whatever they need of it

import numpy as np

from anm_gym.scenes.procedural.furniture.piece import Piece, Style, fronts, legs, table_lamp
from anm_gym.scenes.procedural.palette import WHITE, shade
from anm_gym.scenes.procedural.primitives import (
    Solid,
    bar,
    block,
    box,
    cushion,
    cylinder,
    ellipsoid,
    join,
    rounded,
)


def double_bed(rng: np.random.Generator, style: Style) -> Piece:
    """A bed for two with its head at the wall, and nightstands with lamps beside it."""
    width = float(rng.choice([1.4, 1.6, 1.8]))
    sides = (-1, 1) if rng.random() < 0.7 else (int(rng.choice([-1, 1])),)
    stands = [_nightstand(rng, style).moved(x=side * (width / 2 + 0.28)) for side in sides]
    return Piece("double_bed", (_bed(width, 2, rng, style), *stands))


def single_bed(rng: np.random.Generator, style: Style) -> Piece:
    """A bed for one with its head at the wall."""
    side = int(rng.choice([-1, 1]))
    return Piece("single_bed", (_bed(0.95, 1, rng, style), _nightstand(rng, style).moved(x=side * 0.77)))


def _bed(width: float, sleepers: int, rng: np.random.Generator, style: Style) -> Solid:
    wood = style.colors.wood
    frame = [
        block(width, 0.16, 2.05, wood, (0.0, 0.14, 1.05)),
        legs(width, 2.0, 0.15, wood, 0.035).moved(z=1.05),
    ]
    if rng.random() < 0.5:
        frame.append(
            cushion((width + 0.06, 0.75, 0.14), style.colors.fabric, 0.35, 16, 6).moved(0.0, 0.25, 0.07)
        )
    else:
        frame.append(rounded(width + 0.04, 0.85, 0.05, 0.02, wood).moved(0.0, 0.12, 0.025))
    mattress = cushion((width - 0.04, 0.24, 1.96), WHITE, 0.18, 16, 4).moved(0.0, 0.28, 1.06)
    quilt = cushion((width + 0.06, 0.2, 1.35), style.colors.linen, 0.25, 16, 4).moved(0.0, 0.36, 1.38)
    throw = cushion((width + 0.09, 0.22, 0.5), style.colors.accent, 0.22, 16, 4).moved(0.0, 0.36, 1.72)
    pitch = width / sleepers
    pillows = [
        cushion((min(0.68, pitch - 0.1), 0.17, 0.44), WHITE, 0.5, 12, 4)
        .turned(0.25, "x")
        .turned(rng.uniform(-0.12, 0.12))
        .moved((i - (sleepers - 1) / 2) * pitch, 0.5, 0.38)
        for i in range(sleepers)
    ]
    return join([*frame, mattress, quilt, throw, *pillows])


def _nightstand(rng: np.random.Generator, style: Style) -> Solid:
    body = [
        box((-0.2, 0.08, 0.0), (0.2, 0.5, 0.38), style.colors.wood),
        legs(0.4, 0.38, 0.09, style.colors.wood).moved(z=0.19),
    ]
    drawers = fronts(0.4, 0.1, 0.48, 0.38, 1, 2, shade(style.colors.wood, 1.12))
    return join([*body, drawers, table_lamp(rng, style.colors.accent).moved(0.0, 0.5, 0.18)])


def bunk_bed(rng: np.random.Generator, style: Style) -> Piece:
    """Two beds above each other, along the wall, with a ladder."""
    wood = style.colors.wood
    posts = [bar((x, 0.0, z), (x, 1.75, z), 0.035, wood) for x in (-1.0, 1.0) for z in (0.05, 0.95)]
    parts = list(posts)
    for y in (0.3, 1.25):
        parts.append(box((-1.0, y, 0.03), (1.0, y + 0.08, 0.97), wood))
        parts.append(cushion((1.92, 0.18, 0.9), style.colors.linen, 0.2, 12, 4).moved(0.0, y + 0.07, 0.5))
        parts.append(cushion((0.36, 0.14, 0.55), WHITE, 0.5, 12, 4).moved(-0.72, y + 0.2, 0.5))
        parts.append(bar((-1.0, y + 0.38, 0.95), (0.45, y + 0.38, 0.95), 0.02, wood))
    rungs = [bar((0.55, y, 1.0), (0.9, y, 1.0), 0.016, wood) for y in np.arange(0.3, 1.4, 0.28)]
    rails = [bar((x, 0.0, 1.02), (x, 1.6, 0.98), 0.02, wood) for x in (0.55, 0.9)]
    return Piece("bunk_bed", (join([*parts, *rungs, *rails]),))


def crib(rng: np.random.Generator, style: Style) -> Piece:
    """A small bed behind bars, with a mobile over it."""
    parts = [box((-0.62, 0.28, 0.02), (0.62, 0.36, 0.64), WHITE)]
    parts.append(cushion((1.16, 0.14, 0.56), style.colors.linen, 0.25, 14, 4).moved(0.0, 0.35, 0.33))
    for z in (0.02, 0.64):
        parts += [bar((x, 0.25, z), (x, 0.86, z), 0.01, WHITE, 5) for x in np.linspace(-0.6, 0.6, 9)]
        parts.append(bar((-0.62, 0.88, z), (0.62, 0.88, z), 0.02, WHITE))
    parts += [bar((x, 0.0, z), (x, 0.9, z), 0.025, WHITE) for x in (-0.62, 0.62) for z in (0.02, 0.64)]
    ball = [ellipsoid((0.1, 0.1, 0.1), style.colors.accent, 8, 4).moved(x, 1.15, 0.33) for x in (-0.15, 0.15)]
    arm = [
        bar((-0.62, 0.85, 0.33), (-0.55, 1.35, 0.33), 0.012, WHITE),
        bar((-0.55, 1.35, 0.33), (0.15, 1.35, 0.33), 0.01, WHITE),
    ]
    strings = [cylinder(0.004, 0.12, WHITE, 4).moved(x, 1.24, 0.33) for x in (-0.15, 0.15)]
    return Piece("crib", (join([*parts, *ball, *arm, *strings]),))
