"""Noise: nothing by default, otherwise of the asked size."""

import numpy as np
import pytest

from anm_gym.envs.noise import NoiseSpec


def test_without_noise_nothing_is_drawn_and_nothing_changes(rng: np.random.Generator) -> None:
    before = rng.bit_generator.state
    depth = np.ones((2, 3), np.float32)
    assert NoiseSpec().draw_actuation(rng) == (0.0, 0.0)
    assert NoiseSpec().disturb(depth, 10.0, rng) is depth
    assert rng.bit_generator.state == before


def test_actuation_noise_has_the_asked_deviation(rng: np.random.Generator) -> None:
    noise = NoiseSpec(forward_std_m=0.02, turn_std_deg=3.0)
    draws = np.array([noise.draw_actuation(rng) for _ in range(4000)])
    np.testing.assert_allclose(draws.mean(axis=0), 0.0, atol=0.003)
    np.testing.assert_allclose(draws.std(axis=0), [0.02, np.deg2rad(3.0)], rtol=0.05)


def test_depth_noise_grows_with_depth_and_leaves_empty_pixels_empty(rng: np.random.Generator) -> None:
    depth = np.repeat(np.array([[0.0], [1.0], [4.0]], np.float32), 4000, axis=1)
    noisy = NoiseSpec(depth_std_fraction=0.01).disturb(depth, 10.0, rng)
    assert noisy.dtype == np.float32
    np.testing.assert_array_equal(noisy[0], 0.0)
    np.testing.assert_allclose(noisy[1:].std(axis=1), [0.01, 0.04], rtol=0.05)


def test_noisy_depth_stays_within_the_range_of_the_camera(rng: np.random.Generator) -> None:
    noisy = NoiseSpec(depth_std_fraction=2.0).disturb(np.full((50, 50), 9.0, np.float32), 10.0, rng)
    assert noisy.min() == 0.0
    assert noisy.max() == 10.0


@pytest.mark.parametrize("name", ["forward_std_m", "turn_std_deg", "depth_std_fraction"])
@pytest.mark.parametrize("value", [-0.1, float("nan"), float("inf")])
def test_impossible_deviation_is_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"`{name}` must be >= 0 and finite"):
        NoiseSpec(**{name: value})
