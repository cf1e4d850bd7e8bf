"""From variable zero-crossings to target views, the paper's way.

The most variable zero-crossings are kept, clustered by connectivity, and each cluster proposes a
view half a metre off its surface; one of three criteria chooses among them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from anm_gym.checks import check_at_least, check_choices, check_positive, check_share
from anm_gym.map.neural_map import NeuralMap
from anm_gym.map.zero_crossings import EMPTY, Lattice, ZeroCrossings, extract_zero_crossings

Criterion = Literal["variance", "mean", "count", "area", "distance"]


@dataclass(frozen=True)
class TargetSettings:
    """How target views are proposed and chosen.

    Source:
        Active Neural Mapping, Sec. 4.2; the released code where the presets differ.
    """

    resolution: int = 100
    """Lattice points along each axis of the observed extent."""
    crop_m: float = 0.25
    """Zero-crossings farther than this from every observed point are dropped, metres."""
    ceiling_m: float = 0.8
    """Zero-crossings within this of the highest observed point are dropped, metres."""
    keep_share: float = 0.10
    """Share of the zero-crossings, the most variable ones, that are kept."""
    min_cluster_share: float = 0.005
    """Clusters with a smaller share of the kept triangles are dropped."""
    offset_m: float = 0.5
    """Distance of the view from its surface along the gradient, metres."""
    unit_offset: bool = True
    """Normalise the gradient before the offset (the released code does not)."""
    criterion: Criterion = "variance"
    """Which cluster is chosen: highest peak or mean variability, most triangles, largest area, nearest."""
    min_distance_m: float = 1.0
    """Views nearer than this are dropped if any other remains, metres."""
    clear_height_m: float = 0.85
    """Length below the camera that must be free at a view, metres."""
    local_horizon: bool = True
    """Prefer views inside the box of what the camera sees now."""

    def __post_init__(self) -> None:
        check_choices(self)
        check_at_least(self, 2, "resolution")
        check_positive(self, "crop_m", "ceiling_m", "keep_share", "offset_m")
        check_share(self, "keep_share", "min_cluster_share")
        check_at_least(self, 0.0, "min_distance_m", "clear_height_m")


@dataclass(frozen=True)
class TargetView:
    """A viewpoint proposed for a cluster of variable surface."""

    position: NDArray[np.float64]
    """(3,) camera centre, metres, world frame."""
    heading_rad: float
    """Looks at the cluster, radians."""
    peak_variability: float
    """Highest variability in the cluster."""
    mean_variability: float
    """Mean variability of the cluster."""
    num_faces: int
    """Triangles of the cluster."""
    area_m2: float
    """Area of the cluster, square metres."""


def propose_target_views(neural_map: NeuralMap, settings: TargetSettings) -> list[TargetView]:
    """Propose one view for each cluster of variable zero-crossings.

    Args:
        neural_map: A map that has seen at least one frame.
        settings: Shares and offsets.

    Returns:
        Target views in no order; empty if the map predicts no surface.

    Source:
        Active Neural Mapping, Sec. 4.2.
    """
    surface = _candidate_surface(neural_map, settings)
    if len(surface) == 0:
        return []
    variability = neural_map.variability(surface.vertices)
    kept = variability >= np.quantile(variability, 1.0 - settings.keep_share)
    if not kept[surface.faces].all(axis=1).any():
        return []
    variable = surface.keep_vertices(kept)
    used = np.unique(surface.faces[kept[surface.faces].all(axis=1)])
    scores = variability[used]
    gradients = neural_map.gradient(variable.vertices)
    if settings.unit_offset:
        gradients = gradients / np.maximum(np.linalg.norm(gradients, axis=1, keepdims=True), 1e-9)
    camera_y_m = neural_map.occupancy.floor_y_m + neural_map.camera.sensor_height_m
    clusters = cluster_faces(variable, settings.min_cluster_share)
    return [_view(variable, faces, scores, gradients, settings.offset_m, camera_y_m) for faces in clusters]


def cluster_faces(surface: ZeroCrossings, min_share: float) -> list[NDArray[np.int32]]:
    """Split a mesh into connected clusters of faces.

    Args:
        surface: The mesh.
        min_share: Clusters with a smaller share of all faces are dropped, unless none remains.

    Returns:
        (F_c, 3) faces of each cluster, largest first.
    """
    first, second = surface.faces[:, [0, 1]].ravel(), surface.faces[:, [1, 2]].ravel()
    size = len(surface)
    graph = coo_array((np.ones(len(first)), (first, second)), shape=(size, size))
    _, labels = connected_components(graph, directed=False)
    face_labels = labels[surface.faces[:, 0]]
    names, counts = np.unique(face_labels, return_counts=True)
    large = counts >= min_share * len(surface.faces)
    names = names[large] if large.any() else names
    clusters = [surface.faces[face_labels == name] for name in names]
    return sorted(clusters, key=len, reverse=True)


def choose_target_view(
    views: list[TargetView],
    neural_map: NeuralMap,
    camera_position: NDArray[np.float64],
    visible: NDArray[np.float32],
    settings: TargetSettings,
) -> TargetView | None:
    """Choose a target view by the filters and the criterion.

    Each filter (clear column, minimum distance, local horizon) applies only if a view survives it.

    Args:
        views: From `propose_target_views`.
        neural_map: Tells where space is free.
        camera_position: (3,) where the camera is, metres, world frame.
        visible: (N, 3) points that the camera sees now.
        settings: Filters and criterion.

    Returns:
        The chosen view, or None if there is none.

    Source:
        Active Neural Mapping, Sec. 4.2 and Fig. 5.
    """
    if not views:
        return None
    positions = np.stack([view.position for view in views])
    distances = np.linalg.norm(positions - camera_position, axis=1)
    filters = [_clear_columns(neural_map, positions, settings), distances > settings.min_distance_m]
    if settings.local_horizon and len(visible):
        inside = (positions >= visible.min(axis=0)) & (positions <= visible.max(axis=0))
        filters.append(inside[:, [0, 2]].all(axis=1))
    keep = np.ones(len(views), bool)
    for passed in filters:
        keep = keep & passed if (keep & passed).any() else keep
    scores = CRITERIA[settings.criterion](views, distances)
    return views[int(np.argmax(np.where(keep, scores, -np.inf)))]


Scorer = Callable[[list[TargetView], NDArray[np.float64]], NDArray[np.float64]]
CRITERIA: Final[dict[Criterion, Scorer]] = {
    "variance": lambda views, _: np.array([view.peak_variability for view in views]),
    "mean": lambda views, _: np.array([view.mean_variability for view in views]),
    "count": lambda views, _: np.array([float(view.num_faces) for view in views]),
    "area": lambda views, _: np.array([view.area_m2 for view in views]),
    "distance": lambda _, distances: -distances,
}
"""Score of each view by criterion; the highest is chosen."""


def _candidate_surface(neural_map: NeuralMap, settings: TargetSettings) -> ZeroCrossings:
    """Zero-crossings near observed points and below the ceiling."""
    if len(neural_map.cloud) == 0:
        return EMPTY
    bounds = neural_map.cloud.bounds()
    margin = 0.05 * (bounds[1] - bounds[0])
    lattice = Lattice.with_resolution(bounds + np.stack([-margin, margin]), settings.resolution)
    surface = extract_zero_crossings(neural_map.sdf, lattice)
    if len(surface) == 0:
        return surface
    near = neural_map.cloud.distance_of(surface.vertices) <= settings.crop_m
    below = surface.vertices[:, 1] < bounds[1, 1] - settings.ceiling_m
    return surface.keep_vertices(near & below)


def _view(
    surface: ZeroCrossings,
    faces: NDArray[np.int32],
    scores: NDArray[np.float32],
    gradients: NDArray[np.float32],
    offset_m: float,
    camera_y_m: float,
) -> TargetView:
    members = np.unique(faces)
    center = surface.vertices[members].mean(axis=0, dtype=np.float64)
    position = center + offset_m * gradients[members].mean(axis=0, dtype=np.float64)
    position[1] = camera_y_m
    corners = surface.vertices[faces].astype(np.float64)
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return TargetView(
        position=position,
        heading_rad=float(np.arctan2(position[0] - center[0], position[2] - center[2])),
        peak_variability=float(scores[members].max()),
        mean_variability=float(scores[members].mean()),
        num_faces=len(faces),
        area_m2=float(0.5 * np.linalg.norm(cross, axis=1).sum()),
    )


def _clear_columns(
    neural_map: NeuralMap, positions: NDArray[np.float64], settings: TargetSettings
) -> NDArray[np.bool_]:
    """Ten predicted distances below each camera position must be positive."""
    drops = np.linspace(0.0, settings.clear_height_m, 10)
    columns = np.repeat(positions[:, None], len(drops), axis=1)
    columns[..., 1] -= drops
    return np.asarray((neural_map.sdf(columns.reshape(-1, 3)).reshape(len(positions), -1) > 0.0).all(axis=1))


PAPER_TARGETS: Final = TargetSettings()
RELEASED_TARGETS: Final = TargetSettings(keep_share=0.80, unit_offset=False, criterion="count")
