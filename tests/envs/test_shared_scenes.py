"""Scenes are made once and shared, unless their file has changed."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from anm_gym.envs.explore import ExploreEnv
from anm_gym.envs.shared_scenes import shared_grid, shared_scene
from anm_gym.errors import SceneError
from anm_gym.mesh import TriangleMesh

Y_UP = {"up_axis": "y"}


def test_environments_of_a_process_share_a_scene_but_not_an_agent(explore: Callable[..., ExploreEnv]) -> None:
    first, second = explore(), explore()
    assert first.scene is second.scene
    assert first.simulator is not second.simulator


def test_other_options_make_another_scene(room: str) -> None:
    assert shared_scene(room, Y_UP) is shared_scene(room, dict(Y_UP))
    assert shared_scene(room, Y_UP) is not shared_scene(room, {**Y_UP, "unit": "m"})


def test_changed_file_is_read_again(
    box_room: Callable[..., TriangleMesh], write_mesh: Callable[[TriangleMesh, Path], str], tmp_path: Path
) -> None:
    name = write_mesh(box_room(), tmp_path / "box.ply")
    before = shared_scene(name, Y_UP)
    write_mesh(box_room(width_m=6.0), tmp_path / "box.ply")
    os.utime(name, (1, 1))
    assert shared_scene(name, Y_UP).mesh.bounds[1, 0] == pytest.approx(before.mesh.bounds[1, 0] + 1.0)


def test_changed_file_of_a_dataset_is_read_again(
    box_room: Callable[..., TriangleMesh], write_mesh: Callable[[TriangleMesh, Path], str], tmp_path: Path
) -> None:
    for root, width_m in (("one", 5.0), ("two", 6.0)):
        (tmp_path / root / "gibson").mkdir(parents=True)
        write_mesh(box_room(width_m=width_m), tmp_path / root / "gibson" / "Box.glb")
    one, two = ({"up_axis": "y", "root": str(tmp_path / root)} for root in ("one", "two"))
    assert shared_scene("gibson:Box", one) is shared_scene("gibson:Box", one)
    assert width_of("gibson:Box", two) == pytest.approx(width_of("gibson:Box", one) + 1.0)
    write_mesh(box_room(width_m=7.0), tmp_path / "one" / "gibson" / "Box.glb")
    os.utime(tmp_path / "one" / "gibson" / "Box.glb", (1, 1))
    assert width_of("gibson:Box", one) == pytest.approx(width_of("gibson:Box", two) + 1.0)


def width_of(name: str, options: dict[str, str]) -> float:
    low, high = shared_scene(name, options).mesh.bounds[:, 0]
    return float(high - low)


def test_grid_of_a_scene_is_made_once_and_is_the_environments(
    box_room: Callable[..., TriangleMesh], write_mesh: Callable[[TriangleMesh, Path], str], tmp_path: Path
) -> None:
    scene = shared_scene(write_mesh(box_room(), tmp_path / "grid.ply"), Y_UP)
    alone = shared_grid(scene)
    assert shared_grid(scene) is alone
    other = write_mesh(box_room(), tmp_path / "other.ply")
    env = ExploreEnv(other, scene_options=Y_UP)
    assert shared_grid(env.scene) is env.simulator.grid
    wide = ExploreEnv(other, scene_options=Y_UP, camera={"width_px": 48, "height_px": 16})
    assert wide.simulator.grid is env.simulator.grid, "whichever camera looks at it"
    assert (alone.component == env.simulator.grid.component).all()


def test_unknown_scene_is_an_error_when_the_environment_is_made() -> None:
    with pytest.raises(SceneError, match="tier"):
        ExploreEnv("home:castle:0")
