"""The policies that come with the package are what their cards say, and reach goals in unseen homes."""

import json

import pytest

from agents.navigator_net import NavigatorNetSettings
from agents.policy_file import load_policy
from agents.weights_file import WEIGHTS_FOLDER
from train.navigator.episodes import episodes_of, play_learned
from train.navigator.presets import PRESETS, VARIANTS

MAX_BYTES = 8_000_000
HOMES = [f"home:studio:{seed}" for seed in range(700, 704)]


@pytest.mark.parametrize("variant", ["plus", "star"])
def test_card_tells_how_the_policy_was_trained(variant: str) -> None:
    card = json.loads((WEIGHTS_FOLDER / f"ddppo-{variant}.json").read_text())
    training = card["training"]
    assert load_policy(f"ddppo-{variant}").settings == NavigatorNetSettings.read(training["net"])
    assert training["domain"]["tiers"] == VARIANTS[variant].tiers
    assert training["imitation"]["frames"] == PRESETS["mini"].imitation.frames
    points = [(point["stage"], point["frames"]) for point in card["curve"]]
    assert points == sorted(points), "imitation comes first, and frames rise"
    assert {stage for stage, _ in points} == {"imitation", "reinforcement"}
    assert training["reinforcement"]["frames"] - points[-1][1] < training["evaluation_every"]
    assert card["cpu_s"] > 0


def test_all_weights_together_are_small() -> None:
    assert sum(path.stat().st_size for path in WEIGHTS_FOLDER.glob("ddppo-*.safetensors")) < MAX_BYTES


@pytest.mark.parametrize("name", ["ddppo-plus", "ddppo-star"])
def test_goals_in_unseen_homes_are_reached(name: str) -> None:
    results = play_learned(load_policy(name), episodes_of(HOMES, 16, 0.25), deterministic=False)
    assert sum(result["is_success"] for result in results) >= 14
    assert sum(result["spl"] for result in results) / len(results) > 0.6
