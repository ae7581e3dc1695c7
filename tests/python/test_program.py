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


def run(*command: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    whole = [sys.executable, *command]
    return subprocess.run(whole, capture_output=True, text=True, timeout=100, check=False, cwd=cwd)


def test_the_program_runs_as_a_module_and_as_a_script() -> None:
    module = run("-m", "smaclite_pool", "scenarios")
    assert module.returncode == 0 and all(name in module.stdout for name in sp.scenarios())
    script = Path(sys.executable).parent / "smaclite-pool"
    done = subprocess.run([script, "scenarios"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, module.stdout)


def test_standard_scenarios_do_not_read_unit_files_of_the_working_directory(tmp_path: Path) -> None:
    # 6h_vs_8z has hydralisks, and a unit file of that name comes before the standard type in scenario files.
    (tmp_path / "HYDRALISK.json").write_text("not a unit")
    listed = run("-m", "smaclite_pool", "scenarios", cwd=tmp_path)
    assert listed.returncode == 0 and "so_many_baneling" in listed.stdout, listed.stderr


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
