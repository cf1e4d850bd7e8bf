"""The loop: budget, termination, what the recorder hears."""

import gymnasium as gym
import numpy as np

from train.runner import Recorder, run_episode


class CorridorEnv(gym.Env):
    """Ends at the fifth step forward; action 0 stops."""

    observation_space = gym.spaces.Box(0, 5, (1,), np.float32)
    action_space = gym.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.at = 0
        return np.zeros(1, np.float32), {"seed": seed}

    def step(self, action):
        self.at += action
        return np.full(1, self.at, np.float32), 0.5, action == 0 or self.at == 5, False, {"at": self.at}


class Listener(Recorder):
    def __init__(self):
        self.heard = []

    def start(self, env, observation, info):
        self.heard.append(("start", info["seed"]))

    def step(self, action, observation, info):
        self.heard.append((action, info["at"]))

    def scores(self):
        return {"heard": len(self.heard)}


class CountingPolicy:
    """Goes forward, and keeps as its state what it was told of episode starts."""

    def __init__(self, stop_at=99):
        self.stop_at = stop_at
        self.starts = []

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        self.starts.append(bool(episode_start[0]))
        state = (state or 0) + 1
        return np.array(0 if state == self.stop_at else 1), state


def test_episode_runs_to_its_end_and_is_summed_up():
    listener = Listener()
    record = run_episode(CorridorEnv(), CountingPolicy(), 7, listener)
    assert (record.seed, record.steps, record.total_reward, record.terminated) == (7, 5, 2.5, True)
    assert listener.heard == [("start", 7), (1, 1), (1, 2), (1, 3), (1, 4), (1, 5)]
    assert record.scores == {"heard": 6}


def test_policy_is_told_of_the_first_step_only():
    policy = CountingPolicy()
    run_episode(CorridorEnv(), policy, 0)
    assert policy.starts == [True, False, False, False, False]


def test_state_is_handed_back_to_the_policy():
    assert run_episode(CorridorEnv(), CountingPolicy(stop_at=3), 0).steps == 3


def test_budget_truncates():
    env = gym.wrappers.TimeLimit(CorridorEnv(), 2)
    record = run_episode(env, CountingPolicy(), 0)
    assert (record.steps, record.terminated) == (2, False)
