"""The agent in a mesh: where it stands, how it moves, what it sees."""

from copy import copy
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from anm_gym.actions import FORWARD_STEP_M, TURN_STEP_DEG, Action
from anm_gym.errors import EpisodeError
from anm_gym.geometry import CameraSpec, camera_pose, wrap_angle
from anm_gym.mesh import TriangleMesh
from anm_gym.sim.backends import make_depth_camera
from anm_gym.sim.camera import DepthCamera
from anm_gym.sim.color import ColorCamera
from anm_gym.sim.geodesic import GridGraph, nearest_free_cell
from anm_gym.sim.motion import Motion, move_forward
from anm_gym.sim.traversable import BodySpec, TraversableGrid


@dataclass(frozen=True, eq=False)
class AgentState:
    """Pose of the agent's base on the floor."""

    position_xz: NDArray[np.float64]
    """(2,) floor point, metres, world frame."""
    heading_rad: float
    """Heading, radians, counter-clockwise about +y, 0 looks along -z."""


class Simulator:
    """Discrete motion and depth on one storey of a mesh.

    Args:
        mesh: The scene.
        floor_y_m: Height of the storey's floor, metres.
        camera: The depth camera.
        body: The agent's body.
        backend: Depth back end, see `anm_gym.sim.backends.make_depth_camera`.
        device: Device of the back end.
        cell_m: Edge of a cell of the traversable grid, metres.
        grid: Where the body fits, if that is known already; then `body` and `cell_m` are not used.
        forward_step_m: Length of a forward step, metres.
        turn_step_deg: Angle of a turn, degrees.
    """

    def __init__(
        self,
        mesh: TriangleMesh,
        floor_y_m: float,
        camera: CameraSpec | None = None,
        body: BodySpec | None = None,
        *,
        backend: str = "embree",
        device: str = "cpu",
        cell_m: float = 0.05,
        grid: TraversableGrid | None = None,
        forward_step_m: float = FORWARD_STEP_M,
        turn_step_deg: float = TURN_STEP_DEG,
    ) -> None:
        self.mesh, self.floor_y_m = mesh, floor_y_m
        self._set_steps(forward_step_m, turn_step_deg)
        self.grid = grid or TraversableGrid.from_mesh(mesh, floor_y_m, body, cell_m)
        self.camera: DepthCamera = make_depth_camera(
            mesh, camera or CameraSpec(), backend=backend, device=device
        )
        self._state: AgentState | None = None

    def twin(self, forward_step_m: float, turn_step_deg: float) -> "Simulator":
        """Make another agent in the same world: mesh, grid and camera are shared, the agent is not.

        Args:
            forward_step_m: Length of its forward step, metres.
            turn_step_deg: Angle of its turn, degrees.

        Raises:
            ValueError: If one of them is not > 0.
        """
        twin = copy(self)
        twin._state = None
        twin._set_steps(forward_step_m, turn_step_deg)
        return twin

    @property
    def state(self) -> AgentState:
        """Where the agent is.

        Raises:
            EpisodeError: Before `place`.
        """
        if self._state is None:
            raise EpisodeError("the agent must be placed first; call `place` or reset the environment")
        return self._state

    def place(self, position_xz: ArrayLike, heading_rad: float) -> None:
        """Put the agent on a floor point.

        Raises:
            EpisodeError: If the body does not fit there.
        """
        position = np.array(position_xz, np.float64)
        if not self.grid.is_navigable(position):
            raise EpisodeError(
                f"the agent must stand on navigable floor, got x, z = {position.tolist()}"
                f"; the nearest is {self._nearest_navigable(position)}"
            )
        self._state = AgentState(position, wrap_angle(heading_rad))

    def act(self, action: int, forward_scale: float = 1.0, turn_offset_rad: float = 0.0) -> Motion:
        """Carry out an action.

        Args:
            action: One of `anm_gym.actions.Action`; stop changes nothing.
            forward_scale: Factor on the forward step (actuation noise).
            turn_offset_rad: Added to a turn, radians (actuation noise).

        Returns:
            The motion.

        Raises:
            ValueError: If there is no such action.
        """
        chosen, state = Action(action), self.state
        if chosen is Action.MOVE_FORWARD:
            step_m = max(0.0, forward_scale * self.forward_step_m)
            motion = move_forward(self.grid, state.position_xz, state.heading_rad, step_m)
            self._state = AgentState(motion.position_xz, state.heading_rad)
            return motion
        if chosen is not Action.STOP:
            sign = 1.0 if chosen is Action.TURN_LEFT else -1.0
            turned = state.heading_rad + sign * self.turn_step_rad + turn_offset_rad
            self._state = AgentState(state.position_xz, wrap_angle(turned))
        return Motion(state.position_xz, 0.0, False)

    @property
    def world_from_camera(self) -> NDArray[np.float64]:
        """(4, 4) pose of the camera."""
        x, z = self.state.position_xz
        height_m = self.floor_y_m + self.camera.spec.sensor_height_m
        return camera_pose((x, height_m, z), self.state.heading_rad)

    def depth_m(self) -> NDArray[np.float32]:
        """Planar depth from where the agent is, (H, W) float32 metres, 0 is empty."""
        return self.camera.render(self.world_from_camera)

    def rgb(self) -> NDArray[np.uint8]:
        """Colour image from where the agent is, (H, W, 3) uint8; needs EGL."""
        return self._color_camera.render(self.world_from_camera)

    def geodesic_distance_m(self, from_xz: ArrayLike, to_xz: ArrayLike) -> float:
        """Length of the shortest traversable path, metres; infinite if there is none.

        Over eight neighbours: exact along the axes and diagonals, up to 8 % too long between them.
        """
        path = self.shortest_path(from_xz, to_xz)
        if path is None:
            return float("inf")
        return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())

    def shortest_path(self, from_xz: ArrayLike, to_xz: ArrayLike) -> NDArray[np.float64] | None:
        """Shortest traversable path, (L, 2) floor points with both ends, or None."""
        start, goal = self.grid.cell_at(from_xz), self.grid.cell_at(to_xz)
        cells = None if start is None or goal is None else self.graph.path(start, goal)
        if cells is None:
            return None
        inner = self.grid.frame.centers_of(cells)[1:-1]
        return np.concatenate([np.atleast_2d(from_xz), inner, np.atleast_2d(to_xz)])

    def _set_steps(self, forward_step_m: float, turn_step_deg: float) -> None:
        if not (0.0 < forward_step_m < np.inf and 0.0 < turn_step_deg < np.inf):
            raise ValueError(
                "`forward_step_m` and `turn_step_deg` must be > 0 and finite, "
                f"got {forward_step_m} and {turn_step_deg}"
            )
        self.forward_step_m, self.turn_step_rad = forward_step_m, float(np.deg2rad(turn_step_deg))

    def _nearest_navigable(self, position_xz: NDArray[np.float64]) -> str:
        """The nearest place to stand, for a message."""
        frame = self.grid.frame
        cell = nearest_free_cell(self.grid.navigable, frame.cells_of(position_xz)[0], max(frame.shape))
        return "far away" if cell is None else str(np.round(frame.centers_of(cell)[0], 3).tolist())

    @property
    def graph(self) -> GridGraph:
        """The graph of the navigable cells."""
        return self.grid.graph

    @cached_property
    def _color_camera(self) -> ColorCamera:
        return ColorCamera(self.mesh, self.camera.spec)
