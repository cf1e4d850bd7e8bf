import numpy as np
import pytest
from scipy.spatial import cKDTree

from anm_gym.geometry import CameraSpec, backproject, camera_pose
from anm_gym.metrics.completion import NUM_SAMPLES, CompletionMeter, completion_samples
from anm_gym.sim.backends import make_depth_camera

CAMERA = CameraSpec(width_px=256, height_px=256)
FEW_SAMPLES = 20_000


def meter_after(mesh, poses, camera=CAMERA, visible=None, num_samples=FEW_SAMPLES):
    meter = CompletionMeter(mesh, visible, num_samples=num_samples)
    depth_camera = make_depth_camera(mesh, camera)
    for pose in poses:
        meter.observe(depth_camera.render(pose), camera, pose)
    return meter


def test_a_panorama_inside_a_box_covers_what_its_four_frusta_hold(box_room):
    room = box_room(4.0, 4.0, 2.5)
    poses = [camera_pose([0.0, 1.25, 0.0], turn * np.pi / 2) for turn in range(4)]
    meter = meter_after(room, poses)
    # Floor and ceiling are hidden where |y| exceeds the distance: a square of half-side 1.25 m each.
    hidden = 2 * 2.5**2 / (2 * 16.0 + 4 * 10.0)
    rim = 2 * 4 * 2.5 * 0.05 / 72.0
    assert 100 * (1 - hidden) - 0.7 < meter.comp_pct < 100 * (1 - hidden + rim) + 0.7


def test_a_frame_covers_the_wall_that_it_holds(box_room):
    room = box_room(12.0, 4.0, 2.5)
    meter = meter_after(room, [camera_pose([0.0, 1.25, -1.0], 0.0)])
    points, covered = meter.samples.points, meter.covered
    wall = np.abs(points[:, 2] + 2.0) < 1e-9
    inside = wall & (np.abs(points[:, 0]) < 1.0) & (np.abs(points[:, 1] - 1.25) < 1.0)
    outside = wall & (np.abs(points[:, 0]) > 1.05)
    assert covered[inside].all()
    assert not covered[outside].any()


def test_every_measure_equals_a_search_of_all_points(box_room):
    room = box_room(6.0, 4.0, 2.5)
    poses = [camera_pose([0.3 * step, 1.25, 0.2 * step], 0.5 * step) for step in range(3)]
    meter = meter_after(room, poses, num_samples=4000)
    depths = [make_depth_camera(room, CAMERA).render(pose) for pose in poses]
    cloud = np.concatenate([backproject(d, CAMERA, p) for d, p in zip(depths, poses, strict=True)])
    distance, _ = cKDTree(cloud).query(meter.samples.points)
    scores = meter.scores()
    assert scores.comp_pct == pytest.approx(100 * np.mean(distance < 0.05), abs=0.02)
    assert 0.0 <= scores.comp_cm - 100 * distance.mean() + 1e-3 <= scores.far_bound_cm
    half = CameraSpec(128, 128)
    half_cloud = [
        (CAMERA.directions[::2, ::2] * d[::2, ::2, None]).reshape(-1, 3) @ p[:3, :3].T + p[:3, 3]
        for d, p in zip(depths, poses, strict=True)
    ]
    assert half_cloud[0].shape == (half.width_px * half.height_px, 3)
    official, _ = cKDTree(np.concatenate(half_cloud)).query(meter.samples.points)
    assert scores.comp_pct_official == pytest.approx(100 * np.mean(official < 0.05), abs=0.02)
    expected_cm = 100 * np.minimum(official, 1.0).mean()
    assert 0.0 <= scores.comp_cm_official - expected_cm + 1e-3 <= scores.far_bound_cm


def test_the_curve_has_one_value_a_frame_and_never_falls(two_rooms):
    poses = [camera_pose([-2.0, 1.25, 0.0], turn * np.pi / 6) for turn in range(12)]
    meter = meter_after(two_rooms, poses, CameraSpec(64, 64))
    assert meter.curve_pct.shape == (12,)
    assert meter.curve_pct.dtype == np.float32
    assert (np.diff(meter.curve_pct) >= 0).all()
    assert meter.curve_pct[-1] == pytest.approx(meter.comp_pct)


def test_nothing_observed_is_no_completion_at_the_cap(box_room):
    meter = CompletionMeter(box_room(), num_samples=100)
    scores = meter.scores()
    assert (scores.comp_pct, scores.comp_pct_official, scores.comp_cm_official) == (0.0, 0.0, 100.0)
    assert np.isinf(scores.comp_cm)
    assert scores.comp_visible_pct is None


def test_the_official_measure_puts_empty_pixels_at_the_camera(box_room):
    room = box_room(1.0, 1.0, 2.5)
    camera, pose = CameraSpec(32, 32), camera_pose([0.0, 1.25, 0.0], 0.0)
    meter = CompletionMeter(room, num_samples=2000)
    meter.observe(np.zeros((32, 32), np.float32), camera, pose)
    expected = np.minimum(np.linalg.norm(meter.samples.points - [0.0, 1.25, 0.0], axis=1), 1.0)
    assert meter.comp_cm_official == pytest.approx(100 * expected.mean(), abs=0.01)
    assert meter.comp_pct_official == 0.0


def test_beyond_eight_metres_nothing_is_completed(corridor):
    meter = meter_after(corridor, [camera_pose([4.5, 1.25, 0.0], np.pi / 2)])
    far_end = meter.samples.points[:, 0] < -4.99
    assert far_end.any()
    assert not meter.covered[far_end].any()


def test_the_visible_share_counts_visible_samples_only(two_rooms):
    samples = completion_samples(two_rooms, NUM_SAMPLES)
    visible = (samples.points[:, 2] < -1.9)[:5000] & (samples.points[:5000, 0] < -0.5)
    poses = [camera_pose([-2.0, 1.25, 0.0], turn * np.pi / 6) for turn in range(12)]
    meter = meter_after(two_rooms, poses, visible=visible, num_samples=NUM_SAMPLES)
    assert meter.comp_visible_pct == pytest.approx(100.0, abs=3.0)
    assert meter.comp_pct < 70.0


def test_two_episodes_alike_score_alike(two_rooms):
    poses = [camera_pose([-2.0, 1.25, 0.0], 0.4)]
    first, second = (meter_after(two_rooms, poses, CameraSpec(64, 64)).scores() for _ in range(2))
    assert first == second


@pytest.mark.parametrize(("count", "num_samples"), [(11, 10), (9, 10), (NUM_SAMPLES + 1, NUM_SAMPLES)])
def test_visibility_of_another_sample_set_is_refused(box_room, count, num_samples):
    """A prefix of the default set is as good as all of it; that of another size is another set."""
    with pytest.raises(ValueError, match=f"`visible` must have .*{num_samples} entries.*, got {count}"):
        CompletionMeter(box_room(), np.ones(count, bool), num_samples=num_samples)
