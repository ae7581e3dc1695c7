"""Recordings of pools by a `Recorder` and by the command, and what both refuse."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import smaclite_pool as sp
from smaclite_pool.integrations.pettingzoo import parallel_env

from conftest import PROGRAM, Serve, recorded, replayed


def play(envs: sp.Envs, n_steps: int) -> list[tuple[float, int]]:
    """Plays random actions; return and length of the complete episodes of environment 0."""
    ended = []
    for _ in range(n_steps):
        batch = envs.step(envs.sample_actions())
        if batch.terminated[0] or batch.truncated[0]:
            ended.append((batch.episode_return[0].item(), batch.episode_length[0].item()))
    return ended


def episodes(path: Path) -> list[str]:
    """The lines about episodes, all of which are reproduced."""
    lines = [line for line in replayed(path).splitlines() if line.startswith("episode ")]
    assert all("reproduced" in line for line in lines)
    return lines


@pytest.mark.parametrize("autoreset", ["NextStep", "SameStep"])
def test_a_replay_has_the_episodes_of_environment_0(autoreset: Any, tmp_path: Path) -> None:
    path = tmp_path / "train.smreplay"
    with sp.make("2s3z", 3, autoreset_mode=autoreset) as envs, recorded(envs, path):
        envs.seed_sampler(0)
        envs.reset(seed=9)
        ended = play(envs, 200)
    found = episodes(path)
    assert len(ended) >= 2 and len(found) in (len(ended), len(ended) + 1), "the last one is not over"
    for line, (episode_return, length) in zip(found, ended, strict=False):
        assert f"after {length} steps, return {episode_return:.2f}" in line


def test_a_recorder_beside_the_learner_keeps_the_newest_episodes(serve: Serve, tmp_path: Path) -> None:
    serve("2s3z:4", "--name", "train")
    path = tmp_path / "two.smreplay"
    with sp.connect("train") as envs, sp.Recorder("train", env_id=[1, 3], episodes=2) as recorder:
        with pytest.raises(sp.errors.InvalidRequest, match="no episode began"):
            recorder.save(path)
        envs.reset(seed=1)
        play(envs, 400)
        assert recorder.n_complete > 4
        recorder.save(path)
        # Two complete episodes of both environments, and what the present ones have played.
        assert 4 <= len(episodes(path)) <= 6
    with pytest.raises(sp.errors.Closed):
        recorder.save(path)


def test_what_was_recorded_outlives_the_pool(serve: Serve, tmp_path: Path) -> None:
    supervisor = serve("3m:1", "--name", "train")
    recorder = sp.Recorder("train", "3m")
    with sp.connect("train") as envs:
        envs.reset(seed=1)
        ended = play(envs, 100)
    assert recorder.n_complete == len(ended)
    supervisor.terminate()
    supervisor.wait()
    recorder.save(tmp_path / "late.smreplay")
    assert len(episodes(tmp_path / "late.smreplay")) >= len(ended)


def test_the_command_records_a_running_pool(serve: Serve, tmp_path: Path) -> None:
    serve("3m:2", "--name", "train")
    path = tmp_path / "train.smreplay"
    command = [*PROGRAM, "record", "--pool", "train", "--out", str(path)]
    options = ["--env", "0", "--env", "1", "--episodes", "3"]
    with (
        sp.connect("train") as envs,
        subprocess.Popen([*command, *options], stdout=subprocess.PIPE, text=True) as recording,
    ):
        envs.reset(seed=1)
        while recording.poll() is None:
            play(envs, 10)
        assert recording.stdout is not None
        printed = recording.stdout.read()
    assert recording.returncode == 0
    found = episodes(path)
    assert len(found) >= 3 and all("recorded for" not in line for line in found), "complete episodes only"
    assert str(path) in printed and found[0].replace("; reproduced", "") in printed

    wrong = [(["--env", "2"], "env_id must be below 2"), (["--lane", "MMM"], "no lane `MMM`")]
    for options, message in wrong:
        failed = subprocess.run([*command, *options], capture_output=True, text=True, check=False)
        assert failed.returncode == 1 and message in failed.stderr


def test_environments_of_integrations_are_recorded_by_their_name(tmp_path: Path) -> None:
    env: gymnasium.Env[Any, Any] = gymnasium.make(
        "smaclite_pool.integrations.gymnasium:smaclite_pool/2s3z-v0", name="gym"
    )
    parallel = parallel_env("3m", name="parallel")
    with sp.Recorder("gym") as of_env, sp.Recorder("parallel") as of_parallel:
        env.reset(seed=5)
        for _ in range(3):
            env.step(np.ones(5, np.int64))
        of_env.save(tmp_path / "a.smreplay")
        parallel.reset(seed=5)
        parallel.step(dict.fromkeys(parallel.agents, 1))
        of_parallel.save(tmp_path / "b.smreplay")
    env.close()
    parallel.close()
    assert "recorded for 3 steps" in episodes(tmp_path / "a.smreplay")[0]
    assert "recorded for 1 step" in episodes(tmp_path / "b.smreplay")[0]


def test_wrong_arguments_name_what_is_accepted(tmp_path: Path) -> None:
    with pytest.raises(sp.errors.NoSuchPool, match="no pool named `train`"):
        sp.Recorder("train")
    with sp.make("3m", 2) as envs:
        with pytest.raises(sp.errors.ConnectError, match="env_id must be below 2, .* got 2"):
            sp.Recorder(envs.spec.pool, env_id=2)
        with pytest.raises(sp.errors.InvalidRequest, match="episodes must be between 1 and 1000, got 0"):
            sp.Recorder(envs.spec.pool, episodes=0)
        with pytest.raises(sp.errors.InvalidRequest, match="env_id"):
            sp.Recorder(envs.spec.pool, env_id=-1)
        with (
            sp.Recorder(envs.spec.pool) as recorder,
            pytest.raises(sp.errors.InvalidRequest, match=r"\.smreplay"),
        ):
            recorder.save(tmp_path / "a.gif")
        with (
            sp.Recorder(envs.spec.pool) as recorder,
            pytest.raises(sp.errors.InvalidRequest, match="in a folder that exists; there is no"),
        ):
            recorder.save(tmp_path / "none" / "a.smreplay")


def test_what_is_read_too_late_is_counted_and_reported(tmp_path: Path) -> None:
    """Everything that was not read stayed in the pool: gigabytes, with which `save` then failed."""
    path = tmp_path / "late.smreplay"
    with (
        sp.make("27m_vs_30m", 64, episode_limit=1) as envs,
        sp.Recorder(envs.spec.pool, env_id=list(range(64)), episodes=1000) as recorder,
    ):
        envs.reset(seed=1)
        play(envs, 600)
        with pytest.warns(RuntimeWarning, match=r"\d+ episodes are missing in the replay: they were dropped"):
            recorder.save(path)
        # Every second step is one of autoreset.
        assert recorder.n_lost > 1000 and recorder.n_complete > 1000
        assert recorder.n_lost + recorder.n_complete == 64 * 300
        play(envs, 2)
        assert recorder.n_lost + recorder.n_complete == 64 * 301


def test_a_recorder_misses_nothing_that_it_would_not_keep(
    tmp_path: Path, recwarn: pytest.WarningsRecorder
) -> None:
    with (
        sp.make("27m_vs_30m", 64, episode_limit=1) as envs,
        sp.Recorder(envs.spec.pool, env_id=list(range(64)), episodes=3) as recorder,
    ):
        envs.reset(seed=1)
        play(envs, 600)
        recorder.save(tmp_path / "newest.smreplay")
        assert recorder.n_lost > 1000
    assert not [warning for warning in recwarn if issubclass(warning.category, RuntimeWarning)]
