"""Errors say what was wrong, where, and what is accepted; a request with an error steps no environment."""

from __future__ import annotations

import inspect
import pickle
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp
from numpy.typing import NDArray
from smaclite_pool.integrations.gymnasium import BattleEnv

from conftest import REPOSITORY, each_case, run_script


@pytest.fixture
def envs() -> Iterator[sp.Envs]:
    with sp.make("2s3z", num_envs=2) as made:
        made.reset(seed=1)
        yield made


def test_an_illegal_action_names_environment_agent_and_available_actions(envs: sp.Envs) -> None:
    actions = np.ones((2, 5), np.int32)
    actions[1, 3] = 0  # no-op is for dead agents
    with pytest.raises(
        sp.errors.IllegalAction, match="environment 1, agent 3: action 0 is not available"
    ) as caught:
        envs.step(actions)
    error = caught.value
    assert (error.env, error.agent, error.action) == (1, 3, 0)
    assert error.available == [1, 2, 3, 4, 5]
    assert isinstance(error, ValueError) and isinstance(error, sp.errors.PoolError)
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.env, again.available) == (str(error), 1, error.available)
    for action in (-1, 11, 2**31 - 1):
        actions[1, 3] = action
        with pytest.raises(sp.errors.IllegalAction, match=f"action {action} "):
            envs.step(actions)
    actions[1, 3] = 1
    assert envs.step(actions).episode_length.tolist() == [1, 1], "no environment was stepped before"


Call = Callable[[Any], Any]


def read_only() -> NDArray[np.int32]:
    array = np.zeros((2, 5), np.int32)
    array.flags.writeable = False
    return array


WRONG_REQUESTS: dict[type[Exception], list[tuple[Call, str]]] = {
    sp.errors.InvalidRequest: [
        (lambda e: e.step(np.ones((2, 4), int)), r"actions must be .* shape \(2, 5\), got \(2, 4\)"),
        (lambda e: e.step(np.ones(10, int)), r"shape \(2, 5\), got \(10,\)"),
        (lambda e: e.step([]), r"got \(0,\)"),
        (lambda e: e.step([[1, 2], [3]]), "actions must be an array or nested lists: .*inhomogeneous"),
        (lambda e: e.step(None), r"actions must be .* shape \(2, 5\), got NoneType"),
        (lambda e: e.step({}), r"actions must be .* shape \(2, 5\), got dict"),
        (lambda e: e.step([[1] * 5], env_id=3), r"env_id must be .* shape \(K,\), got \(\)"),
        (lambda e: e.step([], env_id=[]), "env_id must select at least one environment"),
        (lambda e: e.step(np.full((2, 5), 2**40)), r"fit into int32, got 1099511627776 at index \[0, 0\]"),
        (lambda e: e.step(np.full((2, 5), 2**63, np.uint64)), "9223372036854775808 at index"),
        (lambda e: e.step([[1] * 5] * 2, env_id=[0, 2]), "environment 2 does not exist"),
        (lambda e: e.step([[1] * 5] * 2, env_id=[0, -1]), "environment -1 does not exist"),
        (lambda e: e.step([[1] * 5] * 2, env_id=[1, 1]), "environment 1 appears twice"),
        (lambda e: e.step([[1] * 5], env_id=[1]), "steps all 2 environments at once"),
        (lambda e: e.step([[1] * 5], env_id=[[1]]), r"env_id must be .*, got \(1, 1\)"),
        (lambda e: e.recv(), "send actions first"),
        (lambda e: e.recv(timeout=-1), "timeout must be at least 0 seconds, or None, got -1.0"),
        (lambda e: e.recv(timeout=-(10**400)), "timeout must be .*, got -inf"),
        (lambda e: e.recv(timeout=float("nan")), "timeout must be .*, got NaN"),
        (lambda e: e.reset(seed=-1), "seed must not be negative, got -1"),
        (lambda e: e.reset(seed=2**64), "seed must be at most 18446744073709551615, got 184467"),
        (lambda e: e.reset(seed=2**200), "seed must be at most .*, got an integer of more than 127"),
        (lambda e: e.reset(seed=-(2**200)), "seed must not be negative"),
        (lambda e: e.seed_sampler(10**300), "seed must be at most"),
        (lambda e: e.reset(env_id=[True]), r"env_id must be a bool array of shape \(2,\), got \(1,\)"),
        (lambda e: e.reset(env_id=[5]), "environment 5 does not exist"),
        (lambda e: e.reset(env_id=[], timeout=10), "env_id must select at least one environment"),
        (lambda e: e.reset(env_id=[False, False], timeout=10), "env_id must select at least one environment"),
        (
            lambda e: e.sample_actions(out=np.zeros((1, 5), np.int32)),
            r"out must be .* shape \(2, 5\), got int32 of shape \(1, 5\)",
        ),
        (lambda e: e.sample_actions(out=np.zeros((5, 2), np.int32).T), "got one that is not C-contiguous"),
        (lambda e: e.sample_actions(out=read_only()), "got one that is not writeable"),
        (lambda e: e.sample_actions(env_id=[7]), "environment 7 does not exist"),
    ],
    TypeError: [
        (lambda e: e.step(np.ones((2, 5))), "actions must be an integer array, got float64"),
        (lambda e: e.step(np.ones((2, 5), bool)), "actions must be an integer array, got bool"),
        (lambda e: e.step([["a"] * 5] * 2), "actions must be an integer array, got <U1"),
        (lambda e: e.step([[1] * 5], env_id=[0.5]), "env_id must be an integer array, got float64"),
        (lambda e: e.recv(timeout="1"), "timeout must be a number of seconds or None, got str"),
        (lambda e: e.reset(seed=1.5), "or a list with one per environment, got float"),
        (lambda e: e.sample_actions(out=np.zeros((2, 5))), r"int32 array .*, got float64 of shape \(2, 5\)"),
        (lambda e: e.sample_actions(out=[[0] * 5] * 2), r"out must be .*, got list"),
    ],
}


@pytest.mark.parametrize(("error", "call", "match"), each_case(WRONG_REQUESTS))
def test_a_wrong_request_says_what_is_accepted(
    envs: sp.Envs, error: type[Exception], call: Call, match: str
) -> None:
    with pytest.raises(error, match=match):
        call(envs)
    assert envs.step([[1] * 5] * 2).episode_length.tolist() == [1, 1], "and the next valid request works"


WRONG_SETTINGS: dict[type[Exception], list[tuple[dict[str, Any], str]]] = {
    sp.errors.ScenarioError: [
        ({"scenario": "2s3"}, "did you mean `2s3z`"),
        ({"scenario": "./no/such.json"}, "such.json"),
    ],
    sp.errors.InvalidRequest: [
        ({"num_envs": 0}, "environments must be between 1 and 1000000, got 0"),
        ({"num_envs": -3}, "num_envs must not be negative, got -3"),
        ({"num_envs": 2**127}, "num_envs must be at most"),
        ({"batch_size": 9}, "batch size must be between 1 and 2 .*, got 9"),
        ({"threads": 0}, "threads must be between 1 and 1024, got 0"),
        ({"autoreset_mode": "never"}, "got `never`"),
        ({"rules": "mine"}, "mine"),
        ({"wait": "sleep"}, "got `sleep`"),
        ({"fields": ["obz"]}, "unknown field `obz`; the fields are env_id"),
        ({"episode_limit": 0}, 'an integer of at least 1, None or "default", got 0'),
        ({"episode_limit": "none"}, "got `none`"),
        ({"episode_limit": 2**40}, "at most 4294967295"),
        ({"obs_last_actions": 17}, "obs_last_actions must be between 0 and 16, got 17"),
        ({"max_held_batches": 1}, "between 2 and 1024, got 1"),
        ({"name": "a/b"}, "cannot be a name"),
        ({"seed": -1}, "seed must not be negative"),
    ],
    TypeError: [
        ({"num_envs": 64.0}, "num_envs must be an integer, got float"),
        ({"fields": "obs"}, r"fields must be a list of strings, such as \[\"obs\"\], got str"),
        ({"episode_limit": 1.5}, "episode_limit must be an integer .*, got float"),
        ({"obs_last_actions": 1.0}, "obs_last_actions must be an integer, got float"),
        # PyO3 names the argument in a note, which exceptions have since Python 3.11.
        ({"obs_agent_id": 1}, "obs_agent_id" if sys.version_info >= (3, 11) else "bool"),
    ],
    sp.errors.TooLittleMemory: [
        ({"scenario": "27m_vs_30m", "num_envs": 1_000_000, "max_held_batches": 1000}, "bytes"),
    ],
}


@pytest.mark.parametrize(("error", "settings", "match"), each_case(WRONG_SETTINGS))
def test_a_wrong_setting_starts_nothing(error: type[Exception], settings: dict[str, Any], match: str) -> None:
    with pytest.raises(error, match=match):
        sp.make(**{"scenario": "2s3z", "num_envs": 2, **settings})
    assert sp.pools() == []


def test_a_name_that_a_batch_does_not_have_lists_the_fields(envs: sp.Envs) -> None:
    """Other packages say observation, rewards, done or action_mask."""
    batch: Any = envs.step([[1] * 5] * 2)
    for wrong in ("observation", "rewards", "done", "action_mask"):
        with pytest.raises(AttributeError, match=f"no `{wrong}`; .*fields are env_id, obs, .*, was_reset"):
            getattr(batch, wrong)
    with pytest.raises(AttributeError, match='exists only with autoreset_mode="SameStep"'):
        batch.final_obs  # noqa: B018
    assert not hasattr(batch, "__array__") and len(np.asarray(batch.obs)) == 2
    with sp.make("3m", 1, fields=["obs"]) as few:
        batch = few.reset()
        with pytest.raises(AttributeError, match="its fields are env_id, obs, reward, .*, was_reset$"):
            batch.observation  # noqa: B018
        for absent in ("state", "snapshot"):
            with pytest.raises(AttributeError, match="do not include .*; add it to `fields`"):
                getattr(batch, absent)


def test_a_wrong_scenario_file_names_file_key_and_value(runtime_dir: Path) -> None:
    path = runtime_dir / "wrong.json"
    path.write_text('{"num_allied_units": "two"}')
    with pytest.raises(sp.errors.ScenarioError, match="wrong.json"):
        sp.make(path)
    path.unlink()


def test_stepping_before_the_first_reset() -> None:
    """Before it, `sample_actions` once drew actions that no environment would accept."""
    with sp.make("2s3z", num_envs=1) as envs:
        for call in (lambda: envs.step([[1] * 5]), envs.sample_actions):
            with pytest.raises(sp.errors.InvalidRequest, match="call reset first"):
                call()


def test_a_name_that_no_pool_can_have() -> None:
    for name in ("../../etc", "a\0b", "", "a\nb", "x" * 1000):
        for call in (sp.connect, sp.status):
            with pytest.raises(sp.errors.InvalidRequest, match="cannot be a name") as caught:
                call(name)
            assert "\n" not in str(caught.value) and len(str(caught.value)) < 300


def test_a_name_or_lane_that_is_in_use(envs: sp.Envs) -> None:
    with pytest.raises(sp.errors.LaneTaken, match=f"process {envs.spec.pid}") as caught:
        sp.connect(envs.spec.pool)
    assert caught.value.learner_pid == envs.spec.pid and isinstance(caught.value, ConnectionError)
    with pytest.raises(sp.errors.StartError, match="runs already"):
        sp.make("2s3z", 1, name=envs.spec.pool)


def test_no_such_pool_or_lane(envs: sp.Envs) -> None:
    with pytest.raises(sp.errors.NoSuchPool, match=f"running: {envs.spec.pool}"):
        sp.connect("absent", timeout=0.05)
    with pytest.raises(sp.errors.NoSuchPool):
        sp.status("absent")
    with pytest.raises(sp.errors.ConnectError, match="no lane `x`; the pool has `2s3z`"):
        sp.connect(envs.spec.pool, "x")


def test_closed_environments_say_so(envs: sp.Envs) -> None:
    obs = envs.step([[1] * 5] * 2).obs
    envs.close()
    envs.close()
    for call in (envs.recv, envs.reset, envs.sample_actions):
        with pytest.raises(sp.errors.Closed, match="are closed"):
            call()
    assert envs.spec.num_envs == 2 and np.isfinite(obs).all()


def test_every_exception_can_be_raised_again_from_its_message() -> None:
    """Gymnasium's AsyncVectorEnv does so; IllegalAction once failed there with a TypeError."""
    classes = [getattr(sp.errors, name) for name in sp.errors.__all__]
    assert len(classes) == 16
    for error in classes:
        again = error("what was wrong")
        assert str(again) == str(pickle.loads(pickle.dumps(again))) == "what was wrong"


IMPORTS = {
    **{f"integrations.{name}": name for name in ("gymnasium", "jax", "pettingzoo", "torch", "torchrl")},
    **{"integrations.ray": "ray", "integrations.rllib": "rllib", "compat.smaclite": "gymnasium"},
    **{f"examples.{name}": "torch" for name in ("ppo", "self_play", "behaviour_cloning", "epymarl_speed")},
    **{"examples.value_decomposition": "torch", "examples.ray_rollouts": "ray"},
}
"""Modules that need a framework, and the extra that brings it."""


@pytest.mark.parametrize(("module", "name"), IMPORTS.items())
def test_a_missing_framework_names_the_extra_to_install(module: str, name: str) -> None:
    package = {"rllib": "ray"}.get(name, name)
    done = run_script(f"import sys; sys.modules[{package!r}] = None; import smaclite_pool.{module}")
    assert "ModuleNotFoundError" in done.stderr, done.stderr
    # A framework that needs another one, which is missing too, names its own extra.
    assert f"pip install 'smaclite-pool[{name}]'" in done.stderr, done.stderr


def test_a_batch_is_no_tuple(envs: sp.Envs) -> None:
    """The first mistake of everyone who comes from Gymnasium."""
    batch: Any = envs.reset(seed=1)
    with pytest.raises(TypeError, match=r"a batch is no tuple: use batch\.obs"):
        _observations, _infos = batch
    np.testing.assert_array_equal(batch["obs"], batch.obs)
    assert set(dict(batch)) == set(batch.keys()) and "obs" in batch and "rewards" not in batch
    with pytest.raises(KeyError, match="no field 'rewards'; use `reward`; its fields are env_id, obs"):
        batch["rewards"]


def test_what_is_probably_a_mistake_in_a_scenario_is_a_warning(tmp_path: Path) -> None:
    path = tmp_path / "wall.json"
    text = (REPOSITORY / "scenarios/data/3m.json").read_text()
    path.write_text(text.replace('"x": 9, "y": 16', '"x": 9, "y": 28'))
    with pytest.warns(
        UserWarning, match=r"wall.json:6:9: `groups\[0\]` puts a MARINE at .* on a blocked square"
    ):
        sp.make(path, 1).close()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(UserWarning, match="blocked square"):
            sp.make(path, 1, name="walled")
        sp.make("3m", 1, name="walled").close()  # the pool that was refused has ended


def test_a_typo_in_a_keyword_of_make_gets_a_suggestion() -> None:
    with pytest.raises(TypeError, match=r"unexpected keyword argument 'n_envs'; did you mean `num_envs`\?"):
        sp.make("3m", n_envs=2)  # type: ignore[call-overload]
    with pytest.raises(TypeError, match="'colour'; expected one of scenario, num_envs, .*threads"):
        sp.make("3m", colour=2)  # type: ignore[call-overload]
    with pytest.raises(TypeError, match="expected one of") as unknown:
        BattleEnv("3m", colour=2)
    listed = str(unknown.value).split("expected one of ")[1].split(", ")
    assert len(listed) == len(set(listed)) and {"scenario", "rules"} <= set(listed)
    assert not {"self", "num_envs", "autoreset_mode", "fields", "lanes"} & set(listed)
    keys = ["attack_point", "groups", "terrain", "rewards", "smacv2"]
    for name in inspect.signature(sp.make).parameters.keys() - {"battle"} | {*keys}:
        typo = name + "x"
        with pytest.raises(TypeError, match=f"'{typo}'; did you mean `{name}`"):
            sp.make("3m", **{typo: 1})  # type: ignore[call-overload]


def test_files_of_other_kinds_say_what_they_are(tmp_path: Path) -> None:
    """`make("k.smdata")` said "it is not UTF-8 text"."""
    for suffix, expected in (
        ("smdata", "it is a dataset, not a scenario; open it by `smaclite_pool.Dataset`"),
        ("smreplay", "it is a replay, not a scenario; play it by `smaclite-pool replay`"),
        ("snapshot", "it is a snapshot, not a scenario"),
        ("json", "it is not UTF-8 text"),
    ):
        file = tmp_path / f"k.{suffix}"
        file.write_bytes(b"\xff\xfe\x00")
        with pytest.raises(sp.errors.ScenarioError, match=expected):
            sp.make(file, 1)


def test_a_changed_key_is_named_without_a_place_in_a_file_that_the_user_has_not_got() -> None:
    """The error pointed to "scenarios/data/3s5z.json with changed keys:15:38"."""
    with pytest.raises(sp.errors.ScenarioError) as raised:
        sp.make("3s5z", 1, smacv2={"prob_obs_enemy": 2})
    assert "3s5z with changed keys: `smacv2.prob_obs_enemy` is 2" in str(raised.value)
    assert "scenarios/data" not in str(raised.value)
