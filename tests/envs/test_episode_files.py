"""Habitat's files: a hand-made one, round trips, and what is said of broken ones."""

import gzip
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from anm_gym.envs.episode_files import from_json, read_episodes, to_json, write_episodes
from anm_gym.envs.pointnav import PointNavEnv
from anm_gym.envs.pointnav_episodes import PointNavEpisode, draw_episodes, reset_options
from anm_gym.errors import EpisodeError

RECORD: dict[str, Any] = {
    "episode_id": "12",
    "scene_id": "data/scene_datasets/gibson/Cantwell.glb",
    "start_position": [-2.9, 0.107, 7.25],
    "start_rotation": [0, 0.6, 0, 0.8],
    "info": {"geodesic_distance": 6.45, "difficulty": "easy"},
    "goals": [{"position": [1.5, 0.107, 4.75], "radius": None}],
    "shortest_paths": None,
    "start_room": None,
}
"""One episode as the files of Gibson spell it."""


def write(file: Path, content: Any) -> Path:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(gzip.compress(json.dumps(content).encode()))
    return file


def split_of(tmp_path: Path, *records: Any) -> Path:
    return write(tmp_path / "val.json.gz", {"episodes": list(records)})


def drawn(*scenes: str, count: int = 2) -> list[PointNavEpisode]:
    rng = np.random.default_rng(3)
    return [episode for scene in scenes for episode in draw_episodes(scene, count, rng)]


def test_habitat_file_is_understood(tmp_path: Path) -> None:
    write(tmp_path / "content" / "Cantwell.json.gz", {"episodes": [RECORD]})
    split = write(
        tmp_path / "val.json.gz",
        {"episodes": [], "content_scenes_path": "{data_path}/content/{scene}.json.gz"},
    )
    (episode,) = read_episodes(split)
    assert episode == PointNavEpisode(
        episode_id="12",
        scene_id="gibson/Cantwell.glb",
        start_position=(-2.9, 0.107, 7.25),
        start_rotation=(0.0, 0.6, 0.0, 0.8),
        goal_position=(1.5, 0.107, 4.75),
        info={"geodesic_distance": 6.45, "difficulty": "easy"},
        others={"start_room": None},
    )
    assert episode.start == pytest.approx((-2.9, 7.25, 2.0 * np.arctan2(0.6, 0.8)))
    assert episode.goal == (1.5, 4.75)
    assert episode.geodesic_distance_m == 6.45


def test_episode_survives_being_written_and_read() -> None:
    episode = from_json(RECORD, "here")
    assert to_json(episode) == {**RECORD, "scene_id": "gibson/Cantwell.glb"}
    assert from_json(to_json(episode), "here") == episode


def test_unknown_keys_of_the_goal_survive_too() -> None:
    goal = {"position": [1.5, 0.107, 4.75], "radius": 0.2, "room_id": 7, "room_name": "kitchen"}
    episode = from_json({**RECORD, "goals": [goal]}, "here")
    assert episode.goal_others == {"room_id": 7, "room_name": "kitchen"}
    assert to_json(episode)["goals"] == [goal]


def test_file_of_episodes_close_to_walls_plays_through(
    pointnav: Callable[..., PointNavEnv], rooms: str, tmp_path: Path
) -> None:
    (plain,) = draw_episodes(rooms, 1, np.random.default_rng(0), scene_options={"up_axis": "y"})
    ends = [((-3.93, 0.0, 0.31), (3.9, 0.0, -1.88)), ((-0.05, 0.0, 1.0), (2.0, 0.0, 0.0))]
    near = [
        replace(plain, episode_id=str(index), start_position=start, goal_position=goal)
        for index, (start, goal) in enumerate(ends)
    ]
    split, _ = write_episodes(tmp_path / "val.json.gz", near)
    env = pointnav()
    options = list(reset_options(read_episodes(split), scene_options={"up_axis": "y"}))
    for found, episode in zip(options, near, strict=True):
        _, info = env.reset(options=found)
        assert np.linalg.norm(env.simulator.state.position_xz - episode.start[:2]) <= 0.25
        assert np.linalg.norm(env.goal_xz - episode.goal) <= 0.25
        assert np.isfinite(info["distance_to_goal_m"])
        env.step(1)


def test_written_episodes_are_read_back_scene_by_scene(tmp_path: Path) -> None:
    first, second = drawn("home:studio:2"), drawn("home:studio:1")
    split = tmp_path / "val" / "val.json.gz"
    files = write_episodes(split, [first[0], *second, first[1]])
    assert [file.relative_to(tmp_path).as_posix() for file in files] == [
        "val/val.json.gz",
        "val/content/home-studio-2.json.gz",
        "val/content/home-studio-1.json.gz",
    ]
    assert list(read_episodes(split)) == second + first
    assert list(read_episodes(split, scenes=["home-studio-2"])) == first
    assert list(read_episodes(files[1])) == first


def test_written_file_has_habitats_form(tmp_path: Path) -> None:
    split, file = write_episodes(tmp_path / "val.json.gz", drawn("home:studio:1", count=1))
    assert json.loads(gzip.decompress(split.read_bytes())) == {
        "episodes": [],
        "content_scenes_path": "{data_path}/content/{scene}.json.gz",
    }
    (record,) = json.loads(gzip.decompress(file.read_bytes()))["episodes"]
    assert set(record) == set(RECORD) - {"start_room"}
    assert record["episode_id"] == "0"
    assert record["goals"][0]["radius"] == 0.2
    assert record["info"]["geodesic_distance"] >= 1.0


def test_same_episodes_make_the_same_bytes(tmp_path: Path) -> None:
    contents = [
        [
            file.read_bytes()
            for file in write_episodes(tmp_path / name / "val.json.gz", drawn("home:studio:1"))
        ]
        for name in "ab"
    ]
    assert contents[0] == contents[1]


def test_episodes_in_both_places_count_once(tmp_path: Path) -> None:
    write(tmp_path / "content" / "Cantwell.json.gz", {"episodes": [RECORD]})
    assert len(list(read_episodes(split_of(tmp_path, RECORD, RECORD)))) == 1


def test_split_without_files_of_scenes_holds_its_episodes_itself(tmp_path: Path) -> None:
    other = {**RECORD, "scene_id": "gibson/Eudora.glb", "episode_id": 3}
    split = split_of(tmp_path, RECORD, other)
    assert [episode.episode_id for episode in read_episodes(split)] == ["12", "3"]
    assert [episode.episode_id for episode in read_episodes(split, scenes=["Eudora"])] == ["3"]


def test_files_of_other_scenes_are_not_mixed_in(tmp_path: Path) -> None:
    write_episodes(tmp_path / "val.json.gz", drawn("home:studio:1"))
    with pytest.raises(EpisodeError, match=r"must hold no files of other scenes, got home-studio-1.json.gz"):
        write_episodes(tmp_path / "val.json.gz", drawn("home:studio:2"))


def test_scenes_of_one_file_name_are_refused(tmp_path: Path) -> None:
    twins = [from_json({**RECORD, "scene_id": f"{folder}/Cantwell.glb"}, "here") for folder in "ab"]
    with pytest.raises(ValueError, match=r"different file names, got a/Cantwell.glb and b/Cantwell.glb"):
        write_episodes(tmp_path / "val.json.gz", twins)


def test_ids_are_unique_within_a_scene_before_anything_is_written(tmp_path: Path) -> None:
    twice = drawn("home:studio:1") + drawn("home:studio:1")
    with pytest.raises(
        ValueError, match=r"`episode_id` must be unique within home:studio:1, got '0' 2 times"
    ):
        write_episodes(tmp_path / "val" / "val.json.gz", twice)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"start_position": (float("nan"), 0.0, 0.0)},
            r"`start_position` of episode 0 in home:studio:1 must be 3 finite numbers, got \[nan, 0.0, 0.0\]",
        ),
        ({"goal_radius_m": float("inf")}, r"`goals\[0\].radius` of episode 0 in home:studio:1 must be one"),
        ({"others": {"score": float("nan")}}, "episode 0 in home:studio:1 must be made of what JSON can say"),
        ({"info": {"rooms": {1, 2}}}, "episode 0 in home:studio:1 must be made of what JSON can say"),
    ],
)
def test_episode_that_could_not_be_read_back_is_not_written(
    tmp_path: Path, change: dict[str, Any], message: str
) -> None:
    (episode,) = drawn("home:studio:1", count=1)
    with pytest.raises(EpisodeError, match=message):
        write_episodes(tmp_path / "val" / "val.json.gz", [replace(episode, **change)])
    assert not list(tmp_path.iterdir())


def test_single_text_is_no_list_of_scenes(tmp_path: Path) -> None:
    split, *_ = write_episodes(tmp_path / "val.json.gz", drawn("home:studio:1", count=1))
    with pytest.raises(
        TypeError, match=r"`scenes` must be a list of names, got 'Cantwell'; write \['Cantwell'"
    ):
        next(read_episodes(split, scenes="Cantwell"))


def test_other_endings_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"`path` must end in .json.gz, got 'val.json'"):
        write_episodes(tmp_path / "val.json", [])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"start_position": [0, 1]}, r"`start_position` of episode 0 of .*val.json.gz must be 3 finite"),
        ({"start_position": [0, 1, None]}, "`start_position` .* must be 3 finite numbers"),
        ({"start_position": [0, 1, 10**400]}, "`start_position` .* must be 3 finite numbers"),
        ({"start_position": [0, 1, float("nan")]}, "`start_position` .* must be 3 finite numbers"),
        ({"start_position": [0, 1, True]}, "`start_position` .* must be 3 finite numbers"),
        ({"start_rotation": [0, 0, 0]}, "`start_rotation` .* must be 4 finite numbers"),
        ({"start_rotation": [0, 0, 0, 2]}, "`start_rotation` .* must be an upright unit quaternion"),
        ({"start_rotation": [0.6, 0, 0, 0.8]}, "`start_rotation` .* must be an upright unit quaternion"),
        ({"goals": []}, "`goals` .* must be a list of one goal"),
        ({"goals": None}, "`goals` .* must be a list of one goal"),
        ({"goals": [3]}, r"`goals\[0\]` .* must be an object, got 3"),
        ({"goals": [{"radius": 1}]}, r"`goals\[0\].position` .* must be 3 finite numbers, got None"),
        ({"goals": [{"position": [0, 0, 0], "radius": "a"}]}, r"`goals\[0\].radius` .* must be one finite"),
        ({"scene_id": 4}, "`scene_id` .* must be a text, got 4"),
        ({"episode_id": ""}, "`episode_id` .* must be a text, got ''"),
        ({"info": [1]}, "`info` .* must be an object"),
        ({"info": {"geodesic_distance": "far"}}, "`info.geodesic_distance` .* must be one finite number"),
        ({"shortest_paths": 1}, "`shortest_paths` .* must be a list or null, got 1"),
    ],
)
def test_malformed_field_is_named(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    split = split_of(tmp_path, {**RECORD, **change})
    with pytest.raises(EpisodeError, match=message):
        list(read_episodes(split))


@pytest.mark.parametrize("name", ["episode_id", "scene_id", "start_position", "start_rotation", "goals"])
def test_missing_field_is_named(tmp_path: Path, name: str) -> None:
    record = {key: value for key, value in RECORD.items() if key != name}
    with pytest.raises(EpisodeError, match=f"`{name}` of episode 1 of .* must be .*, got None"):
        list(read_episodes(split_of(tmp_path, RECORD, record)))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ([], "val.json.gz must be a JSON object, got list"),
        ({"episodes": {}}, "`episodes` of .*val.json.gz must be a list"),
        ({"episodes": [[]]}, "episode 0 of .*val.json.gz must be a JSON object, got list"),
        ({"episodes": [], "content_scenes_path": "a"}, "`content_scenes_path` of .* must contain {scene}"),
        ({"episodes": [], "content_scenes_path": 3}, "`content_scenes_path` of .* must contain {scene}"),
    ],
)
def test_file_of_something_else_is_refused(tmp_path: Path, content: Any, message: str) -> None:
    split = write(tmp_path / "val.json.gz", content)
    with pytest.raises(EpisodeError, match=message):
        list(read_episodes(split))


def test_every_cut_of_a_file_is_noticed(tmp_path: Path) -> None:
    split = split_of(tmp_path, RECORD)
    whole = split.read_bytes()
    for length in range(0, len(whole), 7):
        split.write_bytes(whole[:length])
        with pytest.raises(EpisodeError, match=r"val.json.gz must be a (whole )?gzip file"):
            list(read_episodes(split))


def test_flipped_bits_are_noticed(tmp_path: Path) -> None:
    split = split_of(tmp_path, RECORD)
    spoiled = bytearray(split.read_bytes())
    spoiled[len(spoiled) // 2] ^= 255
    split.write_bytes(bytes(spoiled))
    with pytest.raises(EpisodeError, match=r"val.json.gz must be"):
        list(read_episodes(split))


def test_missing_file_is_an_error_of_the_episodes(tmp_path: Path) -> None:
    with pytest.raises(EpisodeError, match=r"none.json.gz must be a gzip file of episodes, got none"):
        list(read_episodes(tmp_path / "none.json.gz"))
    write_episodes(tmp_path / "val.json.gz", drawn("home:studio:1", count=1))
    with pytest.raises(EpisodeError, match=r"other.json.gz must be a gzip file of episodes, got none"):
        list(read_episodes(tmp_path / "val.json.gz", scenes=["other"]))
