"""The report's section on failures: by agent, by episode, and each episode's trail on its map."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from train import html
from train.attribution import CAUSES, NO_CAUSE, module_shares_pct
from train.html import Cell
from train.results import Row
from train.tables.measures import agent_name, value_of

NOTE: Final = (
    "Shares of an episode's steps; one step may count for several causes. Stuck: contacts, and no way out "
    "for 20 steps. Unreachable goals: steps towards goals that were given up. Oscillation: away and back, or "
    "turned and turned back, within 100 steps and for nothing new, which is less than half a square metre "
    "of surface. Phantom surface: steps towards goals that were reached and showed nothing new. After the "
    "last gain: steps when all but half a point of the final completion was reached. The main cause is the "
    "one with most steps, if it took a tenth of them."
)
PICTURES_NOTE: Final = (
    "The trail from dark (early) to bright (late) on the map as it was at the end: white is floor that the "
    "agent knew, grey what it did not; of agents without a map all floor is white. Dots are goals, red "
    "crosses goals given up, red discs places where it was stuck."
)


def attribution_body(out: Path, rows: Sequence[Row], by_agent: str) -> str:
    """Write the section.

    Args:
        out: The run's folder, with the pictures.
        rows: Rows of episodes that ended without an error.
        by_agent: The comparison of agents, already written.

    Returns:
        HTML; empty if there is nothing to show.
    """
    known = [row for row in rows if row.get("attribution")]
    parts = [by_agent + html.paragraph(NOTE), _episodes(known)] if known else []
    images = [
        html.image(out / picture, caption(row))
        for row in rows
        for picture in (row.get("pictures") or {}).values()
    ]
    if any(images):
        parts += [html.gallery(images), html.paragraph(PICTURES_NOTE)]
    return "".join(parts)


def caption(row: Row) -> str:
    """Say in a line what an episode came to and what took its steps."""
    name = agent_name(row["agent"], row["preset"])
    head = f"{name}, {row['scene']}, seed {row['seed']}: {value_of(row, 'comp_pct'):.1f} %"
    attribution = row.get("attribution") or {}
    shares = {cause: attribution.get(key) or 0.0 for key, cause in CAUSES.items()}
    named = [f"{cause} {share:.0f} %" for cause, share in shares.items() if share >= 1.0]
    return "; ".join([head, *named])


def _episodes(rows: Sequence[Row]) -> str:
    headings = ["agent", "scene", "seed", "main cause", *(f"{cause} (%)" for cause in CAUSES.values())]
    headings += ["turns (%)", "goals", "given up", "why", "CPU by module"]
    return html.table(headings, [_cells(row) for row in rows])


def _cells(row: Row) -> list[Cell]:
    found: Mapping[str, Any] = row["attribution"]
    cells = [Cell(agent_name(row["agent"], row["preset"])), Cell(row["scene"])]
    cells += [Cell(str(row["seed"]), row["seed"]), Cell(found["main_cause"], None, _is_failure(found))]
    for key in (*CAUSES, "rotation_pct"):
        cells.append(_number(value_of(found, key), 1))
    cells += [_number(value_of(found, "goals"), 0), _number(value_of(found, "goals_failed"), 0)]
    reasons = ", ".join(f"{reason}: {count}" for reason, count in found["failure_reasons"].items())
    return [*cells, Cell(reasons or "–"), Cell(_modules(row.get("cpu_ms") or {}))]


def _is_failure(found: Mapping[str, Any]) -> bool:
    return bool(found["main_cause"] != NO_CAUSE)


def _modules(cpu_ms: Mapping[str, float]) -> str:
    """The three modules that took most of the CPU time."""
    shares_pct = module_shares_pct(cpu_ms)
    largest = sorted(shares_pct, key=lambda name: -shares_pct[name])[:3]
    return ", ".join(f"{name} {shares_pct[name]:.0f} %" for name in largest)


def _number(value: float, digits: int) -> Cell:
    return Cell("–") if math.isnan(value) else Cell(f"{value:.{digits}f}", value)
