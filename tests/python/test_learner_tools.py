"""What learners in Python use besides batches: `was_reset`, rollouts and lanes."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp

from play import duel


def test_was_reset_marks_the_steps_whose_actions_are_ignored() -> None:
    """The first prototype of a learner kept the ends of the step before for this."""
    with sp.make("3m", 4, episode_limit=5) as envs:
        batch = envs.reset(seed=1)
        assert batch.was_reset.tolist() == [True] * 4
        resets = 0
        for _ in range(40):
            ended = batch.terminated | batch.truncated
            batch = envs.step(envs.sample_actions())
            np.testing.assert_array_equal(batch.was_reset, ended)
            assert not batch.reward[batch.was_reset].any()
            resets += int(batch.was_reset.sum())
        assert resets >= 4 * 6
    with sp.make("3m", 2, episode_limit=3, autoreset_mode="SameStep") as envs:
        assert envs.reset().was_reset.all()
        assert not any(envs.step(envs.sample_actions()).was_reset.any() for _ in range(10))
    with sp.make("3m", 1, fields=["obs"]) as envs:
        assert envs.reset().was_reset.all()


def test_a_rollout_holds_copies_of_consecutive_batches() -> None:
    with sp.make("3m", 3) as envs:
        rollout = sp.extras.Rollout(envs, 6)
        rollout[0] = batch = envs.reset(seed=1)
        copies = [batch.copy()]
        for t in range(6):
            rollout[t + 1] = batch = envs.step(envs.sample_actions())
            copies.append(batch.copy())
        assert set(rollout.arrays) == set(copies[0])
        for name, array in rollout.arrays.items():
            np.testing.assert_array_equal(array, np.stack([copy[name] for copy in copies]))
            assert array.flags.c_contiguous and getattr(rollout, name) is array
        assert rollout.obs.shape == (7, 3, envs.spec.n_agents, envs.spec.obs_size)
        with pytest.raises(IndexError, match="row 7 of a rollout with rows 0 to 6"):
            rollout[7] = batch
        with pytest.raises(AttributeError, match="no field 'final_obs'; it has env_id, obs"):
            rollout.final_obs  # noqa: B018
        small = sp.extras.Rollout(envs, 1, ["reward"])
        assert list(small.arrays) == ["reward", "was_reset"]
        with pytest.raises(sp.errors.InvalidRequest, match="among env_id, obs, .*, got 'rewards'"):
            sp.extras.Rollout(envs, 1, ["rewards"])
        with pytest.raises(sp.errors.InvalidRequest, match="steps must be at least 1, got 0"):
            sp.extras.Rollout(envs, 0)
        wrong: dict[str, Any] = {"str": "obs", "int": 3, "int in it": [3], "list in it": [["obs"]]}
        for got, fields in wrong.items():
            message = f'fields must be a list of strings, such as ["obs"], got {got}'
            with pytest.raises(TypeError, match=f"^{re.escape(message)}$"):
                sp.extras.Rollout(envs, 3, fields=fields)
        with sp.make("3m", 1) as one:  # NumPy would copy it to all rows
            kept = rollout.reward.copy()
            with pytest.raises(sp.errors.InvalidRequest, match=r"with env_id of shape \(3,\), got \(1,\)"):
                rollout[0] = one.reset()
            np.testing.assert_array_equal(rollout.reward, kept)
        with pytest.raises(TypeError, match="^envs must be environments or a wrapper of them, got str$"):
            sp.extras.Rollout("3m", 3)  # type: ignore[arg-type]
    with sp.make("3m", 4, batch_size=2) as envs:
        with pytest.raises(sp.errors.InvalidRequest, match="batch_size must be num_envs=4, got 2"):
            sp.extras.Rollout(envs, 5)


def test_lanes_divide_the_environments_of_one_pool() -> None:
    """Together they play what one lane plays, and one worker thread steps them all."""
    with sp.make("2s3z", 5, seed=11) as whole:
        first, second = sp.make("2s3z", 5, seed=11, lanes=2, threads=1)
        assert (first.spec.num_envs, second.spec.num_envs, second.spec.seed) == (3, 2, 14)
        assert first.spec.pool == second.spec.pool and first.spec.lane != second.spec.lane
        batch, policy = whole.reset(), sp.ScriptedPolicy("nearest", whole)
        halves = [first.reset(), second.reset()]
        for _ in range(60):
            for name in batch.keys():
                both = np.concatenate([getattr(half, name) for half in halves])
                if name != "env_id":
                    np.testing.assert_array_equal(both, getattr(batch, name))
            first.send(policy(halves[0]))
            second.send(policy(halves[1]))
            batch, halves = whole.step(policy(batch)), [first.recv(), second.recv()]
        first.close()
        second.step(policy(halves[1]))  # the pool lives as long as one of its lanes
        second.close()


def test_errors_of_lanes() -> None:
    for lanes, text in [(0, "between 1 and 4 for 4 environments, got 0"), (5, "between 1 and 4 .*, got 5")]:
        with pytest.raises(sp.errors.InvalidRequest, match=f"lanes must be {text}"):
            sp.make("3m", 4, lanes=lanes)
    with pytest.raises(sp.errors.InvalidRequest, match="between 1 and 64 for 100 environments, got 65"):
        sp.make("3m", 100, lanes=65)
    [only] = sp.make("3m", 2, lanes=1)
    only.close()


def test_lanes_of_a_scenario_with_a_long_name(tmp_path: Path) -> None:
    """A number after the scenario's name can make it too long for the name of a lane."""
    path = tmp_path / "duel.json"
    path.write_text(json.dumps(duel(name="d" * 39)))
    for envs in sp.make(path, 2, lanes=2):
        assert envs.reset(seed=1).obs.shape[0] == 1
        envs.close()
