"""Solids and furniture: closed surfaces with the volumes and places that they claim."""

import numpy as np
import pytest

from anm_gym.scenes.procedural.furniture import decor
from anm_gym.scenes.procedural.furniture.piece import Maker, Piece, Style
from anm_gym.scenes.procedural.palette import RGB, WOODS, draw_colors, shade
from anm_gym.scenes.procedural.primitives import (
    Solid,
    bar,
    block,
    box,
    cushion,
    cylinder,
    ellipsoid,
    join,
    lathe,
    rounded,
    tube,
    wavy_sheet,
)
from anm_gym.scenes.procedural.recipes import RECIPES, Where
from anm_gym.scenes.procedural.tiers import CORRIDOR, ROOM_TYPES, VOID

RED: RGB = (200, 40, 30)
MAKERS: dict[str, Maker] = {
    maker.__name__: maker
    for recipe in RECIPES.values()
    for item in recipe
    for maker in (item.maker, item.instead)
    if maker is not None
}


def is_closed(solid: Solid) -> bool:
    """Whether every directed edge has its reverse exactly once."""
    edges = np.concatenate([solid.faces[:, pair] for pair in ([0, 1], [1, 2], [2, 0])])
    directed, counts = np.unique(edges, axis=0, return_counts=True)
    return bool((counts == 1).all() and np.array_equal(directed, np.unique(edges[:, ::-1], axis=0)))


def volume_m3(solid: Solid) -> float:
    """Volume inside outward normals."""
    first, second, third = solid.vertices[solid.faces].transpose(1, 0, 2)
    return float(np.einsum("ij,ij->i", first, np.cross(second, third)).sum() / 6.0)


def a_style(rng: np.random.Generator) -> Style:
    return Style(draw_colors("living", WOODS[0], rng), 2.5)


SOLIDS = {
    "box": (box((0, 0, 0), (1, 2, 3), RED), 6.0),
    "block": (block(1.0, 2.0, 0.5, RED), 1.0),
    "rounded": (rounded(2.0, 1.0, 2.0, 0.5, RED, steps=40), 4.0 - (4.0 - np.pi) * 0.25),
    "cylinder": (cylinder(0.5, 2.0, RED, 200), np.pi * 0.5),
    "cone": (cylinder(1.0, 1.0, RED, 200, 0.5), np.pi * 1.75 / 3.0),
    "ring": (lathe([(2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 0.5)], RED, 200), 4.0 * np.pi - 0.5 * np.pi),
    "ellipsoid": (ellipsoid((2.0, 4.0, 1.0), RED, 100, 99), np.pi * 4.0 / 3.0),
    "cushion": (cushion((2.0, 2.0, 2.0), RED, 0.02, 64, 64), 8.0),
    "bar": (bar((0, 0, 0), (0, 0, 2), 0.5, RED, 200), np.pi * 0.5),
    "tube": (tube([(0, 0, 0), (1, 0, 0), (3, 0, 0)], 0.5, RED, 200), np.pi * 0.75),
    "wavy sheet": (wavy_sheet(1.0, 2.0, RED, 3), 0.03),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_solid_is_closed_and_has_its_volume(name: str) -> None:
    solid, volume = SOLIDS[name]
    assert is_closed(solid)
    assert volume_m3(solid) == pytest.approx(volume, rel=0.06 if name == "cushion" else 2e-3)


def test_turning_about_y_brings_the_front_to_the_right() -> None:
    turned = box((0, 0, 0), (0.1, 0.1, 2.0), RED).turned(np.pi / 2)
    np.testing.assert_allclose(turned.high, [2.0, 0.1, 0.0], atol=1e-12)


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_moving_and_turning_keep_the_volume(axis: str) -> None:
    solid = block(1.0, 2.0, 3.0, RED).turned(0.7, axis).moved(1.0, 2.0, 3.0)
    assert volume_m3(solid) == pytest.approx(6.0)


def test_joined_solids_add_up() -> None:
    both = join([block(1.0, 1.0, 1.0, RED), block(1.0, 1.0, 2.0, RED, (5.0, 0.0, 0.0))])
    assert (is_closed(both), volume_m3(both)) == (True, pytest.approx(3.0))


def test_faces_on_the_floor_are_left_out() -> None:
    assert len(block(1.0, 1.0, 1.0, RED).without_faces_on(0.0).faces) == 10


def test_feet_of_slanted_legs_end_on_the_floor() -> None:
    leg = bar((0.3, 0.0, 0.0), (0.0, 0.5, 0.0), 0.05, RED)
    assert leg.low[1] < 0.0
    assert leg.cut_off_below(0.0).low[1] == 0.0


def test_shades_stay_within_a_byte() -> None:
    assert shade((200, 100, 0), 2.0) == (255, 200, 0)


@pytest.mark.parametrize("name", MAKERS)
def test_piece_is_closed_stands_on_the_floor_and_fits_under_the_ceiling(
    name: str, rng: np.random.Generator
) -> None:
    for _ in range(4):
        piece = MAKERS[name](rng, a_style(rng))
        assert all(is_closed(part) for part in piece.parts)
        assert piece.solid.low[1] >= 0.0
        assert piece.solid.high[1] <= 2.5 + 1e-9


@pytest.mark.parametrize("name", MAKERS)
def test_no_part_of_a_piece_is_inside_out(name: str, rng: np.random.Generator) -> None:
    piece = MAKERS[name](rng, a_style(rng))
    assert all(volume_m3(part) > 0.0 for part in piece.parts)


@pytest.mark.parametrize("name", MAKERS)
def test_footprints_cover_what_stands_in_the_way(name: str, rng: np.random.Generator) -> None:
    piece = MAKERS[name](rng, a_style(rng))
    vertices = np.concatenate([part.vertices for part in piece.parts])
    for x, _, z in vertices[(vertices[:, 1] > 0.1) & (vertices[:, 1] < 1.5)]:
        assert any(x0 <= x <= x1 and z0 <= z <= z1 for x0, z0, x1, z1 in piece.footprints)


def test_lamp_over_heads_has_no_footprint(rng: np.random.Generator) -> None:
    assert len(decor.pendant(rng, a_style(rng)).footprints) == 0


def test_rug_and_mat_are_stepped_over(rng: np.random.Generator) -> None:
    flat = [MAKERS[name](rng, a_style(rng)) for name in ("rug", "runner", "mat")]
    assert all(len(piece.footprints) == 0 for piece in flat)


def test_wide_chest_is_low_and_wardrobe_is_tall() -> None:
    low = Piece("chest", (block(1.2, 0.8, 0.5, RED),))
    tall = Piece("wardrobe", (block(1.2, 2.0, 0.5, RED),))
    assert (low.is_tall, tall.is_tall) == (False, True)


def test_every_kind_of_room_has_a_recipe() -> None:
    assert set(RECIPES) == set(ROOM_TYPES) - {VOID} | {CORRIDOR}


@pytest.mark.parametrize("kind", RECIPES)
def test_only_flat_pieces_may_overlap_others(kind: str, rng: np.random.Generator) -> None:
    flat = [item for item in RECIPES[kind] if item.where is Where.FLAT]
    assert all(len(item.maker(rng, a_style(rng)).footprints) == 0 for item in flat)
