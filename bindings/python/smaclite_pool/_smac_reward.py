"""SMAC's reward options over the pool's reward. What the options are called and default to is in `smac`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ._layout import Floats, ScenarioLayout
from .errors import InvalidRequest, PoolError

# The pool's reward of a step is POOL_RATE * (damage + POOL_KILL * kills + POOL_WIN if won) / the most of it there is.
POOL_RATE, POOL_KILL, POOL_WIN = 20.0, 10.0, 200.0


class Unavailable(PoolError, NotImplementedError):
    """Something of SMAC that has no meaning here, or needs what this pool does not tell; the message says why."""


@dataclass(frozen=True)
class RewardOptions:
    """SMAC's reward options, without their prefix `reward_`."""

    sparse: bool = False
    only_positive: bool = True
    death_value: float = 10
    win: float = 200
    defeat: float = 0
    negative_scale: float = 0.5
    scale: bool = True
    scale_rate: float = 20


class Toll(NamedTuple):
    """How both sides stand between two steps."""

    ally_health: Floats
    """[A]: health and shield in points; 0 for the dead."""
    enemy_health: Floats
    """[E]: the same of the enemies."""

    def deaths(self, before: Toll) -> tuple[int, Floats]:
        """How many allies died since `before`, and which enemies did, 1 or 0 each."""
        allies = int(np.count_nonzero((before.ally_health > 0) & (self.ally_health == 0)))
        return allies, ((before.enemy_health > 0) & (self.enemy_health == 0)).astype(np.float32)


class Reward:
    """The reward of a step by these options.

    Damage done to enemies is the pool's own figure, which never subtracts what enemies regain; so with another
    `scale_rate` or `win` rewards stay proportional to the default ones. Damage taken by allies, which only
    `only_positive=False` asks for, is what SMAC takes: their health and shields before the step less those after it.
    """

    def __init__(self, layout: ScenarioLayout, options: RewardOptions) -> None:
        points = [unit["hp"] + unit["shield"] for unit in layout.enemy_figures]
        kinds = [unit["targeter"] for unit in layout.enemy_figures]
        self._options = options
        self._is_default = options == RewardOptions()
        self._pool_unit = (POOL_KILL * layout.n_enemies + POOL_WIN + sum(points)) / POOL_RATE
        self._dies_by_itself = np.array([kind == "KAMIKAZE" for kind in kinds])
        self._kills_are_deaths = not {"KAMIKAZE", "HEAL"} & set(kinds)
        self.max_reward: float = options.death_value * layout.n_enemies + options.win + sum(points)
        """The most an episode can earn before scaling, as SMAC counts it."""
        self._check(layout)

    def _check(self, layout: ScenarioLayout) -> None:
        options = self._options
        if options.scale and (self.max_reward <= 0 or options.scale_rate == 0):
            raise InvalidRequest(
                f"reward_scale divides by {self.max_reward} / {options.scale_rate}: choose reward_win, "
                "reward_death_value and reward_scale_rate above 0, or reward_scale=False"
            )
        allies_hidden = hidden(layout.ally_figures, layout.shield_bits_ally)
        enemies_hidden = hidden(layout.enemy_figures, layout.shield_bits_enemy)
        if not options.sparse and not options.only_positive and allies_hidden:
            raise Unavailable(
                "reward_only_positive=False needs the allies' shields, and the scenario hides them "
                "(ally_has_shields is false)"
            )
        if not options.sparse and options.death_value != POOL_KILL and enemies_hidden and not self._kills_are_deaths:
            raise Unavailable(
                f"reward_death_value={options.death_value}: with enemies that heal or blow themselves up, kills are "
                "told from deaths by the enemies' shields, and the scenario hides them (enemy_has_shields is false)"
            )

    def __call__(self, pool_reward: float, over: bool, won: bool, before: Toll, after: Toll) -> float:
        """The reward of a step that the pool rewarded with `pool_reward` and that led from `before` to `after`."""
        if self._is_default:
            return pool_reward
        options = self._options
        if options.sparse:
            reward = 1.0 if won else -1.0 if over else 0.0
        else:
            earned = pool_reward * self._pool_unit - (POOL_WIN if won else 0.0)
            dead_allies, dead_enemies = after.deaths(before)
            reward = earned
            if options.death_value != POOL_KILL:
                lost = float(np.sum(before.enemy_health - after.enemy_health))
                reward += (options.death_value - POOL_KILL) * self._kills(earned - lost, dead_enemies)
            if not options.only_positive:
                taken = float(np.sum(before.ally_health - after.ally_health))
                reward -= options.negative_scale * (taken + options.death_value * dead_allies)
            reward += options.win if won else options.defeat if over else 0.0
        return reward * options.scale_rate / self.max_reward if options.scale else reward

    def _kills(self, excess: float, dead: Floats) -> float:
        """How many kills were paid for.

        Who blows itself up dies unpaid, and a heal in the tick of the kill leaves a paid kill alive; so where there are
        such enemies, it is seen from what was earned beyond the health that was lost. Of that a kill is 10; the rest is
        what enemies regained, which in a step is less.
        """
        if self._kills_are_deaths:
            return float(dead.sum())
        killed = float(dead[~self._dies_by_itself].sum())
        return max(killed, float(np.floor(excess / POOL_KILL + 0.01)))  # 0.01: the figures are rounded


def hidden(figures: list[dict[str, object]], shown: int) -> bool:
    """Has a side shields that observations and state do not show?"""
    return not shown and any(unit["shield"] for unit in figures)
