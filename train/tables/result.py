"""A table of the paper, from its rows: native and official columns, paired differences."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from anm_gym.metrics.intervals import Interval
from train.protocols import whole_budgets
from train.results import Row
from train.tables.comparison import (
    AgentLine,
    Table,
    estimate,
    make_table,
    paired_differences,
    with_oracle_share,
)
from train.tables.measures import Measure
from train.tables.published import PUBLISHED, Numbers
from train.tables.rosters import TABLES, TableSpec
from train.tables.text import aligned, format_estimate, format_table, interval_as_json, line_as_json


@dataclass(frozen=True, eq=False)
class TableResult:
    """What a table says."""

    name: str
    """`table1` or `table2`."""
    preset: str
    """Preset of `anm`."""
    rows: Sequence[Row]
    """The rows, with the share of the oracle."""
    table: Table
    """Means and intervals."""
    reference: str
    """Whom the differences refer to; empty if that agent has no episode."""

    @property
    def spec(self) -> TableSpec:
        """What the table is made of."""
        return TABLES[self.name]

    @property
    def published(self) -> Numbers:
        """The paper's own numbers under the same protocol; empty for others, such as a part of it."""
        protocol = self.table.protocol
        is_whole = self.table.steps_by_scene == whole_budgets(protocol)
        return PUBLISHED[self.name].get(protocol, {}) if is_whole else {}

    def differences(self, key: str) -> dict[str, Interval]:
        """Mean difference to the reference from the same start, by agent."""
        return paired_differences(self.rows, self.reference, key) if self.reference else {}


def make_result(name: str, preset: str, rows: Sequence[Row], reference: str) -> TableResult:
    """Aggregate the rows of a table.

    Args:
        name: `table1` or `table2`.
        preset: Preset of `anm`.
        rows: What was played.
        reference: Whom to compare with; left out if it has no episode.

    Raises:
        ValueError: If the rows cannot be compared, see `train.tables.comparison.make_table`.
    """
    table = make_table(rows)
    named = {line.name for line in table.lines if line.episodes}
    shared = with_oracle_share(rows)
    return TableResult(name, preset, shared, table, reference if reference in named else "")


def format_result(result: TableResult) -> str:
    """Write the table for people: native, official, the paper's numbers, differences."""
    spec = result.spec
    blocks = [
        f"{spec.title}\nnative metrics; {format_table(result.table, spec.columns(spec.native))}",
        f"official metrics; {format_table(result.table, spec.columns(spec.official))}",
    ]
    if result.published:
        blocks.append(_format_published(result))
    if result.reference and len(result.table.lines) > 1:
        blocks.append(_format_differences(result))
    roles = [(line.name, spec.role_of(line.name, result.preset)) for line in result.table.lines]
    notes = [f"{name} is {role}" for name, role in roles if role]
    return "\n\n".join([*blocks, "\n".join(notes)] if notes else blocks)


def result_as_json(result: TableResult) -> dict[str, Any]:
    """Turn the table into plain values; the keys do not depend on who played."""
    differences = {key: result.differences(key) for key in (*result.spec.native, *result.spec.official)}
    return {
        "table": result.name,
        "title": result.spec.title,
        "protocol": result.table.protocol,
        "steps_by_scene": result.table.steps_by_scene,
        "seeds": sorted({row["seed"] for row in result.rows}),
        "is_paired": result.table.is_paired,
        "reference": result.reference or None,
        "columns": {"native": list(result.spec.native), "official": list(result.spec.official)},
        "agents": [
            _agent_as_json(result, line, {key: found.get(line.name) for key, found in differences.items()})
            for line in result.table.lines
        ],
        "published": result.published or None,
        "failures": [
            {key: row[key] for key in ("agent", "preset", "scene", "seed", "error")}
            for row in result.rows
            if row.get("error")
        ],
    }


def _agent_as_json(
    result: TableResult, line: AgentLine, differences: dict[str, Interval | None]
) -> dict[str, Any]:
    by_scene = {
        scene: {
            key: interval_as_json(_in_scene(result, line, scene, key))
            for key in (*result.spec.native, *result.spec.official)
        }
        for scene in result.table.steps_by_scene
    }
    return {
        **line_as_json(line),
        "name": line.name,
        "role": result.spec.role_of(line.name, result.preset) or None,
        "difference": {key: interval_as_json(value) for key, value in differences.items()},
        "by_scene": by_scene,
    }


def _in_scene(result: TableResult, line: AgentLine, scene: str, key: str) -> Interval | None:
    rows = [
        row
        for row in result.rows
        if not row.get("error")
        and (row["agent"], row["preset"], row["scene"]) == (line.agent, line.preset, scene)
    ]
    return estimate(rows, key)


def _format_published(result: TableResult) -> str:
    columns = [measure for measure in _columns(result) if measure.key in _published_keys(result)]
    header = ["paper", *(measure.heading.replace(" official", "") for measure in columns)]
    body = [
        [name, *(f"{values[measure.key]:.2f}" for measure in columns)]
        for name, values in result.published.items()
    ]
    title = "as published: one run for each scene, from starts that are not known; over all storeys of a mesh"
    return "\n".join([title, *aligned(header, body)])


def _published_keys(result: TableResult) -> set[str]:
    return {key for values in result.published.values() for key in values}


def _columns(result: TableResult) -> list[Measure]:
    return result.spec.columns((*result.spec.native, *result.spec.official))


def _format_differences(result: TableResult) -> str:
    columns = [measure for measure in _columns(result) if measure.key.startswith(("comp_", "mad_", "fpr_"))]
    differences = {measure.key: result.differences(measure.key) for measure in columns}
    columns = [m for m in columns if any(value.count for value in differences[m.key].values())]
    others = [line.name for line in result.table.lines if line.name != result.reference]
    body = [
        [
            name,
            str(max((differences[measure.key][name].count for measure in columns), default=0)),
            *(_difference(differences[measure.key][name], measure.digits) for measure in columns),
        ]
        for name in others
    ]
    title = f"paired differences to {result.reference}, start by start"
    return "\n".join([title, *aligned(["agent", "pairs", *(m.heading for m in columns)], body)])


def _difference(value: Interval, digits: int) -> str:
    return format_estimate(value if value.count else None, digits)
