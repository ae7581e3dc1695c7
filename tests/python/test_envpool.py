"""The EnvPool-compatible API, used as in the examples of EnvPool."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp
from smaclite_pool.integrations import envpool

from conftest import Serve


def first_available(obs: dict[str, Any]) -> np.ndarray[Any, np.dtype[np.int32]]:
    """The last available action of each agent: an attack, if there is one."""
    mask = obs["action_mask"]
    from_the_end = mask[..., ::-1].argmax(-1).astype(np.int32)
    actions: np.ndarray[Any, np.dtype[np.int32]] = mask.shape[-1] - 1 - from_the_end
    return actions


def test_synchronous_stepping_is_that_of_the_pool() -> None:
    made = envpool.make("2s3z", env_type="gymnasium", num_envs=4, seed=3)
    with made as envs, sp.make("2s3z", 4, seed=3) as plain:
        obs, info = envs.reset()
        batch = plain.reset()
        assert not envs.is_async and len(envs) == envs.num_envs == 4
        assert info["env_id"].tolist() == envs.all_env_ids.tolist() == [0, 1, 2, 3]
        for _ in range(100):
            actions = first_available(obs)
            obs, reward, terminated, truncated, info = envs.step(actions, info["env_id"])
            batch = plain.step(actions)
            np.testing.assert_array_equal(obs["obs"], batch.obs)
            np.testing.assert_array_equal(obs["state"], batch.state)
            np.testing.assert_array_equal(obs["action_mask"], batch.avail_actions)
            np.testing.assert_array_equal(reward, batch.reward)
            np.testing.assert_array_equal(terminated, batch.terminated)
            np.testing.assert_array_equal(truncated, batch.truncated)
            np.testing.assert_array_equal(info["battle_won"], batch.battle_won)
            np.testing.assert_array_equal(info["elapsed_step"], batch.episode_length)
            assert info["env_id"].dtype == np.int32


def test_results_come_in_the_order_of_the_actions() -> None:
    """They came in the order of the environments, so that a learner took rows of others for its own."""
    ids = np.array([2, 0, 1])
    with envpool.make("2s3z", num_envs=3, seed=3) as envs, envpool.make("2s3z", num_envs=3, seed=3) as other:
        obs, _ = envs.reset()
        other.reset()
        for copy in (True, False):
            envs._copy = copy
            actions = first_available(obs)
            there = envs.step(actions[ids], ids)
            here = other.step(actions)
            for key, found in there[0].items():
                np.testing.assert_array_equal(found, here[0][key][ids])
            for found, expected in zip(there[1:4], here[1:4], strict=True):
                np.testing.assert_array_equal(found, expected[ids])
            assert there[4]["env_id"].tolist() == ids.tolist()
            obs = here[0]
        assert envs.reset()[1]["env_id"].tolist() == [0, 1, 2]
        assert envs.step(first_available(envs.reset()[0]))[4]["env_id"].tolist() == [0, 1, 2]


def test_asynchronous_stepping_serves_all_environments() -> None:
    with envpool.make_gymnasium("2s3z", num_envs=6, batch_size=2, num_threads=2) as envs:
        assert envs.is_async
        envs.async_reset()
        steps = np.zeros(6, int)
        while steps.min() < 20:
            obs, reward, _, _, info = envs.recv(timeout=60)
            assert obs["obs"].shape == (2, 5, 80) and reward.shape == (2,)
            steps[info["env_id"]] += 1
            envs.send(first_available(obs), info["env_id"])


def test_a_reset_of_some_returns_those_in_their_order() -> None:
    with envpool.make("2s3z", num_envs=4, autoreset_mode="Disabled") as envs:
        obs, _ = envs.reset(seed=1)
        for _ in range(5):
            obs, *_ = envs.step(first_available(obs))
        some, info = envs.reset(np.array([2, 0]), seed=7)
        assert info["env_id"].tolist() == [2, 0] and some["obs"].shape == (2, 5, 80)
        assert info["elapsed_step"].tolist() == [0, 0]
        _, info = envs.reset(options={"reset_mask": np.array([False, True, False, False])})
        assert info["env_id"].tolist() == [1]
        _, info = envs.reset(3)
        assert info["env_id"].tolist() == [3]
        for wrong in (
            {"env_id": np.zeros(0, int)},
            {"env_id": [1], "options": {"reset_mask": np.ones(4, bool)}},
        ):
            with pytest.raises(sp.errors.InvalidRequest):
                envs.reset(**wrong)


def test_a_mask_must_have_a_bool_for_every_environment() -> None:
    """Numbers were read as true, and a short mask as one of the first environments: others were reset."""
    with envpool.make("3m", num_envs=4) as envs:
        envs.reset()
        envs.step(np.ones((4, 3), np.int32))
        with pytest.raises(TypeError, match=r"options\['reset_mask'\] must be a bool array, got int64"):
            envs.reset(options={"reset_mask": np.array([1, 3])})
        for mask in ([True, False], [[True, False, False, True]], True):
            with pytest.raises(
                sp.errors.InvalidRequest, match=r"must be a bool array of shape \(4,\), got \("
            ):
                envs.reset(options={"reset_mask": mask})
        _, info = envs.reset(options={"reset_mask": [False, True, False, True]})
        assert info["env_id"].tolist() == [1, 3] and info["elapsed_step"].tolist() == [0, 0]


def test_arrays_are_copies_unless_copy_is_false() -> None:
    for copy in (True, False):
        with envpool.make("2s3z", num_envs=2, copy=copy) as envs:
            obs, info = envs.reset()
            _, reward, *_ = envs.step(first_available(obs))
            every = [*obs.values(), *info.values(), reward]
            assert {array.flags.writeable for array in every} == {copy}


def test_spec_and_config_say_what_is_served() -> None:
    settings: dict[str, Any] = {"num_envs": 3, "num_threads": 1, "seed": 5, "max_episode_steps": 20}
    with envpool.make("MMM2", **settings) as envs:
        assert envs.config.items() >= settings.items() and envs.config["batch_size"] == 3
        assert f"num_envs={3}" in repr(envs) and envs.spec.config == envs.config
        obs, info = envs.reset()
        sent = {f"obs:{name}": array for name, array in obs.items()}
        sent |= {f"info:{name}": array for name, array in info.items()}
        _, sent["reward"], sent["terminated"], sent["trunc"], _ = envs.step(first_available(obs))
        described = {
            name: (spec.dtype, (3, *spec.shape)) for name, spec in envs.spec.state_array_spec.items()
        }
        assert described == {name: (array.dtype, array.shape) for name, array in sent.items()}
        assert envs.spec.action_array_spec["action"].shape == (10,)
        for _ in range(19):
            obs, _, _, truncated, _ = envs.step(first_available(obs))
        assert truncated.any()


def test_spaces_are_of_one_environment() -> None:
    gymnasium = pytest.importorskip("gymnasium")
    spec = envpool.make_spec("2s3z")
    assert spec.action_space == gymnasium.spaces.MultiDiscrete([11] * 5)
    with envpool.make("2s3z", num_envs=2) as envs:
        obs, _ = envs.reset()
        space: Any = envs.observation_space
        assert space == spec.observation_space and {name: array[1] for name, array in obs.items()} in space
        assert envs.action_space == spec.action_space


def test_invalid_arguments_are_refused() -> None:
    assert envpool.list_all_envs() == sp.scenarios()
    mistakes: list[tuple[dict[str, Any], str]] = [
        ({"env_type": "dm"}, "dm"),
        ({"thread_affinity_offset": 0}, "pinning"),
        ({"num_envs": 2, "batch_size": 3}, "batch size .* got 3"),
        ({"num_threads": -1}, "num_threads must not be negative, got -1"),
        ({"max_episode_steps": 0}, "max_episode_steps must be at least 1, got 0"),
    ]
    for wrong, words in mistakes:
        with pytest.raises(sp.errors.PoolError, match=words):
            envpool.make("2s3z", **wrong)
    with envpool.make("2s3z", num_envs=2) as envs:
        envs.reset()
        with pytest.raises(sp.errors.IllegalAction):
            envs.step(np.full((2, 5), 6))


def test_a_connected_lane_has_the_same_api(serve: Serve) -> None:
    serve("2s3z:4", "--name", "names", "--batch-size", "2")
    with envpool.EnvPool(sp.connect("names")) as envs:
        envs.async_reset()
        assert envs.recv()[-1]["env_id"].shape == (2,)
        assert envs.config == {"num_envs": 4, "batch_size": 2}


def test_both_teams_have_arrays() -> None:
    with (
        envpool.make("5m_vs_6m", num_envs=3, seed=4, sides="both") as envs,
        sp.make("5m_vs_6m", 3, seed=4, sides="both") as pool,
    ):
        obs, info = envs.reset()
        batch = pool.reset()
        for _ in range(30):
            assert np.array_equal(obs["enemy_obs"], batch.enemy_obs)
            assert np.array_equal(obs["enemy_action_mask"], batch.enemy_avail_actions)
            seen = {key: rows[0].astype(np.int8) if "mask" in key else rows[0] for key, rows in obs.items()}
            assert envs.observation_space.contains(seen)
            actions = pool.sample_actions()
            assert all(envs.action_space.contains(row) for row in actions.astype(np.int64))
            obs, _, _, _, info = envs.step(actions)
            batch = pool.step(actions)
            assert np.array_equal(info["enemy_reward"], batch.enemy_reward)
            assert np.array_equal(info["enemy_alive"], batch.enemy_alive)
        assert envs.spec.action_array_spec["action"].shape == (11,)
        assert envs.spec.state_array_spec["obs:enemy_obs"].shape == (6, pool.spec.enemy_obs_size)
