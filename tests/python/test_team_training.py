"""`sp.train`: its arguments, and how a training is interrupted and continued."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
import smaclite_pool as sp

from conftest import Serve, posix, program
from test_team import SMALL


def test_errors_of_the_program_are_raised(tmp_path: Path) -> None:
    sp.train("3m", tmp_path / "run", steps=500, **SMALL)  # type: ignore[arg-type]
    with pytest.raises(
        sp.errors.InvalidRequest, match="already holds a run; resume it with `smaclite-pool train --resume`"
    ):
        sp.train("3m", tmp_path / "run", steps=100)
    with pytest.raises(sp.errors.InvalidRequest, match="did you mean `3m`|unknown scenario `3mm`"):
        sp.train("3mm", tmp_path / "a", steps=100)
    with pytest.raises(sp.errors.InvalidRequest) as raised:
        sp.train("3m", tmp_path / "b", steps=100, learning_rate=0.1)
    assert str(raised.value) == "unknown keyword `learning_rate` found"  # the usage of a program followed
    with pytest.raises(
        sp.errors.InvalidRequest, match="invalid value '1' for `hidden`: must be a whole number between 2"
    ):
        sp.train("3m", tmp_path / "c", hidden=[1, "x"])
    with pytest.raises(sp.errors.InvalidRequest, match="`league_size` need `opponent` league"):
        sp.train("3m", tmp_path / "d", league_every=5)
    # Keywords stood in the middle of commands.
    with pytest.raises(sp.errors.InvalidRequest) as raised:
        sp.train("3m", tmp_path / "e", pool="nope")
    assert "`smaclite-pool serve SCENARIO:N --name NAME`" in str(raised.value)


@pytest.mark.parametrize("option", ["seeds", "resume", "json"])
def test_options_that_do_not_train_one_team_are_refused_before_the_training(
    option: str, tmp_path: Path
) -> None:
    """With `seeds=3`, three teams were trained to the end, and then none of them was found."""
    with pytest.raises(sp.errors.InvalidRequest, match=f"`{option}` is no option of `train`"):
        sp.train("3m", tmp_path / "run", steps=100, **{option: 3})  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())


def test_as_many_steps_are_trained_as_by_the_program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`train` had a default of its own, half of the program's."""
    found = re.search(r"--steps.*?\[default: (\d+)\]", program("train", "--help").stdout, re.DOTALL)
    assert found

    class Stop(Exception):
        pass

    def stop(_: dict[str, Any], steps: int) -> str:
        raise Stop(steps)

    monkeypatch.setattr("smaclite_pool._training.progress_line", stop)
    with pytest.raises(Stop) as stopped:
        sp.train("3m", tmp_path / "run", **SMALL)  # type: ignore[arg-type]
    config = json.loads((tmp_path / "run/run.json").read_text())["config"]
    assert config["steps"] == stopped.value.args[0] == int(found[1])


def test_progress_is_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One line of the first update was all, so that a complete training looked as if it was aborted."""
    sp.train("3m", tmp_path / "run", steps=2000, seed=1, **SMALL)  # type: ignore[arg-type]
    first, *_, last, end = capsys.readouterr().out.splitlines()
    assert "of 2000 steps" in first and end == "complete"
    assert int(last.split()[0]) >= 2000, last


def test_arguments_are_those_of_python(tmp_path: Path) -> None:
    """Lists were passed as '[32', teams as '<Team', flags as '--zero-sum=True', and a scenario that begins
    with a hyphen was an option."""
    small: dict[str, Any] = {**SMALL, "steps": 500}
    rival = sp.load_team("3m")
    team = sp.train("3m", tmp_path / "a", hidden=[16, 8], opponent=rival, last_actions=4, **small)
    assert team.config["hidden"] == [16, 8] and team.config["enemies"] == {"team": {"folder": "zoo:3m"}}
    team = sp.train("3m", tmp_path / "b", opponent="self", zero_sum=True, evaluate_every=None, **small)
    assert team.config["enemies"]["self_play"]["zero_sum"] is True
    with pytest.raises(sp.errors.InvalidRequest, match="^`--help` is neither a standard scenario"):
        sp.train("--help", tmp_path / "c", steps=500)
    with pytest.raises(sp.errors.InvalidRequest, match="a team with default weights and sampled actions"):
        sp.train("3m", tmp_path / "d", opponent=sp.load_team("3m", greedy=True))


def test_a_team_is_trained_on_a_running_pool(serve: Serve, tmp_path: Path) -> None:
    """The default of `opponent` was an option of the program, which refuses one beside `pool`; and a list of
    lanes was the name of one lane."""
    lanes = ["one=3m:8", "two=3m:4"]
    options = ["--opponent", "hold", "--obs-last-actions", "4", "--threads", "1", "--name", "train"]
    serve(*lanes, *options)
    records: list[dict[str, Any]] = []
    team = sp.train(
        "3m",
        tmp_path / "run",
        pool="train",
        lane=["one", "two"],
        steps=500,
        horizon=32,
        threads=1,
        on_update=records.append,
    )
    assert records[0]["steps"] == pytest.approx(32 * (8 + 4), abs=12)  # without those that were resets
    assert team.settings["opponent"] == {"hold": 1.0}
    with pytest.raises(sp.errors.InvalidRequest, match="`opponent` cannot be used with `pool"):
        sp.train("3m", tmp_path / "other", pool="train", opponent="kite")


LEARNER = """
import signal, sys, time
import smaclite_pool as sp

signal.signal(signal.SIGINT, signal.default_int_handler)  # SIGINT is ignored in background jobs of a script

def show(record):
    print(record["update"], flush=True)
    {on_update}

sp.train("3m", sys.argv[1], steps=10**8, on_update=show, num_envs=8, horizon=16, threads=1)
"""


def updates_logged(run: Path) -> int:
    return len((run / "log.csv").read_text().splitlines()) - 1


def wait_until_idle(run: Path) -> None:
    """Waits until a training, whose updates take milliseconds, has made none for a while."""
    before, seen = -1, updates_logged(run)
    while seen != before:
        time.sleep(0.5)
        before, seen = seen, updates_logged(run)


def continues(run: Path) -> None:
    """Resumes the run for one update, which must be the next one after its log."""
    updates = updates_logged(run)
    done = program("train", "--resume", run, "--steps", updates * 8 * 16 + 1, "--json")
    assert json.loads(done.stdout.splitlines()[0])["update"] == updates + 1, "nothing is made twice"


@pytest.mark.parametrize("on_update", ["pass", "time.sleep(0.01)", "time.sleep(1000)"])
@posix
def test_ctrl_c_in_a_terminal_saves_the_last_update(on_update: str, tmp_path: Path) -> None:
    """A terminal sends Ctrl-C to all processes of its group. The program got it, and again from `train`,
    ended at once by the second, and up to a minute of training was lost. While `on_update` is slow, the
    program waits for a reader of what it prints."""
    run = tmp_path / "run"
    argv = [sys.executable, "-c", LEARNER.format(on_update=on_update), str(run)]
    learner = subprocess.Popen(
        argv, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    assert learner.stdout is not None
    while learner.stdout.readline().strip() != ("1" if "1000" in on_update else "5"):
        pass
    if "1000" in on_update:
        wait_until_idle(run)  # the pipe is full
    os.killpg(learner.pid, signal.SIGINT)
    _, messages = learner.communicate(timeout=100)
    assert "KeyboardInterrupt" in messages and learner.returncode == -signal.SIGINT, messages
    continues(run)


def test_an_exception_of_on_update_saves_the_last_update_and_passes_on(tmp_path: Path) -> None:
    class Stop(Exception):
        pass

    def stop(record: dict[str, Any]) -> None:
        if record["update"] == 3:
            raise Stop

    with pytest.raises(Stop):
        sp.train("3m", tmp_path / "run", steps=10**8, on_update=stop, num_envs=8, horizon=16, threads=1)
    continues(tmp_path / "run")


@posix
def test_many_messages_do_not_stop_a_training(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """They went to a pipe that nothing read before the end: when it was full, both waited without end."""
    real = sys.executable
    chatty = tmp_path / "python"
    chatty.write_text(f"#!/bin/sh\nhead -c 1000000 /dev/zero | tr '\\0' x >&2\nexec {real} \"$@\"\n")
    chatty.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(chatty))
    sp.train("3m", tmp_path / "run", steps=500, **SMALL)  # type: ignore[arg-type]
    assert len(capfd.readouterr().err) >= 1_000_000


@posix
def test_a_training_that_is_ended_from_outside_can_be_continued(tmp_path: Path) -> None:
    run, argv = tmp_path / "run", list[str]()

    def end(_: dict[str, Any]) -> None:
        if not argv:
            found = subprocess.run(
                ["pgrep", "-n", "-P", str(os.getpid()), "-f", "train"],
                capture_output=True,
                text=True,
                check=True,
            )
            argv.extend(found.stdout.split())
            os.kill(int(argv[0]), signal.SIGTERM)

    with pytest.raises(
        sp.errors.PoolError, match=r"signal 15 ended the training; .* --resume .*run` continues"
    ):
        sp.train("3m", run, steps=10**8, on_update=end, num_envs=8, horizon=16, threads=1)
    continues(run)
