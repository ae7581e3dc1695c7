"""Behaviour cloning in one file: a team learns to choose the actions that a dataset has.

    smaclite-pool dataset record focus_fire --scenario 3m --steps 100000 --out 3m.smdata
    python -m smaclite_pool.examples.behaviour_cloning 3m.smdata

The simplest method of offline learning, and the one that every other should beat: the actions of a dataset
are the labels of its observations, and a network is trained to classify them. Rewards are not used, and no
battle is played before the evaluation.

All agents share one policy, that of `smaclite_pool.examples.ppo`, which sees an agent's own observation, its
last actions and its number. A tenth of the episodes is set aside: if the loss on them rises while that of the
others falls, the policy learns them by heart. The evaluation plays by the rules of the dataset.

Axes of arrays: T steps of all episodes, A agents, R rows, one per agent and step in which it had a choice.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import smaclite_pool as sp
from numpy.typing import NDArray
from smaclite_pool.examples.options import COUNT, SMALL, extra, one_line_errors, option, parsed, parser_of
from smaclite_pool.examples.ppo import Mlp, log_probabilities, sampled

with extra("torch"):
    import torch
    from safetensors.torch import save_file
    from torch import Tensor
    from torch.nn import functional as F


@dataclass(frozen=True)
class Options:
    """Each of these, except the dataset, is an option of the command line, as `--batch-size 1024`."""

    dataset: str = ""
    map_file: str = option("", "the scenario file, if the dataset is not of a standard scenario")
    out: str = option("", "file for the weights, such as clone.safetensors; empty: none is written")
    seed: int = option(0, "of weights, batches, and the actions of the evaluation", within=(0, 2**63 - 1))
    device: str = option("cpu", "where the network is: cpu or cuda")
    torch_threads: int = option(
        1, "threads of PyTorch, which for matrices so small are best few", within=(1, 1024)
    )
    last_actions: int = option(4, "how many of its own last actions an agent observes", within=(0, 16))
    epochs: int = option(5, "passes over the data", within=COUNT)
    batch_size: int = option(512, "rows of a gradient step", within=COUNT)
    held_out: float = option(
        0.1, "share of the episodes that is not learnt from, but measured on", within=(0.0, 0.99)
    )
    hidden: str = option("64,64", "widths of the hidden layers", numbers=True)
    lr: float = option(1e-3, "step size at the beginning, falling linearly to 0", within=SMALL)
    evaluate_episodes: int = option(200, "episodes of the evaluation", within=COUNT)
    greedy: bool = option(False, "evaluate the most probable actions, not sampled ones")


@dataclass(frozen=True)
class Rows:
    """Observations with the actions that were chosen. Dead agents have no choice, and no rows."""

    obs: Tensor
    available: Tensor
    agents: Tensor
    actions: Tensor

    def __len__(self) -> int:
        return len(self.actions)

    def __getitem__(self, rows: Tensor) -> Rows:
        return Rows(self.obs[rows], self.available[rows], self.agents[rows], self.actions[rows])


def rows_of(
    dataset: sp.Dataset, arrays: dict[str, NDArray[Any]], steps: NDArray[np.bool_], options: Options
) -> Rows:
    """The rows of some steps, bool [T]."""
    has_choice = arrays["avail_actions"].sum(-1) > 1  # [T, A]
    step, agent = np.nonzero(has_choice & steps[:, None])  # [R] each
    past = last_actions(dataset, arrays["actions"], step, agent, options.last_actions)
    obs = np.concatenate([arrays["obs"][step, agent], past], axis=1)
    columns = (obs, arrays["avail_actions"][step, agent], agent, arrays["actions"][step, agent])
    obs_, available, agents, actions = (torch.from_numpy(column).to(options.device) for column in columns)
    return Rows(obs_, available, agents, actions.long())


def last_actions(
    dataset: sp.Dataset,
    actions: NDArray[np.int32],
    step: NDArray[np.int64],
    agent: NDArray[np.int64],
    n: int,
) -> NDArray[np.float32]:
    """The n last actions of agents before steps, one-hot, the newest first, as lanes with `obs_last_actions`
    have them: zeros before the episode. Without them, the clone of a team that saw its own last actions has
    to guess what the team knew."""
    n_actions = dataset.card["sizes"]["n_actions"]
    episodes = dataset.episodes
    begin = np.repeat(episodes["start"], episodes["length"])[step]
    one_hot = np.zeros((len(step), n, n_actions), np.float32)
    for i in range(n):
        [rows] = np.nonzero(step - 1 - i >= begin)
        one_hot[rows, i, actions[step[rows] - 1 - i, agent[rows]]] = 1
    return one_hot.reshape(len(step), n * n_actions)


def split(dataset: sp.Dataset, held_out: float, seed: int) -> NDArray[np.bool_]:
    """The steps of the episodes that are learnt from, bool [T]. Whole episodes, as steps of one are alike."""
    lengths = dataset.episodes["length"]
    is_learnt = np.random.default_rng(seed).permutation(len(lengths)) >= held_out * len(lengths)
    return np.repeat(is_learnt, lengths)


def loss_of(policy: Mlp, rows: Rows) -> tuple[Tensor, Tensor]:
    """The mean of -ln p of the actions, and the share of rows whose action is the most probable one."""
    log_probs = log_probabilities(policy, rows.obs, rows.available, rows.agents)
    accuracy = (log_probs.argmax(-1) == rows.actions).float().mean()
    return F.nll_loss(log_probs, rows.actions), accuracy


def measure(policy: Mlp, rows: Rows) -> tuple[float, float]:
    """Loss and accuracy on all rows; not a number if there are none."""
    with torch.no_grad():
        loss, accuracy = loss_of(policy, rows)
    return loss.item(), accuracy.item()


def learn(policy: Mlp, learnt: Rows, held_out: Rows, options: Options) -> None:
    """Improves the policy, and prints a line per epoch."""
    optimiser = torch.optim.Adam(policy.parameters(), lr=options.lr)
    steps = options.epochs * -(-len(learnt) // options.batch_size)
    schedule = torch.optim.lr_scheduler.LinearLR(optimiser, 1.0, 0.0, steps)
    for epoch in range(options.epochs):
        losses = []
        for rows in torch.randperm(len(learnt), device=options.device).split(options.batch_size):
            loss, _ = loss_of(policy, learnt[rows])
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()
            losses.append(loss.detach())
        held_out_loss, accuracy = measure(policy, held_out)
        print(
            f"epoch {epoch + 1} of {options.epochs}: loss {torch.stack(losses).mean().item():.3f}, "
            f"of episodes held out {held_out_loss:.3f}, {accuracy:.1%} of their actions",
            flush=True,
        )


def act(policy: Mlp, batch: sp.Batch, options: Options) -> NDArray[np.int32]:
    """Chooses actions [N, A] for N environments."""
    obs = torch.tensor(batch.obs, device=options.device)
    available = torch.tensor(batch.avail_actions, device=options.device)
    agents = torch.arange(obs.shape[1], device=options.device)
    with torch.no_grad():
        log_probs = log_probabilities(policy, obs, available, agents)
    actions = log_probs.argmax(-1) if options.greedy else sampled(log_probs)
    return actions.int().cpu().numpy()


def clone(options: Options) -> tuple[Mlp, sp.Dataset]:
    """Learns from the dataset."""
    torch.manual_seed(options.seed)
    torch.set_num_threads(options.torch_threads)
    dataset = sp.Dataset(options.dataset)
    scenario_of(dataset, options)  # before the work: without it, the clone cannot be evaluated
    arrays = dataset.expand(fields=["obs", "avail_actions", "actions"])
    steps = split(dataset, options.held_out, options.seed)
    learnt, held_out = (rows_of(dataset, arrays, chosen, options) for chosen in (steps, ~steps))
    sizes = dataset.card["sizes"]
    widths = [learnt.obs.shape[1], *map(int, options.hidden.split(",")), sizes["n_actions"]]
    policy = Mlp(widths, sizes["n_agents"], 0.01, "relu").to(options.device)
    if len(learnt) == 0:
        raise sp.errors.InvalidRequest(
            f"no step is left to learn from: of {len(dataset.episodes['length'])} episodes, --held-out "
            f"{options.held_out} leaves none with a choice"
        )
    print(f"{dataset.card['steps']:,} steps, {len(learnt):,} rows to learn from, {len(held_out):,} held out")
    learn(policy, learnt, held_out, options)
    return policy, dataset


def scenario_of(dataset: sp.Dataset, options: Options) -> str:
    """The name or the file of what the dataset plays."""
    scenario = options.map_file or dataset.scenario
    if scenario is None:
        raise sp.errors.InvalidRequest(
            "the dataset is not of a standard scenario; --map-file must name its file"
        )
    told = sp.scenario(scenario)  # which raises ScenarioError if it cannot be read
    if options.map_file:
        sizes = dataset.card["sizes"]
        given = (told["name"], len(told["allies"]), len(told["enemies"]))
        expected = (dataset.card["scenario"], sizes["n_agents"], sizes["n_enemies"])
        if given != expected:
            raise sp.errors.InvalidRequest(
                f"--map-file must be the scenario of the dataset: name, agents and enemies are {expected}, "
                f"got {given}"
            )
    return scenario


def evaluate(policy: Mlp, dataset: sp.Dataset, options: Options) -> sp.Evaluation:
    """Plays battles by the rules of the dataset, with seeds from 2^32 on, which it hardly has."""
    scenario = scenario_of(dataset, options)
    own = {"obs_last_actions": options.last_actions, **dataset.settings}
    with sp.make(scenario, min(options.evaluate_episodes, 64), **own) as envs:
        play = partial(act, policy, options=options)
        return sp.evaluate(envs, play, options.evaluate_episodes, seed=2**32 + options.seed)


def main() -> None:
    parser = parser_of(Options, __doc__, "a file of `smaclite-pool dataset record`")
    options = Options(**parsed(parser, Options))
    with one_line_errors("behaviour_cloning"):
        policy, dataset = clone(options)
        if options.out:
            weights = {f"actor.{name}": tensor for name, tensor in policy.state_dict().items()}
            save_file(weights, Path(options.out))
        result = evaluate(policy, dataset, options)
    print(
        f"{len(result)} episodes, {'greedy' if options.greedy else 'sampled'}: won {result.win_rate:.1%}, "
        f"return {result.mean_return:.2f}; in the dataset {dataset.card['win_rate']:.1%}, "
        f"{dataset.card['returns']['mean']:.2f}"
    )


if __name__ == "__main__":
    main()
