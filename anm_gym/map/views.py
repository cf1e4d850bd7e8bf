"""Where to look from: views of variable surface weighed against the steps that they cost (ours).

The paper goes to one cluster of variable surface. Here every traversable place is a candidate; its
gain is the variable surface that it would show, its cost the steps to get there and to turn.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from anm_gym.actions import FORWARD_STEP_M, TURN_STEP_DEG
from anm_gym.checks import check_at_least, check_positive
from anm_gym.geometry import CameraSpec, camera_pose, wrap_angle, wrap_angles
from anm_gym.map.volume import BLOCKED, ObservedVolume

LEAST_STEPS: Final = 1e-9
"""A view costs this at least, where nothing is added to what it costs, steps."""


@dataclass(frozen=True)
class ViewSettings:
    """How candidate views are scored (ours)."""

    max_range_m: float = 6.0
    """Surface farther than this does not count, metres."""
    min_range_m: float = 0.3
    """Surface nearer than this does not count, metres."""
    ray_step_m: float = 0.1
    """Spacing of the samples that look for an obstacle between view and surface, metres."""
    surface_slack_m: float = 0.1
    """The last stretch of a ray in which the surface itself may stand, metres."""
    unknown_decay_m: float = 1.5
    """Length of unknown space after which the hope to see a surface drops to 1/e, metres."""
    max_points: int = 700
    """Surface points that are scored."""
    max_places: int = 80
    """Places that are scored."""
    fixed_cost_steps: float = 18.0
    """Added to each cost, so that a glance close by does not beat a good view, steps."""
    num_headings: int = 36
    """Headings of each place."""
    forward_step_m: float = FORWARD_STEP_M
    """Length of the agent's forward step, metres; goal wrappers set it to that of the environment."""
    turn_step_rad: float = float(np.deg2rad(TURN_STEP_DEG))
    """Angle of its turn, radians; likewise."""

    def __post_init__(self) -> None:
        check_positive(
            self, "max_range_m", "ray_step_m", "unknown_decay_m", "forward_step_m", "turn_step_rad"
        )
        check_at_least(self, 1, "max_points", "max_places", "num_headings")
        check_at_least(self, 0.0, "min_range_m", "surface_slack_m", "fixed_cost_steps")
        if not self.max_range_m / self.ray_step_m < BLOCKED - 1:
            raise ValueError(
                f"`ray_step_m` must be more than `max_range_m` / {BLOCKED - 1}, got {self.ray_step_m} "
                f"of {self.max_range_m}"
            )


@dataclass(frozen=True)
class View:
    """A place and a heading."""

    position_xz: NDArray[np.float64]
    """(2,) floor point, metres."""
    heading_rad: float
    """Where to look, radians."""
    gain: float
    """What is expected to be newly in view; the unit is that of the points' weights."""
    cost_steps: float
    """Steps to get there and to turn, with the fixed cost."""

    @property
    def utility(self) -> float:
        """Gain per step."""
        return self.gain / max(self.cost_steps, LEAST_STEPS)


class TakenViews:
    """The views that an agent has had: what they should have shown and did not, they hide for good (ours).

    Without it, space that no ray ever enters, such as the inside of a cupboard, is looked at again and again.

    Args:
        radius_m: A view counts as taken when one was had this near, metres,
        angle_rad: and in a direction that differs by no more than this, radians.
    """

    def __init__(self, radius_m: float, angle_rad: float) -> None:
        self.radius_m, self.angle_rad = radius_m, angle_rad
        self._poses: list[tuple[float, float, float]] = []

    def add(self, position_xz: NDArray[np.float64], heading_rad: float) -> None:
        """Take note of a view from a (2,) floor point, metres, in a direction, radians."""
        self._poses.append((float(position_xz[0]), float(position_xz[1]), heading_rad))

    def among(self, positions_xz: NDArray[np.float64], num_headings: int) -> NDArray[np.bool_]:
        """Tell which views from (P, 2) places were taken, (P, H); heading h is ``2 pi h / H`` radians."""
        poses = np.array(self._poses).reshape(-1, 3)
        near = np.linalg.norm(positions_xz[:, None] - poses[None, :, :2], axis=2) <= self.radius_m
        headings = 2.0 * np.pi * np.arange(num_headings) / num_headings
        is_towards = np.abs(wrap_angles(headings - poses[:, 2:])) <= self.angle_rad
        # In floats, which count exactly here: products of bool matrices take fifty times as long.
        return np.asarray(near.astype(np.float32) @ is_towards.astype(np.float32) > 0.0)


def expected_visibility(
    places: NDArray[np.float64], points: NDArray[np.float32], volume: ObservedVolume, settings: ViewSettings
) -> NDArray[np.float32]:
    """Estimate how likely each point is seen from each place, whatever the heading.

    Args:
        places: (P, 3) camera centres, metres, world frame.
        points: (V, 3) surface points, metres, world frame.
        volume: What rays have passed and hit.
        settings: Ranges and decay.

    Returns:
        (P, V) float32 in [0, 1]: 0 out of range or behind an observed obstacle, less than 1 through
        unknown space.
    """
    origins = places.T.astype(np.float32)
    offsets = points.T[:, None] - origins[:, :, None]
    ranges = np.sqrt((offsets**2).sum(axis=0)).reshape(-1)
    reach = np.maximum(ranges - settings.surface_slack_m, settings.ray_step_m)
    num_samples = np.ceil(reach / settings.ray_step_m).astype(np.int16)
    ray = np.flatnonzero((ranges > settings.min_range_m) & (ranges < settings.max_range_m))
    ray = ray[np.argsort(-num_samples[ray], kind="stable")]
    steps = offsets.reshape(3, -1).take(ray, axis=1) * (settings.ray_step_m / ranges[ray])
    unknown = volume.trace(origins.take(ray // max(1, len(points)), axis=1), steps, num_samples[ray])
    result = np.zeros(ranges.shape, np.float32)
    result[ray] = np.where(
        unknown < 0, 0.0, np.exp(-settings.ray_step_m * unknown / settings.unknown_decay_m)
    )
    return result.reshape(len(places), len(points))


def in_image(
    center: NDArray[np.float64], heading_rad: float, points: NDArray[np.float32], camera: CameraSpec
) -> NDArray[np.bool_]:
    """Tell which points a level camera has inside its image, whatever stands between.

    Args:
        center: (3,) camera centre, metres, world frame.
        heading_rad: Where it looks, radians.
        points: (V, 3) metres, world frame.
        camera: Its field of view.

    Returns:
        (V,) bool.
    """
    in_camera = (points - center) @ camera_pose(center, heading_rad)[:3, :3]
    ahead = -in_camera[:, 2]
    right, up = 0.5 * camera.width_px / camera.focal_px, 0.5 * camera.height_px / camera.focal_px
    inside = (np.abs(in_camera[:, 0]) < right * ahead) & (np.abs(in_camera[:, 1]) < up * ahead)
    return np.asarray(inside & (ahead > 0.0))


def gains_by_heading(
    places: NDArray[np.float64],
    points: NDArray[np.float32],
    weights: NDArray[np.float32],
    visibility: NDArray[np.float32],
    camera: CameraSpec,
    settings: ViewSettings,
) -> NDArray[np.float64]:
    """Sum the visible weight inside the image for each heading.

    Args:
        places: (P, 3) camera centres.
        points: (V, 3) surface points.
        weights: (V,) worth of each point.
        visibility: (P, V) from `expected_visibility`.
        camera: Its field of view bounds the image.
        settings: Number of headings.

    Returns:
        (P, H) gains; heading h is ``2 pi h / H`` radians.
    """
    offsets = points[None] - places[:, None].astype(np.float32)
    azimuth = np.arctan2(-offsets[..., 0], -offsets[..., 2])
    sector = 2.0 * np.pi / settings.num_headings
    index = np.round(azimuth / sector).astype(np.int64) % settings.num_headings
    half_vertical = np.tan(np.deg2rad(camera.hfov_deg) / 2.0) * camera.height_px / camera.width_px
    horizontal = np.hypot(offsets[..., 0], offsets[..., 2])
    worth = weights * visibility * (np.abs(offsets[..., 1]) < half_vertical * horizontal)
    flat = np.arange(len(places))[:, None] * settings.num_headings + index
    size = len(places) * settings.num_headings
    # Without points, `bincount` counts in whole numbers.
    sums = np.bincount(flat.ravel(), worth.ravel(), minlength=size).astype(np.float64)
    return sectors_in_view(sums.reshape(len(places), settings.num_headings), camera)


def sectors_in_view(sectors: NDArray[np.float64], camera: CameraSpec) -> NDArray[np.float64]:
    """Sum the (P, H, ...) sectors of a circle that an image shows, by the heading of its middle.

    Of a sector that its edge cuts counts the share within.
    """
    sector_rad = 2.0 * np.pi / sectors.shape[1]
    half_sectors = max(0.0, np.deg2rad(camera.hfov_deg) / 2.0 / sector_rad - 0.5)
    whole = int(half_sectors + 1e-9)
    in_view = np.asarray(sum(np.roll(sectors, shift, axis=1) for shift in range(-whole, whole + 1)))
    if (rest := half_sectors - whole) > 1e-9:
        in_view = in_view + rest * sum(np.roll(sectors, shift, axis=1) for shift in (-whole - 1, whole + 1))
    return in_view


def view_costs(
    positions_xz: NDArray[np.float64],
    distances_m: NDArray[np.float64],
    agent_xz: NDArray[np.float64],
    agent_heading_rad: float,
    settings: ViewSettings,
) -> NDArray[np.float64]:
    """Estimate the steps to each place and heading.

    Args:
        positions_xz: (P, 2) floor points.
        distances_m: (P,) length of the path to each, or more where it is tight.
        agent_xz: (2,) where the agent is.
        agent_heading_rad: Where it looks.
        settings: Number of headings, and the agent's steps.

    Returns:
        (P, H) steps: forward steps, the turn onto the path and the turn at its end.
    """
    delta = positions_xz - agent_xz
    goes = distances_m > settings.forward_step_m
    travel = np.where(goes, np.arctan2(-delta[:, 0], -delta[:, 1]), agent_heading_rad)
    headings = 2.0 * np.pi * np.arange(settings.num_headings) / settings.num_headings
    turns = np.abs(wrap_angles(travel - agent_heading_rad))[:, None]
    turns = turns + np.abs(wrap_angles(headings - travel[:, None]))
    steps = distances_m / settings.forward_step_m
    return np.asarray(steps[:, None] + turns / settings.turn_step_rad)


def rank_views(
    positions_xz: NDArray[np.float64],
    gains: NDArray[np.float64],
    costs: NDArray[np.float64],
    settings: ViewSettings,
) -> tuple[View, NDArray[np.float64]]:
    """Choose the view with the highest gain per step.

    Args:
        positions_xz: (P, 2) floor points, metres.
        gains: (P, H) what each view is worth, at least 0; heading h is ``2 pi h / H`` radians.
        costs: (P, H) steps to each; infinite where there is no way.
        settings: The fixed cost.

    Returns:
        The view, whose utility is 0 if none that can be reached has a gain, and the (P, H) utilities of all.
    """
    utilities = gains / np.maximum(costs + settings.fixed_cost_steps, LEAST_STEPS)
    place, heading = np.unravel_index(int(utilities.argmax()), utilities.shape)
    best = View(
        position_xz=positions_xz[place],
        heading_rad=wrap_angle(2.0 * np.pi * heading / settings.num_headings),
        gain=float(gains[place, heading]),
        cost_steps=float(costs[place, heading] + settings.fixed_cost_steps),
    )
    return best, utilities


def sector_of(heading_rad: float, num_headings: int) -> int:
    """Find the heading of a ranking that is nearest to one in radians; heading h is ``2 pi h / H``.

    Example:
        >>> sector_of(-np.pi / 2.0, 36)
        27
    """
    return round(heading_rad * num_headings / (2.0 * np.pi)) % num_headings
