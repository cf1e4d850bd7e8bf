"""How well the gains that a planner expects of views foretell what the views show.

    python -m benchmarks.view_gains [--scenes LIST] [--steps N] [--json PATH] [--quick]

`anm:best` explores. Every few steps, views from reachable places are rated by several gains, and these are
compared with the share of the surface that each view would newly cover, which the mesh tells. Printed per
gain are the rank correlation of the two, and the efficiency: what the view with the highest expected gain
per step of way shows per step, as a share of what the best view shows.
"""

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray
from scipy.stats import spearmanr
from tqdm import tqdm

from agents.roster import build_agent
from anm_gym.map.neural_map import NeuralMap
from anm_gym.map.reach import reachable_space
from anm_gym.map.unseen_volume import UnseenSettings, unseen_volume
from anm_gym.map.view_planner import PlannerSettings, ViewPlanner
from anm_gym.metrics.oracle import GreedyCoverage
from anm_gym.metrics.table_cache import load_view_table
from anm_gym.metrics.view_table import ViewTable
from train.command import run_command, scene_label, split_list
from train.episodes import make_env, scene_of
from train.figures.map_probe import still_copy
from train.pool import prepare_worker
from train.results import Row, write_json

SCENES: Final = "home:flat:34,home:flat:35,home:house:34,home:maze:34"
STEPS: Final = 500
EVERY: Final = 25
"""Steps between two comparisons."""
PLACES: Final = 50
"""Places that are rated, at most."""
QUICK_SCENES: Final = "home:studio:34"
QUICK_STEPS: Final = 60
LEAST_GAIN: Final = 0.001
"""Where no view newly covers this share of the surface, there is nothing to foretell."""


@dataclass(frozen=True)
class Moment:
    """What a planner knows when it decides, and the views that it may choose."""

    neural_map: NeuralMap
    """The map."""
    position_xz: NDArray[np.float64]
    """(2,) where the agent stands, metres."""
    heading_rad: float
    """Where it looks, radians."""
    centers: NDArray[np.float64]
    """(P, 3) camera centres of the views, metres."""


Gains = Callable[[Moment], NDArray[np.float64]]
"""Gives (P, H) gains; heading h is ``2 pi h / H`` radians."""


def gains_by_name() -> dict[str, Gains]:
    """The planner's gain, its parts, and next-best-view's."""
    settings = PlannerSettings()
    surface_alone = replace(settings.surface, frontier_share=0.0)
    return {
        "predicted surface": _planned(replace(settings, surface=surface_alone, unseen_worth=0.0)),
        "surface and rim": _planned(replace(settings, unseen_worth=0.0)),
        "unseen space (nbv)": _unseen(UnseenSettings()),
        "surface, rim and unseen space (anm)": _planned(settings),
    }


def _planned(settings: PlannerSettings) -> Gains:
    planner = ViewPlanner(settings)

    def gains(moment: Moment) -> NDArray[np.float64]:
        neural_map, rng = moment.neural_map, np.random.default_rng(moment.neural_map.num_frames)
        surface = planner.variable_surface(neural_map, moment.position_xz, moment.heading_rad, rng)
        return planner.expected_gains(neural_map, surface, moment.centers)

    return gains


def _unseen(settings: UnseenSettings) -> Gains:
    def gains(moment: Moment) -> NDArray[np.float64]:
        neural_map, floor_y_m = moment.neural_map, moment.neural_map.occupancy.floor_y_m
        return unseen_volume(neural_map.volume, moment.centers, floor_y_m, neural_map.camera, settings)

    return gains


def compare(scene: str, steps: int, bar: "tqdm[None]", seed: int = 0) -> list[Row]:
    """Explore a scene, and compare on the way.

    Returns:
        A row per gain and comparison.
    """
    agent = build_agent("anm", make_env(scene, steps, {}), seed)
    observation, _ = agent.env.reset(seed=seed)
    simulator, camera = agent.env.get_wrapper_attr("simulator"), agent.env.get_wrapper_attr("camera")
    table = load_view_table(scene_of(agent.env).storey_mesh, simulator)
    truth, gains, rows = GreedyCoverage(table, simulator.grid), gains_by_name(), []
    truth.mark_seen(observation["depth"], camera, observation["world_from_camera"])
    for step in range(1, steps + 1):
        action, _ = agent.policy.predict(observation)
        observation, _, terminated, truncated, _ = agent.env.step(action)
        truth.mark_seen(observation["depth"], camera, observation["world_from_camera"])
        if step % EVERY == 0:
            for name, compared in _rate(agent.env, table, truth, gains, np.random.default_rng([seed, step])):
                rows.append({"scene": scene_label(scene), "step": step, "gain": name, **compared})
        bar.update()
        if terminated or truncated:
            break
    agent.env.close()
    return rows


def _rate(
    env: gym.Env[Any, Any],
    table: ViewTable,
    truth: GreedyCoverage,
    gains: dict[str, Gains],
    rng: np.random.Generator,
) -> Iterator[tuple[str, Row]]:
    """Score every gain at the present moment; nothing if no place is reachable or no view shows anything."""
    neural_map = env.get_wrapper_attr("neural_map")
    position_xz, heading_rad = env.get_wrapper_attr("position_xz"), env.get_wrapper_attr("heading_rad")
    planner = PlannerSettings()
    space = reachable_space(neural_map.occupancy, position_xz, planner.reach)
    if space is None:
        return
    cells = space.frame.cells_of(table.positions_xz)
    inside = np.flatnonzero(space.frame.contains(cells))
    places = inside[space.reachable[cells[inside, 0], cells[inside, 1]]]
    places = rng.permutation(places)[:PLACES]
    true = truth.newly_covered(places) / table.num_samples
    if true.size == 0 or true.max() < LEAST_GAIN:
        return
    camera_y_m = neural_map.occupancy.floor_y_m + neural_map.camera.sensor_height_m
    centers = np.insert(table.positions_xz[places], 1, camera_y_m, axis=1)
    distance_m = space.cost_m[cells[places, 0], cells[places, 1]]
    steps = distance_m / planner.views.forward_step_m + planner.views.fixed_cost_steps
    for name, gain in gains.items():
        # Of a copy: asking draws, and the map must learn on as if nobody had asked.
        moment = Moment(still_copy(neural_map), position_xz, heading_rad, centers)
        yield name, scores(_at_headings(gain(moment), true.shape[1]), true, steps)


def _at_headings(gains: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Those of (P, H) headings that a table with `count` headings has too."""
    if gains.shape[1] % count:
        raise ValueError(f"the planner's {gains.shape[1]} headings must be a multiple of the table's {count}")
    return gains[:, :: gains.shape[1] // count]


def scores(expected: NDArray[np.float64], true: NDArray[np.float64], steps: NDArray[np.float64]) -> Row:
    """Compare expected with true gains.

    Args:
        expected: (P, K) gains, in any unit.
        true: (P, K) gains, not all 0.
        steps: (P,) cost of each place.

    Returns:
        `rank_correlation`, and `efficiency`, the share of the best rate that the chosen view has.
    """
    rates = true / steps[:, None]
    chosen = int((expected / steps[:, None]).argmax())
    constant = np.ptp(expected) == 0.0 or np.ptp(true) == 0.0
    correlation = 0.0 if constant else float(spearmanr(expected.ravel(), true.ravel()).statistic)
    return {"rank_correlation": correlation, "efficiency": float(rates.ravel()[chosen] / rates.max())}


def format_table(rows: Sequence[Row]) -> str:
    """Lay out the means, with standard errors of the efficiency."""
    lines = [f"{'gain':<38}{'moments':>8}{'rank correlation':>18}{'efficiency':>18}"]
    for name in dict.fromkeys(row["gain"] for row in rows):
        own = [row for row in rows if row["gain"] == name]
        efficiency = np.array([row["efficiency"] for row in own])
        correlation = np.mean([row["rank_correlation"] for row in own])
        error = efficiency.std(ddof=1) / np.sqrt(len(own)) if len(own) > 1 else np.nan
        lines.append(f"{name:<38}{len(own):>8}{correlation:>18.3f}{efficiency.mean():>11.3f} ± {error:.3f}")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the comparison and print its table."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.view_gains", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument("--scenes", default=None, help=f"meshes or procedural homes ({SCENES})")
    parser.add_argument("--steps", type=int, default=None, help=f"steps of each episode ({STEPS})")
    parser.add_argument("--json", type=Path, default=None, help="write the rows to this file")
    parser.add_argument("--quick", action="store_true", help="one studio, 60 steps")
    options = parser.parse_args(arguments)
    usual_scenes, usual_steps = (QUICK_SCENES, QUICK_STEPS) if options.quick else (SCENES, STEPS)
    steps = usual_steps if options.steps is None else options.steps
    if steps < EVERY:
        raise ValueError(f"`steps` must be >= {EVERY}, from comparison to comparison, got {steps}")
    prepare_worker()
    rows: list[Row] = []
    scenes = split_list(options.scenes or usual_scenes)
    with tqdm(total=steps * len(scenes), unit="step", dynamic_ncols=True) as bar:
        for scene in scenes:
            rows += compare(scene, steps, bar)
    print(format_table(rows))
    if options.json:
        write_json(options.json, rows)


if __name__ == "__main__":
    run_command(main)
