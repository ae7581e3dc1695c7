"""Scripted policies, played with the batches of pools. What they decide is tested in tests/pools."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
import smaclite_pool as sp
from smaclite_pool._native import FIRST_TARGET, STOP

from conftest import Serve
from play import duel

Name = Literal["random", "nearest", "focus_fire", "kite", "hold"]
NAMES: tuple[Name, ...] = ("random", "nearest", "focus_fire", "kite", "hold")


def test_a_policy_depends_on_the_batch_alone() -> None:
    with sp.make("MMM", 4) as envs:
        policies = [sp.ScriptedPolicy(name, envs, seed=2) for name in NAMES]
        batch = envs.reset(seed=1)
        for _ in range(10):
            chosen = [policy(batch) for policy in policies]
            for name, policy, actions in zip(NAMES, policies, chosen, strict=True):
                assert policy.name == name and repr(policy) == f"<smaclite_pool.ScriptedPolicy {name}>"
                assert actions.shape == (4, envs.spec.n_agents) and actions.dtype == np.int32
                again = sp.ScriptedPolicy(name, envs)(batch)
                assert name == "random" or np.array_equal(again, actions)
            batch = envs.step(chosen[2])
        one, other = (sp.ScriptedPolicy("random", envs, seed=7) for _ in range(2))
        assert all(np.array_equal(one(batch), other(batch)) for _ in range(5))
        assert not np.array_equal(one(batch), sp.ScriptedPolicy("random", envs, seed=8)(batch))


def test_actions_are_written_to_a_given_array() -> None:
    with sp.make("3m", 2) as envs:
        policy, batch = sp.ScriptedPolicy("nearest", envs), envs.reset(seed=1)
        out = np.full((2, 3), -1, np.int32)
        assert policy(batch, out) is out and np.array_equal(out, policy(batch))
        assert policy(batch, out=out) is out
        for wrong, error in [(out[:1], ValueError), (out.T, ValueError), (out.astype(np.int64), TypeError)]:
            with pytest.raises(error, match=r"out must be .* int32 array of shape \(2, 3\), got"):
                policy(batch, wrong)  # type: ignore[arg-type]


def test_asynchronous_environments_are_played() -> None:
    with sp.make("3m", 6, batch_size=2, seed=1) as envs:
        policy = sp.ScriptedPolicy("focus_fire", envs)
        envs.async_reset()
        won = 0
        for _ in range(200):
            batch = envs.recv()
            won += int(batch.battle_won.sum())
            envs.send(policy(batch), batch.env_id)
        assert won > 5


def test_an_attached_learner_plays_policies(tmp_path: Path, serve: Serve) -> None:
    own = tmp_path / "duel.json"
    own.write_text(json.dumps(duel(name="duel")))
    serve("3m:2", f"own={own}:2", "--name", "played", "--rules", "paper")
    with sp.connect("played", "3m") as envs:
        batch = envs.reset(seed=1)
        with sp.make("3m", 2, rules="paper") as same:
            assert np.array_equal(
                sp.ScriptedPolicy("kite", envs)(batch), sp.ScriptedPolicy("kite", same)(same.reset(seed=1))
            )
    with sp.connect("played", "own") as envs:
        own.unlink()  # the pool sends the scenario
        actions = sp.ScriptedPolicy("hold", envs)(envs.reset())
        assert not ((actions > STOP) & (actions < FIRST_TARGET)).any(), "no move"
        assert envs.render(envs.step(actions), env_id=0).any()


def test_states_without_units_are_refused() -> None:
    """A policy would see dead units everywhere, and a picture would be empty."""
    with sp.make("3m", 1, seed=1, smacv2={"obs_instead_of_state": True}) as envs:
        batch = envs.reset()
        sp.ScriptedPolicy("random", envs)(batch)  # it reads no state
        refused = "the units of states, but `obs_instead_of_state` of `smacv2` is true"
        with pytest.raises(sp.errors.InvalidRequest, match=f"the policy kite reads {refused}"):
            sp.ScriptedPolicy("kite", envs)
        with pytest.raises(sp.errors.InvalidRequest, match=f"pictures show {refused}"):
            envs.render(batch, 0)


def test_drawn_types_that_states_do_not_name_are_refused(tmp_path: Path) -> None:
    """A policy took all units for those that the file names first, and played otherwise than `record`."""
    path = tmp_path / "drawn.json"
    keys = {
        "name": "drawn",
        "teams": {"distribution": "all_teams", "unit_types": ["MARINE", "MARAUDER"]},
        "start_positions": {"distribution": "surrounded"},
        "num_allied_units": 2,
        "num_enemy_units": 2,
        "terrain_preset": "FLAT",
        "ally_has_shields": False,
        "enemy_has_shields": False,
    }
    path.write_text(json.dumps({**keys, "num_unit_types": 0}))
    with sp.make(path, 1) as envs:
        batch = envs.reset(seed=1)
        sp.ScriptedPolicy("random", envs)(batch)
        with pytest.raises(sp.errors.InvalidRequest, match="do not tell apart the types.*num_unit_types"):
            sp.ScriptedPolicy("kite", envs)
    ids = {"MARINE": 0, "MARAUDER": 1}
    path.write_text(json.dumps({**keys, "num_unit_types": 2, "unit_type_ids": ids}))
    with sp.make(path, 1) as envs:
        sp.ScriptedPolicy("kite", envs)(envs.reset(seed=1))


def test_errors_say_what_is_accepted() -> None:
    with (
        sp.make("3m", 1) as envs,
        sp.make("2s3z", 1) as others,
        sp.make("3m", 1, fields=["state"]) as partial,
    ):
        unknown: Any = "greedy"
        names = "the policies are random, nearest, focus_fire, kite, hold"
        with pytest.raises(sp.errors.InvalidRequest, match=f"unknown policy `greedy`; {names}"):
            sp.ScriptedPolicy(unknown, envs)
        with pytest.raises(sp.errors.InvalidRequest, match="but this lane omits `avail_actions`"):
            sp.ScriptedPolicy("hold", partial)
        with pytest.raises(sp.errors.InvalidRequest, match="seed must not be negative, got -1"):
            sp.ScriptedPolicy("random", envs, seed=-1)
        policy = sp.ScriptedPolicy("hold", envs)
        with pytest.raises(
            sp.errors.InvalidRequest, match="for 3 against 3 units .*, got a batch with 5 against 5"
        ):
            policy(others.reset())
        with pytest.raises(AttributeError, match="do not include `avail_actions`"):
            policy(partial.reset())
        with pytest.raises(TypeError):
            policy(None)  # type: ignore[arg-type]
