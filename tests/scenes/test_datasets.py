"""Datasets: each layout is found, each mesh stands upright, what is missing is named."""

from collections.abc import Callable
from pathlib import Path

import gymnasium
import numpy as np
import pytest
import trimesh

import anm_gym  # noqa: F401 - registers the ids
from anm_gym.errors import SceneError
from anm_gym.mesh import TriangleMesh
from anm_gym.scenes.__main__ import main
from anm_gym.scenes.catalog import make_scene
from anm_gym.scenes.datasets import (
    DATASETS,
    ROOT_VARIABLE,
    find_scene,
    find_scenes,
    is_dataset_scene,
    load_dataset_scene,
)

BoxRoom = Callable[..., TriangleMesh]
FILES = {
    "gibson:Denmark": "gibson/Denmark.glb",
    "mp3d:gZ6f7yhEvPG": "mp3d/gZ6f7yhEvPG/gZ6f7yhEvPG.glb",
    "hm3d:00800-TEEsavR23oF": "hm3d/val/00800-TEEsavR23oF/TEEsavR23oF.basis.glb",
    "replica:room_0": "replica/room_0/habitat/mesh_semantic.ply",
}
HEIGHT_M = 2.6


def write_room(path: Path, room: TriangleMesh) -> Path:
    """Write a y-up room as these datasets have it, z up: (x, y, z) becomes (x, -z, y)."""
    x, y, z = room.vertices.T
    path.parent.mkdir(parents=True, exist_ok=True)
    trimesh.Trimesh(np.stack([x, -z, y], axis=1), room.faces, process=False).export(path)
    return path


@pytest.fixture
def root(tmp_path: Path, box_room: BoxRoom, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Give a folder with a scene of every dataset, named by the variable."""
    room = box_room(6.0, 4.0, HEIGHT_M)
    for file in FILES.values():
        write_room(tmp_path / file, room)
    monkeypatch.setenv(ROOT_VARIABLE, str(tmp_path))
    return tmp_path


@pytest.mark.parametrize("name", FILES)
def test_scene_of_each_layout_stands_upright_under_its_name(name: str, root: Path) -> None:
    scene = make_scene(name)
    assert scene.name == name
    assert scene.source == str(root / FILES[name])
    assert scene.ceiling_y_m is not None
    assert scene.ceiling_y_m - scene.floor_y_m == pytest.approx(HEIGHT_M, abs=1e-5)
    np.testing.assert_allclose(np.ptp(scene.mesh.vertices, axis=0), [6.0, HEIGHT_M, 4.0], atol=1e-5)


def test_scene_taller_than_wide_stands_upright_by_its_dataset(tmp_path: Path, box_room: BoxRoom) -> None:
    """The mesh alone would suggest that the walls are the floor."""
    write_room(tmp_path / "gibson" / "Tower.glb", box_room(3.0, 3.0, 9.0))
    scene = make_scene("gibson:Tower", root=tmp_path)
    assert scene.mesh.bounds[1, 1] - scene.mesh.bounds[0, 1] == pytest.approx(9.0)


@pytest.mark.parametrize("dataset", DATASETS)
def test_scenes_are_listed_with_their_files(dataset: str, root: Path) -> None:
    expected = {name: root / file for name, file in FILES.items() if name.startswith(f"{dataset}:")}
    assert find_scenes(dataset) == expected


def test_root_may_be_the_folder_of_the_dataset_itself(root: Path) -> None:
    assert find_scene("gibson:Denmark", root / "gibson") == root / "gibson" / "Denmark.glb"
    assert list(find_scenes("mp3d", root / "mp3d")) == ["mp3d:gZ6f7yhEvPG"]


def test_number_of_an_hm3d_scene_may_be_left_out(root: Path) -> None:
    assert find_scene("hm3d:TEEsavR23oF") == root / FILES["hm3d:00800-TEEsavR23oF"]


def test_plain_glb_is_preferred_to_the_compressed_one(root: Path, box_room: BoxRoom) -> None:
    plain = write_room(root / "hm3d/val/00800-TEEsavR23oF/TEEsavR23oF.glb", box_room())
    assert find_scene("hm3d:00800-TEEsavR23oF") == plain
    assert find_scenes("hm3d") == {"hm3d:00800-TEEsavR23oF": plain}


def test_original_download_of_gibson_is_found_too(root: Path, box_room: BoxRoom) -> None:
    mesh = write_room(root / "gibson/Elmira/mesh_z_up.obj", box_room())
    assert find_scene("gibson:Elmira") == mesh
    assert list(find_scenes("gibson")) == ["gibson:Denmark", "gibson:Elmira"]


def test_mesh_of_quads_is_read(tmp_path: Path) -> None:
    """Replica's meshes are made of quads."""
    corners = [(x, y, z) for z in (0, 3) for y in (0, 4) for x in (0, 5)]
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    header = f"ply\nformat ascii 1.0\nelement vertex {len(corners)}\n"
    header += "property float x\nproperty float y\nproperty float z\n"
    header += f"element face {len(quads)}\nproperty list uchar int vertex_indices\nend_header\n"
    lines = [" ".join(map(str, corner)) for corner in corners]
    lines += [f"4 {' '.join(map(str, quad))}" for quad in quads]
    path = tmp_path / "replica_v1" / "office_0" / "mesh.ply"
    path.parent.mkdir(parents=True)
    path.write_text(header + "\n".join(lines) + "\n", encoding="ascii")
    scene = make_scene("replica:office_0", root=tmp_path)
    assert len(scene.mesh.faces) == 12
    assert scene.ceiling_y_m == pytest.approx(3.0)


def test_environment_takes_the_name_of_a_dataset_scene(root: Path) -> None:
    camera = {"width_px": 16, "height_px": 16}
    env = gymnasium.make(
        "ANM/Explore-v0", scene="gibson:Denmark", scene_options={"root": str(root)}, camera=camera
    )
    observation, _ = env.reset(seed=0)
    assert env.get_wrapper_attr("scene").name == "gibson:Denmark"
    assert observation["depth"].max() > 0.0
    env.close()


def test_report_on_a_scene_takes_the_name_too(root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["gibson:Denmark"]) == 0
    assert "gibson:Denmark" in capsys.readouterr().out


def test_options_reach_the_loader(root: Path) -> None:
    with pytest.raises(SceneError, match=r"`storey` of .* must be in \[0, 0\], got 3"):
        make_scene("gibson:Denmark", storey=3)
    lying = load_dataset_scene("gibson:Denmark", up_axis="y").scene
    assert np.ptp(lying.mesh.vertices, axis=0)[1] == pytest.approx(4.0)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("gibson:Denmrak", r"must be a mesh of Gibson under .*, got none of .*Denmrak\.glb.*'Denmark'\?"),
        ("mp3d:nowhere", r"got none of .*mp3d/nowhere/nowhere\.glb.*; 1 other scenes of it are there"),
        ("hm3d:00009-vLpv2VX547B", r"00009-vLpv2VX547B/vLpv2VX547B\.basis\.glb"),
        ("gibson:../secret", r"must be a plain name, got '\.\./secret'"),
        ("gibson:", r"the scene in 'gibson:' must be a plain name, got ''"),
    ],
)
def test_missing_scene_says_where_it_was_looked_for(name: str, message: str, root: Path) -> None:
    with pytest.raises(SceneError, match=message):
        make_scene(name)


def test_unknown_root_is_asked_for(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv(ROOT_VARIABLE, raising=False)
    with pytest.raises(
        SceneError, match=r"must be known to find scenes of Gibson, got none; set \$ANM_SCENES"
    ):
        make_scene("gibson:Denmark")
    with pytest.raises(SceneError, match=r"`root` must be a folder of datasets, got .*absent"):
        make_scene("gibson:Denmark", root=tmp_path / "absent")


def test_only_names_of_datasets_are_dataset_scenes() -> None:
    assert is_dataset_scene("replica:room_0")
    assert not is_dataset_scene("home:flat:1")
    assert not is_dataset_scene("gibson/Denmark.glb")
    with pytest.raises(SceneError, match="unknown dataset 'scannet'; choose one of: gibson, mp3d"):
        find_scenes("scannet", ".")
