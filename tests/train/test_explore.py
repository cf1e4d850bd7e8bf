"""The command that explores one scene, and the replay of what it leaves."""

import json
import re

import numpy as np
import pytest

from train.explore import MAP_FILE, SURFACE_FILE, SURFACE_PICTURE, explore, main, summary
from train.replay import main as replay_main
from train.replay import replay
from train.results import ROW_FIELDS
from train.trajectory import Trajectory

CAMERA = {"camera": {"width_px": 32, "height_px": 32}}


@pytest.fixture(scope="module")
def explored(tmp_path_factory, room_file):
    out = tmp_path_factory.mktemp("explored")
    row = explore(str(room_file), "fbe", steps=12, seed=3, out=out, env=CAMERA)
    return out, row


def test_exploration_leaves_everything_there_is_to_see(explored):
    out, row = explored
    names = {path.name for path in out.iterdir()}
    assert names == {
        *("trajectory.npz", "settings.json", "row.json", "report.html"),
        *("topdown.png", "completion.png", "depth.png", "scene.png"),
    }
    assert row["comp_pct"] > 0.0
    assert row["comp_visible_pct"] == pytest.approx(row["comp_pct"], abs=2.0)


def test_report_is_self_contained(explored):
    text = (explored[0] / "report.html").read_text()
    sources = re.findall(r"""(?:src|href)\s*=\s*["']([^"']*)""", text)
    assert len(sources) == 4
    assert all(source.startswith("data:image/png;base64,") for source in sources)
    assert not re.search(r"https?://", text)


def test_settings_say_how_to_do_it_again(explored):
    settings = json.loads((explored[0] / "settings.json").read_text())
    assert (settings["agent"], settings["preset"], settings["seed"], settings["env"]) == (
        "fbe",
        "strong",
        3,
        CAMERA,
    )
    assert settings["settings"]["FrontierGoalWrapper"]["preset"] == "strong"


def test_summary_lists_what_was_measured_and_no_more(explored):
    headings = [heading for heading, _ in summary(explored[1])]
    assert "Comp. (%)" in headings
    assert "MAD (cm)" not in headings


def test_replay_is_bit_for_bit_the_episode(explored, capsys):
    out, row = explored
    result = replay(Trajectory.load(out / "trajectory.npz"))
    assert result.is_equal
    assert result.comp_pct == row["comp_pct"]
    replay_main(out / "trajectory.npz")
    said = capsys.readouterr().out
    assert "every pose is bit for bit the recorded one" in said
    assert "measures otherwise" not in said


def test_replay_says_that_an_episode_is_scored_otherwise(explored, tmp_path, capsys):
    recorded = Trajectory.load(explored[0] / "trajectory.npz")
    change(recorded, curves={"comp_pct": recorded.curves["comp_pct"] + 5.0}).save(tmp_path / "old.npz")
    replay_main(tmp_path / "old.npz")
    assert "but this version measures otherwise" in capsys.readouterr().out


def test_same_seed_leaves_the_same_trajectory(explored, room_file, tmp_path):
    explore(str(room_file), "fbe", steps=12, seed=3, out=tmp_path, env=CAMERA)
    first, second = (Trajectory.load(folder / "trajectory.npz") for folder in (explored[0], tmp_path))
    assert first.poses.tobytes() == second.poses.tobytes()
    assert first.curves["comp_pct"].tobytes() == second.curves["comp_pct"].tobytes()


def change(trajectory, **changes):
    return Trajectory(
        **{name: getattr(trajectory, name) for name in trajectory.__dataclass_fields__} | changes
    )


def test_tampered_pose_is_found(explored, tmp_path):
    recorded = Trajectory.load(explored[0] / "trajectory.npz")
    poses = recorded.poses.copy()
    poses[5, 0] = np.nextafter(poses[5, 0], 9.0)
    change(recorded, poses=poses).save(tmp_path / "tampered.npz")
    with pytest.raises(ValueError, match="the replayed poses must equal the recorded ones"):
        replay_main(tmp_path / "tampered.npz")


def test_replay_in_another_geometry_is_refused(explored):
    recorded = Trajectory.load(explored[0] / "trajectory.npz")
    with pytest.raises(ValueError, match=r"the geometry of .* must be the recorded one \(0123\)"):
        replay(change(recorded, scene_hash="0123"))


def test_trajectory_without_actions_is_refused():
    with pytest.raises(ValueError, match="`trajectory` must have at least one action, got 0"):
        replay(Trajectory("a", 0, np.zeros(0, np.int8), np.zeros((1, 3))))


@pytest.mark.slow
def test_neural_map_and_its_surface_are_left_as_files(room_file, tmp_path):
    import trimesh

    row = explore(str(room_file), "anm", steps=20, seed=0, out=tmp_path, env=CAMERA)
    surface = trimesh.load_mesh(tmp_path / "reconstruction.ply")
    assert len(surface.faces) > 100
    assert len(np.unique(surface.visual.vertex_colors, axis=0)) > 10
    assert (tmp_path / "map.safetensors").stat().st_size > 10_000
    assert (tmp_path / "reconstruction.png").exists()
    assert 0.0 < row["mad_cm"] < 100.0


def test_agent_without_a_map_leaves_none_of_another_agent(room_file, tmp_path):
    for name in (MAP_FILE, SURFACE_FILE, SURFACE_PICTURE):
        (tmp_path / name).write_bytes(b"of an earlier episode")
    explore(str(room_file), "random", steps=2, out=tmp_path, env=CAMERA)
    assert not {MAP_FILE, SURFACE_FILE, SURFACE_PICTURE} & {path.name for path in tmp_path.iterdir()}


def test_quick_command_leaves_the_folder_of_a_full_one_alone(room_file, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    main(["--scene", str(room_file), "--agent", "random", "--quick", "--steps", "1"])
    assert [path.name for path in (tmp_path / "runs").iterdir()] == [f"explore-{room_file.stem}-quick"]


def test_quick_command_plays_a_few_steps_and_writes_its_row(room_file, tmp_path, capsys):
    out, row = tmp_path / "run", tmp_path / "new" / "row.json"
    main(["--scene", str(room_file), "--agent", "random", "--out", str(out), "--quick", "--json", str(row)])
    written = json.loads(row.read_text())
    assert written["steps"] == 12
    assert {*ROW_FIELDS, "scene_file", "wall_s", "versions"} <= written.keys(), "the row of an evaluation"
    assert written["mad_cm"] is None, "this agent has no map"
    assert "Comp. (%)" in capsys.readouterr().out
    assert json.loads((out / "settings.json").read_text())["env"]["camera"]["width_px"] == 48
    main(["--scene", str(room_file), "--agent", "random", "--out", str(out), "--quick", "--steps", "3"])
    assert json.loads((out / "row.json").read_text())["steps"] == 3
