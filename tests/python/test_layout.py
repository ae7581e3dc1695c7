"""Constants and layouts of the native module, compared with what the engine writes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp
from smaclite_pool import _native
from smaclite_pool._layout import Floats, ScenarioLayout
from smaclite_pool._units import UnitsView

SCENARIOS = ["2s3z", "MMM2", "bane_vs_bane", "3s_vs_5z"]


def played(scenario: str) -> list[dict[str, Any]]:
    """Copies of the batches of one battle with random available actions, and the actions that led to each."""
    with sp.make(scenario, 1, seed=3, autoreset_mode="Disabled") as envs:
        envs.seed_sampler(1)
        batches: list[dict[str, Any]] = [{**envs.reset().copy(), "actions": None}]
        while not (batches[-1]["terminated"][0] or batches[-1]["truncated"][0]):
            actions = envs.sample_actions()
            batches.append({**envs.step(actions).copy(), "actions": actions[0]})
    return batches


def test_the_hash_tells_scenarios_apart_by_all_that_is_played(tmp_path: Path) -> None:
    """That of the learners in PyTorch left out damage, rewards and opponents."""
    repository = Path(__file__).parents[2]
    unit = json.loads((repository / "units/data/MARINE.json").read_text())
    scenario = json.loads((repository / "scenarios/data/3m.json").read_text())
    scenario["custom_unit_path"] = "."
    for group in scenario["groups"]:
        group["units"] = {"SOLDIER": 3}

    def hash_of(of_unit: dict[str, Any], of_scenario: dict[str, Any]) -> str:
        (tmp_path / "SOLDIER.json").write_text(json.dumps(unit | of_unit))
        (tmp_path / "own.json").write_text(json.dumps(scenario | of_scenario))
        return sp.scenario(tmp_path / "own.json")["hash"]

    same = hash_of({}, {})
    changes: list[tuple[dict[str, Any], dict[str, Any]]] = [
        ({"damage": unit["damage"] + 1}, {}),
        ({"speed": unit["speed"] + 1}, {}),
        ({}, {"rewards": {"reward_win": 1}}),
        ({}, {"opponent": "attack_nearest"}),
    ]
    hashes = {hash_of(*change) for change in changes}
    assert len(hashes | {same}) == 5 and same == hash_of({}, {}) and len(same) == 16


@pytest.mark.parametrize("scenario", sp.scenarios())
def test_the_blocks_cover_observations_and_state(scenario: str) -> None:
    info = sp.scenario(scenario)
    with sp.make(scenario, 1) as envs:
        obs_size, state_size = envs.spec.obs_size, envs.spec.state_size
        n_actions = envs.spec.n_actions
    for blocks, size in ((info["obs_layout"], obs_size), (info["state_layout"], state_size)):
        end = 0
        for block in blocks:
            assert block["start"] == end and block["shape"][-1] == len(block["features"]), block["name"]
            end += int(np.prod(block["shape"]))
        assert end == size
    assert len(info["state_layout"][-1]["features"]) == n_actions
    assert info["state_layout"][-1]["features"][_native.FIRST_TARGET] == "target_0"


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_the_features_of_the_state_are_those_that_the_engine_writes(scenario: str) -> None:
    layout, batches = ScenarioLayout(scenario), played(scenario)
    units = UnitsView(layout)
    first = batches[0]["state"][0]
    units.update(first)
    for index, start in enumerate(layout.allies + layout.enemies):
        unit = units.unit(index)
        assert np.allclose(unit.pos, start["position"], atol=1e-5)
        assert unit.health == start["hp"] and (unit.owner == 1) == (index < layout.n_agents)
    for side, described in ((layout.state.allies, layout.allies), (layout.state.enemies, layout.enemies)):
        for bit in range(layout.type_bits):
            expected = [unit["type_id"] == bit for unit in described]
            np.testing.assert_array_equal(side.column(first, f"type_{bit}"), expected)
    for batch in batches[1:]:
        last_action = layout.state.last_action.view(batch["state"][0])
        np.testing.assert_array_equal(last_action.argmax(axis=1), batch["actions"])
        assert np.all(last_action.sum(axis=1) == 1)
    alive = layout.state.allies.column(batches[-1]["state"][0], "health") > 0
    np.testing.assert_array_equal(alive, batches[-1]["alive"][0])
    assert not alive.all()


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_the_features_of_observations_are_those_that_the_engine_writes(scenario: str) -> None:
    layout = ScenarioLayout(scenario)
    units, n_agents = UnitsView(layout), layout.n_agents
    seen = 0
    for batch in played(scenario):
        obs: Floats = batch["obs"][0]
        available, alive = batch["avail_actions"][0], batch["alive"][0]
        units.update(batch["state"][0])
        moves = available[:, _native.NORTH : _native.FIRST_TARGET]
        np.testing.assert_array_equal(layout.obs.moves.view(obs), moves)
        assert layout.obs.moves.features == ["north", "south", "east", "west"]
        own_health = layout.obs.own.column(obs, "health")
        np.testing.assert_allclose(own_health, (units.health / units.health_max)[:n_agents], atol=1e-6)
        for agent in np.flatnonzero(alive):
            for block, first in ((layout.obs.allies, 0), (layout.obs.enemies, n_agents)):
                others = [i for i in range(first, first + n_agents) if i != agent]
                if block is layout.obs.enemies:
                    others = list(range(n_agents, n_agents + layout.n_enemies))
                offset = units.positions[others] - units.positions[agent]
                offset /= units.stats[agent]["sight_range"]
                visible = block.column(obs[agent], "health") > 0
                seen += int(visible.sum())
                distance = np.hypot(offset[:, 0], offset[:, 1])
                np.testing.assert_array_equal(visible, (distance < 1) & (units.health[others] > 0))
                for feature, expected in (("distance", distance), ("dx", offset[:, 0]), ("dy", offset[:, 1])):
                    written = block.column(obs[agent], feature)
                    np.testing.assert_allclose(written[visible], expected[visible], atol=1e-5)
                    assert not written[~visible].any()
    assert seen > 0


def test_action_numbers_and_the_targeting_range() -> None:
    """Moves change the position as their names say, and targets are available up to the targeting range."""
    with sp.make("3s_vs_5z", 1, autoreset_mode="Disabled") as envs:
        layout = ScenarioLayout("3s_vs_5z")
        steps = {_native.NORTH: (0, 1), _native.SOUTH: (0, -1), _native.EAST: (1, 0), _native.WEST: (-1, 0)}
        for action, direction in steps.items():
            before, after = UnitsView(layout), UnitsView(layout)
            before.update(envs.reset(seed=1).state[0])
            after.update(envs.step([[action] * 3]).state[0])
            moved = after.positions[:3] - before.positions[:3]
            assert np.all(moved @ np.array(direction) > 0.5), action
        with pytest.raises(sp.errors.IllegalAction):
            envs.step([[_native.NO_OP] * 3])
        envs.step([[_native.STOP] * 3])
    targets = 0
    for batch in played("3s_vs_5z"):
        units = UnitsView(layout)
        units.update(batch["state"][0])
        for agent in np.flatnonzero(batch["alive"][0]):
            offset = units.positions[3:] - units.positions[agent]
            near = np.hypot(offset[:, 0], offset[:, 1]) <= units.stats[agent]["targeting_range"]
            available = batch["avail_actions"][0, agent, _native.FIRST_TARGET :]
            np.testing.assert_array_equal(available, near & (units.health[3:] > 0))
            targets += int(available.sum())
    assert targets > 0
