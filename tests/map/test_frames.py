import numpy as np
import pytest
import torch

from anm_gym.errors import MapError
from anm_gym.geometry import CameraSpec, backproject, camera_pose
from anm_gym.map.frames import FrameStore
from anm_gym.map.settings import SamplingSettings

CPU = torch.device("cpu")


def test_normals_point_out_of_the_walls_in_the_world_frame(
    store: FrameStore, generator: torch.Generator
) -> None:
    window = torch.arange(len(store))
    pixels = store.sample_pixels(window, 200, generator)
    surface, normals = pixels.surface.numpy(), pixels.normals.numpy()
    inward = {0: 2.0, 1: 1.25, 2: 1.5}
    centered = surface - [0.0, 1.25, 0.0]
    on_one_wall = 0
    for axis, half in inward.items():
        others = [other for other in inward if other != axis]
        flat = np.abs(np.abs(centered[:, axis]) - half) < 1e-3
        away = np.all([np.abs(centered[:, o]) < inward[o] - 0.4 for o in others], axis=0)
        chosen = flat & away
        on_one_wall += int(chosen.sum())
        assert np.allclose(normals[chosen, axis], -np.sign(centered[chosen, axis]), atol=1e-3)
    assert on_one_wall > 500


def test_points_are_those_of_the_depth_image(tour, store: FrameStore) -> None:
    expected = backproject(tour.depths[2], tour.camera, tour.poses[2])
    assert np.allclose(store.points(2, stride=1).numpy(), expected, atol=1e-5)


def test_window_holds_the_two_newest_frames_and_replayed_ones(
    store: FrameStore, generator: torch.Generator
) -> None:
    for _ in range(20):
        window = store.window(generator).tolist()
        assert len(window) == len(set(window)) == 5
        assert window[-2:] == [len(store) - 2, len(store) - 1]


def test_replay_prefers_frames_with_a_large_loss(store: FrameStore, generator: torch.Generator) -> None:
    everything = torch.arange(len(store))
    store.record_losses(everything, everything, torch.where(everything == 4, 100.0, 0.01))
    drawn = torch.cat([store.window(generator)[:-2] for _ in range(50)])
    assert int((drawn == 4).sum()) > 40


def test_mean_loss_of_a_frame_ignores_frames_without_rays(store: FrameStore) -> None:
    before = store.state()["losses"].clone()
    store.record_losses(torch.tensor([3, 7]), torch.tensor([0, 0]), torch.tensor([2.0, 4.0]))
    after = store.state()["losses"]
    assert after[3] == 3.0
    assert after[7] == before[7]


def test_depth_out_of_range_is_never_drawn(generator: torch.Generator) -> None:
    camera = CameraSpec(width_px=8, height_px=8)
    frames = FrameStore(camera, SamplingSettings(), CPU)
    frames.append(torch.full((8, 8), 9.0), torch.from_numpy(camera_pose((0, 0, 0), 0.0)).float())
    assert len(frames.sample_pixels(torch.tensor([0]), 50, generator).depth_m) == 0


@pytest.mark.parametrize("size_px", [(2, 64), (64, 2)])
def test_image_without_neighbours_has_no_normals(size_px: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match="`camera` must have at least 3 x 3 pixels"):
        FrameStore(CameraSpec(*size_px), SamplingSettings(), torch.device("cpu"))


def test_empty_store_has_no_window(generator: torch.Generator) -> None:
    frames = FrameStore(CameraSpec(width_px=8, height_px=8), SamplingSettings(), CPU)
    with pytest.raises(MapError, match="no keyframe to replay; call `integrate` with a first frame"):
        frames.window(generator)


def test_frames_of_another_camera_are_refused(store: FrameStore) -> None:
    other = FrameStore(CameraSpec(width_px=8, height_px=8), SamplingSettings(), CPU)
    with pytest.raises(MapError, match="stored frames must have 64 pixels"):
        other.load_state(store.state())
