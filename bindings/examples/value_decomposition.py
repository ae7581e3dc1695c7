"""Value decomposition in one file: QMIX, VDN or IQL (`--algorithm`) of a team with recurrent agents.

    python bindings/examples/value_decomposition.py 2s3z --steps 500000 --seed 1

Every agent has a value Q(history, action) of each of its actions, from a network that all agents share. It is
recurrent, so that an agent remembers what it saw and did. The agents take the action of the largest value, or,
with a probability that falls during training, a random one. Q-learning makes the values of the actions that were
taken more like the reward plus the values that follow:

- IQL (Tan, 1993): each agent on its own, with the reward of the team.
- VDN (Sunehag et al., 2018): the sum of the agents' values is the value of the team.
- QMIX (Rashid et al., 2018): the value of the team is a function of the agents' values and the state that never
  falls when an agent's value rises. So the best actions of the agents still are the best ones of the team.

Whole episodes are kept and learnt from again and again, which on-policy methods (ppo.py) cannot do. Log and
evaluation are as in ppo.py. The same seed gives the same log on a CPU.

Axes of arrays: T steps of an episode, B episodes, N environments, A agents.
"""

from __future__ import annotations

import argparse
import copy
import csv
import json
import time
from collections import deque
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np
import smaclite_pool as sp
import torch
from numpy.typing import NDArray
from safetensors.torch import save_file
from torch import Tensor, nn
from torch.nn import functional as F


def option(default: Any, text: str) -> Any:
    return field(default=default, metadata={"help": f"{text} (default: %(default)s)"})


@dataclass(frozen=True)
class Options:
    """Every option but `scenario` is one of the command line: `--num-envs 64`."""

    scenario: str = "2s3z"
    algorithm: str = option("qmix", "iql, vdn or qmix")
    steps: int = option(1_000_000, "environment steps of the run")
    seed: int = option(0, "of weights, environments, actions and samples of episodes")
    out: str = option("runs", "folder in which the folder of the run is created")
    device: str = option("cpu", "where the networks are: cpu or cuda")
    # With more threads, every small product of matrices ends with all threads waiting for the slowest, in a
    # loop that keeps the cores busy. If other programs use the machine, that multiplies the time.
    torch_threads: int = option(1, "threads of PyTorch")
    threads: int = option(0, "worker threads of the pool; 0: one less than the cores")
    num_envs: int = option(64, "number of environments")
    capacity: int = option(2000, "episodes that are kept")
    batch: int = option(32, "episodes per gradient step")
    # The gradient steps are most of the cost, so this is the option to trade processor time for fewer steps.
    episodes_per_update: int = option(8, "finished episodes per gradient step")
    hidden: int = option(64, "width of the agents' network")
    mixer_width: int = option(32, "width of QMIX's function")
    lr: float = option(1e-3, "step size")
    gamma: float = option(0.99, "discount per step")
    lambda_: float = option(0.6, "weight of the rewards that really followed, against estimates of them")
    epsilon_end: float = option(0.05, "probability of a random action at the end; 1 at the beginning")
    epsilon_steps: int = option(100_000, "steps in which it falls linearly")
    target_interval: int = option(100, "gradient steps after which the target networks are replaced")
    max_grad_norm: float = option(10.0, "longest gradient")
    evaluate_episodes: int = option(200, "episodes of the evaluation at the end, without random actions; 0: none")


class AgentNetwork(nn.Module):
    """Values of actions, from the observation, the agent's own last action and its number.

    Last action and number select a row of weights each, which equals one-hot vectors among the inputs, without
    the products with zeros.
    """

    def __init__(self, envs: sp.Envs, hidden: int) -> None:
        super().__init__()
        self.first = nn.Linear(envs.obs_size, hidden)
        self.last_action = nn.Embedding(envs.n_actions + 1, hidden)  # the last one: no action yet
        self.agent = nn.Embedding(envs.n_agents, hidden)
        self.memory = nn.GRU(hidden, hidden)
        self.values = nn.Linear(hidden, envs.n_actions)
        nn.init.zeros_(self.last_action.weight)
        nn.init.zeros_(self.agent.weight)

    def forward(self, obs: Tensor, last_actions: Tensor, memory: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Of obs [T, B, A, size] and last actions [T, B, A]: values [T, B, A, n_actions] and the memory after
        the last step, [1, B * A, hidden]. Without a memory, the episode begins."""
        agents = torch.arange(obs.shape[2], device=obs.device)
        x = torch.relu(self.first(obs) + self.last_action(last_actions) + self.agent(agents))
        x, memory = self.memory(x.flatten(1, 2), memory)
        return self.values(x).unflatten(1, obs.shape[1:3]), memory


class SumMixer(nn.Module):
    """VDN."""

    def forward(self, values: Tensor, state: Tensor) -> Tensor:
        return values.sum(-1, keepdim=True)


class EachMixer(nn.Module):
    """IQL: no mixing, as many values as agents."""

    def forward(self, values: Tensor, state: Tensor) -> Tensor:
        return values


class QmixMixer(nn.Module):
    """A network with one hidden layer over the agents' values. Its weights are linear functions of the state,
    made positive, so that its output rises with each of its inputs."""

    def __init__(self, envs: sp.Envs, width: int) -> None:
        super().__init__()
        self.weight_1 = nn.Linear(envs.state_size, envs.n_agents * width)
        self.bias_1 = nn.Linear(envs.state_size, width)
        self.weight_2 = nn.Linear(envs.state_size, width)
        self.bias_2 = nn.Sequential(nn.Linear(envs.state_size, width), nn.ReLU(), nn.Linear(width, 1))

    def forward(self, values: Tensor, state: Tensor) -> Tensor:
        """Of values [T, B, A] and state [T, B, size]: [T, B, 1]."""
        weight_1 = self.weight_1(state).abs().unflatten(-1, (values.shape[-1], -1))  # [T, B, A, width]
        hidden = F.elu((values.unsqueeze(-1) * weight_1).sum(-2) + self.bias_1(state))
        return (hidden * self.weight_2(state).abs()).sum(-1, keepdim=True) + self.bias_2(state)


class Replay:
    """Whole episodes: row t of an episode has what the agents saw after t steps and what they then did, and the
    reward and the end that this led to.

    Environments write their current episodes in place. When one ends, its environment goes on in the place of
    the oldest episode, if none is free. Memory that no step reached costs nothing.
    """

    def __init__(self, envs: sp.Envs, capacity: int, seed: int) -> None:
        n_agents, n_actions = envs.n_agents, envs.n_actions
        limit = envs.episode_limit
        assert limit is not None
        axes = (capacity + envs.num_envs, limit + 1)
        self.obs = np.zeros((*axes, n_agents, envs.obs_size), np.float32)
        self.state = np.zeros((*axes, envs.state_size), np.float32)
        self.available = np.zeros((*axes, n_agents, n_actions), np.bool_)
        self.actions = np.zeros((*axes, n_agents), np.int64)
        self.reward = np.zeros(axes, np.float32)
        self.terminated = np.zeros(axes, np.bool_)
        self.lengths = np.zeros(len(self.obs), np.int64)
        self.complete: deque[int] = deque(maxlen=capacity)  # places, the oldest episode first
        self.places = np.arange(envs.num_envs)  # of the current episodes
        self.free = list(range(envs.num_envs, len(self.obs)))
        self.random = np.random.default_rng(seed)

    def store_seen(self, batch: sp.Batch) -> None:
        """The lane is synchronous, so slot i is environment i. A slot that was only reset has length 0: a new
        episode, in the place that `store_outcome` gave the environment."""
        at = self.places, batch.episode_length
        self.obs[at], self.state[at], self.available[at] = batch.obs, batch.state, batch.avail_actions

    def store_outcome(self, actions: NDArray[np.int32], batch: sp.Batch) -> None:
        """`batch` is what the actions led to. The actions of slots that were only reset were ignored."""
        stepped = batch.episode_length > 0
        at = self.places[stepped], batch.episode_length[stepped] - 1
        self.actions[at], self.reward[at] = actions[stepped], batch.reward[stepped]
        self.terminated[at] = batch.terminated[stepped]

    def end_episodes(self, batch: sp.Batch) -> None:
        for i in np.flatnonzero(batch.terminated | batch.truncated):
            self.lengths[self.places[i]] = batch.episode_length[i]
            if not self.free:
                self.free.append(self.complete.popleft())
            self.complete.append(int(self.places[i]))
            self.places[i] = self.free.pop()

    def sample(self, n: int) -> dict[str, Tensor]:
        """n episodes, up to the end of the longest: tensors [T, n, ...] or, of what is seen, [T + 1, n, ...]."""
        places = self.random.choice(np.array(self.complete), n, replace=False)
        steps = int(self.lengths[places].max())
        names = ["obs", "state", "available", "actions", "reward", "terminated"]
        arrays = {name: getattr(self, name)[places, : steps + 1].swapaxes(0, 1) for name in names}
        sampled = {name: torch.from_numpy(array).contiguous() for name, array in arrays.items()}
        for name in ("actions", "reward", "terminated"):
            sampled[name] = sampled[name][:-1]
        return sampled | {"lengths": torch.from_numpy(self.lengths[places])}


class Learner:
    """Networks, their older copies, the optimiser and the episodes."""

    def __init__(self, envs: sp.Envs, options: Options) -> None:
        self.options, self.device = options, torch.device(options.device)
        mixers = {"iql": EachMixer, "vdn": SumMixer, "qmix": lambda: QmixMixer(envs, options.mixer_width)}
        networks = {"agent": AgentNetwork(envs, options.hidden), "mixer": mixers[options.algorithm]()}
        self.team = nn.ModuleDict(networks).to(self.device)
        # The values that follow are estimated by copies that change rarely. Else every gradient step would move
        # its own targets.
        self.target = copy.deepcopy(self.team)
        self.optimiser = torch.optim.Adam(self.team.parameters(), lr=options.lr)
        self.replay = Replay(envs, options.capacity, options.seed)
        self.updates = 0

    def learn(self) -> dict[str, float]:
        """A gradient step on a sample of episodes. Returns values for the log."""
        options = self.options
        data = {name: tensor.to(self.device) for name, tensor in self.replay.sample(options.batch).items()}
        n_actions = data["available"].shape[-1]
        last_actions = F.pad(data["actions"], (0, 0, 0, 0, 1, 0), value=n_actions)  # [T + 1, B, A]
        values, _ = self.team["agent"](data["obs"], last_actions)  # [T + 1, B, A, n_actions]
        chosen = values[:-1].gather(-1, data["actions"].unsqueeze(-1)).squeeze(-1)  # [T, B, A]
        total = self.team["mixer"](chosen, data["state"][:-1])  # [T, B, 1], of IQL [T, B, A]
        with torch.no_grad():
            # Double Q-learning (van Hasselt et al., 2016): the networks choose the best actions, and the copies
            # say what they are worth. The largest of noisy values would be too large.
            best = values.masked_fill(~data["available"], -torch.inf).argmax(-1, keepdim=True)
            target_values, _ = self.target["agent"](data["obs"], last_actions)
            following = target_values.gather(-1, best).squeeze(-1)  # [T + 1, B, A]
            targets = self.targets(data, self.target["mixer"](following, data["state"]))
        steps = torch.arange(len(total), device=self.device)
        is_step = (steps.unsqueeze(-1) < data["lengths"]).unsqueeze(-1)  # [T, B, 1]: not behind the end
        loss = ((total - targets).square() * is_step).sum() / is_step.expand_as(total).sum()
        self.optimiser.zero_grad()
        loss.backward()
        norm = nn.utils.clip_grad_norm_(self.team.parameters(), options.max_grad_norm, error_if_nonfinite=True)
        self.optimiser.step()
        self.updates += 1
        if self.updates % options.target_interval == 0:
            self.target.load_state_dict(self.team.state_dict())
        mean_value = (total.detach() * is_step).sum() / is_step.expand_as(total).sum()
        return {"loss": loss.item(), "mean_value": mean_value.item(), "grad_norm": norm.item()}

    def targets(self, data: dict[str, Tensor], values: Tensor) -> Tensor:
        """What the values of steps should have been, [T, B, 1 or A], given the values [T + 1, B, 1 or A] of the
        best actions.

        With lambda = 0 that of step t is the reward plus gamma times the value of step t + 1. With lambda > 0 that
        value is mixed with the target of step t + 1: rewards reach earlier steps faster, but the actions that
        led to them were partly random or old. (Peng's Q(lambda), 1994.)

        A battle that ended has no future. One that the time limit cut off has: the value of its last state.
        """
        gamma, keep = self.options.gamma, self.options.lambda_
        targets = torch.zeros_like(values[:-1])
        follows = values[-1]
        for t in reversed(range(len(targets))):
            is_last = (data["lengths"] == t + 1).unsqueeze(-1)
            follows = torch.where(is_last, values[t + 1], (1 - keep) * values[t + 1] + keep * follows)
            follows = follows.masked_fill(data["terminated"][t].unsqueeze(-1), 0.0)
            follows = data["reward"][t].unsqueeze(-1) + gamma * follows
            targets[t] = follows
        return targets


class Player:
    """Acts in all environments, and remembers what the agents' networks remember."""

    def __init__(self, envs: sp.Envs, network: nn.Module, device: str) -> None:
        self.envs, self.network, self.device = envs, network, device
        self.last_actions = torch.full((envs.num_envs, envs.n_agents), envs.n_actions, device=device)
        self.memory = torch.zeros(1, envs.num_envs * envs.n_agents, network.memory.hidden_size, device=device)

    def act(self, batch: sp.Batch, epsilon: float) -> NDArray[np.int32]:
        """[N, A]: the best available actions, and random ones with a probability of epsilon."""
        n_agents, n_actions = self.envs.n_agents, self.envs.n_actions
        is_first = torch.tensor(batch.episode_length == 0, device=self.device)
        self.last_actions[is_first] = n_actions
        self.memory.unflatten(1, (-1, n_agents))[:, is_first] = 0.0
        obs = torch.tensor(batch.obs, device=self.device).unsqueeze(0)
        with torch.no_grad():
            values, self.memory = self.network(obs, self.last_actions.unsqueeze(0), self.memory)
        values = values[0].masked_fill(~torch.tensor(batch.avail_actions, device=self.device), -torch.inf)
        actions = values.argmax(-1)
        if epsilon > 0:
            random = torch.from_numpy(self.envs.sample_actions()).to(self.device)
            actions = torch.where(torch.rand_like(values[..., 0]) < epsilon, random, actions)
        self.last_actions = actions
        return actions.int().cpu().numpy()


class Log:
    """`log.csv` in the folder of the run, TensorBoard's file if its package is installed, and progress."""

    def __init__(self, folder: Path) -> None:
        self.file = (folder / "log.csv").open("w", buffering=1)
        self.begin, self.cpu_begin, self.printed = time.perf_counter(), time.process_time(), 0.0
        try:
            from torch.utils.tensorboard import SummaryWriter

            self.tensorboard = SummaryWriter(str(folder))
        except ImportError:
            self.tensorboard = None

    def write(self, row: dict[str, float], speed: dict[str, float]) -> None:
        """Adds a row, with the time and processor time of the run. The latter includes the pool."""
        seconds, cpu_seconds = time.perf_counter() - self.begin, time.process_time() - self.cpu_begin
        row = row | {"seconds": seconds, "cpu_seconds": cpu_seconds} | speed
        if self.tensorboard is not None:
            for name, value in row.items():
                self.tensorboard.add_scalar(name, value, int(row["steps"]))
        writer = csv.DictWriter(self.file, row)
        if row["update"] == 1:
            writer.writeheader()
        writer.writerow({name: "" if value != value else value for name, value in row.items()})
        if seconds > self.printed + 2:
            self.printed = seconds
            print(
                f"{row['steps']:9,} steps, {row['steps'] / cpu_seconds:7,.0f} per CPU second, "
                f"return {row['mean_return']:5.2f}, wins {100 * row['win_rate']:5.1f} %",
                flush=True,
            )


def mean(values: list[float]) -> float:
    return sum(values) / len(values) if values else float("nan")


def train(options: Options) -> nn.ModuleDict:
    """Trains a team, and writes log and weights to its folder."""
    torch.manual_seed(options.seed)
    torch.set_num_threads(options.torch_threads)
    folder = Path(options.out) / f"{Path(options.scenario).stem}-{options.algorithm}-{options.seed}"
    folder.mkdir(parents=True)
    (folder / "options.json").write_text(json.dumps(asdict(options), indent=2))
    episodes: deque[tuple[float, bool, int]] = deque(maxlen=200)  # return, won and length of the newest
    steps = n_episodes = 0
    with sp.make(options.scenario, options.num_envs, threads=options.threads or None) as envs:
        envs.seed_sampler(options.seed)
        learner = Learner(envs, options)
        player = Player(envs, learner.team["agent"], options.device)
        batch = envs.reset(seed=1_000_000 * (options.seed + 1))  # the evaluation uses other seeds
        log = Log(folder)
        waited = learnt = 0.0
        last = (time.perf_counter(), 0)
        while steps < options.steps:
            learner.replay.store_seen(batch)
            epsilon = 1 + (options.epsilon_end - 1) * min(steps / options.epsilon_steps, 1.0)
            actions = player.act(batch, epsilon)
            begin = time.perf_counter()
            batch = envs.step(actions)
            waited += time.perf_counter() - begin
            learner.replay.store_outcome(actions, batch)
            steps += int((batch.episode_length > 0).sum())
            ended = batch.terminated | batch.truncated
            if not ended.any():
                continue
            learner.replay.store_seen(batch)
            learner.replay.end_episodes(batch)
            columns = (batch.episode_return, batch.battle_won, batch.episode_length)
            episodes.extend(zip(*(column[ended].tolist() for column in columns), strict=True))
            n_episodes += int(ended.sum())
            while learner.updates < (n_episodes - options.batch) // options.episodes_per_update:
                begin = time.perf_counter()
                stats = learner.learn()
                now = time.perf_counter()
                learnt += now - begin
                returns, wins, lengths = zip(*episodes, strict=True)
                row = {"update": learner.updates, "steps": steps, "episodes": n_episodes}
                row |= {"mean_return": mean(returns), "win_rate": mean(wins), "mean_length": mean(lengths)}
                elapsed, new_steps = now - last[0], steps - last[1]
                speed = {"steps_per_s": new_steps / elapsed, "wait_share": waited / elapsed}
                log.write(row | stats | {"epsilon": epsilon}, speed | {"learn_share": learnt / elapsed})
                waited, learnt, last = 0.0, 0.0, (now, steps)
    save_file(learner.team.state_dict(), folder / "weights.safetensors")
    return learner.team


def evaluate(team: nn.ModuleDict, options: Options) -> dict[str, float]:
    """Plays the team without random actions. Of every environment the first episodes count, the same number in
    each (to within one): the first that end anywhere would be the short ones."""
    num_envs = min(options.evaluate_episodes, 64)
    quota = np.arange(num_envs) < options.evaluate_episodes % num_envs
    quota = options.evaluate_episodes // num_envs + quota
    episodes = []
    with sp.make(options.scenario, num_envs, threads=options.threads or None) as envs:
        player = Player(envs, team["agent"], options.device)
        batch = envs.reset(seed=0)
        while quota.any():
            batch = envs.step(player.act(batch, epsilon=0.0))
            counted = (batch.terminated | batch.truncated) & (quota > 0)
            quota -= counted
            columns = (batch.episode_return, batch.battle_won, batch.episode_length)
            episodes += zip(*(column[counted].tolist() for column in columns), strict=True)
    returns, wins, lengths = zip(*episodes, strict=True)
    return {"win_rate": mean(wins), "mean_return": mean(returns), "mean_length": mean(lengths)}


def main() -> None:
    keep_lines = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=keep_lines)
    parser.add_argument("scenario", nargs="?", default=Options.scenario, help="a standard scenario or a file")
    for o in fields(Options)[1:]:
        flag = "--" + o.name.strip("_").replace("_", "-")
        parser.add_argument(flag, dest=o.name, type=type(o.default), default=o.default, help=o.metadata["help"])
    options = Options(**vars(parser.parse_args()))
    try:
        team = train(options)
        if options.evaluate_episodes > 0:
            result = evaluate(team, options)
            print(
                f"{options.evaluate_episodes} episodes: won {100 * result['win_rate']:.1f} %, "
                f"mean return {result['mean_return']:.2f}, mean length {result['mean_length']:.1f}"
            )
    except sp.PoolError as error:
        raise SystemExit(f"value_decomposition: {error}") from None
    except FileExistsError as error:
        what = f"{error.filename} already holds a run; choose another --out or --seed"
        raise SystemExit(f"value_decomposition: {what}") from None


if __name__ == "__main__":
    main()
