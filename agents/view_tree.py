"""A random tree of places on the known floor, and the best sequence of looks along one of its branches."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anm_gym.actions import FORWARD_STEP_M, TURN_STEP_DEG
from anm_gym.checks import check_at_least
from anm_gym.geometry import heading_towards, wrap_angle, wrap_angles
from anm_gym.map.reach import ReachableSpace
from anm_gym.map.unseen_volume import UnseenByCell
from anm_gym.map.views import sector_of
from anm_gym.sim.grid_planning import PathTree, RrtSettings, grow_tree, line_is_free


@dataclass(frozen=True, eq=False)
class ViewTree:
    """Places that are reached from the agent's along branches of straight edges."""

    positions_xz: NDArray[np.float64]
    """(N, 2) floor points, the agent's first, metres."""
    parents: NDArray[np.int64]
    """(N,) index of the node before; the first is its own."""

    def way_to(self, node: int) -> list[int]:
        """The nodes from the first to another, both included."""
        way = [node]
        while way[-1] != 0:
            way.append(int(self.parents[way[-1]]))
        return way[::-1]

    def by_depth(self) -> NDArray[np.int64]:
        """All nodes, parents before children."""
        return np.argsort(PathTree(self.positions_xz, self.parents).depths, kind="stable")


def grow_view_tree(
    space: ReachableSpace,
    position_xz: NDArray[np.float64],
    old_branch: list[NDArray[np.float64]],
    settings: RrtSettings,
    rng: np.random.Generator,
) -> ViewTree:
    """Grow a tree over the reachable floor, and keep what still holds of an old branch.

    Args:
        space: The floor that can be reached.
        position_xz: (2,) where the agent stands, metres.
        old_branch: Places (2,) of the last plan, in order; it is joined at the last one that is in sight.
        settings: Points drawn and longest edge.
        rng: Draws the points.

    Source:
        Bircher et al., Receding Horizon "Next-Best-View" Planner for 3D Exploration, 2016, Alg. 1, with RRT*.
    """
    frame, blocked = space.frame, ~space.reachable
    start = _in_cells(space, position_xz)
    grown = grow_tree(blocked, frame.cell_m, start, settings, rng)
    nodes, parents = [*grown.nodes], [*grown.parents.tolist()]
    places = [_in_cells(space, place) for place in old_branch]
    seen = [index for index, place in enumerate(places) if line_is_free(blocked, start[None], place)[0]]
    parent = 0
    for place in places[seen[-1] :] if seen else []:
        if not line_is_free(blocked, np.asarray(nodes[parent])[None], place)[0]:
            break
        nodes.append(place)
        parents.append(parent)
        parent = len(nodes) - 1
    positions = np.asarray(nodes)[:, ::-1] * frame.cell_m + frame.origin_xz
    return ViewTree(positions, np.asarray(parents, np.int64))


def _in_cells(space: ReachableSpace, point_xz: NDArray[np.float64]) -> NDArray[np.float64]:
    """(2,) row and column of a floor point, with fractions."""
    return np.asarray((np.asarray(point_xz) - space.frame.origin_xz)[::-1] / space.frame.cell_m)


@dataclass(frozen=True)
class LookSettings:
    """What a look is worth."""

    decay_per_m: float = 0.25
    """Decay of a look's gain with the cost from the root, 1/m."""
    look_cost_m: float = 1.0
    """Added to the cost of each look, so that a glance does not beat a good view, as a length, metres."""
    min_gain_m3: float = 0.05
    """Looks that show less count nothing, cubic metres."""
    every_node: bool = False
    """Look from every node, from the first ahead and from the others to a drawn heading; else from where and
    to where it is best."""
    shares_views: bool = True
    """Count what an earlier look shows only once."""
    counts_turns: bool = True
    """Count turns as the lengths that take as many steps."""
    turn_cost_m: float = float(FORWARD_STEP_M / np.deg2rad(TURN_STEP_DEG))
    """Length that takes as many steps as a turn of a radian, metres; the goal wrapper sets it."""

    def __post_init__(self) -> None:
        check_at_least(self, 0.0, "decay_per_m", "look_cost_m", "min_gain_m3", "turn_cost_m")


@dataclass(frozen=True, eq=False)
class Look:
    """A look from a node, after others on the same branch."""

    node: int
    """Index in the tree."""
    heading_rad: float
    """Where to look, radians."""
    worth_m3: float
    """Sum of the discounted gains of this look and those before, cubic metres."""
    cost_m: float
    """Cost from the root when the look has been taken, metres."""
    left_m3: NDArray[np.float64]
    """(C,) unseen volume that remains, cubic metres."""
    before: "Look | None"
    """The look before; None at the root."""


def best_looks(
    tree: ViewTree,
    unseen: UnseenByCell,
    heading_rad: float,
    settings: LookSettings,
    rng: np.random.Generator,
) -> list[Look]:
    """Find the sequence of looks along one branch with the largest sum of discounted gains.

    Args:
        tree: Where one can look.
        unseen: What each node would show at each heading.
        heading_rad: Where the agent looks now, radians.
        settings: Discount and what may be left out.
        rng: Draws the headings if every node takes a look.

    Returns:
        The looks in order; empty if nothing is worth one.

    Source:
        Bircher et al., 2016: gain(n) = gain(parent) + visible(n) exp(-decay cost(n)); looking from some
        nodes only, counting a view once, and turns are ours.
    """
    start = Look(0, heading_rad, 0.0, 0.0, unseen.total_m3, None)
    num_headings = unseen.share.shape[1]
    looks: dict[int, Look] = {}
    for node in tree.by_depth().tolist():
        headings = np.arange(num_headings)
        if settings.every_node:
            ahead = np.array([sector_of(heading_rad, num_headings)])
            headings = rng.integers(num_headings, size=1) if node else ahead
        way = tree.way_to(node)
        options = [(start, way)] + [(looks[past], way[place:]) for place, past in enumerate(way[:-1])]
        if settings.every_node:
            options = options[-1:]
        found = [_look(tree, unseen, before, rest, headings, settings) for before, rest in options]
        looks[node] = max(found, key=lambda look: look.worth_m3)
    best: Look | None = max(looks.values(), key=lambda look: look.worth_m3)
    sequence: list[Look] = []
    while best is not None and best.before is not None:
        sequence.append(best)
        best = best.before
    return sequence[::-1] if sequence[0].worth_m3 > 0.0 else []


def _look(
    tree: ViewTree,
    unseen: UnseenByCell,
    before: Look,
    way: list[int],
    choices: NDArray[np.int64],
    settings: LookSettings,
) -> Look:
    """The best look from the last node of a way that begins at the node of the look before."""
    node, places = way[-1], tree.positions_xz[way]
    cost_m = before.cost_m + settings.look_cost_m
    cost_m += float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
    headings = 2.0 * np.pi * choices / unseen.share.shape[1]
    turns_m = np.zeros(len(choices))
    if settings.counts_turns:
        travel_rad = before.heading_rad
        if len(way) > 1:
            cost_m += settings.turn_cost_m * abs(
                wrap_angle(heading_towards(places[0], places[1]) - travel_rad)
            )
            travel_rad = heading_towards(places[-2], places[-1])
        turns_m = settings.turn_cost_m * np.abs(wrap_angles(headings - travel_rad))
    gains = unseen.share[node, choices] @ before.left_m3
    gains[gains < settings.min_gain_m3] = 0.0
    worth = gains * np.exp(-settings.decay_per_m * (cost_m + turns_m))
    best = int(worth.argmax())
    left_m3 = before.left_m3
    if settings.shares_views and worth[best] > 0.0:
        left_m3 = left_m3 * (1.0 - unseen.settled[node, choices[best]])
    return Look(
        node=node,
        heading_rad=wrap_angle(float(headings[best])),
        worth_m3=before.worth_m3 + float(worth[best]),
        cost_m=cost_m + float(turns_m[best]),
        left_m3=left_m3,
        before=before,
    )
