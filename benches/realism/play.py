"""Random play and scripts on the maps of SMAC, beside what was measured on the real game."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import smaclite_pool as sp
from numpy.typing import NDArray

from .columns import Columns
from .pool import Setting
from .recordings import EAST, FIRST_TARGET, NORTH, SOUTH, STOP, WEST

Actor = Callable[[sp.Batch], NDArray[np.int32]]
SEED = 1


@dataclass(frozen=True)
class Result:
    """Means over episodes."""

    episodes: int
    episode_return: float
    length: float
    won: float


def random_play(setting: Setting, episodes: int) -> Result:
    """Uniform over the available actions of each agent."""
    with made(setting, episodes, ["avail_actions"]) as envs:
        envs.seed_sampler(SEED)
        return episodes_of(envs, lambda _: envs.sample_actions())


def scripted(setting: Setting, script: str, episodes: int) -> Result:
    """A script of `SCRIPTS`, or a scripted policy."""
    with made(setting, episodes, ["state", "avail_actions", "snapshot"]) as envs:
        return episodes_of(envs, SCRIPTS[script](envs) if script in SCRIPTS else policy(envs, script))


def made(setting: Setting, count: int, fields: list[str]) -> sp.Envs:
    ends = ["episode_return", "episode_length", "battle_won"]
    envs: sp.Envs = sp.make(setting.scenario, count, fields=[*fields, *ends], **setting.options())
    return envs


def episodes_of(envs: sp.Envs, actor: Actor) -> Result:
    """The first episode of each environment: as many short as long ones."""
    batch = envs.reset(seed=SEED)
    goes_on = np.ones(len(batch), bool)
    returns, lengths, wins = (np.zeros(len(batch)) for _ in range(3))
    while goes_on.any():
        batch = envs.step(actor(batch))
        ended = goes_on & (batch.terminated | batch.truncated)
        returns[ended] = batch.episode_return[ended]
        lengths[ended] = batch.episode_length[ended]
        wins[ended] = batch.battle_won[ended]
        goes_on &= ~ended
    return Result(len(wins), float(returns.mean()), float(lengths.mean()), float(wins.mean()))


def policy(envs: sp.Envs, name: Any) -> Actor:
    return sp.ScriptedPolicy(name, envs)


class Hybrid:
    """Each agent attacks the enemy with the least weight x health + (1 - weight) x distance; it walks to one
    that is out of reach, along the longer axis. Health is in points without shields; 0 is the closest, 1 the
    weakest. Healers play the policy `nearest`."""

    def __init__(self, envs: sp.Envs, weight: float) -> None:
        self.envs, self.weight = envs, weight
        self.columns: Columns | None = None
        units = sp.scenario(envs)["allies"]
        self.healers = np.array([unit["healer"] for unit in units])
        self.others = policy(envs, "nearest")

    def __call__(self, batch: sp.Batch) -> NDArray[np.int32]:
        places, health, alive = self.read(batch.snapshot)
        n = len(self.healers)
        gaps = places[:, None, n:] - places[:, :n, None]  # [M, A, enemies, 2]
        distance = np.hypot(gaps[..., 0], gaps[..., 1])
        cost = self.weight * health[:, None, n:] + (1 - self.weight) * distance
        target = self.targets(np.where(alive[:, None, n:], cost, np.inf), health[:, n:], alive)
        gap = np.take_along_axis(gaps, target[..., None, None], 2)[:, :, 0]
        actions = attack_or_approach(target, gap, batch.avail_actions)
        return np.where(self.healers, self.others(batch), actions).astype(np.int32)

    def targets(
        self, cost: NDArray[np.float64], _health: NDArray[np.float64], _alive: NDArray[np.bool_]
    ) -> NDArray[np.intp]:
        """The enemy of each agent, [M, A]."""
        chosen: NDArray[np.intp] = np.argmin(cost, 2)
        return chosen

    def read(self, snapshots: NDArray[np.uint8]) -> tuple[NDArray[Any], ...]:
        columns = self.columns = self.columns or Columns(snapshots[0])
        return tuple(columns.read(snapshots, name) for name in ("pos", "hp", "alive"))


class FocusFire(Hybrid):
    """The team shares out the enemies, the weakest first: agents in their order get the current one, until
    the damage of their weapons is its health; then the next. When all are shared out, agents attack the
    closest."""

    DAMAGE: ClassVar = {
        "MARINE": 6,
        "MARAUDER": 10,
        "STALKER": 13,
        "ZEALOT": 8,
        "COLOSSUS": 10,
        "HYDRALISK": 12,
        "ZERGLING": 5,
        "BANELING": 16,
    }
    """Of the script's own table; 6 for others."""

    def __init__(self, envs: sp.Envs) -> None:
        super().__init__(envs, 0.0)
        names = [unit["unit_type"].upper() for unit in sp.scenario(envs)["allies"]]
        self.damage = np.array([self.DAMAGE.get(name, 6) for name in names], float)

    def targets(
        self, cost: NDArray[np.float64], health: NDArray[np.float64], alive: NDArray[np.bool_]
    ) -> NDArray[np.intp]:
        chosen: NDArray[np.intp] = np.argmin(cost, 2)
        n = len(self.healers)
        order = np.where(alive[:, n:], health, np.inf).argsort(1, kind="stable")
        n_living = alive[:, n:].sum(1)
        rows = np.arange(len(order))
        place, dealt = np.zeros(len(order), int), np.zeros(len(order))
        for agent in np.flatnonzero(~self.healers):
            acts = alive[:, agent] & (place < n_living)
            current = order[rows, np.minimum(place, order.shape[1] - 1)]
            chosen[acts, agent] = current[acts]
            dealt[acts] += self.damage[agent]
            done = acts & (dealt >= health[rows, current])
            place[done] += 1
            dealt[done] = 0
        return chosen


def attack_or_approach(
    target: NDArray[np.intp], gap: NDArray[np.float32], avail: NDArray[np.bool_]
) -> NDArray[np.int32]:
    """Attacks what is in reach; otherwise a step along the longer axis, or else the other, or else
    anything."""
    attack = FIRST_TARGET + target
    x = np.where(gap[..., 0] > 0, EAST, WEST)
    y = np.where(gap[..., 1] > 0, NORTH, SOUTH)
    x_first = np.abs(gap[..., 0]) > np.abs(gap[..., 1])
    wanted = np.stack([attack, np.where(x_first, x, y), np.where(x_first, y, x)], -1)
    allowed = np.take_along_axis(avail, wanted, 2)
    best = np.take_along_axis(wanted, allowed.argmax(2)[..., None], 2)[..., 0]
    instead = np.where(avail[..., STOP], STOP, avail.argmax(-1))
    return np.where(allowed.any(2), best, instead).astype(np.int32)


SCRIPTS: dict[str, Callable[[sp.Envs], Actor]] = {
    "attack_closest": lambda envs: Hybrid(envs, 0.0),
    "attack_weakest": lambda envs: Hybrid(envs, 1.0),
    "focus_fire": lambda envs: FocusFire(envs),
    "hybrid_attack_heal": lambda envs: Hybrid(envs, 0.5),
}
"""Those of SCMM that can be written for steps of 8 loops and walks in four directions."""
