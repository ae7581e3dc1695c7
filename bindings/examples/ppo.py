"""PPO of a team in one file: MAPPO, or IPPO with `--algorithm ippo`.

    python bindings/examples/ppo.py 2s3z --steps 500000 --seed 1

Proximal policy optimisation (Schulman et al., 2017) repeats two phases: play some steps of all environments with
the current policy, then improve the policy and its critic by a few passes of gradient steps over these data. All
agents share one policy, which sees an agent's own observation and its number. The critic, which only training
uses, sees the state (MAPPO: one value per environment) or the agent's observation (IPPO: one value per agent).

Algorithm, defaults, log and names of weights are those of `smaclite-pool train` (docs/training.md), which is
faster. This file is to be read and changed: from top to bottom, options, networks, the collection of data,
advantages, gradient steps, evaluation, and the loop around them. The same seed gives the same log on a CPU.

Axes of arrays: T steps of a rollout, N environments, A agents, V values per environment (1 or A).
"""

from __future__ import annotations

import argparse
import csv
import json
import time
from collections import defaultdict, deque
from dataclasses import asdict, dataclass, field, fields
from itertools import pairwise
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
    algorithm: str = option("mappo", "what the critic sees: the state (mappo) or an agent's observation (ippo)")
    steps: int = option(1_000_000, "environment steps of the run")
    seed: int = option(0, "of weights, environments, actions and minibatches")
    out: str = option("runs", "folder in which the folder of the run is created")
    device: str = option("cpu", "where the networks are: cpu or cuda")
    # With more threads, every small product of matrices ends with all threads waiting for the slowest, in a loop
    # that keeps the cores busy. If other programs use the machine, that multiplies the time.
    torch_threads: int = option(1, "threads of PyTorch")
    threads: int = option(0, "worker threads of the pool; 0: one less than the cores")
    num_envs: int = option(64, "number of environments")
    horizon: int = option(64, "steps of each environment per update")
    epochs: int = option(4, "passes over the data of an update")
    # Fewer rows than about 4096 per minibatch cost more processor time per row.
    minibatches: int = option(4, "gradient steps per epoch")
    hidden: str = option("64,64", "widths of the hidden layers")
    actor_lr: float = option(7e-4, "step size of the actor")
    critic_lr: float = option(1e-3, "step size of the critic")
    lr_end: float = option(1.0, "share of the step sizes that is left at the end, falling linearly")
    adam_eps: float = option(1e-5, "added to the denominator of Adam")
    gamma: float = option(0.99, "discount per step")
    lambda_: float = option(0.95, "decay of the generalised advantage estimate")
    clip: float = option(0.2, "how far the probability ratio may leave 1")
    value_clip: float = option(0.2, "how far a value may leave its old one, in deviations of the returns")
    huber: float = option(10.0, "where the value loss becomes linear, in deviations of the returns")
    entropy: float = option(0.01, "weight of the entropy at the beginning")
    entropy_end: float = option(0.01, "weight of the entropy at the end")
    max_grad_norm: float = option(1.0, "longest gradient of each network")
    evaluate_episodes: int = option(200, "episodes of the evaluation at the end; 0 for none")
    greedy: bool = option(False, "evaluate the most probable actions, not sampled ones")


class Mlp(nn.ModuleList):
    """Linear layers with ReLU between them.

    With agents, the first layer has a second bias, which the agent of a row selects. It equals a one-hot agent
    number among the inputs, without the products with zeros.
    """

    def __init__(self, widths: list[int], n_agents: int, gain: float) -> None:
        super().__init__(nn.Linear(n_in, n_out) for n_in, n_out in pairwise(widths))
        # An orthogonal matrix keeps the length of its input, and sqrt(2) makes up for the half that ReLU drops.
        for i, layer in enumerate(self):
            nn.init.orthogonal_(layer.weight, gain if i == len(self) - 1 else 2**0.5)
            nn.init.zeros_(layer.bias)
        if n_agents > 0:
            self.id_bias = nn.Parameter(torch.zeros(n_agents, widths[1]))

    def forward(self, x: Tensor, agents: Tensor) -> Tensor:
        """Of inputs [..., size]; `agents` has the agent of each, and is unused without agents."""
        first, *others = self
        x = first(x)
        if hasattr(self, "id_bias"):
            x = x + F.embedding(agents, self.id_bias)
        for layer in others:
            x = layer(torch.relu(x))
        return x


def log_probabilities(actor: nn.Module, obs: Tensor, available: Tensor, agents: Tensor) -> Tensor:
    """Logarithms of the probabilities of the actions; -1e30, and not -inf, if unavailable: 0 * -inf is NaN."""
    logits = actor(obs, agents).masked_fill(~available, -1e30)
    return logits - logits.logsumexp(-1, keepdim=True)  # in a quarter of the time of `log_softmax`


def sampled(log_probs: Tensor) -> Tensor:
    """Draws from the distributions: the largest sum of ln p and Gumbel noise, -ln(-ln u), is action a with
    probability p_a."""
    return (log_probs - torch.empty_like(log_probs).exponential_().log()).argmax(-1)


class ReturnNormaliser:
    """Mean and deviation of the returns, as moving averages over updates.

    The critic predicts returns in these units, so its targets have variance 1 whatever the scale of the rewards.
    """

    def __init__(self) -> None:
        self.mean_sum = self.square_sum = self.weight = 0.0
        self.mean, self.deviation = 0.0, 1.0

    def update(self, returns: Tensor, last: nn.Linear) -> None:
        """Changes the last layer of the critic too, so that it predicts the same returns in the new units (van
        Hasselt et al., 2016)."""
        old_mean, old_deviation = self.mean, self.deviation
        self.mean_sum = 0.9 * self.mean_sum + 0.1 * returns.mean().item()
        self.square_sum = 0.9 * self.square_sum + 0.1 * returns.square().mean().item()
        self.weight = 0.9 * self.weight + 0.1  # that all observations have in the sums
        self.mean = self.mean_sum / self.weight
        self.deviation = max(self.square_sum / self.weight - self.mean**2, 1e-4) ** 0.5
        last.weight.data.mul_(old_deviation / self.deviation)
        last.bias.data.mul_(old_deviation).add_(old_mean - self.mean).div_(self.deviation)


class Rollout:
    """T + 1 batches, one after the other. Row t + 1 has the reward and the ends that the actions chosen from row t
    caused; row T is the first one of the next rollout."""

    FIELDS = ("obs", "state", "avail_actions", "reward", "terminated", "truncated", "episode_length")

    def __init__(self, envs: sp.Envs, steps: int) -> None:
        shapes = {name: envs.fields[name] for name in self.FIELDS}
        self.arrays = {name: np.zeros((steps + 1, *shape), dtype) for name, (dtype, shape) in shapes.items()}

    def store(self, t: int, batch: sp.Batch) -> None:
        for name, array in self.arrays.items():
            array[t] = getattr(batch, name)


def advantages_of(reward: Tensor, values: Tensor, terminated: Tensor, truncated: Tensor, options: Options) -> Tensor:
    """Generalised advantage estimates [T, N, V] (Schulman et al., 2016) of values [T + 1, N, V]; others [T, N].

    The error of the critic in step t is r_t + gamma V_{t+1} - V_t. The advantage of t is the sum of the errors
    from t to the end of the episode, each discounted by gamma lambda per step.

    A battle that ended has no future: V_{t+1} counts as 0. One that the time limit cut off has: V_{t+1} is the
    value of its last state. Under next-step autoreset this state is that of the next batch, as always, so the
    end needs no special case. Either way, the errors of the next episode do not belong to this one.
    """
    continues = (~(terminated | truncated)).float().unsqueeze(-1)
    future = values[1:] * (~terminated).float().unsqueeze(-1)
    errors = reward.unsqueeze(-1) + options.gamma * future - values[:-1]
    advantages = torch.empty_like(errors)
    carried = torch.zeros_like(errors[0])
    for t in reversed(range(len(errors))):
        carried = errors[t] + options.gamma * options.lambda_ * continues[t] * carried
        advantages[t] = carried
    return advantages


@dataclass(frozen=True)
class Rows:
    """The data of an update. A sample is one environment in one step; it has A rows of the policy and V of the
    critic, side by side."""

    # By row of the policy, [T * N * A, ...]:
    obs: Tensor
    available: Tensor
    has_choice: Tensor
    actions: Tensor
    log_probs: Tensor
    advantages: Tensor
    # By row of the critic, [T * N * V, ...], values in units of the normaliser:
    critic_inputs: Tensor
    old_values: Tensor
    targets: Tensor

    samples: Tensor
    """Those from which something can be learnt."""
    explained_variance: float
    """Share of the variance of the returns that the critic predicted."""


class Learner:
    """Networks, optimisers and a rollout."""

    def __init__(self, envs: sp.Envs, options: Options) -> None:
        self.envs, self.options, self.device = envs, options, torch.device(options.device)
        self.sees_state = options.algorithm == "mappo"
        self.n_values = 1 if self.sees_state else envs.n_agents
        n_agents, hidden = envs.n_agents, [int(width) for width in options.hidden.split(",")]
        # The small gain makes the first policy almost uniform, so that it explores.
        actor = Mlp([envs.obs_size, *hidden, envs.n_actions], n_agents, gain=0.01)
        seen, of_agents = (envs.state_size, 0) if self.sees_state else (envs.obs_size, n_agents)
        critic = Mlp([seen, *hidden, 1], of_agents, gain=1.0)
        self.team = nn.ModuleDict({"actor": actor, "critic": critic}).to(self.device)
        self.actor, self.critic = self.team["actor"], self.team["critic"]
        self.actor_optimiser = torch.optim.Adam(self.actor.parameters(), eps=options.adam_eps)
        self.critic_optimiser = torch.optim.Adam(self.critic.parameters(), eps=options.adam_eps)
        self.returns = ReturnNormaliser()
        self.rollout = Rollout(envs, options.horizon)
        self.agents = torch.arange(n_agents, device=self.device)  # [A]
        shape = (options.horizon, options.num_envs, n_agents)
        self.actions = torch.zeros(shape, dtype=torch.int64, device=self.device)
        self.log_probs = torch.zeros(shape, device=self.device)

    def collect(self, batch: sp.Batch, episodes: deque[tuple[float, bool, int]]) -> tuple[sp.Batch, int, float]:
        """Plays T steps from a batch. Returns the last batch, the ended episodes and the seconds of waiting."""
        n_ended, waited = 0, 0.0
        self.rollout.store(0, batch)
        for t in range(self.options.horizon):
            actions = self.act(t)
            begin = time.perf_counter()
            batch = self.envs.step(actions)
            waited += time.perf_counter() - begin
            self.rollout.store(t + 1, batch)
            ended = batch.terminated | batch.truncated
            columns = (batch.episode_return, batch.battle_won, batch.episode_length)
            episodes.extend(zip(*(column[ended].tolist() for column in columns), strict=True))
            n_ended += int(ended.sum())
        return batch, n_ended, waited

    def act(self, t: int) -> NDArray[np.int32]:
        """Draws the actions of step t, [N, A]. Dead agents have only one available action."""
        obs = torch.from_numpy(self.rollout.arrays["obs"][t]).to(self.device)
        available = torch.from_numpy(self.rollout.arrays["avail_actions"][t]).to(self.device)
        with torch.no_grad():
            log_probs = log_probabilities(self.actor, obs, available, self.agents)
            actions = sampled(log_probs)
            self.actions[t] = actions
            self.log_probs[t] = log_probs.gather(-1, actions.unsqueeze(-1)).squeeze(-1)
        return actions.int().cpu().numpy()

    def learn(self, progress: float) -> dict[str, float]:
        """Improves the networks with the rollout. `progress` is the share of the run that is done. Returns means
        over the gradient steps, for the log."""
        options = self.options
        lr_factor = 1 + (options.lr_end - 1) * progress
        entropy_weight = options.entropy + (options.entropy_end - options.entropy) * progress
        self.actor_optimiser.param_groups[0]["lr"] = options.actor_lr * lr_factor
        self.critic_optimiser.param_groups[0]["lr"] = options.critic_lr * lr_factor
        data = self.rows()
        stats: dict[str, list[Tensor]] = defaultdict(list)
        for _ in range(options.epochs):
            # Samples are shuffled, as the rows of one lie side by side in memory.
            samples = data.samples[torch.randperm(len(data.samples), device=self.device)]
            policy_rows = rows_of(samples, self.envs.n_agents)
            policy_rows = policy_rows[data.has_choice[policy_rows]]
            value_rows = rows_of(samples, self.n_values)
            for rows in policy_rows.tensor_split(options.minibatches):
                self.improve_actor(data, rows, entropy_weight, stats)
            for rows in value_rows.tensor_split(options.minibatches):
                self.improve_critic(data, rows, stats)
        row = {"policy_rows": len(policy_rows) / len(data.obs)}
        names = ["policy_loss", "value_loss", "entropy", "kl", "clip_fraction", "actor_grad_norm", "critic_grad_norm"]
        row |= {name: torch.stack(stats[name]).mean().item() for name in names}
        row |= {"explained_variance": data.explained_variance}
        return row | {"actor_lr": options.actor_lr * lr_factor, "entropy_weight": entropy_weight}

    def rows(self) -> Rows:
        """Estimates advantages and targets, and brings the rollout into the form of rows."""
        data = {name: torch.from_numpy(array).to(self.device) for name, array in self.rollout.arrays.items()}
        critic_inputs = data["state"].unsqueeze(2) if self.sees_state else data["obs"]  # [T + 1, N, V, size]
        with torch.no_grad():
            values = self.critic(critic_inputs, self.agents).squeeze(-1)  # [T + 1, N, V]
        values = values * self.returns.deviation + self.returns.mean
        ends = data["terminated"][1:], data["truncated"][1:]
        advantages = advantages_of(data["reward"][1:], values, *ends, self.options)
        targets = advantages + values[:-1]

        # After an episode, a step only resets the environment: its action was ignored, and its sample is left out
        # of learning. The policy learns nothing from agents with one available action either, as dead agents.
        # That drops a third to two thirds of its rows.
        is_learnt = data["episode_length"][1:] > 0  # [T, N]
        has_choice = data["avail_actions"][:-1].sum(-1) > 1  # [T, N, A]

        errors, learnt_targets = advantages[is_learnt], targets[is_learnt]
        self.returns.update(learnt_targets, self.critic[-1])
        in_units = lambda returns: ((returns - self.returns.mean) / self.returns.deviation).flatten()
        # If there is one value per environment, the agents share its advantage.
        advantages = advantages.expand(-1, -1, self.envs.n_agents)
        learnt = advantages[has_choice & is_learnt.unsqueeze(-1)]
        return Rows(
            obs=data["obs"][:-1].flatten(0, 2),
            available=data["avail_actions"][:-1].flatten(0, 2),
            has_choice=has_choice.flatten(),
            actions=self.actions.flatten(),
            log_probs=self.log_probs.flatten(),
            advantages=((advantages - learnt.mean()) / (learnt.std() + 1e-8)).flatten(),
            critic_inputs=critic_inputs[:-1].flatten(0, 2),
            old_values=in_units(values[:-1]),
            targets=in_units(targets),
            samples=is_learnt.flatten().nonzero().squeeze(-1),
            explained_variance=1 - (errors.var() / learnt_targets.var()).item(),
        )

    def improve_actor(self, data: Rows, rows: Tensor, entropy_weight: float, stats: dict[str, list[Tensor]]) -> None:
        """A step up the smaller one of two objectives: the advantage times the ratio of the new probability of the
        action to the old one, and the same with a ratio that is clipped to about 1. So nothing is gained by a
        ratio beyond the clip range, but a step back into it is."""
        # `index_select(0, rows)` is several times as fast as `[rows]`.
        obs, available = data.obs.index_select(0, rows), data.available.index_select(0, rows)
        log_probs = log_probabilities(self.actor, obs, available, rows % self.envs.n_agents)
        log_prob = log_probs.gather(-1, data.actions[rows].unsqueeze(-1)).squeeze(-1)
        log_ratio = log_prob - data.log_probs[rows]
        ratio, advantage, clip = log_ratio.exp(), data.advantages[rows], self.options.clip
        loss = -torch.minimum(ratio * advantage, ratio.clamp(1 - clip, 1 + clip) * advantage).mean()
        entropy = -(log_probs.exp() * log_probs).sum(-1).mean()
        norm = self.step(self.actor_optimiser, loss - entropy_weight * entropy)
        stats["policy_loss"].append(loss.detach())
        stats["entropy"].append(entropy.detach())
        stats["kl"].append((ratio - 1 - log_ratio).mean().detach())
        stats["clip_fraction"].append(((ratio - 1).abs() > clip).float().mean())
        stats["actor_grad_norm"].append(norm)

    def improve_critic(self, data: Rows, rows: Tensor, stats: dict[str, list[Tensor]]) -> None:
        """A step down the larger one of two losses: of the value, and of the value clipped to about its old one."""
        value = self.critic(data.critic_inputs.index_select(0, rows), rows % self.n_values).squeeze(-1)
        old, target, clip = data.old_values[rows], data.targets[rows], self.options.value_clip
        limited = old + (value - old).clamp(-clip, clip)
        losses = (F.huber_loss(v, target, reduction="none", delta=self.options.huber) for v in (value, limited))
        loss = torch.maximum(*losses).mean()
        stats["value_loss"].append(loss.detach())
        stats["critic_grad_norm"].append(self.step(self.critic_optimiser, loss))

    def step(self, optimiser: torch.optim.Optimizer, loss: Tensor) -> Tensor:
        """Makes a gradient step. Returns the length of the gradient before it was clipped."""
        optimiser.zero_grad()
        loss.backward()
        parameters = optimiser.param_groups[0]["params"]
        norm = nn.utils.clip_grad_norm_(parameters, self.options.max_grad_norm, error_if_nonfinite=True)
        optimiser.step()
        return norm


def rows_of(samples: Tensor, width: int) -> Tensor:
    """The rows of samples that have `width` rows each, side by side."""
    return (samples.unsqueeze(-1) * width + torch.arange(width, device=samples.device)).flatten()


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
    update = steps = n_episodes = 0
    with sp.make(options.scenario, options.num_envs, threads=options.threads or None) as envs:
        learner = Learner(envs, options)
        batch = envs.reset(seed=1_000_000 * (options.seed + 1))  # the evaluation uses other seeds
        log = Log(folder)
        while steps < options.steps:
            begin = time.perf_counter()
            batch, n_ended, waited = learner.collect(batch, episodes)
            learn_begin = time.perf_counter()
            stats = learner.learn(min(steps / options.steps, 1.0))
            elapsed, learnt = time.perf_counter() - begin, time.perf_counter() - learn_begin
            new_steps = int((learner.rollout.arrays["episode_length"][1:] > 0).sum())
            update, steps, n_episodes = update + 1, steps + new_steps, n_episodes + n_ended
            returns, wins, lengths = zip(*episodes, strict=True) if episodes else ([], [], [])
            row = {"update": update, "steps": steps, "episodes": n_episodes, "mean_return": mean(returns)}
            row |= {"win_rate": mean(wins), "mean_length": mean(lengths), **stats}
            speed = {"steps_per_s": new_steps / elapsed}
            log.write(row, speed | {"wait_share": waited / elapsed, "learn_share": learnt / elapsed})
    save_file(learner.team.state_dict(), folder / "weights.safetensors")
    return learner.team


def evaluate(team: nn.ModuleDict, options: Options) -> dict[str, float]:
    """Plays the team. Of every environment the first episodes count, the same number in each (to within one): the
    first that end anywhere would be the short ones."""
    num_envs = min(options.evaluate_episodes, 64)
    quota = np.arange(num_envs) < options.evaluate_episodes % num_envs
    quota = options.evaluate_episodes // num_envs + quota
    episodes = []
    with sp.make(options.scenario, num_envs, threads=options.threads or None) as envs:
        batch = envs.reset(seed=0)
        agents = torch.arange(envs.n_agents, device=options.device)
        while quota.any():
            obs = torch.tensor(batch.obs, device=options.device)
            available = torch.tensor(batch.avail_actions, device=options.device)
            with torch.no_grad():
                log_probs = log_probabilities(team["actor"], obs, available, agents)
            actions = log_probs.argmax(-1) if options.greedy else sampled(log_probs)
            batch = envs.step(actions.int().cpu().numpy())
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
        flag, text = "--" + o.name.strip("_").replace("_", "-"), o.metadata["help"]
        if isinstance(o.default, bool):
            parser.add_argument(flag, dest=o.name, action="store_true", help=text)
        else:
            parser.add_argument(flag, dest=o.name, type=type(o.default), default=o.default, help=text)
    options = Options(**vars(parser.parse_args()))
    try:
        team = train(options)
        if options.evaluate_episodes > 0:
            how = "greedy" if options.greedy else "sampled"
            result = evaluate(team, options)
            print(
                f"{options.evaluate_episodes} episodes, {how}: won {100 * result['win_rate']:.1f} %, mean return "
                f"{result['mean_return']:.2f}, mean length {result['mean_length']:.1f}"
            )
    except sp.PoolError as error:
        raise SystemExit(f"ppo: {error}") from None
    except FileExistsError as error:
        raise SystemExit(f"ppo: {error.filename} already holds a run; choose another --out or --seed") from None


if __name__ == "__main__":
    main()
