"""What learning costs is counted, and is paid once."""

import numpy as np
import pytest
import torch

from benchmarks import learning
from benchmarks.learning import FlopCounter, learn, learn_once


def test_operations_of_a_matrix_product_are_counted_both_ways():
    left, right = torch.ones((2, 3), requires_grad=True), torch.ones((3, 4), requires_grad=True)
    with FlopCounter() as counter:
        (left @ right).sum().backward()
    assert counter.flops == 3 * 2 * (2 * 3 * 4)  # forward, and one product for each gradient


def test_cost_is_per_step(recording, tiny, monkeypatch):
    monkeypatch.setattr(learning, "COUNT_EVERY", 2)
    cost = learn(recording, tiny).cost
    assert cost.steps == 4
    assert cost.iterations == 30 + 3 * 3
    assert cost.flops_step > 1e6
    assert 0.0 < cost.cpu_ms_step < cost.wall_ms_step + cost.observe_ms_step + 1000.0


def test_a_map_is_learned_once(recording, tiny, tmp_path, monkeypatch):
    first = learn_once(recording, tiny, tmp_path)
    monkeypatch.setattr(learning, "learn", lambda *_: pytest.fail("learned again"))
    second = learn_once(recording, tiny, tmp_path)
    points = np.random.default_rng(0).uniform(-1.0, 1.0, (50, 3)).astype(np.float32)
    np.testing.assert_array_equal(first.neural_map.sdf(points), second.neural_map.sdf(points))
    assert first.cost == second.cost
    assert {path.name for path in tmp_path.iterdir()} == {
        f"box-0_4_tiny_{tiny.settings_hash}.{suffix}" for suffix in ("json", "safetensors")
    }


def test_a_map_without_its_cost_is_learned_again(recording, tiny, tmp_path):
    learn_once(recording, tiny, tmp_path)
    (cost,) = tmp_path.glob("*.json")
    cost.unlink()
    learn_once(recording, tiny, tmp_path)
    assert cost.exists()
