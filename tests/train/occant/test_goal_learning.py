from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from agents.goal_net import GoalNetSettings
from agents.layout_memory import LayoutSettings
from agents.occant_model import OccAntModel, OccAntSettings, load_model, new_goal_net, save_model
from train.occant.goal_learning import GoalLearner, GoalLearning, coverage, policy_chooser, random_chooser
from train.occant.twin import TwinSettings
from train.occant.twin_world import TwinWorld

MODEL = OccAntSettings(
    anticipates=False,
    goal_net=GoalNetSettings(widths=(4,), kernels=(3, 3)),
    layout=LayoutSettings(map_cells=160, view_cells=16, pool=4),
)
TWIN = TwinSettings(MODEL.layout, MODEL.projection, "area_seen", goals=4, steps_per_goal=10)
TINY = GoalLearning(updates=3, value_updates=0, envs=2, epochs=1, minibatches=2)


def learner_of(world: TwinWorld, settings: GoalLearning = TINY, seed: int = 0) -> GoalLearner:
    return GoalLearner(MODEL, TWIN, settings, [world], None, seed)


def weights_of(learner: GoalLearner) -> list[torch.Tensor]:
    return [value.clone() for value in learner.goal_net.state_dict().values()]


def test_killed_learner_goes_on_bit_for_bit(tmp_path: Path, twin_rooms: TwinWorld) -> None:
    whole = learner_of(twin_rooms)
    list(whole.learn())
    first = learner_of(twin_rooms)
    next(first.learn())
    first.save(tmp_path / "a.safetensors")
    second = learner_of(twin_rooms)
    second.load(tmp_path / "a.safetensors")
    assert second.num_done == 1
    list(second.learn())
    assert second.curve == whole.curve
    assert all(torch.equal(a, b) for a, b in zip(weights_of(whole), weights_of(second), strict=True))


def test_curve_tells_the_area_that_episodes_are_paid_for(twin_rooms: TwinWorld) -> None:
    learner = learner_of(twin_rooms)
    points = list(learner.learn())
    assert learner.curve == points
    assert all(0.0 < point["gain_m2"] < twin_rooms.layout_m2 for point in points)
    # Goals are nearly equally likely at first.
    assert points[0]["entropy"] == pytest.approx(np.log(256), rel=0.01)


def test_ppo_changes_the_actor_which_is_then_a_plain_network(tmp_path: Path, twin_rooms: TwinWorld) -> None:
    learner = learner_of(twin_rooms, replace(TINY, updates=1))
    before = weights_of(learner)
    list(learner.learn())
    assert any(not torch.equal(a, b) for a, b in zip(before, weights_of(learner), strict=True))
    save_model(OccAntModel(MODEL, learner.goal_net, None), tmp_path / "ans.safetensors")
    view = np.random.default_rng(0).random((9, 16, 16), np.float32)
    exported = load_model(tmp_path / "ans.safetensors").score_goals(view)
    with torch.no_grad():
        own = learner.goal_net(torch.from_numpy(view)[None])[0].log_softmax(dim=0).numpy()
    assert exported == pytest.approx(own, abs=2e-2)


def test_policy_that_is_started_from_stays_until_the_critic_has_learned(twin_rooms: TwinWorld) -> None:
    start = new_goal_net(MODEL, 7)
    settings = replace(TINY, updates=2, value_updates=1)
    learner = GoalLearner(MODEL, TWIN, settings, [twin_rooms], None, 0, start)
    expected = list(start.state_dict().values())
    updates = learner.learn()
    next(updates)
    assert all(torch.equal(a, b) for a, b in zip(expected, weights_of(learner), strict=True))
    next(updates)
    assert any(not torch.equal(a, b) for a, b in zip(expected, weights_of(learner), strict=True))


def test_coverage_starts_alike_and_never_falls(twin_rooms: TwinWorld) -> None:
    net = learner_of(twin_rooms).goal_net
    choosers = [random_chooser(256), policy_chooser(net, samples=True), policy_chooser(net, samples=False)]
    curves = [coverage(choose, [twin_rooms], TWIN, None, episodes=2, seed=0) for choose in choosers]
    assert {curve[0] for curve in curves} == {curves[0][0]}
    for curve in curves:
        assert len(curve) == 5
        assert (np.diff(curve) >= 0.0).all()


def test_coverage_tells_a_good_chooser_from_a_bad_one(twin_rooms: TwinWorld) -> None:
    # One always goes where it stands, and sees less than one that goes anywhere.
    twin = replace(TWIN, goals=6, steps_per_goal=25)
    idle = coverage(lambda *_: 7 * 16 + 7, [twin_rooms], twin, None, episodes=6, seed=0)
    roaming = coverage(random_chooser(256), [twin_rooms], twin, None, episodes=6, seed=0)
    assert roaming[-1] > idle[-1]


def test_at_least_one_update_is_needed() -> None:
    with pytest.raises(ValueError, match="` must be >= 1, got 0"):
        GoalLearning(updates=0)
