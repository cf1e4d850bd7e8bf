"""From episodes' rows to one line per agent: mean, 95 % confidence interval, worst scene."""

import math
from collections import defaultdict
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from anm_gym.metrics.intervals import Interval, mean_interval, paired_difference
from train.results import Row

ORACLE: Final = "oracle_coverage"
"""The agent that knows the scene; its completion of the same start is the share's denominator."""


@dataclass(frozen=True)
class Measure:
    """A column of the table."""

    key: str
    """Field of the row; a dotted key looks into a mapping."""
    heading: str
    """Heading with its unit."""
    digits: int = 1
    """Digits after the point."""
    is_better_high: bool | None = None
    """Which end is good; None where neither is."""


MEASURES: Final = (
    Measure("comp_pct", "Comp. (%)", 1, True),
    Measure("comp_cm", "Comp. (cm)", 1, False),
    Measure("comp_auc", "AUC steps (%)", 1, True),
    Measure("comp_auc_m", "AUC metres (%)", 1, True),
    Measure("comp_visible_pct", "of visible (%)", 1, True),
    Measure("oracle_share_pct", "of oracle (%)", 1, True),
    Measure("mad_cm", "MAD (cm)", 2, False),
    Measure("fpr_pct", "FPR (%)", 1, False),
    Measure("path_m", "path (m)", 1),
    Measure("collisions", "collisions", 1, False),
    Measure("cpu_ms.total", "CPU (ms/step)", 1, False),
)
"""The columns, in order; `OFFICIAL_MEASURES` follow where asked for."""

OFFICIAL_MEASURES: Final = (
    Measure("comp_pct_official", "Comp. official (%)", 1, True),
    Measure("comp_cm_official", "Comp. official (cm)", 1, False),
    Measure("mad_cm_official", "MAD official (cm)", 2, False),
    Measure("fpr_pct_official", "FPR official (%)", 1, False),
)
"""The same quantities as the released evaluation of Active Neural Mapping computes them."""

CALIBRATION_MEASURES: Final = (
    Measure("auroc_seen", "AUROC unseen/seen", 3, True),
    Measure("auroc_false", "AUROC false/true", 3, True),
    Measure("ause", "AUSE", 3, False),
    Measure("mad_seen_cm", "MAD seen (cm)", 2, False),
    Measure("free_err_cm", "free-space error (cm)", 2, False),
    Measure("sign_err_pct", "wrong sign (%)", 2, False),
)
"""Whether the map is right about what it has seen, and knows where it is wrong; a table of its own."""

_ALL_MEASURES: Final = MEASURES + OFFICIAL_MEASURES + CALIBRATION_MEASURES


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
    steps: int
    lines: tuple[AgentLine, ...]
    """Best mean completion ratio first."""
    is_paired: bool
    """Whether every agent has the same scenes and seeds."""


def agent_name(agent: str, preset: str) -> str:
    """Spell an agent with its preset, if it has one."""
    return f"{agent}:{preset}" if preset else agent


def value_of(row: Mapping[str, Any], key: str) -> float:
    """Read a measure of a row; NaN where it is absent or null."""
    value: Any = row
    for part in key.split("."):
        value = value.get(part) if isinstance(value, Mapping) else None
    return math.nan if value is None else float(value)


def make_table(rows: Iterable[Row]) -> Table:
    """Aggregate rows into one line per agent and preset.

    Args:
        rows: Result rows; those with an error count as failed and enter no mean.

    Returns:
        The table.

    Raises:
        ValueError: If there is no row, if rows differ in protocol or steps, or if one agent's rows
            differ in settings: such numbers are not comparable.
    """
    all_rows = with_oracle_share(rows)
    if not all_rows:
        raise ValueError("`rows` must hold at least one episode, got 0")
    groups = group_by_agent(all_rows)
    protocol = _single(all_rows, "protocol", "this table")
    steps = _single(all_rows, "steps", "this table")
    lines = [_agent_line(agent, preset, group) for (agent, preset), group in groups.items()]
    lines.sort(key=lambda line: -_mean(line, "comp_pct"))
    episodes = {frozenset(_starts(group)) for group in groups.values()}
    return Table(str(protocol), int(steps), tuple(lines), is_paired=len(episodes) == 1)


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


def estimate(values: Sequence[float]) -> Interval | None:
    """Mean and 95 % t-interval of the values that exist; None if there are none."""
    interval = mean_interval(values)
    return interval if interval.count else None


def format_estimate(value: Interval | None, digits: int) -> str:
    """Write `mean ± half width`, the mean alone for a single episode, a dash for none."""
    if value is None:
        return "–"
    if math.isnan(value.half_width):
        return f"{value.mean:.{digits}f}"
    return f"{value.mean:.{digits}f} ± {value.half_width:.{digits}f}"


def paired_differences(rows: Iterable[Row], reference: str, key: str = "comp_pct") -> dict[str, Interval]:
    """Compare every agent with one of them, episode by episode from the same start.

    Args:
        rows: Result rows.
        reference: The agent to compare with, as `agent_name` spells it.
        key: The measure.

    Returns:
        Mean difference to the reference by agent, with its 95 % t-interval.
    """
    values: dict[str, dict[Hashable, float]] = {
        agent_name(*names): {
            (row["scene"], row["seed"]): value_of(row, key) for row in group if not row.get("error")
        }
        for names, group in group_by_agent(rows).items()
    }
    others = {name: own for name, own in values.items() if name != reference}
    return {name: paired_difference(own, values[reference]) for name, own in others.items()}


def mean_reliability(rows: Iterable[Mapping[str, Any]]) -> NDArray[np.float64]:
    """Average the reliability of episodes, bin by bin.

    Args:
        rows: Result rows; those without `reliability`, or with fewer bins than most, are left out.

    Returns:
        (B, 2) predicted standard deviation and root mean square error, metres; (0, 2) without any.
    """
    found = [np.asarray(row["reliability"], np.float64) for row in rows if row.get("reliability")]
    most = max((len(each) for each in found), default=0)
    if most == 0:
        return np.zeros((0, 2))
    stacked = np.stack([each for each in found if len(each) == most])
    std_m = np.average(stacked[..., 0], axis=0, weights=stacked[..., 2])
    mean_square = np.average(stacked[..., 1] ** 2, axis=0, weights=stacked[..., 2])
    return np.stack([std_m, np.sqrt(mean_square)], axis=1)


def columns_of(table: Table, with_official: bool = False) -> tuple[Measure, ...]:
    """Choose the measures that at least one agent has."""
    measures = MEASURES + OFFICIAL_MEASURES if with_official else MEASURES
    return tuple(
        measure for measure in measures if any(measure.key in line.estimates for line in table.lines)
    )


def format_table(table: Table) -> str:
    """Lay the table out as aligned text, with the protocol above it."""
    measures = columns_of(table)
    header = ["agent", "n", *(measure.heading for measure in measures), "worst scene"]
    body = [
        [
            line.name,
            f"{line.episodes}" + (f" (+{line.failed} failed)" if line.failed else ""),
            *(format_estimate(line.estimates.get(measure.key), measure.digits) for measure in measures),
            f"{line.worst_scene} ({line.worst_comp_pct:.1f} %)" if line.worst_scene else "–",
        ]
        for line in table.lines
    ]
    widths = [max(len(row[column]) for row in [header, *body]) for column in range(len(header))]
    rule = ["─" * width for width in widths]
    text = [_align(row, widths) for row in [header, rule, *body]]
    title = f"protocol {table.protocol}, {table.steps} steps; mean ± 95 % confidence interval over episodes"
    return "\n".join([title, *text, *notes(table)])


def notes(table: Table) -> list[str]:
    """Say what a reader of the table must know: failures and unequal episodes."""
    result = []
    if not table.is_paired:
        result.append(
            "note: the agents do not have the same scenes and seeds; their means are not comparable"
        )
    if any(line.failed for line in table.lines):
        result.append("note: failed episodes enter no mean; their errors are in the rows")
    return result


def table_as_json(table: Table) -> dict[str, Any]:
    """Turn the table into plain values for a JSON file."""
    return {
        "protocol": table.protocol,
        "steps": table.steps,
        "is_paired": table.is_paired,
        "agents": [_line_as_json(line) for line in table.lines],
    }


def _line_as_json(line: AgentLine) -> dict[str, Any]:
    estimates = {
        key: {
            "mean": value.mean,
            "ci95_half_width": None if math.isnan(value.half_width) else value.half_width,
            "episodes": value.count,
        }
        for key, value in line.estimates.items()
    }
    worst = {"scene": line.worst_scene, "comp_pct": line.worst_comp_pct} if line.worst_scene else None
    return {
        "agent": line.agent,
        "preset": line.preset,
        "settings_hash": line.settings_hash,
        "episodes": line.episodes,
        "failed": line.failed,
        **estimates,
        "worst_scene": worst,
    }


def _agent_line(agent: str, preset: str, rows: Sequence[Row]) -> AgentLine:
    good = [row for row in rows if not row.get("error")]
    settings_hash = _single(good, "settings_hash", agent_name(agent, preset)) if good else ""
    estimates = {
        measure.key: found
        for measure in _ALL_MEASURES
        if (found := estimate([value_of(row, measure.key) for row in good])) is not None
    }
    scene, comp_pct = _worst_scene(good)
    return AgentLine(
        agent, preset, str(settings_hash), len(good), len(rows) - len(good), estimates, scene, comp_pct
    )


def _worst_scene(rows: Sequence[Row]) -> tuple[str, float]:
    by_scene: dict[str, list[float]] = defaultdict(list)
    for row in rows:
        by_scene[row["scene"]].append(value_of(row, "comp_pct"))
    means = {scene: float(np.mean(values)) for scene, values in by_scene.items()}
    worst = min(means, key=lambda scene: means[scene], default="")
    return worst, means.get(worst, math.nan)


def _single(rows: Iterable[Row], field: str, owner: str) -> Any:
    values = sorted({row[field] for row in rows}, key=str)
    if len(values) != 1:
        raise ValueError(
            f"the rows of {owner} must have one {field}, got {', '.join(map(str, values))}; "
            "choose rows of one kind, or write to another `--out` folder"
        )
    return values[0]


def _add_share(row: Row, oracle_pct: float) -> Row:
    share = 100.0 * value_of(row, "comp_pct") / oracle_pct if oracle_pct > 0 else math.nan
    return row if math.isnan(share) else {**row, "oracle_share_pct": share}


def _starts(rows: Iterable[Row]) -> set[tuple[str, int]]:
    return {(row["scene"], row["seed"]) for row in rows if not row.get("error")}


def _mean(line: AgentLine, key: str) -> float:
    return line.estimates[key].mean if key in line.estimates else -math.inf


def _align(cells: Sequence[str], widths: Sequence[int]) -> str:
    first, *rest = [
        cell.ljust(width) if column == 0 else cell.rjust(width)
        for column, (cell, width) in enumerate(zip(cells, widths, strict=True))
    ]
    return "  ".join([first, *rest]).rstrip()
