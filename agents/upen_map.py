"""The maps that UPEN keeps in an episode: what was seen, and what the ensemble predicts of the rest."""

from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from agents.upen_ensemble import Ensemble, EnsembleSettings
from anm_gym.checks import check_at_least, check_positive, check_share
from anm_gym.geometry import CameraSpec
from anm_gym.map.grid_fusion import (
    BayesGrid,
    FloorPose,
    centred_frame,
    ego_frame,
    to_ego,
    to_registered,
    window_around,
)
from anm_gym.map.projection import FREE, OCCUPIED, class_probabilities, count_hits, project_depth
from anm_gym.sim.grid import GridFrame

SURE: Final = 0.4
"""Probability from which on the likeliest class is believed; else a cell is unknown (UPEN's code)."""


@dataclass(frozen=True)
class UpenMapSettings:
    """The raster of an episode."""

    map_m: float = 38.4
    """Edge of the square around the start that is mapped, metres (paper's code)."""
    predict_steps: int = 1
    """The ensemble looks at every so many-th frame; at each in the paper's code."""
    floor: float = 1e-3
    """Least probability of a class; 0 in the paper's code, where cells become certain for good."""

    def __post_init__(self) -> None:
        check_positive(self, "map_m")
        check_at_least(self, 1, "predict_steps")
        check_share(self, "floor")


@final
class ObservedMap:
    """Class probabilities of what was seen since the start.

    Args:
        settings: Raster and projection.
        camera: The depth camera.
        start: Where the episode begins; the map is centred on it.
        options: Size and floor of the map.

    Source:
        UPEN's released code; points beyond the map are dropped instead of moved to its border.
    """

    def __init__(
        self, settings: EnsembleSettings, camera: CameraSpec, start: FloorPose, options: UpenMapSettings
    ) -> None:
        self._settings, self._camera = settings, camera
        cells = round(options.map_m / settings.cell_m)
        self.grid = BayesGrid(centred_frame(start.position_xz, cells, settings.cell_m), floor=options.floor)
        self.ego = ego_frame(settings.crop_cells, settings.cell_m, is_centred=True)

    def add(self, depth_m: NDArray[np.float32], world_from_camera: NDArray[np.floating]) -> None:
        """Fuse a depth image, (H, W[, 1]) metres."""
        hits = project_depth(depth_m, self._camera, self._settings.projection, world_from_camera)
        window, inner = window_around(self.grid.frame, hits.points_xz)
        self.grid.fuse(window, class_probabilities(count_hits(hits, inner)))

    def crop(self, pose: FloorPose) -> NDArray[np.float32]:
        """Cut out the square around the agent, (3, h, w) float32, the first row ahead."""
        return to_ego(self.grid.probabilities[0], self.grid.frame, self.ego, pose, self.grid.uniform)


@final
class PredictedMap:
    """What was seen, the mean prediction, and each member's, fused over an episode.

    Args:
        ensemble: The predictors.
        camera: The depth camera.
        start: Where the episode begins.
        settings: The raster.

    Source:
        UPEN's released code: products of every step's predictions, so doubt shrinks even while the agent
        stands still.
    """

    def __init__(
        self, ensemble: Ensemble, camera: CameraSpec, start: FloorPose, settings: UpenMapSettings
    ) -> None:
        self._ensemble, self._settings = ensemble, settings
        self.observed = ObservedMap(ensemble.settings, camera, start, settings)
        self._predicted = BayesGrid(
            self.observed.grid.frame, num_maps=ensemble.settings.members + 1, floor=settings.floor
        )
        self._num_frames = 0

    @property
    def frame(self) -> GridFrame:
        """Where the cells lie."""
        return self._predicted.frame

    @property
    def mean(self) -> NDArray[np.float32]:
        """(3, rows, columns) the fused mean predictions."""
        return np.asarray(self._predicted.probabilities[0])

    @property
    def members(self) -> NDArray[np.float32]:
        """(members, 3, rows, columns) each member's fused predictions."""
        return np.asarray(self._predicted.probabilities[1:])

    def add(self, depth_m: NDArray[np.float32], world_from_camera: NDArray[np.floating]) -> None:
        """Fuse a depth image and what the ensemble makes of the map now."""
        self.observed.add(depth_m, world_from_camera)
        if self._num_frames % self._settings.predict_steps == 0:
            self._predict(FloorPose.of(world_from_camera))
        self._num_frames += 1

    def _predict(self, pose: FloorPose) -> None:
        predicted = self._ensemble.predict(self.observed.crop(pose))
        maps = np.concatenate([predicted.mean(axis=0, keepdims=True), predicted])
        flat, uniform = maps.reshape(-1, *maps.shape[2:]), self._predicted.uniform
        window, put = to_registered(flat, self.observed.ego, self.frame, pose, uniform)
        self._predicted.fuse(window, put.reshape(*maps.shape[:2], *put.shape[1:]))


def free_and_unknown(probabilities: NDArray[np.float32]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Label the cells of (3, rows, columns) class probabilities.

    Returns:
        (rows, columns) free and unknown; what is neither is occupied.

    Source:
        UPEN's released code: the likeliest class where it has at least 0.4, else void; void is unknown.
    """
    is_sure, label = probabilities.max(axis=0) >= SURE, probabilities.argmax(axis=0)
    free, occupied = is_sure & (label == FREE), is_sure & (label == OCCUPIED)
    return free, ~(free | occupied)
