"""A navigator's training run: imitation, then reinforcement, watched, saved and evaluated on the way."""

import time
from collections import deque
from collections.abc import Iterable
from contextlib import closing
from copy import deepcopy
from pathlib import Path
from typing import Any, Final, final

import numpy as np
import torch
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger, configure
from stable_baselines3.common.vec_env import VecMonitor
from tqdm import tqdm

from agents.navigator_net import NavigatorNet
from agents.policy_file import load_policy, save_policy
from train.navigator.dagger import Dagger
from train.navigator.env import NavigationVecEnv
from train.navigator.episodes import episodes_of, play_learned
from train.navigator.hardware import Hardware
from train.navigator.policy import NavigatorPolicy
from train.navigator.ppo import NavigatorPpo
from train.navigator.presets import NavigatorTraining
from train.navigator.ranks import Ranks
from train.navigator.trial import try_out
from train.provenance import versions
from train.results import write_json
from train.run_folder import claim_folder
from train.training_checkpoint import Progress, TrainingCheckpoint

IMITATION: Final = "imitation"
REINFORCEMENT: Final = "reinforcement"
DONE: Final = "done"
WEIGHTS_FILE: Final = "policy.safetensors"
SAVE_S: Final = 60.0
"""Time between two checkpoints, seconds."""
EVALUATION_STEPS_M: Final = (0.065, 0.25)
"""Steps of the evaluations on the way, metres."""
EVALUATION_HOMES: Final = tuple(
    f"home:{tier}:{seed}" for seed in (900, 901, 902) for tier in ("flat", "house")
)
"""Homes of the evaluations on the way; never trained on, and not those of the final one."""
WINDOW: Final = 100
"""Episodes that the logged means are taken over, as the library does it."""


@final
class NavigatorRun:
    """Train a navigator in a folder; started again, it goes on where it stopped.

    Args:
        training: What to do.
        folder: Where checkpoint, log and weights go.
        ranks: The processes that learn together.
        hardware: Where the run computes; another when it goes on is no other run.

    Raises:
        ValueError: If the folder holds a run with other settings, the settings do not work, or so many
            processes leave the actor nothing to learn.
    """

    def __init__(
        self,
        training: NavigatorTraining,
        folder: Path,
        ranks: Ranks | None = None,
        hardware: Hardware | None = None,
    ) -> None:
        self.training, self.folder = training, folder
        self.ranks, self.hardware = ranks or Ranks(), hardware or Hardware()
        training.require_taught_actor(self.ranks.world)
        try_out(training, self.hardware)
        claim_folder(folder, training.as_dict(), writes=self.ranks.is_first)
        self._checkpoint = TrainingCheckpoint(folder / "checkpoint.safetensors")
        self.progress = self._checkpoint.progress() or Progress(IMITATION)
        self._kept_stage = self.progress.stage if self._checkpoint.path.exists() else None
        self._saved_s, self._cpu_before_s = time.monotonic(), self.progress.cpu_s - time.process_time()

    def train(self) -> NavigatorNet:
        """Run both stages and write the weights, with a card beside them; a finished run is read.

        Returns:
            The trained network.
        """
        if self._kept_stage == DONE:
            return load_policy(self.folder / WEIGHTS_FILE)
        seed = self._stage_seed() + self.ranks.rank * self.training.num_agents
        torch.manual_seed(seed)
        net = NavigatorNet(self.training.net).to(self.hardware.device)
        env = NavigationVecEnv(
            self.training.net, self.training.domain, self.training.num_agents, seed, self.hardware
        )
        if self.progress.stage == IMITATION:
            with closing(self._logger()) as logger:
                self._imitate(net, env, logger)
                if not self.training.reinforcement.frames:
                    return self._finish(net, logger)
            self.progress.stage, self.progress.frames = REINFORCEMENT, 0
        with closing(self._logger()) as logger:
            return self._finish(self._reinforce(net, env, logger), logger)

    def _stage_seed(self) -> int:
        """Seed of the stage from here on: one that goes on does not draw again what it has drawn."""
        stage = (IMITATION, REINFORCEMENT).index(self.progress.stage)
        entropy = np.random.SeedSequence([self.training.seed, stage, self.progress.frames])
        return int(entropy.generate_state(1)[0]) // 2

    def _imitate(self, net: NavigatorNet, env: NavigationVecEnv, logger: Logger) -> None:
        dagger = Dagger(net, env, self.training.imitation, self._stage_seed(), self.ranks)
        if self._kept_stage == IMITATION:
            self._checkpoint.restore(net, dagger.optimizer)
            dagger.frames = self.progress.frames
        recent: deque[dict[str, Any]] = deque(maxlen=WINDOW)
        with self._bar(IMITATION, self.training.imitation.frames) as bar:
            for step in dagger.rounds():
                recent.extend(step.episodes)
                bar.update(step.frames - bar.n)
                bar.set_postfix(agreement=f"{step.agreement:.2f}", success=_mean(recent, "is_success"))
                logger.record("train/loss", step.loss)
                logger.record("train/agreement", step.agreement)
                logger.record("rollout/success_rate", _mean(recent, "is_success"))
                logger.record("rollout/spl", _mean(recent, "spl"))
                self.after_round(net, dagger.optimizer, step.frames, logger)

    def _reinforce(self, net: NavigatorNet, env: NavigationVecEnv, logger: Logger) -> NavigatorNet:
        settings = self.training.reinforcement
        monitored = VecMonitor(env, info_keywords=("is_success", "spl"))
        model = NavigatorPpo(
            monitored,
            self.training.net,
            settings,
            self.ranks,
            self._stage_seed(),
            device=self.hardware.device,
        )
        if self._kept_stage == REINFORCEMENT:
            self._checkpoint.restore(model.policy, model.policy.optimizer)
        else:
            model.policy.load_net(net)
            self.ranks.synchronise(model.policy)
        model.set_logger(logger)
        model.num_timesteps = self.progress.frames
        with self._bar(REINFORCEMENT, settings.frames) as bar:
            watch = _Watch(self, bar)
            left = max(settings.frames - self.progress.frames, 0)
            model.learn(left, callback=watch, reset_num_timesteps=False)
        self.progress.frames = model.num_timesteps
        return model.policy.as_net()

    def after_round(
        self,
        module: NavigatorNet | NavigatorPolicy,
        optimizer: torch.optim.Optimizer,
        frames: int,
        logger: Logger,
    ) -> None:
        """Evaluate and save when it is time; the first process does it for all."""
        before, self.progress.frames = self.progress.frames, frames
        if not self.ranks.is_first:
            return
        self.progress.cpu_s = self._cpu_before_s + time.process_time()
        every = self.training.evaluation_every
        is_due = before // every != frames // every
        if is_due:
            self._add_point(module if isinstance(module, NavigatorNet) else module.as_net(), logger)
        if is_due or self.progress.stage == IMITATION:
            self._dump(logger)
        if time.monotonic() - self._saved_s > SAVE_S:
            self._saved_s = time.monotonic()
            self._checkpoint.save(module, optimizer, self.progress)

    def evaluate(self, net: NavigatorNet) -> dict[str, float]:
        """Success and SPL on homes that were never trained on, actions drawn, on the CPU."""
        if self.hardware.device != "cpu":
            net = deepcopy(net).cpu()
        point: dict[str, float] = {}
        for step_m in EVALUATION_STEPS_M:
            episodes = episodes_of(EVALUATION_HOMES, self.training.evaluation_episodes, step_m)
            results = play_learned(net, episodes, deterministic=False)
            point[f"success_{step_m}"] = float(np.mean([result["is_success"] for result in results]))
            point[f"spl_{step_m}"] = float(np.mean([result["spl"] for result in results]))
        return point

    def _add_point(self, net: NavigatorNet, logger: Logger) -> None:
        """Evaluate, and note the point in curve and log."""
        point = self.evaluate(net)
        self.progress.curve.append({"stage": self.progress.stage, "frames": self.progress.frames, **point})
        for name, value in point.items():
            logger.record(f"eval/{name}", value)

    def _finish(self, net: NavigatorNet, logger: Logger) -> NavigatorNet:
        """Write what the run came to; the first process does it for all."""
        net = net.cpu()
        if not self.ranks.is_first:
            return net
        last = self.progress.curve[-1] if self.progress.curve else {}
        if (last.get("stage"), last.get("frames")) != (self.progress.stage, self.progress.frames):
            self._add_point(net, logger)
            self._dump(logger)
        self.progress.cpu_s = self._cpu_before_s + time.process_time()
        save_policy(net, self.folder / WEIGHTS_FILE)
        card = {
            "training": self.training.as_dict(),
            "processes": self.ranks.world,
            "hardware": self.hardware.as_dict(),
            "cpu_s": round(self.progress.cpu_s),
            "curve": self.progress.curve,
            "versions": versions(),
        }
        write_json(self.folder / "policy.json", card)
        self.progress.stage = DONE
        self._checkpoint.save(net, torch.optim.Adam(net.parameters()), self.progress)
        return net

    def _dump(self, logger: Logger) -> None:
        logger.record("time/total_timesteps", self.progress.frames, exclude="tensorboard")
        logger.dump(self.progress.frames)

    def _logger(self) -> Logger:
        if not self.ranks.is_first:
            return Logger(folder=None, output_formats=[])
        # A start that goes on writes a log of its own: the library's would replace the old one.
        folder = self.folder / "log" / f"{self.progress.stage}_{self.progress.frames}"
        return configure(str(folder), ["csv", *_tensorboard()])

    def _bar(self, stage: str, frames: int) -> "tqdm[Any]":
        return tqdm(
            total=frames,
            initial=self.progress.frames,
            unit="frame",
            desc=stage,
            disable=not self.ranks.is_first,
        )


class _Watch(BaseCallback):
    """Follow the library's learning: the critic's start, progress, evaluations, checkpoints."""

    def __init__(self, run: NavigatorRun, bar: "tqdm[Any]") -> None:
        super().__init__()
        self._run, self._bar = run, bar

    def _on_rollout_start(self) -> None:
        # The update of the last rollout is done here, so this is what a checkpoint should hold.
        run, frames = self._run, self.model.num_timesteps
        self._bar.update(frames - self._bar.n)
        assert isinstance(self.model, NavigatorPpo)
        run.after_round(self.model.policy, self.model.policy.optimizer, frames, self.model.logger)
        self.model.policy.learn_values_only(frames < run.training.reinforcement.value_frames)

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        self.logger.record("rollout/spl", _mean(self.model.ep_info_buffer or (), "spl"))

    def _on_training_end(self) -> None:
        self._bar.update(self.model.num_timesteps - self._bar.n)


def _tensorboard() -> list[str]:
    """TensorBoard's format where it is installed."""
    try:
        import tensorboard  # noqa: F401
    except ImportError:
        return []
    return ["tensorboard"]


def _mean(infos: Iterable[dict[str, Any]], key: str) -> float:
    values = [float(info[key]) for info in infos]
    return round(float(np.mean(values)), 3) if values else float("nan")
