"""Scene names: each kind reaches its maker, and unknown names say what there is."""

import builtins
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import trimesh

from anm_gym.errors import BackendError, SceneError
from anm_gym.mesh import TriangleMesh
from anm_gym.scenes import make_scene

BoxRoom = Callable[..., TriangleMesh]


@pytest.fixture
def room_file(tmp_path: Path, box_room: BoxRoom) -> str:
    room = box_room(6.0, 4.0)
    trimesh.Trimesh(room.vertices * 100.0, room.faces, process=False).export(tmp_path / "room.glb")
    return str(tmp_path / "room.glb")


def test_mesh_file_is_loaded_with_its_options(room_file: str) -> None:
    assert make_scene(room_file, unit="cm").ceiling_y_m == pytest.approx(2.5)


def test_plan_is_built(tmp_path: Path) -> None:
    square = [[0, 0], [4, 0], [4, 4], [0, 4]]
    plan = {
        "ceiling_height": 2.5,
        "rooms": [{"id": "room|1", "floorPolygon": square}],
        "walls": [],
        "doors": [],
    }
    (tmp_path / "plan.json").write_text(json.dumps(plan), encoding="utf-8")
    assert make_scene(str(tmp_path / "plan.json")).ceiling_y_m == 2.5


def test_home_is_made_from_its_name() -> None:
    scene = make_scene("home:studio:3")
    assert scene.name == "home:studio:3"
    assert scene.floor_y_m == 0.0


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("home:castle:1", "must be one of studio, flat, house, maze, got 'castle'"),
        ("home:flat:x", "must be an integer >= 0 .*, got 'x'; e.g. 'home:flat:7'"),
        ("home:flat:-1", "must be an integer >= 0 .*, got '-1'"),
        (
            "home:flat:07",
            "must be an integer >= 0 of at most 18 digits, without leading zeros, got '07'",
        ),
        ("home:flat:" + 5000 * "9", "must be an integer >= 0 of at most 18 digits"),
        ("home:flat", "must be an integer >= 0 .*, got ''"),
        ("home:", "must be one of studio, flat, house, maze, got ''"),
        ("villa", "must exist, got nothing there"),
    ],
)
def test_unknown_name_is_refused_with_the_choices(name: str, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        make_scene(name)


@pytest.mark.parametrize("name", ["home:flat:1", "plan.json"])
def test_only_mesh_files_take_options(name: str) -> None:
    with pytest.raises(TypeError, match=r"`options` must be empty for .* got unit; only mesh files take any"):
        make_scene(name, unit="m")


def test_missing_plan_packages_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    real_import = builtins.__import__

    def without_plans(name: str, *rest: Any, **more: Any) -> Any:
        if name == "anm_gym.scenes.floorplan":
            raise ModuleNotFoundError("No module named 'shapely'", name="shapely")
        return real_import(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", without_plans)
    with pytest.raises(BackendError, match=r"floor plans need shapely; pip install 'anm-gym\[plans\]'"):
        make_scene("plan.json")
