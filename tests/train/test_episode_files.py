"""The command that writes a dataset of point-goal episodes."""

import json
from pathlib import Path

import pytest

from anm_gym.envs.episode_files import read_episodes
from train.episode_files import Dataset, main, write_dataset


def test_command_writes_what_it_prints(tmp_path, capsys):
    summary = tmp_path / "no" / "such" / "summary.json"
    out = ["--out", str(tmp_path), "--split", "train", "--json", str(summary)]
    main(["--scenes", "home:studio:1,home:studio:2", "--episodes", "3", *out])
    episodes = list(read_episodes(tmp_path / "train" / "train.json.gz"))
    assert [episode.scene_id for episode in episodes] == ["home:studio:1"] * 3 + ["home:studio:2"] * 3
    content = json.loads(summary.read_text())
    distances = [episode.geodesic_distance_m for episode in episodes[:3]]
    assert content["scenes"]["home:studio:1"] == {
        "episodes": 3,
        "shortest_m": round(min(distances), 3),
        "mean_m": round(sum(distances) / 3, 3),
        "longest_m": round(max(distances), 3),
    }
    assert f"dataset: {content['path']}" in capsys.readouterr().out


def test_mesh_is_named_without_the_folder_of_scenes(room_file, tmp_path):
    dataset = Dataset(
        [room_file.name], 2, out=tmp_path, scenes_dir=room_file.parent, scene_options={"up_axis": "y"}
    )
    write_dataset(dataset)
    assert {episode.scene_id for episode in read_episodes(dataset.path)} == {room_file.name}


def test_scenes_added_at_the_end_leave_the_others_as_they_were(tmp_path):
    short, long = Dataset(["home:studio:1"], 2), Dataset(["home:studio:1", "home:studio:2"], 2)
    assert list(short.draw()) == list(long.draw())[:2]


def test_quick_run_is_short_and_has_the_same_keys(tmp_path):
    contents = []
    for number, count in enumerate((["--quick"], ["--episodes", "5"])):
        summary = tmp_path / f"{number}.json"
        main(["--scenes", "home:studio:1", *count, "--out", str(tmp_path), "--json", str(summary)])
        contents.append(json.loads(summary.read_text()))
    assert [content["scenes"]["home:studio:1"]["episodes"] for content in contents] == [3, 5]
    keys = [(content.keys(), content["scenes"]["home:studio:1"].keys()) for content in contents]
    assert keys[0] == keys[1]


def test_scene_named_twice_is_refused_before_anything_is_drawn(tmp_path):
    with pytest.raises(ValueError, match="`scenes` must name each scene once, got home:studio:1 2 times"):
        main(["--scenes", "home:studio:1,home:studio:2,home:studio:1", "--out", str(tmp_path / "new")])
    assert not list(tmp_path.iterdir())


def test_text_instead_of_a_list_of_scenes_is_refused():
    with pytest.raises(TypeError, match="`scenes` must be a list of names, got 'home:studio:1'"):
        Dataset("home:studio:1")


def test_configuration_file_is_read(tmp_path):
    config = tmp_path / "pointnav.yaml"
    config.write_text(f"scenes: [home:studio:1]\nepisodes: 1\nmin_distance_m: 2.0\nout: {tmp_path}\n")
    main(["--config", str(config)])
    (episode,) = read_episodes(tmp_path / "val" / "val.json.gz")
    assert episode.geodesic_distance_m >= 2.0


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"scenes": []}, "`scenes` must name at least one"),
        ({"episodes": 0}, "`episodes` must be >= 1, got 0"),
        ({"split": "../val"}, "`split` must be a plain name, got '../val'"),
        ({"split": ".."}, "`split` must be a plain name, got '..'"),
    ],
)
def test_impossible_datasets_are_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        Dataset(**{"scenes": ["home:studio:1"], "out": Path("nowhere"), **settings})
