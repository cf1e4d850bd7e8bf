"""Pianos, and what a gym or a children's room has besides furniture."""

# ruff: noqa: ARG001 - all makers have the signature of `Maker`, whatever they need of it

import numpy as np

from anm_gym.scenes.procedural.furniture.piece import Piece, Style
from anm_gym.scenes.procedural.palette import BLACK, BRIGHTS, CERAMIC, IRON, STEEL, pick, shade
from anm_gym.scenes.procedural.primitives import bar, block, box, cylinder, ellipsoid, extrude, join, rounded


def piano(rng: np.random.Generator, style: Style) -> Piece:
    """An upright piano with its stool."""
    color = BLACK if rng.random() < 0.5 else shade(style.colors.wood, 0.7)
    body = [
        box((-0.74, 0.0, 0.0), (0.74, 1.2, 0.34), color),
        box((-0.74, 0.62, 0.34), (0.74, 0.7, 0.6), color),
    ]
    keys = box((-0.62, 0.7, 0.4), (0.62, 0.72, 0.58), CERAMIC)
    feet = [bar((x, 0.0, 0.55), (x, 0.63, 0.55), 0.03, color) for x in (-0.7, 0.7)]
    seat = rounded(0.55, 0.08, 0.34, 0.05, IRON).moved(0.0, 0.42, 0.85)
    posts = [bar((x, 0.0, 0.85), (x, 0.43, 0.85), 0.03, color) for x in (-0.2, 0.2)]
    return Piece("piano", (join([*body, keys, *feet]), join([seat, *posts])))


def treadmill(rng: np.random.Generator, style: Style) -> Piece:
    """A treadmill whose console is at the wall; its deck is inclined."""
    deck = extrude([(0.0, -0.3), (0.16, -0.3), (0.24, 0.0), (0.16, 0.3), (0.0, 0.3)], 0.0, 0.1, BLACK)
    belt = box((-0.26, 0.0, 0.1), (0.26, 0.16, 1.55), BLACK).turned(0.04, "x").moved(y=0.08)
    rails = [bar((x, 0.1, 0.3), (x, 1.15, 0.12), 0.03, STEEL) for x in (-0.34, 0.34)]
    grips = [bar((x, 0.95, 0.15), (x, 0.9, 0.75), 0.02, IRON) for x in (-0.34, 0.34)]
    console = block(0.7, 0.25, 0.05, IRON, (0.0, 1.05, 0.1)).turned(-0.05, "x")
    return Piece("treadmill", (join([deck.moved(z=0.4), belt, *rails, *grips, console]),))


def weights(rng: np.random.Generator, style: Style) -> Piece:
    """A stand with dumbbells."""
    stand = [box((-0.5, y, 0.05), (0.5, y + 0.03, 0.35), IRON) for y in (0.3, 0.65)]
    posts = [bar((x, 0.0, 0.2), (x, 0.68, 0.2), 0.03, IRON) for x in (-0.45, 0.45)]
    bells = []
    for y in (0.39, 0.74):
        for x in np.arange(-0.38, 0.4, 0.25):
            bells.append(bar((x, y, 0.08), (x, y, 0.32), 0.014, STEEL))
            bells += [
                cylinder(0.06, 0.06, pick(BRIGHTS, rng), 8).turned(np.pi / 2, "x").moved(float(x), y, z)
                for z in (0.06, 0.28)
            ]
    return Piece("weights", (join([*stand, *posts, *bells]),), 0.3)


def exercise_ball(rng: np.random.Generator, style: Style) -> Piece:
    """A large ball."""
    size = float(rng.uniform(0.55, 0.7))
    return Piece("exercise_ball", (ellipsoid((size, size, size), pick(BRIGHTS, rng), 16, 9),))


def mat(rng: np.random.Generator, style: Style) -> Piece:
    """A thin mat on the floor."""
    return Piece("mat", (rounded(1.7, 0.015, 0.6, 0.04, pick(BRIGHTS, rng)),))


def tent(rng: np.random.Generator, style: Style) -> Piece:
    """A play tent: a cone of cloth with poles that stick out of its top."""
    cloth = cylinder(0.55, 1.2, style.colors.accent, 6, 0.06)
    poles = [
        bar(
            (0.5 * np.cos(a), 0.0, 0.5 * np.sin(a)),
            (-0.1 * np.cos(a), 1.4, -0.1 * np.sin(a)),
            0.014,
            style.colors.wood,
        )
        for a in np.arange(3) * 2.1
    ]
    return Piece("tent", (join([cloth, *poles]),))
