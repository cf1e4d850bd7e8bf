import numpy as np
import pytest

from anm_gym.mesh import TriangleMesh
from anm_gym.metrics.distance import MeshDistance, cut_triangles, point_triangle_distance

TRIANGLE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


@pytest.mark.parametrize(
    ("point", "distance_m"),
    [
        ((0.2, 0.2, 0.3), 0.3),  # over the face
        ((0.5, -0.4, 0.3), 0.5),  # off an edge
        ((-3.0, -4.0, 0.0), 5.0),  # off a corner
        ((1.0, 1.0, 0.0), np.sqrt(0.5)),  # off the long edge, in the plane
        ((0.25, 0.25, 0.0), 0.0),  # on the face
    ],
)
def test_distance_to_a_triangle_has_its_closed_form(point, distance_m):
    points = np.array([point])
    assert point_triangle_distance(points, TRIANGLE[None])[0] == pytest.approx(distance_m, abs=1e-15)
    assert point_triangle_distance(points, TRIANGLE[None, ::-1])[0] == pytest.approx(distance_m, abs=1e-15)


def test_degenerate_triangles_are_segments_and_points():
    segment = np.array([[0.0, 0, 0], [2.0, 0, 0], [1.0, 0, 0]])
    point = np.ones((3, 3))
    queries = np.array([[1.0, 3.0, 0.0], [1.0, 1.0, 0.0]])
    assert np.allclose(point_triangle_distance(queries, np.stack([segment, point])), [3.0, 1.0])


def test_inside_a_box_the_distance_is_that_to_the_nearest_wall(box_room, rng):
    points = rng.uniform([-2, 0, -2], [2, 2.5, 2], (2000, 3))
    expected = np.minimum(
        2.0 - np.abs(points[:, [0, 2]]).max(axis=1), np.minimum(points[:, 1], 2.5 - points[:, 1])
    )
    assert np.allclose(MeshDistance(box_room(4.0, 4.0, 2.5)).distance_m(points), expected, atol=1e-12)


def test_triangles_of_all_sizes_give_what_brute_force_gives(rng):
    centers = rng.uniform(-2, 2, (300, 1, 3))
    sizes = 10.0 ** rng.uniform(-4, 0.5, (300, 1, 1))
    triangles = centers + sizes * rng.normal(size=(300, 3, 3)) * [1.0, 1.0, 0.05]
    mesh = TriangleMesh(triangles.reshape(-1, 3), np.arange(900, dtype=np.int32).reshape(-1, 3))
    points = rng.uniform(-4, 4, (200, 3))
    expected = [point_triangle_distance(np.tile(point, (300, 1)), triangles).min() for point in points]
    assert np.allclose(MeshDistance(mesh).distance_m(points), expected, atol=1e-12)


def test_cutting_keeps_the_area_and_bounds_the_radius():
    pieces = cut_triangles(TRIANGLE[None] * 3.0, 0.2)
    areas = 0.5 * np.linalg.norm(np.cross(pieces[:, 1] - pieces[:, 0], pieces[:, 2] - pieces[:, 0]), axis=1)
    assert areas.sum() == pytest.approx(4.5)
    assert np.linalg.norm(pieces - pieces.mean(axis=1, keepdims=True), axis=2).max() <= 0.2


def test_no_points_have_no_distances(box_room):
    assert MeshDistance(box_room()).distance_m(np.zeros((0, 3))).shape == (0,)


def test_points_of_another_shape_are_refused(box_room):
    with pytest.raises(ValueError, match=r"`points` must have shape \(N, 3\), got \(3,\)"):
        MeshDistance(box_room()).distance_m(np.zeros(3))
