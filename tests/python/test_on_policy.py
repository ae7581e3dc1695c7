"""on-policy's ShareVecEnv: shapes, shared memory, ends of episodes and counts, compared with the pool."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import smaclite_pool as sp
from numpy.typing import NDArray
from smaclite_pool.marl.on_policy import ShareVecEnv

from conftest import Serve, changed_scenario


def legal(available: NDArray[np.bool_], rng: np.random.Generator) -> list[list[int]]:
    return [[int(rng.choice(np.flatnonzero(mask))) for mask in env] for env in available]


def test_a_number_that_is_no_action_is_named() -> None:
    adapted = ShareVecEnv("3m", 2, seed=1)
    adapted.reset()
    with pytest.raises(sp.errors.InvalidRequest, match=r"fit into int32, got 1e\+30"):
        adapted.step_async(np.full((2, 3, 1), 1e30))
    adapted.close()


def test_steps_are_the_pools_and_shared_by_all_agents() -> None:
    adapted = ShareVecEnv("2s3z", 4, seed=2)
    envs = sp.make("2s3z", 4, seed=2, autoreset_mode="SameStep")
    obs, share_obs, available = adapted.reset()
    batch = envs.reset()
    assert obs.shape == (4, 5, 80) and share_obs.shape == (4, 5, 120) and available.shape == (4, 5, 11)
    sizes = (adapted.observation_space, adapted.share_observation_space, adapted.action_space[0].n)
    assert sizes == ([[80]] * 5, [[120]] * 5, 11) and len(adapted.action_space) == 5
    rng = np.random.default_rng(0)
    kept, games = [], np.zeros((4, 3), int)
    for _ in range(130):  # a first episode ends within 120 steps
        actions = legal(available, rng)
        given = np.array(actions)[..., None].astype(np.float32)
        obs, share_obs, rewards, dones, infos, available = adapted.step(given)
        batch = envs.step(actions)
        np.testing.assert_array_equal(obs, batch.obs)
        np.testing.assert_array_equal(available, batch.avail_actions)
        for agent in range(5):
            np.testing.assert_array_equal(share_obs[:, agent], batch.state)
            np.testing.assert_array_equal(rewards[:, agent, 0], batch.reward)
        ended = batch.terminated | batch.truncated
        np.testing.assert_array_equal(dones.all(axis=1), ended)
        np.testing.assert_array_equal(dones[~ended], ~batch.alive[~ended])
        games += np.stack((batch.battle_won, ended, batch.truncated), axis=1)
        for env in range(4):
            info = infos[env][4]
            counts = [info["battles_won"], info["battles_game"], info["battles_draw"]]
            assert counts == games[env].tolist() and info["restarts"] == 0
            assert (info["won"], info["bad_transition"]) == (batch.battle_won[env], batch.truncated[env])
        kept.append(rewards)  # on-policy's evaluation keeps the rewards of an episode
    assert games[:, 1].min() >= 1
    del obs, share_obs, available, batch
    adapted.close()
    adapted.close()
    envs.close()
    assert adapted.closed and np.sum(kept) > 0


@pytest.mark.parametrize("published", [False, True])
def test_a_time_out_is_a_bad_transition(published: bool, tmp_path: Path) -> None:
    """It never was one with SMACv2's published code."""
    scenario = changed_scenario(tmp_path, "3s_vs_5z", smacv2={"published": True}) if published else "3s_vs_5z"
    envs = ShareVecEnv(scenario, 2, episode_limit=2)
    envs.reset()
    stop = np.ones((2, 3, 1), np.int64)
    assert not envs.step(stop).infos[0][0]["bad_transition"]
    step = envs.step(stop)
    assert step.dones.all() and step.infos[1][2]["bad_transition"] and step.infos[0][0]["battles_draw"] == 1
    assert not envs.step(stop).dones.any()
    envs.close()


def test_wrong_actions_step_nothing() -> None:
    envs = ShareVecEnv("3s_vs_5z", 2)
    before = envs.reset().obs.copy()
    wrong = np.ones((2, 3, 1))
    wrong[1, 2] = 0
    with pytest.raises(sp.errors.IllegalAction) as caught:
        envs.step(wrong)
    assert (caught.value.env, caught.value.agent, caught.value.action) == (1, 2, 0)
    wrong[1, 2] = 1.5
    with pytest.raises(sp.errors.InvalidRequest, match="integers"):
        envs.step(wrong)
    # Once reshaped, so that agents got the actions of others.
    for shape in [(3, 2), (3, 2, 1), (6,), (2, 3, 1, 1), (2, 2), (1, 3)]:
        with pytest.raises(sp.errors.InvalidRequest, match=r"of shape \(2, 3, 1\) or \(2, 3\), got"):
            envs.step(np.ones(shape, np.int64))
    for number in (2**32 + 1, np.inf, np.nan):  # 1 in 32 bits
        with pytest.raises(sp.errors.InvalidRequest, match=r"int32|fractions"):
            envs.step(np.full((2, 3), number))
    with pytest.raises(TypeError, match="actions must be an integer array"):
        envs.step(np.full((2, 3), "stop"))
    np.testing.assert_array_equal(envs.reset().obs, before)
    envs.close()


def test_attaches_to_a_pool_that_resets_in_the_same_step(serve: Serve) -> None:
    serve("2s3z:2", "--autoreset-mode", "SameStep", "--name", "train")
    serve("2s3z:2", "--name", "other")
    attached, embedded = ShareVecEnv.connect("train"), ShareVecEnv("2s3z", 2)
    np.testing.assert_array_equal(attached.reset().share_obs, embedded.reset().share_obs)
    with pytest.raises(sp.errors.InvalidRequest, match="--autoreset-mode SameStep"):
        ShareVecEnv.connect("other")
    attached.close()
    embedded.close()


@pytest.mark.parametrize(
    ("options", "match"),
    [(["--sides", "both"], "sides"), (["--fields", "obs,state"], "`avail_actions`, `alive`")],
)
def test_a_pool_that_cannot_be_played_is_refused(serve: Serve, options: list[str], match: str) -> None:
    """It was attached to, and the first step or reset failed."""
    serve("2s3z:2", "--autoreset-mode", "SameStep", "--name", "train", *options)
    for _ in range(2):  # the lane is free again
        with pytest.raises(sp.errors.InvalidRequest, match=match):
            ShareVecEnv.connect("train", timeout=10)
