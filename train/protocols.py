"""Protocols: which scenes, how many steps in each, from which starts; what makes rows comparable.

A protocol is data. Start poses are read from and written to JSON files by `train.starts`.
"""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from anm_gym.checks import check_known
from anm_gym.errors import SceneError
from anm_gym.scenes.datasets import ROOT_VARIABLE, find_scene, is_dataset_scene
from anm_gym.scenes.reading import SUFFIXES
from train.command import check_scene_names, scene_label

SHORT_STEPS: Final = 1000
"""Budget of scenes with at most five rooms (Active Neural Mapping, supplement)."""
LONG_STEPS: Final = 2000
"""Budget of larger scenes (Active Neural Mapping, supplement)."""

GIBSON_SHORT: Final = ("Denmark", "Elmira", "Eudora", "Greigsville", "Pablo", "Ribera")
GIBSON_LONG: Final = ("Cantwell", "Eastville", "Swormville")
MP3D_SHORT: Final = ("gZ6f7yhEvPG", "pLe4wQe7qrG", "YmJkqBEsHnH")
MP3D_LONG: Final = ("GdvgFV5R1Z5", "HxpKQynjfin")
"""Scenes of the paper's tables, by budget (Active Neural Mapping, supplement)."""

HOME_BUDGETS: Final = {"studio": SHORT_STEPS, "flat": SHORT_STEPS, "house": LONG_STEPS, "maze": LONG_STEPS}
"""Budget of procedural homes by tier, by the paper's rule of five rooms."""
UNSEEN_SEEDS: Final = (90001, 90002)
"""Homes of `open-homes`; nothing may be trained or tuned on seeds from 90 000 to 99 999."""


@dataclass(frozen=True)
class ProtocolScene:
    """A scene with its budget."""

    name: str
    """What `anm_gym.scenes.make_scene` takes."""
    steps: int
    """Budget of an episode."""

    def __post_init__(self) -> None:
        if self.steps < 1:
            raise ValueError(f"`steps` must be >= 1, got {self.steps}")

    @property
    def label(self) -> str:
        """Name in rows."""
        return scene_label(self.name)


@dataclass(frozen=True)
class Protocol:
    """The conditions under which agents are compared.

    Raises:
        ValueError: If there is no scene, or two scenes have one name, see `check_scene_names`.
    """

    name: str
    """Name in rows."""
    base: str
    """Name of the protocol from which this one was shortened; its own if it was not."""
    scenes: tuple[ProtocolScene, ...]
    """Scenes and budgets."""

    def __post_init__(self) -> None:
        if not self.scenes:
            raise ValueError("`scenes` must name at least one, got none")
        check_scene_names(scene.name for scene in self.scenes)

    def only(self, labels: Sequence[str]) -> "Protocol":
        """Keep some of the scenes; rows stay comparable scene by scene.

        Raises:
            ValueError: If one is not in the protocol, or named twice.
        """
        known = {scene.label: scene for scene in self.scenes}
        if len(set(labels)) != len(labels):
            raise ValueError(f"`scenes` must be named once each, got {', '.join(labels)}")
        unknown = [label for label in labels if label not in known]
        if unknown:
            raise ValueError(
                f"unknown scene {', '.join(unknown)!r} of {self.name}; choose among: {', '.join(known)}"
            )
        return replace(self, scenes=tuple(known[label] for label in labels))

    def shortened(self, steps: int) -> "Protocol":
        """Give every scene the same budget; the name tells, so that rows do not mix with the full ones."""
        scenes = tuple(ProtocolScene(scene.name, steps) for scene in self.scenes)
        return replace(self, name=f"{self.base}-{steps}-steps", scenes=scenes)

    def require_scenes(self, root: str | Path | None = None) -> None:
        """Look for the files of all datasets' scenes before anything is run.

        Args:
            root: Folder of the datasets; None for $ANM_SCENES.

        Raises:
            SceneError: If one is missing; the message names them all and where they were looked for, each
                reason once.
        """
        missing: dict[str, list[str]] = {}
        for scene in self.scenes:
            try:
                if is_dataset_scene(scene.name):
                    find_scene(scene.name, root)
            except SceneError as error:
                missing.setdefault(str(error), []).append(scene.label)
        if missing:
            count = sum(map(len, missing.values()))
            reasons = "; ".join(f"{', '.join(labels)}: {reason}" for reason, labels in missing.items())
            raise SceneError(f"{self.name} lacks {count} of {len(self.scenes)} scenes: {reasons}")


def make_protocol(name: str, root: str | Path | None = None) -> Protocol:
    """Look up a protocol.

    Args:
        name: One of `PROTOCOLS`.
        root: For `open-scenes`, the folder of meshes.

    Raises:
        ValueError: If there is no such protocol, or `open-scenes` has no folder with meshes.
    """
    if name == OPEN_SCENES:
        return _open_scenes(root)
    check_known("protocol", name, PROTOCOLS)
    return Protocol(name, name, _FIXED[name]())


def whole_budgets(name: str) -> dict[str, int]:
    """Budgets by label of all scenes of a protocol that fixes them; empty for other names."""
    return {scene.label: scene.steps for scene in _FIXED[name]()} if name in _FIXED else {}


def open_protocol(name: str, root: str | None) -> Protocol:
    """Look up a protocol for a command; workers find its scenes through the environment, too.

    Args:
        name: One of `PROTOCOLS`.
        root: Folder of datasets, or of the meshes of `open-scenes`; None leaves $ANM_SCENES as it is.
    """
    if root is not None and name != OPEN_SCENES:
        os.environ[ROOT_VARIABLE] = str(Path(root).resolve())
    return make_protocol(name, root)


def _paper_scenes(dataset: str, short: Sequence[str], long: Sequence[str]) -> tuple[ProtocolScene, ...]:
    budgets = dict.fromkeys(short, SHORT_STEPS) | dict.fromkeys(long, LONG_STEPS)
    return tuple(ProtocolScene(f"{dataset}:{name}", steps) for name, steps in budgets.items())


def _open_homes() -> tuple[ProtocolScene, ...]:
    return tuple(
        ProtocolScene(f"home:{tier}:{seed}", steps)
        for tier, steps in HOME_BUDGETS.items()
        for seed in UNSEEN_SEEDS
    )


def _open_scenes(root: str | Path | None) -> Protocol:
    """Every mesh below a folder, in the order of paths, but for hidden files."""
    if root is None or not Path(root).is_dir():
        raise ValueError(f"`root` of {OPEN_SCENES} must be a folder of meshes, got {root}")
    files = sorted(file for file in Path(root).resolve().rglob("*") if _is_mesh(file))
    if not files:
        raise ValueError(f"`root` must hold meshes ({' '.join(SUFFIXES)}), got none in {root}")
    return Protocol(OPEN_SCENES, OPEN_SCENES, tuple(ProtocolScene(str(file), SHORT_STEPS) for file in files))


def _is_mesh(file: Path) -> bool:
    return file.suffix.lower() in SUFFIXES and not file.name.startswith(".") and file.is_file()


_FIXED: Final[dict[str, Callable[[], tuple[ProtocolScene, ...]]]] = {
    "open-homes": _open_homes,
    "anm-gibson": lambda: _paper_scenes("gibson", GIBSON_SHORT, GIBSON_LONG),
    "anm-mp3d": lambda: _paper_scenes("mp3d", MP3D_SHORT, MP3D_LONG),
}
OPEN_SCENES: Final = "open-scenes"
PROTOCOLS: Final = (*_FIXED, OPEN_SCENES)
"""Names of all protocols: generated homes, the paper's two sets of scenes, and a folder of any meshes."""
