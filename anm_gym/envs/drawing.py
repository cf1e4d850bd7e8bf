"""Pictures of an episode: the top-down map with the trail, and the depth image."""

import cv2
import numpy as np
from numpy.typing import NDArray

from anm_gym.sim.simulator import AgentState, Simulator


def draw_status(simulator, trajectory, goal_xz, caption):
    return np.zeros((256, 512, 3), np.uint8)
