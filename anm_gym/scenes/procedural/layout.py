"""From a tier and a seed to the plan of a home."""

import numpy as np

from anm_gym.scenes.procedural.openings import find_walls, place_doors, place_windows
from anm_gym.scenes.procedural.partition import GRID_CM, Cell, misfit, subdivide
from anm_gym.scenes.procedural.plan import Layout, Opening, Rect, Room, Wall
from anm_gym.scenes.procedural.tiers import CORRIDOR, ROOM_TYPES, TIERS, VOID, TierSpec, tier_spec

_PLANS = 6
_MAX_PLANS = 60
_TURNED_SHARE = 0.6


def plan_home(tier: str, seed: int) -> Layout:
    """Draw the plan of a home.

    Several plans are drawn and the best is kept: rooms of useful shapes, few of them behind a bathroom.

    Args:
        tier: ``studio``, ``flat``, ``house`` or ``maze``.
        seed: Not negative; the same tier and seed give the same plan, bit for bit.

    Returns:
        The plan, with every room behind at least one door.

    Raises:
        ValueError: If the tier is unknown or the seed is negative.

    Source:
        Ours.
    """
    spec = tier_spec(tier)
    rng = stream(tier, seed, 0)
    kinds, area_m2 = _draw_programme(spec, rng)
    _, rooms, walls, doors = _best_plan(spec, kinds, area_m2, rng)
    yaw_rad = float(rng.uniform(-np.pi, np.pi)) if rng.random() < _TURNED_SHARE else 0.0
    windows = place_windows(rooms, walls, rng)
    return Layout(tier, seed, yaw_rad, rooms, walls, doors, windows)


def stream(tier: str, seed: int, *stage: int) -> np.random.Generator:
    """Make the generator of one stage of one home, independent of all others.

    Raises:
        ValueError: If the seed is negative.
    """
    if seed < 0:
        raise ValueError(f"`seed` must be >= 0, got {seed}")
    return np.random.default_rng([list(TIERS).index(tier), seed, *stage])


def _draw_programme(spec: TierSpec, rng: np.random.Generator) -> tuple[tuple[str, ...], float]:
    """Kinds of rooms and the area, square metres; homes with more rooms are larger."""
    size = rng.random()
    fewest, most = spec.num_rooms
    num_rooms = min(fewest + int(size * (most - fewest + 1)), most)
    if num_rooms == 1 and rng.random() < 0.6:
        num_rooms = most
    kinds = list(spec.essential[:num_rooms])
    if spec.optional:
        kinds += rng.choice(spec.optional, num_rooms - len(kinds)).tolist()
    kinds += [VOID] * int(rng.integers(spec.num_voids[0], spec.num_voids[1] + 1))
    low, high = spec.area_m2
    return tuple(kinds), low + (high - low) * float(np.clip(size + rng.uniform(-0.15, 0.15), 0.04, 0.96))


def _best_plan(
    spec: TierSpec, kinds: tuple[str, ...], area_m2: float, rng: np.random.Generator
) -> tuple[float, tuple[Room, ...], tuple[Wall, ...], tuple[Opening, ...]]:
    """The cheapest of the first `_PLANS` plans whose rooms can all be reached and whose area fits."""
    plans = []
    for _ in range(_MAX_PLANS):
        plan = _draw_plan(spec, kinds, area_m2, rng)
        if plan is not None:
            plans.append(plan)
        if len(plans) == _PLANS:
            break
    assert plans, "sixty plans in a row without a connected one"
    return min(plans, key=lambda plan: plan[0])


def _draw_plan(
    spec: TierSpec, kinds: tuple[str, ...], area_m2: float, rng: np.random.Generator
) -> tuple[float, tuple[Room, ...], tuple[Wall, ...], tuple[Opening, ...]] | None:
    cells = subdivide(_footprint(kinds, area_m2, rng), kinds, spec.corridor_from, rng)
    rooms = _rooms_of(cells, rng)
    walls = find_walls(rooms)
    doors = place_doors(rooms, walls, spec, rng)
    area = sum(room.area_m2 for room in rooms)
    if doors is None or not spec.area_m2[0] <= area <= spec.area_m2[1]:
        return None
    return 2.0 * misfit(cells) + doors[1] / len(rooms), rooms, walls, doors[0]


def _footprint(kinds: tuple[str, ...], area_m2: float, rng: np.random.Generator) -> Rect:
    areas = {kind: ROOM_TYPES[kind].area_m2 for kind in kinds}
    void = kinds.count(VOID) * areas.get(VOID, 0.0) / sum(areas[kind] for kind in kinds)
    total_m2 = area_m2 / (1.0 - void)
    aspect = rng.uniform(1.0, 1.7)
    width = round(np.sqrt(total_m2 * aspect) * 100 / GRID_CM) * GRID_CM
    depth = round(total_m2 * 1e4 / width / GRID_CM) * GRID_CM
    return Rect(0, 0, width, depth) if rng.random() < 0.5 else Rect(0, 0, depth, width)


def _rooms_of(cells: list[Cell], rng: np.random.Generator) -> tuple[Room, ...]:
    """Rooms with their ceilings: one height for the home, lower in some corridors and bathrooms."""
    height = 10 * int(rng.integers(25, 31))
    lower = {CORRIDOR: 10 * int(rng.integers(24, 26)), "bathroom": 240, "storage": 240}
    return tuple(
        Room(cell.kind, cell.rects, min(height, lower.get(cell.kind, height)))
        for cell in cells
        if cell.kind != VOID
    )
