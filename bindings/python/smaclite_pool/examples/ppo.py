"""PPO of a team in one file: MAPPO or IPPO (`--algorithm`).

    python -m smaclite_pool.examples.ppo 2s3z --steps 500000 --seed 1
    python -m smaclite_pool.examples.ppo 3m --steps 500000 --seeds 5 --evaluate-every 50000 --out runs/ppo

Proximal policy optimisation (Schulman et al., 2017) repeats two phases: play some steps of all environments
with the current policy, then improve policy and critic by a few passes of gradient steps over these data. All
agents share one policy, which sees an agent's own observation, and if it is flat also its number. The critic,
which only training uses, sees the state (MAPPO: one value per environment) or an agent's observation (IPPO:
one per agent).

Algorithm, networks, defaults, log and names of weights are those of `smaclite-pool train`, which is faster
(docs/how-to/training.md). This file is to be read and changed: from top to bottom, options, networks (those
of `--network units` are in units_network.py), advantages, the learner, log, and the loop around it. The same
seed gives the same log on a CPU.

Axes of arrays: T steps of a rollout, N environments, A agents, V values per environment (1 or A).
"""

from __future__ import annotations

import errno
import math
import time
from collections import defaultdict, deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import smaclite_pool as sp
from numpy.typing import NDArray
from smaclite_pool.examples import units_network
from smaclite_pool.examples.evaluations import Clock, Evaluations, Log, recent
from smaclite_pool.examples.options import (
    SEED,
    SHARE,
    SMALL,
    STEPS,
    extra,
    one_line_errors,
    option,
    parsed,
    parser_of,
    write_options,
)

with extra("torch"):
    import torch
    from safetensors.torch import save_file
    from torch import Tensor, nn
    from torch.nn import functional as F

ACTIVATIONS: dict[str, Callable[[Tensor], Tensor]] = {"relu": torch.relu, "tanh": torch.tanh}

HIDDEN = {"flat": "64,64", "units": "32,64"}
"""The networks, and the default widths of their hidden layers."""

ACTOR_LR = {"flat": 7e-4, "units": 1.4e-3}
"""The default step sizes of the actor."""

TEAM_ENTROPY = 0.15
"""The more agents explore at once, the less can each of them learn from the reward that they share. So the
default weight of the entropy is divided by their number."""

LAST_ACTIONS = 4
"""How many of its last actions an agent of a fixed team observes by default. A fixed battle is nearly the
same every time, so they say where in it it is. In drawn battles agents learn to go on with what they did."""

STATE_CRITIC_AGENTS = 5
"""The fewest agents of a fixed team whose critic sees the state by default. An observation says little of a
battle of many units whose reward the team shares; in a small team, it says what the agent itself is worth to
it. How strong drawn teams are, the state says, so there the critic always sees it."""


@dataclass(frozen=True)
class Options:
    """Each of these, except the scenario, is an option of the command line, as `--num-envs 64`."""

    scenario: str = "2s3z"
    algorithm: str = option(
        "by team",
        "what the critic sees: state (mappo) or observation (ippo); by team: mappo for 5 agents or more "
        "and for drawn teams",
        ["mappo", "ippo", "by team"],
    )
    steps: int = option(2_000_000, "environment steps of the run", within=STEPS)
    seed: int = option(0, "of weights, environments, actions and minibatches", within=SEED)
    out: str = option("runs", "folder in which the folder of the run is created")
    device: str = option("cpu", "where the networks are: cpu or cuda")
    # Matrices are small here. With more threads, each product ends with threads that wait for the slowest one
    # in a busy loop, and on a machine with other work that multiplies the time.
    torch_threads: int = option(1, "threads of PyTorch", within=(1, 1024))
    threads: int = option(0, "threads of the pool; 0: as many as there are cores", within=(0, 1024))
    last_actions: int = option(
        -1, "how many of its own last actions an agent observes; -1: 4, or 0 for drawn teams", within=(0, 16)
    )
    num_envs: int = option(64, "number of environments", within=(1, 65_536))
    horizon: int = option(64, "steps of each environment per update", within=(1, 65_536))
    epochs: int = option(4, "passes over the data of an update", within=(1, 1000))
    minibatches: int = option(8, "gradient steps per epoch", within=(1, 1000))
    network: str = option(
        "by scenario",
        "flat, or over units: the same for all enemies and all allies; by scenario: units, or flat where "
        "observations have none",
        [*HIDDEN, "by scenario"],
    )
    hidden: str = option(
        "by network",
        "widths of the hidden layers, over units those of embeddings and trunk; by network: 64,64 for flat, "
        "32,64 for units",
        numbers=True,
    )
    activation: str = option("relu", "non-linearity of the hidden layers", [*ACTIVATIONS])
    actor_lr: float = option(
        -1.0, "step size of the actor; -1: by network, 7e-4 for flat, 1.4e-3 for units", within=SMALL
    )
    critic_lr: float = option(1e-3, "step size of the critic", within=SMALL)
    lr_end: float = option(
        0.05, "share of the step sizes that is left at the end, falling linearly", within=SHARE
    )
    adam_eps: float = option(1e-5, "added to the denominator of Adam", within=SMALL)
    gamma: float = option(0.99, "discount per step", within=SHARE)
    lambda_: float = option(0.95, "decay of the generalised advantage estimate", within=SHARE)
    advantage_floor: float = option(
        0.3, "divide advantages at least by this share of the returns' deviation", within=(0, 10)
    )
    clip: float = option(0.2, "how far the probability ratio may leave 1", within=(1e-12, 1e6))
    value_clip: float = option(
        0.2, "how far a value may leave its old one, in deviations of the returns", within=(1e-12, 1e6)
    )
    huber: float = option(
        10.0, "where the value loss becomes linear, in deviations of the returns", within=(1e-12, 1e6)
    )
    entropy: float = option(
        -1.0, "weight of the entropy at the beginning; -1: 0.15 / number of agents", within=(0, 10)
    )
    entropy_end: float = option(0.0, "weight of the entropy at the end", within=(0, 10))
    max_grad_norm: float = option(1.0, "longest gradient of each network", within=(1e-12, 1e6))
    evaluate_every: int = option(
        0, "evaluate every so many steps, and keep the best weights; 0: never", within=(0, 2**48)
    )
    evaluate_episodes: int = option(
        200, "episodes of the evaluation at the end; 0: none", within=(0, 1_000_000)
    )
    greedy: bool = option(False, "evaluate the most probable actions, not sampled ones")


class Mlp(nn.ModuleList):
    """Linear layers with a non-linearity between them.

    With agents, the first layer has a second bias, which the agent of a row selects. It equals a one-hot
    agent number among the inputs, without the products with zeros.
    """

    def __init__(self, widths: list[int], n_agents: int, gain: float, activation: str) -> None:
        super().__init__(nn.Linear(n_in, n_out) for n_in, n_out in pairwise(widths))
        self.activation = ACTIVATIONS[activation]
        # An orthogonal matrix keeps the length of its input; sqrt(2) makes up for the half that ReLU drops.
        layer: Any
        for i, layer in enumerate(self):
            nn.init.orthogonal_(layer.weight, gain if i == len(self) - 1 else 2**0.5)
            nn.init.zeros_(layer.bias)
        self.id_bias = nn.Parameter(torch.zeros(n_agents, widths[1])) if n_agents > 0 else None

    @property
    def head(self) -> Any:
        return self[-1]

    def forward(self, x: Tensor, agents: Tensor) -> Tensor:
        """Of inputs [..., size]; `agents` has the agent of each, and is not used without agents."""
        first, *others = self
        x = first(x)
        if self.id_bias is not None:
            x = x + F.embedding(agents, self.id_bias)
        for layer in others:
            x = layer(self.activation(x))
        return x


def networks(envs: sp.Envs, options: Options, sees_state: bool) -> tuple[Any, Any]:
    """Actor and critic. The small gain makes the first policy almost uniform, so that it explores."""
    spec = envs.spec
    hidden, activation = [int(width) for width in options.hidden.split(",")], options.activation
    if options.network == "units":
        f = ACTIVATIONS[activation]
        return units_network.actor(envs, hidden, 0.01, f), units_network.critic(envs, hidden, sees_state, f)
    actor = Mlp([spec.obs_size, *hidden, spec.n_actions], spec.n_agents, 0.01, activation)
    seen, of_agents = (spec.state_size, 0) if sees_state else (spec.obs_size, spec.n_agents)
    return actor, Mlp([seen, *hidden, 1], of_agents, 1.0, activation)


def log_probabilities(actor: nn.Module, obs: Tensor, available: Tensor, agents: Tensor) -> Tensor:
    """ln p of all actions; -1e30, and not -inf, of unavailable ones, because 0 * -inf is not a number."""
    logits = actor(obs, agents).masked_fill(~available, -1e30)
    return logits - logits.logsumexp(-1, keepdim=True)  # in a quarter of the time of `log_softmax`


def sampled(log_probs: Tensor) -> Tensor:
    """Draws actions: ln p plus Gumbel noise, -ln(-ln u), is largest at action a with probability p_a."""
    return (log_probs - torch.empty_like(log_probs).exponential_().log()).argmax(-1)


class ReturnNormaliser:
    """Mean and deviation of the returns, moving averages over updates. The critic predicts in these units, so
    its targets have variance 1 whatever the scale of the rewards."""

    def __init__(self) -> None:
        self.mean_sum = self.square_sum = self.weight = 0.0
        self.mean, self.deviation = 0.0, 1.0

    def update(self, returns: Tensor, last: Any) -> None:
        """Changes the critic's last layer too, so that it predicts the same returns in the new units (van
        Hasselt et al., 2016)."""
        old_mean, old_deviation = self.mean, self.deviation
        self.mean_sum = 0.9 * self.mean_sum + 0.1 * returns.mean().item()
        self.square_sum = 0.9 * self.square_sum + 0.1 * returns.square().mean().item()
        self.weight = 0.9 * self.weight + 0.1  # of all updates in the sums
        self.mean = self.mean_sum / self.weight
        self.deviation = max(self.square_sum / self.weight - self.mean**2, 1e-4) ** 0.5
        last.weight.data.mul_(old_deviation / self.deviation)
        last.bias.data.mul_(old_deviation).add_(old_mean - self.mean).div_(self.deviation)


def estimate_advantages(
    reward: Tensor, terminated: Tensor, truncated: Tensor, values: Tensor, options: Options
) -> Tensor:
    """Generalised advantage estimates [T, N, V] (Schulman et al., 2016), from rewards and ends of steps,
    [T, N], and values [T + 1, N, V].

    The error of the critic in step t is r_t + gamma V_{t+1} - V_t. The advantage is the sum of the errors
    from t to the end of the episode, each discounted by gamma lambda per step.

    A battle that ended has no future: V_{t+1} counts as 0. One that the time limit cut off has: V_{t+1} is
    the value of its last state. With next-step autoreset this state is in the next batch, as that of every
    other step, so the end needs no special case. Either way the errors that follow are of another episode.
    """
    goes_on = (~(terminated | truncated)).float().unsqueeze(-1)
    following = values[1:] * (~terminated).float().unsqueeze(-1)
    errors = reward.unsqueeze(-1) + options.gamma * following - values[:-1]
    advantages = torch.empty_like(errors)
    advantage = torch.zeros_like(errors[0])
    for t in reversed(range(len(errors))):
        advantage = errors[t] + options.gamma * options.lambda_ * goes_on[t] * advantage
        advantages[t] = advantage
    return advantages


@dataclass(frozen=True)
class Rows:
    """The data of an update. A sample is one environment in one step; it has A rows of the policy and V of
    the critic, side by side."""

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


def rows_of(samples: Tensor, width: int) -> Tensor:
    """The rows of samples that have `width` rows each."""
    return (samples.unsqueeze(-1) * width + torch.arange(width, device=samples.device)).flatten()


def explained(errors: Tensor, targets: Tensor) -> float:
    """The share of the variance of the targets that predictions with these errors explain."""
    return 1 - (errors.var(correction=0) / targets.var(correction=0)).item()


def parts(rows: Tensor, count: int) -> list[Tensor]:
    """The rows in `count` minibatches, or fewer if there are fewer rows."""
    return [part for part in rows.tensor_split(count) if len(part) > 0]


class Learner:
    """Networks, optimisers and a rollout."""

    def __init__(self, envs: sp.Envs, options: Options) -> None:
        options = with_defaults(options)
        self.envs, self.options, self.device = envs, options, torch.device(options.device)
        self.sees_state = options.algorithm == "mappo"
        n_agents = envs.spec.n_agents
        self.n_values = 1 if self.sees_state else n_agents
        self.actor, self.critic = networks(envs, options, self.sees_state)
        self.team = nn.ModuleDict({"actor": self.actor, "critic": self.critic}).to(self.device)
        self.actor_optimiser = torch.optim.Adam(self.actor.parameters(), eps=options.adam_eps)
        self.critic_optimiser = torch.optim.Adam(self.critic.parameters(), eps=options.adam_eps)
        self.returns = ReturnNormaliser()
        names = ["obs", "state", "avail_actions", "reward", "terminated", "truncated"]
        self.rollout = sp.extras.Rollout(envs, options.horizon, names)
        shape = (options.horizon, options.num_envs, n_agents)
        self.actions = torch.zeros(shape, dtype=torch.int64, device=self.device)
        self.log_probs = torch.zeros(shape, device=self.device)
        self.agents = torch.arange(n_agents, device=self.device)

    def act(self, batch: sp.Batch, t: int | None = None, greedy: bool = False) -> NDArray[np.int32]:
        """Chooses actions [N, A], and stores them as those of step t. Dead agents have only one available."""
        obs = torch.tensor(batch.obs, device=self.device)
        available = torch.tensor(batch.avail_actions, device=self.device)
        with torch.no_grad():
            log_probs = log_probabilities(self.actor, obs, available, self.agents)
        actions = log_probs.argmax(-1) if greedy else sampled(log_probs)
        if t is not None:
            self.actions[t] = actions
            self.log_probs[t] = log_probs.gather(-1, actions.unsqueeze(-1)).squeeze(-1)
        return actions.int().cpu().numpy()

    def collect(
        self, batch: sp.Batch, episodes: deque[tuple[float, bool, int]]
    ) -> tuple[sp.Batch, int, float]:
        """Plays T steps. Returns the last batch, how many episodes ended, and the seconds spent waiting."""
        n_ended, waited = 0, 0.0
        self.rollout[0] = batch
        for t in range(self.options.horizon):
            actions = self.act(batch, t)
            begin = time.perf_counter()
            batch = self.envs.step(actions)
            waited += time.perf_counter() - begin
            self.rollout[t + 1] = batch
            ended = batch.terminated | batch.truncated
            columns = (batch.episode_return, batch.battle_won, batch.episode_length)
            episodes.extend(zip(*(column[ended].tolist() for column in columns), strict=True))
            n_ended += int(ended.sum())
        return batch, n_ended, waited

    def learn(self, progress: float) -> dict[str, float]:
        """Improves the networks with the rollout, after this share of the run. Returns values for the log,
        means over the gradient steps."""
        options = self.options
        lr_factor = 1 + (options.lr_end - 1) * progress
        entropy_weight = options.entropy + (options.entropy_end - options.entropy) * progress
        self.actor_optimiser.param_groups[0]["lr"] = options.actor_lr * lr_factor
        self.critic_optimiser.param_groups[0]["lr"] = options.critic_lr * lr_factor
        data = self.rows()
        stats: dict[str, list[Tensor]] = defaultdict(list)
        for _ in range(options.epochs):
            # Samples are shuffled and not rows, because the rows of one lie side by side in memory.
            samples = data.samples[torch.randperm(len(data.samples), device=self.device)]
            policy_rows = rows_of(samples, self.envs.spec.n_agents)
            policy_rows = policy_rows[data.has_choice[policy_rows]]
            for rows in parts(policy_rows, options.minibatches):
                self.improve_actor(data, rows, entropy_weight, stats)
            for rows in parts(rows_of(samples, self.n_values), options.minibatches):
                self.improve_critic(data, rows, stats)
        names = ["policy_loss", "value_loss", "entropy", "kl", "clip_fraction"]
        names += ["actor_grad_norm", "critic_grad_norm"]
        row = {"policy_rows": len(policy_rows) / len(data.obs)}
        row |= {name: torch.stack(stats[name]).mean().item() if stats[name] else math.nan for name in names}
        row |= {"explained_variance": data.explained_variance}
        return row | {"actor_lr": options.actor_lr * lr_factor, "entropy_weight": entropy_weight}

    def rows(self) -> Rows:
        """Estimates advantages and targets, and brings the rollout into the form of rows."""
        data = {name: torch.from_numpy(array).to(self.device) for name, array in self.rollout.arrays.items()}
        critic_inputs = data["state"].unsqueeze(2) if self.sees_state else data["obs"]  # [T + 1, N, V, size]
        with torch.no_grad():
            values = self.critic(critic_inputs, self.agents).squeeze(-1)  # [T + 1, N, V]
        values = values * self.returns.deviation + self.returns.mean
        reward, terminated, truncated = (data[name][1:] for name in ("reward", "terminated", "truncated"))
        advantages = estimate_advantages(reward, terminated, truncated, values, self.options)
        targets = advantages + values[:-1]

        # Nothing is learnt from a step that only reset its environment: its action was ignored. The policy
        # learns nothing from agents with one available action either, which dead ones have too. This drops a
        # third to two thirds of its rows.
        is_learnt = ~data["was_reset"][1:]  # [T, N]
        has_choice = data["avail_actions"][:-1].sum(-1) > 1  # [T, N, A]

        learnt_errors, learnt_targets = advantages[is_learnt], targets[is_learnt]
        if len(learnt_targets) > 0:  # in a short rollout, every environment may only have been reset
            self.returns.update(learnt_targets, self.critic.head)
        old_values = (values[:-1] - self.returns.mean) / self.returns.deviation
        targets = (targets - self.returns.mean) / self.returns.deviation
        # If there is one value per environment, the agents share its advantage.
        advantages = advantages.expand(-1, -1, self.envs.spec.n_agents)
        learnt = advantages[has_choice & is_learnt.unsqueeze(-1)]
        spread = learnt.std().item() if len(learnt) > 1 else 0.0
        scale = max(spread, self.options.advantage_floor * self.returns.deviation) + 1e-8
        return Rows(
            obs=data["obs"][:-1].flatten(0, 2),
            available=data["avail_actions"][:-1].flatten(0, 2),
            has_choice=has_choice.flatten(),
            actions=self.actions.flatten(),
            log_probs=self.log_probs.flatten(),
            advantages=((advantages - learnt.mean()) / scale).flatten(),
            critic_inputs=critic_inputs[:-1].flatten(0, 2),
            old_values=old_values.flatten(),
            targets=targets.flatten(),
            samples=is_learnt.flatten().nonzero().squeeze(-1),
            explained_variance=explained(learnt_errors, learnt_targets),
        )

    def improve_actor(
        self, data: Rows, rows: Tensor, entropy_weight: float, stats: dict[str, list[Tensor]]
    ) -> None:
        """A step up the smaller one of two objectives: the advantage times the ratio of the action's new
        probability to its old one, and the same with the ratio clipped to about 1. So nothing is gained by
        leaving the clip range, but returning to it is."""
        # `index_select(0, rows)` takes a fifth of the time of `[rows]`.
        obs, available = data.obs.index_select(0, rows), data.available.index_select(0, rows)
        log_probs = log_probabilities(self.actor, obs, available, rows % self.envs.spec.n_agents)
        log_prob = log_probs.gather(-1, data.actions[rows].unsqueeze(-1)).squeeze(-1)
        log_ratio = log_prob - data.log_probs[rows]
        ratio, advantage, clip = log_ratio.exp(), data.advantages[rows], self.options.clip
        loss = -torch.minimum(ratio * advantage, ratio.clamp(1 - clip, 1 + clip) * advantage).mean()
        entropy = -(log_probs.exp() * log_probs).sum(-1).mean()
        stats["actor_grad_norm"].append(self.step(self.actor_optimiser, loss - entropy_weight * entropy))
        stats["policy_loss"].append(loss.detach())
        stats["entropy"].append(entropy.detach())
        stats["kl"].append((ratio - 1 - log_ratio).mean().detach())
        stats["clip_fraction"].append(((ratio - 1).abs() > clip).float().mean())

    def improve_critic(self, data: Rows, rows: Tensor, stats: dict[str, list[Tensor]]) -> None:
        """A step down the larger one of two losses: of the value, and of the value clipped to its old one."""
        inputs = data.critic_inputs.index_select(0, rows)
        value = self.critic(inputs, rows % self.n_values).squeeze(-1)
        old, target, clip = data.old_values[rows], data.targets[rows], self.options.value_clip
        clipped = old + (value - old).clamp(-clip, clip)
        loss_of = nn.HuberLoss(reduction="none", delta=self.options.huber)
        loss = torch.maximum(loss_of(value, target), loss_of(clipped, target)).mean()
        stats["critic_grad_norm"].append(self.step(self.critic_optimiser, loss))
        stats["value_loss"].append(loss.detach())

    def step(self, optimiser: torch.optim.Optimizer, loss: Tensor) -> Tensor:
        """Makes a gradient step. Returns the length of the gradient before it was clipped."""
        optimiser.zero_grad()
        loss.backward()
        parameters, longest = optimiser.param_groups[0]["params"], self.options.max_grad_norm
        norm = nn.utils.clip_grad_norm_(parameters, longest, error_if_nonfinite=True)
        optimiser.step()
        return norm


def with_defaults(options: Options) -> Options:
    """With a value for every option whose default depends on the scenario or on the network."""
    scenario = sp.scenario(options.scenario)
    are_drawn, n_agents = scenario["teams_are_drawn"], len(scenario["allies"])
    if options.algorithm == "by team":
        state = n_agents >= STATE_CRITIC_AGENTS or are_drawn
        options = replace(options, algorithm="mappo" if state else "ippo")
    if options.network == "by scenario":
        options = replace(options, network="units" if units_network.has_units(scenario) else "flat")
    if options.hidden == "by network":
        options = replace(options, hidden=HIDDEN[options.network])
    if options.last_actions < 0:
        options = replace(options, last_actions=0 if are_drawn else LAST_ACTIONS)
    if options.entropy < 0:
        options = replace(options, entropy=TEAM_ENTROPY / n_agents)
    if options.actor_lr < 0:
        options = replace(options, actor_lr=ACTOR_LR[options.network])
    return options


def make(options: Options, num_envs: int) -> sp.Envs:
    own_actions, threads = with_defaults(options).last_actions, options.threads or None
    limit = limit_of(options.scenario)
    return sp.make(
        options.scenario, num_envs, threads=threads, obs_last_actions=own_actions, episode_limit=limit
    )


def limit_of(scenario: str) -> int:
    """That of the scenario, or 1000 if it has none: episodes must end."""
    return sp.scenario(scenario)["episode_limit"] or 1000


def train(options: Options, make_envs: Callable[[Options, int], Any] = make) -> Learner:
    """Trains a team, and writes log and weights to its folder."""
    options = with_defaults(options)
    torch.manual_seed(options.seed)
    torch.set_num_threads(options.torch_threads)
    episodes: deque[tuple[float, bool, int]] = deque(maxlen=200)  # return, won and length
    update = steps = n_episodes = 0
    with make_envs(options, options.num_envs) as envs:
        learner = Learner(envs, options)
        folder = folder_of(options)
        write_options(folder, options, sides=envs.spec.sides)
        log = Log(folder)
        evaluations = evaluations_of(learner, folder, log.clock)
        batch = envs.reset(seed=1_000_000 * (options.seed + 1))  # the evaluation has other seeds
        while steps < options.steps:
            evaluations.play_due(steps, update)
            begin = time.perf_counter()
            batch, n_ended, waited = learner.collect(batch, episodes)
            learn_begin = time.perf_counter()
            stats = learner.learn(steps / options.steps)
            elapsed, learnt = time.perf_counter() - begin, time.perf_counter() - learn_begin
            new_steps = int((~learner.rollout.was_reset[1:]).sum())
            update, steps, n_episodes = update + 1, steps + new_steps, n_episodes + n_ended
            row = {"update": update, "steps": steps, "episodes": n_episodes, **recent(episodes), **stats}
            speed = {"steps_per_s": new_steps / elapsed, "wait_share": waited / elapsed}
            log.write(row, speed | {"learn_share": learnt / elapsed})
    evaluations.finish(steps, update)
    save_file(learner.team.state_dict(), folder / "weights.safetensors")
    return learner


def folder_of(options: Options) -> Path:
    """That of the run with these options."""
    name = f"{Path(options.scenario).stem}-{with_defaults(options).algorithm}-{options.seed}"
    return Path(options.out) / name


def evaluations_of(learner: Learner, folder: Path, clock: Clock) -> Evaluations:
    """Against the script, also if the team trains against itself."""

    def policy(envs: sp.Envs, greedy: bool) -> Callable[[sp.Batch], NDArray[np.int32]]:
        return partial(learner.act, greedy=greedy)

    options = learner.options
    return Evaluations(folder, options, learner.team, partial(make, options), policy, clock)


def evaluate(learner: Learner, options: Options) -> sp.Evaluation:
    with make(options, min(options.evaluate_episodes, 64)) as envs:
        return sp.evaluate(
            envs, partial(learner.act, greedy=options.greedy), options.evaluate_episodes, seed=0
        )


def parse_options(description: str | None) -> tuple[Options, int]:
    """The options of the first run, and how many runs there are."""
    parser = parser_of(Options, description, "a standard scenario or a file")
    several = "train that many runs, one after the other, with seeds from --seed on (default: 1)"
    parser.add_argument("--seeds", type=int, default=1, help=several)
    given = parsed(parser, Options)
    seeds = given.pop("seeds")
    most = int(SEED[1]) + 1 - given["seed"]
    if not 1 <= seeds <= most:
        parser.error(f"--seeds must be between 1 and {most:,} with --seed {given['seed']}, got {seeds}")
    return Options(**given), seeds


def main(description: str | None = __doc__, make_envs: Callable[[Options, int], Any] = make) -> None:
    first, seeds = parse_options(description)
    runs = [replace(first, seed=seed) for seed in range(first.seed, first.seed + seeds)]
    with one_line_errors("ppo"):
        # Before the first begins, which may take hours.
        for folder in filter(Path.exists, map(folder_of, runs)):
            raise FileExistsError(errno.EEXIST, "exists", str(folder))
        for options in runs:
            if seeds > 1:
                print(f"seed {options.seed}", flush=True)
            learner = train(options, make_envs)
            if options.evaluate_episodes > 0:
                result = evaluate(learner, options)
                print(
                    f"{len(result)} episodes, {'greedy' if options.greedy else 'sampled'}: won "
                    f"{result.win_rate:.1%}, return {result.mean_return:.2f}, {result.mean_length:.1f} steps"
                )


if __name__ == "__main__":
    main()
