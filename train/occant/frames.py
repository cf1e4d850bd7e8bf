"""Pairs that OccAnt's anticipator learns from: what one depth image shows, and what is there.

Depth is rendered from the mesh and projected as in an episode, so that the anticipator meets later what
it has learned from.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from agents.layout_memory import LayoutSettings
from agents.occant_model import OccAntSettings
from anm_gym.checks import check_at_least, check_positive
from anm_gym.geometry import CameraSpec, camera_pose
from anm_gym.map.grid_fusion import FloorPose
from anm_gym.map.projection import count_hits, project_depth, seen_masks
from anm_gym.scenes.catalog import make_scene
from anm_gym.sim.backends import make_depth_camera
from train.kept_arrays import kept
from train.occant.twin_world import VOID_M, FanSettings, RayFan, TwinWorld

TIERS: Final = ("flat", "house", "studio", "flat", "house", "maze")
"""Homes are taken from these in turn."""
FIRST_TRAINING_SEED: Final = 600_000
"""Seeds of the homes to learn from begin here."""
FIRST_TEST_SEED: Final = 700_000
"""Seeds of the homes to evaluate on begin here."""


@dataclass(frozen=True)
class FrameSettings:
    """How pairs are gathered."""

    frames_per_home: int = 300
    """Poses of a home, drawn uniformly."""
    image_px: int = 128
    """Edge of the depth images, pixels: as many as a projection uses."""
    label_hfov_deg: float = 120.0
    """Field of the sweep that reveals what is to be anticipated, degrees (paper's code)."""
    wall_m: float = 1.0
    """Obstacles of at least this height stop the sweep, metres (paper's code: walls, 1.0 to 1.5 m)."""

    def __post_init__(self) -> None:
        check_at_least(self, 1, "frames_per_home", "image_px")
        check_positive(self, "label_hfov_deg")
        check_at_least(self, 0.0, "wall_m")


@dataclass(frozen=True, eq=False)
class Frames:
    """Patches ahead of the agent, the first row farthest: occupied, explored."""

    looks: NDArray[np.bool_]
    """(N, 2, V, V) what the image shows."""
    labels: NDArray[np.bool_]
    """(N, 2, V, V) what is there, as far as walls let it be revealed."""

    def __len__(self) -> int:
        return len(self.labels)

    @classmethod
    def joined(cls, parts: list["Frames"]) -> "Frames":
        """Put the frames of several homes behind each other."""
        return cls(
            np.concatenate([part.looks for part in parts]), np.concatenate([part.labels for part in parts])
        )


def training_homes(count: int) -> list[str]:
    """Name homes to learn from."""
    return [f"home:{TIERS[i % len(TIERS)]}:{FIRST_TRAINING_SEED + i}" for i in range(count)]


def unseen_homes(count: int) -> list[str]:
    """Name homes that are never learned from."""
    return [f"home:{TIERS[i % len(TIERS)]}:{FIRST_TEST_SEED + i}" for i in range(count)]


def frames_of(
    home: str, model: OccAntSettings, settings: FrameSettings, seed: int, cache: Path | None
) -> Frames:
    """Gather the frames of a home, or read them from the folder where they were kept."""
    path = cache / f"{home.replace(':', '-')}.safetensors" if cache else None
    return kept(path, Frames, lambda: gather(home, model, settings, seed))


def gather(home: str, model: OccAntSettings, settings: FrameSettings, seed: int) -> Frames:
    """Look at a home from random poses.

    Args:
        home: A scene's name.
        model: Patch and projection.
        settings: How many looks, and what is revealed.
        seed: Seeds the poses, together with the home's name.
    """
    scene = make_scene(home)
    world = TwinWorld.of(scene, model.layout.cell_m)
    camera = CameraSpec(width_px=settings.image_px, height_px=settings.image_px)
    depth_camera = make_depth_camera(scene.storey_mesh, camera, backend="embree", device="cpu")
    labeller = Labeller(model.layout, settings)
    rng = np.random.default_rng([seed, *home.encode()])
    looks, labels = [], []
    for _ in range(settings.frames_per_home):
        x, z = world.frame.centers_of(world.starts[rng.integers(len(world.starts))])[0]
        heading_rad = float(rng.uniform(-np.pi, np.pi))
        matrix = camera_pose((x, scene.floor_y_m + camera.sensor_height_m, z), heading_rad)
        looks.append(look_of(depth_camera.render(matrix), camera, model))
        labels.append(labeller.label(world, np.array([x, z, heading_rad]), looks[-1]))
    return Frames(np.stack(looks), np.stack(labels))


def look_of(depth_m: NDArray[np.float32], camera: CameraSpec, model: OccAntSettings) -> NDArray[np.bool_]:
    """Project a depth image on the patch ahead, (2, V, V) bool."""
    hits = project_depth(depth_m, camera, model.projection)
    return seen_masks(count_hits(hits, model.layout.patch), model.projection)


class Labeller:
    """Reveal the true layout ahead of an agent as far as walls let it.

    Args:
        layout: The patch.
        settings: How far a sweep reaches.

    Source:
        Occupancy Anticipation's code, "wall_occupancy": a sweep that only walls stop, and what is visible.
    """

    def __init__(self, layout: LayoutSettings, settings: FrameSettings) -> None:
        self._patch, self._wall_m = layout.patch, settings.wall_m
        self._fan = RayFan(
            FanSettings(
                hfov_deg=settings.label_hfov_deg, range_m=layout.patch_cells * layout.cell_m, columns=256
            )
        )
        points = np.stack([self._fan.right_m, -self._fan.ahead_m], axis=-1).reshape(-1, 2)
        cells = self._patch.cells_of(points)
        self._is_inside = self._patch.contains(cells)
        self._cells = np.where(self._is_inside[:, None], cells, 0)
        everywhere = np.ones(self._patch.shape, bool)
        self._centers = self._patch.centers_of(np.argwhere(everywhere))

    def label(
        self, world: TwinWorld, pose: NDArray[np.float64], look: NDArray[np.bool_]
    ) -> NDArray[np.bool_]:
        """Tell what is there, (2, V, V) bool: occupied, explored.

        Args:
            world: Where the agent is.
            pose: (3,) x, z in metres and heading in radians, world frame.
            look: (2, V, V) what it sees.
        """
        swept = self._fan.swept(self._fan.tops(world, pose[None]), self._wall_m)[0].ravel()
        cells = self._cells[swept & self._is_inside]
        revealed = np.zeros(self._patch.shape, bool)
        revealed[cells[:, 0], cells[:, 1]] = True
        # Rays lie farther apart than cells at the far end.
        revealed = ndimage.binary_closing(np.pad(revealed, 1))[1:-1, 1:-1] | look[1]
        turn = FloorPose((pose[0], pose[1]), pose[2]).world_from_ego
        tops_m = world.tops_at(self._centers @ turn[:, :2].T + turn[:, 2]).reshape(self._patch.shape)
        revealed &= tops_m > VOID_M
        return np.stack([(tops_m > 0.0) & revealed, revealed])


def as_arrays(frames: Frames, chosen: NDArray[Any]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Looks and labels of some frames, each (B, 2, V, V) float32."""
    return frames.looks[chosen].astype(np.float32), frames.labels[chosen].astype(np.float32)
