"""Load a mesh file as a scene: read, clean, scale, turn upright, find the storeys, pick one."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from anm_gym.errors import SceneError
from anm_gym.mesh import TriangleMesh
from anm_gym.scenes.axes import (
    check_unit,
    check_up_axis,
    default_up_axis,
    flat_area_peaks_m2,
    in_metres,
    stands_upright,
    y_up,
)
from anm_gym.scenes.cleaning import CleanMesh, clean_mesh
from anm_gym.scenes.reading import read_triangles
from anm_gym.scenes.scene import Scene, Storey
from anm_gym.scenes.storeys import find_storeys, level_heights

_ROOM_HEIGHTS_M = (2.1, 3.6)
_MUCH_LARGER = 2.0


@dataclass(frozen=True, eq=False)
class LoadedScene:
    """A scene and the record of what the file needed before it became one."""

    scene: Scene
    """The scene."""
    cleaned: CleanMesh
    """Its mesh with the counts of what was dropped."""


def load_scene(
    path: str | Path, *, up_axis: str = "auto", unit: str = "m", storey: int | None = None
) -> Scene:
    """Load a mesh file as a scene.

    Args:
        path: A ``.glb``, ``.gltf``, ``.obj``, ``.ply`` or ``.stl`` file.
        up_axis: ``"y"`` or ``"z"``; ``"auto"`` takes the format's default (y for glTF and OBJ, z for
            PLY and STL) and checks it against the mesh.
        unit: What 1 means in the file: ``"m"``, ``"cm"``, ``"mm"``, ``"in"`` or ``"ft"``.
        storey: Index counted from the lowest; None takes the one with the largest navigable area.

    Returns:
        The scene in metres, y up. `Scene.repairs` tells what was changed.

    Raises:
        ValueError: If `up_axis` or `unit` is unknown.
        SceneError: If the file cannot be read, has the wrong size for its unit, offers the agent no
            floor, or has no storey of that index.
    """
    return load_with_record(path, up_axis=up_axis, unit=unit, storey=storey).scene


def load_with_record(
    path: str | Path, *, up_axis: str = "auto", unit: str = "m", storey: int | None = None
) -> LoadedScene:
    """Load a mesh file as a scene and keep the counts of what was dropped; see `load_scene`."""
    check_up_axis(up_axis)
    check_unit(unit)
    file = Path(path)
    cleaned = clean_mesh(read_triangles(file), file.name)
    cleaned = replace(cleaned, mesh=in_metres(cleaned.mesh, unit))
    if up_axis == "auto":
        cleaned, storeys = _upright(cleaned, file)
    else:
        cleaned = replace(cleaned, mesh=y_up(cleaned.mesh, up_axis))
        storeys = find_storeys(cleaned.mesh)
    if not storeys:
        raise _no_floor_error(cleaned.mesh, file)
    return LoadedScene(assemble_scene(cleaned, storeys, storey, file.stem, str(file)), cleaned)


def assemble_scene(
    cleaned: CleanMesh, storeys: tuple[Storey, ...], index: int | None, name: str, source: str
) -> Scene:
    """Select a storey of a checked mesh.

    Raises:
        SceneError: If there is no storey of that index.
    """
    if index is None:
        selected = max(storeys, key=lambda storey: storey.navigable_area_m2)
    elif 0 <= index < len(storeys):
        selected = storeys[index]
    else:
        floors = ", ".join(f"{storey.index}: y = {storey.floor_y_m:.2f} m" for storey in storeys)
        raise SceneError(
            f"`storey` of {name} must be in [0, {len(storeys) - 1}], got {index}; it has {floors}"
        )
    return Scene(
        name, cleaned.mesh, selected.floor_y_m, selected.ceiling_y_m, storeys, source, cleaned.repairs
    )


def _upright(cleaned: CleanMesh, file: Path) -> tuple[CleanMesh, tuple[Storey, ...]]:
    """Turn a mesh upright by its format's axis, unless the mesh shows that it is the other one."""
    axis = default_up_axis(file)
    other = "z" if axis == "y" else "y"
    usual = y_up(cleaned.mesh, axis)
    storeys = find_storeys(usual)
    area_m2 = dict(zip("xyz", flat_area_peaks_m2(cleaned.mesh).tolist(), strict=True))
    if area_m2[axis] >= area_m2[other] and any(s.ceiling_y_m is None or _is_room_high(s) for s in storeys):
        return replace(cleaned, mesh=usual), storeys
    turned = y_up(cleaned.mesh, other)
    other_storeys = find_storeys(turned)
    is_level = area_m2[other] > area_m2[axis]
    if not _is_more_plausible(other_storeys, storeys) or not _is_room(turned, other_storeys, is_level):
        return replace(cleaned, mesh=usual), storeys
    repair = (
        f"took {other} as the up axis although {file.suffix} files have {axis} up: the mesh has its floors "
        f"across {other} (pass up_axis={axis!r} if this is wrong)"
    )
    return replace(cleaned, mesh=turned, repairs=(*cleaned.repairs, repair)), other_storeys


def _is_more_plausible(candidate: tuple[Storey, ...], usual: tuple[Storey, ...]) -> bool:
    """Whether floors are so much larger, or so much more of a room's height, as to overrule a format."""
    if not candidate or not usual:
        return bool(candidate)
    best, known = (max(storeys, key=lambda s: s.navigable_area_m2) for storeys in (candidate, usual))
    if best.navigable_area_m2 >= _MUCH_LARGER * known.navigable_area_m2:
        return True
    is_larger = best.navigable_area_m2 > known.navigable_area_m2
    return is_larger and _is_room_high(best) and not _is_room_high(known)


def _is_room(mesh: TriangleMesh, storeys: tuple[Storey, ...], is_level: bool) -> bool:
    """Whether a mesh that was turned is a room, rather than walls without a floor on their side."""
    best = max(storeys, key=lambda s: s.navigable_area_m2)
    return _is_room_high(best) or (is_level and (best.ceiling_y_m is None or stands_upright(mesh)))


def _is_room_high(storey: Storey) -> bool:
    if storey.ceiling_y_m is None:
        return False
    return _ROOM_HEIGHTS_M[0] <= storey.ceiling_y_m - storey.floor_y_m <= _ROOM_HEIGHTS_M[1]


def _no_floor_error(mesh: TriangleMesh, file: Path) -> SceneError:
    """Say why nobody can stand on a mesh: nothing is level, or nothing level is large and free."""
    size_m = " x ".join(f"{side:.2f}" for side in mesh.bounds[1] - mesh.bounds[0])
    advice = "check `up_axis` and `unit`"
    _, areas_m2 = level_heights(mesh)
    if len(areas_m2) == 0:
        return SceneError(
            f"{file.name} must have a floor, got {len(mesh.faces)} triangles in {size_m} m "
            f"and no level surface; {advice}"
        )
    return SceneError(
        f"{file.name} must have a floor with room for the agent's body, got level surfaces of at most "
        f"{float(np.max(areas_m2)):.2f} m2 in {size_m} m, all too small or too low overhead; {advice}"
    )
