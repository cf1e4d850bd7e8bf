"""Colours of homes: floors, paints and materials, as RGB triples of 0..255."""

from dataclasses import dataclass

import numpy as np

RGB = tuple[int, int, int]

WHITE: RGB = (242, 241, 236)
PAPER: RGB = (232, 228, 216)
GLASS: RGB = (176, 208, 226)
MIRROR: RGB = (200, 218, 226)
STEEL: RGB = (168, 172, 176)
IRON: RGB = (70, 72, 76)
BLACK: RGB = (34, 35, 38)
CERAMIC: RGB = (246, 247, 247)
WATER: RGB = (186, 216, 224)
LIGHT: RGB = (255, 244, 214)
BRASS: RGB = (186, 150, 86)
TERRACOTTA: RGB = (184, 104, 72)
SOIL: RGB = (74, 56, 44)
STONE: RGB = (150, 148, 142)

WOODS: tuple[RGB, ...] = ((196, 156, 108), (150, 106, 66), (110, 74, 48), (214, 188, 148), (168, 124, 84))
FABRICS: tuple[RGB, ...] = (
    (94, 118, 140),
    (146, 92, 84),
    (112, 130, 104),
    (176, 146, 104),
    (120, 110, 128),
    (72, 88, 104),
    (190, 132, 98),
    (150, 154, 156),
)
LINENS: tuple[RGB, ...] = (
    (226, 222, 212),
    (204, 214, 224),
    (224, 206, 200),
    (206, 216, 200),
    (230, 214, 176),
)
BRIGHTS: tuple[RGB, ...] = (
    (206, 72, 62),
    (232, 172, 58),
    (70, 130, 168),
    (92, 156, 106),
    (156, 98, 158),
    (228, 124, 70),
    (60, 78, 112),
)
LEAVES: tuple[RGB, ...] = ((74, 124, 66), (98, 146, 78), (58, 104, 72))

_WOOD_FLOORS: tuple[RGB, ...] = ((186, 148, 106), (160, 118, 80), (204, 172, 132), (138, 100, 70))
_TILE_FLOORS: tuple[RGB, ...] = ((188, 192, 192), (206, 198, 184), (150, 160, 164), (176, 164, 150))
_CARPETS: tuple[RGB, ...] = ((172, 160, 150), (150, 160, 168), (178, 168, 142))
_WARM_PAINTS: tuple[RGB, ...] = ((236, 226, 206), (230, 214, 196), (224, 222, 208), (222, 206, 178))
_COOL_PAINTS: tuple[RGB, ...] = ((208, 220, 226), (206, 220, 208), (214, 210, 224), (226, 228, 228))
_TILES: tuple[RGB, ...] = ((214, 230, 232), (232, 236, 234), (196, 218, 212), (222, 216, 226))
_PLAYFUL: tuple[RGB, ...] = ((246, 226, 168), (196, 222, 236), (240, 206, 206), (206, 230, 196))


@dataclass(frozen=True)
class RoomColors:
    """The colours of one room."""

    floor: RGB
    """Floor."""
    wall: RGB
    """Paint of the walls."""
    ceiling: RGB
    """Ceiling."""
    wood: RGB
    """Most of the furniture's wood."""
    fabric: RGB
    """Sofas, chairs, curtains."""
    linen: RGB
    """Sheets and towels."""
    accent: RGB
    """Cushions, lamps, small things."""


def draw_colors(kind: str, wood: RGB, rng: np.random.Generator) -> RoomColors:
    """Choose the colours of a room by its kind; `wood` is shared by the home."""
    if kind in ("bathroom", "laundry", "kitchen"):
        floor, wall = pick(_TILE_FLOORS, rng), pick(_TILES if kind != "kitchen" else _WARM_PAINTS, rng)
    elif kind in ("kids", "gym"):
        floor, wall = pick(_CARPETS, rng), pick(_PLAYFUL, rng)
    elif kind in ("bedroom", "office", "library"):
        floor, wall = pick(_CARPETS + _WOOD_FLOORS, rng), pick(_COOL_PAINTS, rng)
    else:
        floor, wall = pick(_WOOD_FLOORS, rng), pick(_WARM_PAINTS, rng)
    own_wood = wood if rng.random() < 0.7 else pick(WOODS, rng)
    fabric, linen, accent = pick(FABRICS, rng), pick(LINENS, rng), pick(BRIGHTS, rng)
    return RoomColors(floor, wall, WHITE, own_wood, fabric, linen, accent)


def pick(colors: tuple[RGB, ...], rng: np.random.Generator) -> RGB:
    """Draw one of the colours."""
    return colors[int(rng.integers(len(colors)))]


def shade(color: RGB, factor: float) -> RGB:
    """Darken (factor < 1) or lighten (factor > 1) a colour."""
    red, green, blue = (min(255, max(0, round(channel * factor))) for channel in color)
    return red, green, blue
