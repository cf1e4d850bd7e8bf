"""The report: its calibration, its failures, and what it says of intervals and of missing curves."""

import numpy as np
import pytest

from train.pictures import save_picture
from train.report import load_curves, write_report
from train.tables.comparison import make_table
from train.tables.text import format_table
from train.trajectory import Trajectory

TITLE = "Calibration of the map&#x27;s uncertainty"


def make_row(agent="anm", seed=0, **changes):
    row = {"agent": agent, "preset": "", "scene": "a", "seed": seed, "protocol": "explore-v0", "steps": 10}
    return row | {"settings_hash": "h1", "comp_pct": 50.0, "cpu_ms": {"total": 4.0}} | changes


def make_map_row(seed=0, **changes):
    calibration = {"auroc_seen": 0.91, "auroc_false": 0.8, "ause": 0.2, "mad_seen_cm": 1.5}
    calibration |= {"reliability": [[0.01, 0.02, 100], [0.1, 0.3, 100]]}
    return make_row(seed=seed, **(calibration | changes))


@pytest.fixture
def report(tmp_path):
    """Write a report on rows and read it."""
    return lambda rows: write_report(tmp_path, rows, "run").read_text(encoding="utf-8")


def section_of(text):
    return text.split(TITLE)[1].split("</section>")[0]


def test_agents_with_a_map_are_compared_with_intervals(report, tmp_path):
    section = section_of(report([make_map_row(), make_map_row(seed=1, auroc_seen=0.93), make_row("fbe")]))
    assert "0.920 ± 0.127" in section
    assert "AUROC unseen/seen" in section
    assert "wrong sign" in section
    assert ">anm<" in section
    assert ">fbe<" not in section


def test_reliability_curve_is_embedded(report, tmp_path):
    assert section_of(report([make_map_row()])).count("data:image/png;base64,") == 1
    assert (tmp_path / "reliability.png").exists()


def test_rows_of_earlier_runs_have_no_such_section(report, tmp_path):
    assert TITLE not in report([make_row(), make_row("fbe")])
    assert not (tmp_path / "reliability.png").exists()


def test_a_map_without_zero_crossings_has_a_line_but_no_curve(report):
    section = section_of(report([make_map_row(auroc_seen=None, reliability=[])]))
    assert "–" in section
    assert "<img" not in section


def test_failed_episodes_enter_no_calibration(report):
    assert TITLE not in report([make_row("fbe"), make_map_row(error="MapError: no")])


def make_curve_row(out, seed, is_kept=True):
    """Make a row; its trajectory is there if it is kept."""
    name = f"episodes/{seed}.npz"
    if is_kept:
        curves = {"comp_pct": np.linspace(0.0, 50.0, 11)}
        Trajectory("a", seed, np.ones(10, np.int8), np.zeros((11, 3)), curves=curves).save(out / name)
    return make_row(seed=seed, trajectory=name)


def test_curves_of_a_part_of_the_episodes_say_so(report, tmp_path):
    rows = [make_curve_row(tmp_path, seed, is_kept=seed != 1) for seed in range(3)]
    text = report(rows)
    assert "Curves of 2 of 3 episodes: 1 have no curve in their row and no trajectory here." in text
    assert "data:image/png;base64," in text
    assert "Curves of" not in report([rows[0], rows[2]])


def test_curves_in_rows_do_where_trajectories_are_gone(report, tmp_path):
    row = make_curve_row(tmp_path, 0, is_kept=False)
    curve = {"step": [0.0, 5.0, 10.0], "path_m": [0.0, 0.2, 0.4], "comp_pct": [1.0, 20.0, 50.0]}
    found = load_curves(tmp_path, [row | {"curve": curve}], 7)
    (over_steps,), (over_metres,) = (*found.over_steps.values(),)[0], (*found.over_metres.values(),)[0]
    assert (over_steps.x.tolist(), over_steps.y.tolist()) == ([0.0, 5.0], [1.0, 20.0])
    assert over_metres.x.tolist() == [0.0, 0.2]
    assert "Curves of" not in report([row | {"curve": curve}])


def test_curve_of_the_trajectory_comes_before_that_of_the_row(tmp_path):
    row = make_curve_row(tmp_path, 0) | {"curve": {"step": [0.0], "path_m": [0.0], "comp_pct": [9.0]}}
    (curve,) = next(iter(load_curves(tmp_path, [row], 10).over_steps.values()))
    assert (len(curve.x), curve.y[-1]) == (11, 50.0)


def test_torn_trajectory_leaves_the_curve_of_the_row(report, tmp_path):
    row = make_curve_row(tmp_path, 0) | {"curve": {"step": [0.0], "path_m": [0.0], "comp_pct": [9.0]}}
    (tmp_path / row["trajectory"]).write_bytes(b"")
    (curve,) = next(iter(load_curves(tmp_path, [row], 10).over_steps.values()))
    assert curve.y.tolist() == [9.0]
    assert "Curves of" not in report([row])


def test_time_of_a_module_is_averaged_over_the_scenes(report):
    """An episode without it spent nothing on it."""
    rows = [
        make_row("fbe", 0, scene="a", cpu_ms={"total": 10.0}),
        make_row("fbe", 1, scene="a", cpu_ms={"total": 10.0, "goal": 4.0}),
        make_row("fbe", 0, scene="b", cpu_ms={"total": 100.0, "goal": 6.0}),
    ]
    text = report(rows).partition("CPU time")[2].partition("</table>")[0]
    assert ">4.00<" in text
    assert ">55.00<" in text


def test_report_without_a_trajectory_has_no_curves_and_leaves_an_earlier_picture(report, tmp_path):
    (tmp_path / "curves.png").write_bytes(b"earlier")
    text = report([make_curve_row(tmp_path, seed, is_kept=False) for seed in range(2)])
    assert "Curves of 0 of 2 episodes" in text
    assert "<img" not in text
    assert (tmp_path / "curves.png").read_bytes() == b"earlier"


def test_report_and_printed_table_say_the_same_of_their_intervals(report):
    rows = [make_row(seed=seed) for seed in range(2)]
    interval = "95 % confidence interval over scenes, or over the seeds of one"
    assert f"Mean ± {interval};" in report(rows)
    assert f"mean ± {interval}" in format_table(make_table(rows)).splitlines()[0]


ATTRIBUTION = {
    "main_cause": "stuck",
    "stuck_pct": 40.0,
    "unreachable_pct": None,
    "oscillation_pct": 0.0,
    "phantom_pct": None,
    "rotation_pct": 55.0,
    "no_gain_pct": 3.0,
    "goals": None,
    "goals_failed": 2,
    "failure_reasons": {"no way": 2},
}


def test_failures_are_shown_with_the_trail(report, tmp_path):
    save_picture(tmp_path / "trail.png", np.zeros((4, 4, 3), np.uint8))
    row = make_row(
        attribution=ATTRIBUTION, pictures={"topdown": "trail.png"}, cpu_ms={"goal": 3.0, "total": 4.0}
    )
    section = report([row]).split("Failure attribution")[1].split("</section>")[0]
    assert "anm, a, seed 0: 50.0 %; stuck 40 %" in section
    assert section.count("data:image/png;base64,") == 1
    assert "no way: 2" in section
    assert "goal 75 %" in section
    assert "unreachable goals (%)" in section


def test_failures_of_an_agent_are_estimated_over_its_episodes(report):
    rows = [make_row(seed=seed, attribution=ATTRIBUTION | {"stuck_pct": 10.0 * seed}) for seed in (1, 3)]
    section = report(rows).split("Failure attribution")[1].split("</section>")[0]
    assert "20.0 ± 127.1" in section


def test_earlier_rows_have_pictures_but_no_attribution(report, tmp_path):
    save_picture(tmp_path / "trail.png", np.zeros((4, 4, 3), np.uint8))
    text = report([make_row(pictures={"topdown": "trail.png"})])
    assert "anm, a, seed 0: 50.0 %" in text
    assert "main cause" not in text.split("Failure attribution")[1].split("<p>")[0]
    assert "Failure attribution" not in report([make_row()])
