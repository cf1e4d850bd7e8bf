"""Trajectories on the disk."""

import json

import numpy as np
import pytest

from train.trajectory import Trajectory


def make_trajectory(rng):
    poses = rng.normal(size=(5, 3))
    actions = np.array([1, 2, 3, 1], np.int8)
    curves = {"comp_pct": rng.uniform(size=5)}
    failures = {
        "failures": rng.normal(size=(1, 3)),
        "failure_reasons": ["no way"],
        "goal_reasons": ["view"] * 2,
    }
    return Trajectory(
        "home:flat:1",
        3,
        actions,
        poses,
        {"camera": {"width_px": 64}},
        np.ones((2, 3)),
        curves,
        **failures,
        surface_m2=3.5,
    )


def test_trajectory_comes_back_bit_for_bit(tmp_path):
    saved = make_trajectory(np.random.default_rng(0))
    path = tmp_path / "sub" / "trajectory.npz"
    saved.save(path)
    loaded = Trajectory.load(path)
    assert (loaded.scene, loaded.seed, loaded.env_options) == (saved.scene, saved.seed, saved.env_options)
    assert (loaded.goal_reasons, loaded.failure_reasons) == (["view", "view"], ["no way"])
    np.testing.assert_allclose(loaded.completed_m2, 0.035 * loaded.curves["comp_pct"])
    for name in ("actions", "poses", "goals", "failures"):
        assert getattr(loaded, name).tobytes() == getattr(saved, name).tobytes()
    assert loaded.curves["comp_pct"].tobytes() == saved.curves["comp_pct"].tobytes()


def test_file_without_failures_is_read(tmp_path):
    """Files of earlier versions have none."""
    header = {"scene": "a", "seed": 0, "env_options": {}, "scene_hash": "h"}
    arrays = {"actions": np.zeros(1, np.int8), "poses": np.zeros((2, 3)), "goals": np.zeros((0, 3))}
    np.savez(tmp_path / "old.npz", header=np.array(json.dumps(header)), **arrays)
    loaded = Trajectory.load(tmp_path / "old.npz")
    assert loaded.failures.shape == (0, 3)
    assert len(loaded.goal_reasons) == len(loaded.failure_reasons) == 0
    assert np.isnan(loaded.surface_m2)


def test_path_length_adds_up_moves_and_ignores_turns():
    poses = np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0], [3.0, 4.0, 1.0], [3.0, 5.0, 1.0]])
    trajectory = Trajectory("a", 0, np.zeros(3, np.int8), poses)
    np.testing.assert_allclose(trajectory.path_m, [0.0, 5.0, 5.0, 6.0])


def test_missing_pose_is_refused():
    with pytest.raises(ValueError, match="`poses` must be one more than the 2 actions, got 2"):
        Trajectory("a", 0, np.zeros(2, np.int8), np.zeros((2, 3)))


def test_other_file_is_refused(tmp_path):
    path = tmp_path / "other.npz"
    np.savez(path, weights=np.zeros(3))
    with pytest.raises(ValueError, match=r"must be a trajectory\.npz"):
        Trajectory.load(path)


def test_pickled_objects_are_refused(tmp_path):
    path = tmp_path / "evil.npz"
    np.savez(path, header=np.array({"scene": "a"}, dtype=object))
    with pytest.raises(ValueError, match=r"must be a trajectory\.npz"):
        Trajectory.load(path)


def test_truncated_file_is_refused_by_name(tmp_path):
    path = tmp_path / "trajectory.npz"
    make_trajectory(np.random.default_rng(0)).save(path)
    path.write_bytes(path.read_bytes()[:-40])
    with pytest.raises(ValueError, match=r"must be a trajectory\.npz"):
        Trajectory.load(path)


def test_file_without_poses_is_refused_by_name(tmp_path):
    path = tmp_path / "trajectory.npz"
    np.savez(path, header=np.array("{}"))
    with pytest.raises(ValueError, match=r"must be a trajectory\.npz"):
        Trajectory.load(path)
