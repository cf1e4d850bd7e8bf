from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from agents.goal_net import GoalNetSettings
from agents.layout_memory import LayoutMemory, LayoutSettings
from agents.occant_model import OccAntSettings
from train.occant.goal_gains import GainLearner, GainLearning, GoalGains, gains_of, turn_views
from train.occant.twin import TwinSettings
from train.occant.twin_world import TwinWorld

MODEL = OccAntSettings(
    anticipates=False,
    goal_net=GoalNetSettings(widths=(8,), kernels=(3, 3)),
    layout=LayoutSettings(map_cells=160, view_cells=16, pool=4),
)
TWIN = TwinSettings(MODEL.layout, MODEL.projection, "area_seen", goals=3, steps_per_goal=10)


def view_of(heading_rad: float) -> np.ndarray:
    return LayoutMemory(MODEL.layout).view(np.array([0.0, 0.0, heading_rad]))


@pytest.mark.parametrize("quarters", [0, 1, 2, 3])
def test_turned_view_is_that_of_a_turned_agent(quarters: int) -> None:
    turned, _ = turn_views(view_of(0.3)[None], np.array([0]), quarters, False)
    # A view has north up, so a world that turns counter-clockwise is an agent that does.
    assert turned[0, 6:] == pytest.approx(view_of(0.3 + quarters * np.pi / 2)[6:], abs=1e-6)


def test_mirrored_view_is_that_of_a_mirrored_agent() -> None:
    mirrored, _ = turn_views(view_of(0.3)[None], np.array([0]), 0, True)
    assert mirrored[0, 6:] == pytest.approx(view_of(-0.3)[6:], abs=1e-6)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("quarters", [0, 1, 2, 3])
def test_goal_keeps_its_place_in_what_is_shown(quarters: int, mirrored: bool) -> None:
    views = np.zeros((1, 9, 16, 16), np.float32)
    views[0, 3, 2, 5] = 1.0
    turned, goals = turn_views(views, np.array([2 * 16 + 5]), quarters, mirrored)
    assert turned[0, 3].reshape(-1)[goals[0]] == 1.0
    assert turned[0, 3].sum() == 1.0


def test_gathered_gains_are_what_episodes_pay_and_are_kept(tmp_path: Path, twin_rooms: TwinWorld) -> None:
    path = tmp_path / "gains.safetensors"
    first = gains_of([twin_rooms], TWIN, None, 2, 0, path)
    again = gains_of([], TWIN, None, 2, 0, path)
    assert first.views.shape == (6, 9, 16, 16)
    assert first.gains_m2.sum() < 2 * twin_rooms.layout_m2
    assert (first.gains_m2 >= 0.0).all()
    assert first.gains_m2.max() > 0.0
    assert all(np.array_equal(a, b) for a, b in zip(vars(first).values(), vars(again).values(), strict=True))


def gains_near_what_is_occupied(count: int) -> GoalGains:
    """Goals that pay 2 m² where the far view is occupied, and nothing elsewhere."""
    rng = np.random.default_rng(0)
    views = np.zeros((count, 9, 16, 16), np.uint8)
    views[:, 3] = 255 * (rng.random((count, 16, 16)) < 0.5)
    goals = rng.integers(256, size=count)
    paid = views[:, 3].reshape(count, -1)[np.arange(count), goals] > 0
    return GoalGains(views, goals, 2.0 * paid.astype(np.float32))


def test_learned_policy_prefers_goals_that_pay() -> None:
    settings = GainLearning(passes=16_000, learning_rate=1e-2, logit_per_m2=3.0)
    learner = GainLearner(MODEL, settings, 0)
    gains = gains_near_what_is_occupied(500)
    losses = list(learner.learn(gains))
    assert np.mean(losses[-20:]) < 0.2 < 0.8 < np.mean(losses[:5])
    view = torch.from_numpy(gains.views[:1].astype(np.float32) / 255.0)
    logits = learner.goal_net()(view)[0].detach().numpy()
    occupied = gains.views[0, 3].reshape(-1) > 0
    # 2 m² more, three logits each.
    assert logits[occupied].mean() - logits[~occupied].mean() == pytest.approx(6.0, abs=1.5)


def test_killed_learner_goes_on_bit_for_bit(tmp_path: Path) -> None:
    gains, settings = gains_near_what_is_occupied(50), GainLearning(passes=256)
    whole, first, second = (GainLearner(MODEL, settings, 0) for _ in range(3))
    list(whole.learn(gains))
    next(first.learn(gains))
    first.save(tmp_path / "a.safetensors")
    second.load(tmp_path / "a.safetensors")
    assert second.num_done == 1
    list(second.learn(gains))
    assert second.curve == whole.curve
    for a, b in zip(whole.scores.parameters(), second.scores.parameters(), strict=True):
        assert torch.equal(a, b)


def test_goals_and_passes_are_checked() -> None:
    with pytest.raises(ValueError, match="`episodes` must be >= 0"):
        replace(GainLearning(), episodes=-1)
