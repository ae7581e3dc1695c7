"""Teams in Python: trained by the program, and played as the program plays them."""

from __future__ import annotations

import copy
import json
import multiprocessing
import os
import pickle
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp

from conftest import REPOSITORY, Serve, changed_scenario, posix, program

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


def test_errors_of_the_program_are_raised(tmp_path: Path, folder: Path) -> None:
    with pytest.raises(
        sp.errors.InvalidRequest, match="already holds a run; resume it with `smaclite-pool train --resume`"
    ):
        sp.train("3m", folder, steps=100)
    with pytest.raises(sp.errors.InvalidRequest, match="did you mean `3m`|unknown scenario `3mm`"):
        sp.train("3mm", tmp_path / "a", steps=100)
    with pytest.raises(sp.errors.InvalidRequest) as raised:
        sp.train("3m", tmp_path / "b", steps=100, learning_rate=0.1)
    assert str(raised.value) == "unknown keyword `learning_rate` found"  # the usage of a program followed
    with pytest.raises(
        sp.errors.InvalidRequest, match="invalid value '1' for `hidden`: must be a whole number between 2"
    ):
        sp.train("3m", tmp_path / "c", hidden=[1, "x"])
    with pytest.raises(sp.errors.InvalidRequest, match="`league_size` need `opponent` league"):
        sp.train("3m", tmp_path / "d", league_every=5)
    # Keywords stood in the middle of commands.
    with pytest.raises(sp.errors.InvalidRequest) as raised:
        sp.train("3m", tmp_path / "e", pool="nope")
    assert "`smaclite-pool serve SCENARIO:N --name NAME`" in str(raised.value)


@pytest.mark.parametrize("option", ["seeds", "resume", "json"])
def test_options_that_do_not_train_one_team_are_refused_before_the_training(
    option: str, tmp_path: Path
) -> None:
    """With `seeds=3`, three teams were trained to the end, and then none of them was found."""
    with pytest.raises(sp.errors.InvalidRequest, match=f"`{option}` is no option of `train`"):
        sp.train("3m", tmp_path / "run", steps=100, **{option: 3})  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())


def test_as_many_steps_are_trained_as_by_the_program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`train` had a default of its own, half of the program's."""
    found = re.search(r"--steps.*?\[default: (\d+)\]", program("train", "--help").stdout, re.DOTALL)
    assert found

    class Stop(Exception):
        pass

    def stop(_: dict[str, Any], steps: int) -> str:
        raise Stop(steps)

    monkeypatch.setattr("smaclite_pool._training.progress_line", stop)
    with pytest.raises(Stop) as stopped:
        sp.train("3m", tmp_path / "run", **SMALL)  # type: ignore[arg-type]
    config = json.loads((tmp_path / "run/run.json").read_text())["config"]
    assert config["steps"] == stopped.value.args[0] == int(found[1])


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


def test_progress_is_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One line of the first update was all, so that a complete training looked as if it was aborted."""
    sp.train("3m", tmp_path / "run", steps=2000, seed=1, **SMALL)  # type: ignore[arg-type]
    first, *_, last, end = capsys.readouterr().out.splitlines()
    assert "of 2000 steps" in first and end == "complete"
    assert int(last.split()[0]) >= 2000, last


def test_arguments_are_those_of_python(tmp_path: Path) -> None:
    """Lists were passed as '[32', teams as '<Team', flags as '--zero-sum=True', and a scenario that begins
    with a hyphen was an option."""
    small: dict[str, Any] = {**SMALL, "steps": 500}
    rival = sp.load_team("3m")
    team = sp.train("3m", tmp_path / "a", hidden=[16, 8], opponent=rival, last_actions=4, **small)
    assert team.config["hidden"] == [16, 8] and team.config["enemies"] == {"team": {"folder": "zoo:3m"}}
    team = sp.train("3m", tmp_path / "b", opponent="self", zero_sum=True, evaluate_every=None, **small)
    assert team.config["enemies"]["self_play"]["zero_sum"] is True
    with pytest.raises(sp.errors.InvalidRequest, match="^`--help` is neither a standard scenario"):
        sp.train("--help", tmp_path / "c", steps=500)
    with pytest.raises(sp.errors.InvalidRequest, match="a team with default weights and sampled actions"):
        sp.train("3m", tmp_path / "d", opponent=sp.load_team("3m", greedy=True))


def test_a_team_is_trained_on_a_running_pool(serve: Serve, tmp_path: Path) -> None:
    """The default of `opponent` was an option of the program, which refuses one beside `pool`; and a list of
    lanes was the name of one lane."""
    lanes = ["one=3m:8", "two=3m:4"]
    options = ["--opponent", "hold", "--obs-last-actions", "4", "--threads", "1", "--name", "train"]
    serve(*lanes, *options)
    records: list[dict[str, Any]] = []
    team = sp.train(
        "3m",
        tmp_path / "run",
        pool="train",
        lane=["one", "two"],
        steps=500,
        horizon=32,
        threads=1,
        on_update=records.append,
    )
    assert records[0]["steps"] == pytest.approx(32 * (8 + 4), abs=12)  # without those that were resets
    assert team.settings["opponent"] == {"hold": 1.0}
    with pytest.raises(sp.errors.InvalidRequest, match="`opponent` cannot be used with `pool"):
        sp.train("3m", tmp_path / "other", pool="train", opponent="kite")


LEARNER = """
import signal, sys, time
import smaclite_pool as sp

signal.signal(signal.SIGINT, signal.default_int_handler)  # SIGINT is ignored in background jobs of a script

def show(record):
    print(record["update"], flush=True)
    {on_update}

sp.train("3m", sys.argv[1], steps=10**8, on_update=show, num_envs=8, horizon=16, threads=1)
"""


def updates_logged(run: Path) -> int:
    return len((run / "log.csv").read_text().splitlines()) - 1


def wait_until_idle(run: Path) -> None:
    """Waits until a training, whose updates take milliseconds, has made none for a while."""
    before, seen = -1, updates_logged(run)
    while seen != before:
        time.sleep(0.5)
        before, seen = seen, updates_logged(run)


def continues(run: Path) -> None:
    """Resumes the run for one update, which must be the next one after its log."""
    updates = updates_logged(run)
    done = program("train", "--resume", run, "--steps", updates * 8 * 16 + 1, "--json")
    assert json.loads(done.stdout.splitlines()[0])["update"] == updates + 1, "nothing is made twice"


@pytest.mark.parametrize("on_update", ["pass", "time.sleep(0.01)", "time.sleep(1000)"])
@posix
def test_ctrl_c_in_a_terminal_saves_the_last_update(on_update: str, tmp_path: Path) -> None:
    """A terminal sends Ctrl-C to all processes of its group. The program got it, and again from `train`,
    ended at once by the second, and up to a minute of training was lost. While `on_update` is slow, the
    program waits for a reader of what it prints."""
    run = tmp_path / "run"
    argv = [sys.executable, "-c", LEARNER.format(on_update=on_update), str(run)]
    learner = subprocess.Popen(
        argv, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    assert learner.stdout is not None
    while learner.stdout.readline().strip() != ("1" if "1000" in on_update else "5"):
        pass
    if "1000" in on_update:
        wait_until_idle(run)  # the pipe is full
    os.killpg(learner.pid, signal.SIGINT)
    _, messages = learner.communicate(timeout=100)
    assert "KeyboardInterrupt" in messages and learner.returncode == -signal.SIGINT, messages
    continues(run)


def test_an_exception_of_on_update_saves_the_last_update_and_passes_on(tmp_path: Path) -> None:
    class Stop(Exception):
        pass

    def stop(record: dict[str, Any]) -> None:
        if record["update"] == 3:
            raise Stop

    with pytest.raises(Stop):
        sp.train("3m", tmp_path / "run", steps=10**8, on_update=stop, num_envs=8, horizon=16, threads=1)
    continues(tmp_path / "run")


@posix
def test_many_messages_do_not_stop_a_training(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """They went to a pipe that nothing read before the end: when it was full, both waited without end."""
    real = sys.executable
    chatty = tmp_path / "python"
    chatty.write_text(f"#!/bin/sh\nhead -c 1000000 /dev/zero | tr '\\0' x >&2\nexec {real} \"$@\"\n")
    chatty.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(chatty))
    sp.train("3m", tmp_path / "run", steps=500, **SMALL)  # type: ignore[arg-type]
    assert len(capfd.readouterr().err) >= 1_000_000


@posix
def test_a_training_that_is_ended_from_outside_can_be_continued(tmp_path: Path) -> None:
    run, argv = tmp_path / "run", list[str]()

    def end(_: dict[str, Any]) -> None:
        if not argv:
            found = subprocess.run(
                ["pgrep", "-n", "-P", str(os.getpid()), "-f", "train"],
                capture_output=True,
                text=True,
                check=True,
            )
            argv.extend(found.stdout.split())
            os.kill(int(argv[0]), signal.SIGTERM)

    with pytest.raises(
        sp.errors.PoolError, match=r"signal 15 ended the training; .* --resume .*run` continues"
    ):
        sp.train("3m", run, steps=10**8, on_update=end, num_envs=8, horizon=16, threads=1)
    continues(run)


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
    assert rival.settings == {**without, "sides": "both", "mirror": True}
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
