"""`just differential`, with our own engine in the place of the published environment: a difference is
found, located, shrunk and kept, and without one none is reported."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp

from differential import scenarios
from differential.__main__ import POLICIES
from differential.battles import Frame, PoolBattle, PublishedFailure, difference
from differential.episode import Episode, play
from differential.examine import HASH_SEED, Published, examine
from differential.generator import random_scenario
from differential.recording import Recorded, first_disagreement
from differential.run import run
from differential.scenarios import ScenarioFiles

TESTS = Path(__file__).resolve().parents[1]
SEEDS = range(1, 41)


class EqualBattle(PoolBattle):
    """The environment that differs in nothing."""


class WrongBattle(PoolBattle):
    """Differs in one bit of one observation, from the third step on, if a MEDIVAC is on the field."""

    def __init__(self, files: ScenarioFiles, path: Path, seed: int) -> None:
        super().__init__(files, path, seed)
        self.steps_left = 3 if "MEDIVAC" in files.roster("ALLY") else None

    def step(self, actions: list[int]) -> Frame:
        frame = super().step(actions)
        if self.steps_left is None:
            return frame
        self.steps_left -= self.steps_left > 0
        obs = frame.obs.copy()
        if not self.steps_left:
            obs[0, 1] = np.nextafter(obs[0, 1], np.float32(2))
        return frame._replace(obs=obs)


class FailingBattle(PoolBattle):
    def step(self, actions: list[int]) -> Frame:
        raise PublishedFailure("a laser beam found no unit")


def recorded(n_ticks: int, differs_in: int | None = None) -> Recorded:
    """A recording of one number per tick."""
    frames = np.zeros((n_ticks + 1, 1))
    if differs_in is not None:
        frames[differs_in + 1 :] = 1
    return {"tick_hp": frames, "tick_reward": np.zeros(n_ticks), "actions": np.zeros((n_ticks // 8, 1))}


def record(episode: Episode, actions: list[list[int]], hash_seed: int) -> Recorded:
    return recorded(8 * len(actions))


def record_a_tie_in_tick_20(episode: Episode, actions: list[list[int]], hash_seed: int) -> Recorded:
    return recorded(8 * len(actions), differs_in=20 if hash_seed == 3 else None)


def record_a_tie_too_late(episode: Episode, actions: list[list[int]], hash_seed: int) -> Recorded:
    return recorded(8 * len(actions) + 8, differs_in=24 if hash_seed == 3 else None)


def mmm(policy: str = "nearest") -> Episode:
    return Episode(scenarios.standard("MMM"), policy, 5, 10)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_seed_gives_one_scenario_and_a_valid_one(seed: int, tmp_path: Path) -> None:
    files = random_scenario(seed)
    assert files == random_scenario(seed)
    described = sp.scenario(files.write(tmp_path))
    for units, faction in ((described["allies"], "ALLY"), (described["enemies"], "ENEMY")):
        assert [unit["unit_type"] for unit in units] == files.roster(faction)


def test_random_scenarios_have_everything_in_them() -> None:
    files = [random_scenario(seed) for seed in SEEDS]
    units = [unit for scenario in files for unit in scenario.units.values()]
    targeters = {unit.get("targeter", "STANDARD") for unit in units}
    assert targeters == {"STANDARD", "KAMIKAZE", "LASER_BEAM", "HEAL"}
    assert {unit["plane"] for unit in units} == {"GROUND", "AIR"}
    assert any("terrain_preset" in scenario.scenario for scenario in files)
    assert any("X" in "".join(scenario.scenario.get("terrain", [])) for scenario in files)
    assert {scenario.scenario["ally_has_shields"] for scenario in files} == {True, False}
    assert len({json.dumps(scenario.scenario["groups"]) for scenario in files}) == len(files)


@pytest.mark.parametrize("name", scenarios.standard_names())
def test_a_standard_scenario_written_out_is_the_same_scenario(name: str, tmp_path: Path) -> None:
    written = sp.scenario(scenarios.standard(name).write(tmp_path))
    expected = sp.scenario(name)
    other = {"episode_limit": None, "hash": None}  # files of the published environment have no limit
    assert {**written, **other} == {**expected, **other}


def test_a_file_is_rewritten_for_the_published_environment(tmp_path: Path) -> None:
    """It knows neither `initial_energy` nor `episode_limit`, and looks for unit files elsewhere."""
    healer = json.loads((scenarios.UNITS / "MEDIVAC.json").read_text())
    scenario = scenarios.standard("2s3z").scenario | {"custom_unit_path": "mine", "episode_limit": 7}
    scenario["groups"][0]["units"] = {"ZEALOT": 4, "angel": 1}
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/angel.json").write_text(json.dumps(healer))
    (tmp_path / "battle.json").write_text(json.dumps({**scenario, "num_unit_types": 0}))
    files = scenarios.read(tmp_path / "battle.json")
    written = json.loads(files.write(tmp_path / "out").read_text())
    assert files.episode_limit == 7
    assert "episode_limit" not in written
    unit = json.loads((tmp_path / "out/units/angel.json").read_text())
    assert unit == {**{key: unit[key] for key in healer if key != "initial_energy"}, "starting_energy": 50}
    assert len(sp.scenario(tmp_path / "out/battle.json")["allies"]) == 5


@pytest.mark.parametrize("policy", POLICIES)
@pytest.mark.parametrize("standard", [True, False], ids=["MMM", "random"])
def test_equal_environments_do_not_differ(standard: bool, policy: str) -> None:
    files = scenarios.standard("MMM") if standard else random_scenario(4)
    outcome = play(Episode(files, policy, 5, 10), EqualBattle)
    assert (outcome.kind, len(outcome.actions)) == ("same", 10)


def test_one_bit_is_a_difference_and_is_located() -> None:
    outcome = play(mmm(), WrongBattle)
    assert outcome.kind == "different"
    assert re.fullmatch(r"after 3 steps, obs\[0, 1\]: published \S+, ours \S+", outcome.what), outcome.what
    assert len(outcome.actions) == 3


@pytest.mark.parametrize("name", Frame._fields)
def test_every_field_is_compared_to_the_bit(name: str) -> None:
    zeros = Frame(
        np.zeros((2, 3), np.float32), np.zeros(4, np.float32), np.zeros((2, 7), bool),
        np.array(0, np.float32), np.array(False), np.array(False),
    )  # fmt: skip
    assert difference(zeros, zeros) is None
    field = getattr(zeros, name)
    other = field | True if field.dtype == bool else -field  # a negative zero is equal, but has other bits
    assert str(difference(zeros, zeros._replace(**{name: other}))).startswith(name)
    wider = np.zeros((*field.shape, 2), field.dtype)
    assert str(difference(zeros, zeros._replace(**{name: wider}))).startswith(name)


def test_a_difference_is_shrunk_to_what_it_needs_and_kept(tmp_path: Path) -> None:
    finding = examine(mmm(), Published(WrongBattle, record), tmp_path)
    assert finding.kind == "different"
    assert finding.smaller.startswith("MMM_small-nearest-5: 1 MEDIVAC against 1 "), finding.smaller
    kept = tmp_path / "MMM-nearest-5"
    assert sorted(path.name for path in kept.iterdir()) == [
        "MMM-nearest-5.npz", "MMM.json", "MMM_small-nearest-5.npz", "MMM_small.json",
    ]  # fmt: skip
    again = scenarios.read(kept / "MMM_small.json")
    assert play(Episode(again, "nearest", 5, 10), WrongBattle).kind == "different"


def test_a_tie_is_not_a_difference(tmp_path: Path) -> None:
    """With another hash seed the published environment parts from itself in the step in which ours does."""
    finding = examine(mmm(), Published(WrongBattle, record_a_tie_in_tick_20), tmp_path)
    assert finding.kind == "tie"
    assert f"in tick 20 with PYTHONHASHSEED={HASH_SEED} and 3" in finding.what
    assert list(tmp_path.iterdir()) == []
    assert examine(mmm(), Published(WrongBattle, record_a_tie_too_late), tmp_path).kind == "different"


def test_the_first_tick_in_which_recordings_disagree() -> None:
    assert first_disagreement(recorded(16), recorded(16)) is None
    assert first_disagreement(recorded(16), recorded(16, differs_in=9)) == 9
    other: dict[str, Any] = recorded(16)
    other["tick_reward"][4] = 1
    assert first_disagreement(recorded(16, differs_in=9), other) == 4
    assert first_disagreement(recorded(16), recorded(24)) == 16


def test_a_run_reports_what_it_finds(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    episodes = [mmm(), Episode(scenarios.standard("2s3z"), "focus", 5, 10)]
    progress = run(episodes, Published(WrongBattle, record), tmp_path, jobs=2, stop_after=5)
    assert dict(progress.tally) == {"same": 1, "different": 1}
    assert progress.faults() == 1
    lines = capsys.readouterr().out.splitlines()
    assert any(line.startswith("different: MMM-nearest-5: after 3 steps, obs[0, 1]") for line in lines), lines
    assert lines[-1].startswith("2 of 2 episodes: ")


def test_a_run_without_differences(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for battle, kind in ((EqualBattle, "same"), (FailingBattle, "published stops")):
        progress = run([mmm()], Published(battle, record), tmp_path, jobs=1, stop_after=5)
        assert dict(progress.tally) == {kind: 1}
        assert progress.faults() == 0
    expected = "the published environment stops: a laser beam found no unit (1 episodes)"
    assert expected in capsys.readouterr().out
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(find_spec("rvo2") is not None, reason="the published environment is installed")
@pytest.mark.parametrize("arguments", [["differential", "1"], ["differential.trained", "a_run"]])
def test_without_the_published_environment_the_commands_say_what_they_need(arguments: list[str]) -> None:
    command = [sys.executable, "-m", *arguments]
    done = subprocess.run(command, cwd=TESTS, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "cannot import rvo2" in done.stderr
    assert "SMAClite-Python-RVO2" in done.stderr
