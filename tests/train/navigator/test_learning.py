"""Both stages learn: imitation on a replay, PPO with the library's training loop."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import torch
from sb3_contrib.common.recurrent.type_aliases import RNNStates
from stable_baselines3.common.vec_env import VecMonitor

from agents.navigator_net import NavigatorNet, NavigatorNetSettings
from train.navigator.dagger import Dagger, DaggerSettings, Replay
from train.navigator.env import DomainSettings, NavigationVecEnv
from train.navigator.ppo import NavigatorPpo, PpoSettings
from train.navigator.presets import PRESETS

Navigation = Callable[..., NavigationVecEnv]
TINY_PPO = PpoSettings(frames=256, rollout_steps=32, minibatches=2, value_frames=0)


def make_ppo(
    env: NavigationVecEnv, net: NavigatorNetSettings, settings: PpoSettings = TINY_PPO
) -> NavigatorPpo:
    return NavigatorPpo(VecMonitor(env), net, settings, device="cpu")


def test_imitation_comes_to_agree_with_the_teacher(
    navigation: Navigation, tiny_net: NavigatorNetSettings
) -> None:
    torch.manual_seed(0)
    settings = DaggerSettings(frames=640, teacher_frames=10**9, segments=4, learning_rate=5e-3)
    env = navigation(2, forward_step_m=(0.25,))
    rounds = list(Dagger(NavigatorNet(replace(tiny_net, lstm_size=32)), env, settings).rounds())
    assert rounds[-1].frames == 640
    assert np.mean([one.agreement for one in rounds[-3:]]) > np.mean([one.agreement for one in rounds[:2]])
    assert rounds[-1].loss < 0.9 * rounds[0].loss


def test_student_never_stops_too_early_while_it_is_taught(
    navigation: Navigation, tiny_net: NavigatorNetSettings
) -> None:
    dagger = Dagger(NavigatorNet(tiny_net), navigation(2), DaggerSettings(teacher_frames=0))
    mixed = dagger._mix(np.array([0, 0, 1, 2]), np.array([1, 0, 2, 2]))
    assert mixed.tolist() == [1, 0, 1, 2]


def test_replay_hands_out_neighbouring_steps_of_one_agent(rng: np.random.Generator) -> None:
    state = (torch.zeros(1, 3, 2), torch.zeros(1, 3, 2))
    replay = Replay(8, {"goal": np.zeros((3, 2), np.float32)}, state)
    for step in range(20):
        goal = np.stack([np.full(3, step), np.arange(3)], axis=1).astype(np.float32)
        replay.add({"goal": goal}, np.full(3, step % 4), np.zeros(3, bool), state)
    observation, labels, (hidden, _), starts = replay.sample(5, 4, rng)
    goals = observation["goal"].reshape(5, 4, 2)
    assert (goals[:, :, 0].diff(dim=1) == 1).all()
    assert goals[:, :, 0].min() >= 12
    assert (goals[:, :, 1] == goals[:, :1, 1]).all()
    assert torch.equal(labels, (observation["goal"][:, 0] % 4).long())
    assert hidden.shape == (1, 5, 2)
    assert starts.shape == (20,)


def test_reinforcement_runs_through_the_librarys_loop(
    navigation: Navigation, tiny_net: NavigatorNetSettings
) -> None:
    model = make_ppo(navigation(4), tiny_net)
    before = {name: values.clone() for name, values in model.policy.state_dict().items()}
    model.learn(256)
    assert model.num_timesteps == 256
    assert any(not torch.equal(values, before[name]) for name, values in model.policy.state_dict().items())


def test_learning_rate_falls_and_the_last_update_still_learns(
    navigation: Navigation, tiny_net: NavigatorNetSettings
) -> None:
    model = make_ppo(navigation(4), tiny_net)
    rates: list[float] = []
    model.policy.optimizer.register_step_pre_hook(
        lambda optimizer, *_: rates.append(optimizer.param_groups[0]["lr"])
    )
    model.learn(300)  # rollouts of 128 frames: at 0, 128 and 256
    assert list(dict.fromkeys(rates)) == pytest.approx(
        [TINY_PPO.learning_rate * (1.0 - frames / 300) for frames in (0, 128, 256)]
    )


def test_only_the_critic_learns_at_first(navigation: Navigation, tiny_net: NavigatorNetSettings) -> None:
    model = make_ppo(navigation(4), tiny_net)
    model.policy.learn_values_only(True)
    before = {name: values.clone() for name, values in model.policy.state_dict().items()}
    model.learn(256)
    changed = {
        name for name, values in model.policy.state_dict().items() if not torch.equal(values, before[name])
    }
    assert changed == {"value_net.weight", "value_net.bias"}


def test_policy_and_plain_network_are_the_same(
    navigation: Navigation, tiny_net: NavigatorNetSettings
) -> None:
    env = navigation(2)
    policy, net = make_ppo(env, tiny_net).policy, NavigatorNet(tiny_net)
    policy.load_net(net)
    observation = {key: torch.from_numpy(values) for key, values in env.reset().items()}
    state, starts = net.first_state(2), torch.ones(2)
    outputs, _ = net.step(observation, state, starts)
    torch.testing.assert_close(policy.predict_values(observation, state, starts).flatten(), outputs.values)
    copied, _ = policy.as_net().step(observation, state, starts)
    torch.testing.assert_close(copied.logits, outputs.logits)


def test_critics_gradient_goes_through_the_lstm(
    navigation: Navigation, tiny_net: NavigatorNetSettings
) -> None:
    env = navigation(2)
    policy = make_ppo(env, tiny_net).policy
    observation = {key: torch.from_numpy(values) for key, values in env.reset().items()}
    state = (torch.zeros(1, 2, 8), torch.zeros(1, 2, 8))
    values, *_ = policy.evaluate_actions(observation, torch.zeros(2), RNNStates(state, state), torch.zeros(2))
    values.sum().backward()
    assert policy.lstm_actor.weight_hh_l0.grad is not None
    assert policy.lstm_actor.weight_ih_l0.grad.abs().sum() > 0


def test_sequences_give_the_probabilities_of_the_rollout(
    navigation: Navigation, tiny_net: NavigatorNetSettings
) -> None:
    """What was collected frame by frame is judged alike in whole sequences: no padding, no lost state."""
    model = make_ppo(navigation(4, max_steps=7), tiny_net)
    model.learn(128)
    model.policy.set_training_mode(False)
    _, callback = model._setup_learn(128)
    model.collect_rollouts(model.env, callback, model.rollout_buffer, 32)
    for samples in model.rollout_buffer.get():
        assert len(samples.returns) == 2 * 32
        values, log_probs, _ = model.policy.evaluate_actions(
            samples.observations,
            samples.actions.long().flatten(),
            samples.lstm_states,
            samples.episode_starts,
        )
        torch.testing.assert_close(log_probs, samples.old_log_prob, atol=1e-5, rtol=1e-4)
        torch.testing.assert_close(values.flatten(), samples.old_values, atol=1e-5, rtol=1e-4)


def test_normalised_advantages_have_mean_0_and_variance_1(
    navigation: Navigation, tiny_net: NavigatorNetSettings
) -> None:
    model = make_ppo(navigation(2), tiny_net, replace(TINY_PPO, normalises_advantages=True))
    model.learn(64)
    assert model.rollout_buffer.advantages.mean() == pytest.approx(0.0, abs=1e-5)
    assert model.rollout_buffer.advantages.std() == pytest.approx(1.0, abs=1e-3)


def test_groups_must_divide_the_agents(navigation: Navigation, tiny_net: NavigatorNetSettings) -> None:
    with pytest.raises(ValueError, match="`num_minibatches` must divide the 3 environments, got 2"):
        make_ppo(navigation(3), tiny_net)


def test_full_network_learns_too() -> None:
    training = PRESETS["full"]
    env = NavigationVecEnv(training.net, DomainSettings(tiers={"studio": 1.0}), 2)
    settings = replace(training.reinforcement, frames=4, rollout_steps=2, minibatches=1)
    model = make_ppo(env, training.net, settings)
    before = model.policy.action_net.weight.clone()
    model.learn(8)
    assert not torch.equal(model.policy.action_net.weight, before)
