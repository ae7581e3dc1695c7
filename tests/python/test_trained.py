"""`just published` without the published environment: the pool in its place, and the program for the team."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp

from conftest import program
from differential import scenarios, trained
from differential.battles import Frame, PoolBattle, PublishedFailure
from differential.examine import Published
from differential.recording import Recorded
from differential.scenarios import ScenarioFiles
from differential.team import Team

EPISODES = 8
SEED = 5


@pytest.fixture(scope="module", params=["flat", "units"])
def folder(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Path:
    """A run that has learnt a little, so that its choices are not all alike."""
    folder: Path = tmp_path_factory.mktemp("runs") / "3m"
    options = ["--network", request.param, "--steps", "20000", "--seed", "1"]
    program("train", "3m", *options, "--out", folder)
    return folder


def plan(folder: Path, greedy: bool = False) -> trained.Plan:
    return trained.read_plan(folder, EPISODES, SEED, greedy)


def no_recording(*_: Any) -> Recorded:
    raise AssertionError("nothing differs, so nothing is recorded")


def equal_recordings(*_: Any) -> Recorded:
    return {"tick_hp": np.zeros((9, 1))}


class WrongReward(PoolBattle):
    """Differs in the reward of the third step."""

    def __init__(self, files: ScenarioFiles, path: Path, seed: int) -> None:
        super().__init__(files, path, seed)
        self.steps_left = 3

    def step(self, actions: list[int]) -> Frame:
        frame = super().step(actions)
        self.steps_left -= 1
        return frame._replace(reward=frame.reward + np.float32(self.steps_left == 0))


class WrongActions(PoolBattle):
    """Shows fewer available actions than there are, from the beginning."""

    def reset(self) -> Frame:
        frame = super().reset()
        available = np.zeros_like(frame.avail_actions)
        available[:, 1] = True
        return frame._replace(avail_actions=available)


class FailingBattle(PoolBattle):
    def step(self, actions: list[int]) -> Frame:
        raise PublishedFailure("a laser beam found no unit")


def test_the_team_plays_here_as_in_the_program(folder: Path) -> None:
    """With the most probable actions, the same seeds give the same episodes."""
    numbers = ["--episodes", str(EPISODES), "--seed", str(SEED)]
    lines = program("evaluate", folder, *numbers, "--greedy", "--json").stdout.splitlines()
    *episodes, result = map(json.loads, lines)
    assert result["mean_length"] > 5
    played = [
        trained.compare(plan(folder, greedy=True), SEED + i, Published(PoolBattle, no_recording)).pool
        for i in range(EPISODES)
    ]
    episodes.sort(key=lambda episode: int(episode["env_id"]))
    assert [(result.won, result.steps) for result in played] == [
        (episode["won"], episode["length"]) for episode in episodes
    ]
    returns = [episode["episode_return"] for episode in episodes]
    assert [result.episode_return for result in played] == pytest.approx(returns, abs=1e-4)


def test_equal_environments_do_not_differ(folder: Path) -> None:
    seeds = range(SEED, SEED + EPISODES)
    compared = [trained.compare(plan(folder), seed, Published(PoolBattle, no_recording)) for seed in seeds]
    assert {comparison.kind for comparison in compared} == {"same"}
    assert all(comparison.published == comparison.pool for comparison in compared)
    assert len({comparison.pool for comparison in compared}) > 1  # sampled, so not all alike


@pytest.mark.parametrize(
    ("battle", "what"),
    [(WrongReward, "after 3 steps, reward: published"), (WrongActions, "after 0 steps, avail_actions[0, ")],
)
def test_a_difference_is_located(folder: Path, battle: type[PoolBattle], what: str) -> None:
    comparison = trained.compare(plan(folder), SEED, Published(battle, equal_recordings))
    assert comparison.kind == "different"
    assert comparison.what.startswith(what), comparison.what


def test_a_known_error_is_not_a_difference(folder: Path) -> None:
    comparison = trained.compare(plan(folder), SEED, Published(FailingBattle, no_recording))
    assert (comparison.kind, comparison.what) == ("published stops", "a laser beam found no unit")


def test_the_report_has_both_sides(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    won, lost = trained.Result(True, 20.0, 30), trained.Result(False, 10.0, 40)
    compared = [
        trained.Comparison(5, "same", "", won, won),
        trained.Comparison(6, "different", "after 3 steps, ...", lost, won),
        trained.Comparison(7, "published stops", "a laser beam found no unit", lost, lost),
    ]
    trained.report(plan(folder), compared, as_json=False)
    lines = capsys.readouterr().out.splitlines()
    assert "published   50.0 % won  return 15.0000  70 steps" in lines[1]
    assert "pool       100.0 % won  return 20.0000  60 steps" in lines[2]
    assert lines[3].strip() == "1 same, 1 different, 1 published stops"
    trained.report(plan(folder), compared, as_json=True)
    result = json.loads(capsys.readouterr().out)
    assert (result["kinds"]["different"], result["pool"]["win_rate"]) == (1, 1.0)


def test_a_team_of_a_custom_scenario_plays_by_its_files_and_limit(tmp_path: Path) -> None:
    unit = json.loads((scenarios.UNITS / "MARINE.json").read_text())
    (tmp_path / "scout.json").write_text(json.dumps({**unit, "hp": 60}))
    scenario = scenarios.standard("3m").scenario
    for group in scenario["groups"]:
        group["units"] = {"scout": 3}
    own = {"name": "mine", "episode_limit": 9, "custom_unit_path": "."}
    (tmp_path / "mine.json").write_text(json.dumps({**scenario, **own}))
    run = tmp_path / "run"
    program("train", tmp_path / "mine.json", "--steps", "1000", "--seed", "1", "--out", run)
    for file in ("scout.json", "mine.json"):
        (tmp_path / file).unlink()  # the run has all that is needed
    custom = plan(run)
    assert (custom.files.name, custom.files.standard, custom.episode_limit) == ("mine", False, 9)
    assert custom.files.units["scout"]["hp"] == 60
    compared = trained.compare(custom, SEED, Published(PoolBattle, no_recording))
    assert (compared.kind, compared.published.steps, compared.pool.steps) == ("same", 9, 9)


def test_last_actions_are_seen_as_in_the_pool() -> None:
    with sp.make("3m", num_envs=1, obs_last_actions=3, episode_limit=None) as envs:
        n_features = envs.spec.obs_size - 3 * envs.spec.n_actions
        weight = np.random.default_rng(1).normal(size=(envs.spec.n_actions, envs.spec.obs_size))
        player = Team(lambda obs: np.asarray(obs @ weight.T), 3).player(1, greedy=False)
        batch = envs.reset(seed=1)
        for _ in range(20):
            frame = PoolBattle.frame(batch)
            alive = ~frame.avail_actions[:, 0]
            inputs = player.inputs(frame._replace(obs=frame.obs[:, :n_features]))
            assert np.array_equal(inputs[alive], frame.obs[alive])
            actions = player.choose(frame._replace(obs=frame.obs[:, :n_features]))
            batch = envs.step(np.array([actions], np.int32))


def test_a_run_with_other_rules_is_refused(folder: Path, tmp_path: Path) -> None:
    run = json.loads((folder / "run.json").read_text())
    (tmp_path / "run.json").write_text(json.dumps({**run, "rules": "paper"}))
    with pytest.raises(ValueError, match="rules `smaclite`, got `paper`"):
        plan(tmp_path)
