"""What belongs to the building, not to a recipe: window frames, curtains, radiators, door leaves, lights."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from anm_gym.scenes.procedural.floor import Pose
from anm_gym.scenes.procedural.furniture import decor
from anm_gym.scenes.procedural.furniture.piece import Piece, Style
from anm_gym.scenes.procedural.plan import Layout, Opening
from anm_gym.scenes.procedural.shell import recess_cm

_LIT_M2 = 3.0
_LEAF_OPEN_RAD = 1.45


@dataclass(frozen=True, eq=False)
class Fixture:
    """A part of the building and where it is."""

    piece: Piece
    """What it is."""
    pose: Pose
    """Where it is, plan frame."""
    is_dropped_if_in_the_way: bool = False
    """Whether it has to leave when a door would be cut off."""


def window_fittings(layout: Layout, index: int, style: Style, rng: np.random.Generator) -> Iterator[Fixture]:
    """Frames and sills in all windows of a room; curtains and radiators at some."""
    for opening in layout.windows:
        if index not in opening.rooms or opening.kind != "window":
            continue
        pose = _facing_in(opening)
        width, bottom, top = opening.width_m, opening.bottom_cm / 100.0, opening.top_cm / 100.0
        recess = recess_cm(opening)
        depth = min(recess.width_cm, recess.depth_cm) / 100.0
        yield Fixture(decor.window_bars(width, bottom, top, depth), pose)
        yield Fixture(decor.sill(width, bottom, depth), pose)
        if bottom < 1.0 and rng.random() < 0.5:
            yield Fixture(decor.curtains(width, top, style), pose)
        if rng.random() < 0.45:
            yield Fixture(decor.radiator(0.8 * width), pose, True)


def door_leaves(layout: Layout, index: int, style: Style, rng: np.random.Generator) -> Iterator[Fixture]:
    """Open leaves of some of the doors, each in the first of its two rooms."""
    for door in layout.doors:
        if door.kind != "door" or door.rooms[0] != index or rng.random() < 0.45:
            continue
        wall = door.wall
        hinge = (door.low_cm if rng.random() < 0.5 else door.high_cm) / 100.0
        along = 1.0 if hinge * 100.0 == door.low_cm else -1.0
        face = (wall.line_cm - wall.half_cm) / 100.0 - 0.03
        swing = _LEAF_OPEN_RAD + float(rng.uniform(0.0, 0.35))
        direction = (along * np.cos(swing), -np.sin(swing))
        dx, dz = direction if wall.along_x else direction[::-1]
        x, z = (hinge - 0.03 * along, face) if wall.along_x else (face, hinge - 0.03 * along)
        piece = decor.door_leaf(door.width_m - 0.02, door.height_m, style.colors.wood)
        yield Fixture(piece, Pose(x, z, float(np.arctan2(-dz, dx))), True)


def ceiling_lights(layout: Layout, index: int, style: Style, rng: np.random.Generator) -> Iterator[Fixture]:
    """A light in the middle of each larger rectangle of a room, several along corridors."""
    room = layout.rooms[index]
    hangs = style.ceiling_m >= 2.5 and not room.is_corridor and rng.random() < 0.5
    for rect in room.rects:
        if rect.area_m2 < _LIT_M2:
            continue
        count = max(1, round(max(rect.width_cm, rect.depth_cm) / 400)) if room.is_corridor else 1
        for share in (np.arange(count) + 0.5) / count:
            fraction = (share, 0.5) if rect.width_cm > rect.depth_cm else (0.5, share)
            x = (rect.x0 + fraction[0] * rect.width_cm) / 100.0
            z = (rect.z0 + fraction[1] * rect.depth_cm) / 100.0
            maker = decor.pendant if hangs else decor.ceiling_light
            yield Fixture(maker(rng, style), Pose(x, z, 0.0))


def _facing_in(opening: Opening) -> Pose:
    """Pose at the middle of an opening on the inner face of its wall, the front into the room."""
    wall = opening.wall
    face = (wall.line_cm + opening.inward * wall.half_cm) / 100.0
    middle = (opening.low_cm + opening.high_cm) / 200.0
    if wall.along_x:
        return Pose(middle, face, 0.0 if opening.inward > 0 else np.pi)
    return Pose(face, middle, np.pi / 2 if opening.inward > 0 else -np.pi / 2)
