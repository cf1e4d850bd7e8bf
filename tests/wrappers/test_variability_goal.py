from dataclasses import replace

import gymnasium
import numpy as np
import pytest

from anm_gym.map.targets import PAPER_TARGETS, TargetView, propose_target_views
from anm_gym.map.view_planner import PlannerSettings
from anm_gym.wrappers.neural_map import NeuralMapWrapper
from anm_gym.wrappers.variability_goal import VariabilityGoalWrapper

SCENE = "home:studio:0"
CAMERA = {"width_px": 48, "height_px": 48}


def mapped(**options: float) -> NeuralMapWrapper:
    explore = gymnasium.make("anm_gym:ANM/Explore-v0", scene=SCENE, camera=CAMERA, **options)
    return NeuralMapWrapper(explore, preset="fast")


def turn_round(env: VariabilityGoalWrapper, steps: int = 4) -> None:
    for _ in range(steps):
        env.step(np.int64(2))


def test_best_view_is_on_known_free_floor_with_a_heading() -> None:
    env = VariabilityGoalWrapper(mapped(), preset="best")
    observation, _ = env.reset(seed=0)
    turn_round(env)
    goal = env.goal
    assert goal.reason in {"view", "wander"}
    assert observation["pointgoal_with_gps_compass"].dtype == np.float32
    cell = env.occupancy.frame.cells_of(goal.position_xz)[0]
    assert env.occupancy.clearance_m[cell[0], cell[1]] > 0.05


def test_views_are_planned_in_the_steps_of_the_environment() -> None:
    env = VariabilityGoalWrapper(mapped(forward_step_m=0.25, turn_step_deg=30.0), preset="best")
    env.reset(seed=0)
    views = env._planner.settings.views
    assert (views.forward_step_m, views.turn_step_rad) == (0.25, pytest.approx(np.pi / 6.0))


def test_planner_takes_note_of_every_view() -> None:
    env = VariabilityGoalWrapper(mapped(), preset="best")
    env.reset(seed=0)
    turn_round(env, 2)
    here = env._planner.taken.among(env.position_xz[None], 36)[0]
    assert 4 <= here.sum() <= 5


def test_paper_goal_is_a_cluster_of_variable_surface() -> None:
    env = VariabilityGoalWrapper(mapped(), preset="paper", targets=replace(PAPER_TARGETS, resolution=24))
    env.reset(seed=0)
    assert env.goal.reason in {"cluster", "wander"}
    assert env.limits.arrival_m == 0.8


def test_clusters_near_a_failure_are_not_proposed_again() -> None:
    env = VariabilityGoalWrapper(mapped(), preset="paper", targets=replace(PAPER_TARGETS, resolution=24))
    env.reset(seed=0)
    failed = env.goal.position_xz
    env.report_unreachable("no path")
    if env.goal.reason == "cluster":
        assert np.linalg.norm(env.goal.position_xz - failed) > 0.5


def test_same_seed_proposes_the_same_goals() -> None:
    goals = []
    for _ in range(2):
        env = VariabilityGoalWrapper(mapped(), preset="best")
        env.reset(seed=1)
        turn_round(env, 12)
        goals.append([(*goal.position_xz, goal.heading_rad) for goal in env.goals])
    assert goals[0] == goals[1]


def test_map_below_is_needed() -> None:
    explore = gymnasium.make("anm_gym:ANM/Explore-v0", scene=SCENE, camera=CAMERA)
    with pytest.raises(ValueError, match="`env` must have a neural map; wrap it in NeuralMapWrapper first"):
        VariabilityGoalWrapper(explore)


def test_unknown_preset_is_refused() -> None:
    with pytest.raises(
        ValueError, match="unknown goal preset 'quick'; choose one of: paper, released, best, fast"
    ):
        VariabilityGoalWrapper(mapped(), preset="quick")


def test_planning_is_refused_where_clusters_are_chosen() -> None:
    with pytest.raises(ValueError, match="`planning` must be None where goals are chosen among clusters"):
        VariabilityGoalWrapper(mapped(), preset="paper", planning=PlannerSettings())


def test_active_mapping_is_explore_with_both_wrappers() -> None:
    env = gymnasium.make("anm_gym:ANM/ActiveMapping-v0", scene=SCENE, camera=CAMERA, preset="fast")
    observation, info = env.reset(seed=0)
    assert "pointgoal_with_gps_compass" in observation
    assert {"goal_distance_m", "goals_count", "is_keyframe"} <= set(info)
    assert env.get_wrapper_attr("neural_map").num_frames == 1
    assert env.observation_space.contains(observation)


def test_clusters_are_extracted_once_a_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []

    def count(*arguments: object) -> list[TargetView]:
        calls.append(1)
        return propose_target_views(*arguments)

    monkeypatch.setattr("anm_gym.wrappers.variability_goal.propose_target_views", count)
    env = VariabilityGoalWrapper(mapped(), preset="paper")
    env.reset(seed=0)
    for _ in range(2):
        env.report_unreachable("test")
    assert len(calls) == 1
    turn_round(env, 1)
    env.report_unreachable("test")
    assert len(calls) == 2
