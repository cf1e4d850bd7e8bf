"""The episodes of a table: agents x scenes x seeds of a protocol, each from its published start."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

from train.backends import Backend
from train.episodes import Job, split_agent
from train.play import play_missing
from train.protocols import Protocol
from train.provenance import scenes_root
from train.quick import STEPS
from train.results import Row
from train.run_folder import hold_folder
from train.starts import SceneStarts, StartTable, starts_for

QUICK_STEPS: Final = {"table1": STEPS, "table2": 4}
"""Budget of `--quick`: choosing among clusters takes seconds a step where a map has hardly begun."""
QUICK_SEEDS: Final = {"table1": (0, 1), "table2": (0,)}
"""Seeds of `--quick`: two have an interval, but scoring the maps of Table 2 takes too long for two."""


@dataclass(frozen=True)
class TableRun:
    """What to play for a table.

    Raises:
        ValueError: If no agent or seed is named, or one twice.
    """

    agents: Sequence[str]
    """Agents of the roster."""
    protocol: Protocol
    """Scenes and budgets."""
    seeds: Sequence[int]
    """One episode per agent, scene and seed."""
    out: Path
    """Folder of the rows."""
    env_options: Mapping[str, Any] = field(default_factory=dict)
    """Arguments of the environment besides the scene."""
    with_pictures: bool = True
    """Whether to draw every episode."""
    with_maps: bool = True
    """Whether to score neural maps."""

    def __post_init__(self) -> None:
        named: dict[str, list[Any]] = {
            "agents": [split_agent(agent) for agent in self.agents],
            "seeds": list(self.seeds),
        }
        for name, values in named.items():
            if not values or len(set(values)) != len(values):
                raise ValueError(f"`{name}` must name at least one and none twice, got {getattr(self, name)}")

    def jobs(self, starts: StartTable) -> list[Job]:
        """List the episodes, scene by scene, so that a worker keeps a scene it has loaded."""
        none = SceneStarts("")
        return [
            Job(
                *split_agent(agent),
                scene.name,
                seed,
                scene.steps,
                self.out.resolve(),
                dict(self.env_options),
                with_maps=self.with_maps,
                with_pictures=self.with_pictures,
                conditions=self.protocol.name,
                start=starts.get(scene.label, none).by_seed.get(seed),
                geometry=starts.get(scene.label, none).geometry,
            )
            for scene in self.protocol.scenes
            for seed in self.seeds
            for agent in self.agents
        ]


def play_table(run: TableRun, backend: Backend) -> list[Row]:
    """Play what has no row yet; the folder also holds the settings and the starts.

    Args:
        run: What to play.
        backend: Where.

    Returns:
        The rows of exactly these episodes.

    Raises:
        SceneError: If scenes of the protocol are missing.
        ValueError: As `play_missing` raises it.
    """
    run.protocol.require_scenes(scenes_root(run.env_options))
    hold_folder(run.out)
    starts = starts_for(run.protocol, run.seeds, run.out, run.env_options)
    return play_missing(run.jobs(starts), run.out, asdict(run), backend)
