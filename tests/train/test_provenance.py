"""Settings have one name: equal settings, equal hash; seeds and scenes are no settings."""

import dataclasses
import subprocess
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from agents.roster import build_agent
from anm_gym.mesh import TriangleMesh
from anm_gym.scenes.datasets import ROOT_VARIABLE
from train.episodes import make_env
from train.provenance import (
    check_scene_files,
    commit_of,
    digest,
    effective_settings,
    environment_digest,
    file_digest,
    geometry_digest,
    versions,
)
from train.tables.rosters import TABLES


@dataclasses.dataclass(frozen=True)
class Settings:
    rate: float = 0.1
    layers: tuple[int, ...] = (4, 4)


class BareEnv(gym.Env):
    observation_space = gym.spaces.Box(0, 1, (1,), np.float32)
    action_space = gym.spaces.Discrete(2)


class MapWrapper(gym.Wrapper, gym.utils.RecordConstructorArgs):
    def __init__(self, env, settings=None, seed=0, reach_m=1.0):
        gym.utils.RecordConstructorArgs.__init__(self, settings=settings, seed=seed, reach_m=reach_m)
        gym.Wrapper.__init__(self, env)
        self.settings = settings or Settings()


class Policy:
    pass


def test_settings_of_every_layer_are_collected():
    settings = effective_settings(MapWrapper(BareEnv(), reach_m=2.0), Policy())
    assert settings == {"MapWrapper": {"settings": {"rate": 0.1, "layers": [4, 4]}, "reach_m": 2.0}}


def test_default_settings_and_the_same_settings_spelled_out_are_equal():
    implicit, explicit = MapWrapper(BareEnv()), MapWrapper(BareEnv(), settings=Settings())
    assert digest(effective_settings(implicit, Policy())) == digest(effective_settings(explicit, Policy()))


@pytest.mark.parametrize("agent", TABLES["table1"].agents("fast"))
def test_budget_and_scene_are_no_settings_of_any_agent_of_the_table(agent):
    """A protocol gives large scenes more steps; its rows of an agent must still go into one line."""
    digests = set()
    for scene, steps in (("home:studio:1", 30), ("home:studio:2", 50)):
        built = build_agent(
            agent, make_env(scene, steps, {"camera": {"width_px": 32, "height_px": 32}}), seed=3
        )
        built.env.reset(seed=3)
        digests.add(digest(effective_settings(built.env, built.policy)))
        built.env.close()
    assert len(digests) == 1


def test_failed_episode_does_not_bind_its_scene_to_the_file_that_failed(tmp_path):
    scene = tmp_path / "flat.ply"
    scene.write_text("broken", encoding="utf-8")
    played = {"scene": "flat", "scene_file": file_digest(str(scene))}
    scene.write_text("mended", encoding="utf-8")
    check_scene_files([str(scene)], [played | {"error": "SceneError: broken"}], tmp_path / "rows.jsonl")
    with pytest.raises(ValueError, match=r"the rows of flat in .*rows\.jsonl must come from"):
        check_scene_files([str(scene)], [played], tmp_path / "rows.jsonl")


def test_scene_of_a_dataset_is_named_by_its_file(tmp_path, monkeypatch):
    monkeypatch.setenv(ROOT_VARIABLE, str(tmp_path))
    file = tmp_path / "gibson" / "Denmark.glb"
    file.parent.mkdir()
    file.write_text("one")
    first = file_digest("gibson:Denmark")
    assert first == file_digest(str(file))
    file.write_text("two")
    with pytest.raises(ValueError, match=r"the rows of gibson:Denmark in .* must come from"):
        check_scene_files(["gibson:Denmark"], [{"scene": "gibson:Denmark", "scene_file": first}], tmp_path)
    assert file_digest("home:flat:1") == ""
    monkeypatch.delenv(ROOT_VARIABLE)
    second = file_digest("gibson:Denmark", tmp_path)
    check_scene_files(
        ["gibson:Denmark"], [{"scene": "gibson:Denmark", "scene_file": second}], tmp_path, tmp_path
    )


def test_seed_is_no_setting():
    first, second = (effective_settings(MapWrapper(BareEnv(), seed=seed), Policy()) for seed in (0, 1))
    assert digest(first) == digest(second)


def test_any_changed_number_changes_the_hash():
    first, second = (
        effective_settings(MapWrapper(BareEnv(), Settings(rate)), Policy()) for rate in (0.1, 0.1000001)
    )
    assert digest(first) != digest(second)


def test_hash_does_not_depend_on_the_order_of_keys():
    assert digest({"a": 1, "b": (2.0, None)}) == digest({"b": [2.0, None], "a": 1})


def test_versions_name_what_makes_the_numbers():
    assert {"python", "numpy", "gymnasium", "torch"} <= set(versions())
    assert versions()["map_products"] in {"bfloat16", "float32"}


def test_real_environments_of_two_scenes_share_a_hash():
    hashes = set()
    for scene in ("home:studio:0", "home:studio:1"):
        env = gym.make("anm_gym:ANM/Explore-v0", scene=scene, camera={"width_px": 8, "height_px": 8})
        hashes.add(digest(effective_settings(env, Policy())))
        env.close()
    assert len(hashes) == 1
    other = gym.make("anm_gym:ANM/Explore-v0", scene="home:studio:0", turn_step_deg=20.0)
    assert digest(effective_settings(other, Policy())) not in hashes


def test_place_of_a_dataset_and_the_budget_are_no_settings():
    here, there = ({"scene_options": {"root": root, "storey": 1}} for root in ("/a", "/b"))
    assert digest(here) == digest(there)
    assert digest({"max_episode_steps": 10}) == digest({"max_episode_steps": 20})
    assert environment_digest({"scene_options": {"root": "/a"}}) == environment_digest({}) == ""
    assert environment_digest(here) == environment_digest({"scene_options": {"storey": 1}}) != ""


def test_geometry_has_one_name_whatever_the_last_bits_are(box_room):
    room = box_room(4.0, 3.0)
    rounded = TriangleMesh(np.nextafter(room.vertices, 9.0), room.faces)
    moved = TriangleMesh(room.vertices + np.array([0.0, 0.002, 0.0]), room.faces)
    assert geometry_digest(rounded) == geometry_digest(room)
    assert geometry_digest(moved) != geometry_digest(room)


def test_commit_is_marked_where_code_was_changed_and_not_where_results_were(tmp_path: Path) -> None:
    def git(*arguments: str) -> str:
        identity = ["-c", "user.name=a", "-c", "user.email=a@b"]
        command = ["git", "-C", str(tmp_path), *identity, *arguments]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()

    assert commit_of(tmp_path) == ""
    git("init", "-q")
    assert commit_of(tmp_path) == ""
    for folder in ("train", "results"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "file").write_text("before")
    git("add", "-A")
    git("commit", "-q", "-m", "all")
    head = git("rev-parse", "--short", "HEAD")
    assert commit_of(tmp_path) == head
    (tmp_path / "results" / "file").write_text("after")
    assert commit_of(tmp_path) == head
    git("commit", "-q", "-a", "-m", "rows")
    assert commit_of(tmp_path) == head, "rows that are committed change no code"
    (tmp_path / "train" / "another").write_text("new")
    assert commit_of(tmp_path) == head + "+", "nobody has committed this one"
    (tmp_path / "train" / "another").unlink()
    (tmp_path / "train" / "file").write_text("after")
    assert commit_of(tmp_path) == head + "+"


def test_values_of_other_libraries_have_names_of_their_own():
    for one, other in ((Path("a"), Path("b")), (np.float32(1.0), np.float32(2.0)), (np.ones(2), np.zeros(2))):
        assert digest({"value": one}) != digest({"value": other})
