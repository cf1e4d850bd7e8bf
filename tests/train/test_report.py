"""The report's section on calibration: who is in it, what it says, what old rows leave out."""

import numpy as np
import pytest

from train.pictures import save_picture
from train.report import write_report

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
