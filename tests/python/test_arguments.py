"""What a caller's memory and objects can be: every array argument, of every layout, and exceptions inside.

An int32 array of actions at an odd address (a message with a byte before its numbers) was contiguous for
NumPy and not a slice for Rust: the call panicked, and the environments were lost. A Ctrl-C in `__array__` of
a tensor became InvalidRequest, which a learner catches and goes on.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp
from numpy.typing import NDArray

FIELDS = ["obs", "state", "avail_actions", "snapshot", "level"]
N = 4


def same_values(array: NDArray[Any]) -> Iterator[tuple[str, Any]]:
    """Arrays of the same shape and values that lie in memory in other ways."""
    wide = np.zeros(tuple(2 * n for n in array.shape), array.dtype)
    strided = wide[tuple(slice(None, None, 2) for _ in array.shape)]
    strided[...] = array
    backwards = tuple(slice(None, None, -1) for _ in array.shape)
    record = np.zeros(array.shape, [("tag", "u1"), ("x", array.dtype)])
    record["x"] = array
    read_only = array.copy()
    read_only.flags.writeable = False
    yield "plain", array.copy()
    yield "strided", strided
    yield "negative strides", np.ascontiguousarray(array[backwards])[backwards]
    yield "Fortran", np.asfortranarray(array)
    yield (
        "unaligned",
        np.frombuffer(b"x" + array.tobytes(), np.uint8)[1:].view(array.dtype).reshape(array.shape),
    )
    yield "packed record", record["x"]
    yield "read-only", read_only
    if array.dtype != np.uint8:
        yield "big-endian", array.astype(array.dtype.newbyteorder(">"))
        yield "list", array.tolist()
    if array.dtype == np.int32:
        yield "int64", array.astype(np.int64)
        yield "uint16", array.astype(np.uint16)


def other_values(array: NDArray[Any]) -> Iterator[tuple[str, Any]]:
    """What no argument takes, or only by chance."""
    yield "0-d", np.array(1, array.dtype)
    yield "no rows", array[:0]
    yield "one axis more", array[None]
    yield "huge", np.broadcast_to(array[:1], (10**12, *array.shape[1:]))
    yield "broadcast", np.broadcast_to(array[:1], array.shape)
    yield "structured", array.view([("x", array.dtype)])
    yield "object", array.astype(object)
    yield "ragged", [[1], [1, 2]]
    yield "complex", array.astype(complex)
    yield "bool", array.astype(bool)
    yield "float16", array.astype(np.float16)
    yield "text", array.astype(str)
    yield "dates", np.zeros(array.shape, "M8[s]")
    yield "largest integers", np.full(array.shape, 2**63, np.uint64)
    yield "not a number", np.full(array.shape, np.nan, np.float32)
    yield "dict", {"a": 1}
    yield "text itself", "none"
    yield "an object", object()


Call = tuple[str, str, Callable[[Any], Any], NDArray[Any]]


@pytest.fixture(scope="module")
def envs() -> Iterator[sp.Envs]:
    with sp.make("2s3z", N, threads=1, fields=FIELDS, max_held_batches=64) as envs:
        yield envs


def calls(envs: sp.Envs) -> Iterator[Call]:
    """Every array argument: its call, its name, and a valid value."""
    batch = envs.reset(seed=1)
    kept = batch.copy()
    stop = np.where(batch.avail_actions[..., 1], 1, 0).astype(np.int32)
    ids, snapshots = np.arange(N, dtype=np.int32), kept["snapshot"]
    policy, renderer = sp.ScriptedPolicy("nearest", envs), sp.Renderer("2s3z", 64, 64)
    state, fixed = batch.state[0].copy(), sp.make("2s3z", N, threads=1, fields=FIELDS).reset(seed=1)

    def from_start(call: Callable[[Any], Any]) -> Callable[[Any], Any]:
        def restored(value: Any) -> Any:
            envs.reset(snapshots=snapshots)
            return call(value)

        return restored

    def replaced(name: str) -> Callable[[Any], Any]:
        return lambda v: policy(fixed.replace(**{name: v}))

    yield "step", "actions", from_start(envs.step), stop
    yield "step", "env_id", from_start(lambda v: envs.step(stop, v)), ids
    yield "reset", "env_id", lambda v: envs.reset(env_id=v), np.ones(N, bool)
    yield "step", "env_id", from_start(lambda v: envs.step(stop, v)), np.ones(N, bool)
    yield "reset", "env_id", lambda v: envs.reset(env_id=v), ids
    yield "reset", "levels", lambda v: envs.reset(levels=v), kept["level"]
    yield "reset", "snapshots", lambda v: envs.reset(snapshots=v), snapshots
    yield "reset to snapshots", "env_id", lambda v: envs.reset(env_id=v, snapshots=snapshots), ids
    yield "fork", "env_id_from", lambda v: envs.fork(v, ids), ids
    yield "fork", "env_id_to", lambda v: envs.fork(ids, v), ids
    yield "sample_actions", "env_id", lambda v: envs.sample_actions(v), ids
    yield "sample_actions", "out", lambda v: envs.sample_actions(out=v), stop
    yield "ScriptedPolicy", "out", lambda v: policy(fixed, v), stop
    yield "replace and ScriptedPolicy", "state", replaced("state"), kept["state"]
    yield "replace and ScriptedPolicy", "avail_actions", replaced("avail_actions"), kept["avail_actions"]
    yield "render", "env_id", lambda v: envs.render(fixed, v, renderer), ids
    yield "Renderer.render", "state", renderer.render, state
    yield "Renderer.sheet", "states", renderer.sheet, kept["state"]
    yield "Renderer.sheet", "env_id", lambda v: renderer.sheet(kept["state"], v), ids
    yield "snapshot_columns", "snapshot", sp.snapshot_columns, snapshots[0]


def refusal(use: Callable[[Any], Any], value: Any) -> Exception | None:
    """The error of a call; any other exception, such as that of a panic, fails the test."""
    try:
        use(value)
    except (sp.errors.InvalidRequest, sp.errors.IllegalAction, TypeError) as error:
        return error
    return None


def test_arrays_of_any_layout_are_read_or_refused_by_name(envs: sp.Envs) -> None:
    checked = 0
    for call, argument, use, value in calls(envs):
        for layout, array in [*same_values(value), *other_values(value)]:
            error = refusal(use, array)
            # Some name a value in the array: "environment 7", "action 5", "these bytes".
            parts = (argument, "actions", "environment", "level", "bytes", "snapshot")
            named = isinstance(error, sp.errors.IllegalAction) or any(part in str(error) for part in parts)
            assert error is None or named, (call, argument, layout, error)
            is_valid = layout in dict(same_values(value)) and argument != "out"
            assert error is None or not is_valid, (call, argument, layout, error)
            checked += 1
            envs.reset(seed=1)
    assert checked > 19 * 25


def test_what_is_read_from_an_odd_address_is_what_lies_there() -> None:
    with sp.make("3m", N, threads=1, fields=FIELDS) as envs:
        snapshots = envs.reset(seed=1).snapshot.copy()
        actions = envs.sample_actions()
        expected = envs.step(actions).copy()
        for layout, array in same_values(actions):
            envs.reset(snapshots=snapshots)
            batch = envs.step(array)
            assert all(np.array_equal(batch[name], expected[name]) for name in ("obs", "state")), layout
        levels = envs.reset(seed=2).level.copy()
        for layout, array in same_values(levels):
            assert np.array_equal(envs.reset(levels=array).level, levels), layout
    with sp.make("3m", N, batch_size=2, threads=1) as envs:
        for _, array in same_values(np.ones((2, 3), np.int32)):
            envs.async_reset(seed=1)
            envs.send(array, envs.recv().env_id)
            assert len(envs.recv()) == len(envs.recv()) == 2


def test_other_bytes_than_0_and_1_of_a_mask_are_true() -> None:
    with sp.make("3m", 2, threads=1) as envs:
        envs.reset(seed=1)
        envs.step(np.ones((2, 3), np.int32))
        assert envs.reset(env_id=np.frombuffer(b"\x02\x00", np.bool_)).episode_length.tolist() == [0, 1]


class Raises(Sequence[Any]):
    """Every way in which a conversion asks an object, with an exception of its own."""

    def __init__(self, error: BaseException) -> None:
        self.error = error

    def fail(self, *_args: Any, **_options: Any) -> Any:
        raise self.error

    __array__ = __index__ = __float__ = __fspath__ = __iter__ = __int__ = __len__ = __getitem__ = fail


def converted(envs: sp.Envs, snapshots: NDArray[np.uint8]) -> dict[str, Callable[[Any], Any]]:
    batch, stop = envs.reset(seed=1), np.ones((N, 5), np.int32)
    policy, renderer = sp.ScriptedPolicy("nearest", envs), sp.Renderer("2s3z", 64, 64)
    return {
        "actions": envs.step,
        "timeout": lambda v: envs.step(stop, timeout=v),
        "seed": lambda v: envs.reset(seed=v),
        "levels": lambda v: envs.reset(levels=v),
        "snapshots": lambda v: envs.reset(snapshots=v),
        "env_id": lambda v: envs.reset(env_id=v, snapshots=snapshots),
        "env_id_from": lambda v: envs.fork(v, [0]),
        "seed of fork": lambda v: envs.fork([0], [0], seed=v),
        "render": lambda v: envs.render(batch, v),
        "columns": lambda v: envs.render(batch, columns=v),
        "captions": lambda v: envs.render(batch, captions=v),
        "replace": lambda v: batch.replace(reward=v),
        "state": renderer.render,
        "width": lambda v: sp.Renderer("2s3z", v),
        "scenario of Renderer": lambda v: sp.Renderer(v),
        "scenario": sp.scenario,
        "seed of a policy": lambda v: sp.ScriptedPolicy("nearest", envs, seed=v),
        "num_envs": lambda v: sp.make("3m", v),
        "path": sp.make,
        "fields": lambda v: sp.make("3m", 1, fields=v),
        "episode_limit": lambda v: sp.make("3m", 1, episode_limit=v),
        "weight": lambda v: sp.make("3m", 1, opponent={"kite": v}),
        "Recorder": lambda v: sp.Recorder(envs.spec.pool, env_id=v),
        "snapshot_columns": sp.snapshot_columns,
        "timeout of connect": lambda v: sp.connect("none", timeout=v),
        "state of a policy": lambda v: policy(batch.replace(state=v)),
    }


@pytest.mark.parametrize(
    "error", [KeyboardInterrupt(), SystemExit(3), MemoryError(), RuntimeError("CUDA error: illegal address")]
)
def test_exceptions_of_the_callers_own_code_pass_unchanged(envs: sp.Envs, error: BaseException) -> None:
    snapshots = envs.reset(seed=1).snapshot.copy()
    for argument, call in converted(envs, snapshots).items():
        with pytest.raises(type(error)) as raised:
            call(Raises(error))
        assert raised.value is error, argument
        envs.reset(seed=1)


def test_errors_about_the_value_name_the_argument_and_keep_their_cause(envs: sp.Envs) -> None:
    snapshots, cause = envs.reset(seed=1).snapshot.copy(), ValueError("the tensor is on another device")
    for argument in ("actions", "seed", "levels", "snapshots", "env_id", "timeout"):
        with pytest.raises((sp.errors.InvalidRequest, TypeError), match=argument) as raised:
            converted(envs, snapshots)[argument](Raises(cause))
        assert raised.value.__cause__ is cause, argument


def integers(envs: sp.Envs) -> dict[str, Callable[[Any], object]]:
    """Calls of functions in Python, by their arguments: the compiled module checks its own."""
    from smaclite_pool.marl.smac import MultiAgentEnv
    from smaclite_pool.marl.smacv2 import StarCraft2Env

    def agent(value: Any) -> object:
        return sp.extras.AgentViews(envs).describe(envs.reset(), 0, value)

    def smac_env(value: Any) -> None:
        MultiAgentEnv("3m", seed=value).close()

    smac, smacv2 = MultiAgentEnv("3m", seed=1), StarCraft2Env("3m", seed=1)
    return {
        "seed of load_team": lambda v: sp.load_team("3m", seed=v),
        "seed of evaluate": lambda v: sp.evaluate(envs, "random", 2, seed=v, against=all_stop),
        "seed of evaluate, of enemies": lambda v: sp.evaluate(envs, all_stop, 2, seed=v, against="random"),
        "episodes of evaluate": lambda v: sp.evaluate(envs, all_stop, v, against="random"),
        "episodes of evaluate_function": lambda v: sp.extras.evaluate_function("3m", lambda view: "stop", v),
        "steps of Rollout": lambda v: sp.extras.Rollout(envs, v),
        "agent of AgentViews": agent,
        "seed of SMAC": smac_env,
        "seed of SMAC's seed": smac.seed,
        "seed of SMACv2": lambda v: StarCraft2Env("3m", seed=v),
        "seed of SMACv2's seed": smacv2.seed,
    }


def all_stop(batch: sp.Batch) -> NDArray[np.int64]:
    """Stop, or no-op of the dead."""
    return np.where(batch.avail_actions[..., 1], 1, 0)


def test_a_boolean_is_no_integer_to_the_compiled_module(envs: sp.Envs) -> None:
    """`episode_limit=True` made episodes of one step."""
    make: Any = sp.make
    names = ["num_envs", "batch_size", "seed", "threads", "episode_limit", "obs_last_actions", "lanes"]
    calls: dict[str, Callable[[], object]] = {
        name: lambda name=name: make("3m", **{name: True})  # type: ignore[misc]
        for name in names
    }
    calls["seed of reset"] = lambda: envs.reset(seed=True)
    calls["seed of seed_sampler"] = lambda: envs.seed_sampler(True)
    for name, call in calls.items():
        with pytest.raises(TypeError, match=f"^{name.split()[0]} must be an integer.*, got bool"):
            call()


def test_integers_are_named_when_they_are_none() -> None:
    """Errors were those of NumPy and Python: "expected non-negative integer" for `load_team(seed=-1)`; or
    there was none, and 1.5 was 1."""
    wrong: list[Any] = [1.5, "1", [1], True]
    valid: list[Any] = [1, np.int64(1), np.uint8(1), np.array(1)]
    with sp.make("3m", 2, threads=1, sides="both", episode_limit=5) as envs:
        for call, use in integers(envs).items():
            name = call.split()[0]
            for value in wrong:
                with pytest.raises(TypeError) as raised:
                    use(value)
                assert str(raised.value) == f"{name} must be an integer, got {type(value).__name__}", call
            with pytest.raises(sp.errors.InvalidRequest, match=f"^{name} must .*, got -1$"):
                use(-1)
            for value in valid:
                use(value)


@pytest.mark.parametrize("key", ["teams", "start_positions", "rewards", "smacv2"])
def test_keys_of_scenario_files_are_named_when_they_are_no_dict(key: str) -> None:
    wrong: list[Any] = [[], "all_teams", 1]
    for value in wrong:
        with pytest.raises(sp.errors.ScenarioError, match=f"`{key}` is .*, but must be an object"):
            sp.make("3m", **{key: value})


GROUPS = [
    {"x": 12, "y": 16, "faction": "ALLY", "units": {"MARINE": 2, "ZEALOT": 1}},
    {"x": 18, "y": 14, "faction": "ENEMY", "units": {"MARINE": 3}},
]
WALL = ["_" * 24, *["_" * 15 + "X" + "_" * 8] * 10, *["_" * 24] * 13]


@pytest.mark.parametrize(
    "battle",
    [
        {"attack_point": np.array([30, 30])},
        {"groups": GROUPS, "teams": None},
        {"groups": GROUPS, "terrain": WALL, "width": 24, "height": 24, "attack_point": [12, 16]},
        {"rewards": {"reward_win": 50}},
    ],
    ids=["attack point", "groups", "map", "rewards"],
)
def test_keys_given_to_make_are_those_of_a_file(battle: dict[str, Any], tmp_path: Path) -> None:
    file = {
        "name": "3m", "num_allied_units": 3, "num_enemy_units": 3, "terrain_preset": "SIMPLE",
        "attack_point": [9, 16], "num_unit_types": 0, "ally_has_shields": True, "enemy_has_shields": False,
        "groups": [GROUPS[0] | {"units": {"MARINE": 3}}, GROUPS[1]], "rewards": {"reward_defeat": -7},
    }  # fmt: skip
    changed = file | {key: value for key, value in battle.items() if value is not None}
    changed["attack_point"] = np.asarray(changed["attack_point"]).tolist()
    changed["rewards"] = file["rewards"] | battle.get("rewards", {})
    if "terrain" in battle:
        del changed["terrain_preset"]
    paths = [tmp_path / "file.json", tmp_path / "changed.json"]
    for path, scenario in zip(paths, [file, changed], strict=True):
        path.write_text(json.dumps(scenario))
    with (
        sp.make(paths[0], 2, threads=1, rules="starcraft", **battle) as made,
        sp.make(paths[1], 2, threads=1, rules="starcraft") as expected,
        sp.make(paths[0], 2, threads=1, rules="starcraft") as plain,
    ):
        pools = [made, expected, plain]
        batches = [envs.reset(seed=3) for envs in pools]
        assert made.spec.rewards == expected.spec.rewards
        same_as_plain = made.spec.rewards == plain.spec.rewards
        for _ in range(30):
            states = [batch.state.copy() for batch in batches]
            assert np.array_equal(states[0], states[1])
            same_as_plain &= np.array_equal(states[0], states[2])
            batches = [envs.step(all_stop(batch)) for envs, batch in zip(pools, batches, strict=True)]
            assert np.array_equal(batches[0].reward, batches[1].reward)
        assert not same_as_plain


def test_a_mask_selects_environments_wherever_ids_do(envs: sp.Envs) -> None:
    mask = np.arange(N) % 2 == 1
    ids = np.flatnonzero(mask)
    batch = envs.reset(seed=1)
    assert np.array_equal(envs.render(batch, mask), envs.render(batch, ids))
    assert envs.sample_actions(mask).shape == (len(ids), 5)
    stop = np.ones((N, 5), np.int32)
    envs.step(stop)
    state = envs.fork(~mask, mask).state
    assert np.array_equal(state[mask], state[~mask])
    before = envs.step(stop).state.copy()
    assert np.array_equal((envs.reset(env_id=mask).state == before).all(axis=1), ~mask)
    with pytest.raises(
        sp.errors.InvalidRequest, match=r"env_id_to must be a bool array of shape \(4,\), got \(1,"
    ):
        envs.fork(mask, [True])
    with sp.make("2s3z", N, batch_size=2, threads=1) as some:
        some.async_reset(seed=1)
        some.recv(), some.recv()
        some.send(stop[mask], mask)
        assert sorted(some.recv().env_id.tolist()) == ids.tolist()


def test_what_too_few_results_would_answer_is_not_sent() -> None:
    """The step was made, and then refused with the advice to send actions."""
    fields = ["env_id", "episode_length", "was_reset", "snapshot"]
    with sp.make("3m", 4, batch_size=2, threads=1, fields=fields) as envs:
        envs.async_reset(seed=1)
        for _ in range(2):
            envs.recv()
        stop = np.ones((1, 3), np.int32)
        calls: list[Callable[[], object]] = [
            lambda: envs.step(stop, [0]),
            lambda: envs.reset(seed=5, env_id=[0]),
            lambda: envs.fork([1], [0]),
        ]
        for call in calls:
            with pytest.raises(sp.errors.InvalidRequest, match="nothing was sent: .* 1 of the 2 results"):
                call()
        envs.send(stop, [1])
        batch = envs.step(stop, [0])  # with the one that was sent, two are enough
        assert sorted(batch.env_id.tolist()) == [0, 1] and (batch.episode_length == 1).all()
