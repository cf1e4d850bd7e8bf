"""Point-goal episodes: headings and quaternions, storeys, draws, and playing them."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from anm_gym.envs.goals import GoalRange
from anm_gym.envs.pointnav import PointNavEnv
from anm_gym.envs.pointnav_episodes import (
    PointNavEpisode,
    draw_episodes,
    heading_of_rotation,
    is_upright,
    reset_options,
    rotation_of_heading,
    scene_name,
    storey_of,
)
from anm_gym.errors import EpisodeError
from anm_gym.mesh import TriangleMesh
from anm_gym.scenes.load import load_scene

Y_UP = {"up_axis": "y"}
ROOT_HALF = float(np.sqrt(0.5))


@pytest.fixture(scope="module")
def two_storeys(
    box_room: Callable[..., TriangleMesh],
    write_mesh: Callable[[TriangleMesh, Path], str],
    tmp_path_factory: pytest.TempPathFactory,
) -> str:
    """Give the file of two equal rooms, one 3 m above the other; without a choice the lower is played."""
    lower, upper = box_room(4.4, 4.4), box_room(4.0, 4.0)
    vertices = np.concatenate([lower.vertices, upper.vertices + np.array([0.0, 3.0, 0.0])])
    faces = np.concatenate([lower.faces, upper.faces + len(lower.vertices)]).astype(np.int32)
    return write_mesh(TriangleMesh(vertices, faces), tmp_path_factory.mktemp("house") / "house.ply")


def episode(start_y_m: float, goal_y_m: float, scene_id: str = "house.ply") -> PointNavEpisode:
    return PointNavEpisode("7", scene_id, (0.5, start_y_m, 1.0), (0.0, 0.0, 0.0, 1.0), (-1.0, goal_y_m, 0.0))


def options_of(found: PointNavEpisode, folder: str | Path = ".", **settings):
    return list(reset_options([found], scenes_dir=folder, scene_options=Y_UP, **settings))


@pytest.mark.parametrize(
    ("rotation", "heading_rad"),
    [
        ((0.0, 0.0, 0.0, 1.0), 0.0),
        ((0.0, ROOT_HALF, 0.0, ROOT_HALF), np.pi / 2),
        ((0.0, -ROOT_HALF, 0.0, ROOT_HALF), -np.pi / 2),
        ((0.0, 1.0, 0.0, 0.0), np.pi),
        ((0.0, 0.0, 0.0, -1.0), 0.0),
    ],
)
def test_quaternion_about_the_up_axis_is_a_heading(rotation, heading_rad) -> None:
    found = heading_of_rotation(rotation)
    assert np.cos(found - heading_rad) == pytest.approx(1.0)
    again = np.array(rotation_of_heading(found))
    assert abs(again @ rotation) == pytest.approx(1.0)


def test_leaning_or_stretched_quaternions_are_not_upright() -> None:
    assert is_upright((0.0, 0.6, 0.0, 0.8))
    assert not is_upright((0.0, 0.6, 0.0, 0.9))
    assert not is_upright((0.1, 0.0, 0.0, float(np.sqrt(0.99))))


def test_procedural_names_do_not_lie_in_the_folder_of_scenes() -> None:
    assert scene_name("home:flat:3", "data") == "home:flat:3"
    assert scene_name("gibson/Cantwell.glb", "data") == str(Path("data/gibson/Cantwell.glb"))


def test_drawn_episode_plays_as_it_says(pointnav: Callable[..., PointNavEnv], rooms: str) -> None:
    folder, name = Path(rooms).parent, Path(rooms).name
    drawn = list(draw_episodes(name, 3, np.random.default_rng(5), scenes_dir=folder, scene_options=Y_UP))
    env = pointnav()
    for found, options in zip(
        drawn, reset_options(drawn, scenes_dir=folder, scene_options=Y_UP), strict=True
    ):
        _, info = env.reset(options=options)
        x, y, z = found.start_position
        assert env.simulator.state.position_xz.tolist() == [x, z]
        assert y == env.scene.floor_y_m
        assert np.cos(env.simulator.state.heading_rad - found.start[2]) == pytest.approx(1.0)
        assert env.goal_xz.tolist() == list(found.goal)
        assert info["distance_to_goal_m"] == found.geodesic_distance_m


def test_draws_keep_to_their_range_and_follow_the_generator() -> None:
    limits = GoalRange(2.0, 4.0)

    def draw(seed: int) -> list[PointNavEpisode]:
        return list(draw_episodes("home:studio:0", 6, np.random.default_rng(seed), limits=limits))

    first = draw(1)
    assert first == draw(1)
    assert first != draw(2)
    assert [found.episode_id for found in first] == list("012345")
    assert all(2.0 <= found.geodesic_distance_m <= 4.0 for found in first)


def test_scene_without_room_for_a_goal_is_refused(rooms: str) -> None:
    draws = draw_episodes(
        rooms, 1, np.random.default_rng(0), limits=GoalRange(50.0, 60.0), scene_options=Y_UP
    )
    with pytest.raises(EpisodeError, match=r"a goal must lie 50.0 to 60.0 m from the start"):
        next(draws)


def test_episode_upstairs_is_refused_with_the_storey_to_ask_for(two_storeys: str) -> None:
    folder = Path(two_storeys).parent
    with pytest.raises(EpisodeError, match=r"must be on storey 0, got y = 3.10, which is storey 1; pass"):
        options_of(episode(3.1, 3.0), folder)


def test_episode_upstairs_can_be_skipped_or_played_there(two_storeys: str) -> None:
    folder, upstairs = Path(two_storeys).parent, {**Y_UP, "storey": 1}
    assert options_of(episode(3.1, 3.0), folder, skip_other_storeys=True) == []
    (options,) = reset_options([episode(3.1, 3.0)], scenes_dir=folder, scene_options=upstairs)
    env = PointNavEnv(two_storeys, scene_options=upstairs, camera={"width_px": 8, "height_px": 8})
    env.reset(options=options)
    assert env.scene.floor_y_m == pytest.approx(3.0)
    assert env.simulator.world_from_camera[:3, 3].tolist() == pytest.approx([0.5, 4.25, 1.0])


def test_episodes_between_storeys_are_skipped_with_those_of_others(two_storeys: str) -> None:
    def kept(*heights_m: tuple[float, float]) -> int:
        episodes = [episode(*pair) for pair in heights_m]
        found = reset_options(
            episodes, scenes_dir=Path(two_storeys).parent, scene_options=Y_UP, skip_other_storeys=True
        )
        return len(list(found))

    assert kept((0.0, 0.0), (1.5, 0.0), (0.0, 3.0), (3.0, 3.0), (0.0, 0.0)) == 2
    with pytest.raises(EpisodeError, match="check the mesh's `up_axis` and `unit`"):
        kept((1.5, 1.5), (1.4, 1.4))


def test_heights_between_or_across_floors_are_refused(two_storeys: str) -> None:
    scene = load_scene(two_storeys, up_axis="y")
    assert storey_of(episode(0.2, -0.1), scene).index == 0
    with pytest.raises(EpisodeError, match=r"`start_position` of episode 7 in house must be within 0.5 m"):
        storey_of(episode(1.5, 0.0), scene)
    with pytest.raises(EpisodeError, match=r"`goals\[0\].position`.*on the start's storey 0.*storey 1"):
        storey_of(episode(0.0, 3.0), scene)


@pytest.mark.parametrize(
    ("position_xz", "expected_xz"),
    [
        ((1.013, 0.521), (1.013, 0.521)),
        ((3.93, 1.013), (3.875, 1.025)),
        ((-3.95, -1.95), (-3.825, -1.825)),
        ((4.02, 0.013), (3.875, 0.025)),
        ((4.07, 0.013), (4.07, 0.013)),
        ((4.2, 0.0), (4.2, 0.0)),
        ((9.0, 9.0), (9.0, 9.0)),
    ],
)
def test_ends_near_walls_are_moved_where_the_body_fits(
    rooms: str, position_xz: tuple[float, float], expected_xz: tuple[float, float]
) -> None:
    (x, z), plain = position_xz, episode(0.0, 0.0, rooms)
    at_start, at_goal = (
        replace(plain, start_position=(x, 0.0, z)),
        replace(plain, goal_position=(x, 0.0, z)),
    )
    (moved,) = options_of(at_start)
    assert moved["start"] == pytest.approx((*expected_xz, 0.0))
    assert moved["goal"] == plain.goal
    (moved,) = options_of(at_goal)
    assert moved["start"] == plain.start
    assert moved["goal"] == pytest.approx(expected_xz)


@pytest.mark.parametrize("name", ["start_position", "goal_position"])
def test_end_far_from_the_floor_is_refused_when_it_is_played(
    pointnav: Callable[..., PointNavEnv], rooms: str, name: str
) -> None:
    far: dict[str, Any] = {name: (4.3, 0.0, 0.0)}
    (options,) = options_of(replace(episode(0.0, 0.0, rooms), **far))
    word = name.removesuffix("_position")
    with pytest.raises(EpisodeError, match=f"`{word}` must be on the largest.*; the nearest of it is"):
        pointnav().reset(options=options)


def test_place_by_hand_is_not_moved(pointnav: Callable[..., PointNavEnv], rooms: str) -> None:
    near_wall = replace(episode(0.0, 0.0, rooms), goal_position=(3.93, 0.0, 1.0))
    with pytest.raises(EpisodeError, match="`goal` must be on the largest"):
        pointnav().reset(options={"goal": near_wall.goal})


def test_radius_and_paths_do_not_change_what_is_played(rooms: str) -> None:
    plain = episode(0.0, 0.0, rooms)
    dressed = replace(plain, goal_radius_m=0.2, shortest_paths=[[]], info={"geodesic_distance": 4.0})
    assert options_of(plain) == options_of(dressed)
    assert (plain.geodesic_distance_m, dressed.geodesic_distance_m) == (None, 4.0)
