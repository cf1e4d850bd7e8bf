"""The recorder: curve, goals, CPU time by module; and the scores made of them."""

from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest

from anm_gym.mesh import TriangleMesh
from train.recorder import EpisodeRecorder, SimulatorClock, env_layers, find_attribute
from train.runner import run_episode
from train.scores import map_scores


class LineEnv(gym.Env):
    """Moves 1 m along x at each step, for four steps; sees nothing."""

    observation_space = gym.spaces.Box(0, 1, (1,), np.float32)
    action_space = gym.spaces.Discrete(2)
    camera = "camera"
    scene = SimpleNamespace(
        mesh=SimpleNamespace(content_hash="abcd"), storey_mesh=SimpleNamespace(areas_m2=np.array([2.0, 3.0]))
    )

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.trajectory = [SimpleNamespace(position_xz=np.zeros(2), heading_rad=0.5)]
        return self._observe(), {"collisions": 0}

    def step(self, action):
        x = len(self.trajectory)
        self.trajectory.append(SimpleNamespace(position_xz=np.array([x, 0.0]), heading_rad=0.5))
        return self._observe(), 0.0, x == 4, False, {"collisions": x // 2}

    def _observe(self):
        return {"depth": np.zeros((2, 2, 1), np.float32), "world_from_camera": np.eye(4)}


class GoalsWrapper(gym.Wrapper):
    """Has a new goal every second step and claims 40 ms in all."""

    def __init__(self, env):
        super().__init__(env)
        self.compute_ms = {"goal": 40.0}

    @property
    def goals(self):
        count = (len(self.get_wrapper_attr("trajectory")) + 1) // 2
        return [SimpleNamespace(position_xz=np.array([i, 0.0]), reason="view") for i in range(count)]

    @property
    def failures(self):
        return [SimpleNamespace(position_xz=goal.position_xz, reason="no way") for goal in self.goals[1:]]


class Meter:
    """Counts frames: 10 % each."""

    curve = ()

    def observe(self, depth, camera, pose):
        assert camera == "camera"
        self.curve = (*self.curve, 10.0 * (len(self.curve) + 1))

    @property
    def comp_pct(self):
        return self.curve[-1]

    @property
    def curve_pct(self):
        return np.array(self.curve)


POLICY = SimpleNamespace(predict=lambda observation, **_: (1, None), compute_ms={"plan": 4.0})


@pytest.fixture
def recorder():
    return EpisodeRecorder(Meter(), POLICY)


def test_trajectory_holds_poses_goals_and_curves(recorder):
    run_episode(GoalsWrapper(LineEnv()), POLICY, 3, recorder)
    trajectory = recorder.trajectory("line", 3, {"rgb": False})
    np.testing.assert_array_equal(trajectory.poses[:, 0], [0, 1, 2, 3, 4])
    np.testing.assert_array_equal(trajectory.curves["comp_pct"], [10, 20, 30, 40, 50])
    np.testing.assert_array_equal(trajectory.curves["collisions"], [0, 0, 1, 1, 2])
    np.testing.assert_array_equal(trajectory.goals, [[0, 0, 0], [1, 0, 2], [2, 0, 4]])
    assert trajectory.goal_reasons == ("view",) * 3
    assert trajectory.surface_m2 == 5.0
    np.testing.assert_array_equal(trajectory.failures, [[1, 0, 2], [2, 0, 4]])
    assert trajectory.failure_reasons == ("no way",) * 2
    assert (trajectory.scene_hash, trajectory.env_options) == ("abcd", {"rgb": False})


def test_agent_without_goals_has_none(recorder):
    run_episode(LineEnv(), POLICY, 0, recorder)
    assert recorder.trajectory("line", 0, {}).goals.shape == (0, 3)


def test_cpu_time_is_by_module_and_step(recorder):
    cpu_ms = run_episode(GoalsWrapper(SimulatorClock(LineEnv())), POLICY, 0, recorder).scores["cpu_ms"]
    assert (cpu_ms["goal"], cpu_ms["plan"]) == (10.0, 1.0)
    assert 0.0 <= cpu_ms["render"] <= cpu_ms["total"]
    assert cpu_ms["other"] >= 0.0


def test_scoring_is_not_charged_to_the_agent():
    class SlowMeter(Meter):
        def observe(self, depth, camera, pose):
            super().observe(depth, camera, pose)
            sum(range(3_000_000))

    scores = run_episode(LineEnv(), POLICY, 0, EpisodeRecorder(SlowMeter())).scores
    assert scores["cpu_ms"]["total"] < 10.0


def test_progress_hears_every_step():
    heard = []
    run_episode(LineEnv(), POLICY, 0, EpisodeRecorder(Meter(), POLICY, heard.append))
    assert heard == [20.0, 30.0, 40.0, 50.0]


def test_attribute_is_found_in_any_layer():
    env = gym.wrappers.TimeLimit(GoalsWrapper(LineEnv()), 3)
    assert find_attribute(env, "camera") == "camera"
    assert find_attribute(env, "neural_map") is None
    assert [type(layer).__name__ for layer in env_layers(env)] == ["TimeLimit", "GoalsWrapper", "LineEnv"]


def test_perfect_map_has_no_error(known_map, monkeypatch):
    """The map of a room whose field is exact and whose surface is the room itself."""
    monkeypatch.setattr("train.calibration.NUM_FREE", 600)
    neural_map = known_map()
    room = neural_map.room
    row = map_scores(neural_map, SimpleNamespace(mesh=room, storey_mesh=room, storey_top_y_m=2.5))
    assert row["mad_cm"] == pytest.approx(0.0, abs=1e-4)
    assert row["fpr_pct"] == 0.0
    assert row["mad_cm_official"] == pytest.approx(0.0, abs=1e-4)
    assert row["fpr_pct_official"] == pytest.approx(row["fpr_pct_official_floor"], abs=0.2)
    assert row["free_err_cm"] == pytest.approx(0.0, abs=1e-4)


def test_surface_of_another_storey_is_not_false(known_map, monkeypatch):
    """What was seen through a stairwell is true, though nobody asks for it."""
    monkeypatch.setattr("train.calibration.NUM_FREE", 600)
    neural_map = known_map()
    room = neural_map.room
    floor = TriangleMesh(room.vertices, room.faces[(room.triangles[:, :, 1] == 0.0).all(axis=1)])
    row = map_scores(neural_map, SimpleNamespace(mesh=room, storey_mesh=floor, storey_top_y_m=2.5))
    assert row["fpr_pct"] == 0.0
    assert row["acc_cm"] == pytest.approx(0.0, abs=1e-4)
    assert row["fpr_pct_official"] > 20.0, "the official measure knows the storey alone"
