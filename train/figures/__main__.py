"""Draw the figures of Active Neural Mapping from an episode of our own, or from the rows of a table.

Command: ``python -m train.figures fig4 --scene home:flat:1``; ``all`` draws every figure of one episode,
``fig5`` the curves of all agents.
"""

import json
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from jsonargparse import ArgumentParser
from tqdm import tqdm

from agents.roster import build_agent
from anm_gym.errors import AnmError
from anm_gym.whole_file import write_whole
from train.command import file_stem, run_command, scene_label
from train.episodes import make_env
from train.figures.compute import ComputeTrace
from train.figures.landscape import LandscapeTrace
from train.figures.learning import LearningTrace
from train.figures.map_probe import Drawing, MapProbe, Moment, Numbers, Trace
from train.figures.slices import SlicesTrace
from train.figures.surface import SurfaceTrace
from train.figures.terms import TermsTrace
from train.pool import prepare_worker
from train.provenance import effective_settings, environment_digest, versions
from train.runner import run_episode

QUICK_STEPS: Final = 60
"""Steps of `--quick`, where no others are given."""

MakeTrace = Callable[[int, int], Trace]
"""Makes a figure's trace from the budget of steps and the seed."""

FIGURES: Final[dict[str, MakeTrace]] = {
    "fig2": LandscapeTrace,
    "fig3": SurfaceTrace,
    "fig4": SlicesTrace,
    "fig6": LearningTrace,
    "fig7": ComputeTrace,
    "eq3": TermsTrace,
}
"""Every figure by its name in the paper."""
ALL: Final = "all"
CURVES: Final = "fig5"
"""The figure that is drawn from the rows of a table."""
OF_EPISODES: Final = frozenset({"scene", "preset", "steps", "seed", "env"})
"""Options that choose the episode to play; `CURVES` plays none of its own."""
OF_CURVES: Final = frozenset({"run"})
"""Options of `CURVES` alone."""


@dataclass(frozen=True)
class Request:
    """What to draw, from which episode.

    Raises:
        ValueError: If a figure is unknown, none is named or there is no step.
    """

    names: tuple[str, ...]
    """Figures, in the order of `FIGURES`."""
    scene: str = "home:flat:1"
    """A mesh, a floor plan or a procedural name."""
    preset: str = "best"
    """Preset of the agent `anm`."""
    steps: int = 300
    """Budget of the episode."""
    seed: int = 0
    """Seed of the start and of the agent."""
    out: Path = Path("runs/figures")
    """Folder of the pictures."""
    env_options: dict[str, Any] = field(default_factory=dict)
    """Arguments of the environment besides the scene."""

    def __post_init__(self) -> None:
        unknown = [name for name in self.names if name not in FIGURES]
        if unknown or not self.names:
            choices = ", ".join([*FIGURES, ALL])
            raise ValueError(f"unknown figure {', '.join(unknown)!r}; choose one of: {choices}")
        if self.steps < 1:
            raise ValueError(f"`steps` must be >= 1, got {self.steps}")

    @property
    def stem(self) -> str:
        """Name of the episode in the names of the files."""
        environment = environment_digest(self.env_options)
        return file_stem("anm", self.preset, scene_label(self.scene), self.seed, self.steps, environment)


@dataclass(frozen=True)
class Drawn:
    """What became of one figure."""

    name: str
    """Its name."""
    picture: Path | None
    """The PNG; None if the episode had not what it takes."""
    numbers: Path | None
    """The JSON file."""
    error: str = ""
    """Why there is no picture."""
    gap: str = ""
    """What the picture lacks of what was asked for."""


def draw_figures(request: Request, json_path: Path | None = None) -> list[Drawn]:
    """Play one episode and draw every figure that was asked for.

    Args:
        request: Figures and episode.
        json_path: Where the numbers of a single figure go, instead of beside its picture.

    Returns:
        One entry per figure.

    Raises:
        ValueError: If `json_path` is given for several figures.
    """
    if json_path is not None and len(request.names) > 1:
        raise ValueError(f"`json` must be given for a single figure, got {len(request.names)} figures")
    traces = {name: FIGURES[name](request.steps, request.seed) for name in request.names}
    last, settings = play(request, list(traces.values()))
    results = []
    for name, trace in tqdm(traces.items(), unit="figure", desc="drawing"):
        head = _head(request, name, last, settings)
        results.append(_draw_one(trace, last, request.out / f"{name}_{request.stem}.png", head, json_path))
    last.env.close()
    return results


def play(request: Request, traces: Sequence[Trace]) -> tuple[Moment, dict[str, Any]]:
    """Play the episode with a bar of its progress.

    Returns:
        Its last moment, with the environment open, and the effective settings.
    """
    prepare_worker()
    env = make_env(request.scene, request.steps, request.env_options)
    agent = build_agent(f"anm:{request.preset}", env, request.seed)
    with tqdm(total=request.steps, unit="step", desc="exploring") as bar:
        probe = MapProbe(traces, agent.policy, lambda _: bar.update())
        run_episode(agent.env, agent.policy, request.seed, probe)
    return probe.last, effective_settings(agent.env, agent.policy)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command."""
    options = read_options(arguments)
    json_path = None if options.json is None else Path(options.json)
    if options.figure == CURVES:
        drawn = draw_curves(Path(options.out), options.run, json_path, is_quick=options.quick)
        parts = (f"{drawn.name}: {drawn.picture}", drawn.gap, f"numbers in {drawn.numbers}")
        print(", ".join(part for part in parts if part))
        return
    request = Request(
        names=tuple(FIGURES) if options.figure == ALL else (options.figure,),
        scene=options.scene,
        preset=options.preset,
        steps=options.steps,
        seed=options.seed,
        out=Path(options.out),
        env_options=options.env or {},
    )
    results = draw_figures(request, json_path)
    for result in results:
        if result.picture is not None:
            print(f"{result.name}: {result.picture}, numbers in {result.numbers}")
    failed = [f"{result.name}: {result.error}" for result in results if result.error]
    if failed:
        print("\n".join(f"error: {line}" for line in failed), file=sys.stderr)
        sys.exit(2)


def read_options(arguments: Sequence[str] | None = None) -> Any:
    """Read the command line; options that would do nothing, or harm, end the command, exit code 2.

    Args:
        arguments: Words of the command line; None for those of the process.
    """
    parser = _parser()
    given = parser.parse_args(arguments, defaults=False).as_dict()
    options = parser.parse_args(arguments)
    others = OF_EPISODES if options.figure == CURVES else OF_CURVES
    if useless := [f"--{name}" for name in given if name in others]:
        advice = "the table has its episodes" if options.figure == CURVES else f"only {CURVES} reads a table"
        parser.error(f"{', '.join(useless)} must not be given with {options.figure}: {advice}; leave out")
    if options.quick and "run" in given:
        parser.error(
            "--quick must not come with --run: its short episodes would join the table's; leave one out"
        )
    if options.quick and "steps" not in given:
        options.steps = QUICK_STEPS
    return options


def draw_curves(out: Path, run: str | None, json_path: Path | None, *, is_quick: bool) -> Drawn:
    """Draw the completion curves of all agents of a table.

    Args:
        out: Folder of the picture.
        run: Folder of the table's rows; None for that of ``train.tables table1``, as it has to be for the
            quick table, whose short episodes would join those of a folder that is given.
        json_path: Where the numbers go, instead of beside the picture.
        is_quick: Whether to play the quick table first, where it has not been.

    Raises:
        FileNotFoundError: If there are no rows, or none of them has a curve or its trajectory.
    """
    from train.figures.curves import gather_curves
    from train.tables.__main__ import play_command

    folder = Path(run or Path("runs") / "table1" / ("open-homes-quick" if is_quick else "open-homes"))
    if is_quick:
        play_command(["table1", "--quick", "--out", str(folder)])
    curves = gather_curves(folder)
    picture = curves.draw(out / f"{CURVES}_{curves.protocol}.png")
    numbers = json_path or picture.with_suffix(".json")
    return Drawn(CURVES, picture, _write_numbers(numbers, curves.numbers()), gap=curves.gap)


def _write_numbers(path: Path, numbers: Numbers) -> Path:
    write_whole(path, json.dumps(plain(numbers), allow_nan=False) + "\n")
    return path


def _draw_one(trace: Trace, last: Moment, picture: Path, head: Numbers, json_path: Path | None) -> Drawn:
    name = head["figure"]
    try:
        drawing: Drawing = trace.finish(last)
    except AnmError as error:
        return Drawn(name, None, None, f"{type(error).__name__}: {error}")
    numbers = json_path or picture.with_suffix(".json")
    _write_numbers(numbers, head | {"data": drawing.numbers()})
    return Drawn(name, drawing.draw(picture), numbers)


def plain(value: Any) -> Any:
    """Turn arrays into lists and values that are not finite into null; floats keep six digits."""
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, np.ndarray | list | tuple):
        return [plain(entry) for entry in (value.tolist() if isinstance(value, np.ndarray) else value)]
    if isinstance(value, float | np.floating):
        return float(f"{value:.6g}") if np.isfinite(value) else None
    return value.item() if isinstance(value, np.generic) else value


def _head(request: Request, name: str, last: Moment, settings: dict[str, Any]) -> Numbers:
    return {
        "figure": name,
        "scene": scene_label(request.scene),
        "agent": f"anm:{request.preset}",
        "seed": request.seed,
        "steps": request.steps,
        "steps_done": last.step,
        "settings": settings,
        "versions": versions(),
    }


def _parser() -> ArgumentParser:
    parser = ArgumentParser(prog="python -m train.figures", description=__doc__.splitlines()[0])
    add = parser.add_argument
    add("figure", choices=[*FIGURES, CURVES, ALL], help="which figure; 'all' draws every one of one episode")
    add("--scene", default="home:flat:1", help="a mesh, a floor plan or a procedural name")
    add("--preset", default="best", help="preset of the agent anm: best, fast, paper or released")
    add("--steps", type=int, default=300, help="budget of the episode")
    add("--seed", type=int, default=0, help="seed of the start and of the agent")
    add("--out", default="runs/figures", help="folder of the pictures and of their numbers")
    add("--json", default=None, help="where the numbers of a single figure go")
    add("--env", type=dict | None, default=None, help="arguments of the environment, such as a camera")
    add("--run", default=None, help=f"for {CURVES}: folder of a table's rows; runs/table1/open-homes")
    add("--quick", action="store_true", help=f"{QUICK_STEPS} steps; for {CURVES} the quick table")
    return parser


if __name__ == "__main__":
    run_command(main)
