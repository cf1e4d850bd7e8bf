"""View tables kept between runs: named by content, written in one stroke, rebuilt when unreadable."""

import hashlib
import os
import warnings
import zipfile
import zlib
from dataclasses import asdict
from pathlib import Path
from typing import Final

import numpy as np

from anm_gym.mesh import TriangleMesh
from anm_gym.metrics.completion import completion_samples
from anm_gym.metrics.view_table import ViewTable, ViewTableSettings, build_view_table, candidate_positions
from anm_gym.sim.simulator import Simulator
from anm_gym.whole_file import whole_file

_FORMAT: Final = 2
_FIELDS: Final = ("points", "positions_xz", "headings_rad", "bits")


def cache_folder() -> Path:
    """Folder of the suite's cache: ``$ANM_CACHE``, or ``~/.cache/anm_gym``."""
    return Path(os.environ.get("ANM_CACHE") or Path.home() / ".cache" / "anm_gym")


def load_view_table(
    mesh: TriangleMesh,
    simulator: Simulator,
    component: int = 1,
    settings: ViewTableSettings | None = None,
    folder: Path | None = None,
) -> ViewTable:
    """Read the view table of a storey from the cache, or build and keep it.

    Args:
        mesh: The surface to be completed (`Scene.storey_mesh`); may be part of the simulator's mesh.
        simulator: Camera, floor and true traversable grid.
        component: The navigable part that the agent can reach.
        settings: Density of poses and samples.
        folder: Folder of the cache; None for `cache_folder`.

    Returns:
        The table; its samples are the first of `completion_samples(mesh)`, so that its `visible` fits
        `CompletionMeter`.
    """
    settings = settings or ViewTableSettings()
    positions = candidate_positions(simulator.grid, component, settings.spacing_m, settings.max_positions)
    name = table_name(mesh, simulator, positions, settings)
    path = (folder or cache_folder()) / "view_tables" / f"{name}.npz"
    table = read_view_table(path)
    if table is None:
        samples = completion_samples(mesh).head(settings.num_samples)
        table = build_view_table(
            samples, simulator.camera, simulator.mesh, simulator.floor_y_m, positions, settings.num_headings
        )
        try:
            write_view_table(path, table)
        except OSError as error:
            warnings.warn(
                f"the view table cannot be kept in {path.parent} ({error}) and will be worked out anew; "
                "name another folder by $ANM_CACHE",
                RuntimeWarning,
                stacklevel=2,
            )
    return table


def table_name(
    mesh: TriangleMesh, simulator: Simulator, positions_xz: np.ndarray, settings: ViewTableSettings
) -> str:
    """Name a table by everything that it depends on, 24 hexadecimal digits."""
    digest = hashlib.sha256(positions_xz.tobytes())
    parts = (mesh.content_hash, simulator.mesh.content_hash, simulator.floor_y_m)
    digest.update(repr((_FORMAT, parts, asdict(simulator.camera.spec), asdict(settings))).encode())
    return digest.hexdigest()[:24]


def read_view_table(path: Path) -> ViewTable | None:
    """Read a table; None if the file is missing, torn or of another shape.

    Args:
        path: File that `write_view_table` wrote.
    """
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
            points, positions, headings, bits = (file[name] for name in _FIELDS)
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error):
        return None
    shape = (len(positions), len(headings), -(-len(points) // 64))
    is_sound = bits.shape == shape and bits.dtype == np.uint64
    return ViewTable(points, positions, headings, bits) if is_sound else None


def write_view_table(path: Path, table: ViewTable) -> None:
    """Write a table; no reader sees half of it.

    Args:
        path: The file; its folder is made if needed.
        table: The table.
    """
    with whole_file(path) as draft, draft.open("wb") as file:
        np.savez_compressed(file, **{name: getattr(table, name) for name in _FIELDS})
