"""One self-contained HTML page: everything inlined, readable with no network, tables that sort."""

import base64
import html
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from anm_gym.whole_file import write_whole


@dataclass(frozen=True)
class Section:
    """A part of the page."""

    title: str
    """Its heading."""
    body: str
    """Its HTML; make it with the functions of this module, which escape what they are given."""


@dataclass(frozen=True)
class Cell:
    """A table cell: what is shown, and what it sorts by if that is not the text."""

    text: str
    sort_key: float | None = None
    is_best: bool = False
    """Whether to set it bold."""


def page(title: str, subtitle: str, sections: Iterable[Section]) -> str:
    """Assemble the page.

    Args:
        title: Heading and browser title.
        subtitle: One line under the heading.
        sections: The parts, in order.

    Returns:
        A whole HTML document without any external reference.
    """
    parts = [
        f"<section><h2>{html.escape(section.title)}</h2>\n{section.body}</section>" for section in sections
    ]
    return _PAGE.format(
        title=html.escape(title),
        subtitle=html.escape(subtitle),
        style=_STYLE,
        script=_SCRIPT,
        body="\n".join(parts),
    )


def write_page(path: Path, text: str) -> Path:
    """Write the page as UTF-8, whole or not at all."""
    write_whole(path, text)
    return path


def table(headings: Sequence[str], rows: Sequence[Sequence[Cell]]) -> str:
    """Make a table that sorts by a click on a heading."""
    head = "".join(f'<th scope="col">{html.escape(heading)}</th>' for heading in headings)
    body = "\n".join("<tr>" + "".join(map(_cell, row)) + "</tr>" for row in rows)
    return f'<div class="scroll"><table><thead><tr>{head}</tr></thead>\n<tbody>{body}</tbody></table></div>'


def paragraph(text: str) -> str:
    """Make a paragraph of plain text."""
    return f"<p>{html.escape(text)}</p>"


def definitions(pairs: Iterable[tuple[str, str]]) -> str:
    """Make a list of terms and their values."""
    items = "".join(f"<dt>{html.escape(term)}</dt><dd>{html.escape(value)}</dd>" for term, value in pairs)
    return f"<dl>{items}</dl>"


def image(path: Path, caption: str = "") -> str:
    """Inline a PNG or JPEG with a caption; an image that is not there becomes nothing."""
    if not path.exists():
        return ""
    kind = "jpeg" if path.suffix in (".jpg", ".jpeg") else "png"
    data = base64.b64encode(path.read_bytes()).decode()
    text = html.escape(caption)
    return (
        f'<figure><img src="data:image/{kind};base64,{data}" alt="{text}">'
        f"<figcaption>{text}</figcaption></figure>"
    )


def gallery(images: Iterable[str]) -> str:
    """Lay images out in a grid; a click enlarges one."""
    return '<div class="gallery">' + "".join(images) + "</div>"


def _cell(cell: Cell) -> str:
    key = "" if cell.sort_key is None else f' data-key="{cell.sort_key:.9g}"'
    text = html.escape(cell.text)
    return f"<td{key}>{f'<strong>{text}</strong>' if cell.is_best else text}</td>"


_PAGE: Final = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>{style}</style>
</head>
<body>
<header><h1>{title}</h1><p class="subtitle">{subtitle}</p></header>
{body}
<script>{script}</script>
</body>
</html>
"""

_STYLE: Final = """
:root { --text: #222; --soft: #666; --line: #ddd; --back: #fff; --tint: #f6f7f9; }
@media (prefers-color-scheme: dark) {
  :root { --text: #e6e6e6; --soft: #a0a0a0; --line: #3a3a3a; --back: #17181a; --tint: #212326; }
}
body { margin: 0 auto; max-width: 88rem; padding: 1.5rem; color: var(--text); background: var(--back);
  font: 15px/1.5 system-ui, -apple-system, "Segoe UI", "DejaVu Sans", sans-serif; }
h1 { font-size: 1.6rem; margin: 0; } h2 { font-size: 1.15rem; margin: 2.2rem 0 .6rem; }
.subtitle { color: var(--soft); margin: .2rem 0 0; }
.scroll { overflow-x: auto; } section p { color: var(--soft); margin: .4rem 0; }
table { border-collapse: collapse; font-size: .85rem; white-space: nowrap;
  font-variant-numeric: tabular-nums; }
th, td { text-align: right; padding: .35rem .55rem; border-bottom: 1px solid var(--line); }
th:first-child, td:first-child { text-align: left; }
th { cursor: pointer; color: var(--soft); font-weight: 600; user-select: none; }
th[aria-sort=ascending]::after { content: " \\25b2"; } th[aria-sort=descending]::after { content: " \\25bc"; }
tbody tr:hover { background: var(--tint); }
figure { margin: 0; } figure img { max-width: min(100%, 62rem); border-radius: 4px; background: #fff; }
figcaption { color: var(--soft); font-size: .85rem; }
.gallery { display: grid; gap: 1rem; margin-top: 1.2rem;
  grid-template-columns: repeat(auto-fill, minmax(15rem, 1fr)); }
.gallery img { width: 100%; cursor: zoom-in; }
.gallery figure.large { grid-column: 1 / -1; } .gallery figure.large img { cursor: zoom-out; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .2rem 1.2rem; margin: 0; }
dt { color: var(--soft); } dd { margin: 0; overflow-wrap: anywhere; }
"""

_SCRIPT: Final = """
for (const head of document.querySelectorAll("th")) head.addEventListener("click", () => {
  const body = head.closest("table").tBodies[0], column = head.cellIndex;
  const down = head.getAttribute("aria-sort") !== "descending";
  for (const other of head.parentNode.children) other.removeAttribute("aria-sort");
  head.setAttribute("aria-sort", down ? "descending" : "ascending");
  const key = row => { const cell = row.cells[column];
    return cell.dataset.key === undefined ? cell.textContent : parseFloat(cell.dataset.key); };
  const order = (a, b) => { const x = key(a), y = key(b);
    return typeof x === "number" && typeof y === "number" ? x - y : String(x).localeCompare(String(y)); };
  [...body.rows].sort((a, b) => (down ? -1 : 1) * order(a, b)).forEach(row => body.append(row));
});
for (const picture of document.querySelectorAll(".gallery figure"))
  picture.addEventListener("click", () => picture.classList.toggle("large"));
"""
