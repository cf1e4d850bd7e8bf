"""A mesh report as text for a terminal."""

from collections.abc import Iterator, Sequence

from anm_gym.scenes.report import MeshReport, StoreyReport

_SHOWN_PARTS = 4


def report_table(report: MeshReport) -> str:
    """Lay out a mesh report as aligned lines.

    Args:
        report: What `mesh_report` found.

    Returns:
        Several lines without a final line break.
    """
    return "\n".join([report.name, *_facts(report), "", *_storeys(report), *_notes(report)])


def _facts(report: MeshReport) -> Iterator[str]:
    size = " x ".join(f"{side:.2f}" for side in report.size_m)
    facts = {
        "source": report.source,
        "size (x, y up, z)": f"{size} m",
        "triangles": f"{report.num_triangles:,} ({report.surface_m2:,.1f} m2)",
        "NaN vertices": f"{report.num_nan_vertices:,}",
        "degenerate faces": f"{report.num_degenerate_faces:,}",
        "duplicated faces": f"{report.num_duplicate_faces:,}",
    }
    for name, value in facts.items():
        yield f"  {name:<18} {value}"


def _storeys(report: MeshReport) -> list[str]:
    header = (
        "storey",
        "floor m",
        "ceiling m",
        "navigable m2",
        "level lost",
        "rays lost",
        "back faces",
        "parts m2",
    )
    rows = [_row(storey, storey.index == report.selected_storey) for storey in report.storeys]
    widths = [max(len(row[column]) for row in (header, *rows)) for column in range(len(header))]
    return [_aligned(header, widths), *(_aligned(row, widths) for row in rows)]


def _row(storey: StoreyReport, is_selected: bool) -> tuple[str, ...]:
    rays = storey.surroundings
    parts = ", ".join(f"{area:.1f}" for area in storey.parts_m2[:_SHOWN_PARTS])
    rest = len(storey.parts_m2) - _SHOWN_PARTS
    return (
        f"{storey.index}{' *' if is_selected else '  '}",
        f"{storey.floor_y_m:.2f}",
        "none" if storey.ceiling_y_m is None else f"{storey.ceiling_y_m:.2f}",
        f"{storey.navigable_m2:.1f}",
        f"{rays.level_escape_share:.1%}",
        f"{rays.escape_share:.1%}",
        f"{rays.back_face_share:.1%}",
        f"{parts} and {rest} more" if rest > 0 else parts,
    )


def _aligned(row: Sequence[str], widths: Sequence[int]) -> str:
    """Right-align every column but the last, which is free text."""
    cells = [cell.rjust(width) for cell, width in zip(row[:-1], widths, strict=False)]
    return "  " + "  ".join([*cells, row[-1]])


def _notes(report: MeshReport) -> Iterator[str]:
    for title, notes in (("repairs", report.repairs), ("warnings", report.warnings)):
        if notes:
            yield f"\n{title}"
            yield from (f"  - {note}" for note in notes)
