"""Navigators compared on point-goal episodes: `python -m train.navigator --evaluate`."""

from collections import Counter
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Final

from tqdm import tqdm

from agents.learned_navigator import LearnedSettings
from agents.navigators import LEARNED, NAVIGATORS
from agents.policy_file import load_policy, policy_identity
from anm_gym.metrics.intervals import mean_interval, wilson_interval
from anm_gym.scenes.catalog import takes_options
from train.command import check_scene_names, scene_label
from train.navigator.driven import play_driven
from train.navigator.episodes import NavigationEpisode, episodes_of, play_learned
from train.pool import run_jobs
from train.provenance import check_scene_files, digest, file_digest, versions
from train.results import SCENE_FILE, Row, append_row, read_rows, row_key, write_json
from train.run_folder import hold_folder
from train.tables.text import aligned

IMAGE_PX: Final = 64
"""Rows and columns of everyone's depth image."""
ALL: Final = "all"
"""Stands for all scenes together."""
SCENE_OPTIONS: Final = "scene_options"
"""Where a row has the keywords with which its mesh was read, if there were any."""
KEY: Final = ("navigator", "weights", "scene", "seed", "step_m", "draws")


@dataclass(frozen=True)
class NavigationComparison:
    """What to compare."""

    navigators: Sequence[str]
    """Names of navigators, or files of trained policies."""
    scenes: Sequence[str]
    """Names or paths of scenes."""
    episodes: int
    """Episodes of every navigator, spread over the scenes."""
    step_m: float
    """Length of a forward step, metres."""
    deterministic: bool
    """Whether learned navigators take the likeliest action."""
    workers: int = 2
    """Processes."""
    scene_options: Mapping[str, Any] = field(default_factory=dict)
    """Keywords for mesh files, such as `unit`."""
    out: Path = field(default_factory=lambda: Path("runs/navigator"))
    """Folder of the rows; started again, it goes on."""

    def __post_init__(self) -> None:
        for name in self.navigators:
            if name not in NAVIGATORS and not Path(name).exists():
                known = ", ".join(sorted(NAVIGATORS))
                raise ValueError(f"unknown navigator {name!r}; choose one of: {known}, or give a file")
        if len(set(self.navigators)) != len(self.navigators):
            raise ValueError(f"`navigators` must differ, got {', '.join(self.navigators)}")
        if self.deterministic and (
            drawing := [name for name in self.navigators if name in LEARNED and _weights_of(name) is None]
        ):
            raise ValueError(
                f"`navigators` must not name {', '.join(drawing)} where the likeliest actions are asked for: "
                "drawing is part of what they are"
            )
        check_scene_names(self.scenes)
        count = len(self.scenes)
        if self.episodes < count:
            raise ValueError(f"`episodes` must be >= 1 for each of {count} scenes, got {self.episodes}")


@dataclass(frozen=True)
class Job:
    """Episodes of one navigator in one scene: all of them if it plays many at a time, else a single one."""

    navigator: str
    """Its name, or a file."""
    deterministic: bool
    """Whether it takes the likeliest action."""
    episodes: tuple[NavigationEpisode, ...]
    """What to play."""
    weights: str = ""
    """See `policy_digest`; found once for all jobs, as it reads the weights."""


def compare_navigators(comparison: NavigationComparison, json_path: Path | None = None) -> list[Row]:
    """Play what is missing, print the table and write it.

    Args:
        comparison: What to compare.
        json_path: Where the table goes as JSON; None for nowhere.

    Returns:
        The lines of the table: one per navigator and scene, and one per navigator for all scenes.

    Raises:
        ValueError: If there are rows of a scene that is another file by now, or was read with other options,
            or another process plays into the folder.
    """
    path = comparison.out / "episodes.jsonl"
    rows = {row_key(row, KEY): row for row in read_rows(path, KEY)}
    check_scene_files(comparison.scenes, rows.values(), path, comparison.scene_options.get("root"))
    _check_scene_options(comparison, rows.values(), path)
    asked = _jobs(comparison)
    jobs = [missing for job in asked if (missing := _without(job, rows)).episodes]
    if jobs:
        hold_folder(comparison.out)
    with tqdm(total=sum(len(job.episodes) for job in jobs), unit="episode") as bar:
        for job, played in run_jobs(play, jobs, comparison.workers):
            for row in played:
                append_row(path, row)
                rows[row_key(row, KEY)] = row
            bar.update(len(job.episodes))
    wanted = [rows[key] for job in asked for key in _keys(job)]
    lines = [line for name in comparison.navigators for line in _lines(name, wanted)]
    print("\n".join([*_as_text(lines), *_other_code(wanted)]))
    if json_path is not None:
        write_json(json_path, lines)
    return lines


def play(job: Job) -> list[Row]:
    """Play the episodes of a job."""
    scene, options = job.episodes[0].scene, dict(job.episodes[0].scene_options)
    source: Row = {SCENE_FILE: file_digest(scene, options.get("root")), "commit": versions()["commit"]}
    if read_with := _options_of(scene, options):
        source[SCENE_OPTIONS] = read_with
    if (weights := _weights_of(job.navigator)) is not None:
        results = play_learned(load_policy(weights), job.episodes, deterministic=job.deterministic)
    else:
        results = [play_driven(job.navigator, episode, IMAGE_PX) for episode in job.episodes]
    return [
        {**dict(zip(KEY, key, strict=True)), **result, **source}
        for key, result in zip(_keys(job), results, strict=True)
    ]


def summarise(navigator: str, scene: str, rows: Sequence[Row]) -> Row:
    """One line of the table: means with 95 % intervals; of several scenes, their means are what varies."""
    count, scenes = len(rows), [row["scene"] for row in rows]
    success, low, high = _success(rows)
    line: Row = {
        "navigator": navigator,
        "draws": rows[0]["draws"],
        "scene": scene,
        "step_m": rows[0]["step_m"],
        "episodes": count,
        "success": success,
        "success_low": low,
        "success_high": high,
    }
    for key in ("spl", "soft_spl", "collisions"):
        interval = mean_interval([float(row[key]) for row in rows], clusters=scenes)
        line |= {key: interval.mean, f"{key}_half_width": interval.half_width if count > 1 else None}
    handovers = [row["handovers"] for row in rows if "handovers" in row]
    return line | {"handovers": sum(handovers) / len(handovers) if handovers else None}


def _success(rows: Sequence[Row]) -> tuple[float, float, float]:
    """Share of successes and its bounds: of Wilson's interval and that over the scenes the wider."""
    values = [float(row["is_success"]) for row in rows]
    low, high = wilson_interval(round(sum(values)), len(values))
    over_scenes = mean_interval(values, clusters=[row["scene"] for row in rows])
    mean, half_width = over_scenes.mean, over_scenes.half_width
    if len({row["scene"] for row in rows}) > 1:
        low, high = min(low, mean - half_width), max(high, mean + half_width)
    return mean, max(low, 0.0), min(high, 1.0)


def _lines(navigator: str, rows: Iterable[Row]) -> list[Row]:
    own = [row for row in rows if row["navigator"] == navigator]
    scenes = list(dict.fromkeys(row["scene"] for row in own))
    lines = [summarise(navigator, name, [row for row in own if row["scene"] == name]) for name in scenes]
    return [*lines, summarise(navigator, ALL, own)] if len(scenes) > 1 else lines


def _as_text(lines: Sequence[Row]) -> list[str]:
    header = [
        "navigator",
        "actions",
        "scene",
        "step m",
        "n",
        "success",
        "SPL",
        "soft SPL",
        "collisions",
        "handovers",
    ]
    body = [
        [
            Path(line["navigator"]).name,
            line["draws"],
            line["scene"],
            f"{line['step_m']:g}",
            str(line["episodes"]),
            f"{line['success']:.3f} [{line['success_low']:.3f}, {line['success_high']:.3f}]",
            *(_estimate(line, key) for key in ("spl", "soft_spl", "collisions")),
            "–" if line["handovers"] is None else f"{line['handovers']:.3f}",
        ]
        for line in lines
    ]
    return aligned(header, body)


def _estimate(line: Row, key: str) -> str:
    half_width = line[f"{key}_half_width"]
    return f"{line[key]:.3f}" + (f" ± {half_width:.3f}" if half_width is not None else "")


def _other_code(rows: Iterable[Row]) -> list[str]:
    """A note if some rows were played at another commit than the code at hand."""
    present = versions()["commit"]
    others = Counter(row.get("commit", "unknown") for row in rows)
    others.pop(present, None)
    played = ", ".join(f"{count} at {commit or 'unknown'}" for commit, count in sorted(others.items()))
    return [f"note: the code at hand is {present or 'unknown'}; episodes played: {played}"] if others else []


def _jobs(comparison: NavigationComparison) -> list[Job]:
    episodes = episodes_of(
        comparison.scenes, comparison.episodes, comparison.step_m, comparison.scene_options
    )
    by_scene = [tuple(one for one in episodes if one.scene == name) for name in comparison.scenes]
    digests = {name: policy_digest(name) for name in comparison.navigators}
    return [
        Job(name, comparison.deterministic, part, digests[name])
        for name in comparison.navigators
        for some in by_scene
        if some
        for part in ([some] if _weights_of(name) is not None else [(one,) for one in some])
    ]


def _options_of(scene: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """Options that decide how a scene is read: not where datasets lie, and none for homes and plans."""
    chosen = options if takes_options(scene) else {}
    return {name: value for name, value in chosen.items() if name != "root"}


def _check_scene_options(comparison: NavigationComparison, rows: Iterable[Row], path: Path) -> None:
    """Refuse to go on with rows of scenes that were read with other options."""
    asked = {scene_label(name): _options_of(name, comparison.scene_options) for name in comparison.scenes}
    for row in rows:
        played, wanted = row.get(SCENE_OPTIONS, {}), asked.get(row["scene"])
        if wanted is not None and played != wanted:
            raise ValueError(
                f"the rows of {row['scene']} in {path} must be read with `scene_options` {wanted}, "
                f"got {played}; write to another `--out` folder"
            )


def _without(job: Job, rows: Container[tuple[Any, ...]]) -> Job:
    """The episodes of a job that have no row yet."""
    missing = [one for key, one in zip(_keys(job), job.episodes, strict=True) if key not in rows]
    return replace(job, episodes=tuple(missing))


def _keys(job: Job) -> list[tuple[Any, ...]]:
    is_learned = _weights_of(job.navigator) is not None
    draws = ("argmax" if job.deterministic else "sampled") if is_learned else "own"
    return [
        (job.navigator, job.weights, scene_label(one.scene), one.seed, one.step_m, draws)
        for one in job.episodes
    ]


def _weights_of(navigator: str) -> str | None:
    """The weights of a navigator whose episodes are played many at a time; None for the others."""
    if navigator not in NAVIGATORS:
        return navigator
    settings = LEARNED.get(navigator)
    if settings is None or settings != LearnedSettings(settings.policy):
        return None
    return settings.policy


def policy_digest(navigator: str) -> str:
    """What tells a navigator's network from an older one of the same name; empty if it has none."""
    if navigator in NAVIGATORS and navigator not in LEARNED:
        return ""
    weights = LEARNED[navigator].policy if navigator in LEARNED else navigator
    return digest(asdict(policy_identity(load_policy(weights))))
