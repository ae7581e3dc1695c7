"""What learners in Python use besides batches: `was_reset`, rollouts, evaluation, wrappers and lanes."""

from __future__ import annotations

import ast
import dataclasses
import importlib.util
import inspect
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp
from numpy.typing import ArrayLike, NDArray
from smaclite_pool._native import FIRST_TARGET, NO_OP, NORTH, STOP

from conftest import changed_scenario, each_case, replayed
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


def first_episodes(policy: str, counts: list[int], seed: int) -> list[tuple[float, int, bool]]:
    """Returns, lengths and victories, played one environment after the other."""
    episodes = []
    for env, count in enumerate(counts):
        with sp.make("MMM", 1, autoreset_mode="Disabled") as envs:
            chosen = sp.ScriptedPolicy(policy, envs)  # type: ignore[arg-type]
            for number in range(count):
                batch = envs.reset(seed=seed + env) if number == 0 else envs.reset()
                while not (batch.terminated[0] or batch.truncated[0]):
                    batch = envs.step(chosen(batch))
                length, won = int(batch.episode_length[0]), bool(batch.battle_won[0])
                episodes.append((float(batch.episode_return[0]), length, won))
    return episodes


def test_an_evaluation_counts_the_first_episodes_of_every_environment() -> None:
    """The same episodes, however the environments are stepped: none is preferred for being short."""
    expected = first_episodes("nearest", [3, 3, 2, 2], seed=7)
    assert len({length for _, length, _ in expected}) > 1
    modes: list[dict[str, Any]] = [{}, {"autoreset_mode": "SameStep"}, {"batch_size": 1}, {"batch_size": 3}]
    for mode in modes:
        with sp.make("MMM", 4, **mode) as envs:
            result = sp.evaluate(envs, sp.ScriptedPolicy("nearest", envs), 10, seed=7)
        assert result.env_id.tolist() == [0, 0, 0, 1, 1, 1, 2, 2, 3, 3]
        episodes = zip(result.returns.tolist(), result.lengths.tolist(), result.won.tolist(), strict=True)
        assert list(episodes) == expected
        assert len(result) == 10 and result.win_rate == result.won.mean()
        assert result.mean_return == pytest.approx(result.returns.mean())
        assert result.mean_length == result.lengths.mean()


def test_who_has_won_if_the_last_units_die_together(tmp_path: Path) -> None:
    """With SMACv2's interface it was a defeat, and against a trained team of a lane a victory."""
    groups = [
        {"x": x, "y": 16, "faction": faction, "units": {"BANELING": 1}}
        for x, faction in [(15, "ALLY"), (17, "ENEMY")]
    ]
    sizes = {"num_allied_units": 1, "num_enemy_units": 1}
    path = changed_scenario(tmp_path, "3m", groups=groups, attack_point=[15, 16], **sizes)

    def rates(against: Any = None, **options: Any) -> tuple[float, float, float]:
        with sp.make(path, 2, seed=1, **options) as envs:
            result = sp.evaluate(envs, "nearest", 4, seed=1, against=against)
            return result.win_rate, result.draw_rate, result.loss_rate

    assert rates() == (1, 0, 0)
    assert rates(smacv2={}) == (0, 1, 0)
    assert rates(sides="both", against="nearest") == (0, 1, 0)
    assert rates(opponent="zoo:all-maps") == (0, 1, 0)
    # Where a team takes turns with a script, the script's episodes were draws, too.
    needed = ["obs", "state", "avail_actions", "alive", "battle_won", "dead_allies", "dead_enemies"]
    fields = [*needed, "episode_return", "episode_length", "opponent"]
    turns: dict[str, Any] = {"opponent": {"zoo:all-maps": 1, "attack_move": 1}}
    for mode in ("NextStep", "SameStep"):
        won, drawn, lost = rates(**turns, fields=fields, autoreset_mode=mode)
        assert won > 0 and drawn > 0 and lost == 0
    with pytest.raises(AttributeError, match="opponent"):
        rates(**turns)


def test_errors_of_an_evaluation() -> None:
    with sp.make("3m", 2, autoreset_mode="Disabled") as envs:
        policy = sp.ScriptedPolicy("nearest", envs)
        with pytest.raises(sp.errors.InvalidRequest, match="episodes must be at least 1, got 0"):
            sp.evaluate(envs, policy, 0)
        with pytest.raises(sp.errors.InvalidRequest, match='needs autoreset_mode="NextStep" or "SameStep"'):
            sp.evaluate(envs, policy, 1)
    # A list was taken with a function, and refused with the name of a script.
    wrong: Any = [1, 2]
    with sp.make("3m", 2) as envs, pytest.raises(TypeError, match="seed must be an integer, got list"):
        sp.evaluate(envs, lambda batch: batch.avail_actions.argmax(-1), 1, seed=wrong)
    with sp.make("3m", 2) as envs, pytest.raises(sp.errors.IllegalAction, match="agent 0: action 0"):
        sp.evaluate(envs, lambda batch: np.full((len(batch), 3), NO_OP), 1)


def stop_or_no_op(batch: Any) -> Any:
    return np.where(batch.avail_actions[..., STOP], STOP, NO_OP)


@pytest.mark.parametrize("published", [False, True])
def test_nobody_loses_at_the_limit(published: bool) -> None:
    """SMACv2's published code terminates episodes at their limit, which counted as defeats."""
    with sp.make("protoss_5_vs_5", 8, episode_limit=5, smacv2={"published": published}) as envs:
        result = sp.evaluate(envs, stop_or_no_op, 16, seed=1)
        assert (result.win_rate, result.loss_rate, result.draw_rate) == (0, 0, 1)
    with sp.make("protoss_5_vs_5", 8, smacv2={"published": published}) as envs:
        assert sp.evaluate(envs, stop_or_no_op, 16, seed=1).loss_rate == 1


def test_the_agents_lose_with_the_last_enemies_where_units_can_be_healers() -> None:
    """Such episodes counted as draws, and their rewards were those of a defeat."""
    banelings = {"distribution": "fixed", "teams": [["BANELING", "BANELING"], ["BANELING", "MEDIVAC"]]}
    starts = {"distribution": "uniform", "allies": [15, 15, 16, 16], "enemies": [17, 15, 18, 16]}
    keys: dict[str, Any] = {
        "num_allied_units": 2,
        "num_enemy_units": 2,
        "teams": banelings,
        "start_positions": starts,
        "num_unit_types": 2,
        "unit_type_ids": {"BANELING": 0, "MEDIVAC": 1},
    }
    ended: set[tuple[bool, float]] = set()

    def attack(batch: Any) -> Any:
        for slot in np.flatnonzero(batch.terminated & (batch.dead_allies == 2) & (batch.dead_enemies == 2)):
            ended.add((bool(batch.battle_won[slot]), round(float(batch.reward[slot]), 2)))
        mask = batch.avail_actions
        return mask.shape[-1] - 1 - mask[..., ::-1].argmax(-1)

    with sp.make("terran_5_vs_5", 8, smacv2={}, rewards={"reward_sparse": True}, **keys) as envs:
        result = sp.evaluate(envs, attack, 80, seed=1)
    assert ended and all(not won and reward < 0 for won, reward in ended)
    assert result.draw_rate == 0


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


def test_two_policies_are_evaluated_against_each_other() -> None:
    """What shoots beats what does not from either side, and two that do not shoot draw."""
    with sp.make("3s_vs_4z", 8, sides="both", episode_limit=150) as envs:

        def idle(batch: sp.Batch) -> NDArray[np.int64]:
            """Stop, or no-op of the dead."""
            return np.where(batch.avail_actions[..., STOP], STOP, NO_OP)

        drawn = sp.evaluate(envs, idle, 8, seed=1, against=idle)
        assert (drawn.draw_rate, drawn.win_rate, drawn.loss_rate) == (1, 0, 0)
        lost = sp.evaluate(envs, idle, 8, seed=1, against="nearest")
        assert lost.loss_rate == 1 and lost.lost.all() and not lost.won.any()
        won = sp.evaluate(envs, "nearest", 8, seed=1, against=idle)
        assert won.win_rate == 1 and won.draw_rate == 0
        scripts = sp.ScriptedPolicy("nearest", envs, side="enemies")
        same = sp.evaluate(envs, idle, 8, seed=1, against=scripts)
        assert np.array_equal(same.returns, lost.returns)
        joint = sp.evaluate(envs, lambda b: np.concatenate([idle(b), scripts(b)], axis=1), 8, seed=1)
        assert np.array_equal(joint.returns, lost.returns)


def test_mistakes_in_a_call_of_evaluate_say_what_is_meant() -> None:
    evaluate: Any = sp.evaluate
    with sp.make("3m", 2) as envs, sp.make("3m", 2, sides="both") as both:
        policy = sp.ScriptedPolicy("nearest", envs)
        assert len(evaluate(envs, "nearest", 2, seed=1)) == 2
        of_enemies, allies = sp.load_team("3m", side="enemies"), sp.ScriptedPolicy("nearest", both)
        cases: dict[type[Exception], list[tuple[str, Any]]] = {
            TypeError: [
                (r"the environments come first: evaluate\(envs, policy", lambda: evaluate(policy, envs, 2)),
                ("'n_episodes'; did you mean 'episodes'?", lambda: evaluate(envs, policy, n_episodes=2)),
                ("policy must be a function from a batch .* got int", lambda: evaluate(envs, 3, 2)),
            ],
            sp.errors.InvalidRequest: [
                ("unknown policy `neares`; .*did you mean `nearest`", lambda: evaluate(envs, "neares", 2)),
                (
                    r"against needs environments .* make\(..., sides=\"both\"\)",
                    lambda: evaluate(envs, policy, 2, against=policy),
                ),
                (
                    r'against must be a ScriptedPolicy\(..., side="enemies"\)',
                    lambda: evaluate(both, policy, 2, against=allies),
                ),
                ('policy must be a team .* side="enemies"', lambda: evaluate(envs, of_enemies, 2)),
                (
                    r'side must be `allies` .* make\(..., sides="both"\)',
                    lambda: sp.ScriptedPolicy("kite", envs, side="enemies"),
                ),
            ],
        }
        for error, match, call in each_case(cases):
            with pytest.raises(error, match=match):
                call()
        for alone in (policy, "nearest", lambda batch: np.ones((2, 3), int)):
            with pytest.raises(sp.errors.InvalidRequest, match=r"pass the policy of the enemies as against="):
                evaluate(both, alone, 2)
    assert list(inspect.signature(evaluate).parameters) == ["envs", "policy", "episodes", "seed", "against"]


def test_a_wrapper_that_forgets_its_base_class_is_told_so() -> None:
    class Forgetful(sp.extras.Wrapper):
        def __init__(self, envs: sp.Envs) -> None:
            pass

    with sp.make("3m", 1) as envs, pytest.raises(AttributeError, match=r"call super\(\).__init__\(envs\)"):
        Forgetful(envs).reset()


def test_lanes_divide_the_environments_of_one_pool(tmp_path: Path) -> None:
    """Together they play what one lane plays, and one worker thread steps them all."""
    path = tmp_path / "first.smreplay"
    with sp.make("2s3z", 5, seed=11) as whole:
        first, second = sp.make("2s3z", 5, seed=11, lanes=2, threads=1, record=path)
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
        assert replayed(path)
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
