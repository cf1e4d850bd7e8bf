import numpy as np
import pytest

from agents.upen_paths import PathSettings, candidates, node_scores
from anm_gym.map.projection import OCCUPIED
from anm_gym.sim.grid_planning import PathTree

DIAGONAL = PathTree(np.array([[2.5, 2.5], [4.5, 4.5], [6.5, 6.5]]), np.array([0, 0, 1]))
"""A path of two edges, two cells down and two to the right each."""


def members_with(*cells: tuple[int, int]) -> np.ndarray:
    """Two members that contradict each other in some cells: a variance of 1/4 there, of 0 elsewhere."""
    members = np.zeros((2, 3, 10, 10), np.float32)
    members[:, 0] = 1.0
    for row, column in cells:
        members[0, :, row, column] = (0.0, 1.0, 0.0)
    assert OCCUPIED == 1
    return members


def test_score_is_the_sum_over_the_cells_of_the_path() -> None:
    scores = node_scores(DIAGONAL, members_with((3, 3), (4, 4), (6, 6), (6, 2)), PathSettings())
    assert scores == pytest.approx([0.0, 0.5, 0.75])


def test_fault_of_the_released_code_stays_on_the_first_column() -> None:
    members = members_with((3, 2), (4, 2), (5, 4), (6, 6), (3, 3))
    paper = node_scores(DIAGONAL, members, PathSettings(scoring="paper"))
    repo = node_scores(DIAGONAL, members, PathSettings(scoring="repo"))
    assert paper == pytest.approx([0.0, 0.25, 0.5])
    assert repo == pytest.approx([0.0, 0.5, 0.75])


def test_both_scorings_agree_on_a_path_along_a_column() -> None:
    tree = PathTree(np.array([[2.5, 2.5], [4.5, 2.5]]), np.array([0, 0]))
    members = members_with((3, 2), (4, 2), (3, 3))
    for scoring in ("paper", "repo"):
        assert node_scores(tree, members, PathSettings(scoring=scoring)) == pytest.approx([0.0, 0.5])


def test_path_along_a_row_has_no_cell_in_the_released_code() -> None:
    tree = PathTree(np.array([[2.5, 2.5], [2.5, 6.5]]), np.array([0, 0]))
    members = members_with((2, 2), (2, 3), (2, 4))
    assert node_scores(tree, members, PathSettings(scoring="repo"))[1] == 0.0
    assert node_scores(tree, members, PathSettings())[1] == pytest.approx(0.5)


def test_mean_does_not_favour_long_paths() -> None:
    members = members_with((3, 3), (4, 4))
    total = node_scores(DIAGONAL, members, PathSettings())
    mean = node_scores(DIAGONAL, members, PathSettings(is_mean=True))
    assert total[2] == total[1]
    assert mean[2] == pytest.approx(0.5 * mean[1])


def test_branches_do_not_share_their_doubt() -> None:
    nodes = np.array([[2.5, 2.5], [4.5, 2.5], [6.5, 2.5], [2.5, 4.5]])
    tree = PathTree(nodes, np.array([0, 0, 1, 0]))
    scores = node_scores(tree, members_with((4, 2), (2, 4)), PathSettings())
    assert scores == pytest.approx([0.0, 0.25, 0.25, 0.25])


def test_only_paths_of_the_asked_depth_are_candidates() -> None:
    chain = PathTree(np.tile(np.arange(13.0)[:, None], (1, 2)), np.maximum(np.arange(13) - 1, 0))
    assert candidates(chain, PathSettings()).tolist() == [10]
    assert candidates(chain, PathSettings(min_depth=11, max_depth=99)).tolist() == [11, 12]


def test_lone_start_has_a_score_of_nothing() -> None:
    alone = PathTree(np.array([[2.5, 2.5]]), np.array([0]))
    assert node_scores(alone, members_with((2, 2)), PathSettings()).tolist() == [0.0]
    assert len(candidates(alone, PathSettings())) == 0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"scoring": "right"}, "`scoring` must be one of paper, repo, got 'right'"),
        ({"min_depth": 11}, r"`min_depth` must be in \[1, max_depth\], got 11 of 10"),
    ],
)
def test_senseless_settings_are_refused(options: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        PathSettings(**options)  # type: ignore[arg-type]
