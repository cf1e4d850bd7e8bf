"""Which of a tree's paths crosses most doubt: UPEN's score, as the paper has it and as its code has it."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from agents.upen_ensemble import Score, doubt
from anm_gym.checks import check_choices
from anm_gym.sim.grid_planning import PathTree

Scoring = Literal["paper", "repo"]


@dataclass(frozen=True)
class PathSettings:
    """How paths are scored, and which may be chosen."""

    score: Score = "var_occ"
    """Doubt of a cell."""
    scoring: Scoring = "paper"
    """`paper`: the cells that the path crosses; `repo`: those of the released code, whose lines run between
    the rows of an edge's ends but stay on the column of the first, so that they leave the path."""
    is_mean: bool = False
    """Take the mean over the cells instead of their sum (paper: sum)."""
    min_depth: int = 10
    """Fewest edges of a path."""
    max_depth: int = 10
    """Most edges of a path; in the paper's code exactly 10."""

    def __post_init__(self) -> None:
        check_choices(self)
        if not 1 <= self.min_depth <= self.max_depth:
            raise ValueError(
                f"`min_depth` must be in [1, max_depth], got {self.min_depth} of {self.max_depth}"
            )


def candidates(tree: PathTree, settings: PathSettings) -> NDArray[np.int64]:
    """Find the nodes of a tree at which a path may end, (K,)."""
    depths = tree.depths
    return np.flatnonzero((depths >= settings.min_depth) & (depths <= settings.max_depth))


def node_scores(tree: PathTree, members: NDArray[np.float32], settings: PathSettings) -> NDArray[np.float64]:
    """Score the path from the start to each node of a tree, (N,).

    Args:
        tree: The paths, in cells of the maps.
        members: (members, 3, rows, columns) float32 class probabilities of each member.
        settings: Which doubt, and of which cells.

    Source:
        UPEN, Eq. 3: the sum over a path of the variance of the occupied probability.
    """
    cells, owner = _edge_cells(tree, settings.scoring, members.shape[2:])
    values = doubt(members[:, :, cells[:, 0], cells[:, 1]], settings.score)
    count = len(tree.nodes)
    totals = np.bincount(owner, values, minlength=count).astype(np.float64)
    lengths = np.bincount(owner, minlength=count).astype(np.float64)
    depths = tree.depths
    for depth in range(2, int(depths.max(initial=0)) + 1):
        nodes = np.flatnonzero(depths == depth)
        totals[nodes] += totals[tree.parents[nodes]]
        lengths[nodes] += lengths[tree.parents[nodes]]
    return totals / np.maximum(lengths, 1.0) if settings.is_mean else totals


def _edge_cells(
    tree: PathTree, scoring: Scoring, shape: tuple[int, ...]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Cells (K, 2) on the edge to each node but the start, without the edge's first, and (K,) that node."""
    nodes = np.arange(1, len(tree.nodes))
    first = tree.nodes[tree.parents[nodes]].astype(np.int64)
    last = tree.nodes[nodes].astype(np.int64)
    if scoring == "repo":
        last[:, 1] = first[:, 1]
    steps = np.abs(last - first).max(axis=1, initial=0)
    owner = np.repeat(nodes, steps)
    order = np.arange(len(owner)) - np.repeat(np.cumsum(steps) - steps, steps) + 1
    share = order / np.repeat(np.maximum(steps, 1), steps)
    begin, end = np.repeat(first, steps, axis=0), np.repeat(last, steps, axis=0)
    cells = np.rint(begin + share[:, None] * (end - begin)).astype(np.int64)
    return np.clip(cells, 0, np.asarray(shape) - 1), owner
