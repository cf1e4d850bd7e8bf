"""What a user types, and how a command ends."""

import pytest

from anm_gym.errors import SceneError
from train.command import file_stem, parse_seeds, run_command, scene_label, split_list


@pytest.mark.parametrize(
    "text", ["random,fbe,anm", "random fbe anm", ["random", "fbe,anm"], ["random,", "fbe, anm"]]
)
def test_list_may_be_spelled_with_commas_or_spaces(text):
    assert split_list(text) == ["random", "fbe", "anm"]


@pytest.mark.parametrize(
    ("text", "seeds"),
    [
        ("3", [0, 1, 2]),
        (3, [0, 1, 2]),
        (["2"], [0, 1]),
        ("4,7", [4, 7]),
        ([4, 7], [4, 7]),
        ("7,", [7]),
        ([7], [7]),
    ],
)
def test_one_number_is_a_count_and_several_are_seeds(text, seeds):
    assert parse_seeds(text) == seeds


@pytest.mark.parametrize("text", ["", "-1,2", "one", [], "0"])
def test_seeds_that_are_no_whole_numbers_are_refused(text):
    with pytest.raises(ValueError, match="`seeds` must be a count of at least 1 or whole numbers"):
        parse_seeds(text)


def test_scene_is_called_by_its_stem():
    assert scene_label("/data/scenes/flat.glb") == "flat"
    assert scene_label("home:flat:1") == "home:flat:1"


def test_stem_is_fit_for_a_file():
    assert file_stem("anm", "best", "home:flat:1", 3) == "anm_best_home-flat-1_3"
    assert file_stem("random", "", "../x y", 0) == "random_..-x-y_0"


def test_error_about_the_world_ends_as_one_line(capsys):
    def body():
        raise SceneError("`scene` must exist, got nothing")

    with pytest.raises(SystemExit) as exit_info:
        run_command(body)
    assert exit_info.value.code == 2
    assert capsys.readouterr().err == "error: `scene` must exist, got nothing\n"


def test_interruption_ends_without_a_traceback(capsys):
    def body():
        raise KeyboardInterrupt

    with pytest.raises(SystemExit) as exit_info:
        run_command(body)
    assert exit_info.value.code == 130
    assert "goes on from its last row" in capsys.readouterr().err


def test_paths_of_a_list_may_hold_spaces():
    assert split_list(["my house/a.glb", "b.glb,c.glb"]) == ["my house/a.glb", "b.glb", "c.glb"]
