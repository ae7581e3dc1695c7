"""Teams in Python: trained by the program, and played in NumPy as the program plays them."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp

SMALL = {"num_envs": 16, "horizon": 32, "threads": 2}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("runs") / "3m"
    records: list[dict[str, Any]] = []
    opponent = {"attack_move": 0.5, "hold": 0.5}
    team = sp.train(
        "3m", path, steps=30_000, seed=1, opponent=opponent, on_update=records.append, last_actions=1, **SMALL
    )
    assert records[-1]["steps"] >= 30_000 and records[-1]["episodes"] > 0
    assert team.settings["opponent"] == opponent and team.settings["obs_last_actions"] == 1
    return path


@pytest.mark.parametrize("greedy", [True, False])
def test_a_team_plays_as_the_program_plays_it(folder: Path, greedy: bool) -> None:
    team = sp.load_team(folder, greedy=greedy)
    with sp.make("3m", num_envs=64, **team.settings) as envs:
        ours = sp.evaluate(envs, team, episodes=256, seed=5)
    argv = [sys.executable, "-m", "smaclite_pool", "evaluate", str(folder), "--episodes=256", "--json"]
    options = ["--seed=5", *(["--greedy"] if greedy else [])]
    done = subprocess.run([*argv, *options], capture_output=True, text=True, check=True)
    result = json.loads(done.stdout.splitlines()[-1])
    if greedy:  # nothing is drawn, but by the seeds of the environments
        assert ours.mean_return == pytest.approx(result["mean_return"], abs=1e-4)
        assert ours.win_rate == result["win_rate"] and ours.mean_length == result["mean_length"]
    else:
        error = (result["return_deviation"] ** 2 * 2 / 256) ** 0.5
        assert abs(ours.mean_return - result["mean_return"]) < 5 * error


def test_what_holds_no_team_is_an_error(tmp_path: Path, folder: Path) -> None:
    with pytest.raises(sp.InvalidRequest, match=r"is not the folder of a trained team: .*run\.json"):
        sp.load_team(tmp_path)
    team = sp.load_team(folder)
    with (
        sp.make("8m", num_envs=2) as envs,
        pytest.raises(sp.InvalidRequest, match=r"observations are \[M, 3, 39\], got \[2, 8, 80\]"),
    ):
        team(envs.reset())


def test_errors_of_the_program_are_raised(tmp_path: Path, folder: Path) -> None:
    with pytest.raises(sp.InvalidRequest, match="already holds a run"):
        sp.train("3m", folder, steps=100)
    with pytest.raises(sp.InvalidRequest, match="did you mean `3m`|unknown scenario `3mm`"):
        sp.train("3mm", tmp_path / "a", steps=100)
    with pytest.raises(sp.InvalidRequest, match="unexpected argument '--learning-rate'"):
        sp.train("3m", tmp_path / "b", steps=100, learning_rate=0.1)


@pytest.mark.parametrize("option", ["seeds", "resume", "json"])
def test_options_that_do_not_train_one_team_are_refused_before_the_training(
    option: str, tmp_path: Path
) -> None:
    """With `seeds=3`, three teams were trained to the end, and then none of them was found."""
    with pytest.raises(sp.InvalidRequest, match=f"`{option}` is no option of `train`"):
        sp.train("3m", tmp_path / "run", steps=100, **{option: 3})  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())


def test_as_many_steps_are_trained_as_by_the_program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`train` had a default of its own, half of the program's."""
    argv = [sys.executable, "-m", "smaclite_pool", "train", "--help"]
    usage = subprocess.run(argv, capture_output=True, text=True, check=True).stdout
    found = re.search(r"--steps.*?\[default: (\d+)\]", usage, re.DOTALL)
    assert found

    class Stop(Exception):
        pass

    def stop(_: dict[str, Any], steps: int) -> str:
        raise Stop(steps)

    monkeypatch.setattr("smaclite_pool._team.progress", stop)
    with pytest.raises(Stop) as stopped:
        sp.train("3m", tmp_path / "run", **SMALL)  # type: ignore[arg-type]
    config = json.loads((tmp_path / "run/run.json").read_text())["config"]
    assert config["steps"] == stopped.value.args[0] == int(found[1])


@pytest.mark.parametrize("scenario", sp.ZOO)
def test_a_team_of_the_zoo_wins(scenario: str) -> None:
    """Nine of ten battles are what it must have won to be there; fewer are played here."""
    team = sp.load_team(scenario, greedy=True)
    with sp.make(scenario, num_envs=16, **team.settings) as envs:
        assert sp.evaluate(envs, team, episodes=16, seed=7).win_rate >= 0.75


def test_teams_of_the_zoo_have_names(tmp_path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert repr(sp.load_team("3m")) == repr(sp.load_team("zoo:3m")) == "<Team 'zoo:3m', sampled actions>"
    monkeypatch.chdir(folder.parent)  # a folder of that name is taken
    assert repr(sp.load_team("3m")) == "<Team '3m', sampled actions>"
    monkeypatch.chdir(tmp_path)
    with pytest.raises(sp.InvalidRequest, match=r"`zoo:4m` is not the folder of a trained team"):
        sp.load_team("zoo:4m")


def test_the_best_weights_play_unless_others_are_named(tmp_path: Path) -> None:
    options = {**SMALL, "steps": 3000, "evaluate_every": 1000, "lr_end": 1.0}
    sp.train("3m", tmp_path / "run", seed=1, **options)  # type: ignore[arg-type]
    # Those before the training differ from the last ones for certain.
    shutil.copy(tmp_path / "run/evaluations/000000000000.safetensors", tmp_path / "run/best.safetensors")
    obs = np.ones((1, 3, 66), np.float32)
    teams = [sp.load_team(tmp_path / "run", weights=weights) for weights in (None, "best", "last")]
    default, best, last = (team.logits(obs) for team in teams)
    assert (default == best).all() and (best != last).any()
    with pytest.raises(sp.InvalidRequest, match='weights must be None, "best" or "last"'):
        sp.load_team(tmp_path / "run", weights="worst")  # type: ignore[arg-type]


def test_progress_is_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sp.train("3m", tmp_path / "run", steps=2000, seed=1, **SMALL)  # type: ignore[arg-type]
    assert "of 2000 steps" in capsys.readouterr().out
