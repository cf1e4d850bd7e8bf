"""Examine a scene: ``python -m anm_gym.scenes FILE [--picture out.png] [--json out.json]``."""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from anm_gym.errors import AnmError
from anm_gym.scenes.axes import METRES_PER_UNIT, UP_AXES
from anm_gym.scenes.catalog import make_scene, takes_options
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
    mesh = parser.add_argument_group("meshes only", argument_default=argparse.SUPPRESS)
    mesh.add_argument("--up-axis", choices=UP_AXES, help="up axis; default: auto")
    mesh.add_argument("--unit", choices=tuple(METRES_PER_UNIT), help="unit; default: m")
    mesh.add_argument("--storey", type=int, help="index from the lowest; default: the largest")
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
    given = {name: getattr(options, name) for name in ("up_axis", "unit", "storey") if name in options}
    if not takes_options(options.file):
        if given:
            names = ", ".join(f"--{name.replace('_', '-')}" for name in given)
            raise ValueError(f"{options.file} must come without {names}; only meshes take any")
        return make_scene(options.file)
    load = load_dataset_scene if is_dataset_scene(options.file) else load_with_record
    return load(options.file, **given)


def _write_json(report: MeshReport, path: Path) -> None:
    path.write_text(json.dumps(report.to_json(), indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
