"""What learners in Python use besides batches: `was_reset`, rollouts, evaluation, wrappers and lanes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp
from numpy.typing import ArrayLike, NDArray
from smaclite_pool._native import FIRST_TARGET, NO_OP, NORTH, STOP

from conftest import replayed
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
    with sp.make("3m", 2, episode_limit=3, autoreset="same_step") as envs:
        assert envs.reset().was_reset.all()
        assert not any(envs.step(envs.sample_actions()).was_reset.any() for _ in range(10))
    with sp.make("3m", 1, fields=["obs"]) as envs:
        assert envs.reset().was_reset.all()


def test_a_rollout_holds_copies_of_consecutive_batches() -> None:
    with sp.make("3m", 3) as envs:
        rollout = sp.Rollout(envs, 6)
        rollout[0] = batch = envs.reset(seed=1)
        copies = [batch.copy()]
        for t in range(6):
            rollout[t + 1] = batch = envs.step(envs.sample_actions())
            copies.append(batch.copy())
        assert set(rollout.arrays) == set(copies[0])
        for name, array in rollout.arrays.items():
            np.testing.assert_array_equal(array, np.stack([copy[name] for copy in copies]))
            assert array.flags.c_contiguous and getattr(rollout, name) is array
        assert rollout.obs.shape == (7, 3, envs.n_agents, envs.obs_size)
        with pytest.raises(IndexError, match="row 7 of a rollout with rows 0 to 6"):
            rollout[7] = batch
        with pytest.raises(AttributeError, match="no field 'final_obs'; it has env_id, obs"):
            rollout.final_obs  # noqa: B018
        small = sp.Rollout(envs, 1, ["reward"])
        assert list(small.arrays) == ["reward", "was_reset"]
        with pytest.raises(sp.InvalidRequest, match="among env_id, obs, .*, got 'rewards'"):
            sp.Rollout(envs, 1, ["rewards"])
        with pytest.raises(sp.InvalidRequest, match="steps must be at least 1, got 0"):
            sp.Rollout(envs, 0)
    with sp.make("3m", 4, batch_size=2) as envs:
        with pytest.raises(
            sp.InvalidRequest, match="batch_size must be num_envs=4, got 2"
        ):
            sp.Rollout(envs, 5)


def first_episodes(policy: str, counts: list[int], seed: int) -> list[tuple[float, int, bool]]:
    """Returns, lengths and victories, played one environment after the other."""
    episodes = []
    for env, count in enumerate(counts):
        with sp.make("MMM", 1, autoreset="disabled") as envs:
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
    modes: list[dict[str, Any]] = [{}, {"autoreset": "same_step"}, {"batch_size": 1}, {"batch_size": 3}]
    for mode in modes:
        with sp.make("MMM", 4, **mode) as envs:
            result = sp.evaluate(envs, sp.ScriptedPolicy("nearest", envs), 10, seed=7)
        assert result.env_id.tolist() == [0, 0, 0, 1, 1, 1, 2, 2, 3, 3]
        episodes = zip(result.returns.tolist(), result.lengths.tolist(), result.won.tolist(), strict=True)
        assert list(episodes) == expected
        assert len(result) == 10 and result.win_rate == result.won.mean()
        assert result.mean_return == pytest.approx(result.returns.mean())
        assert result.mean_length == result.lengths.mean()


def test_errors_of_an_evaluation() -> None:
    with sp.make("3m", 2, autoreset="disabled") as envs:
        policy = sp.ScriptedPolicy("nearest", envs)
        with pytest.raises(sp.InvalidRequest, match="episodes must be at least 1, got 0"):
            sp.evaluate(envs, policy, 0)
        with pytest.raises(sp.InvalidRequest, match='needs autoreset="next_step" or "same_step"'):
            sp.evaluate(envs, policy, 1)
    with sp.make("3m", 2) as envs, pytest.raises(sp.IllegalAction, match="agent 0: action 0"):
        sp.evaluate(envs, lambda batch: np.full((len(batch), 3), NO_OP), 1)


class Doubled(sp.Wrapper):
    """Doubles rewards, and counts batches."""

    batches = 0

    def change_batch(self, batch: sp.Batch | sp.ChangedBatch) -> sp.ChangedBatch:
        self.batches += 1
        return batch.replace(reward=2 * batch.reward)


class NorthIsStop(sp.Wrapper):
    """Stops where the policy wants to go north."""

    def change_actions(self, actions: ArrayLike) -> ArrayLike:
        actions = np.asarray(actions)
        return np.where(actions == NORTH, STOP, actions)


def played(envs: sp.Envs | sp.Wrapper, policy: Any) -> list[dict[str, NDArray[Any]]]:
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
        changed = played(same, north)
        assert same is wrapper and same.n_agents == 5 and same.batches == 31
        assert repr(same).startswith("<Doubled of <NorthIsStop of <smaclite_pool.Envs 2 x 2s3z")
        assert isinstance(wrapper.unwrapped, sp.Envs)
    with pytest.raises(sp.Closed):
        wrapper.reset()
    assert sum(copy["reward"].sum() for copy in expected) > 0
    for plain, doubled in zip(expected, changed, strict=True):
        assert plain.keys() == doubled.keys()
        for name, array in plain.items():
            np.testing.assert_array_equal(array * 2 if name == "reward" else array, doubled[name])


def test_a_changed_batch_has_the_new_fields_and_all_others() -> None:
    with sp.make("3m", 2) as envs:
        batch = envs.reset(seed=1)
        changed = batch.replace(reward=np.ones(2), bonus=np.zeros(2)).replace(bonus=np.ones(2))
        assert changed.keys() == [*batch.keys(), "bonus"]
        assert changed.reward.tolist() == changed.bonus.tolist() == [1, 1]
        assert changed.obs is batch.obs and len(changed) == 2 and changed.sequence == batch.sequence
        assert "other bonus of <smaclite_pool.ChangedBatch with other reward, bonus" in repr(changed)
        with pytest.raises(AttributeError, match="final_obs"):
            changed.final_obs  # noqa: B018
        rollout = sp.Rollout(envs, 1)
        rollout[0] = changed
        assert rollout.reward[0].tolist() == [1, 1]


def test_a_wrapper_that_forgets_its_base_class_is_told_so() -> None:
    class Forgetful(sp.Wrapper):
        def __init__(self, envs: sp.Envs) -> None:
            pass

    with sp.make("3m", 1) as envs, pytest.raises(AttributeError, match=r"call super\(\).__init__\(envs\)"):
        Forgetful(envs).reset()


def test_lanes_divide_the_environments_of_one_pool(tmp_path: Path) -> None:
    """Together they play what one lane plays, and one worker thread steps them all."""
    path = tmp_path / "first.smreplay"
    with sp.make("2s3z", 5, seed=11) as whole:
        first, second = sp.make("2s3z", 5, seed=11, lanes=2, threads=1, record=path)
        assert (first.num_envs, second.num_envs, second.seed) == (3, 2, 14)
        assert first.name == second.name and first.lane != second.lane
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
        with pytest.raises(sp.InvalidRequest, match=f"lanes must be {text}"):
            sp.make("3m", 4, lanes=lanes)
    with pytest.raises(sp.InvalidRequest, match="between 1 and 64 for 100 environments, got 65"):
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
