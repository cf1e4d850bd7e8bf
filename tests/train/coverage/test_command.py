"""The explorer as a learner: what it leaves, that it goes on where it stopped, that it can learn."""

import json
import warnings
from dataclasses import replace

import numpy as np
import pytest
import torch
from stable_baselines3.common.env_checker import check_env

from anm_gym.wrappers.coverage_reward import CoverageWeights
from train.coverage.__main__ import main, read_options, train_explorer, training_of
from train.coverage.run import CoverageRun, load_explorer, score_baseline
from train.coverage.settings import (
    CoverageTraining,
    LearnerSettings,
    ViewSettings,
    expand_scenes,
    make_learner_env,
)

TINY = CoverageTraining(
    scenes=("home:studio:1-2",),
    eval_scenes=("home:studio:3-4",),
    steps=64,
    round_updates=2,
    episode_steps=8,
    scene_episodes=2,
    env={"camera": {"width_px": 16, "height_px": 16}, "forward_step_m": 0.25},
    view=ViewSettings(map_px=28),
    learner=LearnerSettings(num_envs=2, rollout_steps=8, batch_size=8, num_epochs=1),
)
"""Two rounds of two updates, a few seconds."""


@pytest.fixture(autouse=True)
def one_thread():
    """Repeat bit for bit."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """Give a finished run: its settings, what it returned, its weights."""
    training = replace(TINY, out=tmp_path_factory.mktemp("coverage"), baselines=("random",))
    result = train_explorer(training)
    return training, result, weights_of(training)


def weights_of(training) -> dict[str, torch.Tensor]:
    """Read the weights that a run has left."""
    return {name: value.clone() for name, value in CoverageRun(training).model.policy.state_dict().items()}


def is_equal(first, second) -> bool:
    return all(torch.equal(first[name], second[name]) for name in first)


def test_run_leaves_curve_figure_log_and_checkpoint(trained):
    training, result, _ = trained
    names = {path.name for path in training.out.iterdir()}
    assert names == {"settings.json", "run.lock", "checkpoint.safetensors", "log", "curve.json", "curve.png"}
    assert [point["steps"] for point in result["curve"]] == [0, 32, 64]
    assert json.loads((training.out / "curve.json").read_text())["curve"] == result["curve"]
    assert 0.0 < result["baselines_pct"]["random"] < 100.0


def test_log_has_the_usual_tags_and_the_coverage(trained):
    header = (trained[0].out / "log" / "progress_0.csv").read_text().splitlines()[0].split(",")
    assert {"rollout/ep_rew_mean", "rollout/ep_len_mean", "rollout/coverage", "eval/coverage"} <= set(header)
    assert {"train/approx_kl", "train/value_loss", "time/fps", "eval/mean_reward"} <= set(header)


def test_learning_changes_the_policy(trained, tmp_path):
    fresh = CoverageRun(replace(trained[0], out=tmp_path)).model.policy.state_dict()
    assert not is_equal(fresh, trained[2])


def test_interrupted_run_ends_with_the_same_weights(trained, tmp_path, monkeypatch):
    training, result, weights = trained
    again = replace(training, out=tmp_path)
    run = CoverageRun(again)
    learn, rounds = run.model.learn, []

    def learn_once(*arguments, **settings):
        rounds.append(1)
        if len(rounds) == 2:
            learn(16, reset_num_timesteps=False)
            raise KeyboardInterrupt
        return learn(*arguments, **settings)

    monkeypatch.setattr(run.model, "learn", learn_once)
    with pytest.raises(KeyboardInterrupt):
        run.train()
    curve = CoverageRun(again).train()
    assert [point["steps"] for point in curve] == [0, 32, 64]
    assert [round(100.0 * float(np.mean(point["coverages"])), 3) for point in curve] == [
        point["coverage_pct"] for point in result["curve"]
    ]
    assert is_equal(weights_of(again), weights)


def test_finished_run_can_be_prolonged_but_not_changed(trained, tmp_path):
    training = replace(TINY, out=tmp_path, steps=32)
    CoverageRun(training).train()
    assert is_equal_after_more(training, trained)
    with pytest.raises(ValueError, match="hold a run with the same settings, got another `seed` in"):
        CoverageRun(replace(training, seed=1))


def is_equal_after_more(training, trained) -> bool:
    longer = replace(training, steps=64)
    CoverageRun(longer).train()
    return is_equal(weights_of(longer), trained[2])


def test_explorer_can_be_loaded_and_played(trained):
    model, env = load_explorer(trained[0].out)
    assert is_equal(model.policy.state_dict(), trained[2])
    observation, _ = env.reset(seed=0)
    action, _ = model.predict(observation, deterministic=True)
    *_, info = env.step(action)
    assert info["coverage"] > 0.0


def test_memory_can_be_asked_for(tmp_path):
    learner = replace(TINY.learner, algorithm="recurrent_ppo")
    curve = CoverageRun(replace(TINY, out=tmp_path, steps=32, learner=learner)).train()
    assert [point["steps"] for point in curve] == [0, 32]


@pytest.mark.parametrize("depth_px", [0, 36])
def test_environment_is_fit_for_stable_baselines(depth_px):
    env = make_learner_env(replace(TINY, view=ViewSettings(map_px=48, depth_px=depth_px)), ["home:studio:1"])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env)


def test_baselines_start_where_the_learner_is_tested():
    first, second = (score_baseline(TINY, "random") for _ in range(2))
    assert first == second
    assert len(first) == 2


def test_command_reads_configuration_and_options(tmp_path, capsys):
    config = tmp_path / "coverage.yaml"
    config.write_text("steps: 1\nlearner: {num_epochs: 1}\nreward: {collision: 0.5}\nbaselines: []\n")
    arguments = [
        "--config",
        str(config),
        "--out",
        str(tmp_path / "run"),
        "--json",
        str(tmp_path / "new" / "curve.json"),
    ]
    small = ["--view.map_px", "28", "--env", '{"camera": {"width_px": 16, "height_px": 16}}']
    shape = [
        "--learner.num_envs",
        "1",
        "--learner.rollout_steps",
        "8",
        "--learner.batch_size",
        "4",
        "--round_updates",
        "1",
    ]
    where = ["--scenes", "home:studio:1", "--eval-scenes", '["home:studio:2"]', "--episode-steps", "8"]
    main([*arguments, *small, *shape, *where])
    settings = json.loads((tmp_path / "run" / "settings.json").read_text())
    assert (settings["scenes"], settings["eval_scenes"]) == (["home:studio:1"], ["home:studio:2"])
    assert (settings["reward"]["collision"], settings["learner"]["rollout_steps"]) == (0.5, 8)
    assert len(json.loads((tmp_path / "new" / "curve.json").read_text())["curve"]) == 2
    assert "floor seen (%)" in capsys.readouterr().out


def test_lists_may_be_a_text_with_commas():
    training = replace(TINY, scenes="home:studio:1-2,home:studio:5", baselines="")
    assert (training.scenes, training.baselines) == (("home:studio:1-2", "home:studio:5"), ())


def test_run_that_cannot_be_is_refused_before_its_folder_is_claimed(tmp_path):
    with pytest.raises(ValueError, match="unknown agent 'fbo'; choose one of"):
        replace(TINY, baselines=("fbo",))
    with pytest.raises(ValueError, match="`env` must hold arguments of anm_gym:ANM/Explore-v0"):
        CoverageRun(replace(TINY, out=tmp_path / "run", env={"camra": {"width_px": 16}}))
    assert not (tmp_path / "run").exists()


def test_settings_survive_json():
    training = replace(TINY, reward=CoverageWeights(known=0.5))
    plain = json.loads(json.dumps(training, default=lambda value: getattr(value, "__dict__", str(value))))
    again = CoverageTraining.from_plain(plain)
    assert (again.reward, again.view, again.learner, again.env) == (
        training.reward,
        training.view,
        training.learner,
        training.env,
    )


def test_quick_is_the_same_in_small_but_for_what_is_given():
    full, small = (training_of(read_options(words)) for words in ([], ["--quick"]))
    assert full == CoverageTraining()
    assert (small.num_rounds, small.view) == (2, full.view)
    assert small.out != full.out, "what it leaves is not taken for the full run's"
    given = training_of(read_options(["--quick", "--steps", "800", "--learner.num-envs", "2"]))
    assert (given.steps, given.learner) == (800, replace(small.learner, num_envs=2))


def test_ranges_of_homes_are_written_out():
    assert expand_scenes(["home:flat:8-10"]) == ["home:flat:8", "home:flat:9", "home:flat:10"]
    assert expand_scenes(["a-b.glb", "home:flat:7"]) == ["a-b.glb", "home:flat:7"]
    with pytest.raises(ValueError, match="a range of `scenes` must rise, got 'home:flat:3-2'"):
        expand_scenes(["home:flat:1", "home:flat:3-2"])
    with pytest.raises(ValueError, match="`scenes` must name at least one, got none"):
        expand_scenes([])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"eval_scenes": ("home:studio:2",)}, "`eval_scenes` must not be learned in, got home:studio:2"),
        ({"env": {"reward": "none"}}, "`env` must keep the reward of Explore, got 'none'"),
        ({"steps": 0}, "`steps` must be >= 1, got 0"),
    ],
)
def test_impossible_runs_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        replace(TINY, **change)


def test_run_that_cannot_begin_leaves_its_folder_alone(tmp_path):
    with pytest.raises(ValueError, match="`ego_map` must have edges of at least 28 pixels"):
        CoverageRun(replace(TINY, out=tmp_path, view=ViewSettings(map_px=20)))
    assert not list(tmp_path.iterdir())


def test_impossible_stages_are_refused():
    with pytest.raises(ValueError, match="`map_px` or `depth_px` must be > 0, got 0 and 0"):
        ViewSettings(map_px=0)
    for changes, message in (
        ({"num_envs": 0}, "`num_envs` must be >= 1, got 0"),
        ({"batch_size": 1}, "`batch_size` must be >= 2, got 1"),
        ({"algorithm": "a2c"}, "`algorithm` must be one of ppo, recurrent_ppo, got 'a2c'"),
        ({"learning_rate": 0.0}, "`learning_rate` must be > 0, got 0"),
        ({"discount": 1.1}, r"`discount` must be in \[0, 1\], got 1.1"),
    ):
        with pytest.raises(ValueError, match=message):
            LearnerSettings(**changes)
    with pytest.raises(
        ValueError, match="`batch_size` must divide `num_envs` times `rollout_steps`, got 3 of"
    ):
        LearnerSettings(batch_size=3)
