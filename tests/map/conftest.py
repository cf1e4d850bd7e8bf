"""A short tour of a box room as the map's tests see it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from anm_gym.geometry import CameraSpec, camera_pose
from anm_gym.map.frames import FrameStore
from anm_gym.map.neural_map import NeuralMap
from anm_gym.map.presets import map_settings
from anm_gym.map.settings import SamplingSettings
from anm_gym.mesh import TriangleMesh
from anm_gym.sim.backends import make_depth_camera

ROOM_M = (4.0, 2.5, 3.0)
"""Width (x), height (y) and depth (z) of the room."""


@dataclass(frozen=True)
class Tour:
    """Frames taken in a room."""

    camera: CameraSpec
    depths: list[NDArray[np.float32]]
    poses: list[NDArray[np.float64]]


@pytest.fixture(scope="session")
def tour(box_room: Callable[..., TriangleMesh]) -> Tour:
    """Turn once in the middle of a closed room of 4 x 2.5 x 3 m."""
    camera = CameraSpec(width_px=64, height_px=64)
    renderer = make_depth_camera(box_room(ROOM_M[0], ROOM_M[2], ROOM_M[1]), camera)
    poses = [camera_pose((0.3, 1.25, 0.1), angle) for angle in np.deg2rad(np.arange(0.0, 360.0, 20.0))]
    return Tour(camera, [renderer.render(pose) for pose in poses], poses)


@pytest.fixture(scope="session")
def left_room(two_rooms: TriangleMesh) -> NeuralMap:
    """A map of the left of two rooms, seen in one turn from (-3, 0); the door is at x = 0."""
    camera = CameraSpec(width_px=64, height_px=64)
    renderer = make_depth_camera(two_rooms, camera)
    neural_map = NeuralMap(map_settings("fast"), camera)
    for angle in np.deg2rad(np.arange(0.0, 360.0, 20.0)):
        pose = camera_pose((-3.0, 1.25, 0.0), float(angle))
        neural_map.integrate(renderer.render(pose), pose)
    return neural_map


@pytest.fixture
def store(tour: Tour) -> FrameStore:
    """All frames of the tour."""
    frames = FrameStore(tour.camera, SamplingSettings(), torch.device("cpu"))
    for depth, pose in zip(tour.depths, tour.poses, strict=True):
        frames.append(torch.from_numpy(depth), torch.from_numpy(pose).float())
    return frames


@pytest.fixture
def generator() -> torch.Generator:
    """A seeded generator."""
    return torch.Generator().manual_seed(3)


def box_distance(points: NDArray[np.floating]) -> NDArray[np.float64]:
    """Exact signed distance of points inside the room to its nearest face, positive inside."""
    half = np.array([ROOM_M[0], ROOM_M[1], ROOM_M[2]]) / 2.0
    centered = points - np.array([0.0, ROOM_M[1] / 2.0, 0.0])
    return np.asarray((half - np.abs(centered)).min(axis=1))


@pytest.fixture
def room_distance() -> Callable[[NDArray[np.floating]], NDArray[np.float64]]:
    """The room's exact signed distance."""
    return box_distance
