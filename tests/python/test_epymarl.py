"""The runner for EPyMARL: its batch contains the episodes of the environments.

A small test double replaces EPyMARL's batch; where SMACLITE_EPYMARL names EPyMARL's `src` folder, EPyMARL
itself runs.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp
from smaclite_pool.marl.epymarl import PoolRunner
from smaclite_pool.marl.smac import MultiAgentEnv

from conftest import Serve, changed_scenario, replayed

torch = pytest.importorskip("torch")

EPYMARL = os.environ.get("SMACLITE_EPYMARL")


class EpisodeBatch:
    """The part of EPyMARL's class that a runner uses: tensors [batch, steps, ...] by name."""

    def __init__(
        self,
        scheme: Any,
        groups: Any,
        batch_size: int,
        max_seq_length: int,
        preprocess: Any = None,
        device: Any = None,
    ) -> None:
        scheme = {**scheme, "filled": {"vshape": (1,), "dtype": torch.long}}
        self.data: dict[str, Any] = {}
        for name, about in scheme.items():
            shape = about["vshape"] if isinstance(about["vshape"], tuple) else (about["vshape"],)
            members = (groups[about["group"]],) if "group" in about else ()
            dtype = about.get("dtype", torch.float32)
            self.data[name] = torch.zeros((batch_size, max_seq_length, *members, *shape), dtype=dtype)

    def update(
        self, data: Any, bs: Any = slice(None), ts: Any = slice(None), mark_filled: bool = True
    ) -> None:
        if mark_filled:
            self.data["filled"][bs, ts] = 1
        for name, value in data.items():
            target = self.data[name]
            assert value.dtype == target.dtype or name == "actions", name
            target[bs, ts] = value.view(target[bs, ts].shape)

    def __getitem__(self, name: str) -> Any:
        return self.data[name]


class RandomController:
    """Chooses random available actions, which depend on environment, step and mask only."""

    def __init__(self, seed: int) -> None:
        self.seed = seed
        self.action_selector = SimpleNamespace(epsilon=0.5)
        self.calls: list[tuple[int, list[int]]] = []

    def init_hidden(self, batch_size: int) -> None:
        self.batch_size = batch_size

    def select_actions(self, batch: Any, t_ep: int, t_env: int, bs: list[int], test_mode: bool) -> Any:
        self.calls.append((t_ep, list(bs)))
        available = batch["avail_actions"][bs, t_ep].numpy()
        rows = []
        for env, masks in zip(bs, available, strict=True):
            rng = np.random.default_rng((self.seed, env, t_ep))
            rows.append([int(rng.choice(np.flatnonzero(mask))) for mask in masks])
        return torch.tensor(rows)


class Log:
    """A logger that records its calls."""

    def __init__(self) -> None:
        self.entries: list[tuple[str, float, int]] = []

    def log_stat(self, name: str, value: float, t_env: int) -> None:
        self.entries.append((name, float(value), t_env))


@pytest.fixture
def test_double(monkeypatch: pytest.MonkeyPatch) -> None:
    components, buffer = ModuleType("components"), ModuleType("components.episode_buffer")
    buffer.__dict__["EpisodeBatch"] = EpisodeBatch
    monkeypatch.setitem(sys.modules, "components", components)
    monkeypatch.setitem(sys.modules, "components.episode_buffer", buffer)


def args_of(num_envs: int, **env_args: Any) -> SimpleNamespace:
    given = {"map_name": "3s_vs_5z", "seed": 11, **env_args}
    return SimpleNamespace(
        batch_size_run=num_envs,
        env_args=given,
        common_reward=True,
        device="cpu",
        test_nepisode=2 * num_envs,
        runner_log_interval=10**5,
        render=False,
    )


def set_up(runner: Any, controller: RandomController) -> None:
    """As in EPyMARL's `run.py`."""
    info = runner.get_env_info()
    scheme = {
        "state": {"vshape": info["state_shape"]},
        "obs": {"vshape": info["obs_shape"], "group": "agents"},
        "actions": {"vshape": (1,), "group": "agents", "dtype": torch.long},
        "avail_actions": {"vshape": (info["n_actions"],), "group": "agents", "dtype": torch.int},
        "terminated": {"vshape": (1,), "dtype": torch.uint8},
        "reward": {"vshape": (1,)},
    }
    runner.setup(scheme, {"agents": info["n_agents"]}, {}, controller)


def begun(num_envs: int, seed: int = 0, **env_args: Any) -> tuple[PoolRunner, RandomController, Log]:
    log, controller = Log(), RandomController(seed)
    runner = PoolRunner(args_of(num_envs, **env_args), log)
    set_up(runner, controller)
    return runner, controller, log


@pytest.mark.usefixtures("test_double")
@pytest.mark.parametrize("num_envs", [1, 5])
def test_the_batch_is_what_the_environments_played(num_envs: int) -> None:
    runner, controller, _ = begun(num_envs, map_name="MMM2", episode_limit=40)
    envs = [MultiAgentEnv("MMM2", seed=11 + i, episode_limit=40) for i in range(num_envs)]
    for _ in range(2):
        batch = runner.run()
        lengths = [check_episode(batch, env, row) for row, env in enumerate(envs)]
    assert len(set(lengths)) == 1 or num_envs > 1
    assert runner.t == max(lengths)
    assert controller.calls[-1] == (max(lengths), [row for row, n in enumerate(lengths) if n == max(lengths)])
    runner.close_env()
    for env in envs:
        env.close()


def check_episode(batch: Any, env: MultiAgentEnv, row: int) -> int:
    """Replays the actions of a row and compares; returns the length of the episode."""
    env.reset()
    length = int(batch["filled"][row].sum()) - 1
    assert batch["filled"][row, : length + 1].all()
    for t in range(length + 1):
        np.testing.assert_array_equal(batch["obs"][row, t], np.stack(env.get_obs()))
        np.testing.assert_array_equal(batch["state"][row, t], env.get_state())
        np.testing.assert_array_equal(batch["avail_actions"][row, t], env.get_avail_actions())
        actions = batch["actions"][row, t, :, 0].tolist()
        if t == length:
            assert all(env.get_avail_agent_actions(i)[action] for i, action in enumerate(actions))
            break
        reward, ended, _ = env.step(actions)
        assert np.float32(reward) == batch["reward"][row, t] and ended == (t == length - 1)
        assert bool(batch["terminated"][row, t]) == ended
    assert not batch["reward"][row, length:].any()
    return length


@pytest.mark.usefixtures("test_double")
@pytest.mark.parametrize("published", [False, True])
def test_a_time_out_is_no_end_if_episodes_continue(published: bool, tmp_path: Path) -> None:
    own = changed_scenario(tmp_path, "3s_vs_5z", smacv2={"published": True})
    scenario = str(own) if published else "3s_vs_5z"
    for continuing in (False, True):
        runner, _, log = begun(3, map_name=scenario, time_limit=4, continuing_episode=continuing)
        runner.args.runner_log_interval = 0
        terminated = runner.run()["terminated"][:, :, 0]
        assert terminated.tolist() == [[0, 0, 0, int(not continuing), 0]] * 3
        assert ("episode_limit_mean", 1.0, 12) in log.entries or not continuing
        runner.close_env()


@pytest.mark.usefixtures("test_double")
def test_a_replay_has_the_episodes_of_the_first_environment(tmp_path: Path) -> None:
    runner, _, _ = begun(2, map_name="3m", replay_dir=str(tmp_path), replay_prefix="eval")
    lengths = [int(runner.run()["filled"][0].sum()) - 1 for _ in range(3)]
    runner.save_replay()
    runner.close_env()
    (path,) = tmp_path.glob("eval_*.smreplay")
    episodes = [line for line in replayed(path).splitlines() if line.startswith("episode ")]
    for episode, length in zip(episodes, lengths, strict=True):
        assert f"after {length} steps" in episode


@pytest.mark.usefixtures("test_double")
def test_the_log_is_epymarls() -> None:
    runner, _, log = begun(4)
    batch = runner.run()
    lengths = batch["filled"].sum(dim=(1, 2)) - 1
    returns = batch["reward"].sum(dim=(1, 2)).double()
    assert runner.t_env == lengths.sum()
    means = {name: value for name, value, t_env in log.entries if t_env == runner.t_env}
    assert np.isclose(means["return_mean"], returns.mean(), atol=1e-5)
    assert np.isclose(means["return_std"], returns.std(correction=0), atol=1e-5)
    assert means["ep_length_mean"] == lengths.double().mean()
    assert means["dead_allies_mean"] == 3 and means["battle_won_mean"] == 0 and means["epsilon"] == 0.5
    log.entries.clear()
    t_env = runner.t_env
    runner.run(test_mode=True)
    assert runner.t_env == t_env and not log.entries  # two test runs make up `test_nepisode`
    runner.run(test_mode=True)
    logged = {name for name, _, _ in log.entries}
    assert logged >= {"test_return_mean", "test_battle_won_mean", "test_ep_length_mean"}
    assert not runner.test_returns and not runner.test_stats
    runner.close_env()


@pytest.mark.usefixtures("test_double")
def test_the_state_without_last_actions() -> None:
    full, _, _ = begun(2)
    short, _, _ = begun(2, state_last_action=False)
    states = full.run()["state"], short.run()["state"]
    assert states[0].shape[2] - states[1].shape[2] == 3 * 11
    assert torch.equal(states[0][:, :, : states[1].shape[2]], states[1])
    full.close_env()
    short.close_env()


@pytest.mark.usefixtures("test_double")
@pytest.mark.parametrize(
    ("options", "expected"),
    [({"state_last_action": False}, (65, 65)), ({"state_timestep_number": True}, (66, 121))],
    ids=["none", "in the middle"],
)
def test_only_last_actions_are_left_out(
    options: dict[str, bool], expected: tuple[int, int], tmp_path: Path
) -> None:
    file = changed_scenario(tmp_path, "terran_5_vs_5", smacv2=options)
    sizes = []
    for with_last_action in (False, True):
        runner = PoolRunner(args_of(1, map_name=str(file), state_last_action=with_last_action), Log())
        sizes.append(runner.get_env_info()["state_shape"])
        runner.close_env()
    assert tuple(sizes) == expected


@pytest.mark.usefixtures("test_double")
def test_an_attached_pool_plays_the_same(serve: Serve) -> None:
    serve("3s_vs_5z:3", "--batch-size", "1", "--autoreset-mode", "Disabled", "--name", "train")
    serve("3s_vs_5z:3", "--name", "other")
    fitting = ["3s_vs_5z:3", "--batch-size", "1", "--autoreset-mode", "Disabled"]
    serve(*fitting, "--name", "both", "--sides", "both")
    serve(*fitting, "--name", "few", "--fields", "obs,state,avail_actions")
    embedded, _, _ = begun(3)
    attached, _, _ = begun(3, map_name=None, pool="train")
    assert torch.equal(embedded.run()["state"], attached.run()["state"])
    embedded.close_env()
    attached.close_env()
    for options, match in (
        ({"pool": "other"}, "--batch-size 1 --autoreset-mode Disabled"),
        ({"pool": "both", "map_name": None}, "sides must be 'allies'"),
        ({"pool": "few", "map_name": None}, "needs `battle_won`"),
        ({"pool": "train", "map_name": "MMM2"}, "serve MMM2:3 --episode-limit 180 --batch-size 1"),
        ({"pool": "train", "time_limit": 150, "episode_limit": 20}, "the same limit"),
        ({"pool": "train", "time_limit": 20}, "serve 3s_vs_5z:3 --episode-limit 20"),
        ({"pool": "train", "threads": 1}, "its own threads"),
    ):
        with pytest.raises(sp.errors.InvalidRequest, match=match):
            PoolRunner(args_of(3, **options), Log())
    with pytest.raises(sp.errors.InvalidRequest, match="episode_limit"):
        PoolRunner(args_of(3, time_limit=0), Log())


def test_settings_that_cannot_be_served_are_refused() -> None:
    refused: dict[str, tuple[Any, str]] = {
        "obs_last_action": (True, "smaclite_pool.marl.smac"),
        "obs_all_heath": (True, "not known"),
        "map_name": (None, "map_name or"),
    }
    for name, (value, reason) in refused.items():
        with pytest.raises(sp.errors.InvalidRequest, match=reason):
            PoolRunner(args_of(2, **{name: value}), Log())
    rewarded = PoolRunner(args_of(2, reward_only_positive=False, reward_win=200), Log())
    assert not rewarded._envs.spec.rewards["reward_only_positive"]
    rewarded.close_env()
    unshared = args_of(2)
    unshared.common_reward = False
    with pytest.raises(sp.errors.InvalidRequest, match="common_reward"):
        PoolRunner(unshared, Log())


@pytest.mark.skipif(EPYMARL is None, reason="SMACLITE_EPYMARL does not name EPyMARL's src folder")
def test_epymarls_own_runner_plays_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    assert EPYMARL is not None
    monkeypatch.syspath_prepend(EPYMARL)
    from smaclite_pool import compat

    compat.install_smaclite()
    compat.install_smac()
    import importlib

    parallel = importlib.import_module("runners.parallel_runner").ParallelRunner
    args = args_of(4, map_name="MMM2")
    args.env, args.reward_scalarisation, args.n_agents = "sc2", "sum", 10
    log, controller = Log(), RandomController(3)
    theirs = parallel(args, log)
    set_up(theirs, controller)
    ours, _, own_log = begun(4, seed=3, map_name="MMM2")
    for _ in range(2):
        mine, other = ours.run(), theirs.run()
        for name in ("obs", "state", "avail_actions", "actions", "reward", "terminated", "filled"):
            assert torch.equal(mine[name], other[name]), name
    names = [{name for name, _, _ in each.entries} for each in (own_log, log)]
    assert names[0] and names[0] == names[1]
    assert (ours.t, ours.t_env) == (theirs.t, theirs.t_env)
    ours.close_env()
    theirs.close_env()
