from collections.abc import Callable
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest
import torch

from anm_gym.errors import MapError
from anm_gym.geometry import CameraSpec, camera_pose
from anm_gym.map.neural_map import NeuralMap
from anm_gym.map.presets import map_settings
from anm_gym.map.settings import MapSettings, ScheduleSettings

RoomDistance = Callable[[np.ndarray], np.ndarray]


def small(preset: str = "fast", **schedule: float) -> MapSettings:
    """A preset with a narrow network."""
    settings = map_settings(preset)
    return replace(
        settings,
        field=replace(settings.field, width=64),
        schedule=replace(settings.schedule, **schedule),
    )


@pytest.fixture(scope="module")
def learned(tour) -> NeuralMap:
    """A map of the room, learned in two turns."""
    neural_map = NeuralMap(map_settings("fast"), tour.camera)
    for _ in range(2):
        for depth, pose in zip(tour.depths, tour.poses, strict=True):
            neural_map.integrate(depth, pose)
    return neural_map


def test_surface_of_a_box_room_is_learned_to_four_centimetres(learned: NeuralMap) -> None:
    assert np.abs(learned.sdf(learned.cloud.points)).mean() < 0.04


def test_distances_inside_a_box_room_are_learned_to_eight_centimetres(
    learned: NeuralMap, room_distance: RoomDistance, rng: np.random.Generator
) -> None:
    points = rng.uniform([-1.7, 0.2, -1.2], [1.7, 2.3, 1.2], (500, 3)).astype(np.float32)
    predicted = learned.sdf(points)
    assert np.abs(predicted - room_distance(points)).mean() < 0.08
    assert (predicted > 0.0).mean() > 0.99


def test_gradient_points_away_from_the_nearest_wall(learned: NeuralMap) -> None:
    near_wall = np.array([[1.8, 1.2, 0.0], [-1.8, 1.3, 0.1], [0.0, 1.2, 1.3]], np.float32)
    inward = np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    gradient = learned.gradient(near_wall)
    cosine = (gradient * inward).sum(axis=1) / np.linalg.norm(gradient, axis=1)
    assert (cosine > 0.9).all()


def test_mesh_lies_on_the_walls(learned: NeuralMap, room_distance: RoomDistance) -> None:
    surface = learned.mesh(voxel_m=0.1)
    assert np.abs(room_distance(surface.vertices)).mean() < 0.05
    assert len(surface.faces) > 1000


def test_surface_never_seen_is_more_variable_than_surface_seen(learned: NeuralMap) -> None:
    seen = learned.cloud.points[::50]
    outside = seen + np.array([6.0, 0.0, 6.0], np.float32)
    assert np.median(learned.variability(outside)) > 3.0 * np.median(learned.variability(seen))


def test_same_seed_learns_the_same_map_bit_for_bit(tour) -> None:
    points = tour.poses[0][None, :3, 3]
    settings = small(first_iterations=5, iterations=2)
    predictions = []
    for _ in range(2):
        neural_map = NeuralMap(settings, tour.camera, seed=4)
        for depth, pose in zip(tour.depths[:4], tour.poses[:4], strict=True):
            neural_map.integrate(depth, pose)
        predictions.append(neural_map.sdf(points))
    assert predictions[0] == predictions[1]
    other = NeuralMap(settings, tour.camera, seed=5)
    other.integrate(tour.depths[0], tour.poses[0])
    assert other.sdf(points) != predictions[0]


@pytest.mark.parametrize("preset", ["paper", "released"])
def test_paper_and_released_presets_learn(preset: str, tour) -> None:
    settings = small(preset, first_iterations=20, iterations=2, keyframe_iterations=4)
    neural_map = NeuralMap(settings, tour.camera)
    updates = [
        neural_map.integrate(depth, pose) for depth, pose in zip(tour.depths[:5], tour.poses[:5], strict=True)
    ]
    assert updates[0].iterations == 20
    assert all(update.iterations == (4 if update.is_keyframe else 2) for update in updates[1:])
    assert min(updates[-1].distance_loss, updates[-1].eikonal_loss, updates[-1].normal_loss) > 0.0


def test_map_with_dropout_learns_and_is_variable(tour) -> None:
    settings = small("paper", first_iterations=20)
    settings = replace(
        settings,
        field=replace(settings.field, dropout=0.05),
        variability=replace(settings.variability, family="dropout", draws=5),
    )
    neural_map = NeuralMap(settings, tour.camera)
    neural_map.integrate(tour.depths[0], tour.poses[0])
    points = neural_map.cloud.points[:20]
    assert (neural_map.variability(points) > 0.0).all()
    assert np.array_equal(neural_map.sdf(points), neural_map.sdf(points))


def test_depth_of_another_size_is_refused(tour) -> None:
    with pytest.raises(ValueError, match=r"`depth_m` must have shape \(64, 64\), got \(8, 8\)"):
        NeuralMap(small(), tour.camera).integrate(np.ones((8, 8), np.float32), tour.poses[0])


def test_map_that_saw_nothing_predicts_no_surface(tour) -> None:
    neural_map = NeuralMap(small(first_iterations=1), tour.camera)
    neural_map.integrate(np.zeros((64, 64), np.float32), tour.poses[0])
    assert len(neural_map.mesh()) == 0


def test_views_of_something_new_become_keyframes(tour) -> None:
    neural_map = NeuralMap(map_settings("fast"), tour.camera)
    updates = [neural_map.integrate(d, p) for d, p in zip(tour.depths, tour.poses, strict=True)]
    assert neural_map.num_keyframes == sum(update.is_keyframe for update in updates) >= 2
    assert len(neural_map.frames) == neural_map.num_keyframes + 1


def test_keyframe_is_forced_after_its_interval(tour) -> None:
    settings = small(first_iterations=1, iterations=1, keyframe_iterations=1)
    settings = replace(settings, keyframes=replace(settings.keyframes, explained_share=0.0, max_interval=3))
    neural_map = NeuralMap(settings, tour.camera)
    flags = [neural_map.integrate(tour.depths[0], tour.poses[0]).is_keyframe for _ in range(9)]
    assert flags == [False, False, False, False, True, False, False, False, True]


def test_frame_without_depth_changes_no_weight(tour) -> None:
    neural_map = NeuralMap(small(first_iterations=3), tour.camera)
    before = neural_map.sdf(np.zeros((1, 3)))
    update = neural_map.integrate(np.zeros((64, 64), np.float32), tour.poses[0])
    assert update.iterations == 0
    neural_map.field.network.encoding.center_m.zero_()
    assert neural_map.sdf(np.zeros((1, 3))) == before


def test_bfloat16_stays_close_to_float32(tour) -> None:
    distances = []
    for bfloat16 in (True, False):
        neural_map = NeuralMap(small(first_iterations=200, bfloat16=bfloat16), tour.camera)
        neural_map.integrate(tour.depths[0], tour.poses[0])
        distances.append(neural_map.sdf(neural_map.cloud.points))
    assert np.abs(distances[0]).mean() < 0.05
    assert np.abs(distances[0] - distances[1]).mean() < 0.05


def test_map_before_its_first_frame_says_so() -> None:
    neural_map = NeuralMap(small(), CameraSpec(width_px=8, height_px=8))
    with pytest.raises(MapError, match="the map must have seen a frame; call `integrate` first"):
        _ = neural_map.occupancy


def test_points_of_another_shape_are_refused(learned: NeuralMap) -> None:
    with pytest.raises(ValueError, match=r"`points` must have shape \(N, 3\), got \(3,\)"):
        learned.sdf(np.zeros(3))


def test_compute_is_counted_by_module(learned: NeuralMap) -> None:
    assert set(learned.stopwatch.compute_ms) == {"observe", "learn"}
    assert ScheduleSettings().iterations == 10


@pytest.mark.parametrize(
    ("depth", "pose", "what"),
    [
        (
            np.full((64, 64), 2000, np.uint16),
            np.eye(4),
            "must be floating point metres, got uint16",
        ),
        (np.ones((64, 64), np.float32), np.eye(4)[:3], "must be a finite 4 x 4 pose"),
        (
            np.ones((64, 64), np.float32),
            np.full((4, 4), np.nan),
            "must be a finite 4 x 4 pose",
        ),
        (
            np.ones((64, 64), np.float32),
            camera_pose([0.0, 1.25, 0.0], 0.3) @ np.diag([1.0, -1.0, -1.0, 1.0]),
            "must be level, got an up axis with y = -1.000; .* of OpenCV's",
        ),
        (np.ones((64, 64), np.float32), np.diag([1.0, 0.9, 1.0, 1.0]), "scaled, mirrored or transposed"),
        (np.ones((64, 64), np.float32), np.diag([-1.0, 1.0, 1.0, 1.0]), "scaled, mirrored or transposed"),
        (np.ones((64, 64), np.float32), camera_pose([1.0, 1.0, 1.0], 0.0).T, "mirrored or transposed"),
        (np.full((64, 64), 2000.0, np.float32), np.eye(4), "must be in metres, .* are they millimetres"),
        (
            np.ones((64, 64, 3), np.float32),
            np.eye(4),
            r"must have shape \(64, 64\), got \(64, 64, 3\)",
        ),
        ([[1.0]], np.eye(4), r"must have shape \(64, 64\), got \(1, 1\)"),
    ],
)
def test_frame_that_is_no_depth_or_has_no_pose_is_refused(tour, depth, pose, what: str) -> None:
    neural_map = NeuralMap(small(), tour.camera)
    with pytest.raises(ValueError, match=what):
        neural_map.integrate(depth, pose)
    assert neural_map.num_frames == 0
    assert len(neural_map.frames) == len(neural_map.cloud) == 0


def test_a_few_far_depths_are_no_millimetres(tour) -> None:
    depth = np.ones((64, 64), np.float32)
    depth[:4], depth[4:8] = 65_535.0, np.inf
    assert NeuralMap(small(), tour.camera).integrate(depth, np.eye(4)).iterations > 0


@pytest.mark.parametrize("mode", [torch.no_grad, torch.inference_mode])
def test_map_learns_and_answers_the_same_whatever_the_caller_does_about_gradients(tour, mode) -> None:
    points = tour.depths[0].reshape(-1)[:30].reshape(-1, 3)

    def learn() -> list[np.ndarray]:
        neural_map = NeuralMap(small(first_iterations=3, iterations=1), tour.camera)
        for depth, pose in zip(tour.depths[:3], tour.poses[:3], strict=True):
            neural_map.integrate(depth, pose)
        asked = neural_map.sdf(points), neural_map.gradient(points), neural_map.variability(points)
        return [*asked, neural_map.posterior_std(points)]

    with mode():
        inside = learn()
    for first, second in zip(inside, learn(), strict=True):
        np.testing.assert_array_equal(first, second)


def test_map_made_without_gradients_learns_on_with_them(tour) -> None:
    with torch.inference_mode():
        neural_map = NeuralMap(small(first_iterations=3, iterations=1), tour.camera)
        neural_map.integrate(tour.depths[0], tour.poses[0])
    assert neural_map.integrate(tour.depths[1], tour.poses[1]).iterations > 0


def test_copies_and_states_made_without_gradients_learn_on(tour) -> None:
    neural_map = NeuralMap(small(first_iterations=3, iterations=1), tour.camera)
    neural_map.integrate(tour.depths[0], tour.poses[0])
    other = NeuralMap(small(first_iterations=3, iterations=1), tour.camera)
    with torch.inference_mode():
        copied, state = deepcopy(neural_map), neural_map.state()
    other.load_state(state)
    assert copied.integrate(tour.depths[1], tour.poses[1]).iterations > 0
    assert copied.num_frames == neural_map.num_frames + 1
    assert np.isfinite(other.gradient(np.ones((1, 3)))).all()


def test_maps_of_one_state_learn_apart(tour) -> None:
    """What is learned after a state was taken, by the map or by others, changes neither it nor them."""
    maps = [NeuralMap(small(first_iterations=3, iterations=2), tour.camera, seed=seed) for seed in range(3)]
    maps[0].integrate(tour.depths[0], tour.poses[0])
    state = maps[0].state()
    before = {name: tensor.clone() for name, tensor in state.items()}
    for other in maps[1:]:
        other.load_state(state)
    for _ in range(2):
        maps[0].integrate(tour.depths[1], tour.poses[1])
        maps[1].integrate(tour.depths[2], tour.poses[2])
    for name, tensor in maps[2].state().items():
        assert torch.equal(tensor, before[name]), name
        assert torch.equal(state[name], before[name]), name


def test_state_replaces_all_of_a_map_that_has_learned(tour) -> None:
    used, fresh = (NeuralMap(small(first_iterations=3), tour.camera) for _ in range(2))
    used.integrate(tour.depths[0], tour.poses[0])
    used.load_state(fresh.state())
    with pytest.raises(MapError, match="must have seen a frame"):
        _ = used.occupancy
    points = np.ones((5, 3), np.float32)
    for neural_map in (used, fresh):
        neural_map.integrate(tour.depths[1], tour.poses[1])
    np.testing.assert_array_equal(used.sdf(points), fresh.sdf(points))


def test_torch_s_own_generator_is_left_alone(tour) -> None:
    before = torch.random.get_rng_state()
    NeuralMap(small(), tour.camera)
    assert torch.equal(torch.random.get_rng_state(), before)


def test_arrays_may_be_flipped_read_only_or_of_another_byte_order(learned: NeuralMap, tour) -> None:
    points = np.arange(12.0, dtype=np.float32).reshape(4, 3) / 10
    np.testing.assert_array_equal(learned.sdf(points[::-1]), learned.sdf(points)[::-1])
    np.testing.assert_array_equal(learned.sdf(points.astype(">f4")), learned.sdf(points))
    upside_down = tour.depths[0][::-1]
    upside_down.flags.writeable = False
    assert NeuralMap(small(), tour.camera).integrate(upside_down, tour.poses[0]).iterations > 0


@pytest.mark.parametrize("sizes", [(0.0, 0.1), (-1.0, 0.1), (np.nan, 0.1), (0.1, -1.0)])
def test_reconstruction_without_a_spacing_is_refused(learned: NeuralMap, sizes: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="`voxel_m` must be > 0 and `crop_m` >= 0"):
        learned.mesh(*sizes)


def test_points_may_be_a_list(learned: NeuralMap) -> None:
    assert learned.sdf([[0.0, 1.0, 0.0]]).shape == (1,)  # type: ignore[arg-type]
