"""Code written for the published packages `smaclite`, `smac` and `smacv2`, on their drop-in replacements."""

from __future__ import annotations

import copy
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp

pytest.importorskip("gymnasium")

import gymnasium
from gymnasium.wrappers import TimeLimit
from smaclite_pool import compat
from smaclite_pool._render import Window

from conftest import REPOSITORY, posix, run_script

GOLDEN = Path(__file__).resolve().parents[1] / "golden" / "steps"


@pytest.fixture(autouse=True)
def installed() -> Iterator[None]:
    """The replacement of `smaclite` in this process, undone afterwards."""
    path = sys.path[:]
    compat.install_smaclite()
    yield
    sys.path[:] = path
    for name in [name for name in sys.modules if name.split(".")[0] == "smaclite"]:
        del sys.modules[name]
    for name in [name for name in gymnasium.registry if name.startswith("smaclite/")]:
        del gymnasium.registry[name]


def recorded() -> list[Path]:
    """One recorded battle per scenario."""
    first = {path.name.split("-")[0]: path for path in sorted(GOLDEN.glob("*.npz"), reverse=True)}
    return list(first.values())


@pytest.mark.parametrize("path", recorded(), ids=lambda path: path.stem)
def test_it_plays_the_recorded_battles_of_the_published_environment(path: Path) -> None:
    with np.load(path) as trace:
        meta = json.loads(bytes(trace["meta"]))
        battle = {name: trace[name] for name in ("obs", "state", "avail", "actions", "reward", "terminated")}
    env = gymnasium.make(f"smaclite/{meta['scenario']}-v0", seed=meta["seed"], use_cpp_rvo2=True)
    inner: Any = env.unwrapped
    for size in ("n_agents", "n_enemies", "n_actions", "obs_size", "state_size"):
        assert getattr(inner, size) == meta[size], size
    env.reset()
    for step, actions in enumerate(battle["actions"].tolist()):
        at = f"step {step}"
        np.testing.assert_allclose(inner.get_obs(), battle["obs"][step], atol=1e-5, err_msg=at)
        np.testing.assert_allclose(inner.get_state(), battle["state"][step], atol=1e-5, err_msg=at)
        np.testing.assert_array_equal(inner.get_avail_actions(), battle["avail"][step], err_msg=at)
        seen, reward, terminated, truncated, info = env.step(actions)
        assert reward == pytest.approx(battle["reward"][step], abs=1e-5)
        assert (terminated, truncated) == (battle["terminated"][step], False)
        assert all(isinstance(value, (bool, int, float)) for value in info.values())
    np.testing.assert_allclose(seen, battle["obs"][-1], atol=1e-5)
    env.close()


def episode(env: Any, rng: np.random.Generator) -> tuple[int, dict[str, Any]]:
    """Plays an episode as EPyMARL does; returns the number of steps and the last info."""
    env.reset(seed=None, options=None)
    for step in range(1, 10_000):
        legal = [np.flatnonzero(row) for row in env.unwrapped.get_avail_actions()]
        *_, terminated, truncated, info = env.step([int(rng.choice(actions)) for actions in legal])
        if terminated or truncated:
            return step, info
    raise AssertionError("the episode does not end")


def test_a_time_out_is_marked_only_when_asked() -> None:
    """EPyMARL distinguishes a time-out from a defeat by `info["episode_limit"]` alone."""
    limit, rng = 3, np.random.default_rng(1)
    cases: list[tuple[dict[str, Any], bool]] = [({}, False), ({"episode_limit": limit}, True)]
    for settings, marks in cases:
        made = gymnasium.make("smaclite/2s_vs_1sc-v0", seed=1, **settings)
        env: Any = TimeLimit(made, max_episode_steps=limit)
        length, info = episode(env, rng)
        assert (length, info.get("episode_limit", False)) == (limit, marks)
        assert sum(info.values()) == marks  # numbers only: EPyMARL adds them up
        env.close()


def test_there_is_no_episode_limit_by_default() -> None:
    env: Any = gymnasium.make("smaclite/2s_vs_1sc-v0", seed=1)
    env.reset()
    flee = [1, 1]
    for _ in range(400):
        *_, terminated, truncated, _ = env.step(flee)
        assert not truncated
        if terminated:
            break
    else:
        assert len(env.unwrapped.agents) == 2
    env.close()


def test_the_constructor_or_seed_sets_the_seed_of_the_first_reset() -> None:
    rng = np.random.default_rng
    env: Any = gymnasium.make("smaclite/2s3z-v0", seed=3)
    first = [episode(env, rng(0))[0] for _ in range(3)]
    env.close()
    again: Any = gymnasium.make("smaclite/2s3z-v0", seed=8)
    again.unwrapped.seed(3)
    assert [episode(again, rng(0))[0] for _ in range(3)] == first
    again.close()
    drawn = []
    for _ in range(2):  # without a seed NumPy's global generator decides
        np.random.seed(17)
        unseeded: Any = gymnasium.make("smaclite/2s3z-v0")
        drawn.append(unseeded.unwrapped.np_random_seed)
        unseeded.close()
    assert drawn[0] == drawn[1]


def test_the_seeds_of_an_action_space_repeat_its_samples() -> None:
    """Those of one seed per agent did not."""
    env: Any = gymnasium.make("smaclite/3m-v0", seed=1)
    env.reset()
    for seed in (3, (1, 2, 3)):
        samples = []
        for _ in range(2):
            env.action_space.seed(seed)
            samples.append([env.action_space.sample() for _ in range(5)])
        assert samples[0] == samples[1]
    env.close()


def test_a_scenario_file() -> None:
    with pytest.raises(sp.errors.InvalidRequest, match="map_file"):
        gymnasium.make("smaclite/custom-v0")
    with pytest.raises(sp.errors.InvalidRequest, match="map_info"):
        gymnasium.make("smaclite/custom-v0", map_info=object())
    with pytest.raises(sp.errors.ScenarioError, match="no_such_file"):
        gymnasium.make("smaclite/custom-v0", map_file="no_such_file.json")


def test_an_illegal_action_is_an_error_as_in_the_published_environment_or_a_stop() -> None:
    attack = [6] * 5  # no enemy is in range yet
    strict: Any = gymnasium.make("smaclite/2s3z-v0", seed=1)
    strict.reset()
    with pytest.raises(ValueError, match="action 6 is not available"):
        strict.step(attack)
    lenient: Any = gymnasium.make("smaclite/2s3z-v0", seed=1, illegal_actions="stop")
    lenient.reset()
    np.testing.assert_array_equal(lenient.step(attack)[0], strict.step([1] * 5)[0])
    strict.close()
    lenient.close()


def test_spaces_are_those_of_the_published_environment() -> None:
    env: Any = gymnasium.make("smaclite/MMM2-v0").unwrapped
    # The targets of the healer are the other allies, those of other agents are the enemies.
    assert [space.n for space in env.action_space] == [6 + 9] + [6 + 12] * 9
    assert env.observation_space[0] == gymnasium.spaces.Box(-1, 1, (env.obs_size,), np.float32)
    assert type(copy.deepcopy(env.action_space)) is gymnasium.spaces.Tuple
    assert env.reset()[0] in env.observation_space
    env.close()


def test_observations_of_drawn_teams_are_in_their_space() -> None:
    path = REPOSITORY / "scenarios/data/zerg_5_vs_5.json"
    env: Any = gymnasium.make("smaclite/custom-v0", map_file=path, seed=1).unwrapped
    env.action_space.seed(0)
    for _ in range(5):
        assert env.reset()[0] in env.observation_space
        ended = False
        while not ended:
            obs, _, terminated, truncated, _ = env.step(env.action_space.sample())
            assert obs in env.observation_space
            ended = terminated or truncated
    env.close()


def test_all_available_actions_of_drawn_teams_are_in_their_space() -> None:
    """Which agent is a healer is drawn; a space of one sample of the teams would lack its targets."""
    path = REPOSITORY / "scenarios/data/terran_5_vs_5.json"
    env: Any = gymnasium.make("smaclite/custom-v0", map_file=path, seed=1).unwrapped
    sizes = {int(space.n) for space in env.action_space.spaces}
    assert sizes == {env.n_actions}
    env.close()


def test_samples_are_available_and_in_the_space() -> None:
    """A healer can heal the last unit by an action that its space, as in the published one, does not have."""
    env: Any = gymnasium.make("smaclite/MMM2-v0", seed=1).unwrapped
    env.action_space.seed(1)
    for _ in range(8):
        env.reset()
        ended = False
        while not ended:
            actions = env.action_space.sample()
            assert actions in env.action_space
            *_, terminated, truncated, _ = env.step(actions)
            ended = terminated or truncated
    env.close()


def test_living_units_are_listed() -> None:
    env: Any = gymnasium.make("smaclite/2s3z-v0", seed=1).unwrapped
    assert env.agents == {} and env.enemies == {}
    env.reset()
    assert sorted(env.agents) == list(range(5)) and sorted(env.enemies) == list(range(5))
    env.action_space.seed(0)
    terminated = truncated = False
    while not (terminated or truncated):
        *_, terminated, truncated, info = env.step(env.action_space.sample())
        living = [agent for agent, mask in enumerate(env.get_avail_actions()) if not mask[0]]
        assert sorted(env.agents) == living and len(living) == 5 - info["dead_allies"]
        assert len(env.enemies) == 5 - info["dead_enemies"]
    assert info["dead_allies"] > 0
    env.close()


# Each way to install a replacement, in a separate process.

PLAY_SMACLITE = """
import gymnasium as gym
import smaclite
from smaclite.env import SMACliteEnv
env = gym.make("smaclite/2s3z-v0", seed=1)
assert isinstance(env.unwrapped, SMACliteEnv)
env.reset()
env.close()
print(smaclite.__file__)
"""

PLAY_SMAC = """
import smac
import smac.env
from smac.env import MultiAgentEnv, StarCraft2Env
from smac.env.multiagentenv import MultiAgentEnv as Base
from smac.env.starcraft2.maps import get_map_params
from smac.env.starcraft2.maps.smac_maps import get_map_params as of_table
from smac.env.starcraft2.starcraft2 import StarCraft2Env as Same
env = StarCraft2Env(map_name="3s_vs_5z", difficulty="7", step_mul=8, seed=1)
assert isinstance(env, MultiAgentEnv) and Base is MultiAgentEnv
assert smac.env.StarCraft2Env is StarCraft2Env is Same
assert get_map_params("3s_vs_5z")["limit"] == env.episode_limit == 250 and of_table is get_map_params
env.reset()
env.close()
print(smac.__file__)
"""

PLAY_SMACV2 = """
import smacv2
from smacv2.env import MultiAgentEnv, StarCraft2Env, StarCraftCapabilityEnvWrapper
from smacv2.env.multiagentenv import MultiAgentEnv as Base
from smacv2.env.starcraft2.distributions import get_distribution, register_distribution
from smacv2.env.starcraft2.maps import get_map_params
from smacv2.env.starcraft2.maps.smac_maps import SMACMap, get_smac_map_registry, map_param_registry
from smacv2.env.starcraft2.starcraft2 import CannotResetException, StarCraft2Env as Same
from smacv2.env.starcraft2.wrapper import StarCraftCapabilityEnvWrapper as SameWrapper
assert issubclass(CannotResetException, Exception) and Base is MultiAgentEnv
assert smacv2.env.StarCraft2Env is StarCraft2Env is Same and SameWrapper is StarCraftCapabilityEnvWrapper
assert issubclass(StarCraft2Env, MultiAgentEnv) and issubclass(StarCraftCapabilityEnvWrapper, MultiAgentEnv)
assert len(get_smac_map_registry()) == 26 and get_map_params("3s_vs_5z") == map_param_registry["3s_vs_5z"]
print(smacv2.__file__)
"""

PLAY = {"smaclite": PLAY_SMACLITE, "smac": PLAY_SMAC, "smacv2": PLAY_SMACV2}
COMMAND = [sys.executable, "-m", "smaclite_pool.compat"]

IN_CHILDREN = """
import multiprocessing
from smaclite_pool import compat

def play(code):
    exec(code, {})

if __name__ == "__main__":
    compat.install_PACKAGE()
    play(CODE)
    for method in ("fork", "spawn"):
        with multiprocessing.get_context(method).Pool(1) as workers:
            workers.map(play, [CODE])
"""


def run(*command: str, **environment: str) -> subprocess.CompletedProcess[str]:
    env = {**os.environ, **environment}
    return subprocess.run(command, env=env, capture_output=True, text=True, timeout=100, check=False)


@pytest.mark.parametrize("package", ["smaclite", "smac", "smacv2"])
def test_by_python_path(package: str) -> None:
    folder = run(*COMMAND, f"--{package}").stdout.strip()
    assert folder == str(compat.FOLDERS[package])
    done = run(sys.executable, "-c", PLAY[package], PYTHONPATH=folder)
    assert done.stdout.startswith(folder), done.stderr


@pytest.mark.parametrize("package", ["smaclite", "smac", "smacv2"])
@pytest.mark.parametrize("options", [[], ["--smaclite", "--smac", "--smacv2"]])
def test_the_command_replaces_all_by_default(tmp_path: Path, package: str, options: list[str]) -> None:
    script = tmp_path / "play.py"
    script.write_text(PLAY[package])
    done = run(*COMMAND, *options, str(script))
    assert done.stdout.startswith(str(compat.FOLDERS[package])), done.stderr


@pytest.mark.parametrize(("package", "other"), [("smaclite", "smac"), ("smac", "smacv2"), ("smacv2", "smac")])
def test_the_command_can_replace_one_package(tmp_path: Path, package: str, other: str) -> None:
    published = tmp_path / other
    published.mkdir()
    (published / "__init__.py").touch()
    show = f"import {package}, {other}; print({package}.__file__); print({other}.__file__)"
    done = run(*COMMAND, f"--{package}", "-c", show, PYTHONPATH=str(tmp_path))
    ours, theirs = done.stdout.splitlines()
    assert ours.startswith(str(compat.FOLDERS[package])) and theirs.startswith(str(published)), done.stderr


def test_the_command_passes_the_arguments_of_the_script_on(tmp_path: Path) -> None:
    script = tmp_path / "show.py"
    script.write_text("import sys; print(sys.argv[1:])")
    done = run(*COMMAND, "--smac", str(script), "--smaclite", "-m", "x")
    assert done.stdout.strip() == "['--smaclite', '-m', 'x']", done.stderr
    assert run(*COMMAND, "--help").stdout.startswith("usage: ")
    wrong = run(*COMMAND, "--smc", str(script))
    assert wrong.returncode == 2 and "unknown option --smc" in wrong.stderr


def test_pictures_and_a_window_on_demand(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[Any] = []
    monkeypatch.setattr(Window, "show", lambda _, picture: shown.append(picture))
    env: Any = gymnasium.make("smaclite/2s3z-v0", seed=1, render_mode="rgb_array")
    env.reset()
    picture = env.render()
    assert picture.shape == (640, 640, 3) and picture.dtype == np.uint8
    env.close()
    env = gymnasium.make("smaclite/2s3z-v0", seed=1)  # "human", the default of the published environment
    env.reset()
    env.step([1] * 5)
    assert shown == []
    env.unwrapped.seed(1)
    env.reset()
    assert env.render() is None and np.array_equal(shown, [picture])
    env.close()


def test_the_limit_by_variable(monkeypatch: pytest.MonkeyPatch) -> None:
    """For callers who cannot pass arguments on, as on the command line of EPyMARL."""
    show = "import os; print(os.environ['SMACLITE_POOL_EPISODE_LIMIT'])"
    assert run(*COMMAND, "--episode-limit", "4", "-c", show).stdout.strip() == "4"
    wrong = run(*COMMAND, "--episode-limit", "-c", show)
    assert wrong.returncode == 2 and "number of steps" in wrong.stderr
    monkeypatch.setenv(compat.EPISODE_LIMIT_VARIABLE, "4")
    env: Any = gymnasium.make("smaclite/2s_vs_1sc-v0", seed=1)
    length, info = episode(env, np.random.default_rng(1))
    assert (length, info["episode_limit"]) == (4, True)
    env.close()
    monkeypatch.setenv(compat.EPISODE_LIMIT_VARIABLE, "four")
    with pytest.raises(sp.errors.InvalidRequest, match="got 'four'"):
        gymnasium.make("smaclite/2s_vs_1sc-v0")


@pytest.mark.parametrize("package", ["smaclite", "smac", "smacv2"])
@posix
def test_by_install_and_in_child_processes(tmp_path: Path, package: str) -> None:
    script = tmp_path / "children.py"
    script.write_text(IN_CHILDREN.replace("PACKAGE", package).replace("CODE", repr(PLAY[package])))
    done = run(sys.executable, str(script))
    assert done.returncode == 0, done.stderr
    files = done.stdout.split()
    assert len(files) == 3 and all(file.startswith(str(compat.FOLDERS[package])) for file in files)


@pytest.mark.parametrize("package", ["smaclite", "smac", "smacv2"])
def test_beside_the_published_package(tmp_path: Path, package: str) -> None:
    """By default the published package is imported, and the replacement is refused after that."""
    published = tmp_path / package
    published.mkdir()
    (published / "__init__.py").touch()
    begin = f"import sys; sys.path.insert(0, {str(tmp_path)!r})\nfrom smaclite_pool import compat\n"
    install, show = f"compat.install_{package}()", f"import {package}; print({package}.__file__)"
    done = run_script(f"{begin}{install}; {show}")
    assert done.stdout.startswith(str(compat.FOLDERS[package])), done.stderr
    done = run_script(f"{begin}{show}; {install}")
    assert done.stdout.startswith(str(published)) and "was imported already" in done.stderr
