import numpy as np
import pytest

from anm_gym.mesh import TriangleMesh
from anm_gym.metrics.samples import SurfaceSamples, sample_surface


def test_samples_are_uniform_by_area(box_room, rng):
    room = box_room(4.0, 4.0, 2.5)
    samples = sample_surface(room, 40_000, rng)
    floor_share = 16.0 / (2 * 16.0 + 4 * 10.0)
    assert np.mean(samples.points[:, 1] == 0.0) == pytest.approx(floor_share, abs=0.01)
    on_floor = samples.points[samples.points[:, 1] == 0.0]
    assert np.mean(on_floor[:, 0] < -1.0) == pytest.approx(0.25, abs=0.02)
    assert samples.area_m2 == pytest.approx(72.0)


def test_a_prefix_is_uniform_as_well(box_room, rng):
    head = sample_surface(box_room(4.0, 4.0, 2.5), 40_000, rng).head(4000)
    assert len(head) == 4000
    assert np.mean(head.points[:, 1] == 0.0) == pytest.approx(16.0 / 72.0, abs=0.03)


def test_samples_lie_on_their_faces_and_carry_their_normals(box_room, rng):
    room = box_room()
    samples = sample_surface(room, 500, rng)
    offsets = samples.points - room.triangles[samples.faces, 0]
    assert np.abs(np.einsum("ij,ij->i", offsets, samples.normals)).max() < 1e-12


def test_same_generator_state_draws_same_samples(box_room):
    first, second = (sample_surface(box_room(), 100, np.random.default_rng(3)) for _ in range(2))
    assert np.array_equal(first.points, second.points)


def test_faces_without_area_get_no_sample(rng):
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    mesh = TriangleMesh(vertices, np.array([[0, 1, 1], [0, 1, 2]], np.int32))
    assert (sample_surface(mesh, 100, rng).faces == 1).all()


def test_bad_arguments_are_refused(box_room, rng):
    point = TriangleMesh(np.zeros((3, 3)), np.array([[0, 1, 2]], np.int32))
    with pytest.raises(ValueError, match="`count` must be at least 1"):
        sample_surface(box_room(), 0, rng)
    with pytest.raises(ValueError, match="positive area"):
        sample_surface(point, 10, rng)
    with pytest.raises(ValueError, match="equally long"):
        SurfaceSamples(np.zeros((2, 3)), np.zeros((1, 3)), np.zeros(2, np.int64), 1.0)
