"""Curves of all agents: means and bands in closed form, a panel for each budget."""

import json

import numpy as np
import pytest

from train.figures.__main__ import main
from train.figures.curves import gather_curves
from train.play import ROWS_FILE
from train.results import append_row
from train.trajectory import Trajectory


def leave_episode(run, agent, seed, curve, scene="a"):
    """Write a row and its trajectory."""
    steps = len(curve) - 1
    name = f"episodes/{agent}_{scene}_{seed}.npz"
    poses = np.zeros((steps + 1, 3))
    curves = {"comp_pct": np.asarray(curve, float)}
    Trajectory(scene, seed, np.ones(steps, np.int8), poses, curves=curves).save(run / name)
    row = {"agent": agent, "preset": "", "scene": scene, "seed": seed, "protocol": "p", "steps": steps}
    append_row(
        run / ROWS_FILE, row | {"settings_hash": "h", "comp_pct": float(curve[-1]), "trajectory": name}
    )


@pytest.fixture
def run(tmp_path):
    for seed, last in enumerate((10.0, 20.0, 30.0)):
        leave_episode(tmp_path, "fbe", seed, np.linspace(0.0, last, 5))
        leave_episode(tmp_path, "anm", seed, np.linspace(0.0, 2.0 * last, 5))
    return tmp_path


def test_curves_are_means_with_their_t_interval(run):
    (panel,) = gather_curves(run).panels
    assert list(panel.bands) == ["anm", "fbe"]
    band = panel.bands["fbe"]
    np.testing.assert_array_equal(band.x, [0, 1, 2, 3, 4])
    np.testing.assert_allclose(band.mean, [0, 5, 10, 15, 20])
    half = 4.302652729911275 * 10.0 / np.sqrt(3.0)
    assert band.high[-1] == pytest.approx(20.0 + half)
    assert band.low[-1] == 0.0  # no ratio is negative
    assert panel.episodes == {"anm": 3, "fbe": 3}


def test_scenes_of_unlike_budget_have_panels_of_their_own(run):
    leave_episode(run, "fbe", 0, np.linspace(0.0, 40.0, 9), scene="b")
    panels = gather_curves(run).panels
    assert [(panel.steps, panel.scenes) for panel in panels] == [(4, ("a",)), (8, ("b",))]
    assert list(panels[1].bands) == ["fbe"]


def test_failed_episode_has_no_curve(run):
    row = {"agent": "fbe", "preset": "", "scene": "a", "seed": 9, "protocol": "p", "steps": 4}
    append_row(run / ROWS_FILE, row | {"error": "MapError: no"})
    curves = gather_curves(run)
    assert curves.panels[0].episodes["fbe"] == 3
    assert curves.gap == "1 failed"


def test_run_without_rows_names_the_command(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"must hold the rows of a table.*train\.tables table1 --out"):
        gather_curves(tmp_path)


def lose(run, *names):
    for name in names:
        (run / "episodes" / name).unlink()


def test_run_whose_trajectories_are_gone_is_refused_with_their_number(run):
    lose(run, *(f"{agent}_a_{seed}.npz" for agent in ("anm", "fbe") for seed in range(3)))
    with pytest.raises(
        FileNotFoundError,
        match=rf"{run} must hold curves or trajectories of a start that all its agents have, got none in 6 ",
    ):
        gather_curves(run)


def test_figure_says_how_many_of_the_episodes_it_shows(run, tmp_path, capsys):
    leave_episode(run, "fbe", 0, np.linspace(0.0, 40.0, 9), scene="b")
    lose(run, "fbe_a_1.npz", "fbe_b_0.npz")
    curves = gather_curves(run)
    assert [(panel.num_episodes, panel.missing) for panel in curves.panels] == [(4, 2), (0, 1)]
    main(["fig5", "--run", str(run), "--out", str(tmp_path / "out")])
    said = capsys.readouterr().out
    assert "4 of 6 episodes: 1 have no curve in their row and no trajectory here, 1 are from starts" in said
    assert "0 of 1 episodes: 1 have no curve" in said
    (numbers,) = (tmp_path / "out").glob("*.json")
    assert [panel["episodes_missing"] for panel in json.loads(numbers.read_text())["data"]["panels"]] == [
        2,
        1,
    ]


def test_title_of_a_panel_says_how_many_episodes_it_shows(run, tmp_path, monkeypatch):
    titles = []
    monkeypatch.setattr("matplotlib.axes.Axes.set_title", lambda axis, text, **_: titles.append(text))
    gather_curves(run).draw(tmp_path / "whole.png")
    lose(run, "fbe_a_1.npz")
    gather_curves(run).draw(tmp_path / "part.png")
    assert titles == ["1 scene, 4 steps", "1 scene, 4 steps, 4 of 6 episodes"]


def test_agents_are_compared_from_the_starts_that_all_have(run):
    leave_episode(run, "fbe", 3, np.linspace(0.0, 100.0, 5))
    lose(run, "anm_a_0.npz")
    curves = gather_curves(run)
    (panel,) = curves.panels
    assert panel.episodes == {"anm": 2, "fbe": 2}
    assert panel.bands["fbe"].mean[-1] == 25.0  # of seeds 1 and 2, whose last values are 20 and 30
    assert panel.bands["anm"].mean[-1] == 50.0
    assert "2 are from starts that not all agents have" in curves.gap


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (["--scene", "home:flat:2"], "--scene must not be given with fig5: the table has its episodes"),
        (["--steps=9", "--seed=1"], "--steps, --seed must not be given with fig5"),
        (["--env.reward", "none"], "--env must not be given with fig5"),
        (["--quick"], "--quick must not come with --run: its short episodes would join the table's"),
    ],
)
def test_options_that_would_do_nothing_or_harm_are_refused(given, message, run, capsys):
    before = (run / ROWS_FILE).read_bytes()
    with pytest.raises(SystemExit, match="2"):
        main(["fig5", "--run", str(run), *given])
    assert message in " ".join(capsys.readouterr().err.split())
    assert (run / ROWS_FILE).read_bytes() == before


def test_command_draws_the_figure_and_writes_its_numbers(run, tmp_path, capsys):
    leave_episode(run, "fbe", 0, np.linspace(0.0, 40.0, 9), scene="b")
    numbers = tmp_path / "fig5.json"
    main(["fig5", "--run", str(run), "--out", str(tmp_path / "out"), "--json", str(numbers)])
    (picture,) = (tmp_path / "out").glob("fig5_p.png")
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert f"fig5: {picture}" in capsys.readouterr().out
    content = json.loads(numbers.read_text())
    assert content["figure"] == "fig5"
    first, second = content["data"]["panels"]
    assert first["comp_pct"]["anm"]["mean"] == [0.0, 10.0, 20.0, 30.0, 40.0]
    assert second["comp_pct"]["fbe"]["high"] == [None] * 9
