import re
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors import safe_open
from safetensors.torch import load_file, save_file

from anm_gym.errors import MapError
from anm_gym.map.checkpoint import load_map, save_map
from anm_gym.map.neural_map import NeuralMap
from anm_gym.map.presets import map_settings


@pytest.fixture(scope="module")
def trained(tour) -> NeuralMap:
    neural_map = NeuralMap(map_settings("fast"), tour.camera)
    for depth, pose in zip(tour.depths[:6], tour.poses[:6], strict=True):
        neural_map.integrate(depth, pose)
    return neural_map


def test_loaded_map_predicts_and_learns_the_same(trained: NeuralMap, tour, tmp_path: Path) -> None:
    save_map(trained, tmp_path / "map.safetensors")
    first, second = (load_map(tmp_path / "map.safetensors") for _ in range(2))
    points = trained.cloud.points[:100]
    assert np.array_equal(first.sdf(points), trained.sdf(points))
    for neural_map in (first, second):
        neural_map.integrate(tour.depths[6], tour.poses[6])
    assert np.array_equal(first.sdf(points), second.sdf(points))
    assert np.array_equal(first.variability(points), second.variability(points))
    assert first.num_frames == trained.num_frames + 1


def test_saving_leaves_no_partial_file(trained: NeuralMap, tmp_path: Path) -> None:
    save_map(trained, tmp_path / "map.safetensors")
    assert [path.name for path in tmp_path.iterdir()] == ["map.safetensors"]


def test_truncated_file_is_refused(trained: NeuralMap, tmp_path: Path) -> None:
    path = tmp_path / "map.safetensors"
    save_map(trained, path)
    path.write_bytes(path.read_bytes()[:-1000])
    with pytest.raises(MapError, match="`path` must name a saved map"):
        load_map(path)


def test_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MapError, match="`path` must name a saved map"):
        load_map(tmp_path / "nowhere.safetensors")


def test_other_safetensors_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "other.safetensors"
    save_file({"weight": torch.zeros(3)}, path)
    with pytest.raises(MapError, match=r"must hold format .*, got None"):
        load_map(path)


def test_file_with_a_missing_tensor_is_refused(trained: NeuralMap, tmp_path: Path) -> None:
    path = tmp_path / "map.safetensors"
    save_map(trained, path)
    from safetensors import safe_open

    with safe_open(str(path), framework="pt") as file:
        metadata = file.metadata()
    tensors = load_file(path)
    del tensors["field.prior.output.weight"]
    save_file(tensors, path, metadata=metadata)
    with pytest.raises(MapError, match="must fit its settings"):
        load_map(path)


@pytest.mark.parametrize(
    ("name", "spoil", "what"),
    [
        ("frames.poses", lambda tensor: tensor[:, :3], "frames.poses must have shape"),
        ("frames.losses", lambda tensor: tensor[:-1], "frames.losses must have shape"),
        ("cloud", lambda tensor: tensor[:, :2], "cloud must have shape"),
        ("volume.states", lambda tensor: tensor.reshape(-1), "volume.states must have shape"),
        (
            "field.levels.0.table",
            lambda tensor: tensor.reshape(-1),
            "table must have 3 dimensions",
        ),
        ("weight_change", lambda tensor: tensor * torch.nan, "weight_change must hold finite numbers"),
    ],
)
def test_damaged_tensor_is_named(trained: NeuralMap, tmp_path: Path, name: str, spoil, what: str) -> None:
    path = tmp_path / "map.safetensors"
    save_map(trained, path)
    with safe_open(path, framework="pt") as file:
        metadata = file.metadata()
    tensors = load_file(path)
    tensors[name] = spoil(tensors[name]).contiguous()
    save_file(tensors, path, metadata=metadata)
    with pytest.raises(MapError, match=re.escape(what)):
        load_map(path)


def test_folder_of_a_map_is_made(trained: NeuralMap, tmp_path: Path) -> None:
    save_map(trained, tmp_path / "new" / "map.safetensors")
    assert load_map(tmp_path / "new" / "map.safetensors").num_frames == trained.num_frames
