"""SMAC's reward options, computed from the reward and the state of the pool."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..._layout import Floats, ScenarioLayout
from ..._native import KILL_REWARD, REWARD_SCALE, WIN_REWARD
from ...errors import InvalidRequest, PoolError
from ...types import UnitStats

__all__ = ["HealthTotals", "Reward", "RewardOptions", "Unavailable"]


class Unavailable(PoolError, NotImplementedError):
    """An option of SMAC that has no meaning here or needs data that the pool does not have.

    The message gives the reason.
    """


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


class HealthTotals(NamedTuple):
    """Health plus shield of all units between two steps, in points; 0 for the dead."""

    allies: Floats
    """float32 [A]."""
    enemies: Floats
    """float32 [E]."""

    def deaths(self, before: HealthTotals) -> tuple[int, Floats]:
        """The number of allies that died since `before`, and 1 or 0 for each enemy, float32 [E]."""
        allies = int(np.count_nonzero((before.allies > 0) & (self.allies == 0)))
        return allies, ((before.enemies > 0) & (self.enemies == 0)).astype(np.float32)


class Reward:
    """The reward of a step with these options.

    The reward of the pool is

        REWARD_SCALE * (damage + KILL_REWARD * kills + WIN_REWARD if won) / its maximum.

    Damage to enemies comes from this reward, which never subtracts what enemies regain; so rewards with
    another `scale_rate` or `win` stay proportional to the default ones. Damage to allies, which only
    `only_positive=False` needs, is computed as in SMAC: their health and shields before the step minus those
    after it.
    """

    def __init__(self, layout: ScenarioLayout, options: RewardOptions) -> None:
        health = sum(unit["hp"] + unit["shield"] for unit in layout.enemies)
        targeters = [unit["targeter"] for unit in layout.enemies]
        self._options = options
        self._is_default = options == RewardOptions()
        self._points_per_reward = (KILL_REWARD * layout.n_enemies + WIN_REWARD + health) / REWARD_SCALE
        self._self_destructs = np.array([targeter == "KAMIKAZE" for targeter in targeters])
        self._kills_are_deaths = not {"KAMIKAZE", "HEAL"} & set(targeters)
        self.max_reward: float = options.death_value * layout.n_enemies + options.win + health
        """The maximum return before scaling, as SMAC counts it."""
        self._check(layout)

    def _check(self, layout: ScenarioLayout) -> None:
        options = self._options
        if options.scale and (self.max_reward <= 0 or options.scale_rate == 0):
            raise InvalidRequest(
                f"reward_scale divides by {self.max_reward} / {options.scale_rate}: reward_win, "
                "reward_death_value and reward_scale_rate must be above 0, or reward_scale False"
            )
        allies_hidden = _hides_shields(layout.allies, layout.shield_bits_ally)
        enemies_hidden = _hides_shields(layout.enemies, layout.shield_bits_enemy)
        if not options.sparse and not options.only_positive and allies_hidden:
            raise Unavailable(
                "reward_only_positive=False needs the shields of the allies, which the scenario hides "
                "(ally_has_shields is false)"
            )
        changes_kills = not options.sparse and options.death_value != KILL_REWARD
        if changes_kills and enemies_hidden and not self._kills_are_deaths:
            raise Unavailable(
                f"reward_death_value={options.death_value} needs the shields of the enemies, as some of them "
                "heal or destroy themselves, but the scenario hides shields (enemy_has_shields is false)"
            )

    def __call__(
        self, pool_reward: float, ended: bool, won: bool, before: HealthTotals, after: HealthTotals
    ) -> float:
        """The reward of a step that led from `before` to `after` and has `pool_reward` in the pool."""
        if self._is_default:
            return pool_reward
        options = self._options
        if options.sparse:
            reward = 1.0 if won else -1.0 if ended else 0.0
        else:
            earned = pool_reward * self._points_per_reward - (WIN_REWARD if won else 0.0)
            dead_allies, dead_enemies = after.deaths(before)
            reward = earned
            if options.death_value != KILL_REWARD:
                lost = float(np.sum(before.enemies - after.enemies))
                reward += (options.death_value - KILL_REWARD) * self._kills(earned - lost, dead_enemies)
            if not options.only_positive:
                damage = float(np.sum(before.allies - after.allies))
                reward -= options.negative_scale * (damage + options.death_value * dead_allies)
            reward += options.win if won else options.defeat if ended else 0.0
        return reward * options.scale_rate / self.max_reward if options.scale else reward

    def _kills(self, excess: float, dead: Floats) -> float:
        """The number of kills that the pool rewarded.

        A unit that destroys itself dies without a reward, and a unit that is healed in the tick of its kill
        stays alive although the kill was rewarded. If there are such enemies, the kills follow from the
        excess of the points earned over the health lost: each kill accounts for KILL_REWARD, and the rest,
        which is less per step, is what enemies regained.
        """
        if self._kills_are_deaths:
            return float(dead.sum())
        killed = float(dead[~self._self_destructs].sum())
        return max(killed, float(np.floor(excess / KILL_REWARD + 0.01)))  # 0.01: the features are rounded


def _hides_shields(side: list[UnitStats], shield_bits: int) -> bool:
    """Whether a side has shields that observations and state do not contain."""
    return not shield_bits and any(unit["shield"] for unit in side)
