import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from anm_gym.map.zero_crossings import (
    EMPTY,
    Lattice,
    ZeroCrossings,
    extract_zero_crossings,
    zero_crossings_within,
)

BOUNDS = np.array([[-1.5, -1.5, -1.5], [1.5, 1.5, 1.5]])


def outside_ball(points: NDArray[np.float32]) -> NDArray[np.float32]:
    """Positive outside a ball of radius 1."""
    return np.asarray(np.linalg.norm(points, axis=1) - 1.0, np.float32)


def test_sphere_is_found_within_a_millimetre() -> None:
    surface = extract_zero_crossings(outside_ball, Lattice.with_spacing(BOUNDS, 0.06))
    assert np.abs(np.linalg.norm(surface.vertices, axis=1) - 1.0).max() < 1e-3


def test_faces_look_into_free_space() -> None:
    surface = extract_zero_crossings(outside_ball, Lattice.with_resolution(BOUNDS, 40))
    corners = surface.vertices[surface.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outward = (normals * corners.mean(axis=1)).sum(axis=1)
    assert (outward >= -1e-9).all()


def test_no_change_of_sign_gives_no_surface() -> None:
    lattice = Lattice.with_resolution(BOUNDS, 8)
    surface = extract_zero_crossings(lambda points: np.ones(len(points), np.float32), lattice)
    assert len(surface) == 0
    nothing = extract_zero_crossings(outside_ball, lattice, np.zeros(lattice.shape, bool))
    assert len(nothing) == 0
    assert nothing is EMPTY


def test_mask_limits_the_surface() -> None:
    lattice = Lattice.with_resolution(BOUNDS, 30)
    right = lattice.points[:, 0].reshape(lattice.shape) > 0.0
    surface = extract_zero_crossings(outside_ball, lattice, right)
    assert surface.vertices[:, 0].min() > -0.11


def test_surface_within_a_mask_is_the_whole_one_where_it_was_asked() -> None:
    lattice = Lattice.with_resolution(BOUNDS, 30)
    everywhere = zero_crossings_within(outside_ball, lattice, np.ones(lattice.shape, bool))
    np.testing.assert_array_equal(everywhere.vertices, extract_zero_crossings(outside_ball, lattice).vertices)
    for sign in (1.0, -1.0):
        asked = sign * lattice.points[:, 0].reshape(lattice.shape) >= 0.0
        half = zero_crossings_within(outside_ball, lattice, asked)
        assert (sign * half.vertices[:, 0]).min() >= 0.0
        assert 0.4 < len(half) / len(everywhere) <= 0.5
        assert np.abs(outside_ball(half.vertices)).max() < 0.01
    assert len(zero_crossings_within(outside_ball, lattice, np.zeros(lattice.shape, bool))) == 0


def test_points_in_a_mask_are_those_of_the_lattice() -> None:
    lattice = Lattice.with_resolution(BOUNDS, 5)
    mask = lattice.points.sum(axis=1).reshape(lattice.shape) > 0.5
    np.testing.assert_array_equal(lattice.points_in(mask), lattice.points[mask.ravel()])


def test_lattice_spans_its_bounds() -> None:
    even = Lattice.with_spacing(BOUNDS, 0.4)
    assert even.shape == (9, 9, 9)
    assert np.allclose(even.points[0], BOUNDS[0])
    assert (even.points[-1] >= BOUNDS[1] - 1e-6).all()
    assert np.allclose(Lattice.with_resolution(BOUNDS, 11).points[-1], BOUNDS[1])


def test_keeping_vertices_keeps_their_faces() -> None:
    strip = ZeroCrossings(
        np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], np.float32),
        np.array([[0, 1, 2], [1, 3, 2]], np.int32),
    )
    keep = np.array([True, True, True, False])
    assert strip.keep_vertices(keep).faces.tolist() == [[0, 1, 2]]
    assert len(strip.keep_vertices(keep, whole_faces=False).faces) == 2


def test_lattice_points_near_others_are_all_found_and_few_besides(rng: np.random.Generator) -> None:
    lattice, points = Lattice.with_resolution(BOUNDS, 25), rng.uniform(-1.4, 1.4, (30, 3))
    distance_m, _ = cKDTree(points).query(lattice.points)
    near = lattice.near(points, 0.3).ravel()
    assert near[distance_m <= 0.3].all()
    assert not near[distance_m > 0.3 + np.linalg.norm(lattice.spacing_m)].any()
