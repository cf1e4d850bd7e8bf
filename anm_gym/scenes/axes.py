"""Units and up axes: what a file means by its numbers, and whether the mesh agrees.

A wrong unit or axis does not fail loudly by itself: the agent merely sees no wall within its depth
range, or walks on one. So both are checked before anything else looks at the mesh.
"""

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from anm_gym.errors import SceneError
from anm_gym.mesh import TriangleMesh

METRES_PER_UNIT: Final = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
"""The units a file may be in."""
UP_AXES: Final = ("auto", "y", "z")
"""The choices of `up_axis`."""

_FORMAT_UP: Final = {".glb": "y", ".gltf": "y", ".obj": "y", ".ply": "z", ".stl": "z"}
_LONGEST_M: Final = 300.0
_FARTHEST_M: Final = 20_000.0
_THINNEST_M: Final = 60.0
_SHORTEST_M: Final = 1.0
_ROOM_HEIGHT_M: Final = 2.7
_BUILDING_M: Final = 10.0
_LEAST_FACING: Final = 0.02


def default_up_axis(path: str | Path) -> str:
    """Up axis that a format suggests: "y" by the standard of glTF and the habit of OBJ, else "z"."""
    return _FORMAT_UP.get(Path(path).suffix.lower(), "y")


def check_unit(unit: str) -> None:
    """Refuse an unknown unit with a ValueError that lists the known ones."""
    if unit not in METRES_PER_UNIT:
        raise ValueError(f"`unit` must be one of {', '.join(METRES_PER_UNIT)}, got {unit!r}")


def check_up_axis(up_axis: str) -> None:
    """Refuse an unknown up axis with a ValueError that lists the known ones."""
    if up_axis not in UP_AXES:
        raise ValueError(f"`up_axis` must be one of {', '.join(UP_AXES)}, got {up_axis!r}")


def in_metres(mesh: TriangleMesh, unit: str) -> TriangleMesh:
    """Scale a mesh from its unit to metres.

    Raises:
        SceneError: If the result has no building's size; the message names the likely unit. Also if it lies
            so far from the origin, as georeferenced data do, that rays could not resolve millimetres there.
    """
    scaled = TriangleMesh(mesh.vertices * METRES_PER_UNIT[unit], mesh.faces, mesh.face_colors)
    size_m = scaled.bounds[1] - scaled.bounds[0]
    if _is_building(size_m):
        _check_origin(scaled.bounds)
        return scaled
    extent = " x ".join(f"{side:.4g}" for side in size_m)
    raise SceneError(
        f"the scene must measure {_SHORTEST_M:g} to {_LONGEST_M:g} m, got {extent} m "
        f"with unit={unit!r}; {_unit_advice(size_m / METRES_PER_UNIT[unit])}"
    )


def likely_units(size: NDArray[np.float64]) -> tuple[str, ...]:
    """Name the units in which a size would be a building's, the most likely first.

    Args:
        size: (3,) extent of the bounding box in the file's unit.
    """
    plausible = {unit: size * metres for unit, metres in METRES_PER_UNIT.items() if _is_likely(size * metres)}
    return tuple(sorted(plausible, key=lambda unit: _strangeness(plausible[unit])))


def flat_area_peaks_m2(mesh: TriangleMesh) -> NDArray[np.float64]:
    """Measure the largest plane across each axis.

    Args:
        mesh: Mesh in any axes.

    Returns:
        (3,) float64 area, in the mesh's unit squared, of the faces across x, y and z that share one
        coordinate (bins of a hundredth of the largest extent). A floor makes the up axis win.

    Source:
        Ours.
    """
    centers = mesh.triangles.mean(axis=1)
    bin_size = float((mesh.bounds[1] - mesh.bounds[0]).max()) / 100.0
    # The mean of three equal coordinates may be rounded to less than the lowest of them.
    bins = np.floor(np.maximum(centers - mesh.bounds[0], 0.0) / bin_size).astype(np.int64)
    is_across = np.abs(mesh.normals) > 0.9
    areas = [
        np.bincount(bins[is_across[:, axis], axis], mesh.areas_m2[is_across[:, axis]], 1).max()
        for axis in range(3)
    ]
    return np.array(areas)


def stands_upright(mesh: TriangleMesh) -> bool:
    """Tell whether what stands in a mesh faces two ways, as walls around a room do.

    Walls without a floor, laid on a side, do not: two of them then are floor and ceiling.

    Args:
        mesh: Mesh with y up, as is assumed. One in which nothing stands has nothing against it.

    Source:
        Ours.
    """
    is_standing = np.abs(mesh.normals[:, 1]) < 0.1
    facing_m2 = mesh.areas_m2[is_standing] @ mesh.normals[is_standing][:, [0, 2]] ** 2
    return bool(facing_m2.min() >= _LEAST_FACING * facing_m2.max())


def y_up(mesh: TriangleMesh, up_axis: str) -> TriangleMesh:
    """Turn a mesh so that its up axis becomes y: (x, y, z) -> (x, z, -y) for a z-up mesh."""
    if up_axis == "y":
        return mesh
    vertices = np.stack([mesh.vertices[:, 0], mesh.vertices[:, 2], -mesh.vertices[:, 1]], axis=1)
    return TriangleMesh(vertices, mesh.faces, mesh.face_colors)


def _check_origin(bounds_m: NDArray[np.float64]) -> None:
    farthest_m = float(np.abs(bounds_m).max())
    if farthest_m > _FARTHEST_M:
        center = np.round(bounds_m.mean(axis=0)).tolist()
        raise SceneError(
            f"the scene must lie within {_FARTHEST_M:g} m of the origin, where rays resolve millimetres, got "
            f"coordinates up to {farthest_m:.4g} m; move it there, for instance by minus {center}"
        )


def _is_building(size_m: NDArray[np.float64]) -> bool:
    return bool(_SHORTEST_M <= size_m.max() <= _LONGEST_M and size_m.min() <= _THINNEST_M)


def _is_likely(size_m: NDArray[np.float64]) -> bool:
    is_room_high = size_m.min() < 1e-3 * size_m.max() or 1.5 <= size_m.min() <= 20.0
    return bool(2.0 <= size_m.max() <= 150.0 and is_room_high)


def _strangeness(size_m: NDArray[np.float64]) -> float:
    """Distance, in octaves or so, of a size from a single-storey building's."""
    thin_m, long_m = float(size_m.min()), float(size_m.max())
    is_sheet = thin_m < 1e-3 * long_m
    return abs(float(np.log(long_m / _BUILDING_M if is_sheet else thin_m / _ROOM_HEIGHT_M)))


def _unit_advice(size: NDArray[np.float64]) -> str:
    units = likely_units(size)
    if not units:
        return "no known unit makes this a building; rescale it or cut the building out"
    return f"the file is likely in {' or '.join(repr(unit) for unit in units[:2])}: pass unit={units[0]!r}"
