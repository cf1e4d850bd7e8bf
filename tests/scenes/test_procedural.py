"""Homes as scenes: their sizes, their repeatability, and that every room can be reached and none be left."""

import numpy as np
import pytest
from numpy.typing import NDArray

from anm_gym.scenes.procedural import TIERS, Home, build_home, make_home
from anm_gym.scenes.procedural.tiers import CORRIDOR
from anm_gym.sim.traversable import BodySpec, TraversableGrid

RADIUS_M = 0.18
LEAST_FLOOR_M2 = 0.5


def plan_points(home: Home, points_xz: NDArray[np.float64]) -> NDArray[np.float64]:
    """World points (N, 2), metres, in the plan frame, centimetres; the reverse of `Layout.world_xz`."""
    cos, sin = np.cos(home.layout.yaw_rad), np.sin(home.layout.yaw_rad)
    x, z = points_xz.T
    return 100.0 * np.stack([cos * x - sin * z, sin * x + cos * z], axis=1) + home.layout.center_cm


def floor_in_rooms_m2(home: Home, grid: TraversableGrid) -> list[float]:
    """Area of the largest navigable part in each room, square metres."""
    points = plan_points(home, grid.frame.centers_of(np.argwhere(grid.component == 1)))
    areas = []
    for room in home.layout.rooms:
        inside = [
            (points[:, 0] > r.x0) & (points[:, 0] < r.x1) & (points[:, 1] > r.z0) & (points[:, 1] < r.z1)
            for r in room.rects
        ]
        areas.append(float(np.any(inside, axis=0).sum()) * grid.frame.cell_m**2)
    return areas


def assert_all_reached(tier: str, seed: int) -> None:
    home = build_home(tier, seed)
    grid = TraversableGrid.from_mesh(home.mesh, 0.0, BodySpec(radius_m=RADIUS_M))
    assert min(floor_in_rooms_m2(home, grid)) > LEAST_FLOOR_M2
    assert all(grid.component_at(center) == 1 for center in home.layout.door_centers_xz())


@pytest.mark.parametrize(
    ("tier", "seed"), [("studio", 3), ("flat", 1), ("flat", 7), ("house", 2), ("maze", 4)]
)
def test_every_room_is_reached_by_a_wide_body(tier: str, seed: int) -> None:
    assert_all_reached(tier, seed)


@pytest.mark.slow
@pytest.mark.parametrize("tier", TIERS)
def test_every_room_is_reached_by_a_wide_body_for_fifty_seeds(tier: str) -> None:
    for seed in range(50):
        assert_all_reached(tier, seed)


@pytest.mark.parametrize("tier", TIERS)
def test_same_seed_gives_same_home_bit_for_bit(tier: str) -> None:
    first, second = build_home(tier, 5).mesh, build_home(tier, 5).mesh
    assert first.content_hash == second.content_hash
    assert np.array_equal(first.face_colors, second.face_colors)


def test_other_seed_gives_other_home() -> None:
    assert build_home("studio", 0).mesh.content_hash != build_home("studio", 1).mesh.content_hash


@pytest.mark.parametrize("tier", TIERS)
def test_triangles_stay_within_the_tier(tier: str) -> None:
    fewest, most = TIERS[tier].num_triangles
    assert fewest <= len(build_home(tier, 0).mesh.faces) <= most


def test_scene_knows_its_name_floor_and_ceiling() -> None:
    scene = make_home("flat", 7)
    assert (scene.name, scene.floor_y_m) == ("home:flat:7", 0.0)
    assert scene.mesh.bounds[0, 1] == 0.0
    assert scene.mesh.bounds[1, 1] == scene.ceiling_y_m
    assert scene.mesh.face_colors is not None


def test_storey_reports_the_floor_that_the_default_body_reaches() -> None:
    scene = make_home("studio", 2)
    home = build_home("studio", 2)
    assert 0.25 * home.layout.area_m2 < scene.storey.navigable_area_m2 < home.layout.area_m2


def test_home_lies_around_the_origin() -> None:
    bounds = build_home("house", 3).mesh.bounds[:, [0, 2]]
    assert (bounds[0] < 0.0).all()
    assert (bounds[1] > 0.0).all()


def test_every_room_but_corridors_is_furnished() -> None:
    home = build_home("house", 4)
    furnished = {placement.room for placement in home.placements}
    assert {i for i, room in enumerate(home.layout.rooms) if room.kind != CORRIDOR} <= furnished


def test_bedrooms_have_beds_and_kitchens_counters() -> None:
    home = build_home("house", 4)
    things = {(home.layout.rooms[placement.room].kind, placement.name) for placement in home.placements}
    assert ("kitchen", "counter") in things
    assert {("bedroom", "double_bed"), ("bedroom", "single_bed")} & things


@pytest.mark.parametrize("seed", range(3))
def test_no_ray_from_inside_escapes(seed: int, rng: np.random.Generator) -> None:
    from anm_gym.geometry import CameraSpec
    from anm_gym.sim.backends import make_depth_camera

    home = build_home("flat", seed)
    grid = TraversableGrid.from_mesh(home.mesh, 0.0)
    camera = make_depth_camera(home.mesh, CameraSpec())
    origins = np.array([[x, 1.25, z] for x, z in (grid.sample_position(rng) for _ in range(50))])
    directions = rng.normal(size=(50_000, 3))
    hits = camera.cast(np.repeat(origins, 1000, axis=0).astype(np.float32), directions.astype(np.float32))
    assert np.isfinite(hits.distance).all()


def test_unknown_tier_is_refused() -> None:
    with pytest.raises(ValueError, match=r"unknown tier 'castle'; choose one of: studio, flat, house, maze"):
        make_home("castle", 0)


def test_negative_seed_is_refused() -> None:
    with pytest.raises(ValueError, match=r"`seed` must be >= 0, got -1"):
        make_home("flat", -1)
