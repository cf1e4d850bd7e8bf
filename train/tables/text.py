"""Tables as people read them, and as plain values."""

import math
from collections.abc import Sequence
from typing import Any, Final

from anm_gym.metrics.intervals import Interval
from train.tables.comparison import AgentLine, Table
from train.tables.measures import ALL_MEASURES, MEASURES, Measure

INTERVAL: Final = "95 % confidence interval over scenes, or over the seeds of one"
"""What stands behind a mean."""


def format_estimate(value: Interval | None, digits: int) -> str:
    """Write `mean ± half width`, the mean alone for a single episode, a dash for none."""
    if value is None:
        return "–"
    if math.isnan(value.half_width):
        return f"{value.mean:.{digits}f}"
    return f"{value.mean:.{digits}f} ± {value.half_width:.{digits}f}"


def columns_of(table: Table, measures: Sequence[Measure] = MEASURES) -> list[Measure]:
    """Choose those of the measures that at least one agent has."""
    return [measure for measure in measures if any(measure.key in line.estimates for line in table.lines)]


def format_table(table: Table, measures: Sequence[Measure] = MEASURES) -> str:
    """Lay the table out as aligned text, with the protocol above it.

    Args:
        table: The table.
        measures: The columns; those that no agent has are left out.
    """
    measures = columns_of(table, measures)
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
    title = f"protocol {table.protocol}, {table.budget}; mean ± {INTERVAL}"
    return "\n".join([title, *aligned(header, body), *notes(table)])


def aligned(header: Sequence[str], body: Sequence[Sequence[str]]) -> list[str]:
    """Lay cells out in lines, with a rule below the header; the first column is flush left."""
    widths = [max(len(row[column]) for row in [header, *body]) for column in range(len(header))]
    rule = ["─" * width for width in widths]
    return [_align(row, widths) for row in [header, rule, *body]]


def notes(table: Table) -> list[str]:
    """Say what a reader of the table must know: unequal episodes, states of the code, failures."""
    result = []
    if not table.is_paired:
        result.append(
            "note: the agents do not have the same scenes and seeds; their means are not comparable"
        )
    if len(table.commits) > 1 or any(commit.endswith("+") for commit in table.commits):
        names = ", ".join(commit or "unnamed" for commit in table.commits)
        result.append(f"note: the episodes were played by several states of the code: {names}")
    if any(line.failed for line in table.lines):
        result.append("note: failed episodes enter no mean; their errors are in the rows")
    return result


def table_as_json(table: Table) -> dict[str, Any]:
    """Turn the table into plain values for a JSON file."""
    return {
        "protocol": table.protocol,
        "steps": table.steps,
        "steps_by_scene": table.steps_by_scene,
        "is_paired": table.is_paired,
        "agents": [line_as_json(line) for line in table.lines],
    }


def interval_as_json(value: Interval | None) -> dict[str, Any] | None:
    """Turn an interval into plain values; None without a value."""
    if value is None or not value.count:
        return None
    half_width = None if math.isnan(value.half_width) else value.half_width
    return {"mean": value.mean, "ci95_half_width": half_width, "episodes": value.count}


def line_as_json(line: AgentLine) -> dict[str, Any]:
    """Turn an agent's line into plain values; a measure that it has not is null."""
    estimates = {measure.key: interval_as_json(line.estimates.get(measure.key)) for measure in ALL_MEASURES}
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


def _align(cells: Sequence[str], widths: Sequence[int]) -> str:
    first, *rest = [
        cell.ljust(width) if column == 0 else cell.rjust(width)
        for column, (cell, width) in enumerate(zip(cells, widths, strict=True))
    ]
    return "  ".join([first, *rest]).rstrip()
