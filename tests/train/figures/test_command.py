"""The paper's figures: what is behind them is right, and watching changes nothing."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from agents.roster import build_agent
from anm_gym.geometry import CameraSpec, camera_pose
from anm_gym.map.neural_map import NeuralMap
from anm_gym.map.settings import FieldSettings, LossSettings, MapSettings, SamplingSettings, ScheduleSettings
from anm_gym.map.targets import TargetSettings
from anm_gym.map.volume import FREE, OCCUPIED
from train.episodes import make_env
from train.figures.__main__ import (
    FIGURES,
    QUICK_STEPS,
    Request,
    draw_figures,
    main,
    plain,
    play,
    read_options,
)
from train.figures.compute import Compute
from train.figures.landscape import (
    FalsePoints,
    NoFalsePointError,
    Plane,
    choose_false_point,
    landscape,
    predict_at,
    square_extent,
    weights_of,
)
from train.figures.map_probe import (
    draw_rays,
    frozen,
    join_rays,
    predict,
    ray_loss,
    still_copy,
)
from train.figures.slices import cross_section
from train.figures.surface import EDGES_M, medians_by_distance
from train.figures.terms import TermsTrace, running_mean
from train.figures.view import OpenView
from train.runner import run_episode

CAMERA = {"camera": {"width_px": 32, "height_px": 32}}
SPEC = CameraSpec(32, 32)
STEPS = 12


@pytest.fixture(scope="module", autouse=True)
def coarse():
    """Ask for fewer points, times and pixels than a figure for readers needs."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("train.figures.landscape.GRID", 9)
        patch.setattr("train.figures.learning.CHECKPOINTS", 3)
        patch.setattr("train.figures.surface.VOXEL_M", 0.15)
        patch.setattr("train.figures.slices.TARGETS", TargetSettings(resolution=20))
        yield


@pytest.fixture(scope="module")
def drawn(tmp_path_factory, room_file):
    out = tmp_path_factory.mktemp("figures")
    request = Request(tuple(FIGURES), str(room_file), steps=STEPS, out=out, env_options=CAMERA)
    results = {each.name: each for each in draw_figures(request)}
    numbers = {name: json.loads(each.numbers.read_text()) for name, each in results.items() if each.numbers}
    return results, numbers


@pytest.fixture(scope="module")
def seen_wall():
    """Give a map that has seen a wall two metres ahead from the origin."""
    settings = MapSettings(
        field=FieldSettings(width=32),
        sampling=SamplingSettings(rays_per_frame=40, stratified=6, near_surface=4),
        loss=LossSettings(distance_target="normal"),
        schedule=ScheduleSettings(first_iterations=20),
    )
    neural_map = NeuralMap(settings, SPEC, seed=1)
    neural_map.integrate(np.full((32, 32), 2.0, np.float32), camera_pose([0.0, 1.25, 0.0], 0.0))
    return neural_map


def test_every_figure_leaves_picture_and_numbers(drawn):
    results, numbers = drawn
    for name in ("fig3", "fig4", "fig6", "fig7", "eq3"):
        assert results[name].picture.read_bytes().startswith(b"\x89PNG")
        assert numbers[name]["figure"] == name
        assert numbers[name]["steps_done"] == STEPS
        assert numbers[name]["agent"] == "anm:best"


def test_false_point_was_a_zero_crossing_once_and_the_true_point_is_one_at_the_end(drawn):
    result, numbers = drawn[0]["fig2"], drawn[1]["fig2"]
    assert result.picture.read_bytes().startswith(b"\x89PNG")
    data = numbers["data"]
    true_m, false_m = np.abs(data["actual_m"])
    then = data["steps"].index(data["false_step"])
    assert false_m[then] < 0.05
    assert true_m[-1] < 0.15
    assert data["false_distance_m"] > 0.3
    assert 0.0 < data["explained_share"] <= 1.0
    assert np.shape(data["plane_m"]) == (2, len(data["v"]), len(data["u"]))


def test_slices_show_the_agent_in_free_space(drawn):
    data = drawn[1]["fig4"]["data"]
    assert [each["step"] for each in data["slices"]] == [0, 3, 6, 12]
    last = data["slices"][-1]
    assert len(last["trail_xz"]) == STEPS + 1
    assert np.shape(last["sdf_m"]) == (len(data["z_m"]), len(data["x_m"]))
    x, z = last["trail_xz"][-1]
    row, column = np.abs(np.array(data["z_m"]) - z).argmin(), np.abs(np.array(data["x_m"]) - x).argmin()
    assert last["sdf_m"][row][column] > 0.1
    assert np.abs(np.array(data["walls_xz"])[..., 0]).max() == pytest.approx(2.0)


def test_completion_of_the_checkpoints_never_falls(drawn):
    data = drawn[1]["fig6"]["data"]
    assert data["step"] == [4, 8, STEPS]
    assert data["mad_seen_cm"][0] == data["mad_first_cm"][0]
    assert np.diff(data["comp_pct"]).min() >= 0.0
    assert 0.0 < data["mad_seen_cm"][-1] < 50.0
    assert all(0.0 <= each <= 100.0 for each in data["fpr_pct"])


def test_shares_of_the_modules_sum_to_a_hundred(drawn):
    data = drawn[1]["fig7"]["data"]
    assert {"learn", "observe", "goal", "plan", "render"} <= set(data["step_ms"])
    assert {len(values) for values in data["step_ms"].values()} == {STEPS}
    assert sum(data["share_pct"].values()) == pytest.approx(100.0, abs=0.01)
    assert np.mean(data["step_ms"]["learn"]) == pytest.approx(data["mean_ms"]["learn"], rel=1e-4)


def test_terms_are_traced_at_every_step(drawn):
    data = drawn[1]["eq3"]["data"]
    assert data["steps"] == list(range(1, STEPS + 1))
    assert min(data["past"]) > 0.0
    assert len(data["data_shift"]) == len(data["weight_change"]) == STEPS


def test_unseen_surface_is_more_variable_than_seen_surface(drawn):
    data = drawn[1]["fig3"]["data"]
    medians = [value for value in data["median_spread_cm"] if value is not None]
    assert medians[-1] > 1.5 * medians[0]
    assert 0.0 < data["seen_share"] < 1.0


def test_watching_leaves_the_episode_bit_for_bit_the_same(room_file):
    steps = 6
    request = Request(tuple(FIGURES), str(room_file), steps=steps, env_options=CAMERA)
    traces = [make_trace(steps, 0) for make_trace in FIGURES.values()]
    watched, _ = play(request, traces)
    agent = build_agent("anm:best", make_env(str(room_file), steps, CAMERA), 0)
    run_episode(agent.env, agent.policy, 0)
    unwatched = agent.env.get_wrapper_attr("neural_map")
    assert torch.equal(weights_of(watched.neural_map.field), weights_of(unwatched.field))
    np.testing.assert_array_equal(
        watched.pose[[0, 2], 3].astype(np.float32),
        np.asarray(agent.env.get_wrapper_attr("trajectory")[-1].position_xz, np.float32),
    )


def test_plane_goes_through_its_three_weights():
    first, second, third = torch.randn(3, 50, generator=torch.Generator().manual_seed(0))
    plane = Plane.through(first, second, third)
    np.testing.assert_allclose((plane.axes @ plane.axes.T).numpy(), np.eye(2), atol=1e-12)
    coordinates = plane.project(torch.stack([first, second, third]))
    np.testing.assert_allclose(coordinates[0], 0.0, atol=1e-6)
    np.testing.assert_allclose(coordinates[2], [float((third - first).norm()), 0.0], rtol=1e-6, atol=1e-5)
    torch.testing.assert_close(plane.at(*coordinates[1]), second)
    assert plane.explained_share(torch.stack([second, third])) == pytest.approx(1.0)


def test_plane_through_one_line_is_refused():
    with pytest.raises(ValueError, match="must not lie on one line"):
        Plane.through(torch.zeros(4), torch.ones(4), 2.0 * torch.ones(4))


def test_network_at_other_weights_is_the_network_that_has_them(seen_wall):
    network, points = seen_wall.field.network, torch.randn(7, 3)
    weights = weights_of(network)
    torch.testing.assert_close(predict_at(network, weights, points), predict(network, points))
    moved = weights + 0.01 * torch.randn(len(weights))
    other = frozen(network)
    torch.nn.utils.vector_to_parameters(moved, other.parameters())
    torch.testing.assert_close(predict_at(network, moved, points), predict(other, points))
    assert torch.equal(weights_of(network), weights)


def test_landscape_holds_the_prediction_at_its_origin(seen_wall):
    network, points = seen_wall.field.network, torch.tensor([[0.0, 1.0, -1.0], [0.3, 1.0, 2.0]])
    weights = weights_of(network)
    plane = Plane.through(weights, weights + torch.randn(len(weights)), weights + torch.randn(len(weights)))
    values = landscape(network, plane, np.array([-1.0, 0.0]), np.array([0.0, 1.0, 2.0]), points)
    assert values.shape == (2, 3, 2)
    np.testing.assert_allclose(values[:, 0, 1], predict(network, points).numpy(), rtol=1e-5)


def test_extent_is_square_and_holds_the_path():
    u, v = square_extent(np.array([[0.0, 0.0], [4.0, 1.0]]))
    assert np.ptp(u) == pytest.approx(np.ptp(v))
    assert u[0] < 0.0 < 4.0 < u[-1]
    assert v[0] < 0.0 < 1.0 < v[-1]


def at_the_end(mesh, states):
    """Stand in for the end of an episode whose volume holds the given states."""
    volume = SimpleNamespace(state_at=lambda points: np.array(states)[: len(points)])
    return SimpleNamespace(neural_map=SimpleNamespace(volume=volume), scene=SimpleNamespace(mesh=mesh))


def test_false_point_is_the_free_one_farthest_from_any_surface(box_room):
    points = np.array([[0.0, 1.25, 0.0], [0.0, 0.4, 0.0], [9.0, 9.0, 9.0]], np.float32)
    found = [FalsePoints(40, points[:2]), FalsePoints(20, points[1:])]
    end = at_the_end(box_room(), [FREE, OCCUPIED])
    chosen = choose_false_point(found, end)
    assert chosen.step == 20
    np.testing.assert_array_equal(chosen.points, points[1:2])


def test_zero_crossings_at_true_surface_are_no_false_points(box_room):
    near = FalsePoints(20, np.array([[0.0, 0.1, 0.0]], np.float32))
    with pytest.raises(NoFalsePointError, match=r"at the steps 20; give more `--steps`"):
        choose_false_point([near], at_the_end(box_room(), [FREE]))


def test_cross_section_of_a_room_is_its_outline(box_room):
    pieces = cross_section(box_room(4.0, 3.0), 1.25)
    assert np.linalg.norm(pieces[:, 1] - pieces[:, 0], axis=1).sum() == pytest.approx(14.0)
    on_a_wall = np.isclose(np.abs(pieces[..., 0]), 2.0) | np.isclose(np.abs(pieces[..., 1]), 1.5)
    assert on_a_wall.all()


def test_cross_section_above_everything_is_empty(box_room):
    assert cross_section(box_room(), 5.0).shape == (0, 2, 2)


def test_view_sees_each_point_at_its_own_pixel(box_room):
    mesh = box_room(4.0, 3.0)
    view = OpenView(np.array([[-2.2, 0.0, -1.7], [2.2, 1.9, 1.7]]), width_px=80)
    sight = view.see(mesh)
    rows, columns = np.nonzero(sight.is_hit)
    places = view.project(sight.points)
    np.testing.assert_allclose(places, np.stack([columns + 0.5, rows + 0.5], axis=1), atol=1e-3)
    is_floor = np.isclose(sight.points[:, 1], 0.0, atol=1e-5)
    is_far_wall = np.isclose(sight.points[:, 2], -1.5, atol=1e-5)
    assert (is_floor | is_far_wall).all()  # ceiling and near wall show their backs
    assert is_floor.any()
    assert is_far_wall.any()


def test_view_without_width_is_refused():
    with pytest.raises(ValueError, match="`width_px` must be >= 1, got 0"):
        OpenView(np.zeros((2, 3)), width_px=0)


def test_right_prediction_costs_nothing_and_a_wrong_one_does(seen_wall):
    rays = draw_rays(seen_wall.frames, 0, 64, seed=3)
    planar = -2.0 - rays.points[..., 2].reshape(-1)
    assert ray_loss(seen_wall, rays, -planar) == pytest.approx(0.0, abs=0.1)
    assert ray_loss(seen_wall, rays, -planar + 0.3) > 0.25


def test_rays_are_the_same_for_a_seed_and_join_in_order(seen_wall):
    first, again, other = (draw_rays(seen_wall.frames, 0, 16, seed) for seed in (3, 3, 4))
    torch.testing.assert_close(first.points, again.points)
    joined = join_rays([first, other])
    torch.testing.assert_close(joined.points[len(first.points) :], other.points)
    assert len(joined.pixels.depth_m) == len(first.points) + len(other.points)


def test_step_without_learning_has_no_change_by_weights(seen_wall):
    trace = TermsTrace(steps=100, seed=0)
    for step in range(3):
        trace.take(SimpleNamespace(step=step, neural_map=seen_wall, info={"is_keyframe": step == 2}))
    terms = trace.finish(None)
    np.testing.assert_array_equal(terms.weight_change, 0.0)
    np.testing.assert_array_equal(terms.keyframes, [2])
    assert np.abs(terms.data_shift).max() < 0.5 * terms.past.max() + 0.05


def test_copy_answers_without_disturbing_the_map(seen_wall):
    before = seen_wall.state()["generator"].clone()
    still_copy(seen_wall).variability(np.zeros((2, 3), np.float32))
    assert torch.equal(seen_wall.state()["generator"], before)


def test_running_mean_leaves_out_what_is_unknown():
    values = np.array([1.0, np.nan, 3.0, 5.0])
    np.testing.assert_allclose(running_mean(values, 3), [1.0, 2.0, 4.0, 4.0])


def test_medians_are_taken_between_the_edges():
    distance = np.array([0.01, 0.02, 0.03, 0.15])
    medians = medians_by_distance(distance, np.array([1.0, 2.0, 9.0, 7.0]))
    assert medians[0] == 2.0
    assert medians[2] == 7.0
    assert len(medians) == len(EDGES_M) - 1
    assert np.isnan(medians[[1, 3, 4]]).all()


def test_compute_adds_up_its_steps():
    none = np.zeros(0, np.int64)
    compute = Compute({"learn": np.array([1.0, 5.0]), "plan": np.array([1.0, 1.0])}, none, none)
    assert compute.mean_ms == {"learn": 3.0, "plan": 1.0}
    assert compute.share_pct == {"learn": 75.0, "plan": 25.0}


def test_numbers_become_plain_json():
    value = {"a": np.array([[1, 2]]), "b": np.float32(0.1), "c": (np.nan, np.inf), "d": np.bool_(True)}
    assert plain(value) == {"a": [[1, 2]], "b": 0.1, "c": [None, None], "d": True}
    assert json.dumps(plain(value), allow_nan=False)


def test_unknown_figure_lists_the_choices():
    with pytest.raises(ValueError, match="unknown figure 'fig9'; choose one of: fig2, fig3"):
        Request(("fig9",))
    with pytest.raises(ValueError, match="`steps` must be >= 1, got 0"):
        Request(("fig2",), steps=0)


def test_numbers_of_several_figures_do_not_go_to_one_file(tmp_path):
    with pytest.raises(ValueError, match="`json` must be given for a single figure, got 2 figures"):
        draw_figures(Request(("fig6", "fig7")), tmp_path / "numbers.json")


def options_of(scene, out, steps):
    """Write the options of a small run."""
    return [f"--scene={scene}", f"--steps={steps}", f"--out={out}", f"--env={json.dumps(CAMERA)}"]


def test_quick_episode_has_few_steps_unless_others_are_given():
    assert read_options(["fig7", "--quick"]).steps == QUICK_STEPS
    assert read_options(["fig7", "--quick", "--steps", "7"]).steps == 7
    assert read_options(["fig7"]).steps == Request(("fig7",)).steps


def test_figure_of_an_episode_takes_no_rows(capsys):
    with pytest.raises(SystemExit, match="2"):
        main(["fig7", "--run", "runs/table1/open-homes"])
    assert "--run must not be given with fig7: only fig5 reads a table" in capsys.readouterr().err


def test_command_draws_one_figure_and_says_where(room_file, tmp_path, capsys):
    numbers = tmp_path / "numbers.json"
    main(["fig7", *options_of(room_file, tmp_path, steps=4), "--json", str(numbers)])
    assert "fig7: " in capsys.readouterr().out
    assert json.loads(numbers.read_text())["steps_done"] == 4
    assert len(list(tmp_path.glob("fig7_anm_best_room_0_4_*.png"))) == 1, "budget and environment are named"


def test_command_ends_with_an_error_where_there_is_no_picture(room_file, tmp_path, capsys, monkeypatch):
    def nothing_false(*_arguments):
        raise NoFalsePointError("there is none")

    monkeypatch.setattr("train.figures.landscape.choose_false_point", nothing_false)
    with pytest.raises(SystemExit, match="2"):
        main(["fig2", *options_of(room_file, tmp_path, steps=3)])
    assert "error: fig2: NoFalsePointError: there is none" in capsys.readouterr().err
