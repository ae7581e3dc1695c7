"""What was wrong, where, and what would be right; and nothing is stepped."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp


@pytest.fixture
def envs() -> Iterator[sp.Envs]:
    with sp.make("2s3z", num_envs=2) as made:
        made.reset(seed=1)
        yield made


def test_an_illegal_action_names_environment_agent_and_what_was_available(envs: sp.Envs) -> None:
    actions = np.ones((2, 5), np.int32)
    actions[1, 3] = 0  # no-op is for the dead
    with pytest.raises(sp.IllegalAction, match="environment 1, agent 3: action 0 is not available") as caught:
        envs.step(actions)
    error = caught.value
    assert (error.env, error.agent, error.action) == (1, 3, 0)
    assert error.available == [1, 2, 3, 4, 5]
    assert isinstance(error, ValueError) and isinstance(error, sp.PoolError)
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.env, again.available) == (str(error), 1, error.available)
    for action in (-1, 11, 2**31 - 1):
        actions[1, 3] = action
        with pytest.raises(sp.IllegalAction, match=f"action {action} "):
            envs.step(actions)
    actions[1, 3] = 1
    assert envs.step(actions).episode_length.tolist() == [1, 1], "nothing was stepped before"


Call = Callable[[sp.Envs], Any]


@pytest.mark.parametrize(
    ("call", "error", "match"),
    [
        (lambda e: e.step(np.ones((2, 4), int)), sp.InvalidRequest, r"shape \(2, 4\) was given, \(2, 5\) is taken"),
        (lambda e: e.step(np.ones(10, int)), sp.InvalidRequest, r"shape \(10,\) was given, \(2, 5\) is taken"),
        (lambda e: e.step([]), sp.InvalidRequest, r"shape \(0,\) was given"),
        (lambda e: e.step([[1, 2], [3]]), sp.InvalidRequest, "cannot be made an array"),
        (lambda e: e.step(None), sp.InvalidRequest, r"shape \(\) was given"),
        (lambda e: e.step(np.ones((2, 5))), TypeError, "actions: dtype float64 was given"),
        (lambda e: e.step(np.ones((2, 5), bool)), TypeError, "actions: dtype bool was given"),
        (lambda e: e.step([["a"] * 5] * 2), TypeError, "actions: dtype <U1 was given"),
        (lambda e: e.step(np.full((2, 5), 2**40)), sp.InvalidRequest, r"1099511627776 at index \[0, 0\] is beyond"),
        (lambda e: e.step(np.full((2, 5), 2**63, np.uint64)), sp.InvalidRequest, "9223372036854775808 at index"),
        (lambda e: e.step([[1] * 5] * 2, env_id=[0, 2]), sp.InvalidRequest, "environment 2 does not exist"),
        (lambda e: e.step([[1] * 5] * 2, env_id=[0, -1]), sp.InvalidRequest, "environment -1 does not exist"),
        (lambda e: e.step([[1] * 5] * 2, env_id=[1, 1]), sp.InvalidRequest, "environment 1 is given twice"),
        (lambda e: e.step([[1] * 5], env_id=[1]), sp.InvalidRequest, "takes all 2 at once"),
        (lambda e: e.step([[1] * 5], env_id=[[1]]), sp.InvalidRequest, r"env_id: shape \(1, 1\) was given"),
        (lambda e: e.step([[1] * 5], env_id=[0.5]), TypeError, "env_id: dtype float64"),
        (lambda e: e.recv(), sp.InvalidRequest, "send actions first"),
        (lambda e: e.recv(timeout=-1), sp.InvalidRequest, "timeout=-1"),
        (lambda e: e.recv(timeout=float("nan")), sp.InvalidRequest, "timeout=NaN"),
        (lambda e: e.reset(seed=-1), sp.InvalidRequest, "seed=-1 cannot be negative"),
        (lambda e: e.reset(seed=2**64), sp.InvalidRequest, "is too large"),
        (lambda e: e.reset(mask=[True]), sp.InvalidRequest, r"mask: shape \(1,\) was given, \(2,\)"),
        (lambda e: e.reset(mask=[1, 0]), TypeError, "mask: dtype int64 was given, bool"),
        (lambda e: e.reset(mask=[True, False], env_id=[0]), sp.InvalidRequest, "give one"),
        (lambda e: e.reset(env_id=[5]), sp.InvalidRequest, "environment 5 does not exist"),
        (lambda e: e.reset(env_id=[], timeout=10), sp.InvalidRequest, "no environment was chosen"),
        (lambda e: e.reset(mask=[False, False], timeout=10), sp.InvalidRequest, "no environment was chosen"),
        (lambda e: e.sample_actions(out=np.zeros((2, 5))), TypeError, "int32 array of shape"),
        (lambda e: e.sample_actions(out=np.zeros((1, 5), np.int32)), sp.InvalidRequest, r"shape \(2, 5\) is taken"),
        (lambda e: e.sample_actions(env_id=[7]), sp.InvalidRequest, "environment 7 does not exist"),
    ],
)
def test_a_wrong_request_says_what_is_taken(envs: sp.Envs, call: Call, error: type[Exception], match: str) -> None:
    with pytest.raises(error, match=match):
        call(envs)
    assert envs.step([[1] * 5] * 2).episode_length.tolist() == [1, 1], "and the next right one works"


@pytest.mark.parametrize(
    ("settings", "error", "match"),
    [
        ({"scenario": "2s3"}, sp.ScenarioError, "did you mean `2s3z`"),
        ({"scenario": "./no/such.json"}, sp.ScenarioError, "such.json"),
        ({"num_envs": 0}, sp.InvalidRequest, "0 environments; 1 to"),
        ({"num_envs": -3}, sp.InvalidRequest, "num_envs=-3 cannot be negative"),
        ({"batch_size": 9}, sp.InvalidRequest, "batch size 9; 1 to 2"),
        ({"threads": 0}, sp.InvalidRequest, "threads=0: 1 to"),
        ({"autoreset": "never"}, sp.InvalidRequest, "not `never`"),
        ({"rules": "mine"}, sp.InvalidRequest, "mine"),
        ({"wait": "sleep"}, sp.InvalidRequest, "not `sleep`"),
        ({"fields": ["obz"]}, sp.InvalidRequest, "no field is named `obz`; the fields are env_id"),
        ({"fields": "obs"}, TypeError, "str"),
        ({"episode_limit": 0}, sp.InvalidRequest, "at least one step"),
        ({"episode_limit": "none"}, sp.InvalidRequest, "not `none`"),
        ({"episode_limit": 2**40}, sp.InvalidRequest, "too large"),
        ({"frames_held": 1}, sp.InvalidRequest, "2 to 1024"),
        ({"name": "a/b"}, sp.InvalidRequest, "cannot be a name"),
        ({"seed": -1}, sp.InvalidRequest, "seed=-1"),
        ({"scenario": "27m_vs_30m", "num_envs": 1_000_000, "frames_held": 1000}, sp.TooLittleMemory, "bytes"),
    ],
)
def test_a_wrong_setting_starts_nothing(settings: dict[str, Any], error: type[Exception], match: str) -> None:
    with pytest.raises(error, match=match):
        sp.make(**{"scenario": "2s3z", "num_envs": 2, **settings})
    assert sp.pools() == []


def test_a_wrong_scenario_file_names_file_key_and_value(place: Path) -> None:
    path = place / "wrong.json"
    path.write_text('{"num_allied_units": "two"}')
    with pytest.raises(sp.ScenarioError, match="wrong.json"):
        sp.make(path)
    path.unlink()


def test_stepping_before_the_first_reset() -> None:
    with sp.make("2s3z", num_envs=1) as envs, pytest.raises(sp.InvalidRequest, match="call reset first"):
        envs.step([[1] * 5])


def test_a_name_or_lane_that_is_taken(envs: sp.Envs) -> None:
    with pytest.raises(sp.LaneTaken, match=f"process {envs.pid}") as caught:
        sp.connect(envs.name)
    assert caught.value.holder == envs.pid and isinstance(caught.value, ConnectionError)
    with pytest.raises(sp.StartError, match="runs already"):
        sp.make("2s3z", 1, name=envs.name)


def test_no_such_pool_or_lane(envs: sp.Envs) -> None:
    with pytest.raises(sp.NoSuchPool, match=f"running: {envs.name}"):
        sp.connect("nobody", timeout=0.05)
    with pytest.raises(sp.NoSuchPool):
        sp.status("nobody")
    with pytest.raises(sp.ConnectError, match="no lane `x`; the pool has `2s3z`"):
        sp.connect(envs.name, "x")


def test_closed_environments_say_so(envs: sp.Envs) -> None:
    obs = envs.step([[1] * 5] * 2).obs
    envs.close()
    envs.close()
    for call in (envs.recv, envs.reset, envs.sample_actions):
        with pytest.raises(sp.Closed, match="are closed"):
            call()
    assert envs.num_envs == 2 and np.isfinite(obs).all()
