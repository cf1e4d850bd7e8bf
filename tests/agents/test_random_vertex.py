from collections.abc import Callable

import numpy as np

from agents.random_vertex import RandomVertexGoalWrapper
from anm_gym.actions import Action
from anm_gym.envs.explore import ExploreEnv
from anm_gym.map.voronoi_graph import voronoi_graph
from anm_gym.mesh import TriangleMesh


def turned(env: ExploreEnv, seed: int = 0) -> RandomVertexGoalWrapper:
    """An agent after its turn at the start."""
    wrapped = RandomVertexGoalWrapper(env, seed=seed)
    wrapped.reset(seed=0)
    for _ in range(36):
        wrapped.step(np.int64(Action.TURN_LEFT))
    return wrapped


def test_after_a_turn_goals_are_vertices_of_the_graph(
    explore: Callable[..., ExploreEnv], two_rooms: TriangleMesh
) -> None:
    env = turned(explore(two_rooms, start=(-2.0, 0.0, np.pi / 2)))
    assert [goal.reason for goal in env.goals[:4]] == ["sweep", "sweep", "sweep", "random vertex"]
    graph = voronoi_graph(env.occupancy, env.position_xz)
    assert graph is not None
    assert np.linalg.norm(graph.positions_xz - env.goal.position_xz, axis=1).min() < 0.3


def test_vertices_are_drawn_from_the_whole_graph(
    explore: Callable[..., ExploreEnv], two_rooms: TriangleMesh
) -> None:
    env = turned(explore(two_rooms, start=(-2.0, 0.0, np.pi / 2)))
    drawn = set()
    for _ in range(30):
        env.failures.clear()
        env.report_unreachable("another")
        drawn.add(tuple(np.round(env.goal.position_xz, 2)))
    assert len(drawn) >= 3


def test_vertex_that_failed_is_not_drawn_again(
    explore: Callable[..., ExploreEnv], two_rooms: TriangleMesh
) -> None:
    env = turned(explore(two_rooms, start=(-2.0, 0.0, np.pi / 2)))
    while env.goal.reason == "random vertex":
        failed = env.goal.position_xz
        env.report_unreachable("no way")
        assert np.linalg.norm(env.goal.position_xz - failed) > 0.4
    assert env.goal.reason == "wander"


def test_seeds_draw_unlike_vertices_and_the_same_seed_the_same(
    explore: Callable[..., ExploreEnv], two_rooms: TriangleMesh
) -> None:
    goals = []
    for seed in (0, 0, 1):
        env = turned(explore(two_rooms, start=(-2.0, 0.0, np.pi / 2)), seed)
        env.report_unreachable("another")
        goals.append([tuple(goal.position_xz) for goal in env.goals[3:]])
    assert goals[0] == goals[1] != goals[2]
