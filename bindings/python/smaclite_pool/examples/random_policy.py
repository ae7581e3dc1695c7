"""A random policy in an embedded pool: steps per second, returns and wins.

Usage:

    python -m smaclite_pool.examples.random_policy 2s3z --num-envs 64 --seconds 5
"""

import argparse
import time

import numpy as np
import smaclite_pool as sp
from smaclite_pool.examples.options import one_line_errors


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Play a scenario with uniformly random available actions.")
    a_scenario = "a standard scenario or a file (default: 2s3z)"
    parser.add_argument("scenario", nargs="?", default="2s3z", help=a_scenario)
    parser.add_argument("--num-envs", type=int, default=64, help="environments stepped at once (default: 64)")
    parser.add_argument("--seconds", type=float, default=5.0, help="how long to play (default: 5)")
    parser.add_argument("--threads", type=int, help="threads (default: as many as there are cores)")
    parser.add_argument("--seed", type=int, default=1, help="of environments and policy (default: 1)")
    return parser.parse_args()


def play(envs: sp.Envs, seconds: float, seed: int) -> None:
    spec = envs.spec
    envs.seed_sampler(seed)
    returns: list[float] = []
    wins = steps = 0
    batch = envs.reset(seed=seed)
    actions = envs.sample_actions()
    begin = time.perf_counter()
    while time.perf_counter() - begin < seconds:
        batch = envs.step(envs.sample_actions(out=actions))
        steps += len(batch)
        ended = batch.terminated | batch.truncated
        if ended.any():
            returns += batch.episode_return[ended].tolist()
            wins += int(batch.battle_won[ended].sum())
    elapsed = time.perf_counter() - begin
    print(f"{spec.scenario}: {spec.num_envs} environments, {spec.n_agents} agents against {spec.n_enemies}")
    print(f"  {steps / elapsed:,.0f} steps/s ({steps:,} steps of single environments in {elapsed:.1f} s)")
    if returns:
        won = 100 * wins / len(returns)
        print(f"  {len(returns):,} episodes: mean return {np.mean(returns):.2f}, won {won:.1f} %")
    else:
        print("  no episode ended in this time")


def main() -> None:
    options = arguments()
    with one_line_errors("random_policy"):
        with sp.make(options.scenario, options.num_envs, threads=options.threads) as envs:
            play(envs, options.seconds, options.seed)


if __name__ == "__main__":
    main()
