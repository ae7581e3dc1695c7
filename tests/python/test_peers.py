"""`benches/peers.py`, with a script in place of the published environment."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

if sys.platform != "linux":
    pytest.skip("benches/peers.py asks Linux for its cores", allow_module_level=True)

import peers

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
def published(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package `smaclite` without metadata, and without its addon."""
    files = {
        "__init__.py": SMACLITE,
        "env/__init__.py": "",
        "env/maps/__init__.py": "",
        "env/maps/map.py": MAPS,
    }
    for file, text in files.items():
        path = tmp_path / "smaclite" / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    return tmp_path / "smaclite"


def test_a_peer_is_measured_in_turn_with_this_program(
    published: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = []

    def here(scenario: str | None, seconds: float) -> float:
        asked.append((scenario, seconds))
        return 100.0

    monkeypatch.setattr(peers, "here", here)
    assert peers.main(["published", "--rounds", "2", "--seconds", "0.05"]) == 0
    assert asked == [("3m", 0.05)] * 2
    versions, line = capsys.readouterr().out.splitlines()
    assert versions.startswith("smaclite unknown, gymnasium ")
    assert line.startswith("3m: published ") and "1 environment), here 100, " in line, line
    with pytest.raises(SystemExit, match=r"published has no 8m; its maps are \['3m'\]"):
        peers.main(["published", "8m"])


def test_the_error_of_a_process_of_the_peer_is_the_message(published: Path) -> None:
    (published / "__init__.py").write_text("")  # registers nothing
    with pytest.raises(SystemExit, match=r"^peers\.py: NamespaceNotFound: .*smaclite"):
        peers.main(["published", "3m", "--rounds", "1"])


def test_a_peer_that_is_not_installed_is_named() -> None:
    with pytest.raises(SystemExit, match="cannot import the peer: No module named 'envpool'"):
        peers.main(["envpool"])
