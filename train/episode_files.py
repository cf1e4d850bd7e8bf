"""Draw point-goal episodes in scenes and write them as a dataset in Habitat's layout.

Command: ``python -m train.episode_files --scenes home:studio:1,home:flat:2 --episodes 100``.
"""

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from jsonargparse import ArgumentParser
from tqdm import tqdm

from anm_gym.envs.episode_files import write_episodes
from anm_gym.envs.goals import GoalRange
from anm_gym.envs.options import read_names
from anm_gym.envs.pointnav_episodes import PointNavEpisode, draw_episodes
from train.command import run_command, split_list
from train.option_names import spell_with_dashes
from train.quick import add_quick_option, parse_quick
from train.results import write_json

OUT: Final = "runs/pointnav"
"""Folder of the dataset, if no other is given."""
QUICK_EPISODES: Final = 3
"""Episodes in each scene under `--quick`."""


@dataclass(frozen=True)
class Dataset:
    """What to draw and where to write it."""

    scenes: Sequence[str]
    """Mesh files below `scenes_dir`, or procedural names."""
    episodes: int = 100
    """Episodes in each scene."""
    seed: int = 0
    """Seeds the draws; a scene's draws depend on its place in the list, not on the scenes after it."""
    split: str = "val"
    """Name of the split: `train`, `val` or any other."""
    out: Path = Path("runs/pointnav")
    """Folder of the dataset; the split goes into a folder of its own."""
    scenes_dir: Path = Path()
    """Folder of the mesh files; `scene_id` is written without it."""
    scene_options: dict[str, Any] = field(default_factory=dict)
    """Keywords for mesh files, such as `up_axis` and `storey`."""
    min_distance_m: float = 1.0
    """Shortest geodesic distance, metres."""
    max_distance_m: float = 30.0
    """Longest geodesic distance, metres."""

    def __post_init__(self) -> None:
        names = read_names("scenes", self.scenes)
        if not names:
            raise ValueError("`scenes` must name at least one")
        name, count = Counter(names).most_common(1)[0]
        if count > 1:
            raise ValueError(
                f"`scenes` must name each scene once, got {name} {count} times; raise `episodes`"
            )
        if self.episodes < 1:
            raise ValueError(f"`episodes` must be >= 1, got {self.episodes}")
        if self.split in ("", "..") or Path(self.split).name != self.split:
            raise ValueError(f"`split` must be a plain name, got {self.split!r}")

    @property
    def path(self) -> Path:
        """The file of the split."""
        return self.out / self.split / f"{self.split}.json.gz"

    def draw(self) -> Iterator[PointNavEpisode]:
        """Draw the episodes, scene after scene."""
        limits = GoalRange(self.min_distance_m, self.max_distance_m)
        for index, scene in enumerate(self.scenes):
            yield from draw_episodes(
                scene,
                self.episodes,
                np.random.default_rng([self.seed, index]),
                limits=limits,
                scenes_dir=self.scenes_dir,
                scene_options=self.scene_options,
            )


def write_dataset(dataset: Dataset) -> dict[str, Any]:
    """Draw and write a dataset.

    Args:
        dataset: What to draw and where to write it.

    Returns:
        The split's file and, for each scene, the episodes and their geodesic distances in metres.
    """
    total = len(dataset.scenes) * dataset.episodes
    drawn = list(tqdm(dataset.draw(), total=total, unit="episode", delay=1.0))
    write_episodes(dataset.path, drawn)
    distances_m = defaultdict(list)
    for episode in drawn:
        distances_m[episode.scene_id].append(episode.geodesic_distance_m)
    scenes = {
        scene: {
            "episodes": len(found),
            "shortest_m": round(min(found), 3),
            "mean_m": round(float(np.mean(found)), 3),
            "longest_m": round(max(found), 3),
        }
        for scene, found in distances_m.items()
    }
    return {"path": str(dataset.path), "scenes": scenes}


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command and print a line for each scene."""
    options = parse_quick(_parser(), arguments, episodes=QUICK_EPISODES, out=f"{OUT}-quick")
    dataset = Dataset(
        scenes=split_list(options.scenes),
        episodes=options.episodes,
        seed=options.seed,
        split=options.split,
        out=Path(options.out),
        scenes_dir=Path(options.scenes_dir),
        scene_options=options.scene_options or {},
        min_distance_m=options.min_distance_m,
        max_distance_m=options.max_distance_m,
    )
    summary = write_dataset(dataset)
    print(f"{'scene':<28}{'episodes':>9}{'shortest (m)':>14}{'mean (m)':>10}{'longest (m)':>13}")
    for scene, row in summary["scenes"].items():
        distances = f"{row['shortest_m']:>14.2f}{row['mean_m']:>10.2f}{row['longest_m']:>13.2f}"
        print(f"{scene:<28}{row['episodes']:>9}{distances}")
    print(f"dataset: {summary['path']}")
    if options.json:
        write_json(Path(options.json), summary)


def _parser() -> ArgumentParser:
    parser = ArgumentParser(prog="python -m train.episode_files", description=__doc__.splitlines()[0])
    add = parser.add_argument
    add("--config", action="config", help="YAML file with any of these options")
    add("--scenes", nargs="+", default=["home:studio:1"], help="meshes below scenes_dir, or procedural names")
    add("--episodes", type=int, default=100, help="episodes in each scene")
    add("--seed", type=int, default=0, help="seed of the draws")
    add("--split", default="val", help="name of the split")
    add("--out", default=OUT, help="folder of the dataset")
    add("--scenes-dir", default=".", help="folder of the mesh files")
    add("--scene-options", type=dict | None, default=None, help="keywords for mesh files, such as up_axis")
    add("--min-distance-m", type=float, default=1.0, help="shortest geodesic distance, metres")
    add("--max-distance-m", type=float, default=30.0, help="longest geodesic distance, metres")
    add_quick_option(parser, f"{QUICK_EPISODES} episodes in each scene, in a folder of their own")
    add("--json", default=None, help="write the printed table to this file")
    return spell_with_dashes(parser)


if __name__ == "__main__":
    run_command(main)
