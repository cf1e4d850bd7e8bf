"""The network: sequences with episodes in them, what each input changes, and sizes."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import Tensor

from agents.navigator_net import SMALLEST_CROP, NavigatorNet, NavigatorNetSettings, run_lstm, step_lstm
from agents.resnet import DepthResNet


def observation_of(count: int, settings: NavigatorNetSettings, seed: int = 0) -> dict[str, Tensor]:
    rng = np.random.default_rng(seed)
    px, side = settings.image_px, settings.memory.crop_cells
    observation = {
        "depth": rng.integers(0, 256, (count, 1, px, px), dtype=np.uint8),
        "maps": rng.integers(0, 16, (count, 2, side, side), dtype=np.uint8),
        "waves": rng.integers(0, 256, (count, 2, side, side), dtype=np.uint8),
        "goal": np.stack([rng.uniform(0, 9, count), rng.uniform(-3, 3, count)], axis=1).astype(np.float32),
        "previous_action": rng.integers(0, 5, (count, 1), dtype=np.uint8),
        "forward_step_m": np.full((count, 1), 0.065, np.float32),
    }
    return {key: torch.from_numpy(values) for key, values in observation.items()}


def test_settings_in_files_of_earlier_versions_are_read() -> None:
    plain = NavigatorNetSettings().as_dict()
    plain["memory"]["wave"]["max_rounds"] = 160
    plain["memory"]["way_out"]["max_rounds"] = 40
    assert NavigatorNetSettings.read(plain) == NavigatorNetSettings()
    del plain["memory"]["way_out"]
    assert NavigatorNetSettings.read(plain) == NavigatorNetSettings()


@pytest.mark.parametrize("crop_cells", [15, 16])
def test_smallest_maps_pass_the_encoder(crop_cells: int) -> None:
    memory = replace(NavigatorNetSettings().memory, crop_cells=crop_cells)
    if crop_cells < SMALLEST_CROP:
        with pytest.raises(ValueError, match="`crop_cells` must be >= 16, got 15"):
            NavigatorNetSettings(memory=memory)
    else:
        NavigatorNet(NavigatorNetSettings(memory=memory))


@pytest.mark.parametrize("starts", [[], [0], [3], [0, 2, 3, 7], [6, 10, 13]])
def test_lstm_over_whole_episodes_is_the_loop_over_frames(starts: list[int]) -> None:
    """Two sequences of seven frames; the library loops over frames and resets states in between."""
    torch.manual_seed(0)
    lstm, features = torch.nn.LSTM(5, 4, 2), torch.randn(14, 5)
    state = (torch.randn(2, 2, 4), torch.randn(2, 2, 4))
    begins = torch.zeros(14)
    begins[starts] = 1.0
    fused = run_lstm(lstm, features, state, begins).reshape(2, 7, 4)
    for frame in range(7):
        output, state = step_lstm(
            lstm, features.reshape(2, 7, 5)[:, frame], state, begins.reshape(2, 7)[:, frame]
        )
        torch.testing.assert_close(fused[:, frame], output, atol=1e-6, rtol=0)


def test_network_over_sequences_is_the_network_over_frames() -> None:
    net = NavigatorNet().eval()
    observation, starts = observation_of(6, net.settings), torch.tensor([1.0, 0, 0, 0, 1, 0])
    whole = net(observation, net.first_state(2), starts)
    state, logits = net.first_state(2), []
    for frame in range(3):
        some = {key: values.reshape(2, 3, *values.shape[1:])[:, frame] for key, values in observation.items()}
        outputs, state = net.step(some, state, starts.reshape(2, 3)[:, frame])
        logits.append(outputs.logits)
    torch.testing.assert_close(whole.logits.reshape(2, 3, 4), torch.stack(logits, dim=1))


@pytest.mark.parametrize("key", ["depth", "maps", "waves", "goal", "previous_action", "forward_step_m"])
def test_every_input_reaches_the_features(key: str) -> None:
    net = NavigatorNet().eval()
    observation = observation_of(2, net.settings)
    before = net.encoder(observation)
    observation[key] = (observation[key] + 1) % 5 if key == "previous_action" else observation[key] + 1
    assert not torch.equal(net.encoder(observation), before)


def test_goal_to_the_left_and_to_the_right_look_different() -> None:
    """The sign of the bearing: left is positive, and the map's goal plane is higher on that side."""
    net = NavigatorNet().eval()
    observation = observation_of(2, net.settings)
    observation = {key: values[:1].repeat(2, *[1] * (values.ndim - 1)) for key, values in observation.items()}
    observation["goal"] = torch.tensor([[1.0, np.pi / 2], [1.0, -np.pi / 2]], dtype=torch.float32)
    features = net.encoder(observation)
    assert not torch.allclose(features[0], features[1])


def test_first_policy_is_undecided() -> None:
    net = NavigatorNet().eval()
    outputs = net(observation_of(4, net.settings), net.first_state(4), torch.ones(4))
    assert torch.softmax(outputs.logits, dim=1).max() < 0.3


def test_full_network_is_that_of_dd_ppo() -> None:
    settings = NavigatorNetSettings(
        vision="resnet50", uses_maps=False, image_px=256, lstm_size=512, lstm_layers=2
    )
    net = NavigatorNet(settings).eval()
    assert sum(values.numel() for values in net.encoder.vision.parameters()) == pytest.approx(8.1e6, rel=0.05)
    with torch.no_grad():
        outputs = net(observation_of(1, settings), net.first_state(1), torch.ones(1))
    assert outputs.logits.shape == (1, 4)


def test_unknown_encoder_is_refused() -> None:
    with pytest.raises(ValueError, match="`vision` must be one of small, resnet18, resnet50, got 'vgg'"):
        NavigatorNetSettings(vision="vgg")


def test_wave_may_be_wider_at_work_but_never_narrower() -> None:
    settings = NavigatorNetSettings()
    wave, at_work = settings.memory.wave, settings.at_work().memory.wave
    assert at_work.window_cells > wave.window_cells
    assert settings.at_work().at_work() == settings.at_work()
    assert settings.at_work().image_px == settings.image_px


@pytest.mark.parametrize("image_px", [36, 64, 65, 66, 100, 127, 128])
def test_residual_encoder_takes_images_of_any_size(image_px: int) -> None:
    encoder = DepthResNet("resnet18", image_px, width=16)
    assert encoder(torch.zeros(2, 1, image_px, image_px)).shape == (2, 512)
