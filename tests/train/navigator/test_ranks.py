"""Processes that learn together: equal weights, averaged gradients, preempted stragglers."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]

PRELUDE = """
import sys, time, json
from contextlib import suppress
from pathlib import Path
import numpy as np, torch
from stable_baselines3.common.vec_env import VecMonitor
from agents.ego_memory import EgoMemorySettings
from agents.navigator_net import NavigatorNet, NavigatorNetSettings
from train.navigator.dagger import Dagger, DaggerSettings
from train.navigator.env import DomainSettings, NavigationVecEnv
from train.navigator.ppo import NavigatorPpo, PpoSettings
from train.navigator.ranks import Ranks
torch.set_num_threads(1)
ranks, out = Ranks.join(), Path(sys.argv[1])
net = NavigatorNetSettings(image_px=48, lstm_size=8, memory=EgoMemorySettings(crop_cells=20, image_px=24))
def agents(count, seed):
    return NavigationVecEnv(net, DomainSettings(tiers={"studio": 1.0}), count, seed)
def leave(**results):
    (out / f"{ranks.rank}.json").write_text(json.dumps(results))
    ranks.leave()
    for path in Path("/proc/self/task").glob("*/comm"):
        with suppress(OSError):  # a thread that ends now
            assert "gloo" not in path.read_text(), "the group outlives `leave`, and may abort the end"
def weights(module):
    return [float(values.double().sum()) for values in module.parameters()]
"""


def run(script: str, folder: Path, processes: int) -> list[dict]:
    """Run a script on several processes and read what each of them left."""
    import json

    path = folder / "script.py"
    path.write_text(PRELUDE + script, encoding="utf-8")
    command = [sys.executable, "-m", "torch.distributed.run", "--standalone", f"--nproc-per-node={processes}"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    finished = subprocess.run(
        [*command, str(path), str(folder)],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=240,
    )
    assert finished.returncode == 0, finished.stderr[-3000:]
    return [json.loads((folder / f"{rank}.json").read_text()) for rank in range(processes)]


def test_two_processes_end_with_equal_weights_and_frames(tmp_path: Path) -> None:
    script = """
torch.manual_seed(100 + ranks.rank)
student = NavigatorNet(net)
for step in Dagger(student, agents(2, ranks.rank), DaggerSettings(frames=256, segments=2), 0, ranks).rounds():
    pass
settings = PpoSettings(frames=256, rollout_steps=32, minibatches=1, value_frames=0)
model = NavigatorPpo(VecMonitor(agents(2, 5 + ranks.rank)), net, settings, ranks, device="cpu")
model.policy.load_net(student)
before = weights(model.policy)
model.learn(256)
leave(student=weights(student), before=before, policy=weights(model.policy), frames=model.num_timesteps)
"""
    first, second = run(script, tmp_path, 2)
    assert first == second
    assert first["policy"] != first["before"]
    assert first["frames"] >= 256


def test_two_processes_have_the_gradient_of_one_with_twice_the_agents(tmp_path: Path) -> None:
    script = """
torch.manual_seed(0)
student = NavigatorNet(net)
rng = np.random.default_rng(0)
frames = 4 * 6
observation = {
    "depth": rng.integers(0, 256, (frames, 1, 48, 48), dtype=np.uint8),
    "maps": rng.integers(0, 16, (frames, 2, 20, 20), dtype=np.uint8),
    "waves": rng.integers(0, 256, (frames, 2, 20, 20), dtype=np.uint8),
    "goal": rng.uniform(0, 3, (frames, 2)).astype(np.float32),
    "previous_action": rng.integers(0, 5, (frames, 1), dtype=np.uint8),
    "forward_step_m": np.full((frames, 1), 0.25, np.float32),
}
def gradient(agents):
    student.zero_grad()
    frames_of = np.concatenate([np.arange(6 * agent, 6 * agent + 6) for agent in agents])
    some = {key: torch.from_numpy(values[frames_of]) for key, values in observation.items()}
    outputs = student(some, student.first_state(len(agents)), torch.zeros(len(frames_of)))
    (outputs.values.square().mean() + outputs.logits.square().mean()).backward()
gradient([2 * ranks.rank, 2 * ranks.rank + 1])
ranks.average_gradients(student.parameters())
shared = torch.cat([values.grad.flatten() for values in student.parameters()])
gradient([0, 1, 2, 3])
alone = torch.cat([values.grad.flatten() for values in student.parameters()])
leave(error=float((shared - alone).abs().max()), size=float(alone.abs().max()))
"""
    for result in run(script, tmp_path, 2):
        assert result["size"] > 1e-3
        assert result["error"] < 1e-6 * max(result["size"], 1.0)


def test_process_that_sleeps_is_preempted(tmp_path: Path) -> None:
    """Two of three have finished; the third breaks its rollout off, and all count the same frames."""
    script = """
settings = PpoSettings(frames=1, rollout_steps=16, minibatches=1, value_frames=0)
env = agents(2, ranks.rank)
if ranks.rank == 2:
    step_wait = env.step_wait
    env.step_wait = lambda: (time.sleep(0.5), step_wait())[1]
model = NavigatorPpo(VecMonitor(env), net, settings, ranks, device="cpu")
model.learn(1)
leave(steps=model.rollout_buffer.buffer_size, frames=model.num_timesteps, policy=weights(model.policy))
"""
    results = run(script, tmp_path, 3)
    steps = [result["steps"] for result in results]
    assert steps[:2] == [16, 16]
    assert 4 <= steps[2] < 16
    assert {result["frames"] for result in results} == {2 * sum(steps)}
    assert results[0]["policy"] == results[1]["policy"] == results[2]["policy"]


@pytest.mark.parametrize("values", [[1.5, 2.0]])
def test_one_process_alone_needs_nobody(values: list[float]) -> None:
    from train.navigator.ranks import Ranks

    ranks = Ranks.join()
    assert (ranks.world, ranks.is_first) == (1, True)
    assert ranks.total(*values) == values
