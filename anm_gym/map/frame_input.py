"""What a map is given: a depth image of its camera, in metres, from a rigid and level pose."""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from anm_gym.geometry import CameraSpec, check_rigid
from anm_gym.map.occupancy import check_level

INDOORS_M: Final = 100.0
"""Where most depths of an image are larger, it is not in metres."""


def checked_frame(
    depth_m: ArrayLike, world_from_camera: ArrayLike, camera: CameraSpec
) -> tuple[NDArray[np.float32], NDArray[np.floating]]:
    """Check a posed depth image before anything is changed by it.

    Args:
        depth_m: (H, W) or (H, W, 1) floating point planar depth, metres; 0 is empty.
        world_from_camera: (4, 4) pose.
        camera: The camera.

    Returns:
        The image as float32 of its own, and the pose.

    Raises:
        ValueError: If the image does not fit the camera or is not in metres, or the pose is not rigid or not
            level.
    """
    expected, image = (camera.height_px, camera.width_px), np.asarray(depth_m)
    if image.shape not in (expected, (*expected, 1)):
        raise ValueError(f"`depth_m` must have shape {expected}, got {image.shape}")
    if not np.issubdtype(image.dtype, np.floating):
        raise ValueError(f"`depth_m` must be floating point metres, got {image.dtype}; convert it")
    far = np.count_nonzero((image > INDOORS_M) & (image < np.inf))
    if 2 * far > np.count_nonzero((image > 0.0) & (image < np.inf)):
        raise ValueError(
            f"`depth_m` must be in metres, got depths of more than {INDOORS_M:g}; are they millimetres?"
        )
    pose = np.asarray(world_from_camera)
    check_rigid(pose)
    check_level(pose)
    return np.array(image, np.float32), pose
