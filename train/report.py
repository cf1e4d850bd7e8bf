"""The evaluation's report: table, curves, one line and one picture per episode, on one HTML page."""

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from train import html
from train.attribution_report import attribution_body
from train.html import Cell, Section
from train.plots import Curve, completion_figure, reliability_figure
from train.results import Row
from train.tables.comparison import (
    AgentLine,
    Table,
    estimate,
    group_by_agent,
    make_table,
    paired_differences,
    with_oracle_share,
)
from train.tables.measures import (
    ATTRIBUTION_MEASURES,
    CALIBRATION_MEASURES,
    MEASURES,
    OFFICIAL_MEASURES,
    ORACLE,
    Measure,
    agent_name,
    value_of,
)
from train.tables.reliability import ReliabilityBin, gather_reliability
from train.tables.text import INTERVAL, columns_of, format_estimate, notes
from train.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class EpisodeCurves:
    """Completion curves by agent, of the starts for which every agent has one: others would not compare."""

    over_steps: dict[str, list[Curve]]
    """Over steps."""
    over_metres: dict[str, list[Curve]]
    """Over metres."""
    missing: int
    """Episodes without a curve, as earlier versions left them, and without a trajectory."""
    unshared: int
    """Episodes with a curve, from a start for which another agent has none."""

    @property
    def num_found(self) -> int:
        """Episodes whose curves are here."""
        return sum(map(len, self.over_steps.values()))

    @property
    def gap(self) -> str:
        """What is lacking, in words; empty if nothing is."""
        total = self.num_found + self.missing + self.unshared
        why = [f"{self.missing} have no curve in their row and no trajectory here"] * bool(self.missing)
        why += [f"{self.unshared} are from starts that not all agents have"] * bool(self.unshared)
        return f"{self.num_found} of {total} episodes: {', '.join(why)}" if why else ""


def write_report(out: Path, rows: Sequence[Row], title: str) -> Path:
    """Write `report.html`, `curves.png` and, where there are maps, `reliability.png` into the run's folder.

    Args:
        out: The run's folder, with `episodes/` and `pictures/` of its episodes.
        rows: Result rows.
        title: The page's heading.

    Returns:
        Path of the page.

    Raises:
        ValueError: If the rows cannot be compared, see `train.tables.comparison.make_table`.
    """
    table = make_table(rows)
    good = [row for row in with_oracle_share(rows) if not row.get("error")]
    shared_steps = min(table.steps_by_scene.values())
    sections = [
        Section("Comparison", _measured(table, MEASURES) + _table_notes(table)),
        Section("Paired differences", _differences(table, good)),
        Section("Completion", _completion(out, load_curves(out, good, shared_steps), shared_steps)),
        Section("By scene", _by_scene(good)),
        Section("As the released evaluation measures", _measured(table, OFFICIAL_MEASURES)),
        Section("CPU time", _compute(good)),
        Section("Calibration of the map's uncertainty", _calibration(out, table, good)),
        Section("Failure attribution", attribution_body(out, good, _measured(table, ATTRIBUTION_MEASURES))),
        Section("Episodes", _episodes(with_oracle_share(rows))),
        Section("Failures", _failures(rows)),
        Section("Provenance", _provenance(table, rows)),
    ]
    subtitle = f"protocol {table.protocol}, {table.budget}, {len(good)} episodes"
    return html.write_page(out / "report.html", html.page(title, subtitle, [s for s in sections if s.body]))


def load_curves(out: Path, rows: Sequence[Row], max_steps: int) -> EpisodeCurves:
    """Read the first steps of the completion curves by agent: over steps, and over metres.

    Curves of unlike length have no mean, so all end at a budget that every episode had.

    Args:
        out: The run's folder; its `episodes/` may be gone, as git does not keep them. The curves in rows are
            coarser.
        rows: Result rows of episodes that did not fail.
        max_steps: Where the curves end.
    """
    found = [(row, curve) for row in rows if (curve := _curve_of(out, row)) is not None]
    agents = {agent_name(row["agent"], row["preset"]) for row in rows}
    at_start: dict[tuple[str, int], set[str]] = defaultdict(set)
    for row, _ in found:
        at_start[row["scene"], row["seed"]].add(agent_name(row["agent"], row["preset"]))
    steps: dict[str, list[Curve]] = defaultdict(list)
    metres: dict[str, list[Curve]] = defaultdict(list)
    shared = [(row, curve) for row, curve in found if at_start[row["scene"], row["seed"]] == agents]
    for row, curve in shared:
        step, path_m, comp_pct = (values[curve[0] <= max_steps] for values in curve)
        name = agent_name(row["agent"], row["preset"])
        steps[name].append(Curve(step, comp_pct, row["scene"]))
        metres[name].append(Curve(path_m, comp_pct, row["scene"]))
    missing, unshared = len(rows) - len(found), len(found) - len(shared)
    return EpisodeCurves(dict(steps), dict(metres), missing, unshared)


def _curve_of(out: Path, row: Row) -> tuple[NDArray[np.float64], ...] | None:
    """(T,) steps, metres and completion (%) of an episode, from its trajectory or else from its row."""
    path = out / str(row.get("trajectory", ""))
    with suppress(FileNotFoundError, IsADirectoryError, ValueError):  # gone, or torn
        trajectory = Trajectory.load(path)
        comp_pct = trajectory.curves["comp_pct"]
        return np.arange(len(comp_pct), dtype=np.float64), trajectory.path_m, comp_pct
    if curve := row.get("curve"):
        return tuple(np.array(curve[name], np.float64) for name in ("step", "path_m", "comp_pct"))
    return None


def _completion(out: Path, curves: EpisodeCurves, steps: int) -> str:
    """Draw the curves and say whose are not there; without any, an earlier picture stays as it is."""
    about = f"Completion over the {steps} steps that all scenes have, and over metres walked in them."
    note = html.paragraph(f"Curves of {curves.gap}.") if curves.gap else ""
    if not curves.num_found:
        return note
    picture = completion_figure(curves.over_steps, curves.over_metres, steps, out / "curves.png")
    return html.image(picture, about) + note


def _comparison(lines: Sequence[AgentLine], measures: Sequence[Measure]) -> str:
    if not measures:
        return ""
    best = {measure.key: _best(lines, measure) for measure in measures}
    headings = ["agent", "episodes", *(measure.heading for measure in measures)]
    return html.table(headings, [_agent_cells(line, measures, best) for line in lines])


def _measured(table: Table, measures: Sequence[Measure]) -> str:
    return _comparison(table.lines, columns_of(table, measures))


def _agent_cells(line: AgentLine, measures: Sequence[Measure], best: Mapping[str, float]) -> list[Cell]:
    cells = [Cell(line.name), Cell(str(line.episodes), line.episodes)]
    for measure in measures:
        value = line.estimates.get(measure.key)
        mean = value.mean if value else None
        is_best = mean is not None and mean == best[measure.key]
        cells.append(Cell(format_estimate(value, measure.digits), mean, is_best))
    return cells


def _best(lines: Sequence[AgentLine], measure: Measure) -> float:
    """Best mean of a measure among the agents that do not know the scene; NaN without a contest."""
    rivals = [line for line in lines if line.agent != ORACLE and measure.key in line.estimates]
    means = [line.estimates[measure.key].mean for line in rivals]
    if measure.is_better_high is None or len(means) < 2:
        return math.nan
    return max(means) if measure.is_better_high else min(means)


def _table_notes(table: Table) -> str:
    general = f"Mean ± {INTERVAL}; bold is the best mean. A click on a heading sorts."
    worst = [
        f"{line.name} {line.worst_scene} ({line.worst_comp_pct:.1f} %)"
        for line in table.lines
        if line.episodes
    ]
    sentences = [general, f"Worst scene: {', '.join(worst)}.", *notes(table)]
    return "".join(map(html.paragraph, sentences))


def _by_scene(rows: Sequence[Row]) -> str:
    groups = {agent_name(*key): group for key, group in group_by_agent(rows).items()}
    scenes = sorted({row["scene"] for row in rows})
    body = []
    for scene in scenes:
        values = [
            estimate([row for row in group if row["scene"] == scene], "comp_pct") for group in groups.values()
        ]
        cells = [Cell(format_estimate(value, 1), value.mean if value else None) for value in values]
        body.append([Cell(scene), *cells])
    note = html.paragraph("Completion ratio (%), mean ± 95 % t-interval over seeds.")
    return html.table(["scene", *groups], body) + note if body else ""


def _differences(table: Table, rows: Sequence[Row]) -> str:
    """Completion of every agent against the best one that does not know the scene."""
    rivals = [line.name for line in table.lines if line.agent != ORACLE and line.episodes]
    if len(rivals) < 2:
        return ""
    differences = paired_differences(rows, rivals[0])
    body = [
        [Cell(name), Cell(format_estimate(value, 1), value.mean), Cell(str(value.count), value.count)]
        for name, value in differences.items()
        if value.count
    ]
    note = f"Completion ratio minus that of {rivals[0]} from the same start, in percentage points."
    return html.table(["agent", "difference", "pairs"], body) + html.paragraph(note)


def _compute(rows: Sequence[Row]) -> str:
    groups = {agent_name(*key): group for key, group in group_by_agent(rows).items()}
    modules = list(dict.fromkeys(module for row in rows for module in row["cpu_ms"] or {}))
    modules = [module for module in modules if module not in ("other", "total")] + ["other", "total"]
    body = [
        [
            Cell(name),
            *(_mean_ms(group, module) for module in modules),
        ]
        for name, group in groups.items()
    ]
    return html.table(["ms per step", *modules], body) if body else ""


def _mean_ms(rows: Sequence[Row], module: str) -> Cell:
    """Mean over the scenes, as elsewhere; an episode without the module spent nothing on it."""
    charged = [{**row, "cpu_ms": {module: 0.0} | row["cpu_ms"]} for row in rows if row["cpu_ms"]]
    value = estimate(charged, f"cpu_ms.{module}")
    if value is None or not any(module in (row["cpu_ms"] or {}) for row in rows):
        return Cell("–")
    return Cell(f"{value.mean:.2f}", value.mean)


def _calibration(out: Path, table: Table, rows: Sequence[Row]) -> str:
    """Whether neural variability tells where a map is wrong; nothing if no agent has a map."""
    lines = [line for line in table.lines if any(m.key in line.estimates for m in CALIBRATION_MEASURES)]
    if not lines:
        return ""
    note = (
        "Over the zero-crossings that a view planner may consider. AUROC: chance that unseen surface has a "
        "higher variability than seen surface, false surface (5 cm or more off) than true; 0.5 is chance. "
        "AUSE: 0 if variability sorts by the true error; chance gives mostly 0.5 to 0.9, as the errors are "
        "spread. Then the map where "
        "it has seen: distance predicted on seen surface, error in crossed free space, share of it taken "
        "for solid."
    )
    groups = {agent_name(*key): gather_reliability(group) for key, group in group_by_agent(rows).items()}
    curves = {name: bins for name, bins in groups.items() if bins}
    picture = reliability_figure(curves, out / "reliability.png") if curves else None
    caption = (
        "True against predicted error of the zero-crossings, gathered by what was predicted; on the line they"
        " are equal. Bars reach from the scene with the least error to the one with the greatest."
    )
    comparison = _comparison(lines, CALIBRATION_MEASURES) + html.paragraph(note)
    return comparison + (html.image(picture, caption) if picture else "") + _reliability(curves)


def _reliability(curves: Mapping[str, Sequence[ReliabilityBin]]) -> str:
    """The picture in numbers."""
    headings = ["agent", "predicted (cm)", "true (cm)", "true / predicted", "by scene", "share (%)"]
    body = [
        [
            Cell(name),
            _number([100.0 * each.predicted_m], 2),
            _number([100.0 * each.error_m], 2),
            _number([each.ratio], 2),
            Cell(f"{each.lowest_ratio:.2f} to {each.highest_ratio:.2f}"),
            _number([each.share_pct], 0),
        ]
        for name, bins in curves.items()
        for each in bins
    ]
    return html.table(headings, body) if body else ""


def _episodes(rows: Sequence[Row]) -> str:
    measures = [m for m in MEASURES if any(not math.isnan(value_of(row, m.key)) for row in rows)]
    headings = ["agent", "scene", "seed", *(measure.heading for measure in measures), "wall (s)"]
    body = []
    for row in rows:
        cells = [Cell(agent_name(row["agent"], row["preset"])), Cell(row["scene"])]
        cells.append(Cell(str(row["seed"]), row["seed"]))
        cells += [_number([value_of(row, measure.key)], measure.digits) for measure in measures]
        body.append([*cells, _number([value_of(row, "wall_s")], 0)])
    return html.table(headings, body)


def _failures(rows: Sequence[Row]) -> str:
    failed = [row for row in rows if row.get("error")]
    body = [
        [
            Cell(agent_name(row["agent"], row["preset"])),
            Cell(row["scene"]),
            Cell(str(row["seed"])),
            Cell(row["error"]),
        ]
        for row in failed
    ]
    return html.table(["agent", "scene", "seed", "error"], body) if body else ""


def _provenance(table: Table, rows: Sequence[Row]) -> str:
    hashes = [(f"settings of {line.name}", line.settings_hash) for line in table.lines]
    versions: dict[str, dict[str, None]] = defaultdict(dict)
    for row in rows:
        for name, value in (row.get("versions") or {}).items():
            versions[name][str(value)] = None
    return html.definitions([*hashes, *((name, ", ".join(values)) for name, values in versions.items())])


def _number(values: Sequence[float], digits: int) -> Cell:
    known = [value for value in values if not math.isnan(value)]
    if not known:
        return Cell("–")
    mean = float(np.mean(known))
    return Cell(f"{mean:.{digits}f}", mean)
