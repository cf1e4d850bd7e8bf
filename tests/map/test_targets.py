from dataclasses import replace

import numpy as np
import pytest

from anm_gym.map.neural_map import NeuralMap
from anm_gym.map.presets import map_settings
from anm_gym.map.targets import (
    PAPER_TARGETS,
    RELEASED_TARGETS,
    TargetView,
    choose_target_view,
    cluster_faces,
    propose_target_views,
)
from anm_gym.map.zero_crossings import ZeroCrossings

SETTINGS = replace(PAPER_TARGETS, resolution=40)


@pytest.fixture(scope="module")
def half_room(tour) -> NeuralMap:
    """A map that has seen a part of the room."""
    neural_map = NeuralMap(map_settings("fast"), tour.camera)
    for depth, pose in zip(tour.depths[:6], tour.poses[:6], strict=True):
        neural_map.integrate(depth, pose)
    return neural_map


def view(x: float, peak: float, faces: int, area: float) -> TargetView:
    return TargetView(np.array([x, 1.25, 0.1]), 0.0, peak, peak / 2.0, faces, area)


def test_views_stand_at_camera_height_off_their_surface(half_room: NeuralMap) -> None:
    views = propose_target_views(half_room, SETTINGS)
    assert views
    assert all(np.isclose(view.position[1], 1.25, atol=1e-6) for view in views)
    assert all(view.num_faces > 0 and view.area_m2 > 0.0 for view in views)


def test_released_preset_keeps_more_surface_than_the_paper(half_room: NeuralMap) -> None:
    faces = [
        sum(view.num_faces for view in propose_target_views(half_room, replace(preset, resolution=40)))
        for preset in (PAPER_TARGETS, RELEASED_TARGETS)
    ]
    assert faces[1] > 3 * faces[0]


def test_separate_pieces_are_separate_clusters_largest_first() -> None:
    square = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], np.float32)
    surface = ZeroCrossings(
        np.concatenate([square, square + 5.0]),
        np.array([[0, 1, 2], [4, 5, 6], [5, 7, 6]], np.int32),
    )
    clusters = cluster_faces(surface, 0.0)
    assert [len(cluster) for cluster in clusters] == [2, 1]
    assert [len(cluster) for cluster in cluster_faces(surface, 0.5)] == [2]
    assert len(cluster_faces(surface, 0.9)) == 2


def test_each_criterion_chooses_its_view(half_room: NeuralMap) -> None:
    views = [view(1.4, 9.0, 10, 1.0), view(-1.5, 2.0, 50, 1.5), view(-0.9, 1.0, 20, 8.0)]
    settings = replace(SETTINGS, local_horizon=False, clear_height_m=0.0)
    here = np.array([0.3, 1.25, 0.1])
    chosen = {
        criterion: choose_target_view(
            views, half_room, here, np.empty((0, 3), np.float32), replace(settings, criterion=criterion)
        )
        for criterion in ("variance", "mean", "count", "area", "distance")
    }
    expected = {"variance": 0, "mean": 0, "count": 1, "area": 2, "distance": 0}
    assert all(chosen[name] is views[index] for name, index in expected.items())


def test_near_views_give_way_to_far_ones(half_room: NeuralMap) -> None:
    views = [view(0.4, 9.0, 1, 1.0), view(1.6, 1.0, 1, 1.0)]
    settings = replace(SETTINGS, local_horizon=False, clear_height_m=0.0)
    here, nothing = np.array([0.3, 1.25, 0.1]), np.empty((0, 3), np.float32)
    assert choose_target_view(views, half_room, here, nothing, settings) is views[1]
    assert choose_target_view(views[:1], half_room, here, nothing, settings) is views[0]


def test_local_horizon_prefers_what_is_in_view(half_room: NeuralMap) -> None:
    views = [view(-1.6, 9.0, 1, 1.0), view(1.6, 1.0, 1, 1.0)]
    settings = replace(SETTINGS, clear_height_m=0.0)
    here = np.array([0.0, 1.25, 0.1])
    visible = np.array([[0.5, 0.0, -1.0], [2.0, 2.0, 1.0]], np.float32)
    assert choose_target_view(views, half_room, here, visible, settings) is views[1]


def test_no_view_gives_no_choice(half_room: NeuralMap) -> None:
    assert choose_target_view([], half_room, np.zeros(3), np.empty((0, 3), np.float32), SETTINGS) is None


def test_more_than_all_cannot_be_kept() -> None:
    with pytest.raises(ValueError, match=r"`keep_share` must be in \[0, 1\], got 1\.5"):
        replace(SETTINGS, keep_share=1.5)
