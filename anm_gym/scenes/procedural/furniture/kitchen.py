"""Kitchens: counters with sink, stove and wall cabinets, refrigerators, islands."""

# ruff: noqa: ARG001 - all makers have the signature of `Maker`, whatever they need of it

import numpy as np

from anm_gym.scenes.procedural.furniture.piece import Piece, Style, bowl, fronts, scatter
from anm_gym.scenes.procedural.furniture.seating import stool
from anm_gym.scenes.procedural.palette import BLACK, BRIGHTS, CERAMIC, IRON, STEEL, STONE, WHITE, pick, shade
from anm_gym.scenes.procedural.primitives import Solid, bar, block, box, cylinder, join, lathe, rounded, tube

_TOP_M = 0.9
_DEPTH_M = 0.6


def counter(rng: np.random.Generator, style: Style) -> Piece:
    """A kitchen line: cupboards, sink, stove with a hood, wall cabinets above."""
    return _counter(rng, style, int(rng.integers(4, 6)), True)


def short_counter(rng: np.random.Generator, style: Style) -> Piece:
    """A kitchen line of three cupboards, which fits almost everywhere."""
    return _counter(rng, style, 3, True)


def low_counter(rng: np.random.Generator, style: Style) -> Piece:
    """A kitchen line without wall cabinets, so that it may stand under a window."""
    return _counter(rng, style, int(rng.integers(2, 4)), False)


def _counter(rng: np.random.Generator, style: Style, modules: int, has_wall_cabinets: bool) -> Piece:
    width = 0.6 * modules
    color = WHITE if rng.random() < 0.5 else style.colors.wood
    base = [
        box((-width / 2 + 0.02, 0.0, 0.0), (width / 2 - 0.02, 0.1, _DEPTH_M - 0.06), IRON),
        box((-width / 2, 0.1, 0.0), (width / 2, _TOP_M - 0.04, _DEPTH_M - 0.02), color),
        fronts(width, 0.12, _TOP_M - 0.05, _DEPTH_M - 0.02, modules, 1, shade(color, 1.05)),
        box((-width / 2, _TOP_M - 0.04, 0.0), (width / 2, _TOP_M, _DEPTH_M + 0.02), STONE),
    ]
    places = rng.permutation(modules)
    sink_x, stove_x, thing_x = (float(-width / 2 + 0.3 + 0.6 * places[i % modules]) for i in range(3))
    low = [*base, _sink().moved(x=sink_x), _stove().moved(x=stove_x)]
    if modules > 2:
        low.append(bowl(pick(BRIGHTS, rng)).moved(thing_x, _TOP_M, 0.32))
    parts = [join(low)]
    if has_wall_cabinets:
        parts.append(_wall_cabinets(width, stove_x, color))
    return Piece("counter", tuple(parts), 0.6)


def _sink() -> Solid:
    rim = rounded(0.5, 0.012, 0.4, 0.06, STEEL).moved(0.0, _TOP_M, 0.32)
    basin = rounded(0.42, 0.004, 0.32, 0.06, shade(STEEL, 0.7)).moved(0.0, _TOP_M + 0.012, 0.32)
    angles = np.linspace(0.0, np.pi, 6)
    arch = np.stack(
        [np.zeros(6), _TOP_M + 0.24 + 0.09 * np.sin(angles), 0.17 - 0.09 * np.cos(angles)], axis=1
    )
    spout = np.concatenate([[[0.0, _TOP_M, 0.08]], arch, [[0.0, _TOP_M + 0.18, 0.26]]])
    return join([rim, basin, tube(spout, 0.013, STEEL)])


def _stove() -> Solid:
    plate = block(0.56, 0.01, 0.5, BLACK, (0.0, _TOP_M, 0.32))
    rings = [
        cylinder(r, 0.006, IRON, 14).moved(x, _TOP_M + 0.01, z)
        for x, z, r in ((-0.14, 0.2, 0.08), (0.14, 0.2, 0.1), (-0.14, 0.44, 0.1), (0.14, 0.44, 0.08))
    ]
    pot = lathe(
        [(0.1, 0.0), (0.11, 0.14), (0.1, 0.145), (0.02, 0.17), (0.015, 0.19)], (150, 60, 54), 14
    ).moved(0.14, _TOP_M + 0.016, 0.2)
    oven = block(0.54, 0.42, 0.02, BLACK, (0.0, 0.3, _DEPTH_M + 0.006))
    handle = bar((-0.22, 0.66, _DEPTH_M + 0.04), (0.22, 0.66, _DEPTH_M + 0.04), 0.012, STEEL)
    return join([plate, *rings, pot, oven, handle])


def _wall_cabinets(width: float, stove_x: float, color: tuple[int, int, int]) -> Solid:
    parts = []
    for x in np.arange(-width / 2 + 0.3, width / 2, 0.6):
        if abs(x - stove_x) < 0.1:
            parts.append(
                lathe([(0.3, 0.0), (0.28, 0.06), (0.1, 0.22), (0.1, 0.6)], STEEL, 4)
                .turned(np.pi / 4)
                .moved(float(x), 1.6, 0.22)
            )
            continue
        parts.append(box((x - 0.3, 1.45, 0.0), (x + 0.3, 2.1, 0.33), color))
        parts.append(fronts(0.6, 1.46, 2.09, 0.33, 1, 1, shade(color, 1.05)).moved(x=float(x)))
    return join(parts)


def fridge(rng: np.random.Generator, style: Style) -> Piece:
    """A refrigerator with two doors."""
    color = STEEL if rng.random() < 0.5 else CERAMIC
    body = rounded(0.62, 1.82, 0.62, 0.03, color, 2).moved(0.0, 0.02, 0.33)
    doors = [
        box((-0.3, low, 0.64), (0.3, high, 0.67), shade(color, 1.05))
        for low, high in ((0.06, 0.62), (0.65, 1.82))
    ]
    grips = [
        bar((-0.24, low, 0.7), (-0.24, high, 0.7), 0.012, IRON) for low, high in ((0.4, 0.58), (0.75, 1.2))
    ]
    return Piece("fridge", (join([body, *doors, *grips]),), 0.5)


def island(rng: np.random.Generator, style: Style) -> Piece:
    """A free-standing counter with two stools."""
    width = float(rng.uniform(1.2, 1.6))
    body = block(width - 0.1, 0.86, 0.55, style.colors.wood)
    top = rounded(width, 0.04, 0.85, 0.08, STONE).moved(0.0, 0.86, 0.1)
    seats = [join(stool(rng, style).parts).moved(x, 0.0, 0.62) for x in (-0.35, 0.35)]
    return Piece("island", (join([body, top, *scatter(width - 0.2, 0.3, 0.9, 2, rng, style)]), *seats))
