import numpy as np
import pytest

from anm_gym.geometry import CameraSpec
from anm_gym.metrics import table_cache
from anm_gym.metrics.completion import CompletionMeter
from anm_gym.metrics.table_cache import cache_folder, load_view_table, read_view_table, write_view_table
from anm_gym.metrics.view_table import ViewTableSettings
from anm_gym.sim.simulator import Simulator

SETTINGS = ViewTableSettings(num_samples=500, spacing_m=1.0, num_headings=4)


@pytest.fixture
def simulator(two_rooms):
    return Simulator(two_rooms, 0.0, CameraSpec(64, 64))


def load(simulator, folder, settings=SETTINGS):
    return load_view_table(simulator.mesh, simulator, settings=settings, folder=folder)


def test_a_second_load_reads_the_file_and_gives_the_same_table(simulator, tmp_path, monkeypatch):
    first = load(simulator, tmp_path)
    monkeypatch.setattr(table_cache, "build_view_table", lambda *_: pytest.fail("built twice"))
    second = load(simulator, tmp_path)
    assert np.array_equal(first.bits, second.bits)
    assert np.array_equal(first.visible, second.visible)
    assert len(list(tmp_path.rglob("*"))) == 2


@pytest.mark.parametrize("damage", [b"", b"PK\x03\x04 torn", None])
def test_a_damaged_file_is_rebuilt(simulator, tmp_path, damage):
    first = load(simulator, tmp_path)
    (path,) = tmp_path.rglob("*.npz")
    path.write_bytes(path.read_bytes()[:-200] if damage is None else damage)
    assert read_view_table(path) is None
    assert np.array_equal(load(simulator, tmp_path).bits, first.bits)
    assert read_view_table(path) is not None


def test_a_file_of_another_shape_is_rebuilt(simulator, tmp_path):
    table = load(simulator, tmp_path)
    path = tmp_path / "other.npz"
    np.savez(
        path, points=table.points, positions_xz=table.positions_xz, headings_rad=np.zeros(3), bits=table.bits
    )
    assert read_view_table(path) is None
    np.savez(path, points=np.array([{}], object))
    assert read_view_table(path) is None


def test_other_settings_and_cameras_have_other_files(simulator, two_rooms, tmp_path):
    load(simulator, tmp_path)
    load(simulator, tmp_path, ViewTableSettings(num_samples=500, spacing_m=1.0, num_headings=6))
    load(Simulator(two_rooms, 0.0, CameraSpec(32, 32)), tmp_path)
    assert len(list(tmp_path.rglob("*.npz"))) == 3


def test_a_failed_write_leaves_no_file(simulator, tmp_path, monkeypatch):
    table = load(simulator, tmp_path / "good")

    def fail(*args, **kwargs):
        raise OSError("disk full")

    monkeypatch.setattr(np, "savez_compressed", fail)
    with pytest.raises(OSError, match="disk full"):
        write_view_table(tmp_path / "bad" / "table.npz", table)
    assert list((tmp_path / "bad").iterdir()) == []


def test_its_visibility_fits_the_completion_meter(simulator, tmp_path):
    table = load(simulator, tmp_path)
    meter = CompletionMeter(simulator.mesh, table.visible)
    assert np.array_equal(meter.samples.points[: table.num_samples], table.points)
    simulator.place([-2.0, 0.0], 0.0)
    meter.observe(simulator.depth_m(), simulator.camera.spec, simulator.world_from_camera)
    assert meter.comp_visible_pct is not None
    assert meter.comp_visible_pct >= meter.comp_pct - 2.0


def test_the_folder_follows_the_environment_variable(monkeypatch, tmp_path):
    monkeypatch.setenv("ANM_CACHE", str(tmp_path))
    assert cache_folder() == tmp_path
    monkeypatch.delenv("ANM_CACHE")
    assert cache_folder().parts[-2:] == (".cache", "anm_gym")


def test_folder_that_cannot_be_written_costs_the_table_only(simulator, tmp_path):
    (tmp_path / "taken").write_text("a file where the folder should be")
    with pytest.warns(RuntimeWarning, match=r"cannot be kept .* name another folder by \$ANM_CACHE"):
        table = load(simulator, tmp_path / "taken")
    assert table.visible.any()
