"""A network at work: its recurrent state belongs to each agent."""

import numpy as np
import torch

from agents.learned_policy import LearnedPolicy
from agents.navigation_observer import NavigationObserver
from agents.navigator_net import NavigatorNet, NavigatorNetSettings
from anm_gym.geometry import CameraSpec, camera_pose

COUNT = 4


def test_agents_that_are_kept_go_on_with_their_own_state(rng: np.random.Generator) -> None:
    torch.manual_seed(0)
    settings = NavigatorNetSettings()
    net, kept = NavigatorNet(settings).eval(), [3, 1]
    torch.nn.init.normal_(net.actor.weight, std=1.0)
    observer = NavigationObserver(COUNT, CameraSpec(16, 16), 1.25, 0.25, settings)
    poses = np.stack([camera_pose((agent, 1.25, 0.0), agent) for agent in range(COUNT)]).astype(np.float32)
    everyone, some = LearnedPolicy(net, COUNT), LearnedPolicy(net, COUNT)
    for index in range(4):
        depth = rng.uniform(0.5, 4.0, (COUNT, 16, 16)).astype(np.float32)
        goals = np.stack([rng.uniform(1.0, 5.0, COUNT), rng.uniform(-3.0, 3.0, COUNT)], axis=1)
        shown = observer.observe(depth, poses, goals.astype(np.float32))
        whole = everyone.log_probabilities(shown)
        if index < 2:
            some.log_probabilities(shown)
            continue
        if index == 2:
            some.keep(kept)
        part = some.log_probabilities({key: values[kept] for key, values in shown.items()})
        np.testing.assert_allclose(part, whole[kept], atol=1e-5)
        assert np.abs(whole[kept] - whole[:2]).max() > 1e-3, "agents differ"
