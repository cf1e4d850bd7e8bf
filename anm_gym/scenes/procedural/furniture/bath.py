"""Bathrooms and laundries."""

# ruff: noqa: ARG001 - all makers have the signature of `Maker`, whatever they need of it

import numpy as np

from anm_gym.scenes.procedural.furniture.piece import Piece, Style
from anm_gym.scenes.procedural.palette import CERAMIC, GLASS, IRON, MIRROR, STEEL, WATER, shade
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
    tube,
)


def toilet(rng: np.random.Generator, style: Style) -> Piece:
    """A toilet with its cistern, a brush and a roll of paper."""
    foot = lathe([(0.13, 0.0), (0.11, 0.16), (0.19, 0.32), (0.2, 0.4)], CERAMIC, 14)
    bowl = Solid(foot.vertices * (1.0, 1.0, 1.3), foot.faces, foot.colors).moved(z=0.42)
    lid = cushion((0.4, 0.05, 0.5), CERAMIC, 0.8, 16, 3).moved(0.0, 0.39, 0.42)
    cistern = rounded(0.4, 0.36, 0.18, 0.04, CERAMIC).moved(0.0, 0.42, 0.1)
    button = cylinder(0.03, 0.012, STEEL, 10).moved(0.0, 0.78, 0.1)
    brush = cylinder(0.05, 0.3, IRON, 8).moved(0.32, 0.0, 0.12)
    return Piece("toilet", (join([bowl, lid, cistern, button, brush]),), 0.3)


def bathtub(rng: np.random.Generator, style: Style) -> Piece:
    """A tub along the wall, filled, with a tap; it is hollow."""
    length, depth = float(rng.choice([1.5, 1.6, 1.7])), 0.72
    angles = np.arange(20) * (2.0 * np.pi / 20) + np.pi / 20
    shape = (
        np.sign(np.stack([np.cos(angles), np.sin(angles)]))
        * np.abs(np.stack([np.cos(angles), np.sin(angles)])) ** 0.45
    )
    tub = lathe([(0.42, 0.0), (0.5, 0.5), (0.5, 0.54), (0.44, 0.54), (0.38, 0.3)], CERAMIC, 20)
    ring = np.hypot(tub.vertices[:, 0], tub.vertices[:, 2])
    turn = np.concatenate([np.tile(np.arange(20), 5), [0, 0]])
    oval = np.stack(
        [ring * shape[0, turn] * length, tub.vertices[:, 1], ring * shape[1, turn] * depth], axis=1
    )
    body = Solid(oval, tub.faces, tub.colors)
    water = np.all(body.vertices[body.faces][:, :, 1] < 0.31, axis=1) & np.all(
        body.vertices[body.faces][:, :, 1] > 0.29, axis=1
    )
    colors = body.colors.copy()
    colors[water] = WATER
    filled = Solid(body.vertices, body.faces[:, ::-1].copy() if _is_inside_out(body) else body.faces, colors)
    tap = tube(
        [(length / 2 - 0.1, 0.54, 0.0), (length / 2 - 0.1, 0.68, 0.0), (length / 2 - 0.25, 0.68, 0.0)],
        0.018,
        STEEL,
    )
    return Piece("bathtub", (join([filled, tap]).moved(z=depth / 2 + 0.01),))


def _is_inside_out(solid: Solid) -> bool:
    first, second, third = solid.vertices[solid.faces].transpose(1, 0, 2)
    return float(np.einsum("ij,ij->i", first, np.cross(second, third)).sum()) < 0.0


def shower(rng: np.random.Generator, style: Style) -> Piece:
    """A shower tray for a corner, with one pane of glass, a column and a round head."""
    tray = box((-0.44, 0.0, 0.0), (0.44, 0.07, 0.88), CERAMIC)
    side = float(rng.choice([-1.0, 1.0]))
    pane = block(0.02, 1.9, 0.86, GLASS, (side * 0.43, 0.06, 0.44))
    column = tube([(0.0, 0.9, 0.03), (0.0, 2.05, 0.03), (0.0, 2.1, 0.15), (0.0, 2.08, 0.3)], 0.013, STEEL)
    head = cylinder(0.11, 0.02, STEEL, 14).moved(0.0, 2.04, 0.32)
    return Piece("shower", (join([tray, pane]), column, head))


def washbasin(rng: np.random.Generator, style: Style) -> Piece:
    """A basin on a cabinet with a mirror above it."""
    width = float(rng.uniform(0.6, 0.95))
    cabinet = box((-width / 2, 0.25, 0.0), (width / 2, 0.78, 0.44), style.colors.wood)
    top = box((-width / 2 - 0.01, 0.78, 0.0), (width / 2 + 0.01, 0.81, 0.46), CERAMIC)
    basin = lathe([(0.12, 0.0), (0.2, 0.09), (0.21, 0.12), (0.18, 0.12), (0.1, 0.04)], CERAMIC, 16).moved(
        0.0, 0.81, 0.25
    )
    tap = tube([(0.0, 0.81, 0.05), (0.0, 1.02, 0.05), (0.0, 1.02, 0.18)], 0.013, STEEL)
    mirror = block(width - 0.1, 0.7, 0.02, MIRROR, (0.0, 1.15, 0.012))
    soap = lathe([(0.03, 0.0), (0.035, 0.1), (0.01, 0.13), (0.01, 0.16)], style.colors.accent, 8).moved(
        width / 2 - 0.08, 0.81, 0.2
    )
    return Piece("washbasin", (join([cabinet, top, basin, tap, mirror, soap]),), 0.35)


def washing_machine(rng: np.random.Generator, style: Style) -> Piece:
    """A washing machine with a round door and a basket on top."""
    body = rounded(0.6, 0.85, 0.58, 0.02, CERAMIC, 2).moved(z=0.3)
    door = cylinder(0.18, 0.03, GLASS, 18).turned(np.pi / 2, "x").moved(0.0, 0.42, 0.585)
    ring = cylinder(0.21, 0.015, STEEL, 18).turned(np.pi / 2, "x").moved(0.0, 0.42, 0.58)
    panel = block(0.54, 0.09, 0.01, IRON, (0.0, 0.72, 0.592))
    basket = lathe([(0.16, 0.0), (0.22, 0.22), (0.2, 0.22), (0.14, 0.03)], style.colors.wood, 12).moved(
        0.0, 0.85, 0.3
    )
    towel = ellipsoid((0.3, 0.2, 0.28), style.colors.linen, 10, 4).moved(0.0, 0.92, 0.3)
    return Piece("washing_machine", (join([body, door, ring, panel, basket, towel]),), 0.4)


def towel_rail(rng: np.random.Generator, style: Style) -> Piece:
    """A heated rail on the wall with a towel over it."""
    rungs = [bar((-0.25, y, 0.05), (0.25, y, 0.05), 0.012, STEEL, 5) for y in np.arange(0.75, 1.5, 0.12)]
    posts = [bar((x, 0.7, 0.05), (x, 1.55, 0.05), 0.016, STEEL, 5) for x in (-0.25, 0.25)]
    towel = rounded(0.34, 0.5, 0.05, 0.02, shade(style.colors.linen, 0.95), 2).moved(0.0, 1.0, 0.06)
    return Piece("towel_rail", (join([*rungs, *posts, towel]),))


def drying_rack(rng: np.random.Generator, style: Style) -> Piece:
    """A folding rack with cloths hanging from it."""
    parts = [bar((x, 0.0, z), (x, 0.95, -z), 0.012, STEEL, 5) for x in (-0.45, 0.45) for z in (-0.28, 0.28)]
    parts += [bar((-0.47, 0.95, z), (0.47, 0.95, z), 0.009, STEEL, 5) for z in (-0.28, -0.1, 0.1, 0.28)]
    parts += [
        block(0.3, 0.45, 0.012, color, (x, 0.5, z))
        for x, z, color in ((-0.25, -0.1, style.colors.accent), (0.15, 0.1, style.colors.linen))
    ]
    return Piece("drying_rack", (join(parts),))
