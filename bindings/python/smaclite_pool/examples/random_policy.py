"""A random policy in an embedded pool: steps per second, returns and wins.

Usage:

    python -m smaclite_pool.examples.random_policy 2s3z --num-envs 64 --seconds 5
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
import smaclite_pool as sp
from smaclite_pool.examples.options import ANY_SEED, one_line_errors, option, parsed, parser_of


@dataclass(frozen=True)
class Options:
    scenario: str = "2s3z"
    num_envs: int = option(64, "environments stepped at once", within=(1, 65_536))
    seconds: float = option(5.0, "how long to play", within=(0, 1e6))
    threads: int | None = option(None, "of the pool, by default as many as there are cores", within=(1, 1024))
    seed: int = option(1, "of environments and policy", within=ANY_SEED)


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
    options = Options(**parsed(parser_of(Options, __doc__, "a standard scenario or a file"), Options))
    with one_line_errors("random_policy"):
        with sp.make(options.scenario, options.num_envs, threads=options.threads) as envs:
            play(envs, options.seconds, options.seed)


if __name__ == "__main__":
    main()
