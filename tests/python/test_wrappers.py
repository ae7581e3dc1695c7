"""Wrappers: what they change, and that they change nothing else."""

from __future__ import annotations

import ast
import dataclasses
import importlib.util
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp
from numpy.typing import ArrayLike, NDArray
from smaclite_pool._native import FIRST_TARGET, NORTH, STOP


class Doubled(sp.extras.Wrapper):
    """Doubles rewards, and counts batches."""

    batches = 0

    def change_batch(self, batch: sp.Batch) -> sp.Batch:
        self.batches += 1
        return batch.replace(reward=2 * batch.reward)


class NorthIsStop(sp.extras.Wrapper):
    """Stops where the policy wants to go north."""

    def change_actions(self, actions: ArrayLike) -> ArrayLike:
        actions = np.asarray(actions)
        return np.where(actions == NORTH, STOP, actions)


class Fewer(sp.extras.Wrapper):
    """Observations are other numbers, and fewer."""

    def change_spec(self, spec: sp.extras.LaneSpec) -> sp.extras.LaneSpec:
        dtype, (m, n_agents, _) = spec.fields["obs"]
        fields = {**spec.fields, "obs": (dtype, (m, n_agents, 5))}
        return dataclasses.replace(spec, obs_size=5, fields=fields)

    def change_batch(self, batch: sp.Batch) -> sp.Batch:
        return batch.replace(obs=100 * batch.obs[..., :5])


def test_what_a_wrapper_makes_has_no_bounds() -> None:
    """Spaces were made from the layout of the environments below it, which failed or was false."""
    gymnasium = pytest.importorskip("smaclite_pool.integrations.gymnasium")
    envs = gymnasium.BattleVectorEnv(Fewer(sp.make("3m", 2)))
    obs, _ = envs.reset(seed=1)
    assert envs.observation_space["obs"].shape == (2, 3, 5) and obs["obs"].max() > 1
    assert envs.observation_space["obs"].contains(obs["obs"])
    envs.close()


def played(envs: sp.Envs | sp.extras.Wrapper, policy: Any) -> list[dict[str, NDArray[Any]]]:
    batch = envs.reset(seed=3)
    copies = [batch.copy()]
    for step in range(30):
        if step % 2:
            batch = envs.step(policy(batch))
        else:
            envs.send(policy(batch))
            batch = envs.recv()
        copies.append(batch.copy())
    return copies


def test_wrappers_change_batches_and_actions_and_nothing_else() -> None:
    def north(batch: sp.Batch) -> NDArray[np.int64]:
        """The first target in reach, else north, else the first available action."""
        available: NDArray[np.bool_] = batch.avail_actions
        actions = np.where(available[:, :, NORTH], NORTH, available.argmax(-1))
        targets = available[:, :, FIRST_TARGET:]
        return np.where(targets.any(-1), FIRST_TARGET + targets.argmax(-1), actions)

    def stop(batch: sp.Batch) -> NDArray[np.int64]:
        actions = north(batch)
        return np.where(actions == NORTH, STOP, actions)

    with sp.make("2s3z", 2) as envs:
        expected = played(envs, stop)
    wrapper = Doubled(NorthIsStop(sp.make("2s3z", 2)))
    with wrapper as same:
        assert len(same) == 2
        changed = played(same, north)
        assert same is wrapper and same.spec.n_agents == 5 and same.batches == 31
        assert repr(same).startswith("<Doubled of <NorthIsStop of <smaclite_pool.Envs 2 x 2s3z")
        assert isinstance(wrapper.unwrapped, sp.Envs)
    with pytest.raises(sp.errors.Closed):
        wrapper.reset()
    assert sum(copy["reward"].sum() for copy in expected) > 0
    for plain, doubled in zip(expected, changed, strict=True):
        assert plain.keys() == doubled.keys()
        for name, array in plain.items():
            np.testing.assert_array_equal(array * 2 if name == "reward" else array, doubled[name])


def test_a_changed_batch_has_the_new_fields_and_all_others() -> None:
    with sp.make("3m", 2) as envs:
        batch = envs.reset(seed=1)
        changed: Any = batch.replace(reward=np.ones(2), bonus=np.zeros(2)).replace(bonus=[1, 1])
        assert changed.keys() == [*batch.keys(), "bonus"]
        assert changed.reward.tolist() == changed.bonus.tolist() == [1, 1]
        assert changed.obs is batch.obs and len(changed) == 2 and changed.sequence == batch.sequence
        assert "number 1 of its lane with other reward, bonus: env_id, obs" in repr(changed)
        with pytest.raises(AttributeError, match="final_obs"):
            changed.final_obs  # noqa: B018
        rollout = sp.extras.Rollout(envs, 1)
        rollout[0] = changed
        assert rollout.reward[0].tolist() == [1, 1]
        wrong: list[tuple[dict[str, Any], type[Exception], str]] = [
            (
                {"reward": np.ones(3)},
                sp.errors.InvalidRequest,
                r"reward must have one row per slot .* 2, got shape \(3,\)",
            ),
            ({"reward": 1.0}, sp.errors.InvalidRequest, r"reward must have one row .* got shape \(\)"),
            ({"keys": np.ones(2)}, sp.errors.InvalidRequest, "`keys` is an attribute of every batch"),
            ({"note": {"a": 1}}, TypeError, "note must be an array of numbers, got dict"),
        ]
        for fields, error, match in wrong:
            with pytest.raises(error, match=match):
                batch.replace(**fields)


def public(value: Any) -> list[str]:
    return [name for name in dir(value) if not name.startswith("_")]


def test_a_changed_batch_is_used_as_any_other() -> None:
    """`torch()` of a changed batch returned the rewards before the change: silently wrong training.

    Every public name and every way to read is compared, by reflection: on a batch whose fields were replaced
    by equal ones, and on one with another reward.
    """
    with sp.make("3m", 2, fields=["obs", "state", "avail_actions", "episode_length"]) as envs:
        envs.reset(seed=1)
        batch = envs.step(envs.sample_actions())
        equal = batch.replace(**{name: array.copy() for name, array in batch.items()})
        other = batch.replace(reward=np.full(2, 7, np.float32))
        assert public(equal) == public(other) == public(batch) and type(other) is sp.Batch
        reads: dict[str, Callable[[Any], Any]] = {
            "dict": dict,
            "copy": lambda b: b.copy(),
            "items": lambda b: dict(b.items()),
            "values": lambda b: dict(zip(b.keys(), b.values(), strict=True)),
            "[]": lambda b: {name: b[name] for name in b.keys()},
            "get": lambda b: {name: b.get(name) for name in b.keys()},
            "attributes": lambda b: {name: getattr(b, name) for name in b.keys()},
            "**": lambda b: dict(**b),
        }
        if importlib.util.find_spec("torch"):
            reads["torch"] = lambda b: {name: tensor.numpy() for name, tensor in b.torch().items()}
        for way, read in reads.items():
            for changed, reward in ((equal, batch.reward), (other, [7, 7])):
                fields = read(changed)
                assert list(fields) == batch.keys(), way
                np.testing.assert_array_equal(fields["reward"], reward, err_msg=way)
                for name in set(fields) - {"reward"}:
                    np.testing.assert_array_equal(fields[name], batch[name], err_msg=way)
        policy = sp.ScriptedPolicy("focus_fire", envs)
        for changed in (equal, other):
            assert len(changed) == len(batch) and changed.sequence == batch.sequence
            assert "reward" in changed and "rewards" not in changed and 3 not in changed
            assert changed.get("rewards") is None and changed.get("rewards", 3) == 3
            with pytest.raises(TypeError, match="a batch is no tuple"):
                iter(changed)
            assert np.array_equal(policy(changed), policy(batch))
            assert np.array_equal(envs.render(changed, 0), envs.render(batch, 0))
            assert str(sp.extras.AgentViews(envs)(changed, 0, 0)) == str(
                sp.extras.AgentViews(envs)(batch, 0, 0)
            )
        # What is replaced is what is read.
        stops = batch.replace(avail_actions=np.eye(9, dtype=bool)[[[STOP] * 3] * 2])
        assert (policy(stops) == STOP).all()
        dark = batch.replace(state=np.zeros_like(batch.state))
        assert (envs.render(dark, 0) != envs.render(batch, 0)).any()


def signature(function: Any) -> list[tuple[str, Any, Any]]:
    parameters = inspect.signature(function).parameters.values()
    return [(p.name, p.kind, p.default) for p in parameters if p.name != "self"]


def test_wrappers_have_the_signatures_of_what_they_wrap() -> None:
    """`reset(levels=)` was missing in `Wrapper`, so curricula could not be wrapped."""
    with sp.make("3m", 2) as envs:
        wrapper = sp.extras.Wrapper(envs)
        for name in public(sp.Envs):
            inner, outer = getattr(envs, name), getattr(wrapper, name)
            if callable(inner):
                assert signature(outer) == signature(inner), name
            else:
                assert outer == inner, name
        assert set(public(wrapper)) - set(public(envs)) == {
            "change_actions",
            "change_batch",
            "change_spec",
            "envs",
            "unwrapped",
        }
        assert {name for name in public(sp.extras.Wrapper) if name in public(sp.Envs)} >= {
            name for name in public(sp.Envs) if "Batch" in str(stub_returns().get(name))
        }


def methods(file: str, name: str) -> dict[str, ast.FunctionDef]:
    """The methods of a class, as they are written in a file of the package."""
    module = ast.parse((Path(sp.__file__).parent / file).read_text())
    [found] = [node for node in module.body if isinstance(node, ast.ClassDef) and node.name == name]
    return {node.name: node for node in found.body if isinstance(node, ast.FunctionDef)}


def stub_returns() -> dict[str, str]:
    """What the methods of `Envs` return, by the stub."""
    stubs = methods("_native.pyi", "Envs").items()
    return {name: ast.unparse(stub.returns) for name, stub in stubs if stub.returns}


def test_wrappers_have_the_types_of_what_they_wrap() -> None:
    """`Wrapper.reset` was typed `seed: int | None`: a list of seeds worked, and a type checker refused it."""
    stubs, wrappers = methods("_native.pyi", "Envs"), methods("_wrapper.py", "Wrapper")
    shared = [name for name in stubs if name in wrappers and not name.startswith("_")]
    assert "reset" in shared
    for name in shared:
        assert ast.unparse(wrappers[name].args) == ast.unparse(stubs[name].args), name
        assert ast.dump(wrappers[name].returns or ast.Pass()) == ast.dump(
            stubs[name].returns or ast.Pass()
        ), name


def test_a_list_of_seeds_goes_through_a_wrapper() -> None:
    with sp.make("3m", 2) as envs, sp.make("3m", 2) as others:
        wrapper = sp.extras.Wrapper(sp.extras.Wrapper(envs))
        for seed in ([7, 7], [7, None], np.array([3, 9]), 5):
            wrapped, plain = wrapper.reset(seed=seed), others.reset(seed=seed)
            assert np.array_equal(wrapped.obs, plain.obs)
            actions = others.sample_actions()
            for _ in range(3):  # the execution orders are drawn
                assert np.array_equal(wrapper.step(actions).obs, others.step(actions).obs)
                actions = others.sample_actions()


def test_levels_and_selections_reach_the_environments_through_a_wrapper() -> None:
    fields = ["obs", "level", "avail_actions"]
    with sp.make("3m", 2, fields=fields) as envs:
        wrapper = sp.extras.Wrapper(envs)
        levels = envs.reset(seed=1).level.copy()
        levels[:, 0, 3] = 0.5
        assert np.array_equal(wrapper.reset(levels=levels).level, levels)
        envs.async_reset(env_id=[1], levels=levels[1:] * [1, 1, 1, 0.5, 1])
        assert envs.recv().level[:, 0, 3].tolist() == [0.5, 0.25]
        envs.async_reset(env_id=[True, False], seed=3)
        assert envs.recv().was_reset.tolist() == [True, True]
        policy = sp.ScriptedPolicy("nearest", sp.make("3m", 2))
        with pytest.raises(TypeError, match="expected Envs or a Wrapper of them, got int"):
            sp.ScriptedPolicy("nearest", 3)  # type: ignore[arg-type]
        assert policy.side == "allies"
    with sp.make("3m", 2) as envs:
        wrapper = sp.extras.Wrapper(sp.extras.Wrapper(envs))
        policy = sp.ScriptedPolicy("nearest", wrapper)
        assert policy(wrapper.reset(seed=1)).shape == (2, 3)
        assert sp.Renderer(wrapper).state_size == envs.spec.state_size
        assert sp.scenario(wrapper)["name"] == "3m"
        assert sp.evaluate(Doubled(envs), policy, 4, seed=1).mean_return > 0


def test_a_wrapper_that_forgets_its_base_class_is_told_so() -> None:
    class Forgetful(sp.extras.Wrapper):
        def __init__(self, envs: sp.Envs) -> None:
            pass

    with sp.make("3m", 1) as envs, pytest.raises(AttributeError, match=r"call super\(\).__init__\(envs\)"):
        Forgetful(envs).reset()
