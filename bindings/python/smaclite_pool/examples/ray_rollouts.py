"""Data-parallel PPO on a Ray cluster: a pool per node; only rollouts and weights cross nodes.

    python -m smaclite_pool.examples.ray_rollouts 2s_vs_1sc --num-envs 32 --updates 20

The policy is a linear softmax over the observation of an agent, and the value a linear function of the state.
Both are simple enough to differentiate by hand, so that the example shows how rollouts are distributed. With
`RAY_ADDRESS` set it joins that cluster.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import smaclite_pool as sp
from numpy.typing import NDArray
from smaclite_pool.examples.options import COUNT, SMALL, extra, one_line_errors, option, parsed, parser_of
from smaclite_pool.integrations.ray import attach, start

with extra("ray"):
    import ray

Arrays = dict[str, NDArray[Any]]
GAMMA, LAMBDA, CLIP, EPOCHS, RIDGE = 0.99, 0.95, 0.2, 8, 10.0


@dataclass(frozen=True)
class Options:
    scenario: str = "2s_vs_1sc"
    num_envs: int = option(32, "environments per lane", within=(1, 65_536))
    lanes: int = option(1, "rollout actors per node", within=(1, 1024))
    threads: int | None = option(None, "worker threads per node, by default its cores - 1", within=(1, 1024))
    steps: int = option(64, "steps per rollout", within=COUNT)
    updates: int = option(20, "number of policy updates", within=COUNT)
    rate: float = option(0.1, "length of a policy step", within=SMALL)


def probabilities(weights: Arrays, obs: NDArray[Any], legal: NDArray[Any]) -> NDArray[Any]:
    """float32 [..., n_actions]: softmax over the available actions."""
    logits = np.where(legal, obs @ weights["policy"], -np.inf)
    exponentials = np.exp(logits - logits.max(axis=-1, keepdims=True))
    return exponentials / exponentials.sum(axis=-1, keepdims=True)


@ray.remote(num_cpus=0.5)
class Rollout:
    """Plays in a lane of the pool of its node."""

    def __init__(self, steps: int) -> None:
        self.lane = attach()
        self.steps = steps
        self.begin()

    def begin(self) -> None:
        self.random = np.random.default_rng(self.lane.seed)
        self.batch = self.lane.envs.reset(seed=self.lane.seed)

    def sizes(self) -> dict[str, int]:
        spec = self.lane.envs.spec
        return {"obs_size": spec.obs_size, "state_size": spec.state_size, "n_actions": spec.n_actions}

    def collect(self, weights: Arrays) -> Arrays:
        """`steps` steps of every environment, [steps * num_envs, ...]; again if the pool dies meanwhile."""
        while True:
            try:
                return self.play(weights)
            except sp.errors.PoolDied:
                self.lane.reattach()
                self.begin()

    def play(self, weights: Arrays) -> Arrays:
        rows: list[Arrays] = []
        for _ in range(self.steps):
            obs, legal = self.batch.obs.copy(), self.batch.avail_actions.copy()
            state = self.batch.state.copy()
            odds = probabilities(weights, obs, legal)
            noise = self.random.gumbel(size=odds.shape)
            log_odds = np.log(odds, where=legal, out=np.zeros_like(odds))
            actions = np.where(legal, log_odds + noise, -np.inf).argmax(-1)
            chosen = np.take_along_axis(odds, actions[..., None], -1)[..., 0]
            batch = self.batch = self.lane.envs.step(actions)
            ended = batch.terminated | batch.truncated
            later = np.where(ended[:, None], batch.final_state, batch.state) @ weights["value"]
            row = {"obs": obs, "legal": legal, "state": state, "actions": actions}
            row |= {"chosen": chosen, "ended": ended}
            row |= {"later": np.where(batch.terminated, 0.0, later), "reward": batch.reward.copy()}
            rows.append(row | {"won": batch.battle_won.copy(), "return": batch.episode_return.copy()})
        rollout = {name: np.stack([row[name] for row in rows]) for name in rows[0]}
        rollout["advantage"] = advantages(rollout, rollout["state"] @ weights["value"])
        return {name: value.reshape(-1, *value.shape[2:]) for name, value in rollout.items()}


def advantages(rollout: Arrays, value: NDArray[Any]) -> NDArray[Any]:
    """Generalised advantage estimates, [steps, num_envs]."""
    error = rollout["reward"] + GAMMA * rollout["later"] - value
    estimate = np.zeros_like(error)
    carried = np.zeros(error.shape[1])
    for step in reversed(range(len(error))):
        carried = error[step] + GAMMA * LAMBDA * ~rollout["ended"][step] * carried
        estimate[step] = carried
    return estimate


def improve(weights: Arrays, rollout: Arrays, rate: float) -> Arrays:
    """A few ascent steps on PPO's clipped objective, and a least-squares fit of the value."""
    advantage = rollout["advantage"]
    target = advantage + rollout["state"] @ weights["value"]
    scaled = ((advantage - advantage.mean()) / (advantage.std() + 1e-8))[:, None]
    policy = weights["policy"]
    for _ in range(EPOCHS):
        odds = probabilities({"policy": policy}, rollout["obs"], rollout["legal"])
        now = np.take_along_axis(odds, rollout["actions"][..., None], -1)[..., 0]
        ratio = now / rollout["chosen"]
        free = np.where(scaled > 0, ratio < 1 + CLIP, ratio > 1 - CLIP)
        one_hot = np.arange(odds.shape[-1]) == rollout["actions"][..., None]
        logit_gradient = (scaled * ratio * free)[..., None] * (one_hot - odds)
        gradient = np.einsum("bao,ban->on", rollout["obs"], logit_gradient)
        policy = policy + rate * gradient / (np.linalg.norm(gradient) + 1e-8)
    state = rollout["state"]
    value = np.linalg.solve(state.T @ state + RIDGE * np.eye(state.shape[1]), state.T @ target)
    return {"policy": policy, "value": value}


def train(options: Options) -> None:
    serve = ("--autoreset-mode", "SameStep")
    with start(
        options.scenario, options.num_envs, lanes=options.lanes, threads=options.threads, serve=serve
    ) as fleet:
        rollouts = fleet.spawn(Rollout, options.steps)
        sizes = ray.get(rollouts[0].sizes.remote())
        nodes = len(fleet.supervisors)
        print(f"{nodes} nodes, {len(rollouts)} rollout actors of {options.num_envs} environments")
        weights: Arrays = {
            "policy": np.zeros((sizes["obs_size"], sizes["n_actions"]), np.float32),
            "value": np.zeros(sizes["state_size"], np.float32),
        }
        for update in range(options.updates):
            shared = ray.put(weights)  # once, for all actors of a node
            parts = ray.get([rollout.collect.remote(shared) for rollout in rollouts])
            whole = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
            weights = improve(weights, whole, options.rate)
            ended = whole["ended"]
            mean = f"{whole['return'][ended].mean():.2f}" if ended.any() else "none ended"
            battles = f"{ended.sum()} battles, mean return {mean}, won {whole['won'].sum()}"
            print(f"update {update}: {len(ended)} steps, {battles}")


def main() -> None:
    parser = parser_of(Options, __doc__, "a standard scenario, or a file that every node has")
    options = Options(**parsed(parser, Options))
    ray.init(log_to_driver=False)
    with one_line_errors("ray_rollouts"):
        train(options)


if __name__ == "__main__":
    main()
