"""Embedded pools: their properties, stepping, and the end of an episode."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp

from conftest import REPOSITORY, Serve, posix, run_script


def test_a_batch_has_the_fields_that_the_lane_declares() -> None:
    with sp.make("2s3z", num_envs=3, seed=5) as envs:
        batch = envs.reset()
        assert batch.keys() == list(envs.spec.fields)
        sizes = (3, envs.spec.n_agents, envs.spec.obs_size)
        assert envs.spec.fields["obs"] == (np.dtype("float32"), sizes) and sizes == (3, 5, 80)
        for name, (dtype, shape) in envs.spec.fields.items():
            view = getattr(batch, name)
            assert (view.dtype, view.shape) == (dtype, shape), name
            assert view.flags.c_contiguous and view.ctypes.data % 64 == 0, name
            assert getattr(batch, name) is view, "built once"
        assert len(batch) == 3 and batch.env_id.tolist() == [0, 1, 2]
        assert batch.alive.all() and batch.avail_actions.any(axis=2).all()


def test_the_spec_says_what_the_status_says_and_outlives_the_environments() -> None:
    with sp.make("MMM2", num_envs=2, batch_size=1, seed=9, name="mine", obs_last_actions=2) as envs:
        spec = envs.spec
        status = sp.status("mine")["lanes"][0]
        described: dict[str, Any] = {**status["description"], "fields": spec.fields}
        named = {name for name in dir(spec) if not name.startswith("_")}
        assert {"num_envs", "batch_size", "n_agents", "n_enemies", "n_actions", "obs_size"} <= named
        for name in named & described.keys():
            assert getattr(spec, name) == described[name], name
        assert list(spec.fields) == status["description"]["fields"]
        assert (spec.scenario, spec.lane, spec.pool, spec.seed) == ("MMM2", "MMM2", "mine", 9)
        assert (spec.rules, spec.autoreset_mode, spec.episode_limit) == ("smaclite", "NextStep", 180)
        assert (spec.obs_last_actions, spec.obs_agent_id) == (2, False)
        assert "mine" in sp.pools() and status["learner_pid"] == spec.pid
        for shown in (repr(envs), repr(spec)):
            assert "MMM2" in shown and "mine" in shown
    assert sp.pools() == []
    for copied in (pickle.loads(pickle.dumps(spec)), copy.deepcopy(spec)):
        assert copied == spec and copied.fields == spec.fields and copied.snapshot_size == spec.snapshot_size
    with sp.make("MMM2", num_envs=2, batch_size=1, seed=9, name="mine") as other:
        assert other.spec != spec
    with pytest.raises(AttributeError):
        spec.n_agents = 3  # type: ignore[misc]


def test_a_served_lane_appends_them_too(serve: Serve) -> None:
    serve("2s3z:2", "--name", "own", "--obs-last-actions", "2", "--obs-agent-id")
    with sp.connect("own") as envs:
        assert envs.spec.obs_size == 80 + 2 * envs.spec.n_actions + envs.spec.n_agents
        batch = envs.reset()
        assert np.array_equal(batch.obs[:, :, -5:], [np.eye(5)] * 2)
        sp.ScriptedPolicy("nearest", envs)(batch)


def test_every_standard_scenario_plays() -> None:
    assert [len(sp.scenarios(generated=kind)) for kind in (False, True, None)] == [23, 15, 38]
    for name in sp.scenarios():
        with sp.make(name, num_envs=1) as envs:
            batch = envs.reset(seed=1)
            for _ in range(3):
                batch = envs.step(envs.sample_actions())
            assert np.isfinite(batch.obs).all() and batch.episode_length.tolist() == [3]


def test_a_scenario_file_plays_as_the_scenario() -> None:
    path = REPOSITORY / "scenarios" / "data" / "2s3z.json"
    with sp.make(path, num_envs=2) as ours, sp.make("2s3z", num_envs=2) as standard:
        assert np.array_equal(ours.reset(seed=1).obs, standard.reset(seed=1).obs)


def test_actions_of_any_integer_type_are_the_same_actions() -> None:
    with sp.make("2s3z", num_envs=2) as envs:
        legal = [[1] * 5] * 2
        seen = []
        for actions in (
            legal,
            np.array(legal, np.int32),
            np.array(legal, np.uint8),
            np.array(legal, ">i4"),
            np.asfortranarray(np.array(legal, np.int32)),
            np.array(legal, np.uint64),
        ):
            envs.reset(seed=3)
            seen.append(envs.step(actions).obs.copy())
        assert all(np.array_equal(seen[0], obs) for obs in seen)


def test_the_sampler_draws_every_legal_action_and_no_other() -> None:
    with sp.make("2s3z", num_envs=4) as envs:
        mask = envs.reset(seed=1).avail_actions
        drawn = np.zeros_like(mask)
        out = np.empty((4, 5), np.int32)
        for _ in range(300):
            assert envs.sample_actions(out=out) is out
            np.put_along_axis(drawn, out[:, :, None], True, axis=2)
        assert np.array_equal(drawn, mask)
        envs.seed_sampler(7)
        first = envs.sample_actions()
        envs.seed_sampler(7)
        assert np.array_equal(first, envs.sample_actions())
        assert envs.sample_actions(env_id=[2]).shape == (1, 5)


def stop(batch: sp.Batch) -> Any:
    """Stop, or no-op for dead agents."""
    return np.where(batch.alive, 1, 0)


def test_next_step_autoreset_returns_the_first_observation_a_step_later() -> None:
    with sp.make("2s3z", num_envs=2, episode_limit=3) as envs:
        batch = envs.reset(seed=1)
        for step in range(1, 4):
            batch = envs.step(stop(batch))
            assert batch.truncated.tolist() == [step == 3] * 2
        assert batch.episode_length.tolist() == [3, 3]
        batch = envs.step(np.full((2, 5), 99))  # ignored
        assert not batch.truncated.any() and not batch.reward.any()
        assert batch.episode_length.tolist() == [0, 0] and batch.alive.all()


def test_same_step_autoreset_keeps_the_last_observation() -> None:
    settings: dict[str, Any] = {"num_envs": 2, "episode_limit": 3}
    with sp.make("2s3z", **settings) as later, sp.make("2s3z", autoreset_mode="SameStep", **settings) as same:
        a, b = later.reset(seed=1), same.reset(seed=1)
        for _ in range(3):
            a, b = later.step(stop(a)), same.step(stop(b))
        assert b.truncated.all() and b.episode_length.tolist() == [3, 3]
        assert np.array_equal(a.obs, b.final_obs) and np.array_equal(a.state, b.final_state)
        assert np.array_equal(a.avail_actions, b.final_avail_actions)
        assert np.array_equal(later.step(stop(a)).obs, b.obs)
        with pytest.raises(AttributeError, match='autoreset_mode="SameStep"'):
            _ = a.final_obs


def test_disabled_autoreset_requires_a_masked_reset() -> None:
    with sp.make("2s3z", num_envs=3, episode_limit=2, autoreset_mode="Disabled") as envs:
        batch = envs.reset(seed=1)
        batch = envs.step(stop(batch))
        batch = envs.step(stop(batch))
        assert batch.truncated.all()
        with pytest.raises(sp.errors.InvalidRequest, match="reset it first"):
            envs.step(stop(batch))
        batch = envs.reset(env_id=np.array([True, False, True]))
        assert batch.episode_length.tolist() == [0, 2, 0]
        batch = envs.reset(env_id=[1])
        assert batch.episode_length.tolist() == [0, 0, 0]
        batch = envs.reset(env_id=[True, True, True])
        envs.step(stop(batch))


def test_an_episode_limit_can_be_removed_or_changed() -> None:
    with sp.make("2s3z", 1, episode_limit=None) as envs:
        assert envs.spec.episode_limit is None
    with sp.make("2s3z", 1, episode_limit=7) as envs:
        assert envs.spec.episode_limit == 7


def test_a_lane_includes_only_selected_fields() -> None:
    with sp.make("2s3z", num_envs=2, fields=["obs"]) as envs:
        batch = envs.reset()
        assert batch.keys() == ["env_id", "obs", "reward", "terminated", "truncated", "was_reset"]
        with pytest.raises(AttributeError, match="do not include `state`; add it to `fields`"):
            _ = batch.state
        assert not hasattr(batch, "nonsense")


@pytest.mark.parametrize(
    "doing",
    [
        "envs.step(envs.sample_actions())",
        "sp.make('2s3z', num_envs=2).reset()",
        # Windows removes no file that is mapped; there, the next pool to start removes those of this batch.
        pytest.param("batch = sp.make('2s3z', num_envs=2).reset(); time.sleep(100)", marks=posix),
        "batch = sp.Spectator(envs.spec.pool).latest(); time.sleep(100)",
    ],
)
def test_an_interpreter_that_exits_while_a_daemon_thread_works_leaves_nothing(doing: str) -> None:
    """The exit once closed only idle environments: those of a thread inside `step` left the files of their
    pool until the next start. So did a batch that the thread held. The fixture `runtime_dir` fails this test
    if a file is left."""
    script = f"""
import threading, time
import smaclite_pool as sp
envs = sp.make("2s3z", num_envs=8, threads=2)
envs.reset(seed=1)
def work():
    while True:
        {doing}
threading.Thread(target=work, daemon=True).start()
time.sleep(0.3)
"""
    for _ in range(3):
        done = run_script(script)
        assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("begin", "end", "error"),
    [
        ("", "self.envs.reset()", "Closed"),
        ("", "self.envs.step(self.envs.sample_actions())", "Closed"),
        ("", "self.envs.sample_actions()", "Closed"),
        ("", "self.envs.step('wrong')", "Error"),
        ("", "sp.make('3m', 2)", "Closed"),
        ("", "sp.status(self.envs.spec.pool)", "NoSuchPool"),
        ("self.spectator = sp.Spectator(self.envs.spec.pool)", "self.spectator.latest()", "PoolDied"),
    ],
)
def test_a_call_in_a_destructor_at_the_exit_is_an_error(begin: str, end: str, error: str) -> None:
    """The exception classes were imported when they were first raised. At the exit nothing can be imported
    any more: a Rust panic in the destructor ended the process by SIGABRT."""
    done = run_script(f"""
import smaclite_pool as sp
class Held:
    def __init__(self):
        self.envs = sp.make("3m", 2)
        self.batch = self.envs.reset()
        {begin or "pass"}
    def __del__(self):
        {end}
held = Held()  # a global: freed when modules are gone
""")
    assert done.returncode == 0, done.stderr
    assert f"{error}:" in done.stderr and "panic" not in done.stderr, done.stderr


@pytest.mark.parametrize("batch_size", [6, 4])
def test_the_status_counts_what_the_learner_received(batch_size: int) -> None:
    with sp.make("3m", 6, batch_size=batch_size, autoreset_mode="SameStep", threads=2) as envs:
        returns: list[float] = []
        batch, steps, wins, lengths = envs.reset(seed=3), 0, 0, 0
        while len(returns) < 40:
            envs.send(envs.sample_actions(env_id=batch.env_id), env_id=batch.env_id)
            batch = envs.recv()
            steps += len(batch.env_id)
            ended = batch.terminated | batch.truncated
            returns += batch.episode_return[ended].tolist()
            wins += int(batch.battle_won[ended].sum())
            lengths += int(batch.episode_length[ended].sum())
        if batch_size < 6:
            envs.reset()  # waits for the environments that are under way
        stats = sp.status(envs.spec.pool)["lanes"][0]["stats"]
    if batch_size == 6:
        assert (stats["steps"], stats["episodes"], stats["wins"]) == (steps, len(returns), wins)
        assert stats["returns"] == pytest.approx(sum(returns), abs=1e-3)
        assert stats["lengths"] == lengths
    else:
        assert stats["episodes"] >= len(returns) and stats["returns"] >= sum(returns) - 1e-3
