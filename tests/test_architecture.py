"""The rules of the tree: imports go down the floors, files and docstrings, no unpickling."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("anm_gym", "agents", "train")
MAX_LINES = 400

FLOORS: dict[str, int] = {
    "anm_gym": 0,
    "anm_gym.sim": 1,
    "anm_gym.scenes": 2,
    "anm_gym.envs": 3,
    "anm_gym.map": 3,
    "anm_gym.metrics": 3,
    "anm_gym.wrappers": 4,
    "agents": 5,
    "train": 6,
}
"""Floor of each package; the modules directly in `anm_gym` are the ground."""

HOMES: dict[str, set[str]] = {
    "pyrender": {"anm_gym/sim/color.py"},
    "warp": {"anm_gym/sim"},
    "embreex": {"anm_gym/sim"},
    "stable_baselines3": {"train", "agents/sb3.py"},
    "sb3_contrib": {"train", "agents/sb3.py"},
    "torch": {"anm_gym/map", "anm_gym/wrappers", "agents", "train"},
    "gymnasium": {"anm_gym/registration.py", "anm_gym/envs", "anm_gym/wrappers", "agents", "train"},
    "matplotlib": {"anm_gym/scenes", "train"},
}
"""The only files and folders that may import a library."""

UNPICKLERS = {
    "pickle.load",
    "pickle.loads",
    "torch.load",
    "joblib.load",
    "cloudpickle.load",
    "cloudpickle.loads",
}

SOURCES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
TESTS = sorted((ROOT / "tests").rglob("*.py"))


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"), filename=str(path))


def imports_of(path: Path) -> Iterator[tuple[int, str]]:
    """Yield line and dotted name of every import, those inside functions too."""
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            # `from anm_gym import map` reaches a package; `from anm_gym.map import x` names it.
            yield from ((node.lineno, f"{node.module}.{alias.name}") for alias in node.names)


def package_of(dotted: str) -> str | None:
    """Name the package of the suite that a dotted name lies in; None for foreign ones."""
    parts = dotted.split(".")
    nested = ".".join(parts[:2])
    return nested if nested in FLOORS else parts[0] if parts[0] in FLOORS else None


def dotted_name(node: ast.expr) -> str:
    return ast.unparse(node) if isinstance(node, ast.Attribute | ast.Name) else ""


def calls_of(path: Path) -> Iterator[ast.Call]:
    return (node for node in ast.walk(tree_of(path)) if isinstance(node, ast.Call))


def test_every_package_has_a_floor() -> None:
    folders = {path.parent for path in SOURCES}
    paths = [folder.relative_to(ROOT).parts for folder in folders]
    packages = {".".join(parts[:2] if parts[0] == "anm_gym" else parts[:1]) for parts in paths}
    assert packages <= set(FLOORS)


@pytest.mark.parametrize("path", SOURCES, ids=name_of)
def test_imports_go_down_the_floors(path: Path) -> None:
    own = package_of(".".join(path.relative_to(ROOT).with_suffix("").parts))
    assert own is not None
    wrong = [
        f"line {line}: {name}"
        for line, name in imports_of(path)
        if (other := package_of(name)) and other != own and FLOORS[other] >= FLOORS[own]
    ]
    assert not wrong, (
        f"{name_of(path)} stands on floor {FLOORS[own]} and imports from its own or a higher one"
    )


@pytest.mark.parametrize("library", HOMES)
def test_library_is_imported_at_home_only(library: str) -> None:
    strangers = [
        name_of(path)
        for path in SOURCES
        if any(name.split(".")[0] == library for _, name in imports_of(path))
        and not any(name_of(path) == home or name_of(path).startswith(f"{home}/") for home in HOMES[library])
    ]
    assert not strangers


@pytest.mark.parametrize("library", ["pyrender", "warp", "matplotlib"])
def test_heavy_library_is_imported_where_it_is_used(library: str) -> None:
    eager = [
        name_of(path)
        for path in SOURCES
        if path.is_relative_to(ROOT / "anm_gym")
        for node in tree_of(path).body
        for name in _names_of_import(node)
        if name.split(".")[0] == library
    ]
    assert not eager


def _names_of_import(node: ast.stmt) -> list[str]:
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    return [node.module] if isinstance(node, ast.ImportFrom) and node.module else []


@pytest.mark.parametrize("path", SOURCES + TESTS, ids=name_of)
def test_file_stays_under_the_line_limit(path: Path) -> None:
    assert len(path.read_text(encoding="utf-8").splitlines()) < MAX_LINES


@pytest.mark.parametrize("path", SOURCES, ids=name_of)
def test_only_commands_print(path: Path) -> None:
    if path.is_relative_to(ROOT / "train") or path.name == "__main__.py":
        return
    assert not [call.lineno for call in calls_of(path) if dotted_name(call.func) == "print"]


@pytest.mark.parametrize("path", SOURCES, ids=name_of)
def test_everything_public_has_a_docstring(path: Path) -> None:
    tree = tree_of(path)
    missing = [] if ast.get_docstring(tree) or not tree.body else ["the module"]
    missing += [
        node.name
        for scope in [tree, *_public_classes(tree)]
        for node in scope.body
        if isinstance(node, ast.ClassDef | ast.FunctionDef)
        and not node.name.startswith("_")
        and not ast.get_docstring(node)
    ]
    assert not missing


def _public_classes(tree: ast.Module) -> list[ast.ClassDef]:
    return [node for node in tree.body if isinstance(node, ast.ClassDef) and not node.name.startswith("_")]


@pytest.mark.parametrize("path", SOURCES + TESTS, ids=name_of)
def test_nothing_is_unpickled(path: Path) -> None:
    wrong = [
        f"line {call.lineno}: {ast.unparse(call)[:80]}"
        for call in calls_of(path)
        if dotted_name(call.func) in UNPICKLERS or _is_loose_numpy_load(call)
    ]
    assert not wrong, (
        "a file from a stranger must not run code; use safetensors, JSON, or npz without objects"
    )


def _is_loose_numpy_load(call: ast.Call) -> bool:
    if dotted_name(call.func) not in {"np.load", "numpy.load"}:
        return False
    settings = {keyword.arg: ast.unparse(keyword.value) for keyword in call.keywords}
    return settings.get("allow_pickle") != "False"


def test_floors_know_own_names_from_foreign_ones() -> None:
    assert package_of("anm_gym.map.settings") == "anm_gym.map"
    assert package_of("anm_gym.errors.SceneError") == "anm_gym"
    assert package_of("numpy.random") is None
