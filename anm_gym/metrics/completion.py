"""Completion of an episode: how much of the true surface its depth frames came near to, and how near.

It measures the path, not the map; the map is measured by `anm_gym.metrics.map_accuracy`.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anm_gym.geometry import CameraSpec
from anm_gym.mesh import TriangleMesh
from anm_gym.metrics.depth_view import MAX_DEPTH_M, MIN_DEPTH_M, depth_view
from anm_gym.metrics.nearest_observed import NearestObserved
from anm_gym.metrics.observed_cloud import ObservedCloud
from anm_gym.metrics.sample_blocks import SampleBlocks
from anm_gym.metrics.samples import SurfaceSamples, sample_surface

NUM_SAMPLES = 200_000
"""Area-uniform samples of the true surface (released code of Active Neural Mapping)."""

THRESHOLD_M = 0.05
"""A sample counts as completed nearer than this, metres (Active Neural Mapping, Sec. 5.1)."""

OFFICIAL_SIDE_PX = 128
"""Side to which the released code resizes depth before scoring it, pixels."""

OFFICIAL_CAP_M = 1.0
"""Distance of a surface never come near to in the released code, metres."""

SAMPLE_SEED = 0
"""Seed of the sample set: every episode on a mesh is scored at the same points."""


@dataclass(frozen=True)
class CompletionScores:
    """What an episode covered.

    The official measure takes 128 x 128 pixels of each frame and caps distances at 1 m, the native one
    takes all pixels and no cap. Both take depths from 0.07 m to 8 m and the same 200 000 samples.
    """

    comp_pct: float
    """Completion ratio, native: share of the surface within 5 cm of an observed point, per cent. Exact."""
    comp_cm: float
    """Completion distance, native, centimetres: exact for completed samples, within `far_bound_cm` above
    the truth for the others; infinite if nothing was observed."""
    comp_visible_pct: float | None
    """Completion ratio, native, over what is visible from reachable positions, per cent; None if unknown."""
    comp_pct_official: float
    """Completion ratio, official, per cent. Exact."""
    comp_cm_official: float
    """Completion distance, official, centimetres; precise as `comp_cm`."""
    far_bound_cm: float
    """Largest excess of the distance of a sample that was not completed, centimetres."""


class CompletionMeter:
    """Score the depth frames of one episode against the true surface.

    Source:
        Active Neural Mapping, Sec. 5.1 (Comp. ratio and Comp. distance) and its released evaluation. The
        released code puts empty pixels at the camera centre; so does the official measure here.

    Example:
        >>> from anm_gym.geometry import camera_pose
        >>> wall = TriangleMesh(
        ...     np.array([[-9.0, -9, -1], [9, -9, -1], [0, 9, -1]]), np.array([[0, 1, 2]], np.int32)
        ... )
        >>> meter = CompletionMeter(wall, num_samples=1000)
        >>> camera = CameraSpec(64, 64)
        >>> meter.observe(np.ones((64, 64), np.float32), camera, camera_pose([0, 0, 0], 0.0))
        >>> bool(abs(meter.comp_pct - 100 * 4 / 162) < 1.5)  # 2 m x 2 m of the 162 square metres
        True
    """

    def __init__(
        self,
        mesh: TriangleMesh,
        visible: NDArray[np.bool_] | None = None,
        *,
        num_samples: int = NUM_SAMPLES,
        threshold_m: float = THRESHOLD_M,
    ) -> None:
        """Start with nothing observed.

        Args:
            mesh: The true surface, of one storey.
            visible: (M,) bool, whether each of the first M samples of `completion_samples` is visible from
                reachable positions (`ViewTable.visible`); None leaves `comp_visible_pct` unknown.
            num_samples: Size of the sample set.
            threshold_m: Distance below which a sample is completed, metres.

        Raises:
            ValueError: If `visible` is of another sample set: longer than this one, or shorter where this one
                has not the default size, as sets of another size are drawn anew.
        """
        if visible is not None and (
            len(visible) > num_samples or (num_samples != NUM_SAMPLES and len(visible) < num_samples)
        ):
            at_most = "at most " if num_samples == NUM_SAMPLES else ""
            raise ValueError(
                f"`visible` must have {at_most}{num_samples} entries, one per sample, got {len(visible)}"
            )
        self.samples = completion_samples(mesh, num_samples)
        self._visible = visible
        self._blocks = SampleBlocks(self.samples.points)
        self._native = NearestObserved(self._blocks, threshold_m)
        self._official = NearestObserved(self._blocks, threshold_m)
        self._native_cloud = ObservedCloud(mesh.bounds)
        self._official_cloud = ObservedCloud(mesh.bounds)
        self._curve: list[float] = []

    def observe(
        self, depth_m: NDArray[np.float32], camera: CameraSpec, world_from_camera: NDArray[np.floating]
    ) -> None:
        """Score one more frame; the first one is that of the start pose.

        Args:
            depth_m: (H, W) or (H, W, 1) float32 planar depth, metres; 0 is empty.
            camera: The camera that took it.
            world_from_camera: (4, 4) pose.
        """
        view = depth_view(depth_m, camera, world_from_camera, MIN_DEPTH_M, MAX_DEPTH_M)
        official_view = view.thinned(OFFICIAL_SIDE_PX)
        in_view = self._blocks.in_view(view, self._native.reach_m)
        self._native.observe(view, in_view)
        self._native_cloud.add(view.points)
        # Its pixels are some of the others, so it covers nothing that they do not.
        self._official.observe(official_view, self._native.covered_among(in_view))
        self._official_cloud.add(official_view.points)
        if not official_view.is_valid.all():
            self._official_cloud.add(view.world_from_camera[None, :3, 3].astype(np.float32))
        self._curve.append(self.comp_pct)

    @property
    def comp_pct(self) -> float:
        """Completion ratio so far, native, per cent."""
        return 100.0 * self._native.num_covered / len(self.samples)

    @property
    def comp_pct_official(self) -> float:
        """Completion ratio so far, official, per cent."""
        return 100.0 * self._official.num_covered / len(self.samples)

    @property
    def comp_visible_pct(self) -> float | None:
        """Completion ratio so far over the reachable-visible samples, native, per cent; None if unknown."""
        if self._visible is None or not self._visible.any():
            return None
        covered = self._native.covered[: len(self._visible)]
        return float(100.0 * np.mean(covered[self._visible]))

    @property
    def comp_cm(self) -> float:
        """Completion distance so far, native, centimetres; searches the cloud anew at each call."""
        return self._mean_cm(self._native, self._native_cloud, np.inf)

    @property
    def comp_cm_official(self) -> float:
        """Completion distance so far, official, centimetres; searches the cloud anew at each call."""
        return self._mean_cm(self._official, self._official_cloud, OFFICIAL_CAP_M)

    @property
    def curve_pct(self) -> NDArray[np.float32]:
        """(T,) float32 native completion ratio after each observed frame, per cent."""
        return np.array(self._curve, np.float32)

    @property
    def covered(self) -> NDArray[np.bool_]:
        """(N,) bool: which samples are completed, native."""
        return self._native.covered

    def scores(self) -> CompletionScores:
        """Gather every measure of the frames so far."""
        return CompletionScores(
            comp_pct=self.comp_pct,
            comp_cm=self.comp_cm,
            comp_visible_pct=self.comp_visible_pct,
            comp_pct_official=self.comp_pct_official,
            comp_cm_official=self.comp_cm_official,
            far_bound_cm=100.0 * max(self._native_cloud.bound_m, self._official_cloud.bound_m),
        )

    def _mean_cm(self, nearest: NearestObserved, cloud: ObservedCloud, cap_m: float) -> float:
        distance = nearest.distance_m.astype(np.float64)
        far = np.flatnonzero(~np.isfinite(distance))
        distance[far] = cloud.distance_m(self.samples.points[far], cap_m)
        return float(100.0 * distance.mean())


def completion_samples(mesh: TriangleMesh, num_samples: int = NUM_SAMPLES) -> SurfaceSamples:
    """Draw the sample set on which completion is measured, always the same for a mesh.

    Args:
        mesh: The true surface.
        num_samples: Size of the set.

    Returns:
        Samples, uniform by area; any prefix of another size is *not* the set of that size.
    """
    return sample_surface(mesh, num_samples, np.random.default_rng(SAMPLE_SEED))
