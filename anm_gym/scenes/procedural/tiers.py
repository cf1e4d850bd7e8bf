"""Sizes and room programmes of the four tiers of homes.

Only numbers and names; how a programme becomes a plan is the business of `layout`.
"""

from dataclasses import dataclass

from anm_gym.checks import check_known

CORRIDOR = "corridor"
"""Kind of the strips that `layout` puts between rooms."""
VOID = "void"
"""Kind of a request that is left out of the home: it makes the outline less rectangular."""


@dataclass(frozen=True)
class RoomType:
    """How large a kind of room wants to be."""

    area_m2: float
    """Area relative to the other rooms, square metres before the plan is scaled to the home."""
    min_side_cm: int
    """Side under which the room is too narrow to be furnished, centimetres."""


ROOM_TYPES: dict[str, RoomType] = {
    "studio": RoomType(30.0, 320),
    "living": RoomType(26.0, 330),
    "dining": RoomType(14.0, 280),
    "kitchen": RoomType(12.0, 240),
    "bedroom": RoomType(14.0, 280),
    "kids": RoomType(12.0, 260),
    "office": RoomType(11.0, 250),
    "library": RoomType(13.0, 260),
    "gym": RoomType(13.0, 270),
    "bathroom": RoomType(6.5, 190),
    "laundry": RoomType(6.0, 190),
    "storage": RoomType(5.0, 170),
    VOID: RoomType(9.0, 160),
}
"""Room kinds; corridors are not requested, they are made."""


@dataclass(frozen=True)
class TierSpec:
    """The ranges within which a home of one tier lies (ours)."""

    name: str
    """Name of the tier, as in ``home:<name>:<seed>``."""
    area_m2: tuple[float, float]
    """Smallest and largest floor area between wall centre lines, square metres."""
    num_rooms: tuple[int, int]
    """Fewest and most rooms, corridors not counted."""
    essential: tuple[str, ...]
    """Kinds that come first, cut to the number of rooms."""
    optional: tuple[str, ...]
    """Kinds drawn for the remaining rooms."""
    corridor_from: int
    """A block of so many rooms or more is divided by a corridor."""
    num_voids: tuple[int, int] = (0, 0)
    """Fewest and most parts of the outline that are left out."""
    loop_share: float = 0.3
    """Probability that a suitable wall outside the tree of doors gets a door as well."""
    min_loops: int = 0
    """Doors outside the tree that are made as long as there are walls for them."""
    num_triangles: tuple[int, int] = (3_000, 60_000)
    """Range of the number of triangles of the furnished mesh."""


_MAZE = (
    *("living", "bathroom", "bedroom", "kitchen", "dining", "bedroom", "storage", "office"),
    *("bathroom", "library", "bedroom", "living", "kids", "laundry", "bathroom", "gym"),
)
_COMMON = ("bedroom", "kids", "office", "library", "dining", "gym")

TIERS: dict[str, TierSpec] = {
    spec.name: spec
    for spec in (
        TierSpec(
            "studio", (25.0, 40.0), (1, 2), ("studio", "bathroom"), (), 9, num_triangles=(3_000, 12_000)
        ),
        TierSpec(
            "flat",
            (50.0, 90.0),
            (3, 5),
            ("living", "bathroom", "bedroom", "kitchen"),
            ("bedroom", "kids", "office"),
            4,
            num_triangles=(5_000, 25_000),
        ),
        TierSpec(
            "house",
            (110.0, 180.0),
            (6, 10),
            ("living", "bathroom", "bedroom", "kitchen", "bedroom", "dining", "storage", "bathroom"),
            _COMMON,
            5,
            num_voids=(0, 1),
            min_loops=1,
            num_triangles=(8_000, 45_000),
        ),
        TierSpec(
            "maze",
            (300.0, 450.0),
            (20, 28),
            _MAZE,
            (*_COMMON, "storage", "living", "kitchen"),
            7,
            num_voids=(0, 2),
            loop_share=0.25,
            min_loops=3,
            num_triangles=(20_000, 90_000),
        ),
    )
}
"""The four tiers by name."""


def tier_spec(tier: str) -> TierSpec:
    """Look a tier up.

    Raises:
        ValueError: If there is no such tier.
    """
    check_known("tier", tier, TIERS)
    return TIERS[tier]
