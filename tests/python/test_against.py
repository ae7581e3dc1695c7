"""`smaclite-pool bench --against`, with scripts in place of the other programs."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

ENVPOOL = """
import numpy as np

class Envs:
    def __init__(self, batch_size):
        self.batch_size = batch_size
    def async_reset(self):
        self.waiting = True
    def send(self, actions, env_id):
        assert len(actions) == len(env_id) == self.batch_size and not self.waiting
        self.waiting = True
    def recv(self):
        assert self.waiting
        self.waiting = False
        return None, None, None, None, {"env_id": np.arange(self.batch_size)}

def make(task, *, env_type, num_envs, batch_size, num_threads):
    assert num_threads >= 1 and batch_size <= num_envs
    return Envs(batch_size)
"""

SMACLITE = """
import gymnasium
import numpy as np

class Battle(gymnasium.Env):
    def __init__(self, use_cpp_rvo2):
        self.steps = 0
    def reset(self, **_):
        self.steps = 0
        return (), {}
    def get_avail_actions(self):
        return [np.array([0, 1, 0]), np.array([1, 0, 0])]
    def step(self, actions):
        assert actions == [1, 0] and all(type(action) is int for action in actions) and self.steps < 200
        self.steps += 1
        return (), 0.0, False, False, {}

gymnasium.register("smaclite/3m-v0", entry_point=Battle)
"""

MAPS = """
from enum import Enum
from types import SimpleNamespace

class MapPreset(Enum):
    MAP = SimpleNamespace(name="3m")
"""


@pytest.fixture
def peers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder for packages that the interpreter finds first."""
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    return tmp_path


def package(folder: Path, name: str, files: dict[str, str]) -> None:
    for file, text in files.items():
        path = folder / name / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    metadata = folder / f"{name}-1.0.dist-info" / "METADATA"
    metadata.parent.mkdir()
    metadata.write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")


def bench(*options: str) -> subprocess.CompletedProcess[str]:
    argv = [sys.executable, "-m", "smaclite_pool", "bench", "--seconds", "0.05", "--num-envs", "2", *options]
    return subprocess.run(argv, capture_output=True, text=True, timeout=100, check=False)


def test_peers_are_measured_in_the_scenarios_that_they_have(peers: Path) -> None:
    package(peers, "envpool", {"__init__.py": ENVPOOL})
    maps = {"env/__init__.py": "", "env/maps/__init__.py": "", "env/maps/map.py": MAPS}
    package(peers, "smaclite", {"__init__.py": SMACLITE, **maps})
    done = bench("3m", "8m", "--against=published,envpool", "--rounds", "2", "--json")
    assert done.returncode == 0, done.stderr
    results = [json.loads(line) for line in done.stdout.splitlines()]
    assert [(r["peer"], r["scenario"]) for r in results] == [("published", "3m"), ("envpool", "no work")]
    for result in results:
        assert result["peer_steps_per_s"] > 0 and result["steps_per_s"] > 0
        assert result["ratio"] == pytest.approx(result["steps_per_s"] / result["peer_steps_per_s"])
    assert "1 environment" in results[0]["configuration"] and "CartPole" in results[1]["configuration"]
    table = bench("3m", "--against=published", "--rounds", "1")
    assert table.stdout.startswith("scenario  peer ") and "smaclite 1.0" in table.stdout


def test_a_version_that_no_metadata_has_is_unknown(peers: Path) -> None:
    """An addon that was built in place has none, and then nothing was measured."""
    maps = {"env/__init__.py": "", "env/maps/__init__.py": "", "env/maps/map.py": MAPS}
    package(peers, "smaclite", {"__init__.py": SMACLITE, **maps})
    (peers / "rvo2.py").write_text("")
    done = bench("3m", "--against=published", "--rounds", "1")
    assert done.returncode == 0, done.stderr
    assert "pyrvo2 unknown" in done.stdout, done.stdout


def test_a_peer_that_is_not_installed_is_named_with_its_command(peers: Path) -> None:
    (peers / "jaxmarl.py").write_text("raise ImportError('No module named jaxmarl')")
    package(peers, "envpool", {"__init__.py": ENVPOOL})
    done = bench("3m", "--against=smax,envpool", "--rounds", "1")
    assert done.returncode == 0, done.stderr
    assert "smax is not installed: No module named jaxmarl" in done.stdout
    assert "pip install jaxmarl" in done.stdout and "no work" in done.stdout
    alone = bench("3m", "--against=smax")
    assert alone.returncode == 1 and "no other program could be measured" in alone.stderr


def test_a_peer_that_fails_and_a_scenario_that_it_lacks_are_named(peers: Path) -> None:
    package(peers, "envpool", {"__init__.py": "def make(*_, **__):\n    raise ValueError('no such task')\n"})
    maps = {"env/__init__.py": "", "env/maps/__init__.py": "", "env/maps/map.py": MAPS}
    package(peers, "smaclite", {"__init__.py": SMACLITE, **maps})
    done = bench("8m", "--against=published,envpool", "--rounds", "1")
    assert done.returncode == 1
    assert "envpool: ValueError: no such task" in done.stdout
    assert 'published: it has none of the scenarios; it has ["3m"]' in done.stdout


@pytest.mark.parametrize("options", [["--python", "python3"], ["--rounds", "2"], ["--against=starcraft"]])
def test_options_that_do_not_fit_are_usage_errors(options: list[str]) -> None:
    assert bench(*options).returncode == 2
