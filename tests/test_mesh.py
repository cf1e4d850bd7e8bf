"""What is no mesh is said to be none, and why."""

import numpy as np
import pytest

from anm_gym.errors import SceneError
from anm_gym.mesh import TriangleMesh

CORNERS = np.array([[0.0, 0, 0], [0, 0, 1], [1, 0, 0]])


@pytest.mark.parametrize(("face", "wrong"), [([0, 1, -1], -1), ([0, 1, 3], 3)])
def test_index_of_no_vertex_is_named(face: list[int], wrong: int) -> None:
    with pytest.raises(SceneError, match=f"`faces` must index the 3 vertices, got {wrong}"):
        TriangleMesh(CORNERS, np.array([face], np.int32))


def test_colours_are_one_per_face() -> None:
    with pytest.raises(SceneError, match=r"`face_colors` must have shape \(1, 3\), one colour per face, got"):
        TriangleMesh(CORNERS, np.array([[0, 1, 2]], np.int32), np.zeros((7, 3), np.uint8))
