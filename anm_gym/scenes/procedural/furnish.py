"""Place furniture in every room of a plan, so that all doors stay reachable."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from anm_gym.scenes.procedural.fittings import Fixture, ceiling_lights, door_leaves, window_fittings
from anm_gym.scenes.procedural.floor import Pose, RoomFloor
from anm_gym.scenes.procedural.furniture.piece import Maker, Piece, Style
from anm_gym.scenes.procedural.layout import stream
from anm_gym.scenes.procedural.palette import RoomColors
from anm_gym.scenes.procedural.plan import Layout, Wall
from anm_gym.scenes.procedural.primitives import Solid
from anm_gym.scenes.procedural.recipes import RECIPES, Item, Where

_TRIES = 12
_GAP_M = 0.02
_CORNER_GAP_M = 0.04


@dataclass(frozen=True, eq=False)
class Placement:
    """A piece of furniture where it stands."""

    name: str
    """What it is."""
    room: int
    """Index of the room."""
    solid: Solid
    """Its triangles, metres, plan frame."""


@dataclass
class _Room:
    """A room while it is being furnished."""

    layout: Layout
    index: int
    style: Style
    floor: RoomFloor
    rng: np.random.Generator
    anchor: tuple[Piece, Pose] | None = None
    """The last piece that others may face."""


def furnish(layout: Layout, colors: tuple[RoomColors, ...]) -> tuple[Placement, ...]:
    """Furnish all rooms.

    Args:
        layout: The plan.
        colors: Colours of each room.

    Returns:
        Furniture in the order of rooms; a piece that would cut a door off is left out.
    """
    placements: list[Placement] = []
    for index, room in enumerate(layout.rooms):
        style = Style(colors[index], room.ceiling_cm / 100.0)
        state = _Room(
            layout, index, style, RoomFloor(layout, index), stream(layout.tier, layout.seed, 2, index)
        )
        placements += _fit_out(state)
        for item in RECIPES[room.kind]:
            placements += _follow(state, item)
    return tuple(placements)


def _fit_out(room: _Room) -> list[Placement]:
    """Windows, radiators, door leaves and lights, which belong to the building."""
    fixtures: list[Fixture] = [
        *window_fittings(room.layout, room.index, room.style, room.rng),
        *door_leaves(room.layout, room.index, room.style, room.rng),
        *ceiling_lights(room.layout, room.index, room.style, room.rng),
    ]
    kept = []
    for fixture in fixtures:
        piece, pose = fixture.piece, fixture.pose
        if fixture.is_dropped_if_in_the_way:
            if not room.floor.try_take_fixture(piece.footprints, pose):
                continue
        else:
            room.floor.obstruct(piece.footprints, pose)
        kept.append(_place(room, piece, pose))
    return kept


def _follow(room: _Room, item: Item) -> list[Placement]:
    """Place as many pieces as a line of the recipe asks for."""
    wanted = item.count + int(item.per_m2 * room.layout.rooms[room.index].area_m2)
    placed = []
    for _ in range(wanted):
        if room.rng.random() < item.chance:
            makers = (item.maker,) if item.instead is None else (item.maker, item.instead)
            placed += next((found for maker in makers if (found := _place_one(room, maker, item.where))), [])
    return placed


def _place_one(room: _Room, maker: Maker, where: Where) -> list[Placement]:
    """Try a piece at several poses; an empty list when it fits nowhere."""
    piece = maker(room.rng, room.style)
    for pose in _poses(room, piece, where):
        if where is Where.FLAT or _fits(room, piece, pose, where):
            if where in (Where.WALL, Where.CORNER):
                room.anchor = piece, pose
            return [_place(room, piece, pose)]
    if where in (Where.WALL, Where.CORNER):
        room.anchor = None
    return []


def _fits(room: _Room, piece: Piece, pose: Pose, where: Where) -> bool:
    if where is Where.HUNG:
        low, high = piece.solid.low[0], piece.solid.high[0]
        free = room.floor.has_free_wall(float(low) - 0.05, float(high) + 0.05, pose)
        if free:
            room.floor.tall |= room.floor.covered(np.array([[low, 0.0, high, 0.1]]), pose)
        return free
    return room.floor.try_take(piece.footprints, pose, piece.front_m, piece.is_tall)


def _place(room: _Room, piece: Piece, pose: Pose) -> Placement:
    return Placement(
        piece.name, room.index, piece.solid.turned(pose.angle_rad).moved(pose.x_m, 0.0, pose.z_m)
    )


def _poses(room: _Room, piece: Piece, where: Where) -> Iterator[Pose]:
    if where in (Where.WALL, Where.CORNER, Where.HUNG):
        yield from _wall_poses(room, piece, where is Where.CORNER)
    elif where is Where.OPPOSITE:
        yield from _opposite_poses(room)
    elif where is Where.BEFORE:
        yield from _poses_before(room, piece)
    elif where is Where.FLAT:
        yield _flat_pose(room)
    elif where is Where.CENTER:
        yield from _center_poses(room)
    else:
        for _ in range(_TRIES):
            yield Pose(*room.floor.free_position(room.rng), float(room.rng.uniform(-np.pi, np.pi)))


def _wall_poses(room: _Room, piece: Piece, at_end: bool) -> Iterator[Pose]:
    """Poses with the back to a wall: anywhere along it, or (at first) at one of its ends."""
    walls = list(room.layout.walls_of(room.index))
    lengths = np.array([wall.length_cm for wall, _ in walls], np.float64)
    low, high = float(piece.solid.low[0]), float(piece.solid.high[0])
    for attempt in range(2 * _TRIES):
        wall, side = walls[int(room.rng.choice(len(walls), p=lengths / lengths.sum()))]
        start, stop = wall.low_cm / 100.0 + 0.1, wall.high_cm / 100.0 - 0.1
        span = stop - start - (high - low)
        if span < 0.0:
            continue
        slide = float(room.rng.uniform(0.0, span))
        if at_end and attempt < _TRIES:
            slide = _CORNER_GAP_M if slide < span / 2 else span - _CORNER_GAP_M
        yield _against(wall, side, start + slide, low, high, float(piece.solid.low[2]))


def _against(wall: Wall, side: int, start_m: float, low_m: float, high_m: float, back_m: float = 0.0) -> Pose:
    """Pose of a piece whose extent [low, high] begins at a place along a wall and whose back touches it."""
    face = wall.line_cm / 100.0 + side * (wall.half_cm / 100.0 + _GAP_M - min(back_m, 0.0))
    if wall.along_x:
        middle = start_m - low_m if side > 0 else start_m + high_m
        return Pose(middle, face, 0.0 if side > 0 else np.pi)
    middle = start_m + high_m if side > 0 else start_m - low_m
    return Pose(face, middle, np.pi / 2 if side > 0 else -np.pi / 2)


def _opposite_poses(room: _Room) -> Iterator[Pose]:
    """Poses at the walls that the anchor looks at, as nearly in front of it as possible."""
    if room.anchor is None:
        return
    _, anchor = room.anchor
    angle = anchor.angle_rad + np.pi
    for wall, side in room.layout.walls_of(room.index):
        pose = _against(wall, side, 0.0, 0.0, 0.0)
        if np.cos(pose.angle_rad - angle) < 0.9:
            continue
        for shift in np.linspace(0.0, 0.8, 5):
            for sign in (-1.0, 1.0):
                along = sign * float(shift)
                x, z = (anchor.x_m + along, pose.z_m) if wall.along_x else (pose.x_m, anchor.z_m + along)
                yield Pose(x, z, pose.angle_rad)


def _poses_before(room: _Room, piece: Piece) -> Iterator[Pose]:
    if room.anchor is None:
        return
    anchor_piece, anchor = room.anchor
    reach = float(anchor_piece.footprints[0][3]) - float(piece.solid.low[2])
    for gap in (0.3, 0.4, 0.5, 0.62):
        yield Pose(
            anchor.x_m + (reach + gap) * np.sin(anchor.angle_rad),
            anchor.z_m + (reach + gap) * np.cos(anchor.angle_rad),
            anchor.angle_rad + float(room.rng.uniform(-0.06, 0.06)),
        )


def _flat_pose(room: _Room) -> Pose:
    """Middle of the largest rectangle, along its longer side."""
    rect = room.layout.rooms[room.index].rects[0]
    angle = 0.0 if rect.width_cm >= rect.depth_cm else np.pi / 2
    return Pose((rect.x0 + rect.x1) / 200.0, (rect.z0 + rect.z1) / 200.0, angle)


def _center_poses(room: _Room) -> Iterator[Pose]:
    for attempt in range(_TRIES):
        x, z = room.floor.roomiest() if attempt < _TRIES // 2 else room.floor.free_position(room.rng)
        shift = room.rng.uniform(-0.15, 0.15, 2)
        turn = float(room.rng.integers(2)) * np.pi / 2 + float(room.rng.uniform(-0.12, 0.12))
        yield Pose(x + float(shift[0]), z + float(shift[1]), turn)
