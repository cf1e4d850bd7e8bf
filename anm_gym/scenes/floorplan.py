"""Floor plans: ProcTHOR house files read, checked and built as empty homes.

Only the shell is built: floors, ceilings and walls of real thickness with open doorways. Windows and
the doors that lead outside stay closed, so that no ray leaves the house. Furniture is left out.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import shapely
from numpy.typing import NDArray

from anm_gym.errors import SceneError
from anm_gym.scenes.interior import Opening, build_interior
from anm_gym.scenes.scene import Scene, Storey
from anm_gym.sim.traversable import TraversableGrid

CEILINGS_M: Final = (1.8, 20.0)
"""Lowest and highest ceiling that a plan may have, metres (ours)."""

_EXTERIOR: Final = "exterior"


@dataclass(frozen=True, eq=False)
class PlanRoom:
    """One room."""

    name: str
    """Identifier in the file, such as ``room|4``."""
    kind: str
    """Use of the room, such as ``Kitchen``."""
    outline_xz: NDArray[np.float64]
    """(N, 2) float64 corners along the middle of the walls, metres, world frame."""


@dataclass(frozen=True, eq=False)
class FloorPlan:
    """What a plan says, in the world frame: the file's z turned round, as Unity is left-handed."""

    rooms: tuple[PlanRoom, ...]
    """Rooms in the order of the file."""
    walls_xz: NDArray[np.float64]
    """(W, 2, 2) float64 ends of the middle line of each wall that is built, metres."""
    doorways: tuple[Opening, ...]
    """Open doorways between rooms."""
    ceiling_m: float
    """Height of the ceiling over the floor, metres."""


def load_floorplan(path: str | Path) -> Scene:
    """Build the empty home of a ProcTHOR house file.

    Args:
        path: JSON file with ``rooms`` (``floorPolygon``), ``walls`` (``polygon``, ``empty`` for
            open-plan), ``doors`` (``wall0``, ``holePolygon``) and, if not to be taken from the
            walls, ``ceiling_height``.

    Returns:
        One storey with its floor at y = 0. x is the file's; z is the file's with the sign changed,
        which keeps left and right as they are in the house.

    Raises:
        SceneError: If the file is not such a plan, or no room has space for the agent's body.

    Source:
        House format of ProcTHOR (Deitke et al. 2022); wall thickness ours.
    """
    plan = read_floorplan(path)
    mesh = build_interior(
        [(room.kind, room.outline_xz) for room in plan.rooms], plan.walls_xz, plan.doorways, plan.ceiling_m
    )
    areas_m2 = TraversableGrid.from_mesh(mesh, 0.0).component_areas_m2
    if not areas_m2:
        raise SceneError(f"{Path(path).name} must have a room with space for the agent's body, got none")
    storey = Storey(0, 0.0, plan.ceiling_m, areas_m2[0])
    return Scene(Path(path).stem, mesh, 0.0, plan.ceiling_m, (storey,), str(path))


def read_floorplan(path: str | Path) -> FloorPlan:
    """Read and check a ProcTHOR house file; see `load_floorplan`."""
    file = Path(path)
    house = _read_object(file)
    rooms = tuple(_read_room(record, file.name) for record in _records(house, "rooms", file.name))
    if not rooms:
        raise SceneError(f"plan {file.name} must have at least one room, got none")
    records = _records(house, "walls", file.name)
    walls = {
        str(_field(wall, "id", f"a wall of {file.name}")): _read_wall(wall, file.name) for wall in records
    }
    built = [walls[str(wall["id"])] for wall in records if not wall.get("empty", False)]
    doors = [door for door in _records(house, "doors", file.name) if not _leads_outside(door)]
    return FloorPlan(
        rooms,
        np.array(built).reshape(-1, 2, 2),
        tuple(_read_doorway(door, walls, file.name) for door in doors),
        _read_ceiling(house, records, file.name),
    )


def _read_object(file: Path) -> dict[str, Any]:
    if not file.is_file():
        raise SceneError(f"floor plan {file} must be a file, got nothing there; check the path")
    try:
        house = json.loads(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise SceneError(f"floor plan {file.name} must be JSON, got: {error}") from error
    if not isinstance(house, dict):
        raise SceneError(f"floor plan {file.name} must be a JSON object, got a {type(house).__name__}")
    return house


def _field(record: dict[str, Any], key: str, owner: str) -> Any:
    if key not in record:
        raise SceneError(f"{owner} must have {key!r}, got only {', '.join(map(repr, record)) or 'nothing'}")
    return record[key]


def _records(house: dict[str, Any], key: str, name: str) -> list[dict[str, Any]]:
    records = _field(house, key, f"plan {name}")
    if not isinstance(records, list) or not all(isinstance(record, dict) for record in records):
        raise SceneError(f"{key!r} of plan {name} must be a list of objects, got {type(records).__name__}")
    return records


def _read_room(record: dict[str, Any], name: str) -> PlanRoom:
    room = str(_field(record, "id", f"a room of {name}"))
    corners = _points(
        _field(record, "floorPolygon", f"{room} of {name}"), f"'floorPolygon' of {room} in {name}"
    )
    outline_xz = corners[:, [0, -1]] * (1.0, -1.0)
    if len(outline_xz) < 3 or not shapely.Polygon(outline_xz).is_valid:
        reason = (
            shapely.is_valid_reason(shapely.Polygon(outline_xz)) if len(outline_xz) > 2 else "too few corners"
        )
        raise SceneError(f"'floorPolygon' of {room} in {name} must be a simple polygon, got {reason}")
    return PlanRoom(room, str(record.get("roomType", "room")), outline_xz)


def _read_wall(record: dict[str, Any], name: str) -> NDArray[np.float64]:
    """(2, 2) ends of a wall: its first corner, and the corner farthest from that on the floor."""
    owner = f"{record['id']} of {name}"
    ends = _points(_field(record, "polygon", owner), f"'polygon' of {owner}")[:, [0, -1]] * (1.0, -1.0)
    farthest = int(np.linalg.norm(ends - ends[0], axis=1).argmax())
    return ends[[0, farthest]]


def _read_doorway(record: dict[str, Any], walls: dict[str, NDArray[np.float64]], name: str) -> Opening:
    owner = f"{_field(record, 'id', f'a door of {name}')} of {name}"
    wall = _field(record, "wall0", owner)
    if wall not in walls:
        raise SceneError(f"'wall0' of {owner} must name a wall of the plan, got {wall!r}")
    hole = _points(_field(record, "holePolygon", owner), f"'holePolygon' of {owner}")
    (near_m, bottom_m), (far_m, top_m) = hole[:, :2].min(axis=0), hole[:, :2].max(axis=0)
    start, end = walls[wall]
    length_m = float(np.linalg.norm(end - start))
    if not (length_m > 0.0 and near_m < far_m <= length_m + 0.01 and bottom_m < top_m and near_m >= -0.01):
        raise SceneError(
            f"'holePolygon' of {owner} must lie in its wall of {length_m:.2f} m, "
            f"got {near_m:.2f} to {far_m:.2f} m along and {bottom_m:.2f} to {top_m:.2f} m up"
        )
    along = (end - start) / length_m
    return Opening(np.stack([start + near_m * along, start + far_m * along]), float(bottom_m), float(top_m))


def _leads_outside(door: dict[str, Any]) -> bool:
    """Whether a door is an outer one: it names one room twice, or an outer wall."""
    rooms = (door.get("room0"), door.get("room1"))
    is_single = rooms[0] is not None and rooms[0] == rooms[1]
    return is_single or any(
        _EXTERIOR in str(door.get(key, "")) for key in ("room0", "room1", "wall0", "wall1")
    )


def _read_ceiling(house: dict[str, Any], walls: list[dict[str, Any]], name: str) -> float:
    height_m = house.get("ceiling_height")
    if height_m is None:
        tops = [_points(wall["polygon"], f"'polygon' of {wall['id']}")[:, 1].max() for wall in walls]
        height_m = max(tops, default=0.0)
    low_m, high_m = CEILINGS_M
    if not isinstance(height_m, int | float) or not low_m <= height_m <= high_m:
        raise SceneError(f"'ceiling_height' of {name} must be in [{low_m}, {high_m}] m, got {height_m!r}")
    return float(height_m)


def _points(value: Any, owner: str) -> NDArray[np.float64]:
    """(N, 2 or 3) finite coordinates from a list of pairs or of {"x", "y", "z"} objects."""
    try:
        rows = [[point["x"], point["y"], point["z"]] if isinstance(point, dict) else point for point in value]
        points = np.array(rows, np.float64)
    except (KeyError, TypeError, ValueError) as error:
        raise SceneError(f"{owner} must be a list of points, got {str(value)[:60]}") from error
    if points.ndim != 2 or len(points) < 2 or points.shape[1] not in (2, 3) or not np.isfinite(points).all():
        raise SceneError(f"{owner} must be at least two finite points, got {str(value)[:60]}")
    return points
