"""The paper's tables by one command: who is in them, what they say, what is played again."""

import json
from dataclasses import replace

import pytest

from agents.roster import ROSTER
from train.backends import Backend
from train.command import run_command
from train.episodes import split_agent
from train.play import ROWS_FILE
from train.protocols import Protocol, ProtocolScene, make_protocol
from train.provenance import digest
from train.results import append_row, read_rows
from train.tables.__main__ import main, play_command
from train.tables.published import PUBLISHED
from train.tables.result import format_result, make_result, result_as_json
from train.tables.rosters import TABLES
from train.tables.run import TableRun, play_table

TINY_CAMERA = '{"camera": {"width_px": 16, "height_px": 16}}'


def options_of(room_file, out, *more):
    """Write the options of a small table in one room."""
    fixed = ["--protocol=open-scenes", f"--root={room_file.parent}", "--steps=5", "--seeds=2", "--workers=0"]
    return ["table1", *fixed, "--env", TINY_CAMERA, "--no-pictures", f"--out={out}", *more]


@pytest.fixture(scope="module")
def written(room_file, tmp_path_factory):
    out = tmp_path_factory.mktemp("table1")
    agents = ["--agents", "random", "fbe:paper", "--reference", "fbe:paper"]
    main(options_of(room_file, out, *agents, "--json", str(out / "copy.json")))
    return out


def test_command_writes_table_report_starts_and_settings(written):
    table = json.loads((written / "table1.json").read_text())
    assert table == json.loads((written / "copy.json").read_text())
    assert table["protocol"].startswith("open-scenes-5-steps-")
    assert [line["episodes"] for line in table["agents"]] == [2, 2]
    assert all((written / name).is_file() for name in ("report.html", "starts.json", "settings.json"))


def test_every_row_says_under_what_conditions_it_was_played(written):
    rows = read_rows(written / ROWS_FILE)
    assert len(rows) == 4
    for field in ("protocol", "preset", "settings_hash", "geometry", "start"):
        assert all(row[field] is not None for row in rows)
    assert len({(row["seed"], *row["start"]) for row in rows}) == 2


def test_finished_table_is_not_played_again(written, room_file):
    before = (written / ROWS_FILE).read_bytes()
    played = play_command(options_of(room_file, written, "--agents", "random", "fbe:paper"))
    assert (written / ROWS_FILE).read_bytes() == before
    assert len(played.rows) == 4


def test_table_is_printed_from_rows_alone(written, tmp_path, capsys):
    rows = tmp_path / "elsewhere" / ROWS_FILE
    rows.parent.mkdir()
    rows.write_bytes((written / ROWS_FILE).read_bytes())
    rows.parent.chmod(0o555)
    main(
        ["table1", "--rows", str(rows.parent), "--reference", "fbe:paper", "--json", str(tmp_path / "t.json")]
    )
    printed = json.loads((tmp_path / "t.json").read_text())
    assert printed == json.loads((written / "table1.json").read_text())
    assert "paired differences to fbe:paper" in capsys.readouterr().out
    assert [path.name for path in rows.parent.iterdir()] == [ROWS_FILE]


def test_part_of_the_rows_is_chosen_by_agent_scene_and_seed(written, tmp_path):
    fixed = ["table1", "--rows", str(written / ROWS_FILE), "--json", str(tmp_path / "part.json")]
    main([*fixed, "--agents", "fbe:paper", "--seeds", "1,", "--scenes", "room"])
    part = json.loads((tmp_path / "part.json").read_text())
    assert part["seeds"] == [1]
    assert [(line["name"], line["episodes"]) for line in part["agents"]] == [("fbe:paper", 1)]
    for options, message in (
        (["--scenes", "attic"], "`scenes` must name what has rows, got attic, which has none in"),
        (["--agents", "fbe:paper", "nbv"], "`agents` must name what has rows, got nbv:strong"),
        (["--seeds", "0,77"], "`seeds` must name what has rows, got 77"),
        (["--steps", "9"], "`steps` must name what has rows, got 9"),
    ):
        with pytest.raises(ValueError, match=message):
            main([*fixed, *options])


def test_rows_are_printed_as_they_were_played(written):
    with pytest.raises(ValueError, match="leave out --out"):
        main(["table1", "--rows", str(written), "--out", "x"])


def test_rows_that_cannot_be_compared_lie_in_folders_apart(room_file, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    fixed = ["table1", "--protocol=open-scenes", f"--root={room_file.parent}", "--scenes", "room"]
    fixed += ["--seeds=1", "--workers=0", "--agents", "random", "--no-pictures", "--reference", "random"]
    for more in (["--quick"], ["--quick", "--steps=2"], ["--steps=2"], ["--steps=2", "--env", TINY_CAMERA]):
        play_command([*fixed, *more])
    stems = sorted(path.name for path in (tmp_path / "runs" / "table1").iterdir())
    environment = digest(json.loads(TINY_CAMERA), 6)
    assert stems == sorted(
        [
            "open-scenes-quick",
            "open-scenes-2-steps-quick",
            "open-scenes-2-steps",
            f"open-scenes-2-steps-{environment}",
        ]
    )


def test_table_goes_on_with_what_is_missing(written, room_file, tmp_path):
    first, *others = read_rows(written / ROWS_FILE)
    append_row(tmp_path / ROWS_FILE, first | {"comp_pct": 12.5})
    played = play_command(options_of(room_file, tmp_path, "--agents", "random", "fbe:paper"))
    assert [row["comp_pct"] for row in played.rows].count(12.5) == 1
    assert len(played.rows) == 1 + len(others)


def test_folder_is_described_whole_though_a_part_was_asked_for(written, room_file, tmp_path, capsys):
    for row in read_rows(written / ROWS_FILE):
        append_row(tmp_path / ROWS_FILE, row)
    part = ["--agents", "fbe:paper", "--seeds", "0,", "--json", str(tmp_path / "part.json")]
    main(options_of(room_file, tmp_path, *part))
    names = [
        [line["name"] for line in json.loads((tmp_path / f"{name}.json").read_text())["agents"]]
        for name in ("part", "table1")
    ]
    assert names[0] == ["fbe:paper"]
    assert sorted(names[1]) == ["fbe:paper", "random:uniform"]
    assert "random:uniform" not in capsys.readouterr().out
    assert "random:uniform" in (tmp_path / "report.html").read_text()


def test_settings_of_every_agent_lie_beside_the_rows(written):
    """Under the hash that its rows have."""
    hashes = {row["settings_hash"] for row in read_rows(written / ROWS_FILE)}
    kept = {path.stem: json.loads(path.read_text()) for path in (written / "settings").iterdir()}
    assert kept.keys() == hashes
    assert any("FrontierGoalWrapper" in settings for settings in kept.values())


def test_keys_do_not_depend_on_who_played(written, room_file, tmp_path):
    main(options_of(room_file, tmp_path, "--agents", "random", "--seeds", "1"))
    short, full = (json.loads((path / "table1.json").read_text()) for path in (tmp_path, written))
    assert short.keys() == full.keys()
    assert short["agents"][0].keys() == full["agents"][0].keys()
    assert short["agents"][0]["difference"].keys() == full["agents"][0]["difference"].keys()


def make_run(tmp_path, name="anm-gibson", agents=("random", "anm:best")):
    scenes = (ProtocolScene("gibson:Denmark", 1000), ProtocolScene("gibson:Cantwell", 2000))
    return TableRun(agents, Protocol(name, name, scenes), (0, 1), tmp_path)


def make_rows(run, values):
    """Make rows whose completion is that of the agent, plus ten in the second scene, plus the seed."""
    rows = []
    for agent, value in values.items():
        name, _, preset = agent.partition(":")
        for index, scene in enumerate(run.protocol.scenes):
            for seed in run.seeds:
                comp_pct = value + 10.0 * index + seed
                row = {"agent": name, "preset": preset, "scene": scene.label, "seed": seed}
                row |= {"protocol": run.protocol.name, "steps": scene.steps, "settings_hash": name}
                row |= {"comp_pct": comp_pct, "comp_pct_official": comp_pct - 1.0}
                rows.append(row | {"cpu_ms": {"total": 2.0}})
    return rows


@pytest.fixture
def result(tmp_path):
    run = make_run(tmp_path)
    rows = make_rows(run, {"random": 20.0, "anm:best": 60.0, "oracle_coverage": 80.0})
    return make_result("table1", "best", rows, "anm:best")


def test_scenes_may_differ_in_budget(result):
    assert result.table.steps_by_scene == {"gibson:Denmark": 1000, "gibson:Cantwell": 2000}
    assert "1000 to 2000 steps by scene" in format_result(result)


def test_differences_are_taken_start_by_start(result):
    lines = {line["name"]: line for line in result_as_json(result)["agents"]}
    difference = lines["random"]["difference"]["comp_pct"]
    assert difference == {"mean": -40.0, "ci95_half_width": 0.0, "episodes": 4}
    assert lines["anm:best"]["difference"]["comp_pct"] is None
    assert lines["anm:best"]["worst_scene"] == {"scene": "gibson:Denmark", "comp_pct": 60.5}
    assert lines["anm:best"]["by_scene"]["gibson:Cantwell"]["comp_pct"]["mean"] == 70.5


def test_share_of_the_oracle_is_that_of_the_same_start(result):
    lines = {line["name"]: line for line in result_as_json(result)["agents"]}
    assert lines["anm:best"]["oracle_share_pct"]["mean"] == pytest.approx(
        100.0 * (60 / 80 + 61 / 81 + 70 / 90 + 71 / 91) / 4
    )


def test_native_and_official_stand_apart_with_the_paper_beside(tmp_path):
    run = replace(make_run(tmp_path), protocol=make_protocol("anm-gibson"))
    rows = make_rows(run, {"random": 20.0, "anm:best": 60.0})
    text = format_result(make_result("table1", "best", rows, "anm:best"))
    native, official, paper, differences = text.split("\n\n")
    assert "Comp. (%)" in native
    assert "official" not in native.split("\n", 1)[1].replace("native metrics", "")
    assert "Comp. official (%)" in official
    assert "Ours" in paper
    assert "80.45" in paper
    assert "paired differences to anm:best" in differences


def test_other_protocols_have_no_published_numbers(tmp_path):
    run = make_run(tmp_path, "open-homes")
    result = make_result("table1", "best", make_rows(run, {"random": 20.0}), "anm:best")
    assert result_as_json(result)["published"] is None
    assert result_as_json(result)["reference"] is None
    assert "as published" not in format_result(result)


def test_part_of_the_paper_s_protocol_has_no_published_numbers(tmp_path):
    run, whole = make_run(tmp_path), make_protocol("anm-gibson")
    for protocol in (whole, whole.only(["gibson:Denmark"]), whole.shortened(12)):
        rows = make_rows(replace(run, protocol=protocol), {"random": 20.0})
        assert bool(make_result("table1", "best", rows, "random").published) == (protocol is whole)


def test_paper_s_protocol_under_another_camera_has_no_published_numbers(tmp_path):
    run = replace(make_run(tmp_path), protocol=make_protocol("anm-gibson"))
    rows = [row | {"protocol": "anm-gibson-abc123"} for row in make_rows(run, {"random": 20.0})]
    assert not make_result("table1", "best", rows, "random").published


def test_published_columns_are_columns_of_the_table():
    for name, protocols in PUBLISHED.items():
        for lines in protocols.values():
            assert {key for values in lines.values() for key in values} <= set(TABLES[name].official)
    ours = {protocol: lines["Ours"]["comp_pct_official"] for protocol, lines in PUBLISHED["table1"].items()}
    assert ours == {"anm-gibson": 80.45, "anm-mp3d": 73.15}


def test_table_one_has_the_rivals_and_table_two_the_modules():
    assert TABLES["table1"].agents("fast")[-2:] == ["anm:fast", "oracle_coverage"]
    assert {"random", "fbe:paper", "upen", "occant"} <= set(TABLES["table1"].agents("best"))
    assert "anm:paper+dropout" in TABLES["table2"].agents("paper")
    assert TABLES["table2"].role_of("anm:paper+relu", "paper").startswith("Module 4")
    assert TABLES["table2"].role_of("fbe", "paper") == ""


@pytest.mark.parametrize(
    ("agent", "message"),
    [
        ("nobody", "unknown agent 'nobody'; choose one of: random, "),
        ("anm:nope", "unknown preset 'nope' of agent 'anm'; choose one of: best, fast, paper, released"),
        ("anm:best+dropuot", "unknown variant 'dropuot' of agent 'anm'; choose one of: "),
    ],
)
def test_misspelt_agent_stops_the_command_before_anything_is_written(
    room_file, tmp_path, capsys, agent, message
):
    out = tmp_path / "run"
    with pytest.raises(SystemExit) as stopped:
        run_command(lambda: main(options_of(room_file, out, "--agents", "random", agent)))
    assert stopped.value.code == 2
    assert f"error: {message}" in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.parametrize("name", TABLES)
@pytest.mark.parametrize("preset", ROSTER["anm"].presets)
def test_every_agent_of_a_table_is_in_the_roster(name, preset):
    agents = TABLES[name].agents(preset)
    assert len({split_agent(agent) for agent in agents}) == len(agents)


def test_failed_episode_is_listed_and_enters_no_mean(tmp_path):
    run = make_run(tmp_path)
    rows = make_rows(run, {"random": 20.0, "anm:best": 60.0})
    rows[-1] |= {"error": "MapError: no", "comp_pct": None}
    table = result_as_json(make_result("table1", "best", rows, "anm:best"))
    assert [failure["error"] for failure in table["failures"]] == ["MapError: no"]
    assert {line["name"]: line["failed"] for line in table["agents"]} == {"anm:best": 1, "random": 0}
    json.dumps(table, allow_nan=False)


def test_table_needs_its_scenes(tmp_path, monkeypatch):
    monkeypatch.setenv("ANM_SCENES", str(tmp_path))
    with pytest.raises(Exception, match="anm-gibson lacks 2 of 2 scenes"):
        play_table(make_run(tmp_path), Backend(workers=0))


@pytest.mark.parametrize("field", ["agents", "seeds"])
def test_run_that_names_one_twice_is_refused(tmp_path, field):
    value = {"agents": ("fbe", "fbe:strong"), "seeds": (1, 1)}[field]
    given = {"agents": ("random",), "seeds": (0,)} | {field: value}
    with pytest.raises(ValueError, match=f"`{field}` must name at least one and none twice"):
        TableRun(given["agents"], make_run(tmp_path).protocol, given["seeds"], tmp_path)


@pytest.mark.slow
def test_quick_table_has_the_keys_of_the_full_one(tmp_path, written, capsys):
    main(["table1", "--quick", "--agents", "random", "fbe:paper", "--out", str(tmp_path)])
    quick, full = (json.loads((path / "table1.json").read_text()) for path in (tmp_path, written))
    assert quick.keys() == full.keys()
    assert quick["agents"][0].keys() == full["agents"][0].keys()
    assert "report: " in capsys.readouterr().out
