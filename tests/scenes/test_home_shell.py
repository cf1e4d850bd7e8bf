"""The bare home is one closed surface with a tunnel for each loop of rooms."""

import numpy as np
import pytest
from numpy.typing import NDArray

from anm_gym.scenes.procedural.layout import plan_home, stream
from anm_gym.scenes.procedural.openings import find_walls
from anm_gym.scenes.procedural.palette import GLASS, WOODS, draw_colors
from anm_gym.scenes.procedural.plan import Layout, Opening, Rect, Room, Wall
from anm_gym.scenes.procedural.primitives import Solid
from anm_gym.scenes.procedural.shell import build_shell
from anm_gym.scenes.procedural.tiers import TIERS


def shell_of(layout: Layout) -> Solid:
    rng = stream(layout.tier, layout.seed, 1)
    return build_shell(layout, tuple(draw_colors(room.kind, WOODS[0], rng) for room in layout.rooms))


def directed_edges(solid: Solid) -> NDArray[np.int32]:
    """(3 F, 2) edges of all faces in their direction."""
    return np.concatenate([solid.faces[:, pair] for pair in ([0, 1], [1, 2], [2, 0])])


def air_m3(solid: Solid) -> float:
    """Volume inside a surface whose normals point inwards."""
    first, second, third = solid.vertices[solid.faces].transpose(1, 0, 2)
    return float(-np.einsum("ij,ij->i", first, np.cross(second, third)).sum() / 6.0)


def one_room(*openings: Opening) -> Layout:
    """A room of 4 x 3 m between wall centre lines and 2.5 m high."""
    rooms = (Room("bedroom", (Rect(0, 0, 400, 300),), 250),)
    return Layout("studio", 0, 0.0, rooms, find_walls(rooms), (), openings)


def two_rooms(door: bool) -> Layout:
    rooms = (
        Room("bedroom", (Rect(0, 0, 400, 300),), 250),
        Room("kids", (Rect(400, 0, 700, 300),), 250),
    )
    opening = Opening("door", Wall(False, 400, 0, 300, (0, 1)), 100, 190, 0, 200)
    return Layout("flat", 0, 0.0, rooms, find_walls(rooms), (opening,) if door else (), ())


@pytest.mark.parametrize("tier", TIERS)
@pytest.mark.parametrize("seed", range(3))
def test_shell_is_closed_and_consistently_wound(tier: str, seed: int) -> None:
    edges = directed_edges(shell_of(plan_home(tier, seed)))
    directed, counts = np.unique(edges, axis=0, return_counts=True)
    assert (counts == 1).all()
    assert np.array_equal(directed, np.unique(edges[:, ::-1], axis=0))


@pytest.mark.parametrize("tier", TIERS)
@pytest.mark.parametrize("seed", range(3))
def test_each_loop_of_rooms_is_a_tunnel_of_the_shell(tier: str, seed: int) -> None:
    layout = plan_home(tier, seed)
    shell = shell_of(layout)
    num_edges = len(np.unique(np.sort(directed_edges(shell), axis=1), axis=0))
    assert len(shell.vertices) - num_edges + len(shell.faces) == 2 - 2 * layout.num_loops


def test_air_of_one_room_is_the_box_between_its_walls() -> None:
    assert air_m3(shell_of(one_room())) == pytest.approx(3.8 * 2.8 * 2.5)


def test_a_door_adds_its_passage_through_the_wall() -> None:
    closed, opened = shell_of(two_rooms(door=False)), shell_of(two_rooms(door=True))
    assert air_m3(opened) - air_m3(closed) == pytest.approx(0.9 * 2.0 * 0.1)


def test_a_window_is_a_recess_with_a_pane() -> None:
    wall = next(wall for wall in one_room().walls if wall.along_x and wall.line_cm == 0)
    shell = shell_of(one_room(Opening("window", wall, 100, 250, 90, 210)))
    assert air_m3(shell) - air_m3(shell_of(one_room())) == pytest.approx(1.5 * 1.2 * 0.14)
    pane = shell.vertices[shell.faces[(shell.colors == GLASS).all(axis=1)]]
    np.testing.assert_allclose(pane[..., 2], -0.04)


def test_lower_ceilings_are_built_lower() -> None:
    rooms = (
        Room("bedroom", (Rect(0, 0, 400, 300),), 280),
        Room("bathroom", (Rect(400, 0, 700, 300),), 240),
    )
    shell = shell_of(Layout("flat", 0, 0.0, rooms, find_walls(rooms), (), ()))
    assert air_m3(shell) == pytest.approx(3.85 * 2.8 * 2.8 + 2.85 * 2.8 * 2.4)


def test_room_with_a_corner_has_no_wall_inside() -> None:
    rooms = (Room("living", (Rect(0, 0, 400, 300), Rect(0, 300, 200, 500)), 250),)
    shell = shell_of(Layout("studio", 0, 0.0, rooms, find_walls(rooms), (), ()))
    assert air_m3(shell) == pytest.approx((3.8 * 2.8 + 1.8 * 2.0) * 2.5)
