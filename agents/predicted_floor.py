"""Floor that an ensemble predicts, for frontiers: the map in which UPEN's code searches them."""

from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from agents.upen_ensemble import Ensemble
from agents.upen_map import PredictedMap, UpenMapSettings, free_and_unknown
from agents.weights_identity import WeightsIdentity
from anm_gym.envs.mesh_env import Observation
from anm_gym.map.grid_fusion import FloorPose
from anm_gym.sim.grid import GridFrame
from anm_gym.wrappers.goal import GoalWrapper

MARGIN_CELLS = 5
"""Unknown cells around the known ones that are kept; frontiers look that far."""


@dataclass(frozen=True)
class FloorIdentity:
    """What tells a predicted floor from others."""

    ensemble: WeightsIdentity
    """The predictors."""
    raster: UpenMapSettings
    """Their maps."""


@final
class PredictedFloor:
    """The mean prediction of an ensemble, as a map for a `FrontierGoalWrapper`.

    Args:
        ensemble: The predictors.
        settings: The raster; by default certain for good, as published.

    Source:
        UPEN's released code, whose frontier baseline searches the predicted map.
    """

    def __init__(self, ensemble: Ensemble, settings: UpenMapSettings | None = None) -> None:
        self._ensemble, self._settings = ensemble, settings or UpenMapSettings(floor=0.0)
        self.identity = FloorIdentity(ensemble.identity, self._settings)
        self._map: PredictedMap | None = None

    def begin(self, env: GoalWrapper) -> None:
        """Forget the last episode."""
        x, z = env.position_xz
        start = FloorPose((float(x), float(z)), env.heading_rad)
        self._map = PredictedMap(self._ensemble, env.get_wrapper_attr("camera"), start, self._settings)

    def see(self, observation: Observation) -> None:
        """Fuse a depth image and what is predicted from it.

        Raises:
            ValueError: Before `begin`.
        """
        self._known().add(observation["depth"], observation["world_from_camera"].astype(np.float64))

    def floor(self) -> tuple[GridFrame, NDArray[np.bool_], NDArray[np.bool_]]:
        """Where the cells lie, and which are free and unknown; only the part around what is known.

        Raises:
            ValueError: Before `begin`.
        """
        known = self._known()
        free, unknown = free_and_unknown(known.mean)
        rows, columns = (np.flatnonzero((~unknown).any(axis=axis)) for axis in (1, 0))
        if len(rows) == 0:
            return known.frame, free, unknown
        low = np.maximum([rows[0] - MARGIN_CELLS, columns[0] - MARGIN_CELLS], 0)
        high = np.minimum([rows[-1] + 1 + MARGIN_CELLS, columns[-1] + 1 + MARGIN_CELLS], free.shape)
        window: Any = np.s_[low[0] : high[0], low[1] : high[1]]
        x, z = np.asarray(known.frame.origin_xz) + known.frame.cell_m * low[::-1]
        shape = (int(high[0] - low[0]), int(high[1] - low[1]))
        return GridFrame((float(x), float(z)), known.frame.cell_m, shape), free[window], unknown[window]

    def _known(self) -> PredictedMap:
        if self._map is None:
            raise ValueError("the predicted floor must see an episode begin first; call `begin`")
        return self._map
