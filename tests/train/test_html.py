"""The page: self-contained, escaped."""

import re

from train import html
from train.html import Cell, Section

PNG = bytes.fromhex(
    "89504e470d0a1a0a0000000d49484452000000010000000108060000001f15c4890000000d49444154789c6360606060000000"
    "050001a5f645400000000049454e44ae426082"
)


def assert_self_contained(text: str) -> None:
    """No reference leads out of the page: every source is inlined data, nothing is fetched."""
    sources = re.findall(r"""(?:src|href)\s*=\s*["']([^"']*)""", text)
    assert all(source.startswith("data:") for source in sources)
    assert not re.search(r"https?://|//cdn|@import|url\(|fetch\(|<link", text)


def test_page_is_self_contained(tmp_path):
    picture = tmp_path / "a.png"
    picture.write_bytes(PNG)
    body = html.gallery([html.image(picture, "trail")]) + html.table(["agent"], [[Cell("fbe")]])
    text = html.page("run", "two agents", [Section("Episodes", body)])
    assert "data:image/png;base64," in text
    assert_self_contained(text)


def test_text_is_escaped():
    body = html.table(["<h>"], [[Cell("<script>x</script>")]]) + html.paragraph("a < b")
    text = html.page("a & b", "<i>", [Section("<b>", body)])
    assert "<script>x" not in text
    assert "<title>a &amp; b</title>" in text


def test_missing_image_leaves_no_trace(tmp_path):
    assert html.image(tmp_path / "none.png", "gone") == ""


def test_cell_sorts_by_its_key_and_shows_its_text():
    assert '<td data-key="12.5"><strong>12.5 ± 1</strong></td>' in html.table(
        ["x"], [[Cell("12.5 ± 1", 12.5, is_best=True)]]
    )


def test_page_is_written_whole(tmp_path):
    path = html.write_page(tmp_path / "sub" / "report.html", "<p>ü</p>")
    assert path.read_text(encoding="utf-8") == "<p>ü</p>"
    assert [file.name for file in path.parent.iterdir()] == ["report.html"]
