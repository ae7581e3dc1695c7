"""The program and the example, as a person runs them."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import smaclite_pool as sp

from conftest import Serve

REPOSITORY = Path(__file__).resolve().parents[2]


def run(*command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, *command], capture_output=True, text=True, timeout=100, check=False)


def test_the_program_runs_as_a_module_and_as_a_script() -> None:
    module = run("-m", "smaclite_pool", "scenarios")
    assert module.returncode == 0 and all(name in module.stdout for name in sp.scenarios())
    script = Path(sys.executable).parent / "smaclite-pool"
    done = subprocess.run([script, "scenarios"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, module.stdout)


def test_exit_codes_mean_something() -> None:
    assert run("-m", "smaclite_pool", "nonsense").returncode == 2
    failed = run("-m", "smaclite_pool", "status", "nobody")
    assert failed.returncode == 1 and "nobody" in failed.stderr and "Traceback" not in failed.stderr


def test_serve_ends_cleanly_with_ctrl_c(serve: Serve) -> None:
    server = serve("2s3z:4", "--name", "train")
    with sp.connect("train") as envs:
        envs.reset()
        listed = run("-m", "smaclite_pool", "list", "--json")
        assert json.loads(listed.stdout)["pool"] == "train"
    server.send_signal(signal.SIGINT)
    assert server.wait(30) == 0
    assert sp.pools() == []


def test_the_example_plays() -> None:
    example = str(REPOSITORY / "bindings" / "examples" / "random_policy.py")
    done = run(example, "2s3z", "--num-envs", "16", "--seconds", "0.5")
    assert done.returncode == 0, done.stderr
    assert "steps/s" in done.stdout and "mean return" in done.stdout
    assert "did you mean `2s3z`" in run(example, "2s3").stderr
