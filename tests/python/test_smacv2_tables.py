"""SMACv2's interface: its tables, names of features, and what `capability_config` becomes."""

from __future__ import annotations

import copy
import inspect
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp
from smaclite_pool.marl import smacv2
from smaclite_pool.marl.smacv2 import StarCraft2Env, Unavailable
from smaclite_pool.marl.smacv2.names import FeatureNames
from smaclite_pool.marl.smacv2.scenario import scenario_of

from conftest import REPOSITORY
from smacv2_kit import RACES, SMACV2_DEFAULTS, UNIFORM, standard

# --- Names and tables


def test_the_map_table_of_smacv2() -> None:
    names = list(smacv2.get_smac_map_registry())
    assert len(names) == 26 and names[:4] == ["10gen_terran", "10gen_zerg", "10gen_protoss", "3m"]
    params = smacv2.get_map_params("10gen_zerg")
    assert (params["a_race"], params["b_race"], params["map_type"]) == ("Z", "Z", "zerg_gen")
    assert (params["limit"], params["unit_type_bits"], params["map_name"]) == (200, 3, "32x32_flat")
    found = {
        name: smacv2.map_param_registry[name] for name in ("MMM2", "3s_vs_5z", "2s_vs_1sc", "bane_vs_bane")
    }
    sizes = {
        name: (p["n_agents"], p["n_enemies"], p["limit"], p["unit_type_bits"]) for name, p in found.items()
    }
    assert sizes == {
        "MMM2": (10, 12, 180, 3), "3s_vs_5z": (3, 5, 250, 0), "2s_vs_1sc": (2, 1, 300, 0),
        "bane_vs_bane": (24, 24, 200, 2),
    }  # fmt: skip
    races = {name: (p["a_race"], p["b_race"], p["map_type"]) for name, p in found.items()}
    assert races == {
        "MMM2": ("T", "T", "MMM"), "3s_vs_5z": ("P", "P", "stalkers"), "2s_vs_1sc": ("P", "Z", "stalkers"),
        "bane_vs_bane": ("Z", "Z", "bane"),
    }  # fmt: skip
    with pytest.raises(sp.errors.InvalidRequest, match="got '10gen_tosh'"):
        smacv2.get_map_params("10gen_tosh")


def test_takes_every_option_of_smacv2_with_its_default() -> None:
    parameters = inspect.signature(StarCraft2Env).parameters.values()
    ours = {p.name: p.default for p in parameters if p.kind is not p.KEYWORD_ONLY}
    assert ours == SMACV2_DEFAULTS


FLAGS = {
    "conic_fov": False, "obs_all_health": True, "obs_own_health": True, "obs_last_action": False,
    "obs_pathing_grid": False, "obs_terrain_height": False, "obs_own_pos": True, "obs_starcraft": True,
    "obs_timestep_number": False, "state_last_action": True, "state_timestep_number": False,
    "num_fov_actions": 12, "obs_instead_of_state": False,
}  # fmt: skip

# By race, and size of the teams: actions, and sizes of observation and state; then the same with 12 looks.
SIZES = {
    ("protoss", 5, 5): (11, 92, 130, 23, 94, 200), ("terran", 5, 5): (11, 82, 120, 23, 84, 190),
    ("zerg", 10, 10): (16, 162, 290, 28, 164, 430), ("protoss", 10, 11): (17, 191, 327, 29, 193, 467),
    ("terran", 20, 20): (26, 322, 780, 38, 324, 1060), ("zerg", 20, 23): (29, 346, 858, 41, 348, 1138),
}  # fmt: skip


def names_of(race: str, n_units: int, n_enemies: int, n_actions: int, **options: Any) -> FeatureNames:
    config = {name: options.pop(name) for name in ("attack", "health") if name in options}
    scenario = scenario_of(f"10gen_{race}", standard(race, n_units, n_enemies, **config), FLAGS | options)
    return FeatureNames(scenario, n_actions)


@pytest.mark.parametrize(("race", "n_units", "n_enemies"), SIZES)
def test_names_are_as_many_as_features(race: str, n_units: int, n_enemies: int) -> None:
    n_actions, obs, state, with_looks, wide_obs, wide_state = SIZES[race, n_units, n_enemies]
    plain = names_of(race, n_units, n_enemies, n_actions)
    assert (len(plain.observation()), len(plain.state())) == (obs, state)
    cones = names_of(race, n_units, n_enemies, with_looks, conic_fov=True)
    assert (len(cones.observation()), len(cones.state())) == (wide_obs, wide_state)
    assert len(set(plain.observation())) == obs and len(set(cones.state())) == wide_state


def test_names_of_one_unit_with_everything() -> None:
    everything = dict.fromkeys(
        ["obs_last_action", "obs_pathing_grid", "obs_terrain_height", "obs_timestep_number", "conic_fov"],
        True,
    )
    names = names_of("protoss", 2, 1, 20, attack=UNIFORM, health=UNIFORM, **everything)
    bits = [f"enemy_unit_type_0_bit_{bit}" for bit in range(3)]
    enemy = ["enemy_shootable_0", "enemy_distance_0", "enemy_relative_x_0", "enemy_relative_y_0"]
    assert names.seen_enemy(0) == [*enemy, "enemy_health_0", "enemy_shield_0", *bits]
    ally = ["ally_visible_1", "ally_distance_1", "ally_relative_x_1", "ally_relative_y_1", "ally_health_1"]
    ally += ["ally_shield_1", "ally_attack_prob_1", "ally_health_level_1"]
    ally += [f"ally_unit_type_1_bit_{bit}" for bit in range(3)]
    ally += [f"ally_last_action_1_action_{action}" for action in range(20)]
    assert names.seen_ally(1) == ally
    own = ["own_health", "own_shield", "own_attack_prob", "own_health_level", "own_pos_x", "own_pos_y"]
    own += ["own_fov_x", "own_fov_y", *(f"own_unit_type_bit_{bit}" for bit in range(3))]
    assert names.own() == own
    moves = [f"move_action_{direction}" for direction in ("north", "south", "east", "west")]
    moves += [f"pathing_grid_{k}" for k in range(8)] + [f"terrain_height_{k}" for k in range(9)]
    assert names.observation() == [*moves, *names.seen_enemy(0), *ally, *own, "timestep"]
    state = ["ally_health_0", "ally_cooldown_0", "ally_relative_x_0", "ally_relative_y_0", "ally_shield_0"]
    state += ["ally_attack_prob_0", "ally_health_level_0", "ally_fov_x_0", "ally_fov_y_0"]
    assert names.ally(0) == state + [f"ally_unit_type_0_bit_{bit}" for bit in range(3)]
    attributes = ["health", "energy/cooldown", "rel_x", "rel_y", "shield", "fov_x", "fov_y"]
    attributes += ["attack_probability", "total_health", "type_0", "type_1", "type_2"]
    assert names.ally_attributes() == attributes
    open_loop = names_of("protoss", 2, 1, 7, obs_starcraft=False, obs_timestep_number=True)
    assert open_loop.observation() == ["timestep"]


# --- What `capability_config` becomes


def accepted(scenario: dict[str, Any], folder: Path) -> Any:
    """The scenario as its reader reads it."""
    path = folder / "scenario.json"
    path.write_text(json.dumps(scenario))
    return sp.scenario(path)


@pytest.mark.parametrize("race", RACES)
def test_the_standard_files_are_the_generated_scenarios(race: str, tmp_path: Path) -> None:
    ours = scenario_of(f"10gen_{race}", standard(race), {"use_unit_ranges": True, "obs_own_pos": True})
    folder = REPOSITORY / "scenarios" / "data"
    generated = json.loads((folder / f"{race}_5_vs_5.json").read_text())
    expected = {**generated, "smacv2": {**generated["smacv2"], "observe_team": True}}
    assert ours == expected
    assert accepted(ours, tmp_path) == sp.scenario(f"{race}_5_vs_5")


CONFIGS: list[tuple[dict[str, Any], dict[str, Any]]] = [
    (
        {"team_gen": {"dist_type": "all_teams", "unit_types": ["marine", "medivac"], "observe": False}},
        {"teams": {"distribution": "all_teams", "unit_types": ["MARINE", "MEDIVAC"]}},
    ),
    (
        {"team_gen": {"dist_type": "fixed", "items": [["marine"] * 5, ["marauder"] * 5], "test_mode": False}},
        {"teams": {"distribution": "fixed", "teams": [["MARINE"] * 5, ["MARAUDER"] * 5]}},
    ),
    (
        {"start_positions": {"dist_type": "reflect_position", "map_x": 32, "map_y": 32}},
        {"start_positions": {"distribution": "reflect_position"}},
    ),
    ({"start_positions": {"dist_type": "surrounded"}}, {"start_positions": {"distribution": "surrounded"}}),
]


@pytest.mark.parametrize(("tables", "expected"), CONFIGS)
def test_every_distribution_is_one_of_scenario_files(
    tables: dict[str, Any], expected: dict[str, Any], tmp_path: Path
) -> None:
    config = standard(**tables)
    before = copy.deepcopy(config)
    scenario = scenario_of("10gen_terran", config, {})
    assert {name: scenario[name] for name in expected} == expected
    assert scenario["smacv2"]["observe_team"] is config["team_gen"].get("observe", True)
    accepted(scenario, tmp_path)
    assert config == before  # SMACv2 writes into it


def test_capabilities_of_agents_are_options(tmp_path: Path) -> None:
    mask = {"dist_type": "mask", "mask_probability": 0.3}
    config = standard(attack=UNIFORM, health={**UNIFORM, "lower_bound": 0, "observe": False}, enemy_mask=mask)
    options = scenario_of("10gen_terran", config, {})["smacv2"]
    assert options["attack"] == {"lower_bound": 0.0, "upper_bound": 0.5, "observe": True}
    assert options["health"] == {"lower_bound": 0.0, "upper_bound": 0.5, "observe": False}
    assert options["enemy_mask"] == {"mask_probability": 0.3}
    accepted(scenario_of("10gen_terran", config, {}), tmp_path)


def test_without_start_positions_sides_start_on_one_point_each(tmp_path: Path) -> None:
    config = standard()
    del config["start_positions"]
    info = accepted(scenario_of("10gen_terran", config, {}), tmp_path)
    assert np.abs(np.mean([unit["position"] for unit in info["allies"]], axis=0) - [8, 16]).max() < 2
    assert np.abs(np.mean([unit["position"] for unit in info["enemies"]], axis=0) - [24, 16]).max() < 2


def teams(**table: Any) -> dict[str, Any]:
    return standard(
        team_gen={"dist_type": "weighted_teams", "unit_types": ["marine"], "weights": [1], **table}
    )


REFUSED: list[tuple[str, dict[str, Any], str]] = [
    ("10gen_terran", {**standard(), "n_units": 0}, "n_units must be an integer above 0, got 0"),
    ("10gen_terran", {**standard(), "speed": {}}, "got 'speed'"),
    ("10gen_terran", {"n_units": 5, "n_enemies": 5}, "10gen_terran needs team_gen"),
    ("10gen_terran", standard(team_gen=["marine"]), "team_gen must be a table"),
    (
        "10gen_terran",
        teams(dist_type="weighted"),
        "dist_type must be one of weighted_teams, .*, got 'weighted'",
    ),
    ("10gen_terran", teams(dist_type="mask"), "dist_type must be one of weighted_teams"),
    ("10gen_terran", teams(unit_types=["zealot"]), "must be marine, marauder, medivac, got 'zealot'"),
    ("10gen_terran", teams(unit_types="marine"), "list of names"),
    (
        "10gen_terran",
        teams(dist_type="fixed", items=[["marine"] * 5], test_mode=True),
        "test_mode must be False",
    ),
    ("10gen_terran", standard(team_gen={"dist_type": "all_teams"}), "team_gen: all_teams needs 'unit_types'"),
    ("10gen_terran", standard(start_positions={"dist_type": "surrounded", "map_x": 64}), "map_x must be 32"),
    ("10gen_terran", standard(attack={**UNIFORM, "lower_bound": [0, 1]}), "attack: lower_bound must be one"),
    ("MMM2", standard(), "team_gen needs a generated map"),
    ("MMM2", {"n_units": 9}, "n_units of MMM2 must be 10, got 9"),
    ("terran_5_vs_5", {}, "map_name must be one of 10gen_terran"),
]


@pytest.mark.parametrize(("map_name", "config", "message"), REFUSED)
def test_what_is_refused_says_why(map_name: str, config: dict[str, Any], message: str) -> None:
    with pytest.raises((sp.errors.InvalidRequest, Unavailable), match=message):
        scenario_of(map_name, config, {})


def test_keys_without_an_effect_are_logged(caplog: pytest.LogCaptureFixture) -> None:
    scenario_of("10gen_terran", standard(), {})
    assert not caplog.messages
    scenario_of("10gen_terran", teams(exeption_unit_types=["marine"]), {})
    assert caplog.messages == ["team_gen: key 'exeption_unit_types' of weighted_teams has no effect"]


def test_distributions_of_forks() -> None:
    """Forks copy the wrapper, which makes distributions and hands what they draw to the environment."""
    made = smacv2.get_distribution("weighted_teams")({"env_key": "team_gen", "dist_type": "weighted_teams"})
    assert isinstance(made, smacv2.Distribution) and list(made.generate()) == ["team_gen"]
    with pytest.raises(sp.errors.InvalidRequest, match="got 'mine'"):
        smacv2.get_distribution("mine")
    own = type("Own", (smacv2.Distribution,), {})
    smacv2.register_distribution("mine", own)
    assert smacv2.get_distribution("mine") is own
    with pytest.raises(Unavailable, match="got 'mine'"):
        scenario_of("10gen_terran", teams(dist_type="mine"), {})
