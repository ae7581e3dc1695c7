"""What never changes about the environments of a lane."""

from __future__ import annotations

import dataclasses
from typing import Any, Literal

import numpy as np

from .types import LaneDescription, RewardOptions


@dataclasses.dataclass(frozen=True, kw_only=True)
class LaneSpec:
    """What never changes about the environments of a lane: sizes, fields, names and settings.

    `Envs.spec` and `Spectator.spec` are such objects. They can be pickled and need no pool, so a process
    without environments can build networks by one. `dataclasses.replace` makes another one, for wrappers. Do
    not change the dicts: whoever asks for the spec gets the same ones.
    """

    pool: str
    """The pool's name, by which others connect."""
    lane: str
    """The lane's name."""
    pid: int
    """Process id of the pool's supervisor; the process of `make` if the pool is embedded."""
    scenario: str
    """The scenario's name."""
    rules: Literal["smaclite", "paper", "starcraft-1"]
    """The rule set: "smaclite", "paper" or "starcraft-1"."""
    seed: int
    """The lane's seed, also where a random one was drawn: environment i starts with seed + i."""
    num_envs: int
    """Number of environments (N)."""
    batch_size: int
    """Number of environments per batch (M); equal to `num_envs` in synchronous mode."""
    threads: int
    """Worker threads of the pool, which all its lanes share."""
    max_held_batches: int
    """Batches that can be in use at once."""
    n_agents: int
    """Number of agents per environment."""
    n_enemies: int
    """Number of enemies per environment."""
    n_actions: int
    """Number of actions per agent: no-op (dead agents only), stop, move north, south, east and west, then one
    per target."""
    obs_size: int
    """Number of features in an agent's observation, with what the lane appends."""
    state_size: int
    """Number of features in the state."""
    snapshot_size: int
    """Bytes of a snapshot; 0 if the lane has no field `snapshot`."""
    fields: dict[str, tuple[np.dtype[Any], tuple[int, ...]]]
    """From the name of each field in a batch to its dtype and shape."""
    episode_limit: int | None
    """Number of steps after which an episode is truncated; None for no limit."""
    autoreset_mode: Literal["NextStep", "SameStep", "Disabled"]
    """What happens at the end of an episode: "NextStep", "SameStep" or "Disabled", the values of Gymnasium's
    `AutoresetMode`."""
    obs_last_actions: int
    """How many of its own last actions an agent observes; 0 for none."""
    obs_agent_id: bool
    """Whether an agent observes its own number."""
    rewards: RewardOptions
    """What both sides are rewarded for: SMAC's reward options, such as `reward_win`."""
    opponents: dict[str, float]
    """Who plays the enemies: names of `OPPONENTS`, and their weights; "learner" is `opponent_team`, if one
    plays them."""
    opponent_team: str | None
    """The trained team that plays the enemies, as it was named: "zoo:3m", or the folder of its run."""
    sides: Literal["allies", "both", "mirrored"]
    """Which sides actions play: "allies", "both", or "mirrored", which is both with the enemies' fields and
    actions reflected at the centre of the map. What follows is 0 for "allies"."""
    n_enemy_actions: int = 0
    """Number of actions per enemy, which are numbered as those of agents."""
    enemy_obs_size: int = 0
    """Number of features in an enemy's observation."""
    enemy_state_size: int = 0
    """Number of features in the enemies' state."""

    @property
    def n_actors(self) -> int:
        """Number of actions per environment: one per agent, and if actions play both sides then one per
        enemy."""
        return self.n_agents + (0 if self.sides == "allies" else self.n_enemies)

    @staticmethod
    def _of(
        lane: LaneDescription,
        fields: dict[str, tuple[np.dtype[Any], tuple[int, ...]]],
        snapshot_size: int,
    ) -> LaneSpec:
        """Called by the compiled module, for `Envs.spec` and `Spectator.spec`."""
        names = {field.name for field in dataclasses.fields(LaneSpec)}
        values: dict[str, Any] = {name: value for name, value in lane.items() if name in names}
        if enemies := lane["enemies"]:
            values["n_enemy_actions"] = enemies["n_actions"]
            values["enemy_obs_size"], values["enemy_state_size"] = enemies["obs_size"], enemies["state_size"]
        values["max_held_batches"] = lane["capacity"]["max_held_batches"]
        return LaneSpec(**{**values, "fields": fields, "snapshot_size": snapshot_size})
