"""Furnished homes from a tier and a seed: plan, shell and furniture put together as a scene."""

from dataclasses import dataclass

import numpy as np

from anm_gym.mesh import TriangleMesh
from anm_gym.scenes.procedural.furnish import Placement, furnish
from anm_gym.scenes.procedural.layout import plan_home, stream
from anm_gym.scenes.procedural.palette import WOODS, RoomColors, draw_colors, pick
from anm_gym.scenes.procedural.plan import Layout
from anm_gym.scenes.procedural.primitives import Solid, join
from anm_gym.scenes.procedural.shell import build_shell
from anm_gym.scenes.scene import Scene, Storey
from anm_gym.sim.traversable import TraversableGrid


@dataclass(frozen=True, eq=False)
class Home:
    """A furnished home with everything that is known about it."""

    layout: Layout
    """Rooms, walls, doors and windows."""
    placements: tuple[Placement, ...]
    """Furniture, in the order in which it was placed."""
    mesh: TriangleMesh
    """The shell and the furniture, metres, world frame; the floor is at y = 0."""


def build_home(tier: str, seed: int) -> Home:
    """Plan, build and furnish a home.

    Args:
        tier: ``studio``, ``flat``, ``house`` or ``maze``.
        seed: Not negative; the same tier and seed give the same home, bit for bit.

    Raises:
        ValueError: If the tier is unknown or the seed is negative.

    Source:
        Ours.
    """
    layout = plan_home(tier, seed)
    colors = _draw_room_colors(layout)
    placements = furnish(layout, colors)
    solids = [build_shell(layout, colors), *(placement.solid for placement in placements)]
    return Home(layout, placements, _in_world(join(solids), layout))


def make_home(tier: str, seed: int) -> Scene:
    """Make a furnished home as a scene, e.g. ``make_home("flat", 7)``.

    Args:
        tier: ``studio``, ``flat``, ``house`` or ``maze``.
        seed: Not negative; the same tier and seed give the same scene, bit for bit.

    Raises:
        ValueError: If the tier is unknown or the seed is negative.

    Source:
        Ours.
    """
    home = build_home(tier, seed)
    name = f"home:{tier}:{seed}"
    ceiling_m = home.layout.ceiling_m
    navigable_m2 = TraversableGrid.from_mesh(home.mesh, 0.0).component_areas_m2[0]
    storey = Storey(0, 0.0, ceiling_m, navigable_m2)
    return Scene(name, home.mesh, 0.0, ceiling_m, (storey,), f"procedural {name}")


def _draw_room_colors(layout: Layout) -> tuple[RoomColors, ...]:
    rng = stream(layout.tier, layout.seed, 1)
    wood = pick(WOODS, rng)
    return tuple(draw_colors(room.kind, wood, rng) for room in layout.rooms)


def _in_world(solid: Solid, layout: Layout) -> TriangleMesh:
    vertices = solid.vertices.copy()
    vertices[:, (0, 2)] = layout.world_xz(100.0 * solid.vertices[:, (0, 2)])
    return TriangleMesh(np.ascontiguousarray(vertices), solid.faces, solid.colors)
