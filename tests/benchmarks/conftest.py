"""A short recording of a box room, and settings that learn it in no time."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from anm_gym.geometry import CameraSpec, camera_pose
from anm_gym.map.presets import PAPER
from anm_gym.map.settings import FieldSettings
from anm_gym.sim.backends import make_depth_camera
from benchmarks.recordings import Recording


@pytest.fixture(scope="session")
def recording(box_room):
    """Four frames of a room of 4 x 3 m."""
    room, camera = box_room(4.0, 3.0), CameraSpec(48, 48)
    renderer = make_depth_camera(room, camera)
    poses = [camera_pose((0.3, 1.25, 0.1), 0.5 * index) for index in range(4)]
    return Recording(
        name="box-0",
        seed=0,
        scene=SimpleNamespace(mesh=room, storey_mesh=room),
        camera=camera,
        depth_m=np.stack([renderer.render(pose) for pose in poses]),
        world_from_camera=np.stack(poses),
    )


@pytest.fixture(scope="session")
def tiny():
    """Give a small network and a few iterations."""
    return replace(
        PAPER,
        preset="tiny",
        field=FieldSettings(width=16),
        sampling=replace(PAPER.sampling, rays_per_frame=40),
        schedule=replace(PAPER.schedule, first_iterations=30, iterations=3, keyframe_iterations=3),
    )
