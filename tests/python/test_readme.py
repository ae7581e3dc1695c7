"""Checks the table of the README, and runs its code and commands."""

import os
import re
import shlex
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from conftest import PROGRAM, REPOSITORY

README = (REPOSITORY / "README.md").read_text()


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.MULTILINE | re.DOTALL)


@pytest.fixture
def environment() -> Iterator[dict[str, str]]:
    """A separate folder of pools; its path is short, as it contains sockets."""
    with tempfile.TemporaryDirectory(prefix="readme-") as folder:
        yield {**os.environ, "SMACLITE_POOL_ROOT": folder}


def run(argv: list[str], environment: dict[str, str]) -> str:
    done = subprocess.run(argv, env=environment, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_first_example_runs(environment: dict[str, str]) -> None:
    printed = run([sys.executable, "-c", blocks("python")[0]], environment)
    assert printed.startswith("(64, 5, "), printed


def test_two_terminals(environment: dict[str, str]) -> None:
    [serve] = [line for block in blocks("sh") for line in block.splitlines() if " serve " in line]
    arguments = shlex.split(serve)[1:]
    with subprocess.Popen([*PROGRAM, *arguments], env=environment, stdout=subprocess.PIPE, text=True) as pool:
        assert pool.stdout is not None
        try:
            assert any("smaclite_pool.connect" in line for line in pool.stdout), "the pool did not start"
            run([sys.executable, "-c", blocks("python")[1]], environment)
        finally:
            pool.send_signal(signal.SIGINT)
            status = pool.wait(timeout=10)
    assert status == 0


def test_the_commands_that_record_and_convert_a_battle(
    environment: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    lines = [line for block in blocks("sh") for line in block.splitlines()]
    commands = [line for line in lines if re.match(r"\S+smaclite-pool (record|replay) ", line)]
    assert len(commands) == 2
    for command in commands:
        run([*PROGRAM, *shlex.split(command)[1:]], environment)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["2s3z.html", "2s3z.smreplay"]


def test_the_commands_that_train_a_team(
    environment: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    lines = [line for block in blocks("sh") for line in block.splitlines()]
    train, evaluate = [line for line in lines if re.match(r"\S+smaclite-pool (train|evaluate) ", line)]
    assert run([*PROGRAM, *shlex.split(train)[1:]], environment).endswith("complete\n")
    printed = run([*PROGRAM, *shlex.split(evaluate)[1:]], environment)
    win_rate = re.search(r"^win rate +([\d.]+) %$", printed, re.MULTILINE)
    assert win_rate, printed
    assert float(win_rate[1]) > 90


def test_the_scenario_file_is_correct(environment: dict[str, str], tmp_path: Path) -> None:
    file = tmp_path / "scenario.json"
    file.write_text(blocks("json")[0])
    assert "2 agents against 3 enemies" in run([*PROGRAM, "check", str(file)], environment)


def test_every_command_of_the_program_is_listed(environment: dict[str, str]) -> None:
    table = re.search(r"^\| commands of .*\n\|[-| ]+\|\n((?:\|.*\n)+)", README, re.MULTILINE)
    assert table
    documented = [
        name for row in table[1].splitlines() for name in re.findall(r"`([\w-]+)`", row.split("|")[1])
    ]
    listed = run([*PROGRAM, "--help"], environment).split("Commands:")[1].split("Options:")[0]
    assert sorted(documented) == sorted({*re.findall(r"^  ([\w-]+)", listed, re.MULTILINE)} - {"help"})


def test_ci_runs_the_test_command() -> None:
    [command] = [line for block in blocks("sh") for line in block.splitlines() if line.endswith("just test")]
    assert f"\n    {command}\n" in (REPOSITORY / ".ci" / "run").read_text()
