"""Self-play of a team: `smaclite_pool.examples.ppo`, where one team plays both sides of a symmetric scenario.

    python -m smaclite_pool.examples.self_play 3m --steps 500000 --seed 1

The environments have actions for both sides, and show the enemies a mirror image, in which they stand where
agents do (docs/reference/both-sides.md). So a battle is two environments of one side each, and the learner
needs no change: of N environments, it gets the agents of N / 2 battles, and then their enemies. Steps are
counted as it counts them, one for each side. The team is evaluated against the script `attack_move`, which it
never met.

`smaclite-pool train --opponent self` does the same faster, and `--opponent league` adds copies of the team
and the script (docs/how-to/self-play.md).

Axes of arrays: N environments of one side each, A units of a side.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import smaclite_pool as sp
from numpy.typing import ArrayLike, NDArray
from smaclite_pool.examples import ppo
from smaclite_pool.extras import LaneSpec

PAIRS = {"obs": "enemy_obs", "state": "enemy_state", "avail_actions": "enemy_avail_actions"}
"""The fields that a side has for itself, and those of the enemies."""

SHARED = ("terminated", "truncated", "was_reset", "episode_length")
"""The fields that are the same for both sides."""


class Sides(sp.extras.Wrapper):
    """The two sides of N / 2 battles as N environments."""

    def __init__(self, envs: sp.Envs) -> None:
        super().__init__(envs)
        spec = envs.spec
        own, other = ([spec.fields[name][1][1:] for name in names] for names in (PAIRS, PAIRS.values()))
        if own != other:
            raise SystemExit(
                f"self_play: {spec.scenario} is not symmetric: agents have {own}, enemies {other}"
            )
        self.enemy_return: NDArray[np.float32] = np.zeros(spec.num_envs, np.float32)

    def change_spec(self, spec: LaneSpec) -> LaneSpec:
        n = 2 * spec.num_envs
        fields = {name: (dtype, (n, *shape[1:])) for name, (dtype, shape) in spec.fields.items()}
        return replace(spec, num_envs=n, batch_size=n, fields=fields)

    def change_batch(self, batch: Any) -> Any:
        goes_on = ~batch.was_reset
        self.enemy_return = goes_on * (self.enemy_return + batch.enemy_reward)
        allies_are_dead = batch.dead_allies == self.envs.spec.n_agents  # a draw if the enemies are, too
        enemies_won = batch.terminated & allies_are_dead & ~batch.battle_won
        pairs = {own: (getattr(batch, own), getattr(batch, other)) for own, other in PAIRS.items()}
        pairs |= {name: (getattr(batch, name), getattr(batch, name)) for name in SHARED}
        pairs["reward"] = (batch.reward, batch.enemy_reward)
        pairs["battle_won"] = (batch.battle_won & ~allies_are_dead, enemies_won)
        pairs["episode_return"] = (batch.episode_return, self.enemy_return)
        # Not a `Batch`: that has a row per battle, and this one a row per side.
        return SimpleNamespace(**{name: np.concatenate(pair) for name, pair in pairs.items()})

    def change_actions(self, actions: ArrayLike) -> ArrayLike:
        """From [N, A] to [N / 2, 2 A]: of each battle, the agents first."""
        return np.concatenate(np.split(np.asarray(actions), 2), axis=1)


def make(options: ppo.Options, num_envs: int) -> Any:
    own_actions, threads = ppo.with_defaults(options).last_actions, options.threads or None
    if num_envs % 2 == 1:
        raise SystemExit(f"self_play: --num-envs must be even, got {num_envs}: a battle has two sides")
    envs = sp.make(
        options.scenario,
        num_envs // 2,
        threads=threads,
        obs_last_actions=own_actions,
        sides="mirrored",
        episode_limit=ppo.limit_of(options.scenario),
    )
    return Sides(envs)


if __name__ == "__main__":
    ppo.main(__doc__, make)
