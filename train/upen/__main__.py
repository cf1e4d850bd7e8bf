"""Train UPEN's ensemble of occupancy predictors on walks through procedural homes.

Command: ``python -m train.upen --out runs/upen``. A killed run goes on where it was when started again.
"""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jsonargparse import ActionYesNo, ArgumentParser
from tqdm import tqdm

from agents.occupancy_net import MIN_RESIDUAL_WIDTH
from agents.upen_ensemble import SHIPPED, Ensemble, EnsembleSettings, save_ensemble
from train.batch_learning import follow
from train.command import run_command
from train.option_names import spell_with_dashes
from train.provenance import versions
from train.quick import parse_quick_settings
from train.results import write_json
from train.run_clock import RunClock
from train.run_folder import claim_folder
from train.upen.data import Crops, CropSettings, class_shares, crops_of, test_homes, training_homes
from train.upen.learning import LearningSettings, MemberLearner, homes_of_member
from train.upen.scores import evaluate, format_scores


@dataclass(frozen=True)
class UpenTraining:
    """What is trained, and on what."""

    homes: int = 120
    """Homes to learn from."""
    test_homes: int = 16
    """Homes to evaluate on."""
    seed: int = 0
    """Seeds walks, weights and batches."""
    raster: EnsembleSettings = field(default_factory=EnsembleSettings)
    """The networks and their raster."""
    crops: CropSettings = field(default_factory=CropSettings)
    """How crops are gathered."""
    learning: LearningSettings = field(default_factory=LearningSettings)
    """How members learn."""

    def __post_init__(self) -> None:
        if min(self.homes, self.test_homes) < 1:
            raise ValueError(f"`homes` and `test_homes` must be >= 1, got {self.homes} and {self.test_homes}")
        if self.learning.split == "disjoint" and self.homes < self.raster.members:
            raise ValueError(
                "`homes` must be >= `members` for disjoint splits, "
                f"got {self.homes} and {self.raster.members}"
            )

    def quick(self) -> "UpenTraining":
        """The same with everything so small that it takes seconds."""
        return replace(
            self,
            homes=4,
            test_homes=2,
            raster=replace(self.raster, width=MIN_RESIDUAL_WIDTH),
            crops=replace(self.crops, crops_per_home=10),
            learning=replace(self.learning, passes=400),
        )


def train(training: UpenTraining, out: Path) -> tuple[Ensemble, dict[str, Any]]:
    """Gather, learn and evaluate; whatever lies in `out` already is not done again.

    Args:
        training: What to train.
        out: Folder of the run.

    Returns:
        The ensemble, and its settings, curves, scores and CPU time as plain values.

    Raises:
        ValueError: If `out` holds a run with other settings.
    """
    claim_folder(out, asdict(training))
    clock = RunClock(out)
    seen = _gather(training, training_homes(training.homes), out, "homes to learn from")
    unseen = _gather(training, test_homes(training.test_homes), out, "unseen homes")
    learners = [_learn(training, member, seen, out, clock) for member in range(training.raster.members)]
    ensemble = Ensemble(training.raster, [learner.net for learner in learners])
    majority = int(np.argmax(class_shares(Crops.joined(seen))))
    scores = evaluate(ensemble, Crops.joined(unseen), majority, training.seed)
    curves = [learner.curve for learner in learners]
    settings = json.loads(json.dumps(asdict(training)))
    return ensemble, {
        "settings": settings,
        "curves": curves,
        "scores": scores,
        "cpu_s": clock.keep(),
        "versions": versions(),
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command."""
    options = read_options(arguments)
    training, out = training_of(options), Path(options.out)
    torch.set_num_threads(1)
    ensemble, report = train(training, out)
    save_ensemble(ensemble, out / SHIPPED.name, is_half=True)
    written = [out / "upen.json", *([SHIPPED.with_suffix(".json")] if options.install else [])]
    for path in [*written, *([Path(options.json)] if options.json else [])]:
        write_json(path, report)
    if options.install:
        save_ensemble(ensemble, SHIPPED, is_half=True)
    print(format_scores(report["scores"]))
    print(f"ensemble: {SHIPPED if options.install else out / SHIPPED.name}")


def read_options(arguments: Sequence[str] | None = None) -> Any:
    """Read the command line."""
    return parse_quick_settings(_parser, UpenTraining(), UpenTraining().quick(), arguments)


def training_of(options: Any) -> UpenTraining:
    """Settings of a run from the options of its command line."""
    return UpenTraining(
        homes=options.homes,
        test_homes=options.test_homes,
        seed=options.seed,
        raster=EnsembleSettings(net=options.net, width=options.width, members=options.members),
        crops=CropSettings(crops_per_home=options.crops_per_home),
        learning=LearningSettings(passes=options.passes, split=options.split),
    )


def _gather(training: UpenTraining, homes: Sequence[str], out: Path, title: str) -> list[Crops]:
    """The crops of each home."""
    cache = out / "crops"
    return [
        crops_of(home, training.raster, training.crops, training.seed, cache)
        for home in tqdm(homes, desc=title, unit="home")
    ]


def _learn(
    training: UpenTraining, member: int, seen: Sequence[Crops], out: Path, clock: RunClock
) -> MemberLearner:
    """Train a member, or finish it, or read it where it is finished."""
    settings, path = training.learning, out / "members" / f"{member}.safetensors"
    learner = MemberLearner(training.raster, settings, training.seed, member)
    if path.exists():
        learner.load(path)
    homes = homes_of_member(len(seen), member, training.raster.members, settings, training.seed)
    crops = Crops.joined([seen[index] for index in homes])
    follow(learner, learner.learn(crops), settings.num_batches, path, clock, title=f"member {member}")
    return learner


def _parser(default: UpenTraining) -> ArgumentParser:
    parser = ArgumentParser(prog="python -m train.upen", description=__doc__.splitlines()[0])
    add = parser.add_argument
    add("--homes", type=int, default=default.homes, help="procedural homes to learn from")
    add("--test-homes", type=int, default=default.test_homes, help="procedural homes to evaluate on")
    add("--crops-per-home", type=int, default=default.crops.crops_per_home, help="crops of each home")
    add("--net", default=default.raster.net, help="residual (UPEN's) or plain (OccAnt's)")
    add(
        "--width",
        type=int,
        default=default.raster.width,
        help="channels of the first stage; 64 in the paper's code",
    )
    add("--members", type=int, default=default.raster.members, help="networks of the ensemble")
    add("--passes", type=int, default=default.learning.passes, help="crops that a member looks at")
    add("--split", default=default.learning.split, help="overlap (paper) or disjoint")
    add("--seed", type=int, default=default.seed, help="seeds walks, weights and batches")
    add("--out", default="runs/upen", help="folder of the run; started again, it goes on")
    add("--json", default=None, help="write settings, curves and scores to this file too")
    yes_or_no = ActionYesNo(yes_prefix="", no_prefix="no-")
    add("--quick", action=yes_or_no, default=False, help="a run of seconds, but for what is given")
    add("--install", action=yes_or_no, default=False, help="ship the result")
    return spell_with_dashes(parser)


if __name__ == "__main__":
    run_command(main)
