"""The documentation holds: links lead somewhere, examples run, named commands and targets exist."""

import importlib.util
import re
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parent.parent
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")])
FENCE = re.compile(
    r"^(?P<note><!-- not run: [^\n]* -->\n)?```(?P<language>\w*)\n(?P<body>.*?)^```$", re.M | re.S
)
LINK = re.compile(r"(?<!!)\[[^\]]*\]\((?P<target>[^)\s]+)\)|!\[[^\]]*\]\((?P<image>[^)\s]+)\)")
HEADING = re.compile(r"^#+ +(?P<title>.+)$", re.M)


class Block(NamedTuple):
    """One fenced block of a page."""

    page: Path
    number: int
    language: str
    body: str
    is_run: bool


def text_of(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def blocks_of(page: Path) -> list[Block]:
    return [
        Block(page, number, match["language"], match["body"], match["note"] is None)
        for number, match in enumerate(FENCE.finditer(text_of(page)))
    ]


def name_of(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def anchors_of(page: Path) -> set[str]:
    """List a page's heading anchors as GitHub spells them."""
    titles = [match["title"] for match in HEADING.finditer(FENCE.sub("", text_of(page)))]
    return {re.sub(r"[^\w\- ]", "", title.lower()).strip().replace(" ", "-") for title in titles}


def commands() -> list[str]:
    """List the shell lines of all pages, prompts and continuations taken off."""
    bodies = [
        block.body
        for page in PAGES
        for block in blocks_of(page)
        if block.language in {"console", "bash", "sh"} and block.is_run
    ]
    lines = "\n".join(bodies).replace("\\\n", " ").splitlines()
    return sorted({line.removeprefix("$ ").split(" #")[0].strip() for line in lines if line.strip()})


PYTHON_PAGES = [page for page in PAGES if any(b.language == "python" and b.is_run for b in blocks_of(page))]


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_lead_somewhere(page: Path) -> None:
    broken = []
    for match in LINK.finditer(FENCE.sub("", text_of(page))):
        target = match["target"] or match["image"]
        if target.startswith(("http://", "https://", "mailto:")):
            continue
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        if not file.exists() or (anchor and file.suffix == ".md" and anchor not in anchors_of(file)):
            broken.append(target)
    assert not broken


@pytest.mark.parametrize("page", PYTHON_PAGES, ids=name_of)
def test_python_examples_run(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The examples of one page share their names, as a reader's session would."""
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {"__name__": "example"}
    for block in blocks_of(page):
        if block.language == "python" and block.is_run:
            exec(compile(block.body, f"{name_of(page)}, block {block.number}", "exec"), names)


def test_makefile_has_the_documented_targets() -> None:
    targets = set(re.findall(r"^([a-z-]+):", text_of(ROOT / "Makefile"), re.M))
    named = {line.split()[1] for line in commands() if line.startswith("make ")}
    named |= {match for page in PAGES for match in re.findall(r"`make ([a-z-]+)", text_of(page))}
    assert {"demo", "test"} <= named <= targets


def test_documented_modules_exist() -> None:
    modules = {match for line in commands() for match in re.findall(r"python -m ([\w.]+)", line)}
    assert modules
    assert not [name for name in sorted(modules) if importlib.util.find_spec(name) is None]


def test_documented_configurations_exist() -> None:
    files = {match for page in PAGES for match in re.findall(r"configs/\w+\.yaml", text_of(page))}
    assert not [name for name in sorted(files) if not (ROOT / name).is_file()]


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_page_names_no_place_of_one_machine(page: Path) -> None:
    assert not re.findall(r"(?<![\w.])/(?:home|root|tmp|work|Users)/\S+", text_of(page))
