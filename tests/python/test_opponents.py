"""What plays the enemies: names and weights, on every interface."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import smaclite_pool as sp
from smaclite_pool.marl.smac import StarCraft2Env

from conftest import recorded, replayed

MIXTURE = {"attack_move": 1.0, "kite": 2.0, "hold": 1.0}


def test_the_names_are_those_of_the_policies_and_two_more() -> None:
    assert sp.OPPONENTS[:3] == ("attack_move", "attack_nearest", "random") and sp.OPPONENTS[-1] == "learner"
    with sp.make("3m", num_envs=1) as envs:
        assert envs.spec.opponents == {"attack_move": 1.0} and "opponent" not in envs.spec.fields
        for name in sp.OPPONENTS[2:-1]:
            sp.ScriptedPolicy(name, envs)  # type: ignore[arg-type]


def test_the_opponents_of_a_mixture_are_named_in_batches_snapshots_and_replays(tmp_path: Path) -> None:
    file = tmp_path / "mixture.smreplay"
    fields = ["opponent", "snapshot", "state", "avail_actions"]
    seen: set[int] = set()
    with sp.make("3m", num_envs=2, opponent=MIXTURE, fields=fields) as envs, recorded(envs, file):
        assert envs.spec.opponents == MIXTURE
        policy = sp.ScriptedPolicy("focus_fire", envs)
        batch = envs.reset(seed=5)
        for _ in range(120):
            batch = envs.step(policy(batch))
            seen |= set(batch.opponent.tolist())
        columns = [sp.snapshot_columns(snapshot)["opponent"] for snapshot in batch.snapshot]
        assert np.array_equal(columns, batch.opponent)
    assert {sp.OPPONENTS[index] for index in seen} == set(MIXTURE)
    assert "reproduced" in replayed(file)  # every tick is played as recorded


def test_smac_takes_an_opponent() -> None:
    env = StarCraft2Env("3m", seed=1, opponent="hold")
    env.reset()
    before = env.get_state()
    for _ in range(10):  # who holds does not come
        env.step([1] * env.n_agents)
    assert np.array_equal(
        env.get_state()[: -env.n_agents * env.n_actions], before[: -env.n_agents * env.n_actions]
    )
    env.close()


@pytest.mark.parametrize(
    ("opponent", "message"),
    [
        ("kites", "unknown opponent `kites`; the opponents are attack_move, attack_nearest, random"),
        ({}, "at least one opponent must be named"),
        ({"kite": 0}, "the weight of opponent `kite` must be a number above 0, at most 1000000, got 0"),
        ({"kite": float("nan")}, "must be a number above 0, at most 1000000, got NaN"),
        ({"kite": 1e308, "hold": 1e308}, "must be a number above 0, at most 1000000, got 1000"),
        ({"kite": 1, "hodl": 1}, "unknown opponent `hodl`"),
    ],
)
def test_what_is_no_opponent_is_an_error(opponent: object, message: str) -> None:
    with pytest.raises(sp.errors.InvalidRequest, match=message):
        sp.make("3m", opponent=opponent)  # type: ignore[call-overload]


def test_a_wrong_type_names_the_parameter() -> None:
    with pytest.raises(TypeError, match="opponent"):
        sp.make("3m", opponent=3)  # type: ignore[call-overload]
