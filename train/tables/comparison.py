"""From episodes' rows to one line per agent: mean, 95 % confidence interval, worst scene."""

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from anm_gym.metrics.intervals import Interval, mean_interval, paired_difference
from train.results import Row
from train.tables.measures import ALL_MEASURES, ORACLE, agent_name, value_of


@dataclass(frozen=True)
class AgentLine:
    """One agent's line of the table."""

    agent: str
    preset: str
    settings_hash: str
    episodes: int
    """Episodes that ended without an error."""
    failed: int
    """Episodes that raised."""
    estimates: dict[str, Interval]
    """By measure key; a measure that no episode has is absent."""
    worst_scene: str
    """Scene with the lowest mean completion ratio."""
    worst_comp_pct: float
    """That mean, per cent."""

    @property
    def name(self) -> str:
        """Agent and preset as they are spelled on the command line."""
        return agent_name(self.agent, self.preset)


@dataclass(frozen=True)
class Table:
    """A comparison of agents under one protocol."""

    protocol: str
    steps_by_scene: dict[str, int]
    """Budget of each scene."""
    lines: tuple[AgentLine, ...]
    """Best mean completion ratio first."""
    is_paired: bool
    """Whether every agent has the same scenes and seeds."""
    commits: tuple[str, ...] = ()
    """States of this code that played the episodes; unnamed where it was no checkout."""

    @property
    def steps(self) -> int:
        """The largest budget."""
        return max(self.steps_by_scene.values())

    @property
    def budget(self) -> str:
        """The budget in words: one number, or the lowest and the highest."""
        fewest = min(self.steps_by_scene.values())
        return f"{fewest} steps" if fewest == self.steps else f"{fewest} to {self.steps} steps by scene"


def make_table(rows: Iterable[Row]) -> Table:
    """Aggregate rows into one line per agent and preset.

    Args:
        rows: Result rows; those with an error count as failed and enter no mean.

    Returns:
        The table.

    Raises:
        ValueError: If there is no row, or if they are not comparable, see `check_comparable`.
    """
    all_rows = with_oracle_share(rows)
    if not all_rows:
        raise ValueError("`rows` must hold at least one episode, got 0")
    groups = group_by_agent(all_rows)
    check_comparable(all_rows)
    protocol = all_rows[0]["protocol"]
    steps_by_scene = {row["scene"]: int(row["steps"]) for row in all_rows}
    lines = [_agent_line(agent, preset, group) for (agent, preset), group in groups.items()]
    lines.sort(key=lambda line: -_mean(line, "comp_pct"))
    episodes = {frozenset(_starts(group)) for group in groups.values()}
    commits = dict.fromkeys((row.get("versions") or {}).get("commit", "") for row in _good(all_rows))
    return Table(str(protocol), steps_by_scene, tuple(lines), len(episodes) == 1, tuple(commits))


def check_comparable(rows: Iterable[Row]) -> None:
    """Refuse rows that no table may hold together.

    Args:
        rows: Result rows; of those with an error only protocol and steps matter.

    Raises:
        ValueError: If rows differ in protocol or in how they were measured, those of one scene in steps,
            geometry or the surface that is to be seen, those of one scene and seed in their start, or those
            of one agent in settings.
    """
    all_rows = list(rows)
    good = _good(all_rows)
    _single(all_rows, "protocol", "this table")
    _single(good, "measures", "this table")
    for owner, group in _grouped(all_rows, lambda row: row["scene"]).items():
        _single(group, "steps", owner)
    for owner, group in _grouped(good, lambda row: row["scene"]).items():
        _single(group, "geometry", owner)
        _single(group, "surface", owner)
    for owner, group in _grouped(good, lambda row: f"{row['scene']}, seed {row['seed']},").items():
        _single(group, "start", owner)
    for owner, group in _grouped(good, lambda row: agent_name(row["agent"], row["preset"])).items():
        _single(group, "settings_hash", owner)


def group_by_agent(rows: Iterable[Row]) -> dict[tuple[str, str], list[Row]]:
    """Sort rows by agent and preset, in order of first appearance."""
    groups: dict[tuple[str, str], list[Row]] = defaultdict(list)
    for row in rows:
        groups[row["agent"], row["preset"]].append(row)
    return dict(groups)


def with_oracle_share(rows: Iterable[Row]) -> list[Row]:
    """Add `oracle_share_pct`, completion relative to the oracle's from the same start, where there is one."""
    all_rows = list(rows)
    oracle = {
        (row["scene"], row["seed"]): value_of(row, "comp_pct") for row in all_rows if row["agent"] == ORACLE
    }
    return [_add_share(row, oracle.get((row["scene"], row["seed"]), math.nan)) for row in all_rows]


def estimate(rows: Sequence[Row], key: str) -> Interval | None:
    """Mean of a measure, with a 95 % t-interval over scenes or over the seeds of one; None without values."""
    values = [value_of(row, key) for row in rows]
    interval = mean_interval(values, clusters=[row["scene"] for row in rows])
    return interval if interval.count else None


def paired_differences(rows: Iterable[Row], reference: str, key: str = "comp_pct") -> dict[str, Interval]:
    """Compare every agent with one of them, episode by episode from the same start.

    Args:
        rows: Result rows.
        reference: The agent to compare with, as `agent_name` spells it.
        key: The measure.

    Returns:
        Mean difference to the reference by agent, with its 95 % t-interval over scenes, or the seeds of one.
    """
    values: dict[str, dict[tuple[str, int], float]] = {
        agent_name(*names): {
            (row["scene"], row["seed"]): value_of(row, key) for row in group if not row.get("error")
        }
        for names, group in group_by_agent(rows).items()
    }
    others = {name: own for name, own in values.items() if name != reference}
    return {name: paired_difference(own, values[reference]) for name, own in others.items()}


def _agent_line(agent: str, preset: str, rows: Sequence[Row]) -> AgentLine:
    good = _good(rows)
    settings_hash = good[0].get("settings_hash") if good else ""
    estimates = {
        measure.key: found for measure in ALL_MEASURES if (found := estimate(good, measure.key)) is not None
    }
    scene, comp_pct = _worst_scene(good)
    return AgentLine(
        agent, preset, str(settings_hash or ""), len(good), len(rows) - len(good), estimates, scene, comp_pct
    )


def _worst_scene(rows: Sequence[Row]) -> tuple[str, float]:
    by_scene: dict[str, list[float]] = defaultdict(list)
    for row in rows:
        by_scene[row["scene"]].append(value_of(row, "comp_pct"))
    means = {scene: float(np.mean(values)) for scene, values in by_scene.items()}
    worst = min(means, key=lambda scene: means[scene], default="")
    return worst, means.get(worst, math.nan)


def _grouped(rows: Iterable[Row], key: Callable[[Row], str]) -> dict[str, list[Row]]:
    groups: dict[str, list[Row]] = defaultdict(list)
    for row in rows:
        groups[key(row)].append(row)
    return groups


def _good(rows: Iterable[Row]) -> list[Row]:
    return [row for row in rows if not row.get("error")]


def _single(rows: Sequence[Row], field: str, owner: str) -> None:
    """Refuse rows that have not all the same value."""
    values = {str(row.get(field)) for row in rows}
    if len(values) > 1:
        raise ValueError(
            f"the rows of {owner} must have one {field}, got {', '.join(sorted(values))}; "
            "choose rows of one kind, or write to another `--out` folder"
        )


def _add_share(row: Row, oracle_pct: float) -> Row:
    share = 100.0 * value_of(row, "comp_pct") / oracle_pct if oracle_pct > 0 else math.nan
    return row if math.isnan(share) else {**row, "oracle_share_pct": share}


def _starts(rows: Iterable[Row]) -> set[tuple[str, int]]:
    return {(row["scene"], row["seed"]) for row in rows if not row.get("error")}


def _mean(line: AgentLine, key: str) -> float:
    return line.estimates[key].mean if key in line.estimates else -math.inf
