"""The columns of tables: which field of a row, its heading with the unit, which end is good."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

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

ATTRIBUTION_MEASURES: Final = (
    Measure("attribution.stuck_pct", "stuck (%)", 1, False),
    Measure("attribution.unreachable_pct", "unreachable goals (%)", 1, False),
    Measure("attribution.oscillation_pct", "oscillation (%)", 1, False),
    Measure("attribution.phantom_pct", "phantom surface (%)", 1, False),
    Measure("attribution.rotation_pct", "turns (%)", 1),
    Measure("attribution.no_gain_pct", "after the last gain (%)", 1),
)
"""Shares of an episode's steps, see `train.attribution`."""

ALL_MEASURES: Final = MEASURES + OFFICIAL_MEASURES + CALIBRATION_MEASURES + ATTRIBUTION_MEASURES
"""Every measure that is estimated for an agent."""


def agent_name(agent: str, preset: str) -> str:
    """Spell an agent with its preset, if it has one."""
    return f"{agent}:{preset}" if preset else agent


def value_of(row: Mapping[str, Any], key: str) -> float:
    """Read a measure of a row; NaN where it is absent or null."""
    value: Any = row
    for part in key.split("."):
        value = value.get(part) if isinstance(value, Mapping) else None
    return math.nan if value is None else float(value)
