"""The reconstructed surface: colours by height, dollhouse view, PLY."""

import numpy as np
import trimesh

from anm_gym.mesh import TriangleMesh
from train.reconstruction import dollhouse_picture, height_colors, save_ply


def test_colours_run_between_the_ends_and_stay_there():
    low, below, high, above = height_colors(np.array([0.0, -5.0, 2.0, 9.0]), 0.0, 2.0)
    np.testing.assert_array_equal(low, below)
    np.testing.assert_array_equal(high, above)
    assert low.astype(int).sum() > high.astype(int).sum()


def test_ply_is_coloured_and_keeps_its_faces(tmp_path, box_room):
    room = box_room()
    loaded = trimesh.load_mesh(save_ply(tmp_path / "sub" / "room.ply", room), process=False)
    assert len(loaded.faces) == len(room.faces)
    np.testing.assert_allclose(loaded.vertices, room.vertices, atol=1e-6)
    assert len(np.unique(loaded.visual.vertex_colors, axis=0)) == 2


def test_closed_room_is_seen_into_from_above(box_room):
    picture = dollhouse_picture(box_room(4.0, 3.0), cut_y_m=1.9).astype(int)
    height, width = picture.shape[:2]
    assert width > height > 100
    floor = picture[height // 2, width // 2]
    top_of_far_wall = picture[26, width // 2]
    assert 500 < floor.sum() < 765
    assert top_of_far_wall.sum() < floor.sum() - 150


def test_nothing_above_the_cut_is_drawn():
    ceiling = TriangleMesh(
        np.array([[0.0, 3.0, 0.0], [0.0, 3.0, 1.0], [1.0, 3.0, 0.0]]), np.array([[0, 1, 2]], np.int32)
    )
    assert (dollhouse_picture(ceiling, cut_y_m=1.9) == 255).all()
