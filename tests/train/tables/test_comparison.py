"""The table: closed forms of mean and interval, worst scene, refusals."""

import json
import math

import pytest

from train.tables.comparison import estimate, make_table, with_oracle_share
from train.tables.text import format_estimate, format_table, table_as_json


def make_row(agent="fbe", scene="a", seed=0, comp_pct=50.0, **changes):
    row = {"agent": agent, "preset": "strong", "scene": scene, "seed": seed, "protocol": "explore-v0"}
    row |= {"steps": 10, "settings_hash": "h1", "comp_pct": comp_pct, "cpu_ms": {"total": 4.0}}
    return row | changes


def rows_of(*values):
    return [make_row(seed=seed, comp_pct=value) for seed, value in enumerate(values)]


def test_interval_is_over_scenes_where_there_are_several():
    values = {"a": (10.0, 12.0), "b": (40.0, 42.0), "c": (70.0, 72.0)}
    rows = [
        make_row(scene=scene, seed=i, comp_pct=v)
        for scene, pair in values.items()
        for i, v in enumerate(pair)
    ]
    result = estimate(rows, "comp_pct")
    assert (result.mean, result.count) == (41.0, 6)
    assert result.half_width == pytest.approx(4.302652729911275 * 30.0 / math.sqrt(3.0))


def test_interval_of_three_values_matches_the_t_distribution():
    result = estimate(rows_of(1.0, 2.0, 3.0), "comp_pct")
    assert result.mean == 2.0
    assert result.half_width == pytest.approx(4.302652729911275 / math.sqrt(3.0))


def test_interval_of_two_values_matches_the_t_distribution():
    assert estimate(rows_of(0.0, 2.0), "comp_pct").half_width == pytest.approx(12.706204736432095)


def test_single_value_has_no_interval():
    result = estimate(rows_of(4.0, math.nan), "comp_pct")
    assert result.count == 1
    assert math.isnan(result.half_width)
    assert format_estimate(result, 1) == "4.0"


def test_no_value_is_a_dash():
    assert estimate(rows_of(math.nan), "comp_pct") is None
    assert format_estimate(None, 1) == "–"


def test_worst_scene_is_the_one_with_the_lowest_mean():
    rows = [make_row(scene="a", seed=0, comp_pct=10.0), make_row(scene="a", seed=1, comp_pct=90.0)]
    rows += [make_row(scene="b", seed=0, comp_pct=40.0), make_row(scene="b", seed=1, comp_pct=44.0)]
    (line,) = make_table(rows).lines
    assert (line.worst_scene, line.worst_comp_pct) == ("b", 42.0)
    assert line.estimates["comp_pct"].mean == 46.0


def test_best_agent_comes_first():
    table = make_table([make_row("random", comp_pct=30.0), make_row("anm", comp_pct=80.0)])
    assert [line.name for line in table.lines] == ["anm:strong", "random:strong"]


def test_measure_that_no_agent_has_is_not_a_column():
    assert "MAD" not in format_table(make_table([make_row(mad_cm=None)]))
    assert "MAD" in format_table(make_table([make_row(mad_cm=1.25)]))


def test_calibration_is_estimated_but_no_column_of_the_comparison():
    table = make_table([make_row(auroc_seen=0.9), make_row(seed=1, auroc_seen=0.7)])
    assert table.lines[0].estimates["auroc_seen"].mean == pytest.approx(0.8)
    assert "AUROC" not in format_table(table)


def test_failed_episodes_enter_no_mean_but_are_counted():
    table = make_table([make_row(), make_row(seed=1, comp_pct=None, settings_hash=None, error="MapError: x")])
    assert table.lines[0].estimates["comp_pct"].mean == 50.0
    assert table.lines[0].failed == 1
    assert "(+1 failed)" in format_table(table)


@pytest.mark.parametrize("field", ["protocol", "steps", "settings_hash", "measures"])
def test_unlike_rows_of_an_agent_are_refused(field):
    with pytest.raises(ValueError, match=f"must have one {field}, got"):
        make_table([make_row(), make_row(seed=1, **{field: "2"})])


@pytest.mark.parametrize(
    ("field", "owner"), [("geometry", "a"), ("surface", "a"), ("steps", "a"), ("start", "a, seed 0,")]
)
def test_agents_in_unlike_scenes_or_from_unlike_starts_are_refused(field, owner):
    rows = [make_row("anm", **{field: 1}), make_row("fbe", **{field: 2})]
    with pytest.raises(ValueError, match=f"the rows of {owner} must have one {field}, got 1, 2"):
        make_table(rows)


def test_budgets_of_two_scenes_may_differ():
    table = make_table([make_row(scene="a", steps=10), make_row(scene="b", steps=20)])
    assert table.steps_by_scene == {"a": 10, "b": 20}
    assert "10 to 20 steps by scene" in format_table(table)


def test_agents_under_unlike_protocols_are_refused():
    with pytest.raises(ValueError, match="must have one protocol, got explore-v0, noisy"):
        make_table([make_row("anm"), make_row("fbe", protocol="noisy")])


def test_agents_may_differ_in_settings():
    table = make_table([make_row("anm"), make_row("fbe", settings_hash="h2")])
    assert {line.settings_hash for line in table.lines} == {"h1", "h2"}


def test_empty_table_is_refused():
    with pytest.raises(ValueError, match="`rows` must hold at least one episode, got 0"):
        make_table([])


def test_oracle_share_compares_the_same_start():
    rows = [
        make_row("oracle_coverage", seed=0, comp_pct=80.0),
        make_row("oracle_coverage", seed=1, comp_pct=40.0),
    ]
    rows += [make_row("fbe", seed=0, comp_pct=40.0), make_row("fbe", seed=1, comp_pct=40.0)]
    rows += [make_row("fbe", seed=2, comp_pct=40.0)]
    shares = [row.get("oracle_share_pct") for row in with_oracle_share(rows) if row["agent"] == "fbe"]
    assert shares == [50.0, 100.0, None]


def test_unequal_episodes_are_pointed_out():
    table = make_table([make_row("anm"), make_row("fbe"), make_row("fbe", seed=1)])
    assert not table.is_paired
    assert "do not have the same scenes and seeds" in format_table(table)


def test_json_of_the_table_is_plain():
    text = json.dumps(table_as_json(make_table([make_row()])), allow_nan=False)
    assert json.loads(text)["agents"][0]["mad_cm"] is None
    assert json.loads(text)["agents"][0]["comp_pct"] == {"mean": 50.0, "ci95_half_width": None, "episodes": 1}


def test_rows_of_several_states_of_the_code_are_told_of():
    rows = [make_row(seed=seed, versions={"commit": name}) for seed, name in enumerate(("abc", "abc", "def"))]
    assert "several states of the code: abc, def" in format_table(make_table(rows))
    assert "states" not in format_table(make_table(rows[:2]))
