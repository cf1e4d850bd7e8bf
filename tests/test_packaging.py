"""What is installed: metadata, the wheel's contents, declared dependencies, a light import."""

import ast
import re
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

import pytest

import anm_gym

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PACKAGES = ("anm_gym", "agents", "train")
HEAVY = (
    "cv2",
    "embreex",
    "matplotlib",
    "pyrender",
    "scipy",
    "skimage",
    "stable_baselines3",
    "torch",
    "trimesh",
    "warp",
)

DISTRIBUTIONS = {
    "PIL": "pillow",
    "cv2": "opencv-python-headless",
    "mapbox_earcut": "mapbox-earcut",
    "sb3_contrib": "sb3-contrib",
    "skimage": "scikit-image",
    "stable_baselines3": "stable-baselines3",
    "warp": "warp-lang",
    "yaml": "PyYAML",
}
"""Distributions whose name is not that of their module."""


def distribution_names(requirements: list[str]) -> set[str]:
    return {re.split(r"[\[<>=!~; ]", requirement, maxsplit=1)[0] for requirement in requirements}


def foreign_modules(package: str) -> dict[str, str]:
    """Map every foreign top-level module that a package imports to one file that does."""
    found = {}
    for path in sorted((ROOT / package).rglob("*.py")):
        for name in _imported(path):
            if name not in sys.stdlib_module_names and name not in PACKAGES:
                found[name] = path.relative_to(ROOT).as_posix()
    return found


def _imported(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module.split(".")[0]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Build the wheel and give the names of its files."""
    pytest.importorskip("hatchling")
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    (path,) = folder.glob("*.whl")
    with zipfile.ZipFile(path) as archive:
        return archive.namelist()


def test_wheel_holds_one_package_only(wheel: list[str]) -> None:
    tops = {name.split("/")[0] for name in wheel}
    assert tops == {"anm_gym", f"anm_gym-{anm_gym.__version__}.dist-info"}


def test_wheel_holds_every_module_the_type_marker_and_the_licence(wheel: list[str]) -> None:
    sources = {path.relative_to(ROOT).as_posix() for path in (ROOT / "anm_gym").rglob("*.py")}
    assert sources <= set(wheel)
    assert "anm_gym/py.typed" in wheel
    assert any(name.endswith("licenses/LICENSE") for name in wheel)


def test_every_folder_of_modules_is_a_package() -> None:
    folders = {path.parent for package in PACKAGES for path in (ROOT / package).rglob("*.py")}
    assert not [
        folder.relative_to(ROOT).as_posix() for folder in folders if not (folder / "__init__.py").is_file()
    ]


def test_installed_version_is_the_source_version() -> None:
    assert version("anm-gym") == anm_gym.__version__


def test_changelog_tells_of_this_version() -> None:
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert f"## [{anm_gym.__version__}]" in changelog or "## [Unreleased]" in changelog


def test_import_is_light() -> None:
    code = f"import sys, anm_gym; print([name for name in {HEAVY} if name in sys.modules])"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


def test_environments_do_not_load_torch() -> None:
    code = "import sys, anm_gym.envs.explore, anm_gym.envs.pointnav; print('torch' in sys.modules)"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "False"


@pytest.mark.parametrize("package", PACKAGES)
def test_every_imported_library_is_declared(package: str) -> None:
    extras = [entry for entries in PROJECT["optional-dependencies"].values() for entry in entries]
    declared = distribution_names(PROJECT["dependencies"] + extras)
    used = {name: DISTRIBUTIONS.get(name, name) for name in foreign_modules(package)}
    assert {name for name, distribution in used.items() if distribution not in declared} == set()


def test_every_dependency_is_explained() -> None:
    text = (ROOT / "docs" / "dependencies.md").read_text(encoding="utf-8")
    extras = [entry for entries in PROJECT["optional-dependencies"].values() for entry in entries]
    names = distribution_names(PROJECT["dependencies"] + extras) - {"anm-gym"}
    assert not [name for name in sorted(names) if name not in text]
