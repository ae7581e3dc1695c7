"""The vector of Gymnasium's integration, beside Gymnasium's own vectors."""

from __future__ import annotations

import copy
import gc
import pickle
import sys
from contextlib import closing
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp

pytest.importorskip("gymnasium")

import gymnasium
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv
from gymnasium.vector.utils import batch_space
from gymnasium.wrappers.vector import RecordEpisodeStatistics
from smaclite_pool._render import Window
from smaclite_pool.integrations.gymnasium import BattleEnv, BattleVectorEnv, make_vector

from conftest import Serve
from test_gymnasium import no_warnings

__all__ = ["no_warnings"]  # a fixture


@pytest.mark.parametrize("mode", [None, "sync", "async"])
def test_gymnasium_makes_a_vector(mode: str | None) -> None:
    envs = gymnasium.make_vec("smaclite_pool/2s3z-v0", num_envs=3, vectorization_mode=mode)
    expected = {None: BattleVectorEnv, "sync": SyncVectorEnv, "async": AsyncVectorEnv}[mode]
    assert isinstance(envs, expected) and isinstance(envs, gymnasium.vector.VectorEnv)
    observations, _ = envs.reset(seed=1)
    assert observations in envs.observation_space
    assert envs.observation_space == batch_space(envs.single_observation_space, 3)
    assert envs.action_space == batch_space(envs.single_action_space, 3)
    observations, rewards, terminated, truncated, infos = envs.step(np.ones((3, 5), np.int64))
    assert observations in envs.observation_space
    assert infos["episode_length"].tolist() == [1, 1, 1]
    assert [array.shape for array in (rewards, terminated, truncated)] == [(3,)] * 3
    assert [array.dtype for array in (rewards, terminated, truncated)] == [np.float64, np.bool_, np.bool_]
    envs.close()


@pytest.mark.parametrize("mode", ["sync", "async"])
def test_a_vector_of_single_battles_can_stop_what_is_unavailable(mode: Any) -> None:
    """Gymnasium makes its action space, which knows no mask."""
    made = gymnasium.make_vec(
        "smaclite_pool/2s3z-v0", 2, vectorization_mode=mode, illegal_actions="stop", episode_limit=9
    )
    with closing(made) as envs:
        envs.action_space.seed(1)
        envs.reset(seed=1)
        ends = sum(envs.step(envs.action_space.sample())[3].sum() for _ in range(30))
    assert ends == 6


def test_a_vector_draws_every_environment() -> None:
    envs: Any = gymnasium.make_vec("smaclite_pool/2s3z-v0", num_envs=3, render_mode="rgb_array")
    assert envs.metadata["render_modes"] == ["human", "rgb_array"] and envs.metadata["render_fps"] == 2
    with pytest.raises(sp.errors.InvalidRequest, match="call reset first"):
        envs.render()
    first_state = envs.reset(seed=1)[0]["state"]
    first = envs.render()
    assert isinstance(first, tuple) and [picture.shape for picture in first] == [(256, 256, 3)] * 3
    assert np.array_equal(first[1], sp.Renderer("2s3z", 256, 256).render(first_state[1]))
    envs.step(np.ones((3, 5), np.int64))
    for before, after in zip(first, envs.render(), strict=True):
        assert not np.array_equal(before, after)
    envs.close()
    with closing(make_vector("2s3z", 1)) as plain:
        plain.reset()
        assert plain.render() is None
    wrong: list[dict[str, Any]] = [{"render_mode": "ansi"}, {"render_speed": 0}]
    for option in wrong:
        with pytest.raises(sp.errors.InvalidRequest, match=f"{next(iter(option))} must be"):
            make_vector("2s3z", 1, **option)
    with pytest.raises(sp.errors.InvalidRequest, match="field `state`, which this lane omits"):
        make_vector("2s3z", 1, render_mode="rgb_array", fields=["obs"])


def test_a_window_shows_every_step_of_a_vector(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[Any] = []
    monkeypatch.setattr(Window, "show", lambda _, picture: shown.append(picture))
    with closing(make_vector("2s3z", 4, render_mode="human")) as envs:
        states = [envs.reset(seed=1)[0]["state"], envs.step(np.ones((4, 5), np.int64))[0]["state"]]
    expected = [sp.Renderer("2s3z", 256, 256).sheet(state) for state in states]
    assert len(shown) == 2 and all(map(np.array_equal, shown, expected))


def first_available(masks: np.ndarray[Any, Any], rng: np.random.Generator) -> np.ndarray[Any, Any]:
    """Available actions from a given generator."""
    actions: np.ndarray[Any, Any] = (rng.random(masks.shape) * masks).argmax(-1)
    return actions


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_it_plays_as_gymnasiums_own_vector_does(mode: AutoresetMode) -> None:
    """Three battles of the pool beside three single ones that Gymnasium combines: the same bits."""
    n_envs, rng = 3, np.random.default_rng(7)
    ours = make_vector("2s3z", n_envs, autoreset_mode=mode, max_episode_steps=40)
    theirs: Any = SyncVectorEnv([lambda: BattleEnv("2s3z", episode_limit=40)] * n_envs, autoreset_mode=mode)
    assert ours.metadata["autoreset_mode"] is mode and ours.autoreset_mode is theirs.autoreset_mode
    seen, _ = ours.reset(seed=11)
    expected, _ = theirs.reset(seed=11)
    episodes = 0
    for _ in range(130):
        np.testing.assert_equal(seen, expected)
        actions = first_available(seen["action_mask"], rng)
        seen, rewards, terminated, truncated, infos = ours.step(actions)
        expected, *rest, expected_infos = theirs.step(actions)
        ours_by_name = {"reward": rewards, "terminated": terminated, "truncated": truncated}
        for (name, got), wanted in zip(ours_by_name.items(), rest, strict=True):
            np.testing.assert_array_equal(got, wanted, err_msg=name)
        ended = terminated | truncated
        episodes += ended.sum()
        if mode is AutoresetMode.SAME_STEP:
            compare_final(infos, expected_infos)
        if mode is AutoresetMode.DISABLED and ended.any():
            seen, _ = ours.reset(options={"reset_mask": ended})
            expected, _ = theirs.reset(options={"reset_mask": ended.copy()})
    assert episodes >= 6
    ours.close()
    theirs.close()


def compare_final(infos: dict[str, Any], expected: dict[str, Any]) -> None:
    assert ("final_obs" in infos) == ("final_obs" in expected)
    if "final_obs" not in infos:
        return
    for key in ("_final_obs", "_final_info"):
        np.testing.assert_array_equal(infos[key], expected[key])
    assert infos["final_obs"].dtype == object
    for env in np.flatnonzero(infos["_final_obs"]):
        np.testing.assert_equal(infos["final_obs"][env], expected["final_obs"][env])
    for env in np.flatnonzero(~infos["_final_obs"]):
        assert infos["final_obs"][env] is None
    for name in ("battle_won", "dead_allies", "dead_enemies", "episode_return", "episode_length"):
        np.testing.assert_array_equal(infos["final_info"][name], expected["final_info"][name])
        np.testing.assert_array_equal(infos["final_info"][f"_{name}"], expected["final_info"][f"_{name}"])


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_record_episode_statistics_agrees(mode: AutoresetMode) -> None:
    if mode is AutoresetMode.SAME_STEP and tuple(map(int, gymnasium.__version__.split(".")[:2])) < (1, 4):
        pytest.skip("this wrapper forgets the first step after a same-step reset before Gymnasium 1.4")
    made = gymnasium.make_vec("smaclite_pool/2s3z-v0", num_envs=4, autoreset_mode=mode.value)
    envs: Any = RecordEpisodeStatistics(made)
    envs.action_space.seed(3)
    envs.reset(seed=2)
    episodes = 0
    for _ in range(200):
        _, _, terminated, truncated, infos = envs.step(envs.action_space.sample())
        ended = terminated | truncated
        if ended.any():
            episodes += ended.sum()
            np.testing.assert_array_equal(infos["_episode"], ended)
            np.testing.assert_allclose(
                infos["episode"]["r"][ended], infos["episode_return"][ended], rtol=1e-5
            )
            np.testing.assert_array_equal(infos["episode"]["l"][ended], infos["episode_length"][ended])
            if mode is AutoresetMode.DISABLED:
                envs.reset(options={"reset_mask": ended})
    assert episodes >= 8
    envs.close()


def test_a_masked_reset_leaves_the_others_alone() -> None:
    with closing(make_vector("2s3z", 3, autoreset_mode="Disabled")) as envs:
        envs.reset(seed=1)
        for _ in range(5):
            before, *_ = envs.step(envs.action_space.sample())
        mask = np.array([False, True, False])
        after, infos = envs.reset(seed=1, options={"reset_mask": mask})
        np.testing.assert_array_equal(after["obs"][~mask], before["obs"][~mask])
        assert infos["_battle_won"].tolist() == mask.tolist()
        assert (after["state"][1] != before["state"][1]).any()
        with pytest.raises(sp.errors.InvalidRequest, match="at least one environment"):
            envs.reset(options={"reset_mask": ~mask & mask})
        for wrong in (mask[:2], mask.astype(int)):
            with pytest.raises(
                sp.errors.InvalidRequest, match=r"'reset_mask'\] must be bool of shape \(3,\)"
            ):
                envs.reset(options={"reset_mask": wrong})
        with pytest.raises(sp.errors.InvalidRequest, match="one per environment, 3; got 1"):
            envs.reset(seed=[5], options={"reset_mask": mask})
        # The number was that among the selected ones.
        with pytest.raises(sp.errors.InvalidRequest, match=r"seed\[2\] must not be negative, got -3"):
            envs.reset(seed=[*range(len(mask) - 1), -3], options={"reset_mask": mask})


def test_arrays_are_copies_unless_copy_is_false() -> None:
    with closing(make_vector("2s3z", 2)) as envs:
        first, _ = envs.reset(seed=1)
        kept = copy.deepcopy(first)
        held = [envs.step(np.ones((2, 5), int))[0] for _ in range(10)]
        assert all(array.flags.writeable for array in first.values())
        np.testing.assert_equal(first, kept)
        assert len(held) == 10
    with closing(make_vector("2s3z", 2, copy=False, max_held_batches=3)) as envs:
        views, _ = envs.reset(seed=1)
        assert not any(array.flags.writeable for array in views.values())
        held = [views]
        with pytest.raises(sp.errors.TooManyBatchesHeld):
            held.extend(envs.step(np.ones((2, 5), int))[0] for _ in range(5))
        assert len(held) == 3


class Doubled(sp.extras.Wrapper):
    def change_batch(self, batch: sp.Batch) -> sp.Batch:
        return batch.replace(reward=2 * batch.reward)


def test_a_vector_that_cannot_be_copied_says_so_once() -> None:
    """A half-made copy was closed, which failed in `__del__`, and a shallow one closed the environments."""
    failed: list[Any] = []
    hook, sys.unraisablehook = sys.unraisablehook, failed.append
    try:
        # Over a wrapper, a shallow copy was one of the wrapper.
        doubled: Any = Doubled(sp.make("3m", 1))
        for envs in (make_vector("3m", 1), BattleVectorEnv(doubled)):
            with closing(envs):
                for make_copy in (copy.deepcopy, copy.copy, pickle.dumps):
                    with pytest.raises(TypeError, match="`fork` copies battles"):
                        make_copy(envs)
                    gc.collect()
                envs.reset()
    finally:
        sys.unraisablehook = hook
    assert failed == []


def test_an_attached_lane_is_a_vector_too(serve: Serve) -> None:
    serve("2s3z:2", "--name", "gym")
    with pytest.raises(sp.errors.InvalidRequest, match="asynchronous"):
        BattleVectorEnv(sp.make("2s3z", 4, batch_size=2))
    envs = BattleVectorEnv(sp.connect("gym"))
    envs.reset(seed=3)
    seen, *_ = envs.step(envs.action_space.sample())
    assert seen["obs"].shape == (2, 5, 80)
    envs.close()


def test_a_vector_continues_from_snapshots_at_a_reset() -> None:
    fields = ["obs", "state", "avail_actions", "episode_length", "snapshot"]
    envs: Any = gymnasium.make_vec("smaclite_pool/3m-v0", num_envs=3, fields=fields)
    wrapped = RecordEpisodeStatistics(envs)
    wrapped.reset(seed=1)
    envs.step(np.ones((3, 3), np.int64))
    snapshots, state = envs.unwrapped.save(), envs.unwrapped._last.state.copy()
    wrapped.step(np.ones((3, 3), np.int64))
    observations, infos = wrapped.reset(options={"snapshot": snapshots})
    assert np.array_equal(observations["state"], state) and infos["episode_length"].tolist() == [1, 1, 1]
    with pytest.raises(sp.errors.InvalidRequest, match="exclude each other"):
        envs.reset(options={"snapshot": snapshots, "reset_mask": [True] * 3})
    envs.reset(options={"snapshot": snapshots}, seed=[1, 1, 3])
    assert [sp.snapshot_columns(row)["seed"].item() for row in envs.unwrapped.save()] == [1, 1, 3]
    wrapped.close()


@pytest.mark.parametrize("mode", [AutoresetMode.SAME_STEP, "SameStep"])
@pytest.mark.parametrize("more", [[], ["final_obs", "episode_length"]])
def test_fields_of_same_step_autoreset_are_added(mode: Any, more: list[str]) -> None:
    """The first end of an episode was an error about a field that the caller had not named."""
    fields = ["obs", "state", "avail_actions", "snapshot", *more]
    options: dict[str, Any] = {"autoreset_mode": mode, "max_episode_steps": 3, "seed": 1}
    with (
        closing(make_vector("3m", 2, fields=fields, **options)) as envs,
        closing(make_vector("3m", 2, **options)) as complete,
    ):
        envs.reset()
        complete.reset()
        for _ in range(3):
            *_, infos = envs.step(np.ones((2, 3), np.int64))
            *_, expected = complete.step(np.ones((2, 3), np.int64))
        np.testing.assert_equal(infos["final_obs"][1], expected["final_obs"][1])
        assert set(infos["final_obs"][1]) == {"obs", "state", "action_mask"}
    with closing(make_vector("3m", 1, fields=["state"], autoreset_mode=mode)) as envs:
        assert set(envs._envs.spec.fields) & {"final_obs", "final_state"} == {"final_state"}
    with pytest.raises(TypeError, match="fields must be a list of strings"):
        make_vector("3m", 1, fields="obs", autoreset_mode=mode)


def test_a_lane_without_the_fields_that_are_needed_is_refused() -> None:
    """They were missed in the first step, or at the first end of an episode."""
    with (
        sp.make("3m", 2, fields=["obs", "state", "final_obs"], autoreset_mode="SameStep") as envs,
        pytest.raises(sp.errors.InvalidRequest, match='"SameStep" needs `final_state` among `fields`'),
    ):
        BattleVectorEnv(envs)
    with pytest.raises(sp.errors.InvalidRequest, match='"stop" needs `avail_actions` among `fields`'):
        make_vector("3m", 2, fields=["obs"], illegal_actions="stop")


def test_seeds_are_a_list_as_for_gymnasiums_vectors() -> None:
    """`reset(seed=[1, 2, 3, 4])` was refused with "Seed must be a python integer"."""
    seeds = [4, 9, None, 4]
    name = "smaclite_pool/terran_5_vs_5-v0"
    theirs = gymnasium.make_vec(name, num_envs=4, vectorization_mode="sync")
    ours = gymnasium.make_vec(name, num_envs=4)
    expected, _ = theirs.reset(seed=seeds)  # type: ignore[arg-type]
    got, _ = ours.reset(seed=seeds)  # type: ignore[arg-type]
    for i in (0, 1, 3):
        assert np.array_equal(got["obs"][i], expected["obs"][i])
    options = {"reset_mask": [False, False, True, True]}
    again, infos = ours.reset(seed=[8, 8, 8, 9], options=options)  # type: ignore[arg-type]
    assert np.array_equal(again["obs"][3], expected["obs"][1]) and not np.array_equal(
        again["obs"][2], got["obs"][2]
    )
    assert np.array_equal(again["obs"][0], got["obs"][0])
    assert infos["_battle_won"].tolist() == [False, False, True, True], "was the list that the caller passed"
    theirs.close()
    ours.close()


def test_np_random_seed_is_that_of_the_battles() -> None:
    """It was a number of 128 bits that played no part, and that `reset` refused."""
    with closing(gymnasium.make_vec("smaclite_pool/3m-v0", num_envs=2, seed=5)) as envs:
        first, _ = envs.reset()
        assert envs.np_random_seed == 5
        again, _ = envs.reset(seed=envs.np_random_seed)
        np.testing.assert_array_equal(first["state"], again["state"])
        seeds: list[Any] = [4, (7, 9)]
        for seed in seeds:
            envs.reset(seed=seed)
            assert envs.np_random_seed == seed
        with pytest.raises(sp.errors.InvalidRequest, match="seed must be at most"):
            envs.reset(seed=1 << 64)
        assert envs.np_random_seed == seeds[-1], "a seed that was refused"
