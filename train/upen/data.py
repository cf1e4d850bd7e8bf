"""Crops that UPEN's predictors learn from: what a walk has shown of a home, and what is there.

The walks lead between random places of procedural homes; depth is rendered and fused as in an episode.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from agents.upen_ensemble import EnsembleSettings
from agents.upen_map import ObservedMap, UpenMapSettings
from anm_gym.checks import check_at_least, check_positive
from anm_gym.geometry import CameraSpec, camera_pose, heading_towards, wrap_angle
from anm_gym.map.grid_fusion import FloorPose
from anm_gym.map.projection import FREE, NUM_CLASSES, OCCUPIED, VOID
from anm_gym.scenes.catalog import make_scene
from anm_gym.scenes.scene import Scene
from anm_gym.sim.grid import GridFrame
from anm_gym.sim.raster import rasterise_slab
from anm_gym.sim.simulator import Simulator
from train.kept_arrays import kept

TIERS: Final = ("flat", "house", "studio", "maze")
"""Homes are taken from these in turn."""
FIRST_TRAINING_SEED: Final = 500_000
"""Seeds of the homes to learn from; below are those to evaluate on."""
FIRST_TEST_SEED: Final = 30
LABEL_SLAB_M: Final = (-0.2, 0.25, 2.0)
"""Surface between the first two heights is floor, between the last two obstacle, metres (UPEN: to 2 m)."""
LEVELS: Final = 255
"""Probabilities are kept as so many levels of 8 bits."""


@dataclass(frozen=True)
class CropSettings:
    """How crops are gathered."""

    crops_per_home: int = 60
    """Crops of a home."""
    min_steps: int = 10
    """Fewest steps of a walk (UPEN: 11)."""
    max_steps: int = 120
    """Most steps of a walk; 50 in UPEN's code, but episodes here go on much longer."""
    crop_every: int = 4
    """Steps between two crops."""
    step_m: float = 0.25
    """Length of a step, metres (UPEN)."""
    turn_deg: float = 30.0
    """Largest turn between two images, degrees (UPEN)."""
    image_px: int = 128
    """Edge of the depth images, pixels."""

    def __post_init__(self) -> None:
        if not 1 <= self.min_steps <= self.max_steps:
            raise ValueError(
                f"`min_steps` must be in [1, max_steps], got {self.min_steps} of {self.max_steps}"
            )
        check_at_least(self, 1, "crops_per_home", "crop_every", "image_px")
        check_positive(self, "step_m", "turn_deg")


@dataclass(frozen=True, eq=False)
class Crops:
    """Squares around the agent, the first row ahead."""

    inputs: NDArray[np.uint8]
    """(N, 3, h, w) observed class probabilities, times 255."""
    labels: NDArray[np.uint8]
    """(N, h, w) true classes."""

    def __len__(self) -> int:
        return len(self.labels)

    @classmethod
    def joined(cls, parts: list["Crops"]) -> "Crops":
        """Put crops of several homes behind each other."""
        return cls(
            np.concatenate([part.inputs for part in parts]), np.concatenate([part.labels for part in parts])
        )


def training_homes(count: int) -> list[str]:
    """Name homes to learn from."""
    return [f"home:{TIERS[i % len(TIERS)]}:{FIRST_TRAINING_SEED + i}" for i in range(count)]


def test_homes(count: int) -> list[str]:
    """Name homes that are never learned from."""
    return [f"home:{TIERS[i % len(TIERS)]}:{FIRST_TEST_SEED + i}" for i in range(count)]


def crops_of(
    home: str, raster: EnsembleSettings, settings: CropSettings, seed: int, cache: Path | None
) -> Crops:
    """Gather the crops of a home, or read them from the folder where they were kept."""
    path = cache / f"{home.replace(':', '-')}.safetensors" if cache else None
    return kept(path, Crops, lambda: gather(home, raster, settings, seed))


def gather(home: str, raster: EnsembleSettings, settings: CropSettings, seed: int) -> Crops:
    """Walk through a home until it has given its crops.

    Args:
        home: A scene's name.
        raster: Raster and projection.
        settings: How to walk, and when to cut.
        seed: Seeds the walks, together with the home's name.
    """
    scene = make_scene(home)
    camera = CameraSpec(width_px=settings.image_px, height_px=settings.image_px)
    simulator = Simulator(scene.storey_mesh, scene.floor_y_m, camera)
    truth = TrueClasses(scene, simulator.grid.frame, raster.cell_m)
    rng = np.random.default_rng([seed, *home.encode()])
    inputs: list[NDArray[np.uint8]] = []
    labels: list[NDArray[np.uint8]] = []
    while len(labels) < settings.crops_per_home:
        observed: ObservedMap | None = None
        num_steps = int(rng.integers(settings.min_steps, settings.max_steps + 1))
        for step, pose in enumerate(walk(simulator, settings, num_steps, rng)):
            matrix = camera_pose(
                (pose.position_xz[0], scene.floor_y_m + camera.sensor_height_m, pose.position_xz[1]),
                pose.heading_rad,
            )
            observed = observed or ObservedMap(raster, camera, pose, _map_of(truth.frame))
            observed.add(simulator.camera.render(matrix), matrix)
            if step % settings.crop_every == 0:
                inputs.append(np.rint(LEVELS * observed.crop(pose)).astype(np.uint8))
                labels.append(truth.crop(observed.ego, pose))
    kept = slice(settings.crops_per_home)
    return Crops(np.stack(inputs[kept]), np.stack(labels[kept]))


class TrueClasses:
    """The true class of each cell of a scene's floor.

    Args:
        scene: The scene.
        around: A raster that covers it.
        cell_m: Edge of a cell, metres.

    Source:
        UPEN labels a slice of a point cloud; a cell here has a class as soon as a surface touches it.
    """

    def __init__(self, scene: Scene, around: GridFrame, cell_m: float) -> None:
        size_m = around.cell_m * np.asarray(around.shape[::-1])
        high = np.asarray(around.origin_xz) + size_m
        self.frame = GridFrame.around(around.origin_xz, high, cell_m, margin_m=0.0)
        low_m, middle_m, high_m = np.asarray(LABEL_SLAB_M) + scene.floor_y_m
        triangles = scene.storey_mesh.triangles
        self.classes = np.full(self.frame.shape, VOID, np.uint8)
        self.classes[rasterise_slab(triangles, self.frame, low_m, middle_m)] = FREE
        self.classes[rasterise_slab(triangles, self.frame, middle_m, high_m)] = OCCUPIED

    def crop(self, ego: GridFrame, pose: FloorPose) -> NDArray[np.uint8]:
        """Cut out the square around an agent, (h, w) uint8; void beyond the scene."""
        centers = ego.centers_of(np.argwhere(np.ones(ego.shape, bool)))
        turn = pose.world_from_ego
        cells = self.frame.cells_of(centers @ turn[:, :2].T + turn[:, 2])
        inside = self.frame.contains(cells)
        classes = np.full(len(cells), VOID, np.uint8)
        classes[inside] = self.classes[cells[inside, 0], cells[inside, 1]]
        return classes.reshape(ego.shape)


def walk(
    simulator: Simulator, settings: CropSettings, num_steps: int, rng: np.random.Generator
) -> Iterator[FloorPose]:
    """Walk along shortest paths between random places of the largest part of a storey.

    Yields:
        Poses no more than a step and a turn apart.
    """
    position = simulator.grid.sample_position(rng)
    heading = float(rng.uniform(-np.pi, np.pi))
    turn_rad, count = float(np.deg2rad(settings.turn_deg)), 0
    while count < num_steps:
        path = simulator.shortest_path(position, simulator.grid.sample_position(rng))
        assert path is not None
        for place in _evenly(path, settings.step_m):
            wanted = heading_towards(position, place)
            while abs(error := wrap_angle(wanted - heading)) > turn_rad:
                heading = wrap_angle(heading + float(np.copysign(turn_rad, error)))
                yield FloorPose((float(position[0]), float(position[1])), heading)
                count += 1
            heading, position = wanted, place
            yield FloorPose((float(place[0]), float(place[1])), heading)
            count += 1
            if count >= num_steps:
                return


def class_shares(crops: Crops) -> NDArray[np.float64]:
    """Share of each true class, (3,)."""
    counts = np.bincount(crops.labels.ravel(), minlength=NUM_CLASSES)
    return np.asarray(counts / counts.sum())


def _evenly(path: NDArray[np.float64], step_m: float) -> NDArray[np.float64]:
    """Points every step along a path, without its start."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    at = np.arange(step_m, along[-1] + 1e-9, step_m)
    return np.stack([np.interp(at, along, path[:, axis]) for axis in (0, 1)], axis=1)


def _map_of(frame: GridFrame) -> UpenMapSettings:
    """A map that holds the scene, wherever in it the walk begins."""
    return UpenMapSettings(map_m=2.0 * frame.cell_m * max(frame.shape))
