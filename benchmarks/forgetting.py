"""What a map still knows of the surface that it saw first: with replay, with uniform replay, with none.

    python -m benchmarks.forgetting [--presets LIST] [--scenes LIST] [--steps N] [--json PATH] [--quick]

All variants learn the same posed depth images of a walk that explores, and so leaves the first room behind.
The error is the mean absolute distance that the map predicts at surface which the first tenth of the
images showed, where it should be 0; later images may show some of it again, to all variants alike. It is
measured for the whole field and for its network alone, as grids do not forget.
"""

import argparse
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from tqdm import tqdm

from anm_gym.geometry import backproject
from anm_gym.map.neural_map import NeuralMap
from anm_gym.map.presets import map_settings
from benchmarks.recordings import Recording, record
from train.command import run_command, split_list
from train.plots import Curve, figure, plot_curves, save_figure
from train.pool import prepare_worker
from train.results import Row, write_json

PRESETS = "best,best+uniform_replay,best+no_replay"
FIRST_SHARE = 0.1
"""Share of the images that show what must not be forgotten."""
CHECKPOINTS = 20
"""Times at which the errors are measured."""
POINTS = 4000
"""Surface points that are asked."""
MAX_DEPTH_M = 8.0
"""Farther surface is not learned, metres."""


def forget(recording: Recording, preset: str, bar: "tqdm[None]") -> list[Row]:
    """Learn a recording and measure the errors on the way.

    Returns:
        One row per checkpoint: errors of the field and of its network, centimetres, at surface of the first
        images and at all surface seen so far.
    """
    neural_map = NeuralMap(map_settings(preset), recording.camera)
    first = max(1, round(FIRST_SHARE * len(recording)))
    every = max(1, len(recording) // CHECKPOINTS)
    rows: list[Row] = []
    for step, (depth_m, pose) in enumerate(
        zip(recording.depth_m, recording.world_from_camera, strict=True), start=1
    ):
        neural_map.integrate(depth_m, pose)
        if step == len(recording) or (step >= first and step % every == 0):
            names = {"preset": preset, "trajectory": recording.name, "step": step}
            rows.append(names | _errors(neural_map, recording, first, step))
        bar.update()
    return rows


def _errors(neural_map: NeuralMap, recording: Recording, first: int, step: int) -> Row:
    old, seen = _surface(recording, first), _surface(recording, step)
    return {
        "first_room_cm": _mean_cm(neural_map.sdf(old)),
        "first_room_network_cm": _mean_cm(_network(neural_map, old)),
        "seen_cm": _mean_cm(neural_map.sdf(seen)),
        "seen_network_cm": _mean_cm(_network(neural_map, seen)),
    }


def _surface(recording: Recording, images: int) -> NDArray[np.float32]:
    """(N, 3) points of the surface that the first images show."""
    rng = np.random.default_rng(images)
    per_image = -(-POINTS // images)
    points = []
    for depth_m, pose in zip(recording.depth_m[:images], recording.world_from_camera[:images], strict=True):
        near = np.where(depth_m <= MAX_DEPTH_M, depth_m, 0.0).astype(np.float32)
        visible = backproject(near, recording.camera, pose)
        points.append(visible[rng.integers(len(visible), size=per_image)] if len(visible) else visible)
    return np.concatenate(points).astype(np.float32)


def _network(neural_map: NeuralMap, points: NDArray[np.float32]) -> NDArray[np.float32]:
    with torch.no_grad():
        return np.asarray(neural_map.field.network(torch.from_numpy(points)).numpy(), np.float32)


def _mean_cm(distance_m: NDArray[np.float32]) -> float:
    return float(100.0 * np.abs(distance_m).mean())


def format_table(rows: Sequence[Row]) -> str:
    """Lay out the errors at the first room: lowest on the way, and in the end."""
    lines = [
        f"{'trajectory':<18}{'preset':<22}{'field, end':>12}{'network, best':>15}{'network, end':>14}  (cm)"
    ]
    for trajectory, preset in dict.fromkeys((row["trajectory"], row["preset"]) for row in rows):
        own = [row for row in rows if (row["trajectory"], row["preset"]) == (trajectory, preset)]
        network = [row["first_room_network_cm"] for row in own]
        lines.append(
            f"{trajectory:<18}{preset:<22}{own[-1]['first_room_cm']:>12.2f}{min(network):>15.2f}{network[-1]:>14.2f}"
        )
    return "\n".join(lines)


def draw(rows: Sequence[Row], path: Path) -> Path:
    """Draw the errors at the first room over the steps, of the networks and of the fields."""
    result, panels = figure(2)
    titles = {"first_room_network_cm": "network alone", "first_room_cm": "whole field"}
    steps = max(row["step"] for row in rows)
    for index, (axes, (key, title)) in enumerate(zip(panels, titles.items(), strict=True)):
        curves: dict[str, list[Curve]] = defaultdict(list)
        for preset, walk in dict.fromkeys((row["preset"], row["trajectory"]) for row in rows):
            own = [row for row in rows if (row["preset"], row["trajectory"]) == (preset, walk)]
            x, y = (np.array([row[name] for row in own], np.float64) for name in ("step", key))
            curves[preset].append(Curve(x, y, walk))
        label = "error at the first room (cm)"
        plot_curves(axes, curves, float(steps), "steps", label, first=index == 0, y_max=np.inf)
        axes.set_title(title, fontsize=10)
    return save_figure(result, path)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--presets", default=PRESETS, help=f"presets and variants of the map ({PRESETS})")
    parser.add_argument("--scenes", help="meshes, plans or procedural homes (home:house:11)")
    parser.add_argument("--steps", type=int, help="images of a recording (400)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the walks (0)")
    parser.add_argument("--out", type=Path, default=Path("runs/forgetting"), help="folder of the picture")
    parser.add_argument("--json", type=Path, help="write the rows to this file as well")
    parser.add_argument("--quick", action="store_true", help="one studio, 60 steps")
    arguments = parser.parse_args()
    arguments.scenes = split_list(
        arguments.scenes or ("home:studio:11" if arguments.quick else "home:house:11")
    )
    arguments.steps = arguments.steps or (60 if arguments.quick else 400)
    arguments.presets = split_list(arguments.presets)
    return arguments


def main() -> None:
    """Run the comparison, print its table, and leave rows and a picture."""
    arguments = _arguments()
    prepare_worker()
    rows: list[Row] = []
    total = len(arguments.scenes) * len(arguments.presets) * arguments.steps
    with tqdm(total=total, unit="step", dynamic_ncols=True) as bar:
        for scene in arguments.scenes:
            recording = record(scene, arguments.steps, arguments.seed)
            for preset in arguments.presets:
                bar.set_postfix_str(f"{preset}, {recording.name}")
                rows += forget(recording, preset, bar)
    print(format_table(rows))
    print(f"picture: {draw(rows, arguments.out / 'forgetting.png')}")
    if arguments.json:
        write_json(arguments.json, rows)


if __name__ == "__main__":
    run_command(main)
