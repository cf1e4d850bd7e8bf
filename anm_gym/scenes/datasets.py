"""Scenes of Gibson, Matterport3D, HM3D and Replica, found under the folder where their owner keeps them.

Where each dataset puts its files and which way is up in them; reading them is left to `load`.
"""

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from difflib import get_close_matches
from fnmatch import fnmatchcase
from glob import escape
from pathlib import Path
from typing import Any, Final

from anm_gym.errors import SceneError
from anm_gym.scenes.load import LoadedScene, load_with_record

ROOT_VARIABLE: Final = "ANM_SCENES"
"""Environment variable with the folder of the datasets, Habitat's ``data/scene_datasets``."""


@dataclass(frozen=True)
class Dataset:
    """How a dataset is laid out.

    Source:
        Habitat's table of datasets, and the datasets' own descriptions.
    """

    title: str
    """Name in messages."""
    folders: tuple[str, ...]
    """Names that its folder may have below the root; the root may be that folder itself."""
    files: tuple[str, ...]
    """Where a scene's mesh is below that folder, the preferred place first: `{scene}` is its name, `{id}`
    what follows a number and a dash in it, `*` any folder."""
    up_axis: str
    """Up axis of its files; habitat-sim takes every stage without a configuration for z up."""


DATASETS: Final = {
    "gibson": Dataset("Gibson", ("gibson",), ("{scene}.glb", "*/{scene}.glb", "{scene}/mesh_z_up.obj"), "z"),
    "mp3d": Dataset("Matterport3D", ("mp3d",), ("{scene}/{scene}.glb", "*/{scene}/{scene}.glb"), "z"),
    "hm3d": Dataset(
        "HM3D",
        ("hm3d",),
        ("{scene}/{id}.glb", "{scene}/{id}.basis.glb", "*/{scene}/{id}.glb", "*/{scene}/{id}.basis.glb"),
        "z",
    ),
    "replica": Dataset(
        "Replica",
        ("replica", "replica_v1"),
        ("{scene}/habitat/mesh_semantic.ply", "{scene}/mesh.ply"),
        "z",
    ),
}
"""The datasets by the first part of their scenes' names, as in ``gibson:Denmark``."""

_NUMBER: Final = re.compile(r"^\d+-")


def is_dataset_scene(name: str) -> bool:
    """Whether a scene's name begins with one of `DATASETS` and a colon."""
    return name.partition(":")[0] in DATASETS and ":" in name


def load_dataset_scene(
    name: str, *, root: str | Path | None = None, up_axis: str = "auto", **options: Any
) -> LoadedScene:
    """Load a scene by its name in a dataset.

    Args:
        name: Such as ``gibson:Denmark``, ``mp3d:gZ6f7yhEvPG``, ``hm3d:00800-TEEsavR23oF``,
            ``replica:room_0``.
        root: Folder of the datasets; None for $ANM_SCENES.
        up_axis: ``"y"`` or ``"z"``; ``"auto"`` takes the dataset's.
        options: Other keywords of `anm_gym.scenes.load.load_scene`.

    Returns:
        The scene under that name, with the record of its repairs.

    Raises:
        SceneError: If there is no such scene, or its file cannot be used.
    """
    path = find_scene(name, root)
    axis = DATASETS[name.partition(":")[0]].up_axis if up_axis == "auto" else up_axis
    loaded = load_with_record(path, up_axis=axis, **options)
    return replace(loaded, scene=replace(loaded.scene, name=name))


def find_scene(name: str, root: str | Path | None = None) -> Path:
    """Find the mesh file of a dataset's scene.

    Args:
        name: Such as ``gibson:Denmark``; the number of an HM3D scene may be left out.
        root: Folder of the datasets; None for $ANM_SCENES.

    Raises:
        SceneError: If there is none; the message lists where it was looked for.
    """
    dataset, folders, scene = _place_of(name, root)
    if not scene or "/" in scene or scene.startswith("."):
        raise SceneError(f"the scene in {name!r} must be a plain name, got {scene!r}")
    for file in _candidates(dataset, folders, scene):
        return file
    known = [found.partition(":")[2] for found in find_scenes(name.partition(":")[0], root)]
    close = get_close_matches(scene, known, n=1, cutoff=0.5)
    hint = f"did you mean {close[0]!r}?" if close else f"{len(known)} other scenes of it are there"
    places = ", ".join(str(folders[0] / _filled(each, scene)) for each in dataset.files)
    raise SceneError(
        f"{name} must be a mesh of {dataset.title} under {_root_of(name, root)}, got none of {places}; {hint}"
    )


def find_scenes(dataset_name: str, root: str | Path | None = None) -> dict[str, Path]:
    """List the scenes of a dataset.

    Args:
        dataset_name: One of `DATASETS`.
        root: Folder of the datasets; None for $ANM_SCENES.

    Returns:
        Mesh files by the scenes' full names, in the order of names; empty if there are none.

    Raises:
        SceneError: If the dataset is unknown or there is no root.
    """
    dataset, folders, _ = _place_of(f"{dataset_name}:", root)
    found: dict[str, Path] = {}
    for folder in folders:
        for template in dataset.files:
            for file, scene in _files_of(folder, template):
                found.setdefault(f"{dataset_name}:{scene}", file)
    return dict(sorted(found.items()))


def _place_of(name: str, root: str | Path | None) -> tuple[Dataset, list[Path], str]:
    """Look up the dataset, the folders in which it may lie, and the scene's own name."""
    dataset_name, _, scene = name.partition(":")
    if dataset_name not in DATASETS:
        raise SceneError(f"unknown dataset {dataset_name!r}; choose one of: {', '.join(DATASETS)}")
    base = _root_of(name, root)
    dataset = DATASETS[dataset_name]
    inside = [base / folder for folder in dataset.folders if (base / folder).is_dir()]
    return dataset, inside or [base], scene


def _root_of(name: str, root: str | Path | None) -> Path:
    given = root if root is not None else os.environ.get(ROOT_VARIABLE)
    if not given:
        title = DATASETS[name.partition(":")[0]].title
        raise SceneError(
            f"the folder of datasets must be known to find scenes of {title}, got none; "
            f"set ${ROOT_VARIABLE} or `root`"
        )
    if not Path(given).is_dir():
        raise SceneError(f"`root` must be a folder of datasets, got {given}; set ${ROOT_VARIABLE} or `root`")
    return Path(given)


def _candidates(dataset: Dataset, folders: list[Path], scene: str) -> Iterator[Path]:
    """Every file that the scene may be, the preferred one first."""
    numbered = f"[0-9]*-{escape(scene)}"
    for spelling in (escape(scene), numbered):
        templates = [each for each in dataset.files if spelling != numbered or "{id}" in each]
        for folder in folders:
            for template in templates:
                pattern = _filled(template, spelling, escape(_id_of(scene)))
                yield from (file for file in sorted(folder.glob(pattern)) if file.is_file())


def _files_of(folder: Path, template: str) -> Iterator[tuple[Path, str]]:
    """Files that match a template, with the scenes' names."""
    index = next(i for i, part in enumerate(template.split("/")) if "{scene}" in part)
    ending = template.split("/")[index].removeprefix("{scene}")
    for file in sorted(folder.glob(_filled(template, "*", "*"))):
        relative = file.relative_to(folder)
        scene = relative.parts[index].removesuffix(ending)
        if fnmatchcase(relative.as_posix(), _filled(template, escape(scene), escape(_id_of(scene)))):
            yield file, scene


def _filled(template: str, scene: str, identifier: str | None = None) -> str:
    return template.format(scene=scene, id=_id_of(scene) if identifier is None else identifier)


def _id_of(scene: str) -> str:
    return _NUMBER.sub("", scene)
