"""Which furniture belongs into which room, and where it wants to stand."""

from dataclasses import dataclass
from enum import Enum

from anm_gym.scenes.procedural.furniture import (
    bath,
    decor,
    kitchen,
    leisure,
    seating,
    sleeping,
    storage,
    tables,
)
from anm_gym.scenes.procedural.furniture.piece import Maker


class Where(Enum):
    """Where a piece wants to stand."""

    WALL = "back to a wall"
    CORNER = "back to a wall, at its end"
    OPPOSITE = "back to the wall that the piece before it faces"
    BEFORE = "in front of the piece before it"
    CENTER = "in the middle of free floor"
    FREE = "anywhere, turned anyhow"
    FLAT = "flat on the floor in the middle, under other furniture"
    HUNG = "on a wall, over low furniture"


@dataclass(frozen=True)
class Item:
    """One line of a recipe."""

    maker: Maker
    """Draws the piece."""
    where: Where
    """Where it wants to stand."""
    chance: float = 1.0
    """Probability of each."""
    count: int = 1
    """How many at most."""
    per_m2: float = 0.0
    """Further ones for each square metre of the room."""
    instead: Maker | None = None
    """Smaller piece that is tried where the first does not fit."""


_WALLS = (Item(decor.picture, Where.HUNG, 0.8, 1, 0.1),)
_FLOOR = (
    Item(decor.plant, Where.CORNER, 0.7, 1, 0.06),
    Item(decor.clutter, Where.FREE, 0.6, 1, 0.08),
)

RECIPES: dict[str, tuple[Item, ...]] = {
    "studio": (
        Item(sleeping.double_bed, Where.CORNER, instead=sleeping.single_bed),
        Item(kitchen.short_counter, Where.CORNER, instead=kitchen.low_counter),
        Item(kitchen.fridge, Where.CORNER),
        Item(seating.sofa, Where.WALL),
        Item(tables.coffee_table, Where.BEFORE, 0.8),
        Item(storage.television, Where.OPPOSITE, 0.7),
        Item(decor.rug, Where.FLAT),
        Item(storage.wardrobe, Where.CORNER),
        Item(tables.small_dining_set, Where.CENTER, 0.8),
        Item(tables.desk, Where.WALL, 0.5),
        Item(storage.divider, Where.CENTER, 0.5, instead=decor.folding_screen),
        Item(storage.bookshelf, Where.WALL, 0.7),
        Item(seating.armchair, Where.FREE, 0.5),
        Item(decor.floor_lamp, Where.CORNER, 0.8),
        *_FLOOR,
        *_WALLS,
    ),
    "living": (
        Item(seating.sofa, Where.WALL),
        Item(tables.coffee_table, Where.BEFORE, 0.9),
        Item(storage.television, Where.OPPOSITE, 0.9),
        Item(decor.rug, Where.FLAT),
        Item(tables.dining_set, Where.CENTER, 0.6, instead=tables.small_dining_set),
        Item(storage.bookshelf, Where.WALL, 0.8, 1, 0.04),
        Item(storage.divider, Where.CENTER, 0.45, instead=decor.column),
        Item(seating.sofa, Where.WALL, 0.35),
        Item(seating.armchair, Where.FREE, 0.8, 2),
        Item(decor.column, Where.FREE, 0.25),
        Item(leisure.piano, Where.WALL, 0.3),
        Item(storage.sideboard, Where.WALL, 0.6),
        Item(decor.floor_lamp, Where.CORNER, 0.9),
        Item(tables.side_table, Where.CORNER, 0.5),
        Item(seating.stool, Where.FREE, 0.5),
        *_FLOOR,
        *_WALLS,
    ),
    "dining": (
        Item(tables.dining_set, Where.CENTER, instead=tables.small_dining_set),
        Item(decor.rug, Where.FLAT, 0.5),
        Item(storage.sideboard, Where.WALL, 0.9, 1, 0.06),
        Item(storage.bookshelf, Where.WALL, 0.5),
        Item(leisure.piano, Where.WALL, 0.25),
        Item(seating.armchair, Where.FREE, 0.4),
        Item(decor.floor_lamp, Where.CORNER, 0.5),
        *_FLOOR,
        *_WALLS,
    ),
    "kitchen": (
        Item(kitchen.counter, Where.CORNER, instead=kitchen.short_counter),
        Item(kitchen.fridge, Where.CORNER),
        Item(kitchen.low_counter, Where.WALL, 0.7, 1, 0.05),
        Item(kitchen.island, Where.CENTER, 0.4, instead=tables.small_dining_set),
        Item(tables.wall_table, Where.WALL, 0.8),
        Item(storage.sideboard, Where.WALL, 0.5),
        Item(storage.bookshelf, Where.WALL, 0.3),
        Item(decor.plant, Where.CORNER, 0.4),
        Item(decor.clutter, Where.FREE, 0.6, 1, 0.05),
        Item(decor.picture, Where.HUNG, 0.5),
    ),
    "bedroom": (
        Item(sleeping.double_bed, Where.WALL, instead=sleeping.single_bed),
        Item(storage.wardrobe, Where.CORNER, 0.9, 1, 0.06),
        Item(storage.dresser, Where.WALL, 0.8),
        Item(storage.bookshelf, Where.WALL, 0.4),
        Item(decor.folding_screen, Where.FREE, 0.3),
        Item(decor.rug, Where.FLAT, 0.7),
        Item(tables.desk, Where.WALL, 0.4),
        Item(seating.armchair, Where.FREE, 0.5),
        Item(decor.floor_lamp, Where.CORNER, 0.4),
        *_FLOOR,
        *_WALLS,
    ),
    "kids": (
        Item(sleeping.bunk_bed, Where.CORNER, 0.5, instead=sleeping.single_bed),
        Item(sleeping.single_bed, Where.CORNER, 0.5, instead=sleeping.crib),
        Item(tables.desk, Where.WALL, 0.7),
        Item(storage.toy_shelf, Where.WALL, 0.9),
        Item(storage.wardrobe, Where.CORNER, 0.8),
        Item(sleeping.crib, Where.WALL, 0.25),
        Item(leisure.tent, Where.FREE, 0.5),
        Item(seating.bean_bag, Where.FREE, 0.7),
        Item(decor.rug, Where.FLAT, 0.8),
        Item(decor.toys, Where.FREE, 0.8, 2),
        *_FLOOR,
        *_WALLS,
    ),
    "office": (
        Item(tables.desk, Where.WALL, 1.0, 1, 0.04),
        Item(storage.bookshelf, Where.WALL, 0.9, 1, 0.05),
        Item(storage.sideboard, Where.WALL, 0.4),
        Item(seating.armchair, Where.FREE, 0.6),
        Item(storage.divider, Where.CENTER, 0.3),
        Item(tables.wall_table, Where.WALL, 0.3),
        Item(decor.floor_lamp, Where.CORNER, 0.5),
        Item(decor.rug, Where.FLAT, 0.4),
        *_FLOOR,
        *_WALLS,
    ),
    "library": (
        Item(storage.divider, Where.CENTER, 0.7, 1, 0.04),
        Item(storage.bookshelf, Where.WALL, 0.9, 2, 0.1),
        Item(tables.desk, Where.WALL, 0.3),
        Item(seating.armchair, Where.FREE, 0.9, 2),
        Item(tables.coffee_table, Where.CENTER, 0.6),
        Item(leisure.piano, Where.WALL, 0.3),
        Item(decor.floor_lamp, Where.CORNER, 0.9),
        Item(tables.side_table, Where.WALL, 0.6),
        Item(decor.rug, Where.FLAT),
        *_FLOOR,
        *_WALLS,
    ),
    "gym": (
        Item(leisure.treadmill, Where.WALL, 0.9, 1, 0.05),
        Item(leisure.weights, Where.WALL, 0.9),
        Item(leisure.exercise_ball, Where.FREE, 0.8),
        Item(leisure.mat, Where.FLAT, 0.9),
        Item(seating.bench, Where.WALL, 0.7),
        Item(decor.column, Where.FREE, 0.3),
        Item(storage.wardrobe, Where.CORNER, 0.4),
        Item(storage.rack, Where.CORNER, 0.5),
        *_FLOOR,
        *_WALLS,
    ),
    "bathroom": (
        Item(bath.bathtub, Where.CORNER, 0.7, instead=bath.shower),
        Item(bath.toilet, Where.WALL),
        Item(bath.washbasin, Where.WALL),
        Item(bath.shower, Where.CORNER, 0.4),
        Item(bath.towel_rail, Where.WALL, 0.6),
        Item(bath.washing_machine, Where.CORNER, 0.3),
        Item(decor.plant, Where.CORNER, 0.3),
        Item(decor.clutter, Where.FREE, 0.4),
    ),
    "laundry": (
        Item(bath.washing_machine, Where.CORNER, 1.0, 2),
        Item(storage.rack, Where.WALL, 0.8),
        Item(bath.drying_rack, Where.FREE, 0.7),
        Item(bath.washbasin, Where.WALL, 0.5),
        Item(decor.clutter, Where.FREE, 0.7, 2),
    ),
    "storage": (
        Item(storage.rack, Where.WALL, 0.9, 1, 0.2),
        Item(storage.wardrobe, Where.CORNER, 0.4),
        Item(decor.clutter, Where.FREE, 0.8, 2),
    ),
    "corridor": (
        Item(decor.runner, Where.FLAT, 0.7),
        Item(storage.coat_rack, Where.WALL, 0.6, 1, 0.04),
        Item(storage.shoe_cabinet, Where.WALL, 0.6, 1, 0.05),
        Item(tables.console, Where.WALL, 0.5, 1, 0.06),
        Item(seating.bench, Where.WALL, 0.3, 1, 0.05),
        Item(decor.plant, Where.CORNER, 0.5, 1, 0.06),
        Item(decor.picture, Where.HUNG, 0.8, 2, 0.1),
    ),
}
"""Furniture of each kind of room, the most important first."""
