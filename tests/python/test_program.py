"""The program and the example, run as users run them."""

from __future__ import annotations

import json
import os
import platform
import signal
import subprocess
import sys
import sysconfig
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import smaclite_pool as sp

from conftest import PROGRAM, Serve, handles, linux, posix, program


def test_the_program_runs_as_a_module_and_as_a_script() -> None:
    module = program("scenarios")
    assert all(name in module.stdout for name in sp.scenarios())
    script = Path(sysconfig.get_path("scripts")) / "smaclite-pool"
    done = subprocess.run([script, "scenarios"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, module.stdout)


def test_standard_scenarios_do_not_read_unit_files_of_the_working_directory(tmp_path: Path) -> None:
    # 6h_vs_8z has hydralisks; in scenario files, a unit file of that name replaces the standard type.
    (tmp_path / "HYDRALISK.json").write_text("not a unit")
    assert "so_many_baneling" in program("scenarios", cwd=tmp_path).stdout


def test_bench_starts_its_second_process_in_the_same_virtual_environment() -> None:
    # The interpreter's link was followed to the system's Python, which does not have this package.
    options = ["--mode", "attached", "--num-envs", "2", "--seconds", "0.1"]
    assert "attached" in program("bench", "2s3z", *options).stdout


def test_exit_codes_distinguish_usage_errors_from_failures() -> None:
    assert program("nonsense", check=False).returncode == 2
    failed = program("status", "absent", check=False)
    assert failed.returncode == 1 and "absent" in failed.stderr and "Traceback" not in failed.stderr


def test_doctor_knows_the_versions_of_python_and_numpy() -> None:
    run_by = json.loads(program("doctor", "--json").stdout)["facts"]["run by"]
    assert f"NumPy {np.__version__}" in run_by and f"Python {platform.python_version()}" in run_by


def test_completions_run_the_script_of_the_virtual_environment() -> None:
    script = Path(sysconfig.get_path("scripts")) / "smaclite-pool"
    command = [str(script), "completions", "bash"]
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert str(script) in printed
    # Bash's answers end without a newline, and were lost in the buffer of a process that ends by Python.
    asking = {**os.environ, "SMACLITE_POOL_COMPLETE": "bash", "_CLAP_COMPLETE_INDEX": "2"}
    command = [str(script), "--", "smaclite-pool", "show", "2s3"]
    asked = subprocess.run(command, env=asking, capture_output=True, text=True, check=True)
    assert asked.stdout == "2s3z"
    # A module has no path that a shell could run.
    assert '"smaclite-pool" -- ' in program("completions", "bash").stdout


def test_serve_ends_cleanly_with_ctrl_c(serve: Serve) -> None:
    server = serve("2s3z:4", "--name", "train")
    with sp.connect("train") as envs:
        envs.reset()
        listed = program("list", "--json")
        assert json.loads(listed.stdout)["pool"] == "train"
    server.send_signal(signal.SIGINT)
    assert server.wait(30) == 0
    assert sp.pools() == []


@pytest.fixture
def ctrl_c() -> Iterator[None]:
    """Ctrl-C ends processes that the test starts, also where the tests run in the background."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@posix
@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_ends_the_program_while_it_is_imported(tmp_path: Path) -> None:
    """It printed a traceback in the first 0.4 s."""
    (tmp_path / "numpy.py").write_text("import os, signal; os.kill(os.getpid(), signal.SIGINT)")
    script = Path(sysconfig.get_path("scripts")) / "smaclite-pool"
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    for command in ([*PROGRAM, "list"], [sys.executable, str(script), "list"]):
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stderr) == (-signal.SIGINT, "")
    handles = "import signal; signal.signal(signal.SIGINT, lambda *_: print('handled'))"
    library = [sys.executable, "-c", f"{handles}; import smaclite_pool"]
    done = subprocess.run(library, env=environment, capture_output=True, text=True, check=False)
    assert done.stdout == "handled\n"


@posix
@pytest.mark.usefixtures("ctrl_c")
def test_only_the_program_changes_what_ctrl_c_does_and_no_import_fails() -> None:
    code = """
import importlib, pathlib, signal, sys, threading
import smaclite_pool._interrupts as module

def handler(*_):
    pass

def keeps(argv, before):
    signal.signal(signal.SIGINT, before)
    sys.argv = argv
    importlib.reload(module)
    return signal.getsignal(signal.SIGINT) is before

default, script = signal.default_int_handler, ["/bin/smaclite-pool", "list"]
for argv in ([], [pathlib.Path("a.py")], [None], ["-m"], ["-m"] * 99):
    assert keeps(argv, default), argv
assert keeps(script, handler) and keeps(script, signal.SIG_IGN) and not keeps(script, default)
signal.signal(signal.SIGINT, default)
failed = []
threading.excepthook = failed.append
thread = threading.Thread(target=importlib.reload, args=[module])
thread.start()
thread.join()
assert not failed and signal.getsignal(signal.SIGINT) is default
del sys.argv
importlib.reload(module)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@linux
def test_an_interrupted_recording_is_written_and_has_the_status_of_its_signal(
    serve: Serve, tmp_path: Path
) -> None:
    """It had the exit status 0 of a recording with all episodes."""
    serve("3m:2", "--name", "train")
    out = tmp_path / "a.smreplay"
    with sp.connect("train") as envs:
        envs.reset(seed=1)
        argv = [*PROGRAM, "record", "--pool", "train", "--episodes", "10000"]
        recorder = subprocess.Popen(
            [*argv, "--out", str(out)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        handled = None
        while handled is None or time.monotonic() < handled + 2:  # it reads every 50 ms
            envs.step(envs.sample_actions())
            time.sleep(0.001)
            if handled is None and handles(recorder.pid, signal.SIGTERM):
                handled = time.monotonic()
        recorder.send_signal(signal.SIGTERM)
        printed, messages = recorder.communicate(timeout=60)
    assert recorder.returncode == 128 + signal.SIGTERM, printed + messages
    assert str(out) in printed and out.exists(), printed + messages


@pytest.mark.parametrize("user", ["program", "library"])
def test_who_has_no_standard_streams_harms_no_pool(user: str, serve: Serve, tmp_path: Path) -> None:
    """What it printed went into the lock of the shared memory, and no other process could use pools."""
    printing = (
        "import os, smaclite_pool as sp; envs = sp.make('3m', 2); envs.reset(); os.write(1, b'progress')"
    )
    options = ["--steps=3000", "--num-envs=16", f"--out={tmp_path / 'run'}"]
    commands = {
        "program": ["-m", "smaclite_pool", "train", "3m", *options],
        "library": ["-c", printing],
    }
    serve("3m:8")
    without = ["bash", "-c", 'exec "$@" <&- >&-', "bash", sys.executable]
    done = subprocess.run([*without, *commands[user]], timeout=60, check=False)
    # Nothing is open there for the library, or what is not a pool's.
    assert user == "library" or done.returncode == 0
    with sp.make("3m", 2) as envs:
        envs.reset()


def test_a_pool_of_both_sides_says_why_it_is_not_trained_on(serve: Serve, tmp_path: Path) -> None:
    """The reason was said to be the field `opponent`, though the lane served all fields."""
    serve("3m:2", "--name", "arena", "--sides", "mirrored")
    done = program("train", "3m", "--pool", "arena", "--out", tmp_path / "run", check=False)
    assert done.returncode == 1 and "with `--sides allies`" in done.stderr, done.stderr


def test_the_example_plays() -> None:
    example = [sys.executable, "-m", "smaclite_pool.examples.random_policy"]
    command = [*example, "2s3z", "--num-envs", "16", "--seconds", "0.5"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=True)
    assert "steps/s" in done.stdout and "mean return" in done.stdout
    failed = subprocess.run([*example, "2s3"], capture_output=True, text=True, timeout=100, check=False)
    assert "did you mean `2s3z`" in failed.stderr


@pytest.mark.parametrize(
    ("option", "said"),
    [("--width 0", "--width must be between 1"), ("--steps -5", "--steps must be between")],
)
def test_an_example_says_which_numbers_it_takes(option: str, said: str) -> None:
    """A search of no states was a traceback about the number of environments."""
    command = [sys.executable, "-m", "smaclite_pool.examples.planning", "3m", *option.split()]
    failed = subprocess.run(command, capture_output=True, text=True, timeout=100, check=False)
    assert failed.returncode == 2 and said in failed.stderr and "Traceback" not in failed.stderr
