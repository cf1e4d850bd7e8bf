"""Explore one scene and leave all there is to see: surface, map, trajectory, pictures, report.

Command: ``python -m train.explore --scene house.glb --agent anm:best --out runs/house``.
"""

import json
import time
from collections.abc import Sequence
from inspect import signature
from pathlib import Path
from typing import Any, Final

import numpy as np
from jsonargparse import ArgumentParser
from tqdm import tqdm

from anm_gym.map.checkpoint import save_map
from anm_gym.mesh import TriangleMesh
from anm_gym.scenes.catalog import takes_options
from anm_gym.scenes.report import mesh_report
from train import html
from train.command import run_command, scene_label
from train.episodes import Episode, Job, run_job, scene_of, split_agent, whole_row
from train.html import Section
from train.pictures import save_picture, write_montage, write_topdown
from train.plots import Curve, completion_figure
from train.pool import prepare_worker
from train.provenance import versions
from train.quick import STEPS, add_quick_option, env_options, parse_quick
from train.reconstruction import CUT_ABOVE_FLOOR_M, dollhouse_picture, save_ply
from train.recorder import Progress, find_attribute
from train.results import Row, write_json
from train.tables.measures import MEASURES, OFFICIAL_MEASURES, agent_name, value_of

MAP_FILE: Final = "map.safetensors"
"""The neural map, of agents that have one."""
SURFACE_FILE: Final = "reconstruction.ply"
"""Its surface, if it has one."""
SURFACE_PICTURE: Final = "reconstruction.png"
"""A picture of that."""


def explore(
    scene: str,
    agent: str = "anm:best",
    steps: int = 1000,
    seed: int = 0,
    out: Path | None = None,
    env: dict[str, Any] | None = None,
) -> Row:
    """Explore a scene with one agent and leave mesh, map, trajectory, pictures and a report.

    Args:
        scene: A mesh, a floor plan or a procedural name such as home:flat:1.
        agent: An agent of the roster, such as fbe or anm:paper.
        steps: Budget of the episode.
        seed: Seed of the start and of the agent.
        out: Folder of the results; runs/explore-<scene> if not given.
        env: Arguments of the environment, such as a camera.

    Returns:
        The episode's row, where the report lies, and what may be wrong with a mesh that was loaded.
    """
    folder = out or default_folder(scene)
    prepare_worker()
    job = Job(*split_agent(agent), scene, seed, steps, folder, env or {})
    folder.mkdir(parents=True, exist_ok=True)  # now rather than after the episode
    start_s = time.perf_counter()
    with tqdm(total=steps, unit="step", delay=1.0) as bar:
        episode = run_job(job, _progress(bar))
    row = whole_row(job, episode.row, time.perf_counter() - start_s)
    for name in (MAP_FILE, SURFACE_FILE, SURFACE_PICTURE):  # not every agent writes them
        (folder / name).unlink(missing_ok=True)
    episode.trajectory.save(folder / "trajectory.npz")
    _write_settings(job, episode)
    write_json(folder / "row.json", row)
    surface = _write_map(job, episode)
    pictures = _write_pictures(job, episode, surface)
    warnings = list(mesh_report(scene_of(episode.env)).warnings) if takes_options(scene) else []
    _write_report(job, episode, pictures)
    episode.env.close()
    return row | {"report": str(folder / "report.html"), "warnings": warnings}


def default_folder(scene: str) -> Path:
    """Where the results of a scene go."""
    return Path("runs") / f"explore-{scene_label(scene).replace(':', '-')}"


def summary(row: Row) -> list[tuple[str, str]]:
    """List the measures that the row has, as heading and value."""
    name = agent_name(row["agent"], row["preset"])
    pairs = [
        ("agent", name),
        ("scene", row["scene"]),
        ("seed", str(row["seed"])),
        ("steps", str(row["steps_done"])),
    ]
    for measure in MEASURES + OFFICIAL_MEASURES:
        value = value_of(row, measure.key)
        if not np.isnan(value):
            pairs.append((measure.heading, f"{value:.{measure.digits}f}"))
    return pairs


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command and print a short table."""
    parser = ArgumentParser(prog="python -m train.explore", description=__doc__.splitlines()[0])
    parser.add_argument("--config", action="config", help="YAML file with any of these options")
    parser.add_function_arguments(explore, as_positional=False)
    parser.add_argument(
        "--json", type=Path | None, default=None, help="write the episode's row to this file too"
    )
    add_quick_option(parser, f"{STEPS} steps with a small camera")
    options = parse_quick(parser, arguments, steps=STEPS)
    chosen = {name: options[name] for name in signature(explore).parameters}
    if options.quick and options.out is None:
        chosen["out"] = Path(f"{default_folder(options.scene)}-quick")
    row = explore(**(chosen | {"env": env_options(options)}))
    if options.json is not None:
        write_json(options.json, row)
    for heading, value in summary(row):
        print(f"{heading:<22}{value:>14}")
    for note in row["repairs"]:
        print(f"note: {note}")
    for warning in row["warnings"]:
        print(f"warning: {warning}")
    print(f"report: {row['report']}")


def _progress(bar: "tqdm[Any]") -> Progress:
    def show(comp_pct: float) -> None:
        bar.set_postfix_str(f"completion {comp_pct:.1f} %", refresh=False)
        bar.update()

    return show


def _write_settings(job: Job, episode: Episode) -> None:
    content = {**job.identity, "scene": job.scene, "env": job.env_options}
    content |= {
        "settings_hash": episode.row["settings_hash"],
        "settings": episode.settings,
        "versions": versions(),
    }
    write_json(job.out / "settings.json", content)


def _write_map(job: Job, episode: Episode) -> TriangleMesh | None:
    """Save the neural map and its surface; None for an agent without a map or a map without a surface."""
    neural_map = find_attribute(episode.env, "neural_map")
    if neural_map is None:
        return None
    save_map(neural_map, job.out / MAP_FILE)
    surface = neural_map.mesh()
    if len(surface.faces) == 0:
        return None
    mesh = TriangleMesh(np.asarray(surface.vertices, np.float64), np.asarray(surface.faces, np.int32))
    save_ply(job.out / SURFACE_FILE, mesh)
    return mesh


def _write_pictures(job: Job, episode: Episode, surface: TriangleMesh | None) -> dict[str, Path]:
    """Draw the episode.

    Returns:
        Paths by caption.
    """
    out, scene, trajectory = job.out, scene_of(episode.env), episode.trajectory
    cut_y_m = scene.floor_y_m + CUT_ABOVE_FLOOR_M
    y = trajectory.curves["comp_pct"]
    name = agent_name(job.agent, job.preset)
    steps, metres = Curve(np.arange(len(y), dtype=np.float64), y), Curve(trajectory.path_m, y)
    result = {
        "Seen from above, the trail from dark to bright": write_topdown(
            out / "topdown.png", episode.env, trajectory
        ),
        "Completion over steps and metres": completion_figure(
            {name: [steps]}, {name: [metres]}, job.steps, out / "completion.png"
        ),
        "Depth on the way": write_montage(out / "depth.png", episode.env, trajectory),
        "The scene itself": save_picture(out / "scene.png", dollhouse_picture(scene.storey_mesh, cut_y_m)),
    }
    if surface is not None:
        picture = save_picture(out / SURFACE_PICTURE, dollhouse_picture(surface, cut_y_m))
        result = {"Reconstructed surface, coloured by height": picture} | result
    return result


def _write_report(job: Job, episode: Episode, pictures: dict[str, Path]) -> Path:
    settings = [(name, json.dumps(values)) for name, values in episode.settings.items()]
    cpu = [(module, f"{value:.2f} ms per step") for module, value in episode.row["cpu_ms"].items()]
    sections = [
        Section("Result", html.definitions(summary(episode.row))),
        *(Section(caption, html.image(path, path.name)) for caption, path in pictures.items()),
        Section("CPU time", html.definitions(cpu)),
        *(Section("Repaired", html.paragraph(repair)) for repair in episode.row["repairs"]),
        Section("Settings", html.definitions([*settings, *versions().items()])),
    ]
    title = f"{agent_name(job.agent, job.preset)} in {scene_label(job.scene)}"
    subtitle = f"seed {job.seed}, {job.steps} steps; trajectory.npz replays this episode bit for bit"
    return html.write_page(job.out / "report.html", html.page(title, subtitle, sections))


if __name__ == "__main__":
    run_command(main)
