"""Reward options and the shares of single units, from Python; tests/battles/rewards.rs defines them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp
from smaclite_pool.integrations.gymnasium import make_vector
from smaclite_pool.integrations.pettingzoo import parallel_env

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


def steps(envs: sp.Envs, n: int, seed: int = 3) -> list[dict[str, Any]]:
    """Copies of the batches of `n` steps with seeded random actions."""
    envs.reset(seed=seed)
    envs.seed_sampler(seed)
    return [envs.step(envs.sample_actions()).copy() for _ in range(n)]


def test_every_scenario_has_the_default_rewards_until_it_is_told_others() -> None:
    for name in sp.scenarios():
        with sp.make(name, 1) as envs:
            assert envs.spec.rewards == DEFAULTS, name
    with sp.make("3m", 1, rewards={"reward_win": 50}) as envs:
        assert envs.spec.rewards == {**DEFAULTS, "reward_win": 50.0}
        assert sp.status(envs.spec.pool)["lanes"][0]["description"]["rewards"]["reward_win"] == 50


def test_defaults_that_are_written_out_change_no_bit() -> None:
    with sp.make("MMM", 4) as plain, sp.make("MMM", 4, rewards=DEFAULTS) as written:
        for one, other in zip(steps(plain, 150), steps(written, 150), strict=True):
            for name, values in one.items():
                assert values.tobytes() == other[name].tobytes(), name


def test_options_change_rewards_and_nothing_else() -> None:
    with sp.make("3s_vs_5z", 4) as plain, sp.make("3s_vs_5z", 4, rewards=PUNISHED) as punished:
        pairs = list(zip(steps(plain, 150), steps(punished, 150), strict=True))
    for one, other in pairs:
        for name in one.keys() - {"reward", "episode_return"}:
            assert np.array_equal(one[name], other[name]), name
    lost = [other for _, other in pairs if (other["terminated"] & ~other["battle_won"]).any()]
    assert lost and all((batch["reward"][batch["terminated"]] < -29).all() for batch in lost)
    # The returns of the lane are the sums of its rewards.
    env = 0
    total = np.float64(0)
    for _, other in pairs:
        total = (0 if other["was_reset"][env] else total) + np.float64(other["reward"][env])
        assert np.isclose(other["episode_return"][env], total, atol=1e-3)


@pytest.mark.parametrize(
    ("rewards", "message"),
    [
        ({"reward_winn": 1}, "unknown key `rewards.reward_winn`; did you mean `reward_win`"),
        ({"reward_sparse": 1}, "`rewards.reward_sparse` is 1, but must be true or false"),
        ({"reward_scale_rate": 0}, "must be a number above 0"),
        ({"reward_death_value": -1}, "`reward_death_value` and `reward_win` must be at least 0"),
    ],
)
def test_invalid_options_are_refused(rewards: dict[str, Any], message: str) -> None:
    with pytest.raises(sp.errors.ScenarioError, match=message):
        sp.make("3m", 1, rewards=rewards)


def test_scenarios_with_smacv2s_options_have_their_own() -> None:
    name = sp.scenarios(generated=True)[0]
    with pytest.raises(sp.errors.ScenarioError, match="`rewards` must be left out beside `smacv2`"):
        sp.make("3m", 1, rewards={"reward_win": 1}, smacv2={})
    with sp.make(name, 1, smacv2={"reward_win": 77}) as envs:
        assert envs.spec.rewards["reward_win"] == 77


@pytest.mark.parametrize("autoreset", ["NextStep", "SameStep"])
@pytest.mark.parametrize(("batch_size", "threads"), [(6, 1), (6, 3), (2, 2)])
def test_shares_add_up_in_every_mode(autoreset: Any, batch_size: int, threads: int) -> None:
    options: dict[str, Any] = {"sides": "both", "fields": ["reward_agents", "enemy_reward_agents"]}
    options["fields"] += ["enemy_reward", "was_reset", "avail_actions", "enemy_avail_actions"]
    ends = rewarded = 0
    with sp.make(
        "2s3z",
        6,
        batch_size=batch_size,
        threads=threads,
        autoreset_mode=autoreset,
        episode_limit=40,
        seed=1,
        **options,
    ) as envs:
        batch = envs.reset()
        for _ in range(1800 // batch_size):  # asynchronously, chance says how far each environment gets
            batch = envs.step(envs.sample_actions(batch.env_id), batch.env_id)
            own, others = batch.reward_agents, batch.enemy_reward_agents
            np.testing.assert_allclose(own.sum(1), batch.reward, atol=1e-5)
            np.testing.assert_allclose(others.sum(1), batch.enemy_reward, atol=1e-5)
            assert not own[batch.was_reset].any()
            ends += int((batch.terminated | batch.truncated).sum())
            rewarded += int((own > 0).any(1).sum())
    assert ends > 5 and rewarded > 50


def test_shares_must_be_named() -> None:
    with sp.make("3m", 2) as envs:
        assert "reward_agents" not in envs.spec.fields
        with pytest.raises(AttributeError, match="add it to `fields`$"):
            _ = envs.reset().reward_agents


def test_replays_snapshots_and_followers_have_the_rewards(tmp_path: Path) -> None:
    file = tmp_path / "battles.smreplay"
    options: dict[str, Any] = {"rewards": PUNISHED, "fields": ["obs", "avail_actions", "snapshot"]}
    with sp.make("3s_vs_5z", 1, record=file, **options) as envs:
        envs.reset(seed=1)
        for _ in range(60):
            batch = envs.step(envs.sample_actions())
        snapshot = batch.snapshot.copy()
    # Replaying compares the returns.
    command = [sys.executable, "-m", "smaclite_pool", "replay", str(file)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
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
