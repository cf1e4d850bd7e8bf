"""A mesh under examination: is it fit for exploration, and if not, what to do about it?"""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from scipy import ndimage

from anm_gym.mesh import TriangleMesh
from anm_gym.scenes.advice import report_warnings
from anm_gym.scenes.cleaning import CleanMesh
from anm_gym.scenes.load import LoadedScene, load_with_record
from anm_gym.scenes.probes import Surroundings, make_probe, probe_surroundings
from anm_gym.scenes.scene import Scene, Storey
from anm_gym.scenes.storeys import MIN_STOREY_GAP_M, floor_tilt_deg, level_heights
from anm_gym.sim.camera import DepthCamera
from anm_gym.sim.traversable import TraversableGrid

_BESIDE_M2: Final = 5.0
"""Smaller level surfaces are tables and beds, square metres."""
_BESIDE_SHARE: Final = 0.15


@dataclass(frozen=True)
class StoreyReport:
    """One storey, as the default body and its camera meet it."""

    index: int
    """Position counted from the lowest."""
    floor_y_m: float
    """Height of the floor, metres, world frame."""
    ceiling_y_m: float | None
    """Height of the ceiling, metres, world frame; None where most of the floor is open to the sky."""
    navigable_m2: float
    """Area where the body's centre may stand, all parts together, square metres."""
    parts_m2: tuple[float, ...]
    """Area of each connected part, square metres, largest first."""
    tilt_deg: float
    """How far the floor is from level, degrees."""
    beside: tuple[tuple[float, float], ...]
    """Height (metres, world frame) and area (square metres) of other floors of the storey, a step up or down
    that the body does not take."""
    surroundings: Surroundings
    """What rays from the largest part meet."""

    @property
    def height_m(self) -> float | None:
        """Floor to ceiling, metres; None without a ceiling."""
        return None if self.ceiling_y_m is None else self.ceiling_y_m - self.floor_y_m


@dataclass(frozen=True)
class MeshReport:
    """What there is to know about a mesh before exploring it."""

    name: str
    """The scene's name."""
    source: str
    """Where it came from."""
    size_m: tuple[float, float, float]
    """Extent along x, y (up) and z, metres."""
    num_triangles: int
    """Triangles that are used."""
    surface_m2: float
    """Their area, square metres."""
    num_nan_vertices: int
    """Vertices of the file that were NaN or infinite; their faces are dropped."""
    num_degenerate_faces: int
    """Faces of the file without area; they are dropped."""
    num_duplicate_faces: int
    """Faces that repeat the corners of another one, whatever the winding; they are kept."""
    storeys: tuple[StoreyReport, ...]
    """Every storey, lowest first."""
    selected_storey: int
    """Index of the storey that is played."""
    repairs: tuple[str, ...]
    """What the loader changed."""
    warnings: tuple[str, ...]
    """What may spoil an experiment, each with a remedy; empty for a fit mesh."""

    def to_json(self) -> dict[str, Any]:
        """Plain dictionaries, lists, numbers and strings."""
        return asdict(self)


def mesh_report(
    source: Scene | LoadedScene | str | Path,
    *,
    up_axis: str = "auto",
    unit: str = "m",
    storey: int | None = None,
) -> MeshReport:
    """Examine a mesh.

    Args:
        source: A scene, or the path of a mesh file.
        up_axis: For a path, as in `load_scene`.
        unit: For a path, as in `load_scene`.
        storey: For a path, as in `load_scene`.

    Returns:
        Sizes, faults, storeys, shares of rays, warnings. No randomness is involved.

    Raises:
        SceneError: If the file cannot be loaded as a scene.
    """
    if isinstance(source, Scene):
        loaded = LoadedScene(source, CleanMesh(source.mesh, repairs=source.repairs))
    elif isinstance(source, LoadedScene):
        loaded = source
    else:
        loaded = load_with_record(source, up_axis=up_axis, unit=unit, storey=storey)
    return _examine(loaded)


def count_duplicate_faces(mesh: TriangleMesh) -> int:
    """Count the faces whose three corners (to 0.1 mm) are those of an earlier face, in any order."""
    corners = np.rint(mesh.triangles * 1e4).astype(np.int64).astype(np.uint64)
    primes = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)
    mixed = (corners * primes).sum(axis=2, dtype=np.uint64)
    mixed ^= mixed >> np.uint64(29)
    mixed *= np.uint64(0xBF58476D1CE4E5B9)
    keys = mixed.sum(axis=1, dtype=np.uint64)
    return len(keys) - len(np.unique(keys))


def _examine(loaded: LoadedScene) -> MeshReport:
    scene, mesh = loaded.scene, loaded.scene.mesh
    caster = make_probe(mesh)
    storeys = tuple(_examine_storey(mesh, caster, storey) for storey in scene.storeys)
    width_m, height_m, depth_m = (mesh.bounds[1] - mesh.bounds[0]).tolist()
    num_duplicates = count_duplicate_faces(mesh)
    return MeshReport(
        name=scene.name,
        source=scene.source,
        size_m=(width_m, height_m, depth_m),
        num_triangles=len(mesh.faces),
        surface_m2=float(mesh.areas_m2.sum()),
        num_nan_vertices=loaded.cleaned.num_nan_vertices,
        num_degenerate_faces=loaded.cleaned.num_degenerate_faces,
        num_duplicate_faces=num_duplicates,
        storeys=storeys,
        selected_storey=scene.storey.index,
        repairs=scene.repairs,
        warnings=report_warnings(mesh, storeys, num_duplicates),
    )


def _floors_beside(
    mesh: TriangleMesh, grid: TraversableGrid, floor_y_m: float
) -> Iterator[tuple[float, float]]:
    """Find floors at other heights of a storey that are large enough to be rooms, the largest first."""
    least_m2 = max(_BESIDE_M2, _BESIDE_SHARE * next(iter(grid.component_areas_m2), 0.0))
    covered = grid.navigable.copy()
    for height_m in level_heights(mesh)[0].tolist():
        if abs(height_m - floor_y_m) >= MIN_STOREY_GAP_M:
            continue
        other = TraversableGrid.from_mesh(mesh, height_m)
        labels, count = ndimage.label(other.navigable & ~covered)
        largest_m2 = np.bincount(labels.ravel(), minlength=2)[1:].max() * grid.frame.cell_m**2
        if count and largest_m2 >= least_m2:
            yield height_m, float(largest_m2)
            covered |= other.navigable


def _examine_storey(mesh: TriangleMesh, caster: DepthCamera, storey: Storey) -> StoreyReport:
    grid = TraversableGrid.from_mesh(mesh, storey.floor_y_m)
    return StoreyReport(
        index=storey.index,
        floor_y_m=storey.floor_y_m,
        ceiling_y_m=storey.ceiling_y_m,
        navigable_m2=grid.navigable_area_m2,
        parts_m2=grid.component_areas_m2,
        tilt_deg=floor_tilt_deg(mesh, storey.floor_y_m),
        beside=tuple(_floors_beside(mesh, grid, storey.floor_y_m)),
        surroundings=probe_surroundings(caster, mesh, grid, storey.floor_y_m),
    )
