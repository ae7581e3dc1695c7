"""Every cell of the table in docs/reference/cli.md: what is written, and who reads it.

What one part of the program writes was refused by another, or the refusal was no help: "it is not UTF-8 text"
for a replay, ten missing keys for a unit type, an editor for the page of a replay.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import smaclite_pool as sp

from conftest import PROGRAM, REPOSITORY, posix, program

PAGE = REPOSITORY / "docs/reference/cli.md"

FILE = "FILE"
READERS: dict[str, dict[str, list[str]]] = {
    "scenario": {
        "serve": ["serve", FILE, "--name", "files"],
        "train": ["train", FILE, "--steps", "64", "--out", "NEW"],
        "record": ["record", FILE, "--episodes", "1", "--out", "NEW.smreplay"],
        "play": ["play", FILE],
        "bench": ["bench", FILE, "--seconds", "0.01"],
        "make": ["python", "sp.make(FILE, 1).close()"],
        "scenario": ["python", "sp.scenario(FILE)"],
    },
    "check": {"check": ["check", FILE]},
    "show": {"show": ["show", FILE]},
    "edit": {"edit": ["edit", FILE]},
    "record --from": {"record --from": ["record", "--from", FILE, "--out", "NEW.smreplay"]},
    "replay": {"replay": ["replay", FILE]},
    "team": {
        "evaluate": ["evaluate", FILE, "--episodes", "1"],
        "tournament": ["tournament", FILE, "zoo:3m", "--episodes", "1"],
        "exploit": ["exploit", FILE, "--steps", "64", "--seeds", "1"],
        "dataset record": ["dataset", "record", FILE, "--episodes", "1", "--out", "NEW.smdata"],
        "play --against": ["play", "3m", "--against", FILE],
        "train --opponent": ["train", "3m", "--opponent", FILE, "--steps", "64", "--out", "NEW"],
        "evaluate --opponent": ["evaluate", "zoo:3m", "--opponent", FILE, "--episodes", "1"],
        "serve --opponent": ["serve", "3m", "--name", "files", "--opponent", FILE],
        "load_team": ["python", "sp.load_team(FILE)"],
        "make(opponent=)": ["python", "sp.make('3m', 1, opponent=FILE).close()"],
    },
    "run": {
        "train --resume": ["train", "--resume", FILE],
        "report": ["report", FILE, "--out", "NEW"],
        "verify-run": ["verify-run", FILE],
    },
    "dataset": {
        "dataset expand": ["dataset", "expand", FILE, "--out", "NEW"],
        "Dataset": ["python", "sp.Dataset(FILE)"],
    },
}
"""The readers of each column; `python` stands for an expression of the package."""

WRITTEN = {
    "scenario file": "scenario.json",
    "generated scenario": "generated.json",
    "unit file": "unit.json",
    "replay": "battle.smreplay",
    "snapshot": "step.snapshot",
    "folder of a run": "run",
    "its description": "run/run.json",
    "its weights": "run/weights.safetensors",
    "dataset": "data.smdata",
    "folder of its arrays": "arrays",
    "page of a replay": "battle.html",
    "folder of a report": "report",
    "folder of a tournament": "tournament",
}
"""The rows by how they begin, and the file of each that the fixture writes."""

RUNNER = """
import json, os, sys
import smaclite_pool as sp
from smaclite_pool._native import run_program

def read(argv):
    if argv[0] != "python":
        return run_program(["smaclite-pool", *argv])
    try:
        eval(argv[1].replace("FILE", repr(argv[2])))
        return 0
    except Exception as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        return 1

results = []
for argv in json.load(sys.stdin):
    with open("OUTPUT", "w+") as output:
        if (child := os.fork()) == 0:
            for number in (1, 2):
                os.dup2(output.fileno(), number)
            os._exit(read(argv))
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        output.seek(0)
        results.append([status, output.read()])
print(json.dumps(results))
"""
"""Runs readers that refuse a file, one after the other: importing the package takes longer than a refusal.
They start no pool, which a forked process could not."""


class Result(NamedTuple):
    status: int
    output: str


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what is written."""
    folder = tmp_path_factory.mktemp("files")
    commands = [
        "new scenario scenario.json",
        "new scenario generated.json --generated --agents 2xMARINE,1xMEDIVAC",
        "new unit unit.json",
        "record 3m --episodes 1 --out battle.smreplay",
        "replay battle.smreplay --to battle.html",
        "replay battle.smreplay --to step.snapshot --step 5",
        "train 3m --steps 2000 --evaluate-every 2000 --seed 1 --out run",
        "dataset record kite --scenario 3m --episodes 2 --out data.smdata",
        "dataset expand data.smdata --out arrays",
        "report run --out report",
        "tournament hold line --scenario 3m --episodes 2 --out tournament",
    ]
    for command in commands:
        program(*command.split(), cwd=folder)
    return folder


def command(name: str, reader: str, folder: Path) -> list[str]:
    """The arguments of a reader of a file; what it writes has a name of its own."""
    [argv] = [column[reader] for column in READERS.values() if reader in column]
    if argv[0] == "python":
        return [*argv, name]
    new = str(folder / f"new-{reader.replace(' ', '-')}")
    return [word.replace("NEW", new).replace(FILE, name) for word in argv]


@pytest.fixture(scope="module")
def refusals(written: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], dict[str, Result]]:
    """What every reader that refuses a file says."""

    @cache
    def read(name: str) -> dict[str, Result]:
        readers = [reader for file, reader, reads in cells() if file == name and not reads]
        folder = tmp_path_factory.mktemp("refused")
        done = subprocess.run(
            [sys.executable, "-c", RUNNER],
            cwd=written,
            input=json.dumps([command(name, reader, folder) for reader in readers]),
            capture_output=True,
            text=True,
            timeout=300,
        )
        assert done.returncode == 0, done.stderr
        assert not list(folder.iterdir()), "who refuses a file writes nothing"
        found = [Result(*result) for result in json.loads(done.stdout)]
        return dict(zip(readers, found, strict=True))

    return read


def read_by(argv: list[str], folder: Path) -> Result:
    """What a reader says of a file. A command that serves has read its file when it prints an address."""
    if argv[0] == "python":
        code = f"import smaclite_pool as sp\n{argv[1].replace(FILE, repr(argv[2]))}"
        whole = [sys.executable, "-c", code]
    else:
        whole = [*PROGRAM, *argv]
    pipe, both = subprocess.PIPE, subprocess.STDOUT
    with subprocess.Popen(whole, cwd=folder, stdout=pipe, stderr=both, text=True) as process:
        assert process.stdout is not None
        output = ""
        for line in process.stdout:
            output += line
            if argv[0] in {"serve", "play", "edit"} and ("http://" in line or "connect with" in line):
                process.terminate()
        status = process.wait()
    served = argv[0] in {"serve", "play", "edit"} and ("http://" in output or "connect with" in output)
    return Result(0 if served else status, output)


def cells() -> list[tuple[str, str, bool]]:
    """File, reader, and whether it reads the file, of all cells of the page."""
    lines = PAGE.read_text().split("| what is written |")[1].split("\n\n")[0].splitlines()
    columns = [cell.strip() for cell in lines[0].strip("| ").split("|")]
    found = []
    for line in lines[2:]:
        what, *marks = [cell.strip() for cell in line.strip("| ").split("|")]
        what = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", what)
        [name] = [file for begin, file in WRITTEN.items() if re.match(rf"{begin}[,:]", what)]
        for column, mark in zip(columns, marks, strict=True):
            assert mark in {"yes", "-"}, line
            found += [(name, reader, mark == "yes") for reader in READERS[column]]
    return found


def test_the_table_has_every_file_and_every_reader() -> None:
    assert {name for name, _, _ in cells()} == set(WRITTEN.values())
    readers = [reader for column in READERS.values() for reader in column]
    assert len(cells()) == len(WRITTEN) * len(readers)
    listed = PAGE.read_text().split("| column | readers |")[1].split("\n\n")[0]
    for reader in readers:
        command = reader.removeprefix("evaluate ").removeprefix("train ")
        assert f"`{reader}`" in listed or f"`{command}`" in listed or command.split()[0] in listed, reader


EXPECTED: dict[str, str] = {
    "check": "unit or a scenario|not a scenario|not a file|expected a value, got",
    "replay": "expected a replay|not a regular file",
    "record --from": "snapshot|not a regular file",
    "dataset expand": "expected a dataset|not a regular file",
    "Dataset": "expected a dataset|not a regular file",
    "report": "has no runs: expected the folder of a run",
    "tournament": "neither a script .* nor the folder of a run|not the folder of a run",
    "dataset record": "neither a scripted policy .* nor a run|not the folder of a run",
    "load_team": "not the folder of a run of",
}
"""What readers accept, as their errors say it, for those that do not read scenarios or runs."""
for reader in (*READERS["scenario"], "show", "edit"):
    EXPECTED[reader] = "not a scenario|not a file|must be the scenario's name"
for reader in (
    "train --opponent",
    "evaluate --opponent",
    "serve --opponent",
    "make(opponent=)",
    "play --against",
):
    EXPECTED[reader] = "unknown opponent|not the folder of a run"
for reader in ("evaluate", "exploit", "train --resume", "verify-run"):
    EXPECTED[reader] = "not the folder of a run"


@pytest.mark.parametrize(("name", "reader"), [cell[:2] for cell in cells() if cell[2]])
def test_what_is_read(written: Path, tmp_path: Path, name: str, reader: str) -> None:
    shutil.copytree(written, tmp_path / "files")
    status, output = read_by(command(name, reader, tmp_path), tmp_path / "files")
    assert status == 0, output
    if os.name != "posix":
        program("clean")  # Windows ended the pool of `serve`, which removed nothing


@posix
@pytest.mark.parametrize(("name", "reader"), [cell[:2] for cell in cells() if not cell[2]])
def test_what_is_refused(refusals: Callable[[str], dict[str, Result]], name: str, reader: str) -> None:
    status, output = refusals(name)[reader]
    assert status in {1, 2}, output
    assert Path(name).name in output, "the error does not name the file"
    assert re.search(EXPECTED[reader], output), output
    assert "os error" not in output and "panicked" not in output


def test_bytes_of_a_snapshot_file_are_what_restore_takes(written: Path) -> None:
    import numpy as np

    snapshot = np.fromfile(written / "step.snapshot", np.uint8)[None]
    with sp.make("3m", 1, fields=["episode_length", "snapshot"]) as envs:
        envs.reset(seed=1)
        batch: Any = envs.reset(snapshots=snapshot)
        assert batch.episode_length[0] == 5
