"""An explorer's training run: rounds of updates, each followed by a test in unseen scenes and a checkpoint.

A round is a function of the checkpoint before it: every episode begins anew and all draws are seeded by
the round's number. So a run that was killed goes on from its last checkpoint to the same weights, bit
for bit, as one that was not.
"""

import time
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final, final

import gymnasium as gym
import numpy as np
from sb3_contrib import RecurrentPPO
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.logger import Logger, make_output_format
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.on_policy_algorithm import OnPolicyAlgorithm
from stable_baselines3.common.utils import set_random_seed
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv
from tqdm import tqdm

from agents.roster import build_agent
from agents.sb3 import RecurrentViewPolicy, ViewPolicy
from train.coverage.settings import CoverageTraining, expand_scenes, make_explore, make_learner_env
from train.run_folder import claim_folder, read_settings
from train.runner import run_episode
from train.training_checkpoint import Progress, TrainingCheckpoint

STAGE: Final = "coverage"
"""Name in the checkpoint."""
ALGORITHMS: Final[dict[str, tuple[type[OnPolicyAlgorithm], type[Any]]]] = {
    "ppo": (PPO, ViewPolicy),
    "recurrent_ppo": (RecurrentPPO, RecurrentViewPolicy),
}
"""Learners and their policies by the names of the settings."""
MAY_CHANGE: Final = frozenset({"out", "steps", "baselines"})
"""Settings that may be others when a run goes on."""
EVAL_TAGS: Final = {
    "eval/coverage": "coverages",
    "eval/mean_reward": "rewards",
    "eval/mean_ep_length": "lengths",
}
"""What is logged of a test."""
TEST_SEED: Final = 1000
"""Seeds the starts of the tests: the same for every round and every baseline."""

Point = dict[str, Any]


@final
class CoverageRun:
    """Train an explorer in a folder; started again, it goes on where it stopped.

    Args:
        training: What to do, and the folder.

    Raises:
        ValueError: If an argument of the environment does not exist, or the folder holds a run with other
            settings than those of `MAY_CHANGE`.
    """

    def __init__(self, training: CoverageTraining) -> None:
        self.training = training
        self._envs = _vectorise(training, expand_scenes(training.scenes), training.learner.num_envs)
        self._test_envs = _vectorise_apart(training, expand_scenes(training.eval_scenes))
        self.model = make_model(training, self._envs)
        plain = {**asdict(training), "out": str(training.out)}
        claim_folder(training.out, plain, may_change=MAY_CHANGE)
        self._checkpoint = TrainingCheckpoint(training.out / "checkpoint.safetensors")
        self.progress = self._checkpoint.progress() or Progress(STAGE)
        self._cpu_before_s = self.progress.cpu_s - time.process_time()
        if self.progress.frames:
            self._checkpoint.restore(self.model.policy, self.model.policy.optimizer)
            self.model.num_timesteps = self.progress.frames

    def train(self) -> list[Point]:
        """Run the rounds that are left.

        Returns:
            One point of the curve before learning and one after each round: `steps`, and the
            `coverages` (shares), `rewards` and `lengths` of the episodes of the test.
        """
        logger = self._logger()
        self.model.set_logger(logger)
        try:
            self._rounds()
        finally:
            logger.close()
            self._envs.close()
            self._test_envs.close()
        return self.progress.curve

    def _rounds(self) -> None:
        training = self.training
        if not self.progress.curve:
            self._test()
        done, total = self.progress.frames, training.num_rounds * training.round_steps
        with tqdm(total=total, initial=done, unit="step") as bar:
            for index in range(done // training.round_steps, training.num_rounds):
                self._learn(index, bar)
                point = self._test()
                bar.set_postfix_str(f"unseen {100.0 * np.mean(point['coverages']):.1f} %")

    def _learn(self, index: int, bar: "tqdm[Any]") -> None:
        """Do one round from fresh episodes."""
        self.model.set_env(self._envs, force_reset=True)
        self.model.set_random_seed(_seed_of_round(self.training.seed, index))
        watch = _Watch(bar)
        self.model.learn(self.training.round_steps, callback=watch, reset_num_timesteps=False)

    def _test(self) -> Point:
        """Play the episodes of the test, note the point and leave a checkpoint."""
        self.progress.frames = self.model.num_timesteps
        self.progress.cpu_s = self._cpu_before_s + time.process_time()
        point = {"steps": self.progress.frames, **score_policy(self.model, self._test_envs)}
        self.progress.curve.append(point)
        self._checkpoint.save(self.model.policy, self.model.policy.optimizer, self.progress)
        for tag, name in EVAL_TAGS.items():
            self.model.logger.record(tag, float(np.mean(point[name])))
        self.model.logger.dump(self.progress.frames)
        return point

    def _logger(self) -> Logger:
        """Log to a table of its own for each start, and to TensorBoard where it is installed."""
        folder = self.training.out / "log"
        folder.mkdir(exist_ok=True)
        names = ["csv"] + (["tensorboard"] if find_spec("tensorboard") else [])
        suffix = f"_{self.progress.frames}"
        return Logger(str(folder), [make_output_format(name, str(folder), suffix) for name in names])


def make_model(training: CoverageTraining, envs: VecEnv) -> OnPolicyAlgorithm:
    """Make an untrained learner."""
    learner = training.learner
    algorithm, policy = ALGORITHMS[learner.algorithm]
    settings: dict[str, Any] = {
        "n_steps": learner.rollout_steps,
        "batch_size": learner.batch_size,
        "n_epochs": learner.num_epochs,
        "learning_rate": learner.learning_rate,
        "gamma": learner.discount,
        "gae_lambda": learner.gae_lambda,
        "ent_coef": learner.entropy_weight,
    }
    return algorithm(policy, envs, seed=training.seed, device="cpu", **settings)


def load_explorer(folder: Path) -> tuple[OnPolicyAlgorithm, gym.Env]:
    """Read what a run has learned.

    Args:
        folder: The run's folder.

    Returns:
        The learner, whose `predict` chooses the moves, and an environment of the unseen scenes for it.

    Raises:
        FileNotFoundError: If the folder holds no run.
        PolicyError: If its checkpoint cannot be read.
    """
    training = CoverageTraining.from_plain(read_settings(folder))
    scenes = expand_scenes(training.eval_scenes)
    model = make_model(training, _vectorise(training, scenes, 1))
    TrainingCheckpoint(folder / "checkpoint.safetensors").restore(model.policy, model.policy.optimizer)
    return model, make_learner_env(training, scenes)


def score_policy(policy: Any, envs: VecEnv) -> Point:
    """Play one episode in each environment, actions drawn, from starts that are always the same."""
    coverages: list[float] = []

    def note(now: dict[str, Any], _global: dict[str, Any]) -> None:
        if now["done"]:
            coverages.append(now["info"]["coverage"])

    set_random_seed(TEST_SEED)
    envs.seed(TEST_SEED)
    rewards, lengths = evaluate_policy(
        policy, envs, envs.num_envs, deterministic=False, callback=note, return_episode_rewards=True
    )
    return {"coverages": coverages, "rewards": rewards, "lengths": lengths}


def score_baseline(training: CoverageTraining, name: str) -> list[float]:
    """Shares of the floor that an agent of the roster sees, from the starts of the test."""
    coverages = []
    for index, scene in enumerate(expand_scenes(training.eval_scenes)):
        agent = build_agent(name, make_explore(training, [scene]), seed=index)
        record = run_episode(agent.env, agent.policy, TEST_SEED + index)
        coverages.append(float(record.info["coverage"]))
        agent.env.close()
    return coverages


class _Watch(BaseCallback):
    """Move the bar, and log what the usual tags leave out."""

    def __init__(self, bar: "tqdm[Any]") -> None:
        super().__init__()
        self._bar = bar

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        self._bar.update(self.num_timesteps - self._bar.n)
        episodes = self.model.ep_info_buffer or ()
        if episodes:
            self.logger.record("rollout/coverage", float(np.mean([each["coverage"] for each in episodes])))


def _vectorise(training: CoverageTraining, scenes: Sequence[str], count: int) -> VecEnv:
    """Environments that draw their scenes."""
    return DummyVecEnv([partial(_monitored, training, scenes)] * count)


def _vectorise_apart(training: CoverageTraining, scenes: Sequence[str]) -> VecEnv:
    """One environment for each scene."""
    return DummyVecEnv([partial(_monitored, training, [scene]) for scene in scenes])


def _monitored(training: CoverageTraining, scenes: Sequence[str]) -> Monitor[Any, Any]:
    return Monitor(make_learner_env(training, scenes), info_keywords=("coverage",))


def _seed_of_round(seed: int, index: int) -> int:
    return int(np.random.SeedSequence([seed, index]).generate_state(1)[0] >> 1)
