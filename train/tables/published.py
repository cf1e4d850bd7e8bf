"""What the paper prints in its tables, to be read beside our official columns.

One run for each scene, from one start that was not published: intervals cannot be given, and a difference of
a few points means little.

Source:
    Active Neural Mapping, Tables 1 and 2.
"""

from typing import Final

Numbers = dict[str, dict[str, float]]

COVERAGE: Final = ("comp_pct_official", "comp_cm_official")
QUALITY: Final = ("mad_cm_official", "fpr_pct_official", "comp_pct_official")


def _table(keys: tuple[str, ...], lines: dict[str, tuple[float, ...]]) -> Numbers:
    return {name: dict(zip(keys, values, strict=True)) for name, values in lines.items()}


PUBLISHED: Final[dict[str, dict[str, Numbers]]] = {
    "table1": {
        "anm-gibson": _table(
            COVERAGE,
            {
                "Random": (45.80, 34.48),
                "FBE": (68.91, 14.42),
                "UPEN": (63.30, 21.09),
                "OccAnt": (61.88, 23.25),
                "Ours": (80.45, 7.44),
            },
        ),
        "anm-mp3d": _table(
            COVERAGE,
            {
                "Random": (45.67, 26.53),
                "FBE": (71.18, 9.78),
                "UPEN": (69.06, 10.60),
                "OccAnt": (71.72, 9.40),
                "Ours": (73.15, 9.11),
            },
        ),
    },
    "table2": {
        "anm-gibson": _table(
            QUALITY,
            {
                "Random": (8.49, 36.57, 45.80),
                "Module 1": (5.68, 34.65, 79.48),
                "Module 3": (5.44, 25.09, 76.19),
                "Module 4": (6.11, 32.86, 73.70),
                "Ours": (5.10, 28.04, 80.45),
            },
        ),
        "anm-mp3d": _table(
            QUALITY,
            {
                "Random": (8.87, 51.88, 45.67),
                "Module 1": (4.65, 43.03, 71.41),
                "Module 3": (6.06, 39.05, 74.63),
                "Module 4": (4.30, 47.99, 67.75),
                "Ours": (4.29, 40.07, 73.15),
            },
        ),
    },
}
"""By table and protocol: the paper's lines, means over its scenes."""
