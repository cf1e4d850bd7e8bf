"""One episode as a pure function of its job: build scene and agent, run, score, leave files, return a row."""

import time
import traceback
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import gymnasium as gym

from agents.roster import ROSTER, build_agent, parse_agent
from anm_gym.errors import SceneError
from anm_gym.scenes.scene import Scene
from train.attribution import attribute
from train.command import file_stem, scene_label
from train.pictures import write_topdown
from train.provenance import (
    digest,
    effective_settings,
    environment_digest,
    file_digest,
    geometry_digest,
    scenes_root,
    versions,
)
from train.recorder import EpisodeRecorder, Progress, SimulatorClock, find_attribute
from train.results import MAP_LEFT_OUT, ROW_FIELDS, SCENE_FILE, Key, Row, row_key, write_json
from train.runner import EpisodeRecord, run_episode
from train.scores import MEASURES, make_meter, map_scores, trail_scores
from train.trajectory import Trajectory

ENV_ID: Final = "anm_gym:ANM/Explore-v0"
"""The environment under every agent."""
FREE_PROTOCOL: Final = "explore-v0"
"""Protocol of episodes whose scenes, budget and seeds are chosen freely."""

Start = tuple[float, float, float]
"""x, z (metres) and heading (radians) of the first pose."""


@dataclass(frozen=True)
class Job:
    """What determines an episode, and where its files go."""

    agent: str
    """Name in the roster."""
    preset: str
    """The agent's preset; empty if it has none."""
    scene: str
    """A path or a procedural name."""
    seed: int
    """Seed of the start and of the agent."""
    steps: int
    """Budget."""
    out: Path
    """Folder of the run."""
    env_options: dict[str, Any] = field(default_factory=dict)
    """Arguments of the environment besides the scene; part of the protocol."""
    with_maps: bool = True
    """Whether to score the neural map of agents that have one."""
    with_pictures: bool = True
    """Whether to draw the episode."""
    conditions: str = FREE_PROTOCOL
    """Name of the protocol, see `train.protocols`."""
    start: Start | None = None
    """Where the episode starts; None lets the seed draw it."""
    geometry: str = ""
    """Name of the geometry that the start belongs to; empty accepts any."""

    @property
    def protocol(self) -> str:
        """Name of the protocol, with a hash of the environment's arguments if they are not the defaults."""
        return "-".join(part for part in (self.conditions, environment_digest(self.env_options)) if part)

    @property
    def identity(self) -> Row:
        """The fields of the row that are known before the episode."""
        return {
            "agent": self.agent,
            "scene": scene_label(self.scene),
            "seed": self.seed,
            "protocol": self.protocol,
            "preset": self.preset,
            "steps": self.steps,
        }

    @property
    def scenes_root(self) -> str | None:
        """Folder of the datasets, where the environment's arguments name one."""
        return scenes_root(self.env_options)

    @property
    def key(self) -> Key:
        """The key of its row."""
        return row_key(self.identity)

    @property
    def name(self) -> str:
        """Stem of its files."""
        scene = scene_label(self.scene)
        return file_stem(self.agent, self.preset, scene, self.seed, self.steps, self.protocol)


@dataclass(frozen=True)
class Episode:
    """A played job; the environment is still open, with the agent's map as it ended."""

    env: gym.Env
    """The agent's environment, with its wrappers."""
    record: EpisodeRecord
    """Steps, reward, compute."""
    trajectory: Trajectory
    """What replays it."""
    row: Row
    """Its scores."""
    settings: dict[str, Any]
    """Effective settings of the agent."""


def split_agent(text: str) -> tuple[str, str]:
    """Split an agent's spelling into name and preset; the preset is empty where there is only one.

    Raises:
        ValueError: If the agent or its preset is unknown.
    """
    name, preset = parse_agent(text)
    return name, "" if ROSTER[name].presets == (preset,) else preset


def play(job: Job) -> Row:
    """Play a job, leave its trajectory and picture; an episode that raises becomes a row with the error.

    Args:
        job: The episode.

    Returns:
        Its row, with every field of `ROW_FIELDS`.
    """
    start_s = time.perf_counter()
    try:
        episode = run_job(job)
        row = episode.row | _leave_files(job, episode)
        episode.env.close()
    except Exception as error:  # noqa: BLE001 - what one agent does must not end the others' run
        row = {"error": f"{type(error).__name__}: {error}", "traceback": traceback.format_exc(limit=-6)}
    return whole_row(job, row, time.perf_counter() - start_s)


def whole_row(job: Job, measured: Row, wall_s: float) -> Row:
    """Give a row every field: what was not measured is null.

    Args:
        job: The episode.
        measured: What it came to.
        wall_s: Time that it took, seconds.
    """
    taken = {"wall_s": round(wall_s, 3), "versions": versions()}
    return dict.fromkeys(ROW_FIELDS) | job.identity | measured | taken


def run_job(job: Job, progress: Progress | None = None) -> Episode:
    """Build what a job needs, run its episode and score it.

    Args:
        job: The episode.
        progress: Told after each step.

    Returns:
        The episode, with its environment open.

    Raises:
        SceneError: If the scene is not the one to which the start belongs.
    """
    env = make_env(job.scene, job.steps, job.env_options)
    geometry, file = _checked_geometry(job, env), file_digest(job.scene, job.scenes_root)
    agent = build_agent(f"{job.agent}:{job.preset}", env, job.seed)
    recorder = EpisodeRecorder(make_meter(env), agent.policy, progress)
    record = run_episode(agent.env, agent.policy, job.seed, recorder, job.start)
    trajectory = recorder.trajectory(job.scene, job.seed, _options_of(job))
    settings = effective_settings(agent.env, agent.policy)
    neural_map = find_attribute(agent.env, "neural_map")
    is_scored = neural_map is not None and job.with_maps
    failures = attribute(trajectory, find_attribute(agent.env, "arrival_m"))
    row = {
        **job.identity,
        "settings_hash": digest(settings),
        SCENE_FILE: file,
        "steps_done": record.steps,
        "scene_hash": trajectory.scene_hash,
        "geometry": geometry,
        "surface": geometry_digest(scene_of(env).storey_mesh),
        "measures": MEASURES,
        "repairs": list(scene_of(env).repairs),
        "start": [round(number, 6) for number in trajectory.poses[0].tolist()],
        "attribution": failures.as_row(),
        "handovers": None
        if (handovers := find_attribute(agent.env, "handovers")) is None
        else len(handovers),
        **record.scores,
        **trail_scores(recorder.meter, trajectory, job.steps),
        **(map_scores(neural_map, scene_of(env)) if is_scored else {}),
        MAP_LEFT_OUT: neural_map is not None and not is_scored,
    }
    return Episode(agent.env, record, trajectory, row, settings)


def make_env(scene: str, steps: int, env_options: dict[str, Any]) -> gym.Env:
    """Make the exploration environment with a step limit.

    Raises:
        ValueError: If an argument is unknown, or named by another option.
    """
    reserved = {"id", "scene", "max_episode_steps"} & env_options.keys()
    if reserved:
        raise ValueError(f"`env` must not hold {', '.join(sorted(reserved))}: other options name them")
    try:
        return SimulatorClock(gym.make(ENV_ID, max_episode_steps=steps, scene=scene, **env_options))
    except TypeError as error:  # an argument that somebody down there does not know
        raise ValueError(f"`env` must hold arguments of {ENV_ID}, got {env_options}: {error}") from error


def scene_of(env: gym.Env) -> Scene:
    """Get the scene that an environment plays in."""
    scene = env.get_wrapper_attr("scene")
    assert isinstance(scene, Scene)
    return scene


def _checked_geometry(job: Job, env: gym.Env) -> str:
    """Name the scene's geometry, and refuse one to which the job's start does not belong."""
    geometry = geometry_digest(scene_of(env).mesh)
    if job.geometry not in {"", geometry}:
        raise SceneError(
            f"the geometry of {job.scene} must be {job.geometry}, to which the starts belong, got {geometry}"
        )
    return geometry


def _options_of(job: Job) -> dict[str, Any]:
    """Arguments that make the environment of the same episode again."""
    return job.env_options if job.start is None else {**job.env_options, "start": list(job.start)}


def _leave_files(job: Job, episode: Episode) -> Row:
    """Leave the trajectory, the picture and, once for all episodes of an agent, what its hash stands for."""
    settings = job.out / "settings" / f"{episode.row['settings_hash']}.json"
    if not settings.exists():
        write_json(settings, episode.settings)
    trajectory = Path("episodes") / f"{job.name}.npz"
    episode.trajectory.save(job.out / trajectory)
    if not job.with_pictures:
        return {"trajectory": trajectory.as_posix()}
    picture = Path("pictures") / f"{job.name}.png"
    write_topdown(job.out / picture, episode.env, episode.trajectory)
    return {"trajectory": trajectory.as_posix(), "pictures": {"topdown": picture.as_posix()}}
