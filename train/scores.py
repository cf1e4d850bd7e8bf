"""The measures of an episode, under the names that rows use."""

from typing import Any, Final

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from anm_gym.actions import FORWARD_STEP_M
from anm_gym.metrics.completion import CompletionMeter
from anm_gym.metrics.curves import auc_over_metres, auc_over_steps
from anm_gym.metrics.distance import MeshDistance
from anm_gym.metrics.map_accuracy import field_scores, reconstruction_scores
from anm_gym.metrics.table_cache import load_view_table
from anm_gym.scenes.scene import Scene
from train.results import Row
from train.trajectory import Trajectory

MEASURES: Final = 2
"""Version of what rows measure; tables refuse to mix it. A change of any measure's definition raises it."""
CURVE_STEPS: Final = 20
"""Steps between the points of the curve in a row."""
SAMPLE_SEED: Final = 0
"""Seed of the points at which reconstructions are compared with the truth."""


def make_meter(env: gym.Env) -> CompletionMeter:
    """Make a meter for an episode in the environment's scene.

    Args:
        env: An exploration environment; which of the surface is visible from reachable positions is looked
            up in the cache, or worked out once.
    """
    mesh = env.get_wrapper_attr("scene").storey_mesh
    table = load_view_table(mesh, env.get_wrapper_attr("simulator"))
    return CompletionMeter(mesh, table.visible)


def trail_scores(meter: CompletionMeter, trajectory: Trajectory, steps: int) -> Row:
    """Score where the agent went and what it saw there.

    Args:
        meter: The meter that observed every frame.
        trajectory: The episode.
        steps: The budget; its metres are those of so many forward steps.

    Returns:
        Completion native and official, its areas over steps and metres, its curve at every
        `CURVE_STEPS`-th step and the last, the path and the collisions.
    """
    scores, curve = meter.scores(), trajectory.curves["comp_pct"]
    budget_m = steps * trajectory.env_options.get("forward_step_m", FORWARD_STEP_M)
    return {
        "comp_pct": scores.comp_pct,
        "comp_cm": scores.comp_cm,
        "comp_visible_pct": scores.comp_visible_pct,
        "comp_auc": auc_over_steps(curve, steps),
        "comp_auc_m": auc_over_metres(curve, trajectory.path_m, budget_m),
        "curve": _thinned(curve, trajectory.path_m),
        "comp_pct_official": scores.comp_pct_official,
        "comp_cm_official": scores.comp_cm_official,
        "path_m": float(trajectory.path_m[-1]),
        "collisions": int(trajectory.curves["collisions"][-1]),
    }


def _thinned(comp_pct: NDArray[np.floating], path_m: NDArray[np.floating]) -> dict[str, list[float]]:
    """A curve that is short enough for a row, so that figures can be drawn from rows alone."""
    steps = np.unique(np.append(np.arange(0, len(comp_pct), CURVE_STEPS), len(comp_pct) - 1))
    return {
        "step": steps.tolist(),
        "comp_pct": comp_pct[steps].round(2).tolist(),
        "path_m": path_m[steps].round(3).tolist(),
    }


def map_scores(neural_map: Any, scene: Scene) -> Row:
    """Score a neural map against the true surface.

    Args:
        neural_map: The agent's `NeuralMap` at the end of the episode.
        scene: The scene that was mapped.

    Returns:
        Distance of the field at the storey's surface, and of the reconstruction from it, native and official;
        then what `calibration_scores` says of the map where it has seen, and of its variability.
    """
    from train.calibration import calibration_scores

    # What is asked for is the storey; what is true is the whole mesh, as stairwells show other storeys too.
    truth, true_distance = scene.storey_mesh, MeshDistance(scene.mesh)
    field = field_scores(neural_map.sdf, truth, top_y_m=scene.storey_top_y_m)
    surface = neural_map.mesh()
    rng = np.random.default_rng(SAMPLE_SEED)
    mesh = reconstruction_scores(surface.vertices, surface.faces, truth, rng, true_distance=true_distance)
    return {
        "mad_cm": field.mad_cm,
        "fpr_pct": mesh.fpr_pct,
        "acc_cm": mesh.acc_cm,
        "mad_cm_official": field.mad_official_cm,
        "fpr_pct_official": mesh.fpr_official_pct,
        "fpr_pct_official_floor": mesh.fpr_floor_pct,
        **calibration_scores(neural_map, truth, true_distance),
    }
