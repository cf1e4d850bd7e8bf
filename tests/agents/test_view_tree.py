import numpy as np
import pytest
from numpy.typing import NDArray

from agents.view_tree import LookSettings, ViewTree, best_looks, grow_view_tree
from anm_gym.map.reach import ReachableSpace
from anm_gym.map.unseen_volume import UnseenByCell
from anm_gym.sim.grid import GridFrame
from anm_gym.sim.grid_planning import RrtSettings

FRAME = GridFrame((0.0, 0.0), 0.05, (60, 120))
"""3 m along z, 6 m along x."""
GROWTH = RrtSettings(iterations=80, extension_m=1.0, neighbour_m=1.5, shrink_m=10.0, sampling="whole_map")
AGENT = np.array([1.0, 1.5])
PLAIN = LookSettings(look_cost_m=0.0)


def floor(door: bool = True) -> ReachableSpace:
    """Two rooms with a wall at x = 3 m, with a door at the far end or none."""
    cost = np.ones(FRAME.shape)
    cost[: 50 if door else 60, 60] = np.inf
    return ReachableSpace(FRAME, cost)


def chain(*places: tuple[float, float]) -> ViewTree:
    """A branch without forks."""
    return ViewTree(np.array(places), np.maximum(np.arange(len(places)) - 1, 0))


def shows(*rows: dict[int, float], cells: int = 2) -> UnseenByCell:
    """What nodes show of cells of 1 m³, at heading 0 of 4: cell -> share."""
    share = np.zeros((len(rows), 4, cells), np.float32)
    for node, row in enumerate(rows):
        for cell, value in row.items():
            share[node, 0, cell] = value
    return UnseenByCell(np.ones(cells), share, share)


def nodes(unseen: UnseenByCell, settings: LookSettings, rng: np.random.Generator) -> list[int]:
    tree = chain((0.0, 0.0), (0.0, -1.0), (0.0, -2.0))
    return [look.node for look in best_looks(tree, unseen, 0.0, settings, rng)]


def test_tree_stays_on_the_floor_and_gets_through_the_door(rng: np.random.Generator) -> None:
    tree = grow_view_tree(floor(), AGENT, [], GROWTH, rng)
    cells = FRAME.cells_of(tree.positions_xz)
    assert floor().reachable[cells[:, 0], cells[:, 1]].all()
    assert (tree.positions_xz[:, 0] > 3.5).any()
    edges = np.linalg.norm(tree.positions_xz - tree.positions_xz[tree.parents], axis=1)
    assert edges.max() <= 1.5 + 1e-9


def test_tree_does_not_cross_a_wall(rng: np.random.Generator) -> None:
    tree = grow_view_tree(floor(door=False), AGENT, [], GROWTH, rng)
    assert len(tree.positions_xz) > 20
    assert tree.positions_xz[:, 0].max() < 3.0


def test_ways_lead_from_the_agent_over_parents(rng: np.random.Generator) -> None:
    tree = grow_view_tree(floor(), AGENT, [], GROWTH, rng)
    way = tree.way_to(len(tree.parents) - 1)
    assert way[0] == 0
    assert [int(tree.parents[node]) for node in way[1:]] == way[:-1]
    order = tree.by_depth().tolist()
    assert all(order.index(tree.parents[node]) <= order.index(node) for node in range(len(order)))


def test_old_branch_is_joined_where_it_is_seen_and_kept_to_its_end(rng: np.random.Generator) -> None:
    branch = [np.array(place) for place in ((1.0, 2.0), (1.5, 2.7), (3.5, 2.7), (4.0, 1.0))]
    settings = RrtSettings(iterations=1, sampling="whole_map")
    tree = grow_view_tree(floor(), AGENT, branch, settings, rng)
    way = tree.positions_xz[tree.way_to(len(tree.parents) - 1)]
    assert way[-1] == pytest.approx((4.0, 1.0))
    assert len(way) < 5


def test_old_branch_ends_where_a_wall_has_appeared(rng: np.random.Generator) -> None:
    branch = [np.array(place) for place in ((1.5, 2.7), (3.5, 2.7), (4.0, 1.0))]
    tree = grow_view_tree(floor(door=False), AGENT, branch, RrtSettings(iterations=1), rng)
    assert tree.positions_xz[:, 0].max() < 3.0


def test_look_that_shows_more_than_it_costs_is_taken(rng: np.random.Generator) -> None:
    assert nodes(shows({}, {0: 1.0}, {1: 1.0}), PLAIN, rng) == [1, 2]
    assert nodes(shows({}, {}, {1: 1.0}), PLAIN, rng) == [2]
    assert nodes(shows({0: 0.04}, {}, {}), PLAIN, rng) == []


def test_view_is_counted_once(rng: np.random.Generator) -> None:
    twice = shows({}, {0: 1.0}, {0: 1.0})
    (look,) = best_looks(chain((0.0, 0.0), (0.0, -1.0), (0.0, -2.0)), twice, 0.0, PLAIN, rng)
    assert look.node == 1
    assert look.worth_m3 == pytest.approx(np.exp(-0.25))


def test_gains_add_up_along_the_branch_as_in_the_paper(rng: np.random.Generator) -> None:
    paper = LookSettings(
        decay_per_m=0.5,
        look_cost_m=0.0,
        min_gain_m3=0.0,
        every_node=True,
        shares_views=False,
        counts_turns=False,
    )
    everywhere = UnseenByCell(np.ones(1), np.ones((3, 4, 1), np.float32), np.ones((3, 4, 1), np.float32))
    looks = best_looks(chain((0.0, 0.0), (0.0, -1.0), (0.0, -3.0)), everywhere, 0.0, paper, rng)
    assert [look.node for look in looks] == [0, 1, 2]
    assert looks[-1].worth_m3 == pytest.approx(1.0 + np.exp(-0.5) + np.exp(-1.5))


def test_glance_aside_is_left_out_where_it_delays_a_better_look(rng: np.random.Generator) -> None:
    share = np.zeros((3, 4, 2), np.float32)
    share[1, 1, 0], share[2, 0, 1] = 0.3, 1.0  # a little to the left of the way, much at its end
    unseen = UnseenByCell(np.array([1.0, 4.0]), share, share)
    assert nodes(unseen, LookSettings(look_cost_m=1.0), rng) == [2]
    assert nodes(unseen, LookSettings(look_cost_m=0.0, counts_turns=False), rng) == [1, 2]


def test_turns_count_like_the_lengths_that_take_as_many_steps(rng: np.random.Generator) -> None:
    behind: NDArray[np.float32] = np.zeros((1, 4, 1), np.float32)
    behind[0, 2, 0] = 1.0
    (look,) = best_looks(chain((0.0, 0.0)), UnseenByCell(np.ones(1), behind, behind), 0.0, PLAIN, rng)
    assert look.cost_m == pytest.approx(18 * 0.065)
    assert abs(look.heading_rad) == pytest.approx(np.pi)
