"""How many frames a core-second learns: our recurrent PPO against the library's, in one run.

Both learn in homes of the same kind, with DD-PPO's 128 steps and two epochs. The library's
has its own way with the same encoder: an LSTM each for actor and critic, a loop over frames, and
padding that goes through the encoder. As installed it steps one environment after the other; it is also
measured with our vector environment, which draws and observes for all at once. How much padding costs
depends on how long episodes are, so there are two kinds: those of an untrained policy, of which every
fourth action is STOP, and those of one that has learned not to. Also printed: what two processes make of it.

    python -m benchmarks.navigator [--quick] [--json PATH]
"""

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Final

import gymnasium
import numpy as np
import torch
from numpy.typing import NDArray
from sb3_contrib import RecurrentPPO
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor

from agents.navigator_net import NavigatorNetSettings
from anm_gym.actions import Action
from train.navigator.env import DomainSettings, NavigationVecEnv
from train.navigator.policy import NavigatorExtractor
from train.navigator.ppo import NavigatorPpo, PpoSettings
from train.navigator.ranks import Ranks
from train.results import write_json

NUM_AGENTS: Final = 16
ROLLOUT_STEPS: Final = 128
QUICK_ROLLOUT_STEPS: Final = 32
PROCESSES: Final = (1, 2)
"""Numbers of processes of `weak_scaling`."""
EPISODES: Final = {"short": 0.0, "long": 4.0}
"""How much less likely than the other actions STOP is made at first, as a difference of logits."""
DOMAIN: Final = DomainSettings(tiers={"studio": 1.0}, episodes_per_home=1000)
"""Agents stay in studios, which are made quickly, so that learning is what is timed."""


def make_together(seed: int = 0) -> VecMonitor:
    """All agents in our vector environment."""
    return VecMonitor(NavigationVecEnv(NavigatorNetSettings(), DOMAIN, NUM_AGENTS, seed))


def make_one_by_one() -> VecMonitor:
    """As many agents as environments of their own, stepped in turn as the library does by default."""
    return VecMonitor(DummyVecEnv([partial(LoneAgent, index) for index in range(NUM_AGENTS)]))


class LoneAgent(gymnasium.Env[dict[str, NDArray[Any]], np.int64]):
    """One agent as an environment of its own.

    Args:
        index: Which of the agents it is; they differ in their steps and cameras.
    """

    def __init__(self, index: int) -> None:
        steps_m, heights_m = DOMAIN.forward_step_m, DOMAIN.sensor_height_m
        domain = replace(
            DOMAIN,
            forward_step_m=(steps_m[index % len(steps_m)],),
            sensor_height_m=(heights_m[index // len(steps_m) % len(heights_m)],),
        )
        self._agent = NavigationVecEnv(NavigatorNetSettings(), domain, 1, index)
        self.observation_space, self.action_space = self._agent.observation_space, self._agent.action_space
        self._next: dict[str, NDArray[Any]] | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """Begin an episode; all but the first have begun when the one before ended."""
        super().reset(seed=seed, options=options)
        return self._next or _only(self._agent.reset()), {}

    def step(self, action: np.int64) -> tuple[dict[str, NDArray[Any]], float, bool, bool, dict[str, Any]]:
        """Take an action."""
        shown, rewards, dones, _ = self._agent.step(np.array([action]))
        self._next = _only(shown)
        return self._next, float(rewards[0]), bool(dones[0]), False, {}


def _only(batch: Any) -> dict[str, NDArray[Any]]:
    return {key: values[0] for key, values in batch.items()}


def ours(rollout_steps: int = ROLLOUT_STEPS, ranks: Ranks | None = None) -> NavigatorPpo:
    """Our recurrent PPO."""
    settings = PpoSettings(frames=10**9, minibatches=2, rollout_steps=rollout_steps, value_frames=0)
    env = make_together(ranks.rank if ranks else 0)
    return NavigatorPpo(env, NavigatorNetSettings(), settings, ranks, device="cpu")


def stock(rollout_steps: int, env: VecMonitor, **policy_kwargs: Any) -> RecurrentPPO:
    """The library's recurrent PPO with our encoder."""
    net = NavigatorNetSettings()
    return RecurrentPPO(
        "MultiInputLstmPolicy",
        env,
        n_steps=rollout_steps,
        batch_size=NUM_AGENTS * rollout_steps // 2,
        n_epochs=2,
        device="cpu",
        policy_kwargs={
            "features_extractor_class": NavigatorExtractor,
            "features_extractor_kwargs": {"net": net},
            "normalize_images": False,
            "lstm_hidden_size": net.lstm_size,
            "net_arch": [],
            **policy_kwargs,
        },
    )


VARIANTS: Final[dict[str, Callable[[int], Any]]] = {
    "ours": ours,
    "library": lambda steps: stock(steps, make_one_by_one()),
    "library, our agents": lambda steps: stock(steps, make_together()),
    "the same, shared LSTM": lambda steps: stock(
        steps, make_together(), shared_lstm=True, enable_critic_lstm=False
    ),
}


def measure(variant: str, episodes: str, rollouts: int, rollout_steps: int = ROLLOUT_STEPS) -> dict[str, Any]:
    """Collect and learn; CPU time is split between the two."""
    torch.manual_seed(0)
    model, frames = VARIANTS[variant](rollout_steps), NUM_AGENTS * rollout_steps
    with torch.no_grad():
        model.policy.action_net.bias[Action.STOP] -= EPISODES[episodes]
    model.learn(frames)  # the first rollout makes the homes
    parts = {"collect_ms": 0.0, "learn_ms": 0.0}
    for name, method in (("collect_ms", "collect_rollouts"), ("learn_ms", "train")):
        setattr(model, method, _timed(getattr(model, method), parts, name))
    model.learn(rollouts * frames, reset_num_timesteps=False)
    per_frame = {name: value / (rollouts * frames) for name, value in parts.items()}
    rate = 1000.0 / sum(per_frame.values())
    return {"variant": variant, "episodes": episodes, **per_frame, "frames_per_core_s": rate}


def _timed(method: Callable[..., Any], parts: dict[str, float], name: str) -> Callable[..., Any]:
    def run(*args: Any, **kwargs: Any) -> Any:
        began_s = time.process_time()
        result = method(*args, **kwargs)
        parts[name] += 1000.0 * (time.process_time() - began_s)
        return result

    return run


def weak_scaling(rollouts: int) -> dict[str, float]:
    """Frames per wall second of one process and of two, each with its own agents."""
    return {str(count): _frames_per_s(count, rollouts) for count in PROCESSES}


def _frames_per_s(processes: int, rollouts: int) -> float:
    command = [sys.executable, "-m", "torch.distributed.run", "--standalone", f"--nproc-per-node={processes}"]
    command += [str(Path(__file__).resolve()), "--rank-of-scaling", str(rollouts)]
    environment = {
        **os.environ,
        "OMP_NUM_THREADS": "1",
        "PYTHONPATH": str(Path(__file__).resolve().parents[1]),
    }
    finished = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return float(finished.stdout.split()[-1])


def run_rank(rollouts: int) -> None:
    """One of the processes of `weak_scaling`; the first prints."""
    ranks = Ranks.join()
    model, frames = ours(ranks=ranks), ranks.world * NUM_AGENTS * ROLLOUT_STEPS
    model.learn(frames)
    began_s, before = time.monotonic(), model.num_timesteps
    model.learn(rollouts * frames, reset_num_timesteps=False)
    if ranks.is_first:
        print((model.num_timesteps - before) / (time.monotonic() - began_s))
    ranks.leave()


def compare(first: dict[str, Any], row: dict[str, Any]) -> str:
    """One line of the table: a row, and how many times more the first one makes of its time."""
    whole = first["frames_per_core_s"] / row["frames_per_core_s"]
    return (
        f"{row['variant']:21}  {row['episodes']:5} episodes: {row['frames_per_core_s']:5.0f} frames per "
        f"core-second (ours x {whole:.2f}); a frame takes {row['collect_ms']:.2f} ms to collect and "
        f"{row['learn_ms']:.2f} ms to learn (x {row['learn_ms'] / first['learn_ms']:.1f})"
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.navigator", description=__doc__.splitlines()[0]
    )
    parser.add_argument("--quick", action="store_true", help="one rollout each, no second process")
    parser.add_argument("--rollouts", type=int, default=3, help="rollouts that are timed")
    parser.add_argument("--json", type=Path, default=None, help="write the numbers to this file")
    parser.add_argument("--rank-of-scaling", type=int, default=None, help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    torch.set_num_threads(1)
    if options.rank_of_scaling is not None:
        run_rank(options.rank_of_scaling)
        return
    rollouts, steps = (1, QUICK_ROLLOUT_STEPS) if options.quick else (options.rollouts, ROLLOUT_STEPS)
    rows = []
    for episodes in EPISODES:
        rows += [measure(variant, episodes, rollouts, steps) for variant in VARIANTS]
        for row in rows[-len(VARIANTS) :]:
            print(compare(rows[-len(VARIANTS)], row))
    scaling: dict[str, float | None] = dict.fromkeys(map(str, PROCESSES))
    if not options.quick:
        scaling |= weak_scaling(rollouts)
        for processes, rate in scaling.items():
            print(f"{processes} process(es): {rate:.0f} frames per second")
    if options.json is not None:
        write_json(options.json, {"rows": rows, "frames_per_s": scaling})


if __name__ == "__main__":
    main()
