"""Protocols: the paper's lists, homes nobody trains on, starts that a file defines."""

import json
import shutil

import numpy as np
import pytest
import trimesh

from anm_gym.errors import SceneError
from anm_gym.scenes.datasets import ROOT_VARIABLE
from anm_gym.scenes.procedural.tiers import TIERS
from train.backends import Backend
from train.episodes import Job, make_env, play
from train.protocols import PROTOCOLS, Protocol, ProtocolScene, make_protocol
from train.replay import replay
from train.starts import (
    SceneStarts,
    draw_starts,
    file_name,
    main,
    merged,
    published_file,
    read_starts,
    starts_for,
    write_starts,
)
from train.tables.run import TableRun, play_table
from train.trajectory import Trajectory

TINY = {"camera": {"width_px": 16, "height_px": 16}}


@pytest.fixture
def room(room_file):
    return Protocol("one-room", "one-room", (ProtocolScene(str(room_file), 5),))


def test_paper_protocols_have_the_paper_scenes_and_budgets():
    gibson, mp3d = make_protocol("anm-gibson"), make_protocol("anm-mp3d")
    long = {scene.label for scene in (*gibson.scenes, *mp3d.scenes) if scene.steps == 2000}
    assert len(gibson.scenes) == 9
    assert len(mp3d.scenes) == 5
    assert long == {
        *("gibson:Cantwell", "gibson:Eastville", "gibson:Swormville"),
        *("mp3d:GdvgFV5R1Z5", "mp3d:HxpKQynjfin"),
    }
    assert {scene.steps for scene in gibson.scenes} == {1000, 2000}


def test_open_homes_are_two_of_every_tier():
    tiers = [scene.name.split(":")[1] for scene in make_protocol("open-homes").scenes]
    assert {tier: tiers.count(tier) for tier in TIERS} == dict.fromkeys(TIERS, 2)


def test_open_scenes_are_the_meshes_of_a_folder(tmp_path, room_file):
    for name in ("b/two.ply", "a/one.ply"):
        (tmp_path / name).parent.mkdir()
        shutil.copy(room_file, tmp_path / name)
    (tmp_path / "notes.txt").write_text("no mesh")
    (tmp_path / "._one.ply").write_text("hidden")
    (tmp_path / "folder.obj").mkdir()
    protocol = make_protocol("open-scenes", tmp_path)
    assert [scene.label for scene in protocol.scenes] == ["one", "two"]


def test_protocol_without_scenes_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"`root` must hold meshes .*, got none in"):
        make_protocol("open-scenes", tmp_path)
    with pytest.raises(ValueError, match="`root` of open-scenes must be a folder of meshes, got None"):
        make_protocol("open-scenes")
    with pytest.raises(ValueError, match=f"unknown protocol 'kitti'; choose one of: {', '.join(PROTOCOLS)}"):
        make_protocol("kitti")


def test_scenes_of_one_name_are_refused():
    scenes = (ProtocolScene("a/x.glb", 5), ProtocolScene("b/x.ply", 5))
    with pytest.raises(ValueError, match="`scenes` must have different names in rows and files, got x, x"):
        Protocol("p", "p", scenes)
    alike = (ProtocolScene("room-1.glb", 5), ProtocolScene("room_1.glb", 5))
    with pytest.raises(ValueError, match="different names in rows and files, got room-1, room_1; rename"):
        Protocol("p", "p", alike)
    with pytest.raises(ValueError, match="`steps` must be >= 1, got 0"):
        ProtocolScene("a", 0)


def test_shortened_protocol_has_another_name():
    short = make_protocol("open-homes").shortened(7)
    assert (short.name, short.base) == ("open-homes-7-steps", "open-homes")
    assert {scene.steps for scene in short.scenes} == {7}


def test_part_of_a_protocol_keeps_its_name_and_budgets():
    part = make_protocol("anm-gibson").only(["gibson:Cantwell"])
    assert part.name == "anm-gibson"
    assert part.scenes == (ProtocolScene("gibson:Cantwell", 2000),)
    with pytest.raises(
        ValueError, match="unknown scene 'Paris' of anm-gibson; choose among: gibson:Cantwell"
    ):
        part.only(["Paris"])


def test_missing_scenes_are_all_named_before_anything_runs(tmp_path):
    with pytest.raises(SceneError, match=r"anm-mp3d lacks 5 of 5 scenes: .*gZ6f7yhEvPG\.glb.*HxpKQynjfin"):
        make_protocol("anm-mp3d").require_scenes(tmp_path)
    make_protocol("open-homes").require_scenes()


def test_scenes_that_are_missing_for_one_reason_share_it(monkeypatch):
    monkeypatch.delenv(ROOT_VARIABLE, raising=False)
    with pytest.raises(SceneError) as missing:
        make_protocol("anm-gibson").require_scenes()
    assert str(missing.value).startswith("anm-gibson lacks 9 of 9 scenes: gibson:Denmark, gibson:Elmira, ")
    assert str(missing.value).count("the folder of datasets must be known to find scenes of Gibson") == 1


def test_starts_are_those_that_a_reset_draws(room):
    (scene,) = room.scenes
    drawn = draw_starts(scene, [3])
    env = make_env(scene.name, 5, TINY)
    env.reset(seed=3)
    state = env.get_wrapper_attr("trajectory")[0]
    expected = [*state.position_xz, state.heading_rad]
    np.testing.assert_allclose(drawn.by_seed[3], expected, atol=1e-6)


def test_file_of_starts_reads_back_to_the_same_numbers(tmp_path):
    table = {"a": SceneStarts("g1", {0: (0.1, -2.0 / 3.0, 3.0), 7: (1.0, 2.0, -1.5)})}
    path = write_starts(tmp_path / "sub" / "p.json", "p", table)
    assert read_starts(path) == table
    assert read_starts(tmp_path / "none.json") == {}


@pytest.mark.parametrize("text", ["{", "[]", '{"format": 2, "scenes": {}}', '{"format": 1}'])
def test_other_file_is_no_file_of_starts(tmp_path, text):
    (tmp_path / "p.json").write_text(text)
    with pytest.raises(ValueError, match="must be a file of starts of format 1"):
        read_starts(tmp_path / "p.json")


def test_starts_of_another_geometry_are_refused():
    tables = [{"a": SceneStarts("g1", {0: (0.0, 0.0, 0.0)})}, {"a": SceneStarts("g2", {1: (0.0, 0.0, 0.0)})}]
    with pytest.raises(ValueError, match="the starts of a must belong to one geometry, got g1 and g2"):
        merged(tables)


def test_run_keeps_its_starts_and_draws_only_what_is_missing(tmp_path, room):
    label = room.scenes[0].label
    geometry = draw_starts(room.scenes[0], []).geometry
    write_starts(tmp_path / file_name(), "one-room", {label: SceneStarts(geometry, {0: (0.5, 0.5, 1.0)})})
    starts = starts_for(room, (0, 1), tmp_path)
    assert starts[label].by_seed[0] == (0.5, 0.5, 1.0)
    assert starts[label].by_seed[1] == draw_starts(room.scenes[0], [1]).by_seed[1]
    assert read_starts(tmp_path / file_name()) == starts
    assert set(starts_for(room, (1,), tmp_path)[label].by_seed) == {1}
    assert set(read_starts(tmp_path / file_name())[label].by_seed) == {0, 1}


def test_scene_that_cannot_be_loaded_fails_alone(tmp_path, room):
    broken = tmp_path / "broken.ply"
    broken.write_text("ply")
    both = Protocol("p", "p", (*room.scenes, ProtocolScene(str(broken), 5)))
    starts = starts_for(both, (0,), tmp_path)
    assert list(starts) == [room.scenes[0].label]
    run = TableRun(["random"], both, (0,), tmp_path, TINY, with_pictures=False)
    rows = play_table(run, Backend(workers=0))
    assert [bool(row.get("error")) for row in rows] == [False, True]
    assert "broken.ply" in rows[1]["error"]


def test_another_storey_has_starts_of_its_own(tmp_path, room):
    other = {"scene_options": {"storey": 0}}
    starts_for(room, (0,), tmp_path)
    assert [path.name for path in tmp_path.glob("starts*")] == ["starts.json"]
    starts_for(room, (1,), tmp_path, other | TINY)
    own = tmp_path / file_name(env_options=other)
    assert own.name != "starts.json"
    assert set(read_starts(own)[room.scenes[0].label].by_seed) == {1}
    homes = make_protocol("open-homes")
    assert published_file(homes, other) != published_file(homes)
    assert published_file(homes, {"scene_options": {"root": "/data"}}) == published_file(homes)


def test_starts_of_a_folder_of_meshes_are_not_published(tmp_path, room_file):
    protocol = make_protocol("open-scenes", room_file.parent)
    assert published_file(protocol) is None
    with pytest.raises(ValueError, match="`out` must name a file for open-scenes"):
        main(["open-scenes", "--root", str(room_file.parent), "--seeds", "1"])


def test_published_starts_belong_to_the_homes_of_today():
    protocol = make_protocol("open-homes")
    published = read_starts(published_file(protocol))
    assert list(published) == [scene.label for scene in protocol.scenes]
    assert all(set(starts.by_seed) >= set(range(5)) for starts in published.values())
    scene = protocol.scenes[0]
    drawn = draw_starts(scene, [0])
    assert drawn.geometry == published[scene.label].geometry
    np.testing.assert_allclose(drawn.by_seed[0], published[scene.label].by_seed[0], atol=2e-6)


def test_command_writes_the_starts_of_the_paper_scenes_where_they_are(
    tmp_path, box_room, capsys, monkeypatch
):
    monkeypatch.setenv(ROOT_VARIABLE, "unset")  # taken back after the test, whatever the command sets
    room = box_room(4.0, 3.0)
    x, y, z = room.vertices.T
    mesh = trimesh.Trimesh(np.stack([x, -z, y], axis=1), room.faces, process=False)
    for scene in make_protocol("anm-mp3d").scenes:
        name = scene.name.partition(":")[2]
        (tmp_path / "mp3d" / name).mkdir(parents=True)
        mesh.export(tmp_path / "mp3d" / name / f"{name}.glb")
    out = tmp_path / "starts.json"
    main(["anm-mp3d", "--root", str(tmp_path), "--seeds", "2", "--out", str(out)])
    assert "mp3d:HxpKQynjfin: 2000 steps, 2 starts" in capsys.readouterr().out
    first = json.loads(out.read_text())
    assert len(first["scenes"]) == 5
    main(["anm-mp3d", "--root", str(tmp_path), "--seeds", "3", "--out", str(out)])
    second = json.loads(out.read_text())
    kept = second["scenes"]["mp3d:HxpKQynjfin"]["starts"]
    assert len(kept) == 3
    assert kept.items() >= first["scenes"]["mp3d:HxpKQynjfin"]["starts"].items()


def test_command_refuses_a_file_that_is_none_of_starts_before_it_draws(tmp_path, room_file, monkeypatch):
    def never(*_arguments):
        pytest.fail("starts were drawn")

    monkeypatch.setattr("train.starts.draw_starts", never)
    out = tmp_path / "starts.json"
    out.write_text("{")
    with pytest.raises(ValueError, match="must be a file of starts of format 1"):
        main(["open-scenes", "--root", str(room_file.parent), "--seeds", "2", "--out", str(out)])


def test_episode_begins_at_its_start_and_replays_from_there(tmp_path, room):
    job = Job(
        "random", "", room.scenes[0].name, 0, 5, tmp_path, TINY, conditions="one-room", start=(0.5, -0.5, 1.0)
    )
    row = play(job)
    assert row.get("error") is None
    assert row["start"] == [0.5, -0.5, 1.0]
    assert row["protocol"].startswith("one-room-")
    trajectory = Trajectory.load(tmp_path / row["trajectory"])
    assert trajectory.env_options["start"] == [0.5, -0.5, 1.0]
    assert replay(trajectory).is_equal


def test_episode_in_another_geometry_than_its_start_fails_by_name(tmp_path, room):
    job = Job("random", "", room.scenes[0].name, 0, 5, tmp_path, TINY, geometry="0123456789abcdef")
    assert "must be 0123456789abcdef, to which the starts belong" in play(job)["error"]
