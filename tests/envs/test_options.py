"""Options of an episode are checked before anything happens."""

import numpy as np
import pytest

from anm_gym.envs.options import EpisodeOptions, read_names

KNOWN = ("scene", "start", "goal")


@pytest.mark.parametrize("options", [None, {}])
def test_no_options_ask_for_nothing(options: dict[str, object] | None) -> None:
    read = EpisodeOptions.read(options, KNOWN)
    assert (read.scene, read.start, read.goal) == (None, None, None)


def test_numbers_are_read_as_float64() -> None:
    read = EpisodeOptions.read({"scene": "home:flat:1", "start": [1, 2, 3], "goal": (4, 5)}, KNOWN)
    assert read.scene == "home:flat:1"
    np.testing.assert_array_equal(read.start, [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(read.goal, [4.0, 5.0])


def test_misspelled_option_is_answered_with_the_nearest() -> None:
    with pytest.raises(ValueError, match="unknown reset option 'strat'; did you mean 'start'"):
        EpisodeOptions.read({"strat": (0, 0, 0)}, KNOWN)


def test_option_of_another_environment_is_answered_with_the_choices() -> None:
    with pytest.raises(ValueError, match="unknown reset option 'goal'; choose among: scene, start"):
        EpisodeOptions.read({"goal": (0, 0)}, ("scene", "start"))


@pytest.mark.parametrize("start", [(1.0, 2.0), (1.0, 2.0, float("nan")), "corner", 3.0, (1, 2, "north")])
def test_malformed_start_is_refused(start: object) -> None:
    with pytest.raises(ValueError, match=r"`start` must be finite numbers \(x, z, heading_rad\)"):
        EpisodeOptions.read({"start": start}, KNOWN)


def test_names_are_a_list_and_no_text() -> None:
    assert read_names("scenes", ("a", "b")) == ["a", "b"]
    with pytest.raises(TypeError, match=r"`scenes` must be a list of names, got 'ab'; write \['ab'\]"):
        read_names("scenes", "ab")
