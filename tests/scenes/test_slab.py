"""Cutting a mesh between two heights."""

from collections.abc import Callable

import numpy as np
import pytest

from anm_gym.errors import SceneError
from anm_gym.mesh import TriangleMesh
from anm_gym.metrics.distance import MeshDistance
from anm_gym.scenes.slab import slab_of

BoxRoom = Callable[..., TriangleMesh]


def horizontal(y_m: float) -> TriangleMesh:
    vertices = np.array([[0.0, y_m, 0.0], [2.0, y_m, 0.0], [0.0, y_m, 2.0]])
    return TriangleMesh(vertices, np.array([[0, 1, 2]], np.int32))


def test_walls_are_cut_at_both_heights(box_room: BoxRoom) -> None:
    tower = box_room(height_m=9.0)
    walls = np.abs(tower.normals[:, 1]) < 0.5
    middle = slab_of(tower, 2.0, 5.0)
    np.testing.assert_allclose(middle.bounds[:, 1], [2.0, 5.0])
    assert middle.areas_m2.sum() == pytest.approx(tower.areas_m2[walls].sum() * 3.0 / 9.0)
    assert MeshDistance(tower).distance_m(middle.triangles.reshape(-1, 3)).max() < 1e-9


def test_slanted_triangle_keeps_the_area_between_the_heights() -> None:
    ramp = TriangleMesh(np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 4.0, 4.0]]), np.array([[0, 1, 2]]))
    parts = [slab_of(ramp, low, high).areas_m2.sum() for low, high in ((-9, 1), (1, 3), (3, 9))]
    assert sum(parts) == pytest.approx(ramp.areas_m2.sum())
    np.testing.assert_allclose(np.array(parts) / ramp.areas_m2.sum(), [7 / 16, 8 / 16, 1 / 16])


def test_what_lies_between_the_heights_stays_as_it_is(box_room: BoxRoom) -> None:
    room = box_room()
    for low_m, high_m in ((0.0, 2.5), (-np.inf, np.inf), (-1.0, np.inf)):
        same = slab_of(room, low_m, high_m)
        assert (same.faces == room.faces).all()
        assert (same.vertices == room.vertices).all()


def test_pieces_keep_the_colour_of_their_triangle(box_room: BoxRoom) -> None:
    room = box_room()
    colors = np.arange(3 * len(room.faces), dtype=np.uint8).reshape(-1, 3)
    half = slab_of(TriangleMesh(room.vertices, room.faces, colors), -1.0, 1.0)
    assert half.face_colors is not None
    color_of = {tuple(color): normal for color, normal in zip(colors, room.normals, strict=True)}
    for color, normal in zip(half.face_colors, half.normals, strict=True):
        np.testing.assert_allclose(normal, color_of[tuple(color)], atol=1e-12)
    assert slab_of(room, -1.0, 1.0).face_colors is None


def test_horizontal_triangle_on_a_height_is_kept() -> None:
    assert len(slab_of(horizontal(1.0), 1.0, 2.0).faces) == 1
    assert len(slab_of(horizontal(2.0), 1.0, 2.0).faces) == 1


def test_nothing_between_the_heights_is_refused() -> None:
    with pytest.raises(SceneError, match="at least one triangle"):
        slab_of(horizontal(0.0), 1.0, 2.0)
