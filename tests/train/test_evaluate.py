"""Evaluation: what is run, what is not run again, what is written."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import pytest

from train.backends import Backend
from train.episodes import Job
from train.evaluate import Evaluation, evaluate, main
from train.play import ROWS_FILE, play_missing
from train.provenance import file_digest
from train.results import append_row, read_rows

ROOT = Path(__file__).parents[2]
HERE = Backend(workers=0)
TINY_CAMERA = '{"camera": {"width_px": 32, "height_px": 32}}'


@pytest.fixture
def played():
    return []


@pytest.fixture
def play(played):
    """Stands in for an episode; the row tells its job only."""

    def fake(job):
        played.append(job.key)
        return job.identity | {"settings_hash": "h", "comp_pct": 10.0 * job.seed, "wall_s": 0.0}

    return fake


def make_evaluation(tmp_path, **changes):
    return Evaluation(
        **{"agents": ["random", "fbe"], "scenes": ["a.glb", "home:flat:1"], "out": tmp_path} | changes
    )


def test_every_combination_is_run_once(tmp_path, play, played):
    rows = evaluate(make_evaluation(tmp_path), backend=HERE, play=play)
    assert len(set(played)) == len(played) == len(rows) == 12
    assert {row["scene"] for row in rows} == {"a", "home:flat:1"}


def test_scenes_are_run_one_after_the_other(tmp_path, play, played):
    evaluate(make_evaluation(tmp_path), backend=HERE, play=play)
    scenes = [key[2] for key in played]
    assert scenes == sorted(scenes)


def test_episodes_with_a_row_are_not_run_again(tmp_path, play, played):
    first = evaluate(make_evaluation(tmp_path, seeds=(0, 1)), backend=HERE, play=play)
    played.clear()
    rows = evaluate(make_evaluation(tmp_path, seeds=(0, 1, 2)), backend=HERE, play=play)
    assert {key[3] for key in played} == {2}
    assert [row for row in rows if row["seed"] < 2] == first


def test_another_budget_or_camera_is_another_episode_with_files_of_its_own(tmp_path, play, played):
    changes = ({}, {"steps": 5}, {"env_options": {"camera": {"width_px": 64}}})
    evaluations = [make_evaluation(tmp_path, **changed) for changed in changes]
    for evaluation in evaluations:
        evaluate(evaluation, backend=HERE, play=play)
    assert len(set(played)) == 36
    assert len({job.name for evaluation in evaluations for job in evaluation.jobs()}) == 36


def test_torn_row_and_failed_episode_are_run_again(tmp_path, play, played):
    evaluation = make_evaluation(tmp_path, agents=["random"], scenes=["a.glb"])
    good, bad, torn = evaluation.jobs()
    append_row(tmp_path / ROWS_FILE, good.identity | {"settings_hash": "h", "comp_pct": 1.0})
    append_row(tmp_path / ROWS_FILE, bad.identity | {"error": "MapError: no"})
    with (tmp_path / ROWS_FILE).open("a") as file:
        file.write(json.dumps(torn.identity)[:-3])
    rows = evaluate(evaluation, backend=HERE, play=play)
    assert played == [bad.key, torn.key]
    assert [row["comp_pct"] for row in rows] == [1.0, 10.0, 20.0]


def test_map_that_was_left_out_is_scored_when_it_is_asked_for(tmp_path, play, played):
    evaluation = make_evaluation(tmp_path, agents=["random"], scenes=["a.glb"], with_maps=False)
    with_map, without = evaluation.jobs()[:2]
    append_row(
        tmp_path / ROWS_FILE,
        with_map.identity | {"settings_hash": "h", "comp_pct": 1.0, "map_left_out": True},
    )
    append_row(
        tmp_path / ROWS_FILE,
        without.identity | {"settings_hash": "h", "comp_pct": 2.0, "map_left_out": False},
    )
    evaluate(replace(evaluation, seeds=(0, 1)), backend=HERE, play=play)
    assert played == []
    evaluate(replace(evaluation, seeds=(0, 1), with_maps=True), backend=HERE, play=play)
    assert played == [with_map.key]


def test_scoring_that_fails_is_reported_and_loses_no_row(tmp_path, play):
    evaluation = make_evaluation(tmp_path, agents=["random"], scenes=["a.glb"], seeds=(0,), with_maps=False)
    (job,) = evaluation.jobs()
    append_row(tmp_path / ROWS_FILE, job.identity | {"comp_pct": 1.0, "map_left_out": True})
    (failed,) = evaluate(
        replace(evaluation, with_maps=True),
        backend=HERE,
        play=lambda job: job.identity | {"error": "MapError"},
    )
    assert failed["error"] == "MapError"
    (kept,) = evaluate(evaluation, backend=HERE, play=play)
    assert kept["comp_pct"] == 1.0


@pytest.mark.slow
def test_killed_run_goes_on_where_it_was(tmp_path):
    """The process group dies by SIGKILL in the middle; the second run adds exactly what is missing."""
    script = tmp_path / "run.py"
    script.write_text(
        "import sys, time\n"
        "from pathlib import Path\n"
        "from train.backends import Backend\n"
        "from train.evaluate import Evaluation, evaluate\n"
        "def play(job):\n"
        "    time.sleep(0.4)\n"
        "    return job.identity | {'comp_pct': 1.0, 'run': sys.argv[1]}\n"
        f"run = Evaluation(['random'], ['home:flat:1'], tuple(range(6)), 9, Path({str(tmp_path)!r}))\n"
        "if __name__ == '__main__':\n"
        "    evaluate(run, backend=Backend(workers=1), play=play)\n"
    )
    command = [sys.executable, str(script)]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    first = subprocess.Popen(
        [*command, "1"], env=environment, start_new_session=True, stderr=subprocess.DEVNULL
    )
    _wait_for_rows(tmp_path / ROWS_FILE, 2)
    os.killpg(first.pid, signal.SIGKILL)
    first.wait()
    before = read_rows(tmp_path / ROWS_FILE)
    subprocess.run([*command, "2"], env=environment, check=True, stderr=subprocess.DEVNULL)
    after = read_rows(tmp_path / ROWS_FILE)
    assert after[: len(before)] == before
    assert 2 <= len(before) < 6
    assert sorted(row["seed"] for row in after) == [0, 1, 2, 3, 4, 5]
    assert [row["run"] for row in after] == ["1"] * len(before) + ["2"] * (6 - len(before))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"agents": []}, "`agents`, `scenes` and `seeds` must each name at least one"),
        ({"steps": 0}, "`steps` must be >= 1, got 0"),
        (
            {"scenes": ["x/a.glb", "y/a.ply"]},
            "`scenes` must have different names in rows and files, got a, a",
        ),
        ({"agents": ["fbe", "fbe"]}, "`agents` must differ"),
    ],
)
def test_wrong_evaluation_is_refused(tmp_path, changes, message):
    with pytest.raises(ValueError, match=message):
        make_evaluation(tmp_path, **changes)


def run_tiny(room_file, out, *options):
    scene = ["--scenes", str(room_file), "--steps", "8", "--seeds", "2", "--env", TINY_CAMERA]
    main([*scene, "--agents", "random,fbe", "--out", str(out), *options])


def test_quick_command_has_the_keys_of_a_full_one(tmp_path, room_file):
    found = []
    for number, options in enumerate([["--quick"], ["--steps", "8", "--env", TINY_CAMERA]]):
        out, table = tmp_path / f"run{number}", tmp_path / f"{number}.json"
        where = ["--scenes", str(room_file), "--out", str(out), "--json", str(table)]
        main([*options, *where, "--agents", "random", "--seeds", "1", "--workers", "0"])
        found.append(json.loads(table.read_text()))
    (quick,), (full,) = (table["agents"] for table in found)
    assert (found[0].keys(), quick.keys()) == (found[1].keys(), full.keys())
    row = read_rows(tmp_path / "run0" / ROWS_FILE)[0]
    assert row["steps"] == 12
    assert row["curve"]["step"] == [0.0, 12.0]
    assert row["curve"]["comp_pct"][-1] == pytest.approx(row["comp_pct"], abs=0.01)
    assert row["curve"]["path_m"][-1] == pytest.approx(row["path_m"], abs=0.001)


def test_command_writes_rows_table_and_a_self_contained_report(tmp_path, room_file, capsys):
    run_tiny(room_file, tmp_path / "run", "--workers", "0", "--json", str(tmp_path / "table.json"))
    rows = read_rows(tmp_path / "run" / ROWS_FILE)
    assert len(rows) == 4
    assert not any(row.get("error") for row in rows)
    assert all(row["auroc_seen"] is None and row["reliability"] is None for row in rows)
    assert json.loads((tmp_path / "table.json").read_text())["agents"][0]["episodes"] == 2
    assert "fbe:strong" in capsys.readouterr().out
    report = (tmp_path / "run" / "report.html").read_text()
    sources = re.findall(r"""(?:src|href)\s*=\s*["']([^"']*)""", report)
    assert len(sources) == 5
    assert all(source.startswith("data:image/png;base64,") for source in sources)
    assert not re.search(r"https?://", report)


def test_number_of_workers_changes_no_row(tmp_path, room_file):
    for workers in ("1", "2"):
        run_tiny(room_file, tmp_path / workers, "--workers", workers, "--no-pictures")
    one, two = (_untimed(read_rows(tmp_path / workers / ROWS_FILE)) for workers in ("1", "2"))
    assert one == two


def test_agent_that_fails_does_not_end_the_run(tmp_path):
    evaluation = make_evaluation(tmp_path, agents=["random"], scenes=["none.glb"], seeds=(0,), steps=5)
    (row,) = evaluate(evaluation, backend=HERE)
    assert row["error"].startswith("SceneError: ")
    assert row["comp_pct"] is None


def _wait_for_rows(path, count):
    for _ in range(300):
        if len(read_rows(path)) >= count:
            return
        time.sleep(0.1)
    raise AssertionError(f"no {count} rows in 30 s")


def _untimed(rows):
    times = ("cpu_ms", "wall_s")
    plain = [{key: value for key, value in row.items() if key not in times} for row in rows]
    return sorted(plain, key=lambda row: (row["agent"], row["seed"]))


def test_repeated_seed_is_refused(tmp_path):
    with pytest.raises(ValueError, match="`seeds` must differ, got 1, 1"):
        Evaluation(["fbe"], ["home:flat:1"], [1, 1], out=tmp_path)


def test_agent_whose_settings_changed_does_not_join_its_old_rows(tmp_path, play):
    def played_with(settings):
        return lambda job: play(job) | {"settings_hash": settings}

    evaluate(Evaluation(["fbe"], ["home:flat:1"], [0], out=tmp_path), HERE, played_with("old"))
    more = Evaluation(["fbe"], ["home:flat:1"], [0, 1], out=tmp_path)
    refusal = (
        r"fbe.* cannot join .*: the rows of fbe.* must have one settings_hash, got new, old.* another `--out`"
    )
    with pytest.raises(ValueError, match=refusal):
        evaluate(more, HERE, played_with("new"))
    assert {row["settings_hash"] for row in read_rows(tmp_path / ROWS_FILE)} == {"old"}
    assert len(evaluate(more, HERE, played_with("old"))) == 2


@pytest.mark.parametrize("field", ["settings_hash", "geometry", "surface", "measures"])
def test_row_that_would_spoil_the_file_is_not_written(field, tmp_path, play):
    """Also where none of the rows that are there is asked for."""

    def played_with(value):
        return lambda job: play(job) | {field: value}

    evaluate(Evaluation(["fbe"], ["home:flat:1"], [0], out=tmp_path), HERE, played_with("old"))
    before = (tmp_path / ROWS_FILE).read_bytes()
    with pytest.raises(ValueError, match=f"must have one {field}, got new, old"):
        evaluate(Evaluation(["fbe"], ["home:flat:1"], [1], out=tmp_path), HERE, played_with("new"))
    assert (tmp_path / ROWS_FILE).read_bytes() == before


@pytest.mark.parametrize(("protocol", "is_joined"), [("open-homes", False), ("explore-v0", True)])
def test_protocol_is_one_table_whatever_budgets_its_scenes_have(protocol, is_joined, tmp_path, play):
    """Budgets that are chosen freely make tables of their own."""

    def played_with(settings):
        return lambda job: play(job) | {"settings_hash": settings}

    short, long = (
        Job("fbe", "strong", scene, 0, steps, tmp_path, conditions=protocol)
        for scene, steps in (("home:studio:1", 10), ("home:flat:1", 20))
    )
    play_missing([short], tmp_path, {}, HERE, played_with("old"))
    refused = nullcontext() if is_joined else pytest.raises(ValueError, match="must have one settings_hash")
    with refused:
        play_missing([long], tmp_path, {}, HERE, played_with("new"))
    assert len(read_rows(tmp_path / ROWS_FILE)) == 1 + is_joined


def test_episodes_that_earlier_code_played_are_pointed_out(tmp_path, play, capsys):
    def played_by(commit):
        return lambda job: play(job) | {"versions": {"commit": commit}}

    evaluate(Evaluation(["fbe"], ["home:flat:1"], [0], out=tmp_path), HERE, played_by("abc1234+"))
    assert "played before" not in capsys.readouterr().err
    evaluate(Evaluation(["fbe"], ["home:flat:1"], [0, 1], out=tmp_path), HERE, played_by("def5678"))
    assert "1 of 2 episodes were played before, by the code as of abc1234+ (now" in capsys.readouterr().err


def test_two_rows_of_one_run_that_cannot_be_compared_are_not_both_written(tmp_path, play):
    with pytest.raises(ValueError, match="must have one geometry"):
        evaluate(
            Evaluation(["fbe"], ["home:flat:1"], [0, 1], out=tmp_path),
            HERE,
            lambda job: play(job) | {"geometry": f"g{job.seed}"},
        )
    assert len(read_rows(tmp_path / ROWS_FILE)) == 1


def test_folder_that_another_process_plays_into_is_refused(tmp_path, play, held):
    """And the settings of what is under way stay as they are."""
    evaluation = Evaluation(["fbe"], ["home:flat:1"], [0], out=tmp_path)
    (tmp_path / "settings.json").write_text("theirs")
    with held(tmp_path), pytest.raises(ValueError, match="no other process writes to"):
        evaluate(evaluation, HERE, play)
    assert (tmp_path / "settings.json").read_text() == "theirs"
    assert len(evaluate(evaluation, HERE, play)) == 1


def test_rows_of_another_file_of_the_same_name_are_not_taken_for_this_one(tmp_path, play):
    meshes = [tmp_path / folder / "room.glb" for folder in "ab"]
    for mesh in meshes:
        mesh.parent.mkdir()
        mesh.write_text(mesh.parent.name)

    def played_in(job):
        return play(job) | {"scene_file": file_digest(job.scene)}

    first, second = (Evaluation(["fbe"], [str(mesh)], [0], out=tmp_path / "out") for mesh in meshes)
    evaluate(first, HERE, played_in)
    evaluate(first, HERE, lambda _: pytest.fail("played twice"))
    with pytest.raises(ValueError, match=r"the rows of room in .* must come from .*b/room.glb as it is now"):
        evaluate(second, HERE, played_in)
    meshes[0].write_text("changed")
    with pytest.raises(ValueError, match="write to another `--out` folder"):
        evaluate(first, HERE, played_in)
