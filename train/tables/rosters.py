"""Who is in the paper's tables, and which columns they have."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from train.tables.measures import MEASURES, OFFICIAL_MEASURES, ORACLE, Measure

CRITERIA: Final = ("variance", "count", "distance")
"""Choices of a target among clusters that the paper compares (Table 2, Module 2)."""
DRIVERS: Final = ("ddppo-plus", "ddppo-star", "oracle")
"""Navigators beside the planner (Table 2, Module 3)."""


@dataclass(frozen=True)
class Entry:
    """One line that a table should have."""

    agent: str
    """Spelling of the agent; `{preset}` stands for the preset of `anm`."""
    role: str = ""
    """What the line shows, where the agent's name does not say it."""


@dataclass(frozen=True)
class TableSpec:
    """What a table is made of."""

    title: str
    """What it compares."""
    entries: tuple[Entry, ...]
    """Its lines."""
    native: tuple[str, ...]
    """Keys of the exact measures among its columns."""
    official: tuple[str, ...]
    """Keys of the same measures as the released evaluation computes them."""
    reference: str = "anm:{preset}"
    """Whom the others are compared with, start by start."""

    def columns(self, keys: Sequence[str]) -> list[Measure]:
        """Look the measures up by key."""
        known = {measure.key: measure for measure in MEASURES + OFFICIAL_MEASURES}
        return [known[key] for key in keys]

    def agents(self, preset: str) -> list[str]:
        """Spell the agents of all lines."""
        return [entry.agent.format(preset=preset) for entry in self.entries]

    def role_of(self, agent: str, preset: str) -> str:
        """Tell what an agent stands for in this table; empty if its name says it."""
        roles = {entry.agent.format(preset=preset): entry.role for entry in self.entries}
        return roles.get(agent, "")


TABLES: Final = {
    "table1": TableSpec(
        "Table 1: coverage of the actively captured data",
        tuple(
            map(
                Entry,
                (
                    *("random", "fbe:paper", "fbe:strong", "upen", "occant", "ans", "nbv", "rh_nbv"),
                    *("random_vertex", "voronoi", "anm:{preset}", ORACLE),
                ),
            )
        ),
        native=(
            *("comp_pct", "comp_cm", "comp_auc", "comp_auc_m", "comp_visible_pct", "oracle_share_pct"),
            *("path_m", "collisions", "cpu_ms.total"),
        ),
        official=("comp_pct_official", "comp_cm_official"),
    ),
    "table2": TableSpec(
        "Table 2: substitutes for the modules of Active Neural Mapping",
        (
            Entry("random"),
            Entry("anm:{preset}+dropout", "Module 1: dropout instead of perturbed weights"),
            *(Entry(f"anm:{{preset}}+select={name}", "Module 2: another choice") for name in CRITERIA),
            *(Entry(f"anm:{{preset}}+nav={name}", "Module 3: another navigator") for name in DRIVERS),
            Entry("anm:{preset}+relu", "Module 4: ReLU network with positional encoding"),
            Entry("anm:{preset}", "Ours"),
        ),
        native=("mad_cm", "fpr_pct", "comp_pct", "comp_cm", "comp_auc", "cpu_ms.total"),
        official=("mad_cm_official", "fpr_pct_official", "comp_pct_official", "comp_cm_official"),
    ),
}
"""The tables of Active Neural Mapping; the lines and columns that the paper has not are ours."""
