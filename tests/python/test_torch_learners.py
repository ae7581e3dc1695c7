"""The learners in PyTorch of smaclite_pool.examples: teams learn, and equal seeds give equal runs."""

from __future__ import annotations

import csv
import importlib
import json
import subprocess
import sys
from collections import deque
from dataclasses import asdict, replace
from itertools import product
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp

from conftest import program

torch = pytest.importorskip("torch")
safetensors = pytest.importorskip("safetensors.torch")

# Imported by name, because they import torch, which may be missing.
ppo: Any = importlib.import_module("smaclite_pool.examples.ppo")
self_play: Any = importlib.import_module("smaclite_pool.examples.self_play")
units_network: Any = importlib.import_module("smaclite_pool.examples.units_network")
value_decomposition: Any = importlib.import_module("smaclite_pool.examples.value_decomposition")

NO_OP = 0
RANDOM_RETURN = 1.4  # of the random policy on 3m (docs/reference/policies.md)
TIMES = ("seconds", "cpu_seconds", "steps_per_s", "wait_share", "learn_share")
PPO = {"steps": 45_000}
SHORT = {"steps": 28_000, "episodes_per_update": 8, "epsilon_steps": 12_000, "log_interval": 5}
LEARNERS = [
    (ppo, "mappo", PPO),
    (ppo, "ippo", PPO),
    (value_decomposition, "iql", SHORT),
    (value_decomposition, "vdn", SHORT),
    (value_decomposition, "qmix", SHORT),
]
learners = pytest.mark.parametrize(("example", "algorithm", "options"), LEARNERS)


def train(example: Any, folder: Path, algorithm: str, **options: Any) -> tuple[Any, list[dict[str, str]]]:
    """Trains on 3m. Returns the learner and the rows of its log."""
    options = {"scenario": "3m", "algorithm": algorithm, "out": str(folder), "threads": 1, **options}
    learner = example.train(example.Options(**options))
    with (folder / f"3m-{algorithm}-{options.get('seed', 0)}/log.csv").open() as file:
        return learner, list(csv.DictReader(file))


@learners
def test_a_team_learns(example: Any, algorithm: str, options: dict[str, Any], tmp_path: Path) -> None:
    learner, log = train(example, tmp_path, algorithm, seed=1, **options)
    assert float(log[-1]["mean_return"]) > 2.5 * RANDOM_RETURN, log[-1]
    assert list(log[0])[-5:] == list(TIMES)
    if example is ppo:
        result = ppo.evaluate(learner, ppo.Options(scenario="3m", evaluate_episodes=64))
        assert len(result) == 64 and result.mean_return > 2.5 * RANDOM_RETURN, result


def test_advantages_are_sums_of_discounted_errors_until_the_end_of_the_episode() -> None:
    """The definition, with ends of both kinds."""
    options = ppo.Options(gamma=0.9, lambda_=0.8)
    generator = torch.Generator().manual_seed(1)
    reward, end = (torch.rand(12, 3, generator=generator) for _ in range(2))
    terminated, truncated = end < 0.15, end > 0.85
    assert terminated.any() and truncated.any()
    values = torch.rand(13, 3, 2, generator=generator)
    advantages = ppo.estimate_advantages(reward, terminated, truncated, values, options)
    for t in range(12):
        for env in range(3):
            expected, factor = torch.zeros(2), 1.0
            for k in range(t, 12):
                following = torch.zeros(2) if terminated[k, env] else values[k + 1, env]
                expected += factor * (reward[k, env] + 0.9 * following - values[k, env])
                factor *= 0.9 * 0.8
                if terminated[k, env] or truncated[k, env]:
                    break
            assert torch.allclose(advantages[t, env], expected, atol=1e-5), (t, env)


def test_nothing_is_learnt_from_resets_and_agents_without_a_choice() -> None:
    with sp.make("3m", 8, threads=1, episode_limit=10) as envs:
        learner = ppo.Learner(envs, ppo.Options(num_envs=8, horizon=32))
        learner.collect(envs.reset(seed=1), deque())
        rollout, data = learner.rollout, learner.rows()
        sampled = torch.zeros(32 * 8, dtype=torch.bool)
        sampled[data.samples] = True
        was_reset = torch.from_numpy(rollout.was_reset[1:])
        assert was_reset.sum() == 8 * 2 and torch.equal(sampled.reshape(32, 8), ~was_reset)
        # An agent of 3m that lives can always stop and move; a dead one has only no-op.
        alive = torch.from_numpy(~rollout.avail_actions[:-1, :, :, NO_OP])
        assert torch.equal(data.has_choice.reshape(32, 8, 3), alive)


def test_a_change_of_the_returns_changes_no_prediction() -> None:
    torch.manual_seed(1)
    critic, returns = ppo.Mlp([5, 8, 1], 0, 1.0, "relu"), ppo.ReturnNormaliser()
    x, agents = torch.rand(4, 5), torch.zeros(4, dtype=torch.int64)
    before = critic(x, agents) * returns.deviation + returns.mean
    returns.update(torch.tensor([10.0, 30.0]), critic[-1])
    assert (round(returns.mean), round(returns.deviation)) == (20, 10)
    assert torch.allclose(critic(x, agents) * returns.deviation + returns.mean, before, atol=1e-4)


def test_targets_of_values_by_their_definition() -> None:
    """An episode that ended after 2 steps, and one that was cut off after 3, with lambda 0, 1 and between."""
    reward = torch.tensor([[1.0, 2.0], [3.0, 4.0], [9.0, 5.0]])
    terminated = torch.tensor([[False, False], [True, False], [False, False]])
    data = {"reward": reward, "terminated": terminated, "lengths": torch.tensor([2, 3])}
    values = torch.tensor([[0.0, 0.0], [10.0, 20.0], [70.0, 30.0], [70.0, 40.0]]).unsqueeze(-1)
    for keep in (0.0, 0.5, 1.0):
        # The last step first: nothing follows the first episode, the value 40 the second.
        last_1, last_2 = 3.0, 5 + 0.9 * 40
        middle_2 = 4 + 0.9 * ((1 - keep) * 30 + keep * last_2)
        first = [1 + 0.9 * ((1 - keep) * 10 + keep * last_1), 2 + 0.9 * ((1 - keep) * 20 + keep * middle_2)]
        with sp.make("3m", 1, threads=1) as envs:
            options = value_decomposition.Options(gamma=0.9, lambda_=keep, capacity=1)
            targets = value_decomposition.Learner(envs, options).targets(data, values)
        assert torch.allclose(targets[0, :, 0], torch.tensor(first))
        assert torch.allclose(targets[1, :, 0], torch.tensor([last_1, middle_2]))
        assert torch.allclose(targets[2, 1, 0], torch.tensor(last_2))


def test_kept_episodes_are_those_that_were_played() -> None:
    """Against a plain copy of every batch, with more episodes than are kept."""
    with sp.make("3m", 4, threads=1) as envs:
        replay = value_decomposition.Replay(envs, capacity=6, seed=1)
        envs.seed_sampler(1)
        batch = envs.reset(seed=1)
        current: list[list[dict[str, Any]]] = [[] for _ in range(4)]
        played: list[list[dict[str, Any]]] = []
        while len(played) < 15:
            actions = envs.sample_actions()
            before, batch = batch, envs.step(actions)
            replay.store(before, actions, batch)
            for i in range(4):
                if batch.was_reset[i]:
                    continue
                step = {"obs": before.obs[i].copy(), "state": before.state[i].copy()}
                step |= {"available": before.avail_actions[i].copy(), "actions": actions[i].copy()}
                step |= {"reward": batch.reward[i], "terminated": batch.terminated[i]}
                current[i].append(step)
                if batch.terminated[i] or batch.truncated[i]:
                    played.append([*current[i], {"obs": batch.obs[i].copy(), "state": batch.state[i].copy()}])
                    current[i] = []
        assert len(replay.complete) == 6
        for place, episode in zip(replay.complete, played[-6:], strict=True):
            assert replay.lengths[place] == len(episode) - 1
            for t, step in enumerate(episode):
                for name, value in step.items():
                    assert (getattr(replay, name)[place, t] == value).all(), (name, t)
        sample = replay.sample(6)
        assert len(sample["obs"]) == sample["lengths"].max() + 1 == len(sample["reward"]) + 1


def test_the_value_of_a_qmix_team_rises_with_those_of_its_agents() -> None:
    with sp.make("3m", 1, threads=1) as envs:
        torch.manual_seed(1)
        mixer = value_decomposition.QmixMixer(envs, 32)
        values = torch.randn(20, 1, 3, requires_grad=True)
        mixer(values, torch.randn(20, 1, envs.spec.state_size)).sum().backward()
    assert values.grad is not None and (values.grad >= 0).all() and (values.grad > 0).any()


def test_defaults_and_weights_are_those_of_the_program(tmp_path: Path) -> None:
    """So the two can be compared, and a folder of `smaclite-pool train` evaluates the team."""
    for algorithm, network in product(("mappo", "ippo"), ("flat", "units")):
        learner, _ = train(ppo, tmp_path / network, algorithm, network=network, steps=1_000)
        weights = safetensors.load_file(tmp_path / f"{network}/3m-{algorithm}-0/weights.safetensors")
        folder = tmp_path / f"program-{algorithm}-{network}"
        options = ["--algorithm", algorithm, "--network", network, "--steps", "1"]
        program("train", "3m", *options, "--out", folder)

        config = json.loads((folder / "run.json").read_text())["config"]
        assert options_as_in_config(replace(learner.options, steps=1), config) == config
        assert config.get("network", "flat") == network

        file = folder / "weights.safetensors"
        expected = {name: tensor.shape for name, tensor in safetensors.load_file(file).items()}
        assert {name: tensor.shape for name, tensor in weights.items()} == expected
        safetensors.save_file(weights, file)
        assert "mean return" in program("evaluate", folder, "--episodes", "4").stdout


def options_as_in_config(options: ppo.Options, config: dict[str, Any]) -> dict[str, Any]:
    values = asdict(options) | {"hidden": [int(width) for width in options.hidden.split(",")]}
    return {name: values.get(name, values.get(f"{name}_")) for name in config}


@pytest.mark.parametrize("scenario", ["3s_vs_5z", "5m_vs_6m", "8m", "MMM", "zerg_5_vs_5", "protoss_10_vs_11"])
def test_defaults_of_a_scenario_are_those_of_the_program(scenario: str, tmp_path: Path) -> None:
    """They depend on the number of agents, and on whether teams are drawn: the critic of a small fixed team
    sees an observation."""
    small = ["--steps", "1", "--num-envs", "4", "--horizon", "8"]
    program("train", scenario, *small, "--out", tmp_path / "a")
    config = json.loads((tmp_path / "a" / "run.json").read_text())["config"]
    options = ppo.with_defaults(ppo.Options(scenario, steps=1, num_envs=4, horizon=8))
    assert options_as_in_config(options, config) == config
    assert options.algorithm == ("ippo" if scenario == "3s_vs_5z" else "mappo")


def some_batch(envs: sp.Envs) -> sp.Batch:
    """A batch of battles in which units have met, and some are dead or out of sight."""
    envs.seed_sampler(1)
    batch = envs.reset(seed=1)
    for _ in range(20):
        batch = envs.step(envs.sample_actions())
    return batch


# One without healers, and two with: a fixed team, and one that is drawn.
@pytest.mark.parametrize("scenario", ["3m", "MMM", "terran_5_vs_5"])
def test_a_network_over_units_computes_what_that_of_the_program_does(scenario: str, tmp_path: Path) -> None:
    options: dict[str, Any] = {"network": "units", "num_envs": 16, "horizon": 32, "hidden": [8, 16]}
    team = sp.train(scenario, tmp_path / "run", seed=1, steps=2_000, actor_lr=0.01, **options)
    weights = safetensors.load_file(tmp_path / "run/weights.safetensors")
    sees_state = team.config["algorithm"] == "mappo"
    assert sees_state == (scenario != "3m")
    with sp.make(scenario, 32, threads=1, **team.settings) as envs:
        actor = units_network.actor(envs, [8, 16], 0.01, torch.relu)
        critic = units_network.critic(envs, [8, 16], sees_state, torch.relu)
        # Refuses weights of other names or shapes.
        torch.nn.ModuleDict({"actor": actor, "critic": critic}).load_state_dict(weights)
        obs = some_batch(envs).obs
        with torch.no_grad():
            logits = actor(torch.tensor(obs), torch.arange(envs.spec.n_agents)).numpy()
    assert np.ptp(logits) > 1 and np.allclose(logits, team.logits(obs), atol=1e-5)


def permuted(x: Any, layout: list[Any], kind: str, order: Any) -> Any:
    """Inputs [..., size] with the rows of a kind of units in another order."""
    x, names = x.clone(), [kind, *(["last_action"] if kind == "allies" else [])]
    for part in layout:
        if part["name"] in names:
            n, width = part["shape"]
            columns = slice(part["start"], part["start"] + n * width)
            x[..., columns] = x[..., columns].unflatten(-1, (n, width))[..., order, :].flatten(-2)
    return x


@pytest.mark.parametrize("activation", [torch.relu, torch.tanh])
def test_the_order_of_units_does_not_matter_to_networks_over_units(activation: Any) -> None:
    torch.manual_seed(1)
    with sp.make("MMM", 16, threads=1, obs_last_actions=2) as envs:
        info, batch, agents = sp.scenario(envs), some_batch(envs), torch.arange(envs.spec.n_agents)
        obs, state = torch.tensor(batch.obs), torch.tensor(batch.state)
        actor = units_network.actor(envs, [8, 16], 1.0, activation)
        critic = units_network.critic(envs, [8, 16], True, activation)
    first, n = info["actions"].index("target_0"), len(info["enemies"])
    attackers = [agent for agent, unit in enumerate(info["allies"]) if not unit["healer"]]
    order, other_order = torch.randperm(n), torch.randperm(envs.spec.n_agents)
    with torch.no_grad():
        expected, values = actor(obs, agents), critic(state, agents)
        outputs = actor(permuted(obs, info["obs_layout"], "enemies", order), agents)
        of_enemies = critic(permuted(state, info["state_layout"], "enemies", order), agents)
        of_allies = critic(permuted(state, info["state_layout"], "allies", other_order), agents)
    assert expected[..., first:].std(-1).max() > 0.01 and values.std() > 0.01
    attacks = expected[:, attackers, first : first + n]
    expected[:, attackers, first : first + n] = attacks[..., order]
    assert torch.allclose(outputs, expected, atol=1e-5)
    assert torch.allclose(of_enemies, values, atol=1e-5) and torch.allclose(of_allies, values, atol=1e-5)


def test_the_last_action_of_a_dead_agent_does_not_matter_to_networks_over_units() -> None:
    with sp.make("3m", 16, threads=1) as envs:
        layout, state = sp.scenario(envs)["state_layout"], torch.tensor(some_batch(envs).state)
        critic = units_network.critic(envs, [8, 16], True, torch.relu)
    values = []
    for names in ([], ["allies"], ["allies", "last_action"]):
        for part in layout:
            if part["name"] in names:
                state[:, part["start"] : part["start"] + part["shape"][1]] = 0.0  # the row of agent 0
        with torch.no_grad():
            values.append(critic(state, torch.tensor(0)))
    alive, dead, without_action = values
    assert not torch.allclose(alive, dead) and torch.equal(dead, without_action)


@pytest.mark.parametrize(
    ("example", "algorithm"), [(ppo, "mappo"), (ppo, "ippo"), (value_decomposition, "qmix")]
)
def test_networks_over_units_learn(example: Any, algorithm: str, tmp_path: Path) -> None:
    """All of their weights change, and equal seeds give equal runs."""
    options: dict[str, Any] = {"network": "units", "steps": 4_500, "num_envs": 16, "seed": 3}
    if example is value_decomposition:
        options |= {"batch": 8, "log_interval": 1}
    learner, log = train(example, tmp_path / "one", algorithm, **options)
    same, _ = train(example, tmp_path / "two", algorithm, **options)
    assert len(log) > 1
    torch.manual_seed(3)
    with example.make(learner.options, 1) as envs:
        first = example.Learner(envs, learner.options).team.state_dict()
    weights, same_weights = learner.team.state_dict(), same.team.state_dict()
    assert all(torch.equal(weights[name], same_weights[name]) for name in weights)
    assert not [name for name in weights if torch.equal(weights[name], first[name])]


def test_networks_over_units_need_units_and_two_widths() -> None:
    options = {"obs_starcraft": False, "obs_timestep_number": True}
    with sp.make("3m", 1, threads=1, smacv2=options) as envs:
        with pytest.raises(sp.errors.InvalidRequest, match=r"network must be `flat` where.*, got `units`"):
            units_network.actor(envs, [8, 16], 1.0, torch.relu)
    with sp.make("3m", 1, threads=1) as envs:
        with pytest.raises(sp.errors.InvalidRequest, match=r"hidden must be 2 widths .*, got \[8\]"):
            units_network.actor(envs, [8], 1.0, torch.relu)


@learners
def test_evaluations_are_those_of_the_program_and_change_no_bit(
    example: Any, algorithm: str, options: dict[str, Any], tmp_path: Path
) -> None:
    """Equal seeds give equal runs, with evaluations or without. `smaclite-pool report` reads the folder
    beside one of `smaclite-pool train`."""
    options = {**options, "steps": 4_500, "seed": 3}
    without, log = train(example, tmp_path / "without", algorithm, **options)
    team, same_log = train(example, tmp_path / "runs", algorithm, evaluate_every=2_000, **options)
    weights, same_weights = without.team.state_dict(), team.team.state_dict()
    assert all(torch.equal(weights[name], same_weights[name]) for name in weights)
    _, other_log = train(example, tmp_path / "other", algorithm, **{**options, "seed": 4})
    steady, same, other = (
        [{name: value for name, value in row.items() if name not in TIMES} for row in rows]
        for rows in (log, same_log, other_log)
    )
    assert len(log) > 1 and steady == same != other
    folder = tmp_path / f"runs/3m-{algorithm}-3"
    assert not (tmp_path / f"without/3m-{algorithm}-3/evaluations.csv").exists()

    small = "--steps 4500 --evaluate-every 2000 --num-envs 8 --horizon 16 --hidden 16,16 --seed 3"
    program("train", "3m", "--out", tmp_path / "program", *small.split())
    header = (folder / "evaluations.csv").read_text().splitlines()[0]
    assert header == (tmp_path / "program/evaluations.csv").read_text().splitlines()[0]
    assert json.loads((folder / "final.json").read_text()).keys() == (
        json.loads((tmp_path / "program/final.json").read_text()).keys()
    )
    program("report", tmp_path / "runs", tmp_path / "program", "--out", tmp_path / "out")
    with (tmp_path / "out/runs.csv").open() as file:
        ours, theirs = csv.DictReader(file)
    assert (ours["algorithm"], ours["task"], ours["seed"]) == ("runs", "3m", "3")
    assert ours["evaluations"] == theirs["evaluations"] == "4"  # 0, 2000, 4000 and 4500
    metrics = json.loads((tmp_path / "out/metrics.json").read_text())["smaclite"]["3m"]
    assert metrics["runs"]["run_1"].keys() == metrics["program"]["run_1"].keys()
    assert len(metrics["runs"]["run_1"]["absolute_metrics"]["return"]) == 320


def test_evaluations_keep_the_best_weights_and_their_time(tmp_path: Path) -> None:
    """A team that wins more the longer it trains, then loses, without battles."""
    evaluations: Any = importlib.import_module("smaclite_pool.examples.evaluations")
    module = torch.nn.Linear(1, 1)
    rates = {0: 0.0, 10: 0.5, 20: 0.95, 30: 0.2}
    now = 0

    class Played(evaluations.Evaluations):  # type: ignore[misc]
        def episodes(self, count: int, greedy: bool, occasion: list[int]) -> sp.Evaluation:
            played.append((count, greedy, tuple(occasion), module.weight.item()))
            won = np.arange(count) < round(rates[now] * count)
            return sp.Evaluation(
                np.zeros(count, np.int32), won.astype(np.float32), np.ones(count, np.int32), won, ~won
            )

    played: list[tuple[int, bool, tuple[int, ...], float]] = []
    options = SimpleNamespace(seed=1, steps=30, evaluate_every=10)
    clock = evaluations.Clock()
    evaluated = Played(tmp_path, options, module, None, None, clock)
    for now in rates:
        module.weight.data.fill_(float(now))
        evaluated.play_due(now + 1, now)
    evaluated.finish(31, 30)
    rows = (tmp_path / "evaluations.csv").read_text().splitlines()
    assert [row.split(",")[:3] for row in rows[1:]] == [[str(s), str(s + 1), str(s)] for s in rates]
    result = json.loads((tmp_path / "final.json").read_text())
    assert (result["steps"], result["trained_steps"], result["run_steps"]) == (20, 21, 31)
    best = safetensors.load_file(tmp_path / "best.safetensors")
    assert best["weight"].item() == 20 and module.weight.item() == 30
    assert [of for of in played if of[0] == 320] == [(320, True, (), 20.0), (320, False, (), 20.0)]
    win = json.loads((tmp_path / "time_to_win.json").read_text())
    assert win["greedy"]["steps"] == 20 and win["sampled"]["wins"] == 190
    # Of 200 episodes, a team that loses plays one block of 40 with greedy and one with sampled actions.
    assert [of for of in played if of[0] == 40 and of[3] == 0.0] == [
        (40, True, (0, 0), 0.0),
        (40, False, (0, 0), 0.0),
    ]
    assert not [of for of in played if of[0] == 40 and of[3] == 30.0], "it had won before"


def test_a_team_plays_itself(tmp_path: Path) -> None:
    """Half of the environments are the mirrored enemies of the others, and both halves win alike."""
    options = ppo.Options(scenario="3m", steps=90_000, seed=1, threads=1, out=str(tmp_path))
    learner = ppo.train(options, self_play.make)
    with (tmp_path / "3m-ippo-1/log.csv").open() as file:
        log = list(csv.DictReader(file))
    assert 0.3 < float(log[-1]["win_rate"]) < 0.6, log[-1]
    result = ppo.evaluate(learner, ppo.Options(scenario="3m", evaluate_episodes=64))
    assert result.mean_return > 2.5 * RANDOM_RETURN, result
    with pytest.raises(SystemExit, match="5m_vs_6m is not symmetric"):
        self_play.make(ppo.Options(scenario="5m_vs_6m"), 4)
    with pytest.raises(SystemExit, match="must be even, got 3"):
        self_play.make(options, 3)


def test_the_command_line_and_its_errors(tmp_path: Path) -> None:
    command = [sys.executable, ppo.__file__, "3m", "--steps", "1000", "--num-envs", "16"]
    command += ["--out", str(tmp_path), "--evaluate-episodes", "3", "--greedy"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=True)
    assert done.stdout.splitlines()[-1].startswith("3 episodes, greedy: won ")
    again = subprocess.run(command, capture_output=True, text=True, timeout=100, check=False)
    assert again.returncode == 1
    assert again.stderr.startswith("ppo: ") and "choose another --out" in again.stderr


@pytest.mark.parametrize(
    ("learner", "option", "accepted"),
    [
        (ppo, "--epochs 0", "between 1 and 1,000, got 0"),
        (ppo, "--minibatches 100000", "between 1 and 1,000"),
        (ppo, "--torch-threads 0", "between 1 and 1,024"),
        (ppo, "--hidden a", "numbers from 2 to 4096, with commas, as 64,64, got 'a'"),
        (ppo, "--hidden 0,64", "numbers from 2 to 4096, with commas, as 64,64, got '0,64'"),
        (ppo, "--seed 9223372036854775807", "between 0 and 18,446,744,073,707"),
        (ppo, "--gamma nan", "between 0 and 1, got nan"),
        (ppo, "--evaluate-every -1", "between 0 and"),
        (ppo, "--device gpu", "a device that PyTorch can use, as cpu, got 'gpu': "),
        (value_decomposition, "--device meta", "a device that PyTorch can use"),
        (value_decomposition, "--batch 0", "between 1 and 1,000,000"),
        (value_decomposition, "--capacity 10", "at least --batch, 32, got 10"),
        (value_decomposition, "--lr 0", "between 1e-12 and 1, got 0.0"),
    ],
)
def test_options_out_of_range_are_refused_before_anything_is_made(
    learner: Any,
    option: str,
    accepted: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """They were errors of PyTorch or Python, some after the training, or none."""
    argv = ["learner", "3m", "--steps", "300", "--out", str(tmp_path), *option.split()]
    monkeypatch.setattr("sys.argv", argv)
    with pytest.raises(SystemExit) as ended:
        learner.main()
    assert ended.value.code == 2
    assert f"{option.split()[0]} must be {accepted}" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_several_seeds_are_trained_in_one_call(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The folders are those that `report` takes for one algorithm."""
    small = "--steps 200 --num-envs 8 --horizon 16 --hidden 8,8 --threads 1 --evaluate-episodes 0"
    argv = ["ppo", "3m", "--seed", "4", "--seeds", "2", "--out", str(tmp_path), *small.split()]
    monkeypatch.setattr("sys.argv", argv)
    ppo.main()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["3m-ippo-4", "3m-ippo-5"]
    options = [json.loads((path / "options.json").read_text()) for path in sorted(tmp_path.iterdir())]
    assert [one["seed"] for one in options] == [4, 5] and "seeds" not in options[0]
    monkeypatch.setattr("sys.argv", ["ppo", "--seeds", "0"])
    with pytest.raises(SystemExit):
        ppo.main()
