"""How many frames a core-second learns: our recurrent PPO against the library's, in one run.

Both learn on the same agents in the same homes, with DD-PPO's 128 steps and two epochs. The library's
has its own way with the same encoder: an LSTM each for actor and critic, a loop over frames, and
padding that goes through the encoder. Also printed: what two processes make of it.

    python -m benchmarks.navigator [--quick] [--json PATH]
"""

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import torch
from sb3_contrib import RecurrentPPO
from stable_baselines3.common.vec_env import VecMonitor

from agents.navigator_net import NavigatorNetSettings
from train.navigator.env import DomainSettings, NavigationVecEnv
from train.navigator.policy import NavigatorExtractor
from train.navigator.ppo import NavigatorPpo, PpoSettings
from train.navigator.ranks import Ranks

NUM_AGENTS: Final = 16
ROLLOUT_STEPS: Final = 128
FRAMES: Final = NUM_AGENTS * ROLLOUT_STEPS


def make_env(seed: int = 0) -> VecMonitor:
    """Agents in studios: homes are made quickly, so that learning is what is timed."""
    domain = DomainSettings(tiers={"studio": 1.0}, episodes_per_home=1000)
    return VecMonitor(NavigationVecEnv(NavigatorNetSettings(), domain, NUM_AGENTS, seed))


def ours(ranks: Ranks | None = None) -> NavigatorPpo:
    """Our recurrent PPO."""
    settings = PpoSettings(frames=10**9, minibatches=2, rollout_steps=ROLLOUT_STEPS, value_frames=0)
    env = make_env(ranks.rank if ranks else 0)
    return NavigatorPpo(env, NavigatorNetSettings(), settings, ranks, device="cpu")


def stock(**policy_kwargs: Any) -> RecurrentPPO:
    """The library's recurrent PPO with our encoder."""
    net = NavigatorNetSettings()
    return RecurrentPPO(
        "MultiInputLstmPolicy",
        make_env(),
        n_steps=ROLLOUT_STEPS,
        batch_size=FRAMES // 2,
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


VARIANTS: Final[dict[str, Callable[[], Any]]] = {
    "ours": ours,
    "library": stock,
    "library, shared LSTM": lambda: stock(shared_lstm=True, enable_critic_lstm=False),
}


def measure(make: Callable[[], Any], rollouts: int) -> dict[str, float]:
    """Collect and learn; CPU time is split between the two."""
    torch.manual_seed(0)
    model = make()
    model.learn(FRAMES)  # the first rollout makes the homes
    parts = {"collect_ms": 0.0, "learn_ms": 0.0}
    for name, method in (("collect_ms", "collect_rollouts"), ("learn_ms", "train")):
        setattr(model, method, _timed(getattr(model, method), parts, name))
    model.learn(rollouts * FRAMES, reset_num_timesteps=False)
    frames = rollouts * FRAMES
    return {name: value / frames for name, value in parts.items()} | {
        "frames_per_core_s": 1000.0 * frames / sum(parts.values())
    }


def _timed(method: Callable[..., Any], parts: dict[str, float], name: str) -> Callable[..., Any]:
    def run(*args: Any, **kwargs: Any) -> Any:
        began_s = time.process_time()
        result = method(*args, **kwargs)
        parts[name] += 1000.0 * (time.process_time() - began_s)
        return result

    return run


def weak_scaling(rollouts: int) -> dict[str, float]:
    """Frames per wall second of one process and of two, each with its own agents."""
    return {str(count): _frames_per_s(count, rollouts) for count in (1, 2)}


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
    model = ours(ranks)
    model.learn(ranks.world * FRAMES)
    began_s, before = time.monotonic(), model.num_timesteps
    model.learn(rollouts * ranks.world * FRAMES, reset_num_timesteps=False)
    if ranks.is_first:
        print((model.num_timesteps - before) / (time.monotonic() - began_s))
    ranks.leave()


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
    rollouts = 1 if options.quick else options.rollouts
    rows = {name: measure(make, rollouts) for name, make in VARIANTS.items()}
    for name, row in rows.items():
        ratio = rows["ours"]["frames_per_core_s"] / row["frames_per_core_s"]
        learning = row["learn_ms"] / rows["ours"]["learn_ms"]
        print(
            f"{name:22} {row['frames_per_core_s']:6.0f} frames per core-second (ours x {ratio:.2f}); "
            f"collect {row['collect_ms']:.2f} ms, learn {row['learn_ms']:.2f} ms (x {learning:.1f}) a frame"
        )
    scaling = {} if options.quick else weak_scaling(rollouts)
    for processes, rate in scaling.items():
        print(f"{processes} process(es): {rate:.0f} frames per second")
    if options.json is not None:
        options.json.write_text(json.dumps({"variants": rows, "scaling": scaling}, indent=2) + "\n")


if __name__ == "__main__":
    main()
