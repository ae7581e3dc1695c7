"""Data-parallel PPO on a Ray cluster: every node plays in its own pool, only rollouts and weights cross nodes.

    python bindings/examples/ray_rollouts.py 2s_vs_1sc --num-envs 32 --updates 20

The policy is a linear softmax over an agent's observation, the value a linear function of the state: small enough to
differentiate by hand, so that what is left is how rollouts are spread. With `RAY_ADDRESS` set it joins that cluster.
"""

import argparse
from typing import Any

import numpy as np
import ray
import smaclite_pool as sp
from numpy.typing import NDArray
from smaclite_pool.ray import attach, start

Arrays = dict[str, NDArray[Any]]
GAMMA, LAMBDA, CLIP, EPOCHS, RIDGE = 0.99, 0.95, 0.2, 8, 10.0


def probabilities(weights: Arrays, obs: NDArray[Any], legal: NDArray[Any]) -> NDArray[Any]:
    """[..., n_actions]: softmax over the legal actions."""
    logits = np.where(legal, obs @ weights["policy"], -np.inf)
    grown = np.exp(logits - logits.max(axis=-1, keepdims=True))
    return grown / grown.sum(axis=-1, keepdims=True)


@ray.remote(num_cpus=0.5)
class Rollout:
    """Plays in a lane of its node's pool."""

    def __init__(self, steps: int) -> None:
        self.lane = attach()
        self.steps = steps
        self.begin()

    def begin(self) -> None:
        self.random = np.random.default_rng(self.lane.seed)
        self.batch = self.lane.envs.reset(seed=self.lane.seed)

    def sizes(self) -> dict[str, int]:
        envs = self.lane.envs
        return {name: getattr(envs, name) for name in ("obs_size", "state_size", "n_actions")}

    def collect(self, weights: Arrays) -> Arrays:
        """`steps` steps of every environment, [steps * num_envs, ...]; anew in a new pool, should the pool die."""
        while True:
            try:
                return self.play(weights)
            except sp.PoolDied:
                self.lane.reattach()
                self.begin()

    def play(self, weights: Arrays) -> Arrays:
        rows: list[Arrays] = []
        for _ in range(self.steps):
            obs, legal, state = self.batch.obs.copy(), self.batch.avail_actions.copy(), self.batch.state.copy()
            odds = probabilities(weights, obs, legal)
            noise = self.random.gumbel(size=odds.shape)
            actions = np.where(legal, np.log(odds, where=legal, out=np.zeros_like(odds)) + noise, -np.inf).argmax(-1)
            chosen = np.take_along_axis(odds, actions[..., None], -1)[..., 0]
            batch = self.batch = self.lane.envs.step(actions)
            ended = batch.terminated | batch.truncated
            later = np.where(ended[:, None], batch.final_state, batch.state) @ weights["value"]
            row = {"obs": obs, "legal": legal, "state": state, "actions": actions, "chosen": chosen, "ended": ended}
            row |= {"later": np.where(batch.terminated, 0.0, later), "reward": batch.reward.copy()}
            rows.append(row | {"won": batch.battle_won.copy(), "return": batch.episode_return.copy()})
        rollout = {name: np.stack([row[name] for row in rows]) for name in rows[0]}
        rollout["advantage"] = advantages(rollout, rollout["state"] @ weights["value"])
        return {name: value.reshape(-1, *value.shape[2:]) for name, value in rollout.items()}


def advantages(rollout: Arrays, value: NDArray[Any]) -> NDArray[Any]:
    """Generalised advantage estimates, [steps, num_envs]."""
    surprise = rollout["reward"] + GAMMA * rollout["later"] - value
    estimate = np.zeros_like(surprise)
    carried = np.zeros(surprise.shape[1])
    for step in reversed(range(len(surprise))):
        carried = surprise[step] + GAMMA * LAMBDA * ~rollout["ended"][step] * carried
        estimate[step] = carried
    return estimate


def improve(weights: Arrays, rollout: Arrays, rate: float) -> Arrays:
    """A few steps up PPO's clipped objective, and the value that fits the returns best."""
    advantage = rollout["advantage"]
    target = advantage + rollout["state"] @ weights["value"]
    scaled = ((advantage - advantage.mean()) / (advantage.std() + 1e-8))[:, None]
    policy = weights["policy"]
    for _ in range(EPOCHS):
        odds = probabilities({"policy": policy}, rollout["obs"], rollout["legal"])
        now = np.take_along_axis(odds, rollout["actions"][..., None], -1)[..., 0]
        ratio = now / rollout["chosen"]
        free = np.where(scaled > 0, ratio < 1 + CLIP, ratio > 1 - CLIP)
        taken = np.arange(odds.shape[-1]) == rollout["actions"][..., None]
        slope = (scaled * ratio * free)[..., None] * (taken - odds)
        ascent = np.einsum("bao,ban->on", rollout["obs"], slope)
        policy = policy + rate * ascent / (np.linalg.norm(ascent) + 1e-8)
    state = rollout["state"]
    value = np.linalg.solve(state.T @ state + RIDGE * np.eye(state.shape[1]), state.T @ target)
    return {"policy": policy, "value": value}


def train(options: argparse.Namespace) -> None:
    serve = ("--autoreset", "same_step")
    with start(options.scenario, options.num_envs, lanes=options.lanes, threads=options.threads, serve=serve) as fleet:
        rollouts = fleet.spawn(Rollout, options.steps)
        sizes = ray.get(rollouts[0].sizes.remote())
        print(f"{len(fleet.supervisors)} nodes, {len(rollouts)} rollout actors of {options.num_envs} environments")
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
            print(f"update {update}: {len(ended)} steps, {ended.sum()} battles, mean return {mean}, won {whole['won'].sum()}")


def main() -> None:
    parser = argparse.ArgumentParser(description="Data-parallel PPO on a Ray cluster.")
    parser.add_argument("scenario", nargs="?", default="2s_vs_1sc", help="a standard scenario or a file of every node")
    parser.add_argument("--num-envs", type=int, default=32, help="environments of a lane (default: 32)")
    parser.add_argument("--lanes", type=int, default=1, help="rollout actors of a node (default: 1)")
    parser.add_argument("--threads", type=int, help="worker threads of a node (default: its cores, less one)")
    parser.add_argument("--steps", type=int, default=64, help="steps of a rollout (default: 64)")
    parser.add_argument("--updates", type=int, default=20, help="updates of the policy (default: 20)")
    parser.add_argument("--rate", type=float, default=0.1, help="length of a policy step (default: 0.1)")
    options = parser.parse_args()
    ray.init(log_to_driver=False)
    train(options)


if __name__ == "__main__":
    main()
