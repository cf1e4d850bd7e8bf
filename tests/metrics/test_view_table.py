import numpy as np
import pytest

from anm_gym.geometry import CameraSpec, camera_pose
from anm_gym.metrics.completion import completion_samples
from anm_gym.metrics.depth_view import depth_view
from anm_gym.metrics.nearest_observed import NearestObserved
from anm_gym.metrics.sample_blocks import SampleBlocks
from anm_gym.metrics.view_table import (
    ViewTableSettings,
    build_view_table,
    candidate_positions,
    pack,
    unpack,
)
from anm_gym.sim.backends import make_depth_camera
from anm_gym.sim.traversable import TraversableGrid

CAMERA = CameraSpec()
NUM_SAMPLES = 4000


def table_of(mesh, positions, num_headings=12, spec=CAMERA):
    samples = completion_samples(mesh, NUM_SAMPLES)
    camera = make_depth_camera(mesh, spec)
    return build_view_table(samples, camera, mesh, 0.0, np.asarray(positions), num_headings)


@pytest.mark.parametrize("count", [1, 63, 64, 65, 200])
def test_unpacking_undoes_packing(rng, count):
    mask = rng.random((3, count)) < 0.5
    words = pack(mask)
    assert words.shape == (3, -(-count // 64))
    assert np.bitwise_count(words).sum() == mask.sum()
    assert all(
        np.array_equal(unpack(row, count), expected) for row, expected in zip(words, mask, strict=True)
    )


@pytest.mark.parametrize(
    ("spec", "rim"), [(CAMERA, 0.12), (CameraSpec(max_depth_m=2.0), 0.2), (CameraSpec(min_depth_m=1.5), 0.2)]
)
def test_a_pose_covers_what_its_rendered_frame_covers(two_rooms, spec, rim):
    table = table_of(two_rooms, [[-1.0, 0.3], [1.5, -0.4]], spec=spec)
    camera = make_depth_camera(two_rooms, spec)
    for row, (x, z) in enumerate(table.positions_xz):
        for column, heading in enumerate(table.headings_rad):
            pose = camera_pose([x, 1.25, z], heading)
            nearest = NearestObserved(SampleBlocks(table.points), 0.05)
            nearest.observe(depth_view(camera.render(pose), spec, pose))
            promised, kept = table.covers(row, column), nearest.covered
            assert np.count_nonzero(promised & ~kept) <= 0.005 * kept.sum() + 2
            assert np.count_nonzero(kept & ~promised) <= rim * kept.sum() + 2  # the 5 cm rim of every edge


def test_from_one_room_only_a_wedge_of_the_other_is_visible(two_rooms):
    table = table_of(two_rooms, [[-3.5, 0.0]])
    x, _, z = table.points.T
    assert table.visible[(x > 0.5) & (np.abs(z) < 0.3) & (x < 3.5)].mean() > 0.5
    assert not table.visible[(x > 0.1) & (x < 2.0) & (np.abs(z) > 1.9)].any()


def test_the_reachable_visible_surface_leaves_out_what_the_camera_cannot_tilt_to(box_room):
    table = table_of(box_room(2.0, 2.0, 6.0), [[0.0, 0.0]])
    walls = (table.points[:, 1] > 0.01) & (table.points[:, 1] < 5.99)
    assert not table.visible[table.points[:, 1] > 5.99].any()
    assert table.visible[walls & (np.abs(table.points[:, 1] - 1.25) < 0.9)].all()
    assert not table.visible[walls & (table.points[:, 1] > 1.25 + np.sqrt(2.0) + 0.1)].any()


def test_candidates_cover_the_part_and_keep_away_from_walls(two_rooms):
    grid = TraversableGrid.from_mesh(two_rooms, 0.0)
    positions = candidate_positions(grid, spacing_m=0.5)
    assert all(grid.is_navigable(position) for position in positions)
    cells = grid.frame.centers_of(np.argwhere(grid.component == 1))
    gaps = np.linalg.norm(cells[:, None] - positions[None], axis=2).min(axis=1)
    assert gaps.max() < 0.5 * np.sqrt(2.0)
    assert 80 <= len(positions) <= 190


def test_a_large_floor_gets_no_more_positions_than_asked_for(two_rooms):
    grid = TraversableGrid.from_mesh(two_rooms, 0.0)
    assert 10 <= len(candidate_positions(grid, max_positions=30)) <= 60


def test_bad_arguments_are_refused(two_rooms):
    grid = TraversableGrid.from_mesh(two_rooms, 0.0)
    with pytest.raises(ValueError, match="`component` must be the label"):
        candidate_positions(grid, component=9)
    with pytest.raises(ValueError, match="at least one position"):
        table_of(two_rooms, np.zeros((0, 2)))
    with pytest.raises(ValueError, match="`spacing_m` must be > 0, got 0"):
        ViewTableSettings(spacing_m=0.0)
