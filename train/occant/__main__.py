"""Train OccAnt, or ANS with --no-anticipation: first what completes looks, then what chooses goals.

Command: ``python -m train.occant --out runs/occant``. A killed run goes on where it was when started again.
"""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import torch
from jsonargparse import ActionYesNo, ArgumentParser
from tqdm import tqdm

from agents.goal_net import GoalNet
from agents.occant_model import Anticipator, OccAntModel, OccAntSettings, save_model
from agents.weights_file import WEIGHTS_FOLDER
from train.batch_learning import follow
from train.command import run_command
from train.occant.anticipator import (
    AnticipatorLearner,
    AnticipatorLearning,
    format_anticipation,
    score_anticipator,
)
from train.occant.frames import Frames, FrameSettings, frames_of, training_homes, unseen_homes
from train.occant.goal_gains import GainLearner, GainLearning, gains_of
from train.occant.goal_learning import GoalLearner, GoalLearning, coverage, policy_chooser, random_chooser
from train.occant.twin import Reward, TwinSettings
from train.occant.twin_world import TwinWorld
from train.option_names import spell_with_dashes
from train.provenance import versions
from train.quick import parse_quick_settings
from train.results import write_json
from train.run_clock import RunClock
from train.run_folder import claim_folder


@dataclass(frozen=True)
class OccAntTraining:
    """What is trained, and on what."""

    model: OccAntSettings = field(default_factory=OccAntSettings)
    """The networks and their maps."""
    frame_homes: int = 50
    """Homes that the anticipator learns from."""
    test_homes: int = 12
    """Homes to evaluate both on."""
    frames: FrameSettings = field(default_factory=FrameSettings)
    """How the anticipator's frames are gathered."""
    anticipator: AnticipatorLearning = field(default_factory=AnticipatorLearning)
    """How the anticipator learns."""
    goal_homes: int = 60
    """Homes that the global policy learns in."""
    reward: Reward = "map_accuracy"
    """What the global policy is paid for; `area_seen` for ANS."""
    gains: GainLearning = field(default_factory=GainLearning)
    """How the global policy first learns what goals are worth."""
    goals: GoalLearning = field(default_factory=GoalLearning)
    """How the global policy learns."""
    test_episodes: int = 48
    """Episodes in which the global policy is evaluated."""
    seed: int = 0
    """Seeds everything."""

    def __post_init__(self) -> None:
        if min(self.frame_homes, self.test_homes, self.goal_homes, self.test_episodes) < 1:
            raise ValueError("`frame_homes`, `test_homes`, `goal_homes` and `test_episodes` must be >= 1")
        if self.goals.updates <= self.goals.value_updates:
            raise ValueError(
                f"`updates` must be > {self.goals.value_updates}, in which only the critic learns, "
                f"got {self.goals.updates}"
            )
        _ = self.twin  # checks the reward before anything is trained

    @property
    def twin(self) -> TwinSettings:
        """The episodes of the global policy."""
        return TwinSettings(
            self.model.layout,
            self.model.projection,
            self.reward,
            look_every_steps=self.model.look_every_steps,
        )

    def quick(self) -> "OccAntTraining":
        """The same with everything so small that it takes seconds."""
        return replace(
            self,
            model=replace(self.model, width=4),
            frame_homes=3,
            test_homes=2,
            frames=replace(self.frames, frames_per_home=30),
            anticipator=replace(self.anticipator, passes=1000),
            goal_homes=3,
            gains=replace(self.gains, episodes=4, passes=256),
            goals=replace(self.goals, updates=3, value_updates=1, envs=4),
            test_episodes=4,
        )


def train(training: OccAntTraining, out: Path) -> tuple[OccAntModel, dict[str, Any]]:
    """Gather, learn and evaluate; whatever lies in `out` already is not done again.

    Args:
        training: What to train.
        out: Folder of the run.

    Returns:
        The model, and its settings, curves, scores and CPU time as plain values.

    Raises:
        ValueError: If `out` holds a run with other settings.
    """
    claim_folder(out, asdict(training))
    report: dict[str, Any] = {"settings": json.loads(json.dumps(asdict(training))), "versions": versions()}
    clock, anticipator = RunClock(out), None
    if training.model.anticipates:
        anticipator, report["anticipator"] = _learn_to_anticipate(training, out, clock)
    learner, report["policy"] = _learn_to_choose(training, anticipator, out, clock)
    report["cpu_s"] = clock.keep()
    return OccAntModel(training.model, learner.goal_net, anticipator), report


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command."""
    options = read_options(arguments)
    training = training_of(options)
    out, name = Path(options.out), "occant" if training.model.anticipates else "ans"
    torch.set_num_threads(1)
    model, report = train(training, out)
    folders = [out, *([WEIGHTS_FOLDER] if options.install else [])]
    for folder in folders:
        save_model(model, folder / f"{name}.safetensors")
    for path in [*(folder / f"{name}.json" for folder in folders), *_paths(options.json)]:
        write_json(path, report)
    if "anticipator" in report:
        print(format_anticipation(report["anticipator"]["scores"]))
    print(format_coverage(report["policy"]))
    print(f"model: {folders[-1] / name}.safetensors")


def format_coverage(policy: dict[str, Any]) -> str:
    """Lay the curve of learning and of coverage out as tables."""
    gains = [point["gain_m2"] for point in policy["curve"]]
    parts = [
        gains[len(gains) * i // 5 : max(len(gains) * (i + 1) // 5, len(gains) * i // 5 + 1)] for i in range(5)
    ]
    means = "  ".join(f"{sum(part) / len(part):.1f}" for part in parts if part)
    lines = [f"paid for, square metres an episode, by fifths of training: {means}", ""]
    count = len(next(iter(policy["coverage"].values()))) - 1
    goals = [round(count * part / 6) for part in range(7)]
    steps = [policy["steps_per_goal"] * number for number in goals]
    lines.append(f"{'layout seen, %, after steps':32}" + "".join(f"{step:>7}" for step in steps) + "   mean")
    for name, shares in policy["coverage"].items():
        cells = [*(shares[number] for number in goals), sum(shares) / len(shares)]
        lines.append(f"{name:32}" + "".join(f"{100.0 * cell:7.1f}" for cell in cells))
    return "\n".join(lines)


def _learn_to_anticipate(
    training: OccAntTraining, out: Path, clock: RunClock
) -> tuple[Anticipator, dict[str, Any]]:
    learner, path = (
        AnticipatorLearner(training.model, training.anticipator, training.seed),
        out / "anticipator.safetensors",
    )
    if path.exists():
        learner.load(path)
    if learner.num_done < training.anticipator.num_batches:
        seen = _gather(training, training_homes(training.frame_homes), out, "homes to learn from")
        total = training.anticipator.num_batches
        follow(learner, learner.learn(seen), total, path, clock, title="anticipator")
    unseen = _gather(training, unseen_homes(training.test_homes), out, "unseen homes")
    anticipator = learner.anticipator()
    return anticipator, {"curve": learner.curve, "scores": score_anticipator(anticipator, unseen)}


def _learn_to_choose(
    training: OccAntTraining, anticipator: Anticipator | None, out: Path, clock: RunClock
) -> tuple[GoalLearner, dict[str, Any]]:
    names = training_homes(training.goal_homes)
    worlds = _worlds(training, names, "homes to explore")
    start, errors = _learn_gains(training, worlds, anticipator, out, clock)
    settings, seed = training.goals, training.seed
    learner = GoalLearner(training.model, training.twin, settings, worlds, anticipator, seed, start)
    path = out / "policy.safetensors"
    if path.exists():
        learner.load(path)
    follow(learner, learner.learn(), training.goals.updates, path, clock, title="policy", unit="update")
    unseen = _worlds(training, unseen_homes(training.test_homes), "unseen homes")
    choosers = {
        "random goals": random_chooser(training.model.layout.num_goals),
        **({"before PPO, drawn": policy_chooser(start, samples=True)} if start else {}),
        "policy, drawn": policy_chooser(learner.goal_net, samples=True),
        "policy, likeliest": policy_chooser(learner.goal_net, samples=False),
    }
    curves = {
        name: coverage(choose, unseen, training.twin, anticipator, training.test_episodes, training.seed)
        for name, choose in tqdm(choosers.items(), desc="coverage", unit="policy")
    }
    steps = training.twin.steps_per_goal
    return learner, {"gains": errors, "curve": learner.curve, "coverage": curves, "steps_per_goal": steps}


def _learn_gains(
    training: OccAntTraining,
    worlds: Sequence[TwinWorld],
    anticipator: Anticipator | None,
    out: Path,
    clock: RunClock,
) -> tuple[GoalNet | None, list[float]]:
    """Learn what goals are worth; None if there are no random ones to learn from."""
    settings, path = training.gains, out / "gains.safetensors"
    if settings.episodes == 0:
        return None, []
    learner = GainLearner(training.model, settings, training.seed)
    if path.exists():
        learner.load(path)
    if learner.num_done < settings.num_batches:
        kept = out / "random_goals.safetensors"
        gains = gains_of(worlds, training.twin, anticipator, settings.episodes, training.seed, kept)
        follow(learner, learner.learn(gains), settings.num_batches, path, clock, title="gains")
    return learner.goal_net(), learner.curve


def _gather(training: OccAntTraining, homes: Sequence[str], out: Path, title: str) -> Frames:
    parts = [
        frames_of(home, training.model, training.frames, training.seed, out / "frames")
        for home in tqdm(homes, desc=title, unit="home")
    ]
    return Frames.joined(parts)


def _worlds(training: OccAntTraining, homes: Sequence[str], title: str) -> list[TwinWorld]:
    cell_m = training.model.layout.cell_m
    return [TwinWorld.of(home, cell_m) for home in tqdm(homes, desc=title, unit="home")]


def _paths(text: str | None) -> list[Path]:
    return [Path(text)] if text else []


def read_options(arguments: Sequence[str] | None = None) -> Any:
    """Read the command line."""
    return parse_quick_settings(_parser, OccAntTraining(), OccAntTraining().quick(), arguments)


def training_of(options: Any) -> OccAntTraining:
    """Settings of a run from the options of its command line."""
    default = OccAntTraining()
    return OccAntTraining(
        model=replace(default.model, anticipates=options.anticipation, width=options.width),
        frame_homes=options.frame_homes,
        test_homes=options.test_homes,
        frames=replace(default.frames, frames_per_home=options.frames_per_home),
        anticipator=replace(default.anticipator, passes=options.passes),
        goal_homes=options.goal_homes,
        reward=options.reward or ("map_accuracy" if options.anticipation else "area_seen"),
        gains=replace(default.gains, episodes=options.gain_episodes, passes=options.gain_passes),
        goals=replace(
            default.goals, updates=options.updates, value_updates=options.value_updates, envs=options.envs
        ),
        test_episodes=options.test_episodes,
        seed=options.seed,
    )


def _parser(default: OccAntTraining) -> ArgumentParser:
    parser = ArgumentParser(prog="python -m train.occant", description=__doc__.splitlines()[0])
    add = parser.add_argument
    yes_or_no = ActionYesNo(yes_prefix="", no_prefix="no-")
    add(
        "--anticipation",
        action=yes_or_no,
        default=True,
        help="complete what is seen (OccAnt), or do not (ANS)",
    )
    add("--reward", default=None, help="map_accuracy (default with anticipation) or area_seen")
    add(
        "--width", type=int, default=default.model.width, help="channels of the U-Net; 16 in the paper's code"
    )
    add("--frame-homes", type=int, default=default.frame_homes, help="homes the anticipator learns from")
    add("--frames-per-home", type=int, default=default.frames.frames_per_home, help="looks at each of them")
    add("--passes", type=int, default=default.anticipator.passes, help="frames the anticipator looks at")
    add("--goal-homes", type=int, default=default.goal_homes, help="homes the global policy learns in")
    add(
        "--gain-episodes",
        type=int,
        default=default.gains.episodes,
        help="episodes of random goals that the global policy starts from; 0 for none",
    )
    add("--gain-passes", type=int, default=default.gains.passes, help="random goals it looks at")
    add("--updates", type=int, default=default.goals.updates, help="PPO updates of the global policy")
    add(
        "--value-updates",
        type=int,
        default=default.goals.value_updates,
        help="updates at the start in which only the critic learns",
    )
    add("--envs", type=int, default=default.goals.envs, help="episodes of an update")
    add("--test-homes", type=int, default=default.test_homes, help="homes to evaluate on")
    add("--test-episodes", type=int, default=default.test_episodes, help="episodes to evaluate in")
    add("--seed", type=int, default=default.seed, help="seeds everything")
    add("--out", default="runs/occant", help="folder of the run; started again, it goes on")
    add("--json", default=None, help="write settings, curves and scores to this file too")
    add("--quick", action=yes_or_no, default=False, help="a run of seconds, but for what is given")
    add("--install", action=yes_or_no, default=False, help="ship the result")
    return spell_with_dashes(parser)


if __name__ == "__main__":
    run_command(main)
