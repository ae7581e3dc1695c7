"""A trained team as the opponent of a lane: `opponent="zoo:3m"` or the folder of a run.

Users could let a team play the enemies only by hand, with actions for both sides: `opponent` refused it.
"""

from __future__ import annotations

import json
import shutil
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp

from conftest import Serve, program, recorded, replayed

SEEN = ("obs", "state", "avail_actions", "alive", "reward", "terminated", "truncated", "dead_enemies")
FIELDS = [*SEEN, "battle_won", "episode_return", "episode_length", "dead_allies", "opponent", "snapshot"]

Rows = list[dict[str, Any]]


def rows_of(envs: sp.Envs, batch: sp.Batch, steps: int, *, skip: str = "", rival: Any = None) -> Rows:
    """What a learner sees from a batch on whose agents focus fire; `rival` chooses the enemies' actions."""
    agents = sp.ScriptedPolicy("focus_fire", envs)
    rows = []
    for _ in range(steps):
        rows.append({name: batch[name].copy() for name in SEEN if name != skip})
        actions = agents(batch)
        batch = envs.step(actions if rival is None else np.concatenate([actions, rival(batch)], axis=1))
    return rows


def play(steps: int = 120, *, skip: str = "", **options: Any) -> Rows:
    given: dict[str, Any] = {"num_envs": 6, "opponent": "zoo:3m", "fields": FIELDS} | options
    with sp.make("3m", **given) as envs:
        return rows_of(envs, envs.reset(seed=3), steps, skip=skip)


def assert_equal(ours: Rows, theirs: Rows) -> None:
    assert len(ours) == len(theirs)
    for step, (our, their) in enumerate(zip(ours, theirs, strict=True)):
        for name in our:
            np.testing.assert_array_equal(our[name], their[name], err_msg=f"{name} after {step} steps")


@pytest.fixture
def decided(tmp_path: Path) -> Path:
    """The folder of a team whose most probable action has all the probability: what it draws is what
    `greedy` takes, so actions that are drawn here and there can be compared."""
    folder = tmp_path / "decided"
    program("zoo", "--export", "3m", folder)
    file = folder / "best.safetensors"
    content = file.read_bytes()
    length = int.from_bytes(content[:8], "little")
    header, data = json.loads(content[8 : 8 + length]), bytearray(content[8 + length :])
    header.pop("__metadata__")  # it has the checksum
    for name, tensor in header.items():
        if name.endswith(("2.weight", "2.bias")):
            begin, end = tensor["data_offsets"]
            values = np.frombuffer(data[begin:end], np.float32)
            data[begin:end] = (values * np.float32(1e6)).tobytes()
    text = json.dumps(header).encode()
    file.write_bytes(len(text).to_bytes(8, "little") + text + data)
    return folder


@pytest.mark.parametrize(("own_actions", "threads"), [(4, 1), (4, 3), (0, 2)])
def test_a_team_plays_as_load_team_does(decided: Path, own_actions: int, threads: int) -> None:
    """The agents of the two lanes meet the same enemies, whatever the agents observe of their own actions."""
    rival = sp.load_team(decided, side="enemies", greedy=True)
    assert rival.settings["obs_last_actions"] == 4
    with sp.make("3m", num_envs=6, **rival.settings) as envs:
        by_hand = rows_of(envs, envs.reset(seed=3), 120, rival=rival)
    skip = "" if own_actions == 4 else "obs"
    own: dict[str, Any] = {"threads": threads, "obs_last_actions": own_actions, "skip": skip}
    assert_equal(play(opponent=decided, episode_limit=rival.settings["episode_limit"], **own), by_hand)
    assert any(row["terminated"].any() for row in by_hand)


def test_a_lane_with_a_team_looks_like_any_other() -> None:
    with sp.make("3m", num_envs=2, opponent="zoo:3m") as envs, sp.make("3m", num_envs=2) as usual:
        assert (envs.spec.sides, envs.spec.n_actors, envs.spec.obs_size) == ("allies", 3, usual.spec.obs_size)
        assert set(envs.spec.fields) == set(usual.spec.fields)
        assert envs.spec.opponents == {"learner": 1.0}
        assert envs.spec.opponent_team == "zoo:3m"
        assert usual.spec.opponent_team is None


def test_threads_and_batches_change_no_bit() -> None:
    one = play(threads=1)
    assert_equal(play(threads=3), one)
    with sp.make("3m", 6, opponent="zoo:3m", fields=FIELDS, batch_size=2, threads=2) as envs:
        agents = sp.ScriptedPolicy("focus_fire", envs)
        steps = np.zeros(6, int)
        envs.async_reset(seed=3)
        while steps.min() < len(one):
            batch = envs.recv()
            for slot, env in enumerate(batch.env_id):
                if steps[env] < len(one):
                    for name in SEEN:
                        np.testing.assert_array_equal(batch[name][slot], one[steps[env]][name][env])
                steps[env] += 1
            envs.send(agents(batch), batch.env_id)


def test_snapshots_and_forks_go_on_with_the_same_bits() -> None:
    """A team observes its last four actions, which a snapshot must have even where agents observe none."""
    with sp.make("3m", num_envs=4, opponent="zoo:3m", fields=FIELDS, threads=2) as envs:
        agents = sp.ScriptedPolicy("focus_fire", envs)
        batch = envs.reset(seed=3)
        for _ in range(9):
            batch = envs.step(agents(batch))
        saved = batch.snapshot.copy()
        columns = sp.snapshot_columns(saved[1])
        assert columns["n_past"] == columns["n_known"] == 4
        assert (columns["past_actions"][:, 3:] > 0).any(), "the actions of the enemies"
        np.testing.assert_array_equal(sp.pack_snapshot(columns, envs), saved[1])
        expected = rows_of(envs, batch, 60)
    with sp.make("3m", num_envs=4, opponent="zoo:3m", fields=FIELDS, threads=1) as envs:
        envs.reset(seed=8)
        # What was earned before is not in a snapshot.
        assert_equal(rows_of(envs, envs.reset(snapshots=saved), 60)[1:], expected[1:])
        envs.reset(snapshots=saved)
        for row in rows_of(envs, envs.fork([1, 1, 1], [0, 2, 3]), 60):
            for name in SEEN:
                np.testing.assert_array_equal(row[name], row[name][[1, 1, 1, 1]], err_msg=name)
        envs.reset(snapshots=saved)
        reseeded = rows_of(envs, envs.fork([1, 1, 1], [0, 2, 3], seed=5), 60)
        assert any((row["state"] != row["state"][:1]).any() for row in reseeded), "actions are drawn anew"
    with (
        sp.make("3m", num_envs=4, fields=FIELDS) as usual,
        pytest.raises(
            sp.errors.InvalidRequest, match="`obs_last_actions` 4, and this one has 0 .*a team that plays"
        ),
    ):
        usual.reset()
        usual.reset(snapshots=saved)


def test_a_replay_needs_no_team(decided: Path, tmp_path: Path) -> None:
    file = tmp_path / "battles.smreplay"
    opponent = {str(decided): 3, "kite": 1.0}
    with sp.make("3m", 6, opponent=opponent, fields=FIELDS) as envs, recorded(envs, file):
        rows_of(envs, envs.reset(seed=3), 120)
    shutil.rmtree(decided)
    assert "reproduced" in replayed(file)


def test_a_team_and_scripts_take_turns() -> None:
    with sp.make("3m", 16, opponent={"zoo:3m": 1, "hold": 1}, fields=FIELDS) as envs:
        agents = sp.ScriptedPolicy("focus_fire", envs)
        batch, seen = envs.reset(seed=3), set()
        for _ in range(60):
            seen |= {sp.OPPONENTS[opponent] for opponent in batch.opponent}
            batch = envs.step(agents(batch))
        assert seen == {"learner", "hold"} and envs.spec.opponents == {"learner": 1.0, "hold": 1.0}


def test_a_served_lane_shows_the_same_bits(serve: Serve) -> None:
    serve("3m:6", "--opponent", "zoo:3m", "--fields", ",".join(FIELDS), "--name", "arena", "--threads", "2")
    with sp.connect("arena") as envs:
        assert envs.spec.opponent_team == "zoo:3m"
        assert_equal(rows_of(envs, envs.reset(seed=3), 120), play())
    refused = program("train", "--pool", "arena", "--out", "run", check=False)
    assert refused.returncode == 1 and "a trained team play the enemies in pool `arena`" in refused.stderr


def test_gymnasium_shows_the_same_bits() -> None:
    gymnasium = pytest.importorskip("gymnasium")
    pytest.importorskip("smaclite_pool.integrations.gymnasium")  # registers the names
    vector = gymnasium.make_vec("smaclite_pool/3m-v0", num_envs=6, opponent="zoo:3m")
    with sp.make("3m", 6, opponent="zoo:3m") as envs:
        (seen, _), batch = vector.reset(seed=3), envs.reset(seed=3)
        for _ in range(60):
            np.testing.assert_array_equal(seen["obs"], batch.obs)
            actions = envs.spec.n_actions - 1 - batch.avail_actions[:, :, ::-1].argmax(-1)
            seen, batch = vector.step(actions)[0], envs.step(actions)
    vector.close()


def test_a_team_of_other_rules_is_warned_of() -> None:
    """`serve`, `play` and `evaluate` warned of it, and `make` did not."""
    says = "the team `zoo:3m` was trained with rules smaclite, and the battles have rules starcraft-1"
    with pytest.warns(UserWarning, match=says):
        sp.make("3m", 1, opponent="zoo:3m", rules="starcraft").close()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sp.make("3m", 1, opponent="zoo:3m").close()


@pytest.mark.parametrize(
    ("scenario", "options", "message"),
    [
        ("3m", {"opponent": "zoo:3n"}, "the zoo has no team `3n`; it has 10m_vs_11m, "),
        ("3m", {"opponent": "3m"}, "unknown opponent `3m`; .*; the team of the zoo is `zoo:3m`"),
        ("3m", {"opponent": "no/folder"}, r"`no/folder` is not the folder of a run .*: it has no run\.json"),
        (
            "5m_vs_6m",
            {"opponent": "zoo:5m_vs_6m"},
            "opponent `zoo:5m_vs_6m`: the team was trained in `5m_vs_6m` and plays 5 units .* the enemies of "
            "this scenario are 6 .* whose two sides have equal sizes",
        ),
        ("3s_vs_3z", {"opponent": "zoo:all-maps"}, "it plays them where both sides have the same units"),
        ("8m", {"opponent": {"zoo:3m": 1, "kite": 1}}, "plays 3 units .* the enemies of this scenario are 8"),
        (
            "3m",
            {"opponent": {"zoo:3m": 1, "zoo:8m": 1}},
            "only one trained team .*, got `zoo:3m` and `zoo:8m`",
        ),
        ("3m", {"opponent": {"zoo:3m": 1, "learner": 1}}, "in the place of `learner`, which cannot be named"),
        ("3m", {"opponent": {"zoo:3m": 0}}, "the weight of opponent `zoo:3m` must be a number above 0"),
        ("3m", {"opponent": "zoo:3m", "sides": "both"}, "needs sides `allies`: with both, its actions are"),
        (
            "3m",
            {"opponent": "zoo:3m", "smacv2": {"prob_obs_enemy": 0.5}},
            "opponent `zoo:3m` is a trained team, which cannot play .* a scenario with key `smacv2`",
        ),
    ],
)
def test_what_cannot_play_the_enemies_is_an_error(
    scenario: str, options: dict[str, Any], message: str
) -> None:
    with pytest.raises(sp.errors.InvalidRequest, match=message):
        sp.make(scenario, num_envs=2, **options)


def test_serve_names_the_lane_of_a_team_that_does_not_fit() -> None:
    done = program("serve", "3m:2", "8m:2", "--opponent", "zoo:3m", check=False)
    assert done.returncode == 1 and "lane `8m:2`: opponent `zoo:3m`: the team was trained in" in done.stderr


def test_what_a_path_raises_is_raised() -> None:
    class Path:
        def __fspath__(self) -> str:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sp.make("3m", opponent=Path())
