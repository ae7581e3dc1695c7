"""Snapshots, `restore` and `fork` from Python, and what records or wraps battles that jump."""

from __future__ import annotations

import pickle
import time
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import smaclite_pool as sp
import smaclite_pool.integrations.gymnasium  # registers its ids
from numpy.typing import NDArray
from smaclite_pool.integrations.pettingzoo import parallel_env

from conftest import Serve, each_case, recorded
from test_recorder import episodes

FIELDS = ["obs", "state", "avail_actions", "alive", "episode_return", "episode_length", "snapshot"]


def steps(envs: Any, count: int) -> list[tuple[NDArray[np.int32], dict[str, NDArray[Any]]]]:
    """Plays random actions: what was done, and what came of it."""
    played = []
    for _ in range(count):
        actions = envs.sample_actions()
        played.append((actions, envs.step(actions).copy()))
    return played


def assert_repeats(envs: Any, played: list[tuple[NDArray[np.int32], dict[str, NDArray[Any]]]]) -> None:
    for actions, expected in played:
        batch = envs.step(actions)
        for name, array in expected.items():
            np.testing.assert_array_equal(getattr(batch, name), array, err_msg=name)


def test_battles_go_on_from_a_snapshot_with_the_same_bits(tmp_path: Path) -> None:
    with sp.make("2s3z", 6, fields=FIELDS, episode_limit=20, obs_last_actions=2) as envs:
        batch = envs.reset(seed=1)
        steps(envs, 7)
        batch = envs.step(envs.sample_actions())
        kept = batch.snapshot  # a view, which keeps its batch
        assert kept.shape == (6, envs.spec.snapshot_size) and kept.dtype == np.uint8
        np.save(tmp_path / "kept.npy", kept)
        future = steps(envs, 30)
        batch = envs.reset(snapshots=kept)
        assert batch.was_reset.all() and not batch.reward.any() and (batch.episode_length == 8).all()
        assert_repeats(envs, future)
    for copy in (np.load(tmp_path / "kept.npy"), pickle.loads(pickle.dumps(kept))):
        with sp.make("2s3z", 6, fields=FIELDS, episode_limit=20, obs_last_actions=2, threads=1) as envs:
            envs.reset(seed=77)
            envs.reset(snapshots=copy)
            assert_repeats(envs, future)


def test_copies_have_one_future_until_they_are_reseeded() -> None:
    with sp.make("MMM", 8, fields=FIELDS) as envs:
        envs.reset(seed=1)
        steps(envs, 10)
        batch = envs.fork([0] * 8, range(8))
        for _ in range(12):
            assert (batch.obs == batch.obs[0]).all()
            batch = envs.step(np.repeat(envs.sample_actions()[:1], 8, axis=0))
        batch = envs.fork([0] * 8, range(8), seed=5)
        assert (batch.obs == batch.obs[0]).all()
        seeds = [sp.snapshot_columns(row)["seed"].item() for row in batch.snapshot]
        assert seeds == list(range(5, 13))
        given = [3, None, 2**64 - 1, 3]
        copies = batch.snapshot[[1] * 4]
        for seeded in (
            envs.fork([1] * 4, range(4), seed=given),
            envs.reset(seed=given, env_id=range(4), snapshots=copies),
        ):
            seeds = [sp.snapshot_columns(row)["seed"].item() for row in seeded.snapshot]
            assert seeds == [3, 6, 2**64 - 1, 3, *range(9, 13)]


def test_environments_begin_with_snapshots_as_with_a_reset() -> None:
    """A synchronous lane was first reset by another request, and an asynchronous one refused."""
    with sp.make("terran_5_vs_5", 4, fields=FIELDS, seed=9) as envs:
        batch = envs.reset(seed=1)
        kept = envs.step(envs.sample_actions()).snapshot
        future = steps(envs, 10)
    with sp.make("terran_5_vs_5", 4, fields=FIELDS, seed=9, threads=1) as envs:
        reset = envs.reset().state.copy()
    for batch_size, env_id, match in [
        (4, [2, 2], "environment 2 appears twice"),
        (4, [4], "environment 4 does not exist"),
        (2, [1, 3], "call reset first"),
    ]:
        with sp.make("terran_5_vs_5", 4, batch_size=batch_size, fields=FIELDS, seed=9) as envs:
            with pytest.raises(sp.errors.InvalidRequest, match=match):
                envs.reset(env_id=env_id, snapshots=kept[: len(env_id)])
            with pytest.raises(sp.errors.InvalidRequest, match="environment 0 cannot be restored"):
                envs.reset(snapshots=kept * 0)
            with pytest.raises(sp.errors.InvalidRequest, match="call reset first"):
                envs.step(np.ones((4, 5), np.int32))
            batch = envs.reset(snapshots=kept)
            assert batch.was_reset.all() and (batch.episode_length == 1).all()
            if batch_size == 4:
                assert_repeats(envs, future)
    with sp.make("terran_5_vs_5", 4, fields=FIELDS, seed=9) as envs:
        batch = envs.reset(env_id=[3, 1], snapshots=kept[:2])
        assert batch.episode_length.tolist() == [0, 1, 0, 1] and batch.was_reset.all()
        assert np.array_equal(batch.snapshot[[3, 1]], kept[:2])
        assert np.array_equal(batch.state[[0, 2]], reset[[0, 2]])


def test_an_asynchronous_lane_branches() -> None:
    with sp.make("3m", 6, batch_size=2, threads=2, fields=FIELDS) as envs:
        envs.async_reset(seed=1)
        ready: list[int] = []
        for _ in range(3):
            ready += envs.recv(timeout=60).env_id.tolist()
        envs.async_fork([ready[0], ready[0]], [ready[1], ready[2]])
        batch = envs.recv(timeout=60)
        assert sorted(batch.env_id.tolist()) == sorted(ready[1:3]) and batch.was_reset.all()
        envs.async_reset(env_id=batch.env_id, snapshots=batch.snapshot)
        again = envs.recv(timeout=60)
        order = np.argsort(batch.env_id)
        np.testing.assert_array_equal(again.obs[np.argsort(again.env_id)], batch.obs[order])


@pytest.mark.parametrize("served", [False, True])
def test_an_environment_that_still_works_is_not_copied(served: bool, serve: Serve) -> None:
    """The copy was of the state before or after the step that was not received, or was refused by the next
    `recv`, depending on how far the pool was."""
    if served:
        serve("3m:4", "--name", "busy", "--batch-size", "2", "--threads", "1")
    for wait in (0.0, 0.02):
        with sp.connect("busy", timeout=10) if served else sp.make("3m", 4, batch_size=2, threads=1) as envs:
            envs.async_reset(seed=1)
            for _ in range(2):
                envs.recv()
            envs.send([[1, 1, 1]], [1])
            time.sleep(wait)
            with pytest.raises(sp.errors.InvalidRequest, match="environment 1 still works"):
                envs.async_fork([1, 0], [2, 3])
            envs.async_fork([0], [2])
            assert sorted(envs.recv().env_id.tolist()) == [1, 2]


def test_edited_columns_become_a_snapshot_again() -> None:
    with sp.make("2s3z", 1, fields=FIELDS) as envs:
        envs.reset(seed=1)
        steps(envs, 6)
        snapshot = envs.step(envs.sample_actions()).snapshot[0]
        columns = sp.snapshot_columns(snapshot)
        np.testing.assert_array_equal(sp.pack_snapshot(columns, "2s3z"), snapshot)
        columns["hp"][0] = 3.5
        columns["alive"][9] = False
        batch = envs.reset(snapshots=sp.pack_snapshot(columns, envs))
        found = sp.snapshot_columns(batch.snapshot[0])
        assert found["hp"][0] == 3.5 and not found["alive"][9] and found["neighbour_rank"][9] == -1
        steps(envs, 30)
        for column, value, error in [
            ("hp", -1, "column 'hp' must be between 0 and .* for unit 2, got -1"),
            ("target", 99, "column 'target' must be between -1 and 9 for unit 2, got 99"),
            ("last_action", 11, "column 'last_action' must be below 11 for agent 2"),
        ]:
            columns = sp.snapshot_columns(snapshot)
            columns[column][2] = value
            with pytest.raises(sp.errors.InvalidRequest, match=error):
                sp.pack_snapshot(columns, envs)
        columns = sp.snapshot_columns(snapshot)
        with pytest.raises(
            sp.errors.InvalidRequest, match=r"column `pos` must have shape \[10, 2\], got \[10\]"
        ):
            sp.pack_snapshot({**columns, "pos": columns["hp"]}, envs)
        with pytest.raises(TypeError, match="column `alive` must be of type bool, got float64"):
            sp.pack_snapshot({**columns, "alive": columns["hp"]}, envs)
        with pytest.raises(KeyError, match="there is no column `vel`"):
            sp.pack_snapshot({name: value for name, value in columns.items() if name != "vel"}, envs)
        with pytest.raises(sp.errors.InvalidRequest, match="must be 3, 3 and at most 16, got 5, 5 and 0"):
            sp.pack_snapshot(columns, "3m")


def test_units_of_an_edited_snapshot_attack_the_other_side_and_heal_their_own() -> None:
    """Enemies with targets of their own side shot each other to death."""
    with sp.make("MMM", 1, rules="starcraft", fields=FIELDS) as envs:
        columns = sp.snapshot_columns(envs.reset(seed=1).snapshot[0])
        healer = 0  # the medivac
        for column, unit, target, side in [
            ("target", 11, 12, "the other"),
            ("hit_target", 1, 2, "the other"),
            ("last_attacked", 12, 13, "the other"),
            ("attack_target", healer, 15, "its own"),
        ]:
            edited = {name: value.copy() for name, value in columns.items()}
            edited[column][unit] = target
            error = f"'{column}' must be a unit of {side} side, or -1, for unit {unit}, got {target}"
            with pytest.raises(sp.errors.InvalidRequest, match=error):
                sp.pack_snapshot(edited, envs)
        columns["target"][healer] = 1
        sp.pack_snapshot(columns, envs)


def test_integers_that_do_not_fit_into_a_column_are_refused() -> None:
    """They became others: 2**32 + 1 was 1."""
    with sp.make("3m", 1, fields=FIELDS) as envs:
        columns = sp.snapshot_columns(envs.reset(seed=1).snapshot[0])
        for column, value in [
            ("target", np.full(6, 2**32 + 4)),
            ("last_action", np.array([2**32 + 3] * 3 + [-1] * 3)),
            ("episode_length", np.asarray(2**32 + 7, np.uint64)),
        ]:
            with pytest.raises(sp.errors.InvalidRequest, match=f"column `{column}` must fit into u?int32"):
                sp.pack_snapshot({**columns, column: value}, envs)


def test_a_drawn_unit_gets_a_type_of_another_plane() -> None:
    """It was refused, for columns that were not edited."""
    with sp.make("terran_5_vs_5", 1, fields=FIELDS) as envs:
        types = [unit_type["unit_type"] for unit_type in sp.scenario(envs)["unit_types"]]
        marine, medivac = types.index("MARINE"), types.index("MEDIVAC")
        columns = next(
            columns
            for seed in range(99)
            for columns in [sp.snapshot_columns(envs.reset(seed=seed).snapshot[0])]
            if marine in columns["unit_type"][:5]
        )
        columns["unit_type"][list(columns["unit_type"]).index(marine)] = medivac
        batch = envs.reset(snapshots=sp.pack_snapshot(columns, envs))
        assert list(sp.snapshot_columns(batch.snapshot[0])["unit_type"]) == list(columns["unit_type"])
        steps(envs, 30)


def test_what_flies_at_a_unit_that_was_edited_to_be_dead_earns_nothing() -> None:
    groups = [{"x": 9, "y": 16, "faction": "ALLY", "units": {"STALKER": 2}}]
    groups += [{"x": 16, "y": y, "faction": "ENEMY", "units": {"SPINE_CRAWLER": 1}} for y in (14, 18)]
    keys: dict[str, Any] = {"groups": groups, "num_enemy_units": 2}
    with sp.make("2s_vs_1sc", 1, rules="starcraft", fields=FIELDS, **keys) as envs:
        batch = envs.reset(seed=1)
        while True:  # until a projectile is in the air
            batch = envs.step(np.where(batch.avail_actions[..., 6], 6, 4))
            columns = sp.snapshot_columns(batch.snapshot[0])
            if columns["hits"][:2].any():
                break
        columns["alive"][2] = False  # the enemy that it flies at
        envs.reset(snapshots=sp.pack_snapshot(columns, envs))
        batch = envs.step(np.ones((1, 2), np.int32))
        assert batch.reward[0] == 0 and sp.snapshot_columns(batch.snapshot[0])["hp"][2] == 0


def test_battles_continue_in_environments_that_were_not_reset() -> None:
    with sp.make("3m", 2, seed=0, fields=FIELDS) as envs, sp.make("3m", 2, seed=7, fields=FIELDS) as others:
        kept = envs.reset(seed=1).snapshot
        batch = others.reset(snapshots=kept)
        assert batch.was_reset.all() and np.array_equal(batch.snapshot, kept)
        with sp.make("3m", 2, seed=7) as plain, sp.make("3m", 2, seed=7) as untouched:
            with pytest.raises(sp.errors.InvalidRequest, match="name the field `snapshot`"):
                plain.reset(snapshots=kept)
            first = [each.reset().obs for each in (plain, untouched)]
            assert np.array_equal(first[0], first[1]), "what was refused drew no episode"
        only_one = others.reset(env_id=[False, True], snapshots=kept[0])
        assert np.array_equal(only_one.snapshot, kept[[0, 0]])


def test_wrong_arguments_name_what_is_accepted() -> None:
    envs: Any
    with sp.make("3m", 2, seed=0, fields=FIELDS) as envs, sp.make("3m", 2) as plain:
        snapshots = envs.reset(seed=1).snapshot
        plain.reset()
        cases: dict[type[Exception], list[tuple[str, Any]]] = {
            sp.errors.InvalidRequest: [
                ("name the field `snapshot`", lambda: plain.reset(snapshots=snapshots)),
                ("environment 0 cannot be restored", lambda: envs.reset(snapshots=snapshots * 0)),
                ("take 2 snapshots of", lambda: envs.reset(snapshots=snapshots[:1])),
                # As many bytes, which were once read as rows of other bytes.
                (r"of shape \(2, \d+\), got \(\d+, 2\)", lambda: envs.reset(snapshots=snapshots.T)),
                ("uint8 array of shape", lambda: envs.reset(snapshots=snapshots.reshape(-1))),
                ("environment 5 does not exist", lambda: envs.fork([5], [0])),
                ("appears twice", lambda: envs.fork([0, 1], [1, 1])),
                ("got 2 and 1", lambda: envs.fork([0, 1], [1])),
                ("at least one environment", lambda: envs.fork([], [])),
                (
                    "one per environment of the request, 2; got 3",
                    lambda: envs.reset(seed=[1, 2, 3], snapshots=snapshots),
                ),
                (
                    "levels and snapshots cannot be combined",
                    lambda: envs.reset(levels=np.zeros((2, 6, 5), np.float32), snapshots=snapshots),
                ),
            ],
            TypeError: [
                ("must be a uint8 array", lambda: envs.reset(snapshots=np.zeros((2, 4)))),
                ("or a list with one per environment, got str", lambda: envs.fork([0], [1], seed="3")),
            ],
        }
        for error, text, call in each_case(cases):
            with pytest.raises(error, match=text):
                call()
            assert envs.step(envs.sample_actions()).episode_length[0] > 0, "the lane goes on"


def test_wrappers_and_rollouts_see_branches() -> None:
    class Doubled(sp.extras.Wrapper):
        def change_batch(self, batch: Any) -> Any:
            return batch.replace(obs=2 * batch.obs)

    with Doubled(sp.make("3m", 4, fields=FIELDS)) as envs:
        first = envs.reset(seed=1)
        rollout = sp.extras.Rollout(envs, 3)
        rollout[0] = envs.step(envs.sample_actions())
        rollout[1] = envs.reset(snapshots=first.snapshot)
        np.testing.assert_array_equal(rollout.obs[1], first.obs)
        rollout[2] = envs.fork([0], [3])
        rollout[3] = envs.step(envs.sample_actions())
        assert rollout.was_reset.all(1).tolist() == [False, True, True, False]


def test_recordings_of_battles_that_jump_are_reproduced(tmp_path: Path) -> None:
    """An episode that began with edited health was played again with that of the scenario."""
    path = tmp_path / "jumps.smreplay"
    with sp.make("2s3z", 2, fields=FIELDS, episode_limit=15) as envs, recorded(envs, path):
        snapshots = envs.reset(seed=1).snapshot.copy()
        columns = sp.snapshot_columns(snapshots[0])
        columns["hp"][:] = 5
        weak = sp.pack_snapshot(columns, envs)
        middle = steps(envs, 6)[3][1]["snapshot"]
        batch = envs.reset(snapshots=np.stack([weak, snapshots[1]]))
        steps(envs, 4)
        envs.reset(snapshots=middle)
        steps(envs, 20)
        assert batch.was_reset.all()
    found = episodes(path)  # of environment 0
    assert "recorded for 6 steps" in found[0] and "recorded for 4 steps" in found[1], found
    assert "after 15 steps" in found[2], "it began with step 5"


def test_gymnasium_saves_and_restores() -> None:
    env: Any = gymnasium.make("smaclite_pool/3m-v0").unwrapped
    env.reset(seed=4)
    env.step([1, 1, 1])
    saved = env.save()
    future = [env.step([2, 2, 2]) for _ in range(5)]
    observation, info = env.restore(saved)
    assert info["episode_length"] == 1 and observation["obs"].shape == (
        3,
        env.observation_space["obs"].shape[1],
    )
    for expected, found in zip(future, [env.step([2, 2, 2]) for _ in range(5)], strict=True):
        np.testing.assert_array_equal(found[0]["obs"], expected[0]["obs"])
    env.restore(saved, seed=9)
    env.close()
    fields = ["obs", "state", "avail_actions", "episode_length", "snapshot"]
    envs: Any = gymnasium.make_vec("smaclite_pool/2s3z-v0", 3, fields=fields).unwrapped
    with pytest.raises(sp.errors.InvalidRequest, match="call reset first"):
        envs.save()
    envs.reset(seed=1)
    saved = envs.save()
    ahead = envs.step(np.ones((3, 5), int))[0]
    _, infos = envs.restore(saved)
    assert infos["episode_length"].tolist() == [0] * 3
    np.testing.assert_array_equal(envs.step(np.ones((3, 5), int))[0]["obs"], ahead["obs"])
    _, infos = envs.restore(saved[:1], [2], seed=5)
    assert infos["episode_length"].tolist() == [1, 1, 0]
    envs.close()
    plain: Any = gymnasium.make_vec("smaclite_pool/3m-v0", 1).unwrapped
    with pytest.raises(sp.errors.InvalidRequest, match="name the field `snapshot`"):
        plain.save()
    plain.close()


def test_pettingzoo_saves_and_restores() -> None:
    env = parallel_env("3m")
    env.reset(seed=4)
    saved = env.save()
    actions = {agent: 1 for agent in env.agents}
    ahead = env.step(actions)[0]
    observations, _ = env.restore(saved)
    assert set(observations) == set(env.agents) == set(actions)
    again = env.step(actions)[0]
    for agent in actions:
        np.testing.assert_array_equal(again[agent]["observation"], ahead[agent]["observation"])
    env.close()


def test_a_column_that_snapshots_do_not_have_is_an_error() -> None:
    """`columns["health"] = ...` was accepted and changed nothing: the name is `hp`."""
    with sp.make("3m", 1, fields=["snapshot"]) as envs:
        columns = sp.snapshot_columns(envs.reset(seed=1).snapshot[0])
        for name, hint in (("health", "hp"), ("cooldwn", "cooldown")):
            with pytest.raises(sp.errors.InvalidRequest, match=f"no column `{name}`; did you mean `{hint}`"):
                sp.pack_snapshot(columns | {name: columns["hp"]}, envs)


@pytest.mark.parametrize(
    ("column", "value", "error"),
    [
        ("n_perception", 2**32 - 1, r"column `perception` must have shape \[4294967295\], got \[0\]"),
        ("n_phases", 2**32 - 1, r"column `windup` must have shape \[4294967295\], got \[0\]"),
        ("episode_length", 2**31, "'episode_length' must be at most 2147483647, got 2147483648"),
    ],
)
def test_a_count_that_no_battle_has_is_refused(column: str, value: int, error: str) -> None:
    """Memory for the count was taken before it was checked, which ended the process."""
    with sp.make("3m", 1, fields=["snapshot"]) as envs:
        columns = sp.snapshot_columns(envs.reset(seed=1).snapshot[0])
        wrong = np.array(value, columns[column].dtype)
        with pytest.raises(sp.errors.InvalidRequest, match=error):
            sp.pack_snapshot({**columns, column: wrong}, envs)


def test_the_greatest_episode_length_stays() -> None:
    """The next step was number -2147483648, and its state could not be restored."""
    with sp.make("3m", 1, episode_limit=None, fields=["snapshot", "episode_length"]) as envs:
        columns = sp.snapshot_columns(envs.reset(seed=1).snapshot[0])
        greatest = np.array(2**31 - 1, columns["episode_length"].dtype)
        envs.reset(snapshots=sp.pack_snapshot({**columns, "episode_length": greatest}, envs)[None])
        batch = envs.step(np.ones((1, 3), int))
        assert batch.episode_length.tolist() == [2**31 - 1]
        envs.reset(snapshots=batch.snapshot.copy())


@pytest.mark.parametrize("served", [False, True])
def test_a_refusal_is_told_before_that_nothing_will_come(served: bool, serve: Serve) -> None:
    """`recv` counted results that a refused request would never have, and the environment stayed at work."""
    if served:
        serve("3m:6", "--name", "few", "--batch-size", "2")
    with sp.connect("few") if served else sp.make("3m", 6, batch_size=2) as envs:
        envs.reset(seed=1)
        envs.recv()
        envs.recv()
        for _ in range(2):
            envs.send(np.full((1, 3), 8), [1])
            with pytest.raises(sp.errors.IllegalAction, match="action 8"):
                envs.recv()
        envs.send(np.ones((1, 3), np.int32), [1])
        with pytest.raises(sp.errors.InvalidRequest, match="of the 2 results of a batch, 1 are outstanding"):
            envs.recv(timeout=0.5)
        envs.send(np.ones((1, 3), np.int32), [2])
        assert sorted(envs.recv().env_id) == [1, 2]
