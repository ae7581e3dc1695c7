"""Value decomposition in one file: QMIX, VDN or IQL (`--algorithm`) of a team with recurrent agents.

    python -m smaclite_pool.examples.value_decomposition 2s3z --steps 500000 --seed 1

For each agent, a network that all agents share computes a value Q(history, action) of each of its actions. It
is recurrent, so that an agent remembers what it saw and did. The agents take the action of the largest value
or, with a probability that falls during training, a random one. Q-learning makes the value of an action that
was taken more like the reward plus the value that follows:

- IQL (Tan, 1993): for each agent on its own, with the reward of the team.
- VDN (Sunehag et al., 2018): for the team, whose value is the sum of the agents' values.
- QMIX (Rashid et al., 2018): for the team, whose value is a function of the agents' values and the state that
  does not fall when the value of an agent rises. So each agent's best action is part of the team's best.

Whole episodes are kept, and learnt from more than once, which PPO (ppo.py) cannot do. Log and evaluation are
as in ppo.py. This file is to be read and changed: from top to bottom, options, networks (`--network units`
needs units_network.py), memory of episodes, the learner, the player, log, and the loop around them. The same
seed gives the same log on a CPU.

Axes of arrays: T steps of an episode, B episodes, N environments, A agents.
"""

from __future__ import annotations

import copy
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import smaclite_pool as sp
from numpy.typing import NDArray
from smaclite_pool.examples import units_network
from smaclite_pool.examples.evaluations import Clock, Evaluations, Log, recent
from smaclite_pool.examples.options import (
    COUNT,
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


@dataclass(frozen=True)
class Options:
    """Each of these, except the scenario, is an option of the command line, as `--num-envs 64`."""

    scenario: str = "2s3z"
    algorithm: str = option("qmix", "iql, vdn or qmix", ["iql", "vdn", "qmix"])
    steps: int = option(1_000_000, "environment steps of the run", within=STEPS)
    seed: int = option(0, "of weights, environments, actions and samples of episodes", within=SEED)
    out: str = option("runs", "folder in which the folder of the run is created")
    device: str = option("cpu", "where the networks are: cpu or cuda")
    # Matrices are small here. With more threads, each product ends with threads that wait for the slowest one
    # in a busy loop, and on a machine with other work that multiplies the time.
    torch_threads: int = option(1, "threads of PyTorch", within=(1, 1024))
    threads: int = option(0, "threads of the pool; 0: as many as there are cores", within=(0, 1024))
    num_envs: int = option(64, "number of environments", within=(1, 65_536))
    capacity: int = option(2000, "episodes that are kept", within=COUNT)
    batch: int = option(32, "episodes per gradient step", within=COUNT)
    # Gradient steps are most of the cost: a smaller number needs fewer environment steps, and more time.
    episodes_per_update: int = option(4, "finished episodes per gradient step", within=COUNT)
    network: str = option(
        "flat", "flat, or over units: the same for all enemies and all allies", ["flat", "units"]
    )
    hidden: int = option(64, "width of the agents' network", within=(2, 4096))
    embedding: int = option(32, "width of the embeddings of units, with --network units", within=(2, 4096))
    mixer_width: int = option(32, "width of QMIX's function", within=(1, 4096))
    lr: float = option(1e-3, "step size", within=SMALL)
    gamma: float = option(0.99, "discount per step", within=SHARE)
    lambda_: float = option(
        0.6, "weight of the rewards that followed, against estimates of them", within=SHARE
    )
    epsilon_end: float = option(
        0.05, "probability of a random action at the end; 1 at the beginning", within=SHARE
    )
    epsilon_steps: int = option(0, "steps in which it falls linearly; 0: half of all", within=(0, 2**48))
    log_interval: int = option(10, "gradient steps per row of the log", within=COUNT)
    target_interval: int = option(
        50, "gradient steps after which the target networks are replaced", within=COUNT
    )
    max_grad_norm: float = option(10.0, "longest gradient", within=(1e-12, 1e6))
    evaluate_every: int = option(
        0, "evaluate every so many steps, and keep the best weights; 0: never", within=(0, 2**48)
    )
    evaluate_episodes: int = option(
        200, "episodes of the evaluation, without random actions; 0: none", within=(0, 1_000_000)
    )


class AgentNetwork(nn.Module):
    """Values of the actions of an agent, from all that it has seen in the episode."""

    def __init__(self, envs: sp.Envs, hidden: int) -> None:
        super().__init__()
        self.first = nn.Linear(envs.spec.obs_size, hidden)
        self.memory = nn.GRU(hidden, hidden)
        self.values = nn.Linear(hidden, envs.spec.n_actions)

    def forward(self, obs: Tensor, memory: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Of obs [T, B, A, size]: values [T, B, A, n_actions], and the memory after the last step, [1, B * A,
        hidden]. Without a memory before the first step, episodes begin."""
        x, memory = self.memory(torch.relu(self.first(obs)).flatten(1, 2), memory)
        return self.values(x).unflatten(1, obs.shape[1:3]), memory


class UnitsAgentNetwork(nn.Module):
    """The same with a network over units. The GRU stands behind its trunk."""

    def __init__(self, envs: sp.Envs, hidden: int, embedding: int) -> None:
        super().__init__()
        self.units = units_network.actor(envs, [embedding, hidden], 1.0, torch.relu)
        self.memory = nn.GRU(hidden, hidden)

    def forward(self, obs: Tensor, memory: Tensor | None = None) -> tuple[Tensor, Tensor]:
        inputs, agents = obs.flatten(0, 2), torch.arange(obs.shape[2], device=obs.device)
        trunk, seen = self.units.read(inputs)
        trunk, memory = self.memory(trunk.unflatten(0, (len(obs), -1)), memory)
        values = self.units.outputs(inputs, agents.expand(obs.shape[:3]).flatten(), trunk.flatten(0, 1), seen)
        return values.unflatten(0, obs.shape[:3]), memory


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
        spec = envs.spec
        super().__init__()
        self.weight_1 = nn.Linear(spec.state_size, spec.n_agents * width)
        self.bias_1 = nn.Linear(spec.state_size, width)
        self.weight_2 = nn.Linear(spec.state_size, width)
        self.bias_2 = nn.Sequential(nn.Linear(spec.state_size, width), nn.ReLU(), nn.Linear(width, 1))

    def forward(self, values: Tensor, state: Tensor) -> Tensor:
        """Of values [T, B, A] and state [T, B, size]: [T, B, 1]."""
        weight_1 = self.weight_1(state).abs().unflatten(-1, (values.shape[-1], -1))  # [T, B, A, width]
        hidden = F.elu((values.unsqueeze(-1) * weight_1).sum(-2) + self.bias_1(state))
        return (hidden * self.weight_2(state).abs()).sum(-1, keepdim=True) + self.bias_2(state)


class Replay:
    """Whole episodes. Row t of an episode has what the agents saw after t steps and what they then did, and
    the reward and the end that this led to.

    Environments write their current episodes in place. When one ends, its environment goes on in the place of
    the oldest episode, if none is free. Memory that no step reached costs nothing.
    """

    def __init__(self, envs: sp.Envs, capacity: int, seed: int) -> None:
        spec = envs.spec
        n_agents, n_actions = spec.n_agents, spec.n_actions
        limit = spec.episode_limit
        if limit is None:
            raise SystemExit("value_decomposition: the scenario has no episode limit; it needs one")
        axes = (capacity + spec.num_envs, limit + 1)
        self.obs = np.zeros((*axes, n_agents, spec.obs_size), np.float32)
        self.state = np.zeros((*axes, spec.state_size), np.float32)
        self.available = np.zeros((*axes, n_agents, n_actions), np.bool_)
        self.actions = np.zeros((*axes, n_agents), np.int64)
        self.reward = np.zeros(axes, np.float32)
        self.terminated = np.zeros(axes, np.bool_)
        self.lengths = np.zeros(len(self.obs), np.int64)
        self.complete: deque[int] = deque(maxlen=capacity)  # places, the oldest episode first
        self.places = np.arange(spec.num_envs)  # of the current episodes
        self.free = list(range(spec.num_envs, len(self.obs)))
        self.random = np.random.default_rng(seed)

    def store(self, before: sp.Batch, actions: NDArray[np.int32], after: sp.Batch) -> None:
        """Stores a step of all environments. The lane is synchronous, so slot i is environment i."""
        stepped = ~after.was_reset  # actions of the others were ignored
        at = self.places[stepped], before.episode_length[stepped]
        self.obs[at], self.state[at] = before.obs[stepped], before.state[stepped]
        self.available[at], self.actions[at] = before.avail_actions[stepped], actions[stepped]
        self.reward[at], self.terminated[at] = after.reward[stepped], after.terminated[stepped]
        for i in np.flatnonzero(after.terminated | after.truncated):
            place, length = int(self.places[i]), after.episode_length[i]
            self.obs[place, length], self.state[place, length] = after.obs[i], after.state[i]
            self.available[place, length] = after.avail_actions[i]
            self.lengths[place] = length
            if not self.free:
                self.free.append(self.complete.popleft())
            self.complete.append(place)
            self.places[i] = self.free.pop()

    def sample(self, n: int) -> dict[str, Tensor]:
        """n episodes up to the end of the longest: tensors [T, n, ...]; of what is seen, [T + 1, n, ...]."""
        places = self.random.choice(np.array(self.complete), n, replace=False)
        steps = int(self.lengths[places].max())
        names = ["obs", "state", "available", "actions", "reward", "terminated"]
        arrays = {name: getattr(self, name)[places, : steps + 1].swapaxes(0, 1) for name in names}
        sampled = {name: torch.from_numpy(array).contiguous() for name, array in arrays.items()}
        for name in ("actions", "reward", "terminated"):
            sampled[name] = sampled[name][:-1]
        return sampled | {"lengths": torch.from_numpy(self.lengths[places])}


class Learner:
    """Networks, older copies of them, the optimiser and the episodes."""

    def __init__(self, envs: sp.Envs, options: Options) -> None:
        self.options, self.device = options, torch.device(options.device)
        self.agent: Any = (
            UnitsAgentNetwork(envs, options.hidden, options.embedding)
            if options.network == "units"
            else AgentNetwork(envs, options.hidden)
        )
        self.mixer: nn.Module = EachMixer() if options.algorithm == "iql" else SumMixer()
        if options.algorithm == "qmix":
            self.mixer = QmixMixer(envs, options.mixer_width)
        self.team = nn.ModuleDict({"agent": self.agent, "mixer": self.mixer}).to(self.device)
        # Copies that change rarely estimate the values that follow. Otherwise each gradient step would move
        # its own targets.
        self.target = copy.deepcopy(self.team)
        self.optimiser = torch.optim.Adam(self.team.parameters(), lr=options.lr)
        self.replay = Replay(envs, options.capacity, options.seed)
        self.updates = 0

    def learn(self) -> dict[str, float]:
        """A gradient step on a sample of episodes. Returns values for the log."""
        options = self.options
        data = {name: tensor.to(self.device) for name, tensor in self.replay.sample(options.batch).items()}
        values, _ = self.agent(data["obs"])  # [T + 1, B, A, n_actions]
        chosen = values[:-1].gather(-1, data["actions"].unsqueeze(-1)).squeeze(-1)  # [T, B, A]
        total = self.mixer(chosen, data["state"][:-1])  # [T, B, 1], of IQL [T, B, A]
        with torch.no_grad():
            # Double Q-learning (van Hasselt et al., 2016): the networks choose the best actions, and the
            # copies value them. The largest one of several noisy values would be too large on average.
            best = values.masked_fill(~data["available"], -torch.inf).argmax(-1, keepdim=True)
            target_values, _ = self.target["agent"](data["obs"])
            following = target_values.gather(-1, best).squeeze(-1)  # [T + 1, B, A]
            targets = self.targets(data, self.target["mixer"](following, data["state"]))
        steps = torch.arange(len(total), device=self.device)
        is_step = steps.unsqueeze(-1) < data["lengths"]  # [T, B]: not behind the end of its episode
        loss = (total - targets)[is_step].square().mean()
        self.optimiser.zero_grad()
        loss.backward()
        parameters, longest = self.team.parameters(), options.max_grad_norm
        norm = nn.utils.clip_grad_norm_(parameters, longest, error_if_nonfinite=True)
        self.optimiser.step()
        self.updates += 1
        if self.updates % options.target_interval == 0:
            self.target.load_state_dict(self.team.state_dict())
        mean_value = total.detach()[is_step].mean()
        return {"loss": loss.item(), "mean_value": mean_value.item(), "grad_norm": norm.item()}

    def targets(self, data: dict[str, Tensor], values: Tensor) -> Tensor:
        """What the values should have been, [T, B, 1 or A], given those of the best actions, which have one
        more step.

        With lambda = 0, the target of step t is its reward plus gamma times the value of step t + 1. With
        lambda = 1, it is the discounted sum of the rewards that followed. In between, the value of step t + 1
        is mixed with the target of step t + 1 (Peng and Williams, 1994). Then rewards reach earlier steps in
        fewer updates, though some of the actions that led to them were random.

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

    def __init__(self, envs: sp.Envs, learner: Learner) -> None:
        self.envs, self.network, self.device = envs, learner.agent, learner.device
        rows, hidden = envs.spec.num_envs * envs.spec.n_agents, learner.options.hidden
        self.memory = torch.zeros(1, rows, hidden, device=self.device)

    def act(self, batch: sp.Batch, epsilon: float) -> NDArray[np.int32]:
        """[N, A]: the best available actions, and random ones with a probability of epsilon."""
        is_first = torch.tensor(batch.was_reset, device=self.device)
        self.memory[:, is_first.repeat_interleave(self.envs.spec.n_agents)] = 0.0
        obs = torch.tensor(batch.obs, device=self.device).unsqueeze(0)
        with torch.no_grad():
            values, self.memory = self.network(obs, self.memory)
        values = values[0].masked_fill(~torch.tensor(batch.avail_actions, device=self.device), -torch.inf)
        actions = values.argmax(-1)
        if epsilon > 0:
            random = torch.from_numpy(self.envs.sample_actions()).to(self.device)
            actions = torch.where(torch.rand_like(values[..., 0]) < epsilon, random, actions)
        return actions.int().cpu().numpy()


def make(options: Options, num_envs: int) -> sp.Envs:
    """Agents see their own last action too, so that their history has what they did, and their own number, so
    that they can differ."""
    threads = options.threads or None
    return sp.make(options.scenario, num_envs, threads=threads, obs_last_actions=1, obs_agent_id=True)


def train(options: Options) -> Learner:
    """Trains a team, and writes log and weights to its folder."""
    torch.manual_seed(options.seed)
    torch.set_num_threads(options.torch_threads)
    episodes: deque[tuple[float, bool, int]] = deque(maxlen=200)  # return, won and length
    steps = n_episodes = 0
    with make(options, options.num_envs) as envs:
        learner = Learner(envs, options)
        folder = Path(options.out) / f"{Path(options.scenario).stem}-{options.algorithm}-{options.seed}"
        write_options(folder, options)
        log = Log(folder)
        player, evaluations = Player(envs, learner), evaluations_of(learner, folder, log.clock)
        envs.seed_sampler(options.seed)
        batch = envs.reset(seed=1_000_000 * (options.seed + 1))  # the evaluation has other seeds
        begin, waited, learnt, begin_steps = time.perf_counter(), 0.0, 0.0, 0  # since the last row of the log
        epsilon_steps = options.epsilon_steps or options.steps / 2
        while steps < options.steps:
            evaluations.play_due(steps, learner.updates)
            epsilon = 1 + (options.epsilon_end - 1) * min(steps / epsilon_steps, 1.0)
            actions = player.act(batch, epsilon)
            step_begin = time.perf_counter()
            before, batch = batch, envs.step(actions)
            waited += time.perf_counter() - step_begin
            learner.replay.store(before, actions, batch)
            steps += int((~batch.was_reset).sum())
            ended = batch.terminated | batch.truncated
            columns = (batch.episode_return, batch.battle_won, batch.episode_length)
            episodes.extend(zip(*(column[ended].tolist() for column in columns), strict=True))
            n_episodes += int(ended.sum())
            while learner.updates < (n_episodes - options.batch) // options.episodes_per_update:
                learn_begin = time.perf_counter()
                stats = learner.learn()
                end = time.perf_counter()
                learnt += end - learn_begin
                if learner.updates % options.log_interval == 0:
                    row = {"update": learner.updates, "steps": steps, "episodes": n_episodes}
                    speed = {"steps_per_s": (steps - begin_steps) / (end - begin)}
                    speed |= {"wait_share": waited / (end - begin), "learn_share": learnt / (end - begin)}
                    log.write(row | recent(episodes) | stats | {"epsilon": epsilon}, speed)
                    begin, waited, learnt, begin_steps = end, 0.0, 0.0, steps
    if learner.updates == 0:
        needed = options.batch + options.episodes_per_update
        print(f"nothing was learnt: the first gradient step needs {needed} episodes, and {n_episodes} ended")
    evaluations.finish(steps, learner.updates)
    save_file(learner.team.state_dict(), folder / "weights.safetensors")
    return learner


def evaluations_of(learner: Learner, folder: Path, clock: Clock) -> Evaluations:
    """Greedy actions are those without random ones; sampled ones explore as at the end of the training."""
    options = learner.options

    def policy(envs: sp.Envs, greedy: bool) -> Callable[[sp.Batch], NDArray[np.int32]]:
        return partial(Player(envs, learner).act, epsilon=0.0 if greedy else options.epsilon_end)

    return Evaluations(folder, options, learner.team, partial(make, options), policy, clock)


def evaluate(learner: Learner, options: Options) -> sp.Evaluation:
    """Plays without random actions."""
    with make(options, min(options.evaluate_episodes, 64)) as envs:
        player = Player(envs, learner)
        return sp.evaluate(envs, partial(player.act, epsilon=0.0), options.evaluate_episodes, seed=0)


def main() -> None:
    parser = parser_of(Options, __doc__, "a standard scenario or a file")
    options = Options(**parsed(parser, Options))
    if options.capacity < options.batch:
        parser.error(f"--capacity must be at least --batch, {options.batch}, got {options.capacity}")
    with one_line_errors("value_decomposition"):
        learner = train(options)
        if options.evaluate_episodes > 0:
            result = evaluate(learner, options)
            print(
                f"{len(result)} episodes: won {result.win_rate:.1%}, return {result.mean_return:.2f}, "
                f"{result.mean_length:.1f} steps"
            )


if __name__ == "__main__":
    main()
