import json

import numpy as np
import pytest

from benchmarks.view_gains import format_table, main, scores


def test_expecting_the_truth_is_best_and_its_opposite_worst():
    true = np.array([[0.1, 0.4], [0.0, 0.3]])
    steps = np.array([20.0, 10.0])
    assert scores(true, true, steps) == {"rank_correlation": pytest.approx(1.0), "efficiency": 1.0}
    opposite = scores(-true, true, steps)
    assert opposite["rank_correlation"] == pytest.approx(-1.0)
    assert opposite["efficiency"] == 0.0
    assert scores(np.ones((2, 2)), true, steps)["rank_correlation"] == 0.0


def test_the_way_counts():
    true = np.array([[0.4], [0.3]])
    chosen_for_its_gain = scores(np.array([[9.0], [1.0]]), true, np.array([20.0, 10.0]))
    assert chosen_for_its_gain["efficiency"] == pytest.approx((0.4 / 20.0) / (0.3 / 10.0))


def test_quick_run_rates_every_gain_and_the_planner_beats_a_coin(tmp_path, capsys):
    main(["--quick", "--json", str(tmp_path / "gains.json")])
    rows = json.loads((tmp_path / "gains.json").read_text())
    names = {row["gain"] for row in rows}
    assert len(names) == 4
    assert {row["step"] for row in rows} <= {25, 50}
    assert all(row["rank_correlation"] > 0.2 for row in rows if "anm" in row["gain"])
    printed = capsys.readouterr().out
    assert all(name in printed for name in names)


def test_table_holds_means():
    rows = [{"gain": "a", "rank_correlation": value, "efficiency": value} for value in (0.2, 0.4)]
    assert format_table(rows).splitlines()[-1].split() == ["a", "2", "0.300", "0.300", "±", "0.100"]


def test_too_few_steps_are_refused():
    with pytest.raises(ValueError, match="`steps` must be >= 25"):
        main(["--steps", "10"])
