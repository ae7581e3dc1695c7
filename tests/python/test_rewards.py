"""Reward options and the shares of single units, from Python; tests/battles/rewards.rs defines them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp
from smaclite_pool.integrations.gymnasium import make_vector
from smaclite_pool.integrations.pettingzoo import parallel_env
from smaclite_pool.marl.smac import StarCraft2Env

from conftest import recorded, replayed

DEFAULTS = {
    "reward_sparse": False,
    "reward_only_positive": True,
    "reward_death_value": 10.0,
    "reward_win": 200.0,
    "reward_defeat": 0.0,
    "reward_negative_scale": 0.5,
    "reward_scale": True,
    "reward_scale_rate": 20.0,
}
PUNISHED = {"reward_only_positive": False, "reward_defeat": -30, "reward_scale": False}


def test_every_scenario_has_the_default_rewards_until_it_is_told_others() -> None:
    for name in sp.scenarios():
        with sp.make(name, 1) as envs:
            assert envs.spec.rewards == DEFAULTS, name
    with sp.make("3m", 1, rewards=DEFAULTS) as envs:
        assert envs.spec.rewards == DEFAULTS
    with sp.make("3m", 1, rewards={"reward_win": 50}) as envs:
        assert envs.spec.rewards == {**DEFAULTS, "reward_win": 50.0}
        assert sp.status(envs.spec.pool)["lanes"][0]["description"]["rewards"]["reward_win"] == 50


def test_invalid_options_are_refused() -> None:
    with pytest.raises(sp.errors.ScenarioError, match="`rewards.reward_winn`; did you mean `reward_win`"):
        sp.make("3m", 1, rewards={"reward_winn": 1})


def test_scenarios_with_smacv2s_options_have_their_own() -> None:
    name = sp.scenarios(generated=True)[0]
    with pytest.raises(sp.errors.ScenarioError, match="`rewards` must be left out beside `smacv2`"):
        sp.make("3m", 1, rewards={"reward_win": 1}, smacv2={})
    options = {"reward_win": 77}
    for made in (sp.make(name, 1, smacv2=options), sp.make(name, 1, rewards=options)):
        with made as envs:
            assert envs.spec.rewards == {**DEFAULTS, "reward_win": 77}
    # Together they were refused, although the file has options of its own to which both are added.
    with sp.make(name, 1, rewards=options, smacv2={"reward_defeat": -5}) as envs:
        assert envs.spec.rewards == {**DEFAULTS, "reward_win": 77, "reward_defeat": -5}
    # SMAC's emulation refused them on these scenarios, by keys that it does not take.
    env = StarCraft2Env(map_name=name, reward_sparse=True, seed=1)
    env.reset()
    rewards = [env.step([np.flatnonzero(row)[-1] for row in env.get_avail_actions()])[0] for _ in range(5)]
    assert rewards == [0] * 5
    env.close()


def test_shares_add_up() -> None:
    fields = ["reward_agents", "enemy_reward_agents", "enemy_reward", "avail_actions", "enemy_avail_actions"]
    with sp.make("2s3z", 6, sides="both", fields=fields, seed=1) as envs:
        envs.reset()
        batches = [envs.step(envs.sample_actions()).copy() for _ in range(60)]
    assert sum((batch["reward_agents"] > 0).any(1).sum() for batch in batches) > 10
    for batch in batches:
        np.testing.assert_allclose(batch["reward_agents"].sum(1), batch["reward"], atol=1e-5)
        np.testing.assert_allclose(batch["enemy_reward_agents"].sum(1), batch["enemy_reward"], atol=1e-5)


def test_shares_must_be_named() -> None:
    with sp.make("3m", 2) as envs:
        assert "reward_agents" not in envs.spec.fields
        with pytest.raises(AttributeError, match="add it to `fields`$"):
            _ = envs.reset().reward_agents


def test_replays_snapshots_and_followers_have_the_rewards(tmp_path: Path) -> None:
    file = tmp_path / "battles.smreplay"
    options: dict[str, Any] = {"rewards": PUNISHED, "fields": ["obs", "avail_actions", "snapshot"]}
    with sp.make("3s_vs_5z", 1, **options) as envs, recorded(envs, file):
        envs.reset(seed=1)
        for _ in range(60):
            batch = envs.step(envs.sample_actions())
        snapshot = batch.snapshot.copy()
    replayed(file)  # compares the returns
    with sp.make("3s_vs_5z", 1, fields=["snapshot"]) as other:
        other.reset()
        with pytest.raises(sp.errors.InvalidRequest, match="scenario"):
            other.reset(snapshots=snapshot)


def test_every_interface_takes_them() -> None:
    rewards_at_the_end = {"reward_sparse": True, "reward_scale": False}
    env = make_vector("3s_vs_5z", num_envs=2, rewards=rewards_at_the_end, seed=1)
    env.reset(seed=1)
    rewards: set[float] = set()
    for _ in range(150):
        rewards |= set(env.step(env.action_space.sample())[1].tolist())
    assert rewards == {0.0, -1.0}
    env.close()


def test_pettingzoo_gives_each_agent_its_share() -> None:
    own = parallel_env("2s3z", seed=1, own_rewards=True)
    team = parallel_env("2s3z", seed=1)
    observations, _ = own.reset(seed=1)
    team.reset(seed=1)
    differ = False
    rng = np.random.default_rng(1)
    while own.agents:
        actions = {
            agent: int(rng.choice(np.flatnonzero(observation["action_mask"])))
            for agent, observation in observations.items()
        }
        observations, shares, *_ = own.step(actions)
        _, rewards, *_ = team.step(actions)
        assert np.isclose(sum(shares.values()), rewards["agent_0"], atol=1e-6)
        differ |= len(set(shares.values())) > 1
    assert differ
    own.close()
    team.close()
