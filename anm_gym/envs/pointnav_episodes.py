"""Point-goal episodes as data: what one is, how it is drawn in a scene, how it is played.

In Habitat's terms throughout, so that its datasets and ours are the same thing; `episode_files` reads
and writes them.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

from anm_gym.envs.goals import MAX_STARTS, GoalRange, draw_ends
from anm_gym.envs.largest_part import LARGEST, is_open_between, nearest_place
from anm_gym.envs.shared_scenes import shared_grid, shared_scene
from anm_gym.errors import EpisodeError
from anm_gym.scenes.scene import Scene, Storey
from anm_gym.sim.point_distance import DistanceToPoint
from anm_gym.sim.traversable import TraversableGrid

SAME_FLOOR_M: Final = 0.5
"""Places whose heights differ by less are on one floor, metres (Habitat's generator)."""
GOAL_RADIUS_M: Final = 0.2
"""Radius of a drawn goal, metres (Habitat's generator)."""
SNAP_M: Final = 0.25
"""How far the ends of an episode are moved to where the body fits here, metres.

Habitat's navigation mesh lets an agent stand a few centimetres nearer to walls than a grid of 5 cm does, and
joins places that are cut off here. Farther than the body's diameter and a cell, it would be another place.
"""
UNIT_TOLERANCE: Final = 1e-3
"""How far a quaternion's norm, or the y of the agent's up axis, may be from 1."""

Position = tuple[float, float, float]
Rotation = tuple[float, float, float, float]


@dataclass(frozen=True)
class PointNavEpisode:
    """One point-goal episode; the names and frames are those of Habitat's files.

    Source:
        Habitat's `PointNav-v1` datasets.
    """

    episode_id: str
    """Name of the episode, unique within its scene."""
    scene_id: str
    """Mesh file below the folder of scenes, or another name that `make_scene` knows."""
    start_position: Position
    """Where the agent begins, (x, y, z) metres, world frame with y up."""
    start_rotation: Rotation
    """Where it looks at first, unit quaternion (x, y, z, w); it must be upright."""
    goal_position: Position
    """Where it has to go, (x, y, z) metres."""
    goal_radius_m: float | None = None
    """Radius of the goal, metres; None where the task decides."""
    shortest_paths: Sequence[Any] | None = None
    """Kept as it was read; nothing here uses it."""
    info: Mapping[str, Any] = field(default_factory=dict)
    """Kept as it was read; `geodesic_distance` is in it."""
    goal_others: Mapping[str, Any] = field(default_factory=dict)
    """Keys of the goal that are not named here, such as `room_id`."""
    others: Mapping[str, Any] = field(default_factory=dict)
    """Keys of the file that are not named here, such as `start_room`."""

    @property
    def start(self) -> tuple[float, float, float]:
        """The start as environments take it: x and z in metres, heading in radians."""
        x, _, z = self.start_position
        return x, z, heading_of_rotation(self.start_rotation)

    @property
    def goal(self) -> tuple[float, float]:
        """The goal as environments take it: x and z in metres."""
        return self.goal_position[0], self.goal_position[2]

    @property
    def geodesic_distance_m(self) -> float | None:
        """Length of the shortest path according to whoever made the episode, metres."""
        value = self.info.get("geodesic_distance")
        return None if value is None else float(value)


def heading_of_rotation(rotation: Rotation) -> float:
    """Heading, radians, of an upright quaternion (x, y, z, w): where it turns -z to."""
    x, y, z, w = rotation
    return float(np.arctan2(2.0 * (x * z + w * y), 1.0 - 2.0 * (x * x + y * y)))


def rotation_of_heading(heading_rad: float) -> Rotation:
    """Unit quaternion (x, y, z, w) of a turn about +y."""
    return 0.0, float(np.sin(0.5 * heading_rad)), 0.0, float(np.cos(0.5 * heading_rad))


def is_upright(rotation: Rotation) -> bool:
    """Tell whether a quaternion has the length 1 and leaves the up axis up."""
    x, _, z, _ = rotation
    is_unit = abs(float(np.linalg.norm(rotation)) - 1.0) <= UNIT_TOLERANCE
    return is_unit and 2.0 * (x * x + z * z) <= UNIT_TOLERANCE


def scene_name(scene_id: str, scenes_dir: str | Path = ".") -> str:
    """Name an episode's scene as environments do.

    Files lie below `scenes_dir`; what has a colon, such as ``home:flat:3``, is a name and stays.
    """
    return scene_id if ":" in scene_id else str(Path(scenes_dir) / scene_id)


def reset_options(
    episodes: Iterable[PointNavEpisode],
    *,
    scenes_dir: str | Path = ".",
    scene_options: Mapping[str, Any] | None = None,
    skip_other_storeys: bool = False,
) -> Iterator[dict[str, Any]]:
    """Turn episodes into what ``reset(options=...)`` of `ANM/PointNav-v0` takes, one after the other.

    A start or goal that is not on the largest navigable part is moved to its nearest place, if that is
    within `SNAP_M` and no wall is between them; otherwise it is left as it is, for `reset` to refuse.

    Args:
        episodes: The episodes.
        scenes_dir: Folder below which their mesh files lie.
        scene_options: Keywords for mesh files, the same that the environment was made with; its
            ``storey`` is the one that is played.
        skip_other_storeys: Leave out what is on another storey of its scene, or between storeys, rather than
            raise.

    Yields:
        A dict of ``scene``, ``start`` and ``goal``.

    Raises:
        SceneError: If a scene cannot be used.
        EpisodeError: If an episode is not on the storey that is played; the message names its own.
            If such are left out: when no episode is on any storey, as in a mesh that lies on its side.

    Example:
        >>> episode = next(draw_episodes("home:studio:0", 1, np.random.default_rng(0)))
        >>> sorted(next(reset_options([episode])))
        ['goal', 'scene', 'start']
    """
    between, is_any_on_a_storey = None, False
    for episode in episodes:
        name = scene_name(episode.scene_id, scenes_dir)
        scene = shared_scene(name, scene_options)
        try:
            storey = storey_of(episode, scene)
        except EpisodeError as error:
            if not skip_other_storeys:
                raise
            between = between or error
            continue
        is_any_on_a_storey = True
        if storey == scene.storey:
            grid, (x, z, heading_rad) = shared_grid(scene), episode.start
            start = (*_snapped((x, z), grid), heading_rad)
            yield {"scene": name, "start": start, "goal": _snapped(episode.goal, grid)}
        elif not skip_other_storeys:
            raise EpisodeError(
                f"`start_position` of episode {episode.episode_id} in {scene.name} must be on storey "
                f"{scene.storey.index}, got y = {episode.start_position[1]:.2f}, which is storey "
                f"{storey.index}; pass scene_options={{'storey': {storey.index}}} here and to `make`"
            )
    if between is not None and not is_any_on_a_storey:
        raise between


def storey_of(episode: PointNavEpisode, scene: Scene) -> Storey:
    """Find the storey on which an episode begins and ends.

    Raises:
        EpisodeError: If start or goal is farther than `SAME_FLOOR_M` from every floor, or they are on
            different ones.
    """
    heights_m = {"start_position": episode.start_position[1], "goals[0].position": episode.goal_position[1]}
    found = []
    for name, y_m in heights_m.items():
        nearest = min(scene.storeys, key=lambda storey: abs(storey.floor_y_m - y_m))
        if abs(nearest.floor_y_m - y_m) > SAME_FLOOR_M:
            floors = ", ".join(f"{storey.floor_y_m:.2f}" for storey in scene.storeys)
            raise EpisodeError(
                f"`{name}` of episode {episode.episode_id} in {scene.name} must be within {SAME_FLOOR_M} m "
                f"of a floor (y = {floors}), got y = {y_m:.2f}; check the mesh's `up_axis` and `unit`"
            )
        found.append(nearest)
    if found[0] != found[1]:
        raise EpisodeError(
            f"`goals[0].position` of episode {episode.episode_id} in {scene.name} must be on the start's "
            f"storey {found[0].index}, got y = {episode.goal_position[1]:.2f}, storey {found[1].index}"
        )
    return found[0]


def draw_episodes(
    scene_id: str,
    count: int,
    rng: np.random.Generator,
    *,
    limits: GoalRange | None = None,
    scenes_dir: str | Path = ".",
    scene_options: Mapping[str, Any] | None = None,
) -> Iterator[PointNavEpisode]:
    """Draw episodes in a scene, as `ANM/PointNav-v0` draws them at `reset`.

    Args:
        scene_id: Mesh file below `scenes_dir`, or a procedural name.
        count: How many.
        rng: Where they are drawn.
        limits: Allowed geodesic distances; 1 to 30 m by default.
        scenes_dir: Folder of the mesh files.
        scene_options: Keywords for a mesh file.

    Yields:
        Episodes numbered from 0.

    Raises:
        SceneError: If the scene cannot be used.
        EpisodeError: If `MAX_STARTS` starts have no goal at an allowed distance.
    """
    scene = shared_scene(scene_name(scene_id, scenes_dir), scene_options)
    grid = shared_grid(scene)
    for index in range(count):
        starts = (grid.sample_position(rng) for _ in range(MAX_STARTS))
        start_xz, goal_xz = draw_ends(starts, grid, grid.graph, limits or GoalRange(), rng)
        yield PointNavEpisode(
            episode_id=str(index),
            scene_id=scene_id,
            start_position=(float(start_xz[0]), scene.floor_y_m, float(start_xz[1])),
            start_rotation=rotation_of_heading(float(rng.uniform(-np.pi, np.pi))),
            goal_position=(float(goal_xz[0]), scene.floor_y_m, float(goal_xz[1])),
            goal_radius_m=GOAL_RADIUS_M,
            info={"geodesic_distance": DistanceToPoint(grid, grid.graph, goal_xz)(start_xz)},
        )


def _snapped(position_xz: tuple[float, float], grid: TraversableGrid) -> tuple[float, float]:
    """Move a floor point onto the largest navigable part if that is near, on this side of walls; metres."""
    if grid.component_at(position_xz) == LARGEST:
        return position_xz
    nearest_xz = nearest_place(grid, position_xz)
    if nearest_xz is None or np.linalg.norm(nearest_xz - position_xz) > SNAP_M:
        return position_xz
    is_here = is_open_between(grid, position_xz, nearest_xz)
    return (float(nearest_xz[0]), float(nearest_xz[1])) if is_here else position_xz
