"""Walls between the rooms of a plan, and the doors, windows and entrance cut into them."""

import numpy as np
from numpy.typing import NDArray

from anm_gym.scenes.procedural.plan import OUTSIDE, Opening, Room, Wall
from anm_gym.scenes.procedural.tiers import CORRIDOR, TierSpec

_MARGIN_CM = 15
_MIN_DOOR_CM = 80
_SOCIAL = frozenset({"living", "dining", "kitchen", "studio"})
_WET = frozenset({"bathroom", "laundry", "storage"})
_MAX_LOOP_COST = 3.6


def find_walls(rooms: tuple[Room, ...]) -> tuple[Wall, ...]:
    """Find the straight walls between each two rooms and around the home."""
    xs, zs, labels = _label_grid(rooms)
    return tuple(_walls_along(labels, zs, xs, True) + _walls_along(labels.T, xs, zs, False))


def _label_grid(rooms: tuple[Room, ...]) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Room index of every rectangle of the grid of all wall lines, with a border of `OUTSIDE`."""
    rects = [(index, rect) for index, room in enumerate(rooms) for rect in room.rects]
    xs = np.unique([x for _, rect in rects for x in (rect.x0, rect.x1)])
    zs = np.unique([z for _, rect in rects for z in (rect.z0, rect.z1)])
    labels = np.full((len(zs) + 1, len(xs) + 1), OUTSIDE)
    for index, rect in rects:
        rows = 1 + np.searchsorted(zs, (rect.z0, rect.z1))
        columns = 1 + np.searchsorted(xs, (rect.x0, rect.x1))
        labels[rows[0] : rows[1], columns[0] : columns[1]] = index
    return xs, zs, labels


def _walls_along(
    labels: NDArray[np.int64], lines: NDArray[np.int64], ends: NDArray[np.int64], along_x: bool
) -> list[Wall]:
    walls = []
    for row, line in enumerate(lines):
        below, above = labels[row, 1:-1], labels[row + 1, 1:-1]
        changes = np.flatnonzero((np.diff(below) != 0) | (np.diff(above) != 0)) + 1
        for start, stop in zip([0, *changes], [*changes, len(below)], strict=True):
            if below[start] != above[start]:
                rooms = (int(below[start]), int(above[start]))
                walls.append(Wall(along_x, int(line), int(ends[start]), int(ends[stop]), rooms))
    return walls


def place_doors(
    rooms: tuple[Room, ...], walls: tuple[Wall, ...], spec: TierSpec, rng: np.random.Generator
) -> tuple[tuple[Opening, ...], float] | None:
    """Connect all rooms by a cheapest tree of doors, then add some that close loops.

    Args:
        rooms: The rooms.
        walls: The walls of `find_walls`.
        spec: Tier, for the number of loops.
        rng: Source of chance.

    Returns:
        The doors and the cost of the tree (low when nobody walks through a bathroom); None when
        some room has no wall that is long enough for a door.
    """
    candidates = _candidates(rooms, walls, rng)
    tree, spare = _spanning_tree(len(rooms), candidates)
    if len(tree) < len(rooms) - 1:
        return None
    loops = [(cost, wall) for cost, wall in spare if cost < _MAX_LOOP_COST]
    wanted = max(int(rng.binomial(len(loops), spec.loop_share)), spec.min_loops)
    chosen = [wall for _, wall in tree] + [wall for _, wall in loops[:wanted]]
    return tuple(_cut_door(rooms, wall, rng) for wall in chosen), sum(cost for cost, _ in tree)


def _candidates(
    rooms: tuple[Room, ...], walls: tuple[Wall, ...], rng: np.random.Generator
) -> list[tuple[float, Wall]]:
    """The longest wall of each two neighbours with its cost, cheapest first."""
    longest: dict[tuple[int, int], Wall] = {}
    for wall in walls:
        pair = (min(wall.rooms), max(wall.rooms))
        fits = not wall.is_exterior and wall.length_cm >= _MIN_DOOR_CM + 2 * _MARGIN_CM
        if fits and (pair not in longest or wall.length_cm > longest[pair].length_cm):
            longest[pair] = wall
    costs = [_door_cost(rooms[wall.rooms[0]].kind, rooms[wall.rooms[1]].kind) for wall in longest.values()]
    jitter = rng.uniform(0.0, 0.5, len(costs))
    return sorted(zip((costs + jitter).tolist(), longest.values(), strict=True), key=lambda item: item[0])


def _door_cost(first: str, second: str) -> float:
    kinds = {first, second}
    if kinds == {CORRIDOR}:
        return 0.0
    if kinds <= _SOCIAL:
        return 0.8
    if CORRIDOR in kinds:
        return 1.0
    if kinds & _WET:
        return 8.0 if kinds <= _WET else 3.2
    return 2.0 if kinds & _SOCIAL else 3.0


def _spanning_tree(
    num_rooms: int, candidates: list[tuple[float, Wall]]
) -> tuple[list[tuple[float, Wall]], list[tuple[float, Wall]]]:
    """Kruskal's algorithm: walls of the cheapest tree, and the others."""
    group = list(range(num_rooms))
    tree: list[tuple[float, Wall]] = []
    spare: list[tuple[float, Wall]] = []
    for cost, wall in candidates:
        first, second = (group[room] for room in wall.rooms)
        (spare if first == second else tree).append((cost, wall))
        group = [first if member == second else member for member in group]
    return tree, spare


def _cut_door(rooms: tuple[Room, ...], wall: Wall, rng: np.random.Generator) -> Opening:
    kinds = {rooms[index].kind for index in wall.rooms}
    space = wall.length_cm - 2 * _MARGIN_CM
    lowest_ceiling = min(rooms[index].ceiling_cm for index in wall.rooms)
    if kinds == {CORRIDOR} or (kinds <= _SOCIAL and space >= 140 and rng.random() < 0.7):
        width = min(space, 10 * int(rng.integers(13, 23)))
        return _opening("wide", wall, width, int(rng.integers(0, 2)) * 0.5, lowest_ceiling - 20)
    width = min(space // 5 * 5, 5 * int(rng.integers(16, 21)))
    at = rng.choice([0.0, 1.0, rng.uniform(0.2, 0.8)])
    return _opening("door", wall, width, float(at), int(rng.integers(200, 211)))


def _opening(kind: str, wall: Wall, width: int, at: float, top: int, bottom: int = 0) -> Opening:
    """Cut an opening; `at` in [0, 1] slides it along the wall between the margins."""
    low = wall.low_cm + _MARGIN_CM + round((wall.length_cm - 2 * _MARGIN_CM - width) * at)
    return Opening(kind, wall, low, low + width, bottom, top)


def place_windows(
    rooms: tuple[Room, ...], walls: tuple[Wall, ...], rng: np.random.Generator
) -> tuple[Opening, ...]:
    """Put one entrance and the windows into the outer walls; all of them are closed."""
    outer = [wall for wall in walls if wall.is_exterior]
    entrance = _place_entrance(rooms, outer, rng)
    windows = [
        window
        for wall in outer
        if wall != entrance.wall
        for window in _windows_in(rooms[max(wall.rooms)].kind, wall, rng)
    ]
    return (entrance, *windows)


def _place_entrance(rooms: tuple[Room, ...], outer: list[Wall], rng: np.random.Generator) -> Opening:
    """Prefer the end of a corridor, then the room where one lives."""
    ranks = {CORRIDOR: 0, "studio": 1, "living": 1, "dining": 2, "kitchen": 2}
    long_enough = [wall for wall in outer if wall.length_cm >= 100] or outer
    wall = min(long_enough, key=lambda wall: (ranks.get(rooms[max(wall.rooms)].kind, 3), rng.random()))
    return _opening("entrance", wall, min(90, wall.length_cm - 2 * _MARGIN_CM), 0.5, 205)


def _windows_in(kind: str, wall: Wall, rng: np.random.Generator) -> list[Opening]:
    small = kind in _WET
    spacing = 360 if small else 280
    count = max(1, wall.length_cm // spacing) if wall.length_cm >= 110 and kind != "storage" else 0
    pitch = wall.length_cm / max(count, 1)
    windows = []
    for index in range(count):
        width = 60 if small else min(10 * int(rng.integers(9, 19)), int(pitch) - 60)
        middle = wall.low_cm + round(pitch * (index + 0.5))
        bottom, top = (140, 200) if small else (90, 220)
        windows.append(Opening("window", wall, middle - width // 2, middle - width // 2 + width, bottom, top))
    return windows
