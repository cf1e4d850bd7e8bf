import pytest
import torch

from agents.goal_net import GoalNet, GoalNetSettings
from agents.layout_memory import VIEW_CHANNELS


def test_every_cell_of_the_view_gets_a_score() -> None:
    net = GoalNet(GoalNetSettings(widths=(4, 2), kernels=(3, 3, 5)))
    assert net(torch.zeros(3, VIEW_CHANNELS, 16, 16)).shape == (3, 256)


def test_a_place_is_judged_by_what_lies_around_it() -> None:
    torch.manual_seed(0)
    net = GoalNet().double()
    maps = torch.rand(1, VIEW_CHANNELS, 48, 48, dtype=torch.float64)
    moved = torch.roll(maps, (3, 5), (2, 3))
    scores, again = (net(values).reshape(48, 48) for values in (maps, moved))
    assert torch.allclose(again[20:40, 20:40], scores[17:37, 15:35])


def test_layers_and_kernels_must_agree() -> None:
    with pytest.raises(ValueError, match="`kernels` must have one more entry than `widths`, got 2 and 2"):
        GoalNetSettings(widths=(4, 4), kernels=(3, 3))
