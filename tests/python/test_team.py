"""Teams in Python: loaded, and played as the program plays them."""

from __future__ import annotations

import copy
import json
import multiprocessing
import pickle
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp

from conftest import REPOSITORY, changed_scenario, program

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
    team = sp.load_team(folder, greedy=greedy, seed=0)
    with sp.make("3m", num_envs=64, **team.settings) as envs:
        ours = sp.evaluate(envs, team, episodes=256, seed=5)
    options = ["--seed=5", *(["--greedy"] if greedy else [])]
    done = program("evaluate", folder, "--episodes=256", "--json", *options)
    result = json.loads(done.stdout.splitlines()[-1])
    if greedy:  # nothing is drawn, but by the seeds of the environments
        assert ours.mean_return == pytest.approx(result["mean_return"], abs=1e-4)
        assert ours.win_rate == result["win_rate"] and ours.mean_length == result["mean_length"]
    else:
        error = (result["return_deviation"] ** 2 * 2 / 256) ** 0.5
        assert abs(ours.mean_return - result["mean_return"]) < 5 * error


def test_a_team_that_plays_the_enemies_draws_its_actions() -> None:
    """With `--greedy`, that of the enemies was greedy, too, which it never is in training."""
    options = ["--opponent", "zoo:2s3z", "--episodes=256", "--seed=5", "--greedy", "--json"]
    result = json.loads(program("evaluate", "zoo:2s3z", *options).stdout.splitlines()[-1])
    rivals = [sp.load_team("2s3z", side="enemies", greedy=greedy, seed=1) for greedy in (False, True)]
    with sp.make("2s3z", 64, **rivals[0].settings) as envs:
        team = sp.load_team("2s3z", greedy=True)
        drawn, greedy = (sp.evaluate(envs, team, episodes=256, seed=5, against=rival) for rival in rivals)
    error = (result["return_deviation"] ** 2 * 2 / 256) ** 0.5
    assert abs(drawn.mean_return - result["mean_return"]) < 5 * error
    assert abs(greedy.mean_return - result["mean_return"]) > 5 * error


@pytest.mark.parametrize("scenario", ["MMM", "terran_5_vs_5"])
def test_a_team_over_units_plays_as_the_program_plays_it(tmp_path: Path, scenario: str) -> None:
    """With a healer among the agents, known by its type, which in one of the scenarios is drawn."""
    options: dict[str, Any] = {"network": "units", "actor_lr": 0.01, "steps": 5000, **SMALL}
    team = sp.train(scenario, tmp_path / "run", seed=1, **options)
    check_greedy(team, scenario, tmp_path / "run")


def test_a_team_of_several_maps_plays_others_as_the_program_does(tmp_path: Path) -> None:
    """Also a scenario of the user's, with a unit type that no other map has."""
    options = ["--steps", "5000", "--actor-lr", "0.01", "--num-envs", "16", "--horizon", "32"]
    done = program("train", "--maps", "2s3z,MMM", *options, "--out", tmp_path / "run")
    assert done.stdout.startswith("2 maps: "), done.stdout
    own = json.loads((REPOSITORY / "scenarios/data/3m.json").read_text())
    units = json.loads((REPOSITORY / "units/data/MARINE.json").read_text())
    (tmp_path / "GUARD.json").write_text(json.dumps({**units, "attack_range": 7, "hp": 70}))
    own["custom_unit_path"] = "."
    own["groups"][0]["units"] = {"GUARD": 3}
    (tmp_path / "own.json").write_text(json.dumps(own))
    for scenario in ("MMM", "zerg_5_vs_5", str(tmp_path / "own.json")):
        check_greedy(
            sp.load_team(tmp_path / "run", map=scenario), scenario, tmp_path / "run", "--map", scenario
        )
    # As opponents, on a map with other units than its first one has.
    with sp.make("3m", 2, opponent=str(tmp_path / "run")) as envs:
        envs.reset(seed=1)
        envs.step(envs.sample_actions())
    # As a team of one map, which plays wherever a folder does.
    adapted = tmp_path / "on-MMM"
    program("adapt", tmp_path / "run", "MMM", "--out", adapted)
    check_greedy(sp.load_team(adapted), "MMM", tmp_path / "run", "--map", "MMM")
    done = program("adapt", tmp_path / "run", "MMM", "--out", adapted, check=False)
    assert done.returncode == 1 and "already holds a run" in done.stderr


def test_a_team_of_one_map_plays_no_other(folder: Path) -> None:
    expected = "the team was trained in `3m` and plays that alone"
    with pytest.raises(sp.errors.InvalidRequest, match=expected):
        sp.load_team(folder, map="8m")
    done = program("evaluate", folder, "--map", "8m", check=False)
    assert done.returncode == 1 and expected in done.stderr


def check_greedy(team: sp.Team, scenario: str, folder: Path, *options: str) -> None:
    team.greedy = True
    with sp.make(scenario, num_envs=32, **team.settings) as envs:
        ours = sp.evaluate(envs, team, episodes=32, seed=5)
    done = program("evaluate", folder, "--episodes=32", "--seed=5", "--greedy", "--json", *options)
    result = json.loads(done.stdout.splitlines()[-1])
    assert ours.mean_return == pytest.approx(result["mean_return"], abs=1e-4)
    assert ours.win_rate == result["win_rate"] and ours.mean_length == result["mean_length"]


def test_a_network_that_is_unknown_is_an_error(tmp_path: Path) -> None:
    shutil.copytree(REPOSITORY / "bindings/learn/zoo/3m", tmp_path / "run")
    text = (tmp_path / "run/run.json").read_text()
    (tmp_path / "run/run.json").write_text(text.replace('"hidden"', '"network": "graph", "hidden"'))
    expected = r"run\.json.*network must be `flat`, `units` or `universal`, got `graph`"
    with pytest.raises(sp.errors.InvalidRequest, match=expected):
        sp.load_team(tmp_path / "run")


def test_what_holds_no_team_is_an_error(tmp_path: Path, folder: Path) -> None:
    with pytest.raises(sp.errors.InvalidRequest, match=r"is not the folder of a run .*: it has no run\.json"):
        sp.load_team(tmp_path)
    team = sp.load_team(folder)
    with (
        sp.make("8m", num_envs=2) as envs,
        pytest.raises(sp.errors.InvalidRequest, match=r"observations \[M, 3, 39\], got \[2, 8, 80\]"),
    ):
        team(envs.reset())


@pytest.mark.parametrize("scenario", [name for name in sp.ZOO if name != "all-maps"])
def test_a_team_of_the_zoo_wins(scenario: str) -> None:
    """Nine of ten battles are what it must have won to be there; fewer are played here."""
    team = sp.load_team(scenario, greedy=True)
    with sp.make(scenario, num_envs=16, **team.settings) as envs:
        assert sp.evaluate(envs, team, episodes=16, seed=7).win_rate >= 0.75


@pytest.mark.parametrize("scenario", ["3m", "2s3z", "MMM", "10m_vs_11m"])
def test_one_team_of_the_zoo_wins_many_maps(scenario: str) -> None:
    team = sp.load_team("all-maps", map=scenario, greedy=True)
    with sp.make(scenario, num_envs=16, **team.settings) as envs:
        assert sp.evaluate(envs, team, episodes=16, seed=7).win_rate >= 0.75


def test_teams_of_the_zoo_have_names(tmp_path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert repr(sp.load_team("3m")) == repr(sp.load_team("zoo:3m")) == "<Team 'zoo:3m', sampled actions>"
    monkeypatch.chdir(folder.parent)  # a folder of that name is taken
    assert repr(sp.load_team("3m")) == "<Team '3m', sampled actions>"
    monkeypatch.chdir(tmp_path)
    with pytest.raises(sp.errors.InvalidRequest, match=r"^the zoo has no team `4m`; it has 10m_vs_11m, "):
        sp.load_team("zoo:4m")
    # "[Errno 2] No such file or directory: '3n/run.json'" was all that it said.
    with pytest.raises(
        sp.errors.InvalidRequest, match=r"no folder `3n`, and the zoo has no team `3n`; it has .*3m"
    ):
        sp.load_team("3n")


def test_the_best_weights_play_unless_others_are_named(tmp_path: Path) -> None:
    options = {**SMALL, "steps": 3000, "evaluate_every": 1000, "lr_end": 1.0}
    sp.train("3m", tmp_path / "run", seed=1, **options)  # type: ignore[arg-type]
    # Those before the training differ from the last ones for certain.
    shutil.copy(tmp_path / "run/evaluations/000000000000.safetensors", tmp_path / "run/best.safetensors")
    obs = np.ones((1, 3, 66), np.float32)
    teams = [sp.load_team(tmp_path / "run", weights=weights) for weights in (None, "best", "last")]
    default, best, last = (team.logits(obs) for team in teams)
    assert (default == best).all() and (best != last).any()
    with pytest.raises(sp.errors.InvalidRequest, match='weights must be None, "best" or "last"'):
        sp.load_team(tmp_path / "run", weights="worst")  # type: ignore[arg-type]


def damaged(data: bytes, how: str) -> bytes:
    """A file of weights with NaN, or with one bit that is flipped."""
    start = 8 + int.from_bytes(data[:8], "little")
    if how == "NaN":  # and its checksum
        header = re.sub(rb'"crc32c":"[0-9a-f]*"', b'"none":"00000000"', data[8:start])
        header = header.ljust(start - 8)[: start - 8]
        return data[:8] + header + np.full((len(data) - start) // 4, np.nan, "<f4").tobytes()
    at = start + (len(data) - start) // 2
    return data[:at] + bytes([data[at] ^ 64]) + data[at + 1 :]


@pytest.mark.parametrize(("how", "why"), [("NaN", "contains NaN"), ("a bit", "its checksum differs")])
def test_damaged_weights_are_refused(how: str, why: str, folder: Path, tmp_path: Path) -> None:
    """The program refused them, and Python played them: with NaN, action 1 in every step."""
    shutil.copytree(folder, tmp_path / "run")
    path = tmp_path / "run/weights.safetensors"
    path.write_bytes(damaged(path.read_bytes(), how))
    with pytest.raises(sp.errors.InvalidRequest, match=f"weights.safetensors` is damaged .*{why}"):
        sp.load_team(tmp_path / "run")


VALUES: list[Any] = [-1, 2**64, 1e308, None, True, "x" * 3000, "\x1b[31m", [], {}, [1] * 20]


@pytest.mark.parametrize("value", VALUES, ids=lambda value: repr(value)[:12])
def test_a_damaged_description_is_an_error_with_the_name_of_its_file(
    value: Any, folder: Path, tmp_path: Path
) -> None:
    """Each key was read as it came, and failed somewhere as an AttributeError or a TypeError."""
    shutil.copytree(folder, tmp_path / "run")
    path = tmp_path / "run/run.json"
    run, messages = json.loads(path.read_text()), list[str]()
    for whole, keys in [(run, list(run)), (run["config"], list(run["config"]))]:
        for key in keys:
            before, whole[key] = whole[key], value
            path.write_text(json.dumps(run))
            try:
                sp.load_team(tmp_path / "run")  # some values are those of another run
            except sp.errors.InvalidRequest as error:
                messages.append(str(error))
            whole[key] = before
    assert all("run" in text and len(text) < 600 and "\x1b" not in text for text in messages), messages
    assert messages


def play_in_another_process(team: sp.Team, seed: int) -> float:
    with sp.make("3m", num_envs=4, threads=1, **team.settings) as envs:
        return sp.evaluate(envs, team, episodes=8, seed=seed).mean_return


def test_a_team_is_sent_to_other_processes() -> None:
    """`multiprocessing` pickles what it sends to processes that it spawns."""
    team = sp.load_team("3m", seed=3)
    with multiprocessing.get_context("spawn").Pool(1) as workers:
        theirs = workers.apply(play_in_another_process, (team, 1))
    copied = copy.deepcopy(team)
    assert theirs == play_in_another_process(team, 1) == play_in_another_process(copied, 1)


@pytest.mark.parametrize("make_copy", [copy.copy, copy.deepcopy])
def test_a_copy_of_a_team_draws_by_a_generator_of_its_own(make_copy: Callable[[sp.Team], sp.Team]) -> None:
    """One of `copy.copy` shared it, so that each changed what the other drew."""
    team = sp.load_team("3m", seed=3)
    with sp.make("3m", num_envs=4, **team.settings) as envs:
        batch = envs.reset(seed=1)
        team(batch)
        copied = make_copy(team)
        theirs = [copied(batch) for _ in range(9)]
        np.testing.assert_array_equal(theirs, [team(batch) for _ in range(9)])
    assert repr(copied) == repr(team) and copied.seed == 3


def test_environments_say_what_to_use_instead_of_a_copy() -> None:
    with sp.make("3m", num_envs=1) as envs:
        for make_copy in (pickle.dumps, copy.copy, copy.deepcopy):
            with pytest.raises(TypeError, match="`fork` copies battles .* `snapshot` and `reset`"):
                make_copy(envs)


def test_a_team_that_knows_units_plays_no_enemies_that_are_others() -> None:
    """`make` refused it, and here it took zealots for stalkers."""
    with pytest.raises(sp.errors.InvalidRequest, match="both sides have the same units and shields"):
        sp.load_team("all-maps", map="3s_vs_3z", side="enemies")
    assert sp.load_team("all-maps", map="2s3z", side="enemies").scenario == "2s3z"


def test_a_team_of_changed_battles_names_no_standard_scenario(tmp_path: Path) -> None:
    """`make(team.scenario)` played the standard scenario of that name: 5 % of battles won instead of 82."""
    groups = [
        {"x": x, "y": 16, "faction": faction, "units": {"MARINE": 3}}
        for x, faction in ((9, "ALLY"), (15, "ENEMY"))
    ]
    file = changed_scenario(tmp_path, "3m", groups=groups)
    small: dict[str, Any] = {"num_envs": 4, "horizon": 8, "minibatches": 1, "hidden": [8, 8], "threads": 1}
    for scenario, expected in ((str(file), None), ("3m", "3m")):
        folder = tmp_path / f"run-{expected}"
        team = sp.train(scenario, folder, steps=64, **small)
        assert (team.name, team.scenario) == ("3m", expected)


def test_a_run_whose_pool_had_no_episode_limit_plays_episodes_that_end(folder: Path, tmp_path: Path) -> None:
    """Some commands played it, and others said that it must have a limit, which nothing could give it."""
    run = shutil.copytree(folder, tmp_path / "run")
    described = json.loads((run / "run.json").read_text())
    (run / "run.json").write_text(json.dumps(described | {"episode_limit": None}))
    assert sp.load_team(run).settings["episode_limit"] == 1000
    dataset = tmp_path / "episodes.smdata"
    program("dataset", "record", run, "--episodes", "3", "--out", dataset)


def test_a_team_plays_the_enemies(folder: Path) -> None:
    """How it does was found by guessing; and with the `opponent` of its settings a script played them."""
    team, rival = sp.load_team("3m"), sp.load_team("3m", side="enemies", seed=1)
    assert repr(rival) == "<Team 'zoo:3m', sampled actions, plays the enemies>"
    wins = losses = 0
    with sp.make("3m", num_envs=64, **rival.settings) as envs:
        hold = sp.ScriptedPolicy("hold", envs)
        batch = envs.reset(seed=1)
        swapped = batch.replace(obs=batch.enemy_obs, avail_actions=batch.enemy_avail_actions)
        ours = sp.load_team("3m", greedy=True)(swapped)
        assert (ours == sp.load_team("3m", side="enemies", greedy=True)(batch)).all()
        for _ in range(200):
            batch = envs.step(np.concatenate([hold(batch), rival(batch)], axis=1))
            wins += int(batch.battle_won.sum())
            losses += int((batch.terminated & (batch.dead_allies == 3)).sum())
    assert losses > 9 * wins, (losses, wins)
    without = {name: value for name, value in team.settings.items() if name != "opponent"}
    assert rival.settings == {**without, "sides": "mirrored"}
    with (
        sp.make("5m_vs_6m", num_envs=2, sides="both") as envs,
        pytest.raises(
            sp.errors.InvalidRequest, match="plays the enemies of a scenario whose two sides have equal sizes"
        ),
    ):
        rival(envs.reset())
    with pytest.raises(sp.errors.InvalidRequest, match=r"got \[3\]: a team plays the enemies of a scenario"):
        rival.logits(np.zeros(3, np.float32))  # which was an IndexError
    with pytest.raises(sp.errors.InvalidRequest, match='side must be "allies" or "enemies", got .enemy'):
        sp.load_team("3m", side="enemy")  # type: ignore[arg-type]
