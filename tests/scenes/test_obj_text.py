"""OBJ files as CAD programs write them: faces of many corners, indices that count backwards."""

from pathlib import Path

import numpy as np
import pytest

from anm_gym.scenes import load_scene
from anm_gym.scenes.obj_text import cut_polygon, needs_care, plain_obj
from anm_gym.scenes.reading import read_triangles

WALL_WITH_DOOR = np.array(
    [[5, 0, 0], [5, 0, 2], [5, 2, 2], [5, 2, 3], [5, 0, 3], [5, 0, 5], [5, 2.5, 5], [5, 2.5, 0]], float
)


def doubled_area(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    first, second, third = points[triangles].transpose(1, 0, 2)
    return np.cross(second - first, third - first)


@pytest.mark.parametrize("start", range(8))
@pytest.mark.parametrize("step", [1, -1])
def test_polygon_is_cut_along_its_shape(start: int, step: int) -> None:
    points = np.roll(WALL_WITH_DOOR, start, axis=0)[::step]
    areas = doubled_area(points, cut_polygon(points))
    assert np.abs(areas).sum() == pytest.approx(2 * (5 * 2.5 - 2))
    assert (np.sign(areas[:, 0]) == np.sign(areas[0, 0])).all()
    normal = np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0)
    assert np.sign(areas[0, 0]) == np.sign(normal[0])


def test_polygon_without_area_is_a_fan() -> None:
    line = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]])
    np.testing.assert_array_equal(cut_polygon(line), [[0, 1, 2], [0, 2, 3]])
    assert len(cut_polygon(np.full((5, 3), np.nan))) == 3


def two_rooms_with_one_polygon_between() -> str:
    """Two rooms of 5 x 5 m; the wall between them, with its door, is one face."""
    lines, count = [], 0
    corners = [(0.0, 0.0), (10.0, 0.0), (10.0, 5.0), (0.0, 5.0)]
    faces = [[(x, y, z) for x, z in corners] for y in (0.0, 2.5)]
    for (x1, z1), (x2, z2) in zip(corners, corners[1:] + corners[:1], strict=True):
        faces.append([(x1, 0.0, z1), (x2, 0.0, z2), (x2, 2.5, z2), (x1, 2.5, z1)])
    for face in [*faces, WALL_WITH_DOOR.tolist()]:
        lines += [f"v {x} {y} {z}" for x, y, z in face]
        lines.append("f " + " ".join(str(count + index + 1) for index in range(len(face))))
        count += len(face)
    return "\n".join(lines)


def test_door_in_a_wall_that_is_one_polygon_stays_open(tmp_path: Path) -> None:
    (tmp_path / "rooms.obj").write_text(two_rooms_with_one_polygon_between())
    (storey,) = load_scene(tmp_path / "rooms.obj").storeys
    assert storey.navigable_area_m2 == pytest.approx(45.0, abs=1.0)


def test_negative_indices_count_from_where_they_stand(tmp_path: Path) -> None:
    parts = []
    for x in (0.0, 10.0, 20.0):
        parts += [f"v {x} 0 0", f"v {x + 1} 0 0", f"v {x} 0 1", "vt 0 0", "f -3/-1 -2/-1 -1/-1"]
    (tmp_path / "parts.obj").write_text("\n".join(parts))
    raw = read_triangles(tmp_path / "parts.obj")
    assert sorted(raw.vertices[raw.faces][:, 0, 0].tolist()) == [0.0, 10.0, 20.0]


def test_text_is_rewritten_only_where_it_must_be() -> None:
    assert not needs_care(b"v 0 0 0\nf 1/1 2/2 3/3 # 4 - 5\n")
    assert not needs_care(b"f 1 2 3 4\n")
    assert needs_care(b"f 1 2 3 4 5\n")
    assert needs_care(b"f -1 -2 -3\n")
    assert needs_care(b"f 1/-1 2/-2 3/-3\n")
    assert needs_care(b"f 1 2 \\\n3 4 5\n")
    corners = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0.5 0\n"
    assert plain_obj(corners + "f 1 2 \\\n3 4 5\n").count("f ") == 3
    assert "f 1 2 9 4 5" in plain_obj("v 0 0 0\nf 1 2 9 4 5\n")  # the parser says what is wrong
    with pytest.raises(ValueError, match="-9 counts back beyond the 4 so far"):
        plain_obj("v 0 0 0\n" * 4 + "f -9 -8 -7\n")


@pytest.mark.parametrize("suffix", [".obj", ".stl", ".ply"])
def test_names_in_latin_1_do_not_make_a_file_unreadable(tmp_path: Path, suffix: str) -> None:
    text = {
        ".obj": "g Küche\nv 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n",
        ".stl": "solid Küche\nfacet normal 0 1 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 0 1\n"
        "endloop\nendfacet\nendsolid Küche\n",
        ".ply": "ply\nformat ascii 1.0\ncomment Küche\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        "0 0 0\n1 0 0\n0 0 1\n3 0 1 2\n",
    }[suffix]
    path = tmp_path / f"kitchen{suffix}"
    path.write_bytes(text.encode("latin-1"))
    assert len(read_triangles(path).faces) == 1
