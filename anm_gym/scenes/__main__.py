"""Examine a scene: ``python -m anm_gym.scenes FILE [--picture out.png] [--json out.json]``."""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from anm_gym.errors import AnmError
from anm_gym.scenes.axes import METRES_PER_UNIT, UP_AXES
from anm_gym.scenes.catalog import HOME_PREFIX, make_scene
from anm_gym.scenes.datasets import is_dataset_scene, load_dataset_scene
from anm_gym.scenes.load import LoadedScene, load_with_record
from anm_gym.scenes.report import MeshReport, mesh_report
from anm_gym.scenes.scene import Scene
from anm_gym.scenes.table import report_table


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns 0, or 1 after a message if the scene cannot be used."""
    options = _parser().parse_args(arguments)
    try:
        _examine(options)
    except (AnmError, ValueError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m anm_gym.scenes",
        description="Tell whether a mesh is fit for exploration, and why not.",
    )
    parser.add_argument(
        "file",
        help="mesh (.glb .gltf .obj .ply .stl), floor plan (.json), home:<tier>:<seed>, or gibson:, mp3d:, "
        "hm3d: or replica:<scene> under $ANM_SCENES",
    )
    parser.add_argument("--up-axis", choices=UP_AXES, default="auto", help="up axis of a mesh file")
    parser.add_argument("--unit", choices=tuple(METRES_PER_UNIT), default="m", help="unit of a mesh file")
    parser.add_argument("--storey", type=int, help="index from the lowest; default: the largest")
    parser.add_argument(
        "--picture", type=Path, metavar="PNG", help="draw the storey from above into this file"
    )
    parser.add_argument("--json", type=Path, metavar="JSON", help="write the report into this file")
    return parser


def _examine(options: argparse.Namespace) -> None:
    loaded = _load(options)
    report = mesh_report(loaded)
    print(report_table(report))
    if options.json is not None:
        _write_json(report, options.json)
    if options.picture is not None:
        from anm_gym.scenes.picture import save_picture

        save_picture(loaded if isinstance(loaded, Scene) else loaded.scene, options.picture)


def _load(options: argparse.Namespace) -> Scene | LoadedScene:
    if options.file.startswith(HOME_PREFIX) or options.file.lower().endswith(".json"):
        return make_scene(options.file)
    load = load_dataset_scene if is_dataset_scene(options.file) else load_with_record
    return load(options.file, up_axis=options.up_axis, unit=options.unit, storey=options.storey)


def _write_json(report: MeshReport, path: Path) -> None:
    path.write_text(json.dumps(report.to_json(), indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
