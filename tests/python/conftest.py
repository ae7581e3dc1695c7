"""Fixtures: a runtime directory per test, which must be empty afterwards, and pools in separate processes."""

from __future__ import annotations

import gc
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import smaclite_pool as sp

REPOSITORY = Path(__file__).resolve().parents[2]
PROGRAM = [sys.executable, "-m", "smaclite_pool"]

linux = pytest.mark.skipif(sys.platform != "linux", reason="it reads /proc")
posix = pytest.mark.skipif(os.name != "posix", reason="this system has no signals, forks or shells")

# Pages and README serve pools, by commands of a POSIX shell; types are those of the tests for Linux.
of_linux = ["test_docs.py", "test_faq.py", "test_readme.py", "test_site.py", "test_types.py"]
collect_ignore = [] if sys.platform == "linux" else of_linux


def note_test(outcome: str, name: str, reason: str) -> None:
    """Notes which tests ran and which were skipped, for the end of a run of several jobs (.ci/skipped.py)."""
    if folder := os.environ.get("SMACLITE_TEST_LOG"):
        with (Path(folder) / f"{os.getpid()}.tsv").open("a", encoding="utf-8") as file:
            file.write("\t".join((outcome, name, " ".join(reason.split()))) + "\n")


def skip_reason(report: pytest.TestReport | pytest.CollectReport) -> str:
    return report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    if hasattr(report, "node"):
        return  # pytest-xdist hands on what a worker process has noted
    if report.skipped:
        note_test("skipped", report.nodeid, skip_reason(report))
    elif report.when == "call":
        note_test("ran", report.nodeid, "")


def pytest_collectreport(report: pytest.CollectReport) -> None:
    if report.skipped:  # a whole module, by `importorskip`
        note_test("skipped", report.nodeid, skip_reason(report))


def shm_prefix(root: Path) -> str:
    """Prefix of the folder's name in /dev/shm: FNV-1a of `root`, as in ipc/src/runtime_dir.rs."""
    folder = 0xCBF29CE484222325
    for byte in str(root).encode():
        folder = ((folder ^ byte) * 0x100000001B3) % 2**64
    return f"sp{folder % 2**32:08x}"


def left_over(root: Path) -> list[str]:
    """Files of a runtime directory, in its folder and in /dev/shm. On other systems a lock stays in it."""
    files = [str(path) for path in root.rglob("*") if not path.is_dir() and path != root / "lock"]
    return files + [str(path) for path in Path("/dev/shm").glob(shm_prefix(root) + "*")]


@pytest.fixture(autouse=True)
def runtime_dir(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The runtime directory of this test's pools. Its path is short, because it contains sockets."""
    root = Path(tempfile.mkdtemp(prefix="sp-", dir="/tmp" if os.name == "posix" else None)).resolve()
    monkeypatch.setenv("SMACLITE_POOL_ROOT", str(root))
    yield root
    left = left_over(root)
    if left:
        gc.collect()  # the environments may be in a cycle, with a failed test's traceback for instance
        left = left_over(root)
    shutil.rmtree(root)
    for path in map(Path, left):
        shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
    assert not left


Serve = Callable[..., "subprocess.Popen[str]"]


@pytest.fixture
def serve(runtime_dir: Path) -> Iterator[Serve]:
    """Starts `smaclite-pool serve` with the given arguments and returns it when learners can attach."""
    started: list[subprocess.Popen[str]] = []

    def start(*args: str) -> subprocess.Popen[str]:
        process = subprocess.Popen([*PROGRAM, "serve", *args], stdout=subprocess.PIPE, text=True)
        started.append(process)
        assert process.stdout is not None
        for line in process.stdout:
            if line.startswith("connect with"):
                return process
        raise AssertionError(f"serve ended with {process.wait()}")

    yield start
    for process in started:
        if process.poll() is None:
            if os.name == "posix":
                process.send_signal(signal.SIGCONT)
            process.terminate()
            process.wait(30)
        if process.stdout is not None:
            process.stdout.close()
    if started and os.name != "posix":
        program("clean")  # Windows ended the pool, which removed nothing


class Alarm(Exception):
    """Raised by the handler of SIGALRM."""


@pytest.fixture
def alarm() -> Iterator[Callable[[float], object]]:
    """Raises `Alarm` in the main thread, so many seconds after it is called; 0 for not at all."""

    def ring(*_: object) -> None:
        raise Alarm

    before = signal.signal(signal.SIGALRM, ring)
    yield partial(signal.setitimer, signal.ITIMER_REAL)
    signal.setitimer(signal.ITIMER_REAL, 0)
    signal.signal(signal.SIGALRM, before)


def handles(pid: int, number: int) -> bool:
    """Whether a process has a handler of a signal."""
    status = Path(f"/proc/{pid}/status").read_text()
    caught = next(line.split()[1] for line in status.splitlines() if line.startswith("SigCgt:"))
    return bool(int(caught, 16) & 1 << number - 1)


def stop(server: subprocess.Popen[str]) -> None:
    """Sends SIGSTOP and waits until every thread has stopped: until then one may still answer."""
    server.send_signal(signal.SIGSTOP)
    os.waitpid(server.pid, os.WUNTRACED)


def program(
    *args: object, cwd: Path | None = None, check: bool = True, **env: str
) -> subprocess.CompletedProcess[str]:
    """Runs `smaclite-pool`; with `check`, it must succeed. `env` is added to the environment."""
    command, env = [*PROGRAM, *map(str, args)], {**os.environ, **env}
    done = subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True, timeout=300, check=False)
    assert not check or done.returncode == 0, done.stdout + done.stderr
    return done


@contextmanager
def recorded(envs: sp.Envs, path: Path) -> Iterator[None]:
    """Records environment 0, and writes the replay at the end."""
    with sp.Recorder(envs.spec.pool, envs.spec.lane) as recorder:
        yield
        recorder.save(path)


def replayed(path: Path) -> str:
    """What `smaclite-pool replay` prints about a replay; every tick of it was played again."""
    return program("replay", path).stdout


def changed_scenario(folder: Path, name: str, **keys: Any) -> Path:
    """A file of a standard scenario with other keys, or with other keys of its `smacv2`."""
    scenario = json.loads((REPOSITORY / f"scenarios/data/{name}.json").read_text())
    if "smacv2" in keys:
        keys["smacv2"] = scenario.get("smacv2", {}) | keys["smacv2"]
    path = folder / f"{name}.json"
    path.write_text(json.dumps(scenario | keys))
    return path


def each_case(by_error: dict[type[Exception], list[Any]]) -> list[tuple[Any, ...]]:
    """Error, what raises it and its message, of all cases of a table of tuples by error."""
    return [(error, *case) for error, cases in by_error.items() for case in cases]


def run_script(text: str, *args: str) -> subprocess.CompletedProcess[str]:
    """Runs Python code in a new process."""
    command = [sys.executable, "-c", text, *args]
    return subprocess.run(command, capture_output=True, text=True, timeout=100, check=False)
