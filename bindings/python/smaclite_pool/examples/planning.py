"""Search instead of learning: beam search and Monte-Carlo tree search over branches of one battle.

    python -m smaclite_pool.examples.planning 5m_vs_6m                                # beam search
    python -m smaclite_pool.examples.planning 3m --method mcts --steps 300000

Both look for one good episode. Copies of a battle have its execution orders, so a plan leads again to what
it led to: at the end it is played once more, and the returns are compared.

- Beam search keeps the best states of each time step, tries joint actions in all of them, and keeps the
  best of what they lead to. When the episode is over it begins again, for as long as there are steps to
  spend.
- Tree search (MCTS) goes step by step: from the present state it grows a tree, and then plays the action
  that it visited most. There are too many joint actions to try all, so a node gets another child only as
  its visits grow (progressive widening). A new node is valued by some steps of a scripted policy.

The joint actions that they try are those of the scripted policy, in which some agents do something random.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import smaclite_pool as sp
from numpy.typing import NDArray
from smaclite_pool.examples.options import SEED, STEPS, one_line_errors, option, parsed, parser_of

FULL_RETURN = 20.0
"""The return of a victory without losses on the way."""
HEALTH_WEIGHT = 5.0
"""What the health of all agents is worth, as a return."""
WIN_BONUS = 100.0
POLICIES = ["random", "nearest", "focus_fire", "kite", "hold"]
USUAL_LENGTH = 60
"""Steps of an episode that a tree search divides its budget by."""

Actions = NDArray[np.int32]


@dataclass(frozen=True)
class Options:
    scenario: str = "5m_vs_6m"
    method: str = option("beam", "beam search or tree search", ["beam", "mcts"])
    policy: str = option("focus_fire", "whose actions are varied", POLICIES)
    steps: int = option(1_000_000, "steps to simulate", within=STEPS)
    width: int = option(500, "states of a beam", within=(1, 10_000))
    tries: int = option(12, "joint actions per state of a beam", within=(1, 100))
    depth: int = option(16, "steps that value a node of a tree", within=(0, 10_000))
    seed: int = option(1, "of the battle and the search", within=SEED)


@dataclass
class Plan:
    """The actions of an episode, and what they led to."""

    actions: list[Actions]
    """One joint action [n_agents] per step."""
    episode_return: float = -math.inf
    won: bool = False

    def is_better_than(self, other: Plan) -> bool:
        return (self.won, self.episode_return) > (other.won, other.episode_return)


class Score:
    """How good the states of a batch are: the return so far, and the health of the agents."""

    def __init__(self, scenario: str) -> None:
        [allies] = [part for part in sp.scenario(scenario)["state_layout"] if part["name"] == "allies"]
        agents, features = allies["shape"]
        self.health = slice(allies["start"], allies["start"] + agents * features, features)

    def __call__(self, batch: sp.Batch) -> NDArray[np.float64]:
        health: NDArray[np.float64] = batch.state[:, self.health].mean(1, dtype=np.float64)
        return batch.episode_return + HEALTH_WEIGHT * health + WIN_BONUS * batch.battle_won


class Proposals:
    """Joint actions to try: those of a scripted policy, in which some agents do something random."""

    def __init__(self, envs: sp.Envs, policy: Any, seed: int) -> None:
        self.envs, self.rng = envs, np.random.default_rng(seed)
        self.policy = sp.ScriptedPolicy(policy, envs, seed=seed)

    def __call__(self, batch: sp.Batch) -> Actions:
        share = self.rng.random((self.envs.spec.num_envs, 1))  # of the agents that do something random
        is_random = self.rng.random((self.envs.spec.num_envs, self.envs.spec.n_agents)) < share
        return np.where(is_random, self.envs.sample_actions(), self.policy(batch)).astype(np.int32)


def ended(batch: sp.Batch) -> NDArray[np.bool_]:
    return batch.terminated | batch.truncated


# ---------------------------------------------------------------------------------------------- beam search


def beam_search(envs: sp.Envs, score: Score, options: Options) -> Plan:
    best, steps, propose = Plan([]), 0, Proposals(envs, options.policy, options.seed)
    while steps < options.steps:
        plan, used = one_beam(envs, score, propose, options)
        best, steps = (plan if plan.is_better_than(best) else best), steps + used
    return best


def one_beam(envs: sp.Envs, score: Score, propose: Proposals, options: Options) -> tuple[Plan, int]:
    """The best episode of one beam, and the number of steps."""
    spec = envs.spec
    all_envs = np.arange(spec.num_envs)
    envs.reset(seed=options.seed)
    batch = envs.fork(np.zeros_like(all_envs), all_envs)
    parents = all_envs
    history: list[tuple[NDArray[np.int_], Actions]] = []
    best = Plan([])
    while True:
        actions = propose(batch)
        batch = envs.step(actions)
        history.append((parents, actions))
        over, scores = ended(batch), score(batch)
        if over.any():
            slot = int(np.argmax(np.where(over, scores, -np.inf)))
            plan = Plan(path(history, slot), float(batch.episode_return[slot]), bool(batch.battle_won[slot]))
            best = plan if plan.is_better_than(best) else best
        if over.all():
            return best, len(history) * spec.num_envs
        parents = np.resize(most_promising(scores, ~over, options.width), spec.num_envs)
        batch = envs.fork(parents, all_envs)


def most_promising(scores: NDArray[np.float64], alive: NDArray[np.bool_], width: int) -> NDArray[np.int_]:
    """The environments with the best scores, one of those that are equal."""
    candidates = np.flatnonzero(alive)
    _, first = np.unique(-np.round(scores[candidates], 6), return_index=True)
    return candidates[first][:width]


def path(history: list[tuple[NDArray[np.int_], Actions]], slot: int) -> list[Actions]:
    """The joint actions that led to the state in a slot, from the first step on."""
    actions = []
    for parents, tried in reversed(history):
        actions.append(tried[slot])
        slot = int(parents[slot])
    return actions[::-1]


# ---------------------------------------------------------------------------------------------- tree search


@dataclass
class Node:
    """A state that was reached, and what was tried from there."""

    snapshot: NDArray[np.uint8]
    episode_return: float = 0.0
    won: bool = False
    over: bool = False
    visits: int = 0
    total: float = 0.0
    children: list[tuple[Actions, Node]] = field(default_factory=list)

    def widens(self) -> bool:
        """Whether it gets another child at this visit."""
        return len(self.children) < math.sqrt(self.visits + 1)

    def best_child(self) -> Node:
        """By the upper confidence bound."""
        log = math.log(self.visits + 1)
        return max(
            (child for _, child in self.children),
            key=lambda child: child.total / child.visits + 0.5 * math.sqrt(log / child.visits),
        )


def tree_search(envs: sp.Envs, score: Score, options: Options) -> Plan:
    propose = Proposals(envs, options.policy, options.seed)
    batch = envs.reset(seed=options.seed)
    root = Node(batch.snapshot[0].copy())
    plan = Plan([])
    rounds = max(1, options.steps // (USUAL_LENGTH * envs.spec.num_envs * (options.depth + 1)))
    while not root.over:
        for _ in range(rounds):
            grow(envs, propose, root, score, options.depth)
        actions, root = max(root.children, key=lambda child: child[1].visits)
        plan.actions.append(actions)
    plan.episode_return, plan.won = root.episode_return, root.won
    return plan


def grow(envs: sp.Envs, propose: Proposals, root: Node, score: Score, depth: int) -> None:
    """Adds a node per environment to the tree, and values all of them at once."""
    paths = [descend(root) for _ in range(envs.spec.num_envs)]
    batch = envs.reset(snapshots=np.stack([path[-1].snapshot for path in paths]))
    actions = propose(batch)
    batch = envs.step(actions)
    for slot, path in enumerate(paths):
        node = Node(batch.snapshot[slot].copy())
        node.episode_return, node.won = float(batch.episode_return[slot]), bool(batch.battle_won[slot])
        node.over = bool(batch.terminated[slot] or batch.truncated[slot])
        path[-1].children.append((actions[slot], node))
        path.append(node)
    values, over = score(batch), ended(batch)
    for _ in range(depth):
        batch = envs.step(propose.policy(batch))
        values, over = np.where(over, values, score(batch)), over | ended(batch)
    for path, value in zip(paths, values / FULL_RETURN, strict=True):
        path[-1].visits += 1  # the others were counted on the way down
        for node in path:
            node.total += value


def descend(root: Node) -> list[Node]:
    """The nodes from the root to one that gets another child; visits count at once, so that paths differ."""
    node, nodes = root, [root]
    node.visits += 1
    while not node.widens() and not (child := node.best_child()).over:
        node = child
        node.visits += 1
        nodes.append(node)
    return nodes


# --------------------------------------------------------------------------------------------------------


def replayed(scenario: str, plan: Plan, seed: int) -> tuple[float, bool]:
    """The return of a plan, and whether it wins, in a battle that nothing else was tried in."""
    with sp.make(scenario, num_envs=1) as envs:
        batch = envs.reset(seed=seed)
        for actions in plan.actions:
            batch = envs.step(actions[None])
        return float(batch.episode_return[0]), bool(batch.battle_won[0])


def main() -> None:
    options = Options(**parsed(parser_of(Options, __doc__, "a standard scenario or a file"), Options))
    fields = ["state", "avail_actions", "battle_won", "episode_return", "episode_length"]
    num_envs = options.width * options.tries
    if options.method == "mcts":
        fields, num_envs = [*fields, "snapshot"], 64
    begin = time.perf_counter()
    with one_line_errors("planning"):
        with sp.make(options.scenario, num_envs, fields=fields) as envs:
            envs.seed_sampler(options.seed)
            search = beam_search if options.method == "beam" else tree_search
            plan = search(envs, Score(options.scenario), options)
        seconds = time.perf_counter() - begin
        again = replayed(options.scenario, plan, options.seed)
    outcome = "won" if plan.won else "lost"
    print(
        f"{options.scenario}: {outcome} with return {plan.episode_return:.2f} in {len(plan.actions)} steps, "
        f"found in {seconds:.1f} s"
    )
    if again != (plan.episode_return, plan.won):
        raise SystemExit(f"planning: the plan gave {again} when it was played again")


if __name__ == "__main__":
    main()
