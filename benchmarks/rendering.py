"""Compare a frame of `DepthCamera.render` with bare Embree on prebuilt rays.

    python -m benchmarks.rendering [--scene SPEC] [--json PATH] [--quick]

The difference is what the suite adds to a frame: rays from a pose, limits of depth. Both are timed in
one process, in alternating pairs over the same poses, in CPU milliseconds, so that other load on the
machine falls on both alike.
"""

import argparse
import statistics
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np
from embreex.mesh_construction import TriangleMesh as EmbreeMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from anm_gym.geometry import CameraSpec, camera_pose
from anm_gym.scenes.catalog import make_scene
from anm_gym.scenes.scene import Scene
from anm_gym.sim.backends import make_depth_camera
from anm_gym.sim.traversable import TraversableGrid
from train.results import write_json

TARGET_RATIO = 1.05
"""A frame may cost this many times bare Embree."""
REPETITIONS = 4
"""Timed pairs at each pose."""


@dataclass(frozen=True)
class Comparison:
    """CPU time of one 256 x 256 frame, medians over the poses."""

    scene: str
    num_triangles: int
    num_poses: int
    camera_ms: float
    """`DepthCamera.render`, CPU milliseconds."""
    bare_ms: float
    """`EmbreeScene.run` on prebuilt rays, CPU milliseconds."""
    ratio: float
    """Median over the pairs of `camera_ms / bare_ms`."""
    max_difference_mm: float
    """Largest difference of depth where both are within the limits, millimetres."""


def compare(scene: Scene, num_poses: int, seed: int = 0) -> Comparison:
    """Time both over random poses of a scene."""
    spec = CameraSpec()
    camera = make_depth_camera(scene.mesh, spec)
    bare = EmbreeScene()
    EmbreeMesh(bare, scene.mesh.vertices.astype(np.float32), scene.mesh.faces)
    pairs, difference_mm = [], 0.0
    for pose in _poses(scene, spec, num_poses, seed):
        rays = _prebuilt_rays(pose, spec)
        for repetition in range(1 + REPETITIONS):
            camera_ms, ours = _cpu_ms(partial(camera.render, pose))
            bare_ms, theirs = _cpu_ms(partial(bare.run, *rays, query="DISTANCE"))
            if repetition > 0:  # the first warms the caches for both
                pairs.append((camera_ms, bare_ms))
        difference_mm = max(difference_mm, _difference_mm(ours, theirs))
    camera_ms, bare_ms = (statistics.median(column) for column in zip(*pairs, strict=True))
    ratio = statistics.median(ours / theirs for ours, theirs in pairs)
    return Comparison(scene.name, len(scene.mesh.faces), num_poses, camera_ms, bare_ms, ratio, difference_mm)


def _poses(scene: Scene, spec: CameraSpec, count: int, seed: int) -> list[NDArray[np.float64]]:
    generator = np.random.default_rng(seed)
    grid = TraversableGrid.from_mesh(scene.mesh, scene.floor_y_m)
    height_m = scene.floor_y_m + spec.sensor_height_m
    positions = [grid.sample_position(generator) for _ in range(count)]
    return [camera_pose((x, height_m, z), generator.uniform(-np.pi, np.pi)) for x, z in positions]


def _prebuilt_rays(
    pose: NDArray[np.float64], spec: CameraSpec
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    directions = (spec.directions.reshape(-1, 3) @ pose[:3, :3].T).astype(np.float32)
    return np.tile(pose[:3, 3].astype(np.float32), (len(directions), 1)), directions


def _cpu_ms(run: Callable[[], NDArray[np.float32]]) -> tuple[float, NDArray[np.float32]]:
    start_s = time.process_time()
    depth = run()
    return 1000.0 * (time.process_time() - start_s), depth


def _difference_mm(ours: NDArray[np.float32], theirs: NDArray[np.float32]) -> float:
    seen = ours.ravel() > 0
    return float(1000.0 * np.abs(ours.ravel()[seen] - theirs[seen]).max(initial=0.0))


def main() -> None:
    """Run the comparison and print a line, or write it as JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scene", default="home:house:0", help="a mesh, a plan or a procedural home")
    parser.add_argument("--json", type=Path, help="write the figures to this file as well")
    parser.add_argument("--quick", action="store_true", help="20 poses instead of 200")
    arguments = parser.parse_args()
    result = compare(make_scene(arguments.scene), 20 if arguments.quick else 200)
    verdict = "met" if result.ratio <= TARGET_RATIO else "MISSED"
    print(f"{result.scene}: {result.num_triangles} triangles, {result.num_poses} poses of 256 x 256")
    print(f"DepthCamera.render {result.camera_ms:.2f} CPU-ms, bare Embree {result.bare_ms:.2f} CPU-ms")
    print(f"ratio {result.ratio:.3f} (target <= {TARGET_RATIO}: {verdict})")
    print(f"largest difference {result.max_difference_mm:.4f} mm")
    if arguments.json:
        write_json(arguments.json, asdict(result))


if __name__ == "__main__":
    main()
