"""One step of what a run would do, before it claims its folder: settings that cannot work claim none."""

from contextlib import closing
from dataclasses import replace
from typing import Any

import torch
from stable_baselines3.common.utils import obs_as_tensor

from agents.navigator_net import NavigatorNet
from train.navigator.env import NavigationVecEnv
from train.navigator.hardware import Hardware
from train.navigator.presets import NavigatorTraining


def try_out(training: NavigatorTraining, hardware: Hardware) -> None:
    """Look once with every camera and every step that a run has, and show it to the network.

    Args:
        training: What a run would do.
        hardware: Where it computes.

    Raises:
        ValueError: If a camera or a step does not fit the homes that are tried, or the network the images.
        BackendError: If what draws depth is missing.
    """
    studios = replace(training.domain, tiers={"studio": 1.0})  # the homes that are made quickest
    bodies = len(studios.forward_step_m) * len(studios.sensor_height_m)
    env = NavigationVecEnv(training.net, studios, min(bodies, training.num_agents), training.seed, hardware)
    with closing(env):
        shown: Any = env.reset()
    try:
        with torch.inference_mode():
            NavigatorNet(training.net).encoder(obs_as_tensor(shown, torch.device("cpu")))
    except RuntimeError as error:
        raise ValueError(
            f"`net` must be made for what agents see, got {error}; choose other sizes"
        ) from error
