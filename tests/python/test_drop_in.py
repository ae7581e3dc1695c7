"""Code written for the published package `smaclite`, on the stand-in."""

from __future__ import annotations

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
from conftest import run_script
from gymnasium.wrappers import TimeLimit
from smaclite_pool import drop_in

GOLDEN = Path(__file__).resolve().parents[1] / "golden" / "steps"


@pytest.fixture(autouse=True)
def installed() -> Iterator[None]:
    """The stand-in on this process's path."""
    path, ours = sys.path[:], set(gymnasium.registry)
    drop_in.install()
    yield
    sys.path[:] = path
    for name in [name for name in sys.modules if name.split(".")[0] == "smaclite"]:
        del sys.modules[name]
    for name in set(gymnasium.registry) - ours:
        del gymnasium.registry[name]


def recorded() -> list[Path]:
    """One recorded battle a scenario."""
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
        np.testing.assert_allclose(inner.get_obs(), battle["obs"][step], atol=1e-5, err_msg=f"step {step}")
        np.testing.assert_allclose(inner.get_state(), battle["state"][step], atol=1e-5, err_msg=f"step {step}")
        np.testing.assert_array_equal(inner.get_avail_actions(), battle["avail"][step], err_msg=f"step {step}")
        seen, reward, terminated, truncated, info = env.step(actions)
        assert reward == pytest.approx(battle["reward"][step], abs=1e-5)
        assert (terminated, truncated) == (battle["terminated"][step], False)
        assert all(isinstance(value, (bool, int, float)) for value in info.values())
    np.testing.assert_allclose(seen, battle["obs"][-1], atol=1e-5)
    env.close()


def episode(env: Any, rng: np.random.Generator) -> tuple[int, dict[str, Any]]:
    """Plays as EPyMARL does; the number of steps and the last info."""
    env.reset(seed=None, options=None)
    for step in range(1, 10_000):
        legal = [np.flatnonzero(row) for row in env.unwrapped.get_avail_actions()]
        *_, terminated, truncated, info = env.step([int(rng.choice(actions)) for actions in legal])
        if terminated or truncated:
            return step, info
    raise AssertionError("the episode does not end")


def test_a_time_out_is_marked_only_when_asked() -> None:
    """Told apart by `info["episode_limit"]` alone, as EPyMARL does it."""
    limit, rng = 3, np.random.default_rng(1)
    cases: list[tuple[dict[str, Any], bool]] = [({}, False), ({"episode_limit": limit}, True)]
    for settings, marks in cases:
        made = gymnasium.make("smaclite/2s_vs_1sc-v0", seed=1, **settings)
        env: Any = TimeLimit(made, max_episode_steps=limit)
        length, info = episode(env, rng)
        assert (length, info.get("episode_limit", False)) == (limit, marks)
        assert sum(info.values()) == marks  # numbers only: EPyMARL adds them up
        env.close()


def test_there_is_no_limit_of_its_own() -> None:
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


def test_seeds_are_the_constructors_until_a_reset_brings_one() -> None:
    rng = np.random.default_rng
    env: Any = gymnasium.make("smaclite/2s3z-v0", seed=3)
    first = [episode(env, rng(0))[0] for _ in range(3)]
    env.close()
    again: Any = gymnasium.make("smaclite/2s3z-v0", seed=8)
    again.unwrapped.seed(3)
    assert [episode(again, rng(0))[0] for _ in range(3)] == first
    again.close()


def test_a_scenario_file() -> None:
    with pytest.raises(sp.InvalidRequest, match="map_file"):
        gymnasium.make("smaclite/custom-v0")
    with pytest.raises(sp.InvalidRequest, match="map_info"):
        gymnasium.make("smaclite/custom-v0", map_info=object())
    with pytest.raises(sp.ScenarioError, match="no_such_file"):
        gymnasium.make("smaclite/custom-v0", map_file="no_such_file.json")


# The ways to come by the stand-in, each in a process of its own.

PLAY = """
import gymnasium as gym
import smaclite
from smaclite.env import SMACliteEnv
env = gym.make("smaclite/2s3z-v0", seed=1)
assert isinstance(env.unwrapped, SMACliteEnv)
env.reset()
env.close()
print(smaclite.__file__)
"""

IN_CHILDREN = """
import multiprocessing as mp, sys
from smaclite_pool import drop_in

def play(_):
    import gymnasium, smaclite
    env = gymnasium.make("smaclite/2s3z-v0", seed=1)
    env.reset()
    env.close()
    return smaclite.__file__

if __name__ == "__main__":
    drop_in.install()
    play(0)
    for way in ("fork", "spawn"):
        with mp.get_context(way).Pool(1) as workers:
            [file] = workers.map(play, [0])
    print(file)
"""


def test_by_python_path(tmp_path: Path) -> None:
    module = [sys.executable, "-m", "smaclite_pool.drop_in"]
    folder = subprocess.run(module, capture_output=True, text=True, check=True).stdout.strip()
    env = {**os.environ, "PYTHONPATH": folder}
    done = subprocess.run([sys.executable, "-c", PLAY], env=env, capture_output=True, text=True, check=False)
    assert done.stdout.startswith(folder), done.stderr
    script = tmp_path / "play.py"
    script.write_text(PLAY)
    done = subprocess.run([*module, str(script)], capture_output=True, text=True, check=False)
    assert done.stdout.startswith(folder), done.stderr


def test_the_limit_by_variable(monkeypatch: pytest.MonkeyPatch) -> None:
    """For callers who cannot pass arguments on, as EPyMARL's on the command line."""
    show = "import os; print(os.environ['SMACLITE_POOL_EPISODE_LIMIT'])"
    command = [sys.executable, "-m", "smaclite_pool.drop_in", "--episode-limit"]
    done = subprocess.run([*command, "4", "-c", show], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "4"
    done = subprocess.run([*command, "-c", show], capture_output=True, text=True, check=False)
    assert done.returncode == 2 and "number of steps" in done.stderr
    monkeypatch.setenv(drop_in.LIMIT, "4")
    env: Any = gymnasium.make("smaclite/2s_vs_1sc-v0", seed=1)
    length, info = episode(env, np.random.default_rng(1))
    assert (length, info["episode_limit"]) == (4, True)
    env.close()
    monkeypatch.setenv(drop_in.LIMIT, "four")
    with pytest.raises(sp.InvalidRequest, match="=four"):
        gymnasium.make("smaclite/2s_vs_1sc-v0")


def test_by_install_and_in_child_processes(tmp_path: Path) -> None:
    script = tmp_path / "children.py"
    script.write_text(IN_CHILDREN)
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=False)
    assert done.stdout.startswith(str(drop_in.FOLDER)), done.stderr


def test_beside_the_published_package(tmp_path: Path) -> None:
    """Whoever does not ask for the stand-in gets the published package; who got that cannot install any more."""
    published = tmp_path / "smaclite"
    published.mkdir()
    (published / "__init__.py").touch()
    begin = f"import sys; sys.path.insert(0, {str(tmp_path)!r})\nfrom smaclite_pool import drop_in\n"
    done = run_script(begin + "drop_in.install(); import smaclite; print(smaclite.__file__)")
    assert done.stdout.startswith(str(drop_in.FOLDER)), done.stderr
    done = run_script(begin + "import smaclite; print(smaclite.__file__); drop_in.install()")
    assert done.stdout.startswith(str(published)) and "is imported already" in done.stderr
