"""Compare the presets of the map on equal walks: what they cost, how true they are, what they doubt.

    python -m benchmarks.mapping [--presets LIST] [--scenes LIST] [--steps N] [--families LIST] [--quick]

Every preset learns the same posed depth images. A map is kept as soon as it is learned, so an interrupted
run goes on where it was; its times are those of when it was learned. Take another `--out` after changing how
maps learn.
"""

import argparse
import math
from collections.abc import Sequence
from pathlib import Path
from typing import get_args

import numpy as np
from tqdm import tqdm

from anm_gym.map.presets import map_settings
from anm_gym.map.settings import PerturbationFamily
from benchmarks.learning import learn_once
from benchmarks.quality import QUICK, Effort, make_truth, score_map
from benchmarks.recordings import Recording, record
from train.command import run_command, split_list
from train.plots import tradeoff_figure
from train.pool import prepare_worker
from train.results import Row, append_row, write_json

PRESETS = "paper,released,fast,best"
SCENES = "home:studio:11,home:flat:11,home:house:11"
FAMILIES = "unit_norm,delta_norm,delta_weight,laplace"
REFERENCE = "released"
"""The preset whose CPU time the others are compared with."""

MAP_COLUMNS = (
    ("cpu_ms_step", "learn (CPU-ms)", 1),
    ("observe_ms_step", "log (CPU-ms)", 1),
    ("ratio", f"{REFERENCE} / this", 1),
    ("wall_ms_step", "wall (ms)", 1),
    ("gflops_step", "GFLOP", 2),
    ("points_step", "points", 0),
    ("mad_seen_cm", "MAD seen (cm)", 2),
    ("mad_all_cm", "MAD all (cm)", 2),
    ("free_err_cm", "free err. (cm)", 2),
    ("sign_err_pct", "wrong sign (%)", 2),
    ("fpr_pct", "FPR (%)", 1),
    ("acc_cm", "Acc. (cm)", 2),
    ("memory_mb", "memory (MB)", 1),
)
"""Key, heading and digits of the table of maps; costs are per step."""

FAMILY_COLUMNS = (
    ("auroc_seen", "unseen/seen", 3),
    ("auroc_far", "far/seen", 3),
    ("auroc_false", "false/true", 3),
    ("ause", "AUSE", 3),
    ("variability_ms", "1000 points (CPU-ms)", 1),
)
"""Key, heading and digits of the table of families."""

TRADE_OFFS = (
    ("mad_seen_cm", "MAD on seen surface (cm)"),
    ("free_err_cm", "error in free space (cm)"),
    ("fpr_pct", "false positives (%)"),
)
"""Key and label of the picture's panels."""

Column = tuple[str, str, int]


def compare(
    recording: Recording,
    presets: Sequence[str],
    families: Sequence[str],
    effort: Effort,
    bar: "tqdm[None]",
    out: Path,
) -> list[Row]:
    """Let every preset learn a recording and measure each.

    Args:
        recording: The images.
        presets: Names of presets.
        families: Families of variability.
        effort: How many points the measures take.
        bar: Told after each map.
        out: Folder of `maps/` and of `rows.jsonl`, to which the rows are appended.

    Returns:
        One row per preset and family.
    """
    truth = make_truth(recording, effort)
    rows: list[Row] = []
    for preset in presets:
        bar.set_postfix_str(f"{preset}, {recording.name}")
        learned = learn_once(recording, map_settings(preset), out / "maps")
        names = {"trajectory": recording.name, "seed": recording.seed}
        fresh = [names | row for row in score_map(learned, truth, families, effort)]
        for row in fresh:
            append_row(out / "rows.jsonl", row)
        rows += fresh
        bar.update()
    return rows


def format_block(rows: Sequence[Row]) -> str:
    """Lay out the rows of one recording: a table of maps, and one of families."""
    maps = [_with_ratios(row, rows) for row in _one_per_preset(rows)]
    header = ["preset", "field", *(heading for _, heading, _ in MAP_COLUMNS)]
    table = _aligned([header, *([row["preset"], row["field"], *_cells(row, MAP_COLUMNS)] for row in maps)])
    header = ["preset", "family", *(heading for _, heading, _ in FAMILY_COLUMNS)]
    ranking = _aligned(
        [header, *([row["preset"], row["family"], *_cells(row, FAMILY_COLUMNS)] for row in rows)]
    )
    title = f"{rows[0]['trajectory']}, {rows[0]['steps']} steps"
    return f"{title}\n{table}\n\nAUROC and AUSE of neural variability over zero-crossings\n{ranking}\n"


def draw(rows: Sequence[Row], path: Path) -> Path:
    """Draw errors over CPU time, one marker per preset: its mean over the recordings."""
    points = {}
    for preset in dict.fromkeys(row["preset"] for row in rows):
        own = _one_per_trajectory([row for row in rows if row["preset"] == preset])
        keys = ["cpu_ms_step", *(key for key, _ in TRADE_OFFS)]
        points[preset] = {key: float(np.mean([row[key] for row in own])) for key in keys}
    return tradeoff_figure(points, ("cpu_ms_step", "learning (CPU-ms per step)"), TRADE_OFFS, path)


def _one_per_preset(rows: Sequence[Row]) -> list[Row]:
    return list({row["preset"]: row for row in rows}.values())


def _one_per_trajectory(rows: Sequence[Row]) -> list[Row]:
    return list({row["trajectory"]: row for row in rows}.values())


def _with_ratios(row: Row, rows: Sequence[Row]) -> Row:
    reference = [other["cpu_ms_step"] for other in rows if other["preset"] == REFERENCE]
    ratio = reference[0] / row["cpu_ms_step"] if reference else float("nan")
    return row | {"ratio": ratio, "gflops_step": row["flops_step"] / 1e9}


def _cells(row: Row, columns: Sequence[Column]) -> list[str]:
    return ["–" if math.isnan(row[key]) else f"{row[key]:.{digits}f}" for key, _, digits in columns]


def _is_nan(value: object) -> bool:
    return isinstance(value, float) and math.isnan(value)


def _aligned(lines: Sequence[Sequence[str]]) -> str:
    """Two columns of names to the left, numbers to the right."""
    widths = [max(len(line[column]) for line in lines) for column in range(len(lines[0]))]
    return "\n".join(
        "  ".join(
            cell.ljust(width) if column < 2 else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    )


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--presets", help=f"presets of the map ({PRESETS})")
    parser.add_argument("--scenes", help=f"meshes, plans or procedural homes ({SCENES})")
    parser.add_argument("--steps", type=int, help="images of a recording (200)")
    parser.add_argument("--families", default=FAMILIES, help=f"families of neural variability ({FAMILIES})")
    parser.add_argument("--seed", type=int, default=0, help="seed of the walks (0)")
    parser.add_argument("--out", type=Path, help="folder of maps, rows and picture (runs/mapping)")
    parser.add_argument("--json", type=Path, help="write the rows to this file as well")
    parser.add_argument("--quick", action="store_true", help="one studio, 40 steps, fewer points")
    arguments = parser.parse_args()
    quick = arguments.quick
    arguments.presets = split_list(arguments.presets or ("fast,best" if quick else PRESETS))
    arguments.scenes = split_list(arguments.scenes or ("home:studio:11" if quick else SCENES))
    arguments.families = split_list(arguments.families)
    arguments.steps = arguments.steps or (40 if quick else 200)
    arguments.out = arguments.out or Path("runs/mapping-quick" if quick else "runs/mapping")
    return arguments


def _check(presets: Sequence[str], families: Sequence[str]) -> None:
    known = get_args(PerturbationFamily)
    unknown = [family for family in families if family not in known]
    if unknown:
        raise ValueError(f"unknown families {', '.join(unknown)}; choose some of: {', '.join(known)}")
    for preset in presets:
        if map_settings(preset).field.dropout == 0.0 and set(families) <= {"dropout"}:
            raise ValueError(
                f"`families` must name one beside 'dropout' for preset {preset!r}, which drops none"
            )


def main() -> None:
    """Run the comparison, print its tables, and leave rows and a picture."""
    arguments = _arguments()
    _check(arguments.presets, arguments.families)
    prepare_worker()
    effort, rows = QUICK if arguments.quick else Effort(), []
    (arguments.out / "rows.jsonl").unlink(missing_ok=True)
    total = len(arguments.scenes) * len(arguments.presets)
    with tqdm(total=total, unit="map", dynamic_ncols=True) as bar:
        for scene in arguments.scenes:
            recording = record(scene, arguments.steps, arguments.seed)
            fresh = compare(recording, arguments.presets, arguments.families, effort, bar, arguments.out)
            tqdm.write(format_block(fresh))
            rows += fresh
    print(f"picture: {draw(rows, arguments.out / 'mapping.png')}")
    if arguments.json:
        plain = [{key: None if _is_nan(value) else value for key, value in row.items()} for row in rows]
        write_json(arguments.json, plain)


if __name__ == "__main__":
    run_command(main)
