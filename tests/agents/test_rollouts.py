import numpy as np
import pytest

from agents.cost_to_go import CostSettings, Floor, cost_to_go
from agents.rollouts import Move, RolloutSettings, best_move, turn_towards
from anm_gym.actions import Action
from anm_gym.sim.grid import GridFrame

FRAME = GridFrame((-3.0, -3.0), 0.05, (120, 120))
SETTINGS = RolloutSettings(forward_step_m=0.065, turn_step_rad=float(np.deg2rad(10.0)))
COSTS = CostSettings()


def move(
    goal: tuple[float, float],
    heading_deg: float = 0.0,
    wall: tuple[slice, slice] | None = None,
    last: Action | None = None,
    blocked_deg: tuple[float, ...] = (),
) -> Move | None:
    """Best move from the origin on an open floor of 6 x 6 m with an optional wall."""
    occupied = np.zeros(FRAME.shape, bool)
    if wall is not None:
        occupied[wall] = True
    nowhere = np.zeros(FRAME.shape, bool)
    floor = Floor(FRAME, occupied, unknown=nowhere, stood=nowhere)
    origin = np.array([0.01, 0.01])
    ways = cost_to_go(floor, origin, goal, COSTS, 0.0)
    assert ways is not None
    blocked = [float(np.deg2rad(angle)) for angle in blocked_deg]
    return best_move(floor, ways, origin, np.deg2rad(heading_deg), SETTINGS, COSTS, last, blocked)


def action(*arguments: object, **options: object) -> Action:
    chosen = move(*arguments, **options)  # type: ignore[arg-type]
    assert chosen is not None
    return chosen.action


@pytest.mark.parametrize(
    ("goal", "expected"),
    [
        ((0.0, -1.0), Action.MOVE_FORWARD),
        ((-1.0, 0.0), Action.TURN_LEFT),
        ((1.0, 0.0), Action.TURN_RIGHT),
        ((-0.5, 1.5), Action.TURN_LEFT),
        ((0.5, 1.5), Action.TURN_RIGHT),
    ],
)
def test_agent_turns_to_the_goal_then_walks(goal: tuple[float, float], expected: Action) -> None:
    assert action(goal) is expected


def test_expected_steps_are_those_of_turn_and_walk() -> None:
    chosen = move((-1.3, 0.0))
    assert chosen is not None
    assert chosen.remaining_steps == pytest.approx(9 + 20, abs=2.0)


def test_small_error_far_from_the_goal_is_walked_off() -> None:
    assert action((0.0, -2.0), heading_deg=4.0) is Action.MOVE_FORWARD


def test_wall_ahead_is_gone_round() -> None:
    wall = (np.s_[50:52], np.s_[50:75])
    assert action((0.0, -2.0), wall=wall) is Action.TURN_LEFT


def test_last_turn_is_not_undone_for_little() -> None:
    assert action((0.0, -2.0), heading_deg=9.0) is Action.TURN_RIGHT
    assert action((0.0, -2.0), heading_deg=9.0, last=Action.TURN_LEFT) is Action.MOVE_FORWARD
    assert action((2.0, 0.0), last=Action.TURN_LEFT) is Action.TURN_RIGHT


def test_blocked_heading_is_not_tried_again() -> None:
    assert action((0.0, -2.0), blocked_deg=(0.0,)) in (Action.TURN_LEFT, Action.TURN_RIGHT)


def test_agent_that_is_blocked_all_round_has_no_move() -> None:
    assert move((0.0, -2.0), blocked_deg=tuple(range(0, 360, 10))) is None


def test_turn_takes_the_short_way() -> None:
    assert turn_towards(np.deg2rad(20.0)) is Action.TURN_LEFT
    assert turn_towards(np.deg2rad(200.0)) is Action.TURN_RIGHT
