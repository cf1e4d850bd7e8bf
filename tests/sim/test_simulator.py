import numpy as np
import pytest

from anm_gym.actions import MOVES, Action
from anm_gym.errors import EpisodeError
from anm_gym.geometry import CameraSpec
from anm_gym.sim.simulator import Simulator

TINY = CameraSpec(width_px=16, height_px=16)


@pytest.fixture
def simulator(two_rooms):
    simulator = Simulator(two_rooms, 0.0, TINY)
    simulator.place((-2.0, 0.0), 0.0)
    return simulator


def test_a_forward_step_goes_where_the_agent_looks(simulator):
    motion = simulator.act(Action.MOVE_FORWARD)
    np.testing.assert_allclose(simulator.state.position_xz, [-2.0, -0.065])
    assert motion.travelled_m == pytest.approx(0.065)
    assert not motion.collided


def test_thirty_six_left_turns_come_full_circle(simulator):
    simulator.act(Action.TURN_LEFT)
    assert simulator.state.heading_rad == pytest.approx(np.deg2rad(10.0))
    for _ in range(35):
        simulator.act(Action.TURN_LEFT)
    assert np.cos(simulator.state.heading_rad) == pytest.approx(1.0)
    assert simulator.state.position_xz.tolist() == [-2.0, 0.0]


def test_a_right_turn_undoes_a_left_turn(simulator):
    simulator.act(Action.TURN_LEFT)
    simulator.act(Action.TURN_RIGHT)
    assert simulator.state.heading_rad == pytest.approx(0.0)


def test_stop_changes_nothing(simulator):
    before = simulator.state
    assert not simulator.act(Action.STOP).collided
    assert simulator.state is before


def test_noise_scales_the_step_and_bends_the_turn(simulator):
    assert simulator.act(Action.MOVE_FORWARD, forward_scale=1.4).travelled_m == pytest.approx(0.091)
    assert simulator.act(Action.MOVE_FORWARD, forward_scale=-0.3).travelled_m == 0.0
    simulator.act(Action.TURN_LEFT, turn_offset_rad=0.02)
    assert simulator.state.heading_rad == pytest.approx(np.deg2rad(10.0) + 0.02)


def test_the_camera_stands_above_the_agent_and_looks_ahead(simulator):
    simulator.place((-2.0, 0.5), np.pi / 2)
    pose = simulator.world_from_camera
    np.testing.assert_allclose(pose[:3, 3], [-2.0, 1.25, 0.5])
    np.testing.assert_allclose(-pose[:3, 2], [-1.0, 0.0, 0.0], atol=1e-12)
    assert simulator.depth_m()[8, 8] == pytest.approx(2.0, abs=1e-4)


def test_the_camera_follows_a_raised_floor(box_room):
    mesh = box_room()
    raised = type(mesh)(mesh.vertices + np.array([0.0, 3.0, 0.0]), mesh.faces)
    simulator = Simulator(raised, 3.0, TINY)
    simulator.place((0.0, 0.0), 0.0)
    assert simulator.world_from_camera[1, 3] == pytest.approx(4.25)


def test_two_thousand_random_actions_never_leave_the_navigable_floor(two_rooms, rng):
    simulator = Simulator(two_rooms, 0.0, TINY)
    simulator.place(simulator.grid.sample_position(rng), 0.3)
    weights, collisions = [0.7, 0.15, 0.15], 0
    for action in rng.choice(MOVES, 2000, p=weights):
        before = simulator.state.position_xz
        motion = simulator.act(int(action))
        collisions += motion.collided
        assert simulator.grid.component_at(simulator.state.position_xz) == 1
        assert np.linalg.norm(motion.position_xz - before) == pytest.approx(motion.travelled_m, abs=1e-9)
        assert motion.travelled_m <= simulator.forward_step_m + 1e-9
    assert collisions > 50


def test_the_same_actions_replay_bit_for_bit(two_rooms):
    def play():
        simulator = Simulator(two_rooms, 0.0, TINY)
        generator = np.random.default_rng(5)
        simulator.place(simulator.grid.sample_position(generator), 1.0)
        states = []
        for action in generator.choice(MOVES, 60):
            simulator.act(int(action))
            states.append(np.append(simulator.state.position_xz, simulator.state.heading_rad))
        return np.array(states), simulator.depth_m()

    for first, second in zip(play(), play(), strict=True):
        np.testing.assert_array_equal(first, second)


def test_a_corridor_is_walked_straight(corridor):
    simulator = Simulator(corridor, 0.0, TINY)
    assert simulator.geodesic_distance_m((-4.5, 0.0), (4.5, 0.0)) == pytest.approx(9.0, abs=0.03)
    path = simulator.shortest_path((-4.51, 0.02), (4.47, -0.03))
    np.testing.assert_allclose(path[[0, -1]], [[-4.51, 0.02], [4.47, -0.03]])


def test_the_way_between_rooms_leads_through_the_door(simulator):
    length_m = simulator.geodesic_distance_m((-2.0, 1.7), (2.0, 1.7))
    bend = np.hypot(2.0, 1.7 - 0.4)
    assert 2 * bend <= length_m <= 2 * bend * 1.09
    path = simulator.shortest_path((-2.0, 1.7), (2.0, 1.7))
    assert abs(path[np.abs(path[:, 0]).argmin(), 1]) <= 0.45
    assert np.linalg.norm(np.diff(path, axis=0), axis=1).sum() == pytest.approx(length_m)


def test_a_place_in_a_wall_is_unreachable(simulator):
    assert simulator.geodesic_distance_m((-2.0, 0.0), (0.0, 1.5)) == np.inf
    assert simulator.shortest_path((-2.0, 0.0), (30.0, 0.0)) is None


def test_the_distance_to_where_one_stands_is_zero(simulator):
    assert simulator.geodesic_distance_m((-2.0, 0.0), (-2.0, 0.0)) == 0.0


def test_wherever_the_agent_stops_a_way_leads_back(simulator, rng):
    for action in rng.choice(MOVES, 300, p=[0.8, 0.1, 0.1]):
        simulator.act(int(action))
    assert simulator.geodesic_distance_m(simulator.state.position_xz, (2.0, 0.0)) < 10.0


def test_a_placed_position_is_a_copy(simulator):
    position = np.array([1.0, 1.0])
    simulator.place(position, 0.0)
    position[:] = 0.0
    assert simulator.state.position_xz.tolist() == [1.0, 1.0]


def test_the_agent_cannot_be_placed_in_a_wall(simulator):
    with pytest.raises(
        EpisodeError, match=r"navigable floor, got x, z = \[0.0, 1.5\]; the nearest is \[-?0\.\d+, 1\."
    ):
        simulator.place((0.0, 1.5), 0.0)


def test_the_agent_cannot_be_placed_far_outside(simulator):
    with pytest.raises(EpisodeError, match="the nearest is far away"):
        simulator.place((900.0, 0.0), 0.0)


def test_the_agent_must_be_placed_before_it_acts(two_rooms):
    with pytest.raises(EpisodeError, match="must be placed first"):
        Simulator(two_rooms, 0.0, TINY).act(Action.MOVE_FORWARD)


def test_an_unknown_action_is_refused(simulator):
    with pytest.raises(ValueError, match="9 is not a valid Action"):
        simulator.act(9)


@pytest.mark.parametrize("steps", [{"forward_step_m": 0.0}, {"turn_step_deg": -1.0}])
def test_steps_must_have_a_length(two_rooms, steps):
    with pytest.raises(ValueError, match="`forward_step_m` and `turn_step_deg` must be > 0"):
        Simulator(two_rooms, 0.0, TINY, **steps)


@pytest.mark.render
def test_the_colour_picture_has_the_size_of_the_depth_image(simulator):
    assert simulator.rgb().shape == (16, 16, 3)
