"""A custom scenario, and single battles of all integrations, for several tests."""

from __future__ import annotations

from typing import Any

import pytest


def duel(allies: int = 2, unit: str = "ZEALOT", enemy_x: float = 12, name: str = "duel") -> dict[str, Any]:
    """A custom scenario: some allies of one unit type, and one enemy of the same type beside them."""
    return {
        "name": name,
        "num_allied_units": allies,
        "num_enemy_units": 1,
        "groups": [
            {"faction": "ALLY", "x": 9, "y": 16, "units": {unit: allies}},
            {"faction": "ENEMY", "x": enemy_x, "y": 16, "units": {unit: 1}},
        ],
        "attack_point": [9, 16],
        "terrain_preset": "SIMPLE",
        "num_unit_types": 0,
        "ally_has_shields": unit == "ZEALOT",
        "enemy_has_shields": unit == "ZEALOT",
    }


def battle_of(adapter: str, scenario: str, **options: Any) -> Any:
    """An environment of one battle, as an integration makes it."""
    if adapter == "gymnasium":
        return pytest.importorskip("smaclite_pool.integrations.gymnasium").BattleEnv(scenario, **options)
    if adapter == "rllib":
        pytest.importorskip("ray.rllib")
        rllib = pytest.importorskip("smaclite_pool.integrations.rllib")
        return rllib.BattleMultiAgentEnv({"scenario": scenario, **options})
    pytest.importorskip("pettingzoo")
    pettingzoo = pytest.importorskip("smaclite_pool.integrations.pettingzoo")
    return getattr(pettingzoo, adapter)(scenario, **options)
