"""Maps learned from rendered depth, held against exact distances."""

from collections.abc import Callable

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from anm_gym.geometry import CameraSpec, camera_pose
from anm_gym.map.neural_map import NeuralMap
from anm_gym.map.presets import map_settings
from anm_gym.mesh import TriangleMesh
from anm_gym.sim.backends import make_depth_camera

CAMERA = CameraSpec(width_px=96, height_px=96)
EYE_M = 1.25
RADIUS_M = 2.0

Points = NDArray[np.floating]


def learn(mesh: TriangleMesh, places: list[tuple[float, float]], turns: int = 1) -> NeuralMap:
    """Turn round at each (x, z) place in steps of 15 degrees."""
    renderer = make_depth_camera(mesh, CAMERA)
    neural_map = NeuralMap(map_settings("best"), CAMERA)
    for x, z in places:
        for angle in np.deg2rad(np.arange(0.0, 360.0 * turns, 15.0)):
            pose = camera_pose((x, EYE_M, z), float(angle))
            neural_map.integrate(renderer.render(pose), pose)
    return neural_map


def in_box(points: Points, width_m: float, depth_m: float, height_m: float = 2.5) -> Points:
    """Exact distance to the faces of a room around the origin, positive inside."""
    half = np.array([width_m, height_m, depth_m]) / 2.0
    return np.asarray((half - np.abs(points - [0.0, height_m / 2.0, 0.0])).min(axis=1))


def mean_error_m(neural_map: NeuralMap, points: Points, exact: Callable[[Points], Points]) -> float:
    return float(np.abs(neural_map.sdf(points.astype(np.float32)) - exact(points)).mean())


def test_inside_of_a_sphere_is_learned_to_a_centimetre(rng: np.random.Generator) -> None:
    ball = trimesh.creation.icosphere(subdivisions=5, radius=RADIUS_M)
    center = np.array([0.0, EYE_M, 0.0])
    mesh = TriangleMesh(np.asarray(ball.vertices) + center, np.asarray(ball.faces, np.int32)[:, ::-1].copy())
    neural_map = learn(mesh, [(0.0, 0.0)], turns=2)
    directions = rng.normal(size=(3000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions = directions[np.abs(directions[:, 1]) < 0.5]
    for share in (1.0, 0.97, 0.9):
        points = center + share * RADIUS_M * directions
        assert (
            mean_error_m(neural_map, points, lambda p: RADIUS_M - np.linalg.norm(p - center, axis=1)) < 0.01
        )


@pytest.mark.parametrize(("width_m", "depth_m"), [(4.0, 3.0), (8.0, 1.2)], ids=["box", "corridor"])
def test_rooms_are_learned_to_a_centimetre(
    width_m: float, depth_m: float, box_room: Callable[..., TriangleMesh], rng: np.random.Generator
) -> None:
    places = [(x, 0.0) for x in np.linspace(-0.35 * width_m, 0.35 * width_m, 3)]
    neural_map = learn(box_room(width_m, depth_m), places)
    surface = neural_map.cloud.points[::7]
    assert mean_error_m(neural_map, surface, lambda p: np.zeros(len(p))) < 0.01
    low, high = np.array([-width_m / 2, 0.0, -depth_m / 2]), np.array([width_m / 2, 2.5, depth_m / 2])
    inside = rng.uniform(low + 0.02, high - 0.02, (3000, 3))
    known = inside[neural_map.posterior_std(inside.astype(np.float32)) < 0.03]
    assert len(known) > 300
    assert mean_error_m(neural_map, known, lambda p: in_box(p, width_m, depth_m)) < 0.01
    assert mean_error_m(neural_map, inside, lambda p: in_box(p, width_m, depth_m)) < 0.06
    assert (neural_map.sdf(inside.astype(np.float32)) > 0.0).mean() > 0.995


def test_no_wall_stands_in_a_doorway_that_was_looked_through(
    two_rooms: TriangleMesh, rng: np.random.Generator
) -> None:
    neural_map = learn(two_rooms, [(-3.0, 0.0), (-1.5, 0.3)])
    opening = rng.uniform([-0.3, 0.15, -0.4], [0.3, 2.3, 0.4], (2000, 3)).astype(np.float32)
    behind_wall = rng.uniform([-0.1, 0.3, -1.8], [-0.02, 2.2, -0.7], (500, 3)).astype(np.float32)
    assert (neural_map.sdf(opening) > 0.0).mean() > 0.995
    in_plane = opening * np.array([0.0, 1.0, 1.0], np.float32)
    exact = np.minimum(0.5 - np.abs(in_plane[:, 2]), np.minimum(in_plane[:, 1], 2.5 - in_plane[:, 1]))
    assert np.abs(neural_map.sdf(in_plane) - exact).mean() < 0.08
    assert np.abs(neural_map.sdf(behind_wall) - np.abs(behind_wall[:, 0])).mean() < 0.03
