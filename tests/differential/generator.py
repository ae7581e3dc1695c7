"""Random scenarios: a seed gives invented units, terrain, groups and flags.

Left out is what differs from the published environment on purpose (docs/concepts/fidelity.md): units in plane
`COLOSSUS`, maps that are not square, and agents' healers that the published environment has no action
indices for.
"""

from __future__ import annotations

import random

from .scenarios import PUBLISHED_TERRAINS, PUBLISHED_UNITS, Json, ScenarioFiles, count_units

ATTRIBUTES = ["LIGHT", "ARMORED", "MASSIVE", "BIOLOGICAL", "MECHANICAL", "PSIONIC", "STRUCTURE", "HEROIC"]
SHIELDED = {"COLOSSUS", "STALKER", "ZEALOT"}
PRESET_SIDE = 32
"""Width and height of the preset terrains."""


def random_scenario(seed: int) -> ScenarioFiles:
    """The random scenario of that seed."""
    rng = random.Random(seed)
    units: dict[str, Json] = {}
    if rng.random() < 0.6:
        units = {f"type{seed}x{i}": random_unit(rng) for i in range(rng.randint(1, 3))}
    files = ScenarioFiles(f"random{seed}", {"name": f"random{seed}"}, units)
    scenario = files.scenario
    side = PRESET_SIDE
    if rng.random() < 0.4:
        scenario["terrain_preset"] = rng.choice(PUBLISHED_TERRAINS)
    else:
        side = rng.choice([24, 32, 32, 32, 40])
        scenario.update(terrain=random_terrain(rng, side), width=side, height=side)
    allies = [random_group(rng, files, "ALLY", side) for _ in range(rng.randint(1, 3))]
    enemies = [random_group(rng, files, "ENEMY", side) for _ in range(rng.randint(1, 3))]
    limit_healers(files, allies, enemies)
    part_groups(allies + enemies)
    scenario["groups"] = ordered_groups(rng, allies, enemies)
    count_units(scenario)
    scenario["attack_point"] = attack_point(rng, allies, side)
    used = list(dict.fromkeys(unit for group in scenario["groups"] for unit in group["units"]))
    scenario["num_unit_types"] = len(used) if rng.random() < 0.7 else 0
    if scenario["num_unit_types"]:
        scenario["unit_type_ids"] = {unit: i for i, unit in enumerate(used)}
    for key, groups in (("ally_has_shields", allies), ("enemy_has_shields", enemies)):
        kinds = {unit for group in groups for unit in group["units"]}
        scenario[key] = all(unit in SHIELDED or "shield" in units.get(unit, {}) for unit in kinds)
    return files


def random_unit(rng: random.Random) -> Json:
    """A unit file."""
    planes = ["GROUND"] * 4 + ["AIR"] * 2
    targets = [["GROUND", "AIR"]] * 5 + [["GROUND"], ["AIR"]]
    unit: Json = {
        "hp": rng.choice([20, 45, 60, 100, 150]),
        "armor": rng.choice([0, 0, 1, 2]),
        "speed": rng.choice([0, 2.25, 3.15, 3.5, 4.5]),
        "attack_range": rng.choice(["MELEE", 0.25, 2, 4.5, 6]),
        "size": rng.choice([0.4, 0.75, 1, 1.5, 2]),
        "attributes": rng.sample(ATTRIBUTES, rng.randint(0, 3)),
        "plane": rng.choice(planes),
        "valid_targets": rng.choice(targets),
    }
    if rng.random() < 0.4:
        unit["shield"] = rng.choice([10, 50, 80])
    if rng.random() < 0.3:
        unit["hp_regen"] = rng.choice([0.27, 1.0])
    if rng.random() < 0.5:
        unit["minimum_scan_range"] = rng.choice([5, 7, 9])
    unit.update(random_healer(rng) if rng.random() < 0.15 else random_attacker(rng))
    return unit


def random_healer(rng: random.Random) -> Json:
    return {
        "combat_type": "HEALING",
        "targeter": "HEAL",
        "damage": 0,
        "cooldown": 0,
        "energy": 200,
        "starting_energy": rng.choice([4, 20, 50]),
        "attack_range": rng.choice([2, 4]),
    }


def random_attacker(rng: random.Random) -> Json:
    unit: Json = {
        "damage": rng.choice([5, 8, 10, 20]),
        "cooldown": rng.choice([0.5, 0.61, 1.0, 1.86]),
        "attacks": rng.choice([1, 1, 2]),
    }
    if rng.random() < 0.4:
        unit["bonuses"] = {name: rng.choice([2, 5, 10]) for name in rng.sample(ATTRIBUTES, rng.randint(1, 2))}
    kind = rng.random()
    if kind < 0.15:
        unit.update(targeter="KAMIKAZE", targeter_kwargs={"radius": rng.choice([1.2, 2.2])})
    elif kind < 0.35:
        beam = {"width": rng.choice([2.8, 4]), "height": rng.choice([0.3, 1])}
        unit.update(targeter="LASER_BEAM", targeter_kwargs=beam)
    return unit


def random_terrain(rng: random.Random, side: int) -> list[str]:
    """A square map: with or without a border, blocked rectangles or scattered blocked squares."""
    rows = [["_"] * side for _ in range(side)]
    if rng.random() < 0.5:
        for i in range(side):
            rows[0][i] = rows[-1][i] = rows[i][0] = rows[i][-1] = "X"
    if rng.random() < 0.7:
        for _ in range(rng.randint(0, 9)):
            width, height = rng.randint(1, 5), rng.randint(1, 5)
            west, south = rng.randint(6, side - 7), rng.randint(2, side - 4)
            for row in rows[south : south + height]:
                row[west : west + width] = "X" * len(row[west : west + width])
    else:
        for row in rows:
            for x in range(6, side - 6):
                if rng.random() < 0.04:
                    row[x] = "X"
    return ["".join(row) for row in rows]


def random_group(rng: random.Random, files: ScenarioFiles, faction: str, side: int) -> Json:
    """A group of up to three types; invented types are likelier than standard ones."""
    invented = list(files.units)
    if invented and rng.random() < 0.7:
        kinds = list(dict.fromkeys(rng.choice(PUBLISHED_UNITS + invented * 3) for _ in range(2)))
    else:
        kinds = rng.sample(PUBLISHED_UNITS + invented, rng.randint(1, 3))
    kinds.sort(key=files.heals)  # the published environment counts on healers being last
    # Five units of the greatest size side by side stay on the map.
    west, east = (5.5, 9.5) if faction == "ALLY" else (13, side - 5.5)
    return {
        "x": quarter(rng.uniform(west, east)),
        "y": quarter(rng.uniform(6, side - 6)),
        "faction": faction,
        "units": {unit: rng.randint(1, 2 if files.heals(unit) else 6) for unit in kinds},
    }


def ordered_groups(rng: random.Random, allies: list[Json], enemies: list[Json]) -> list[Json]:
    """All groups, sometimes with the two sides in random order among each other."""
    sides = ["ALLY"] * len(allies) + ["ENEMY"] * len(enemies)
    if rng.random() < 0.5:
        rng.shuffle(sides)
    left = {"ALLY": iter(allies), "ENEMY": iter(enemies)}
    return [next(left[faction]) for faction in sides]


def limit_healers(files: ScenarioFiles, allies: list[Json], enemies: list[Json]) -> None:
    """Leaves the agents the healers that the published environment has action indices for: they must have the
    highest ids, and be one at most unless there are as many enemies as agents."""
    allies.sort(key=lambda group: any(files.heals(unit) for unit in group["units"]))
    for group in allies[:-1]:
        fighters = {unit: count for unit, count in group["units"].items() if not files.heals(unit)}
        group["units"] = fighters or {"MARINE": 2}
    n_agents, n_enemies = (sum(sum(group["units"].values()) for group in side) for side in (allies, enemies))
    last = allies[-1]["units"]
    healers = [unit for unit in last if files.heals(unit)]
    if healers and n_enemies < n_agents:
        for unit in healers[1:]:
            del last[unit]
        last[healers[0]] = 1


def part_groups(groups: list[Json]) -> None:
    """Shifts groups near another one a little: no unit of a scenario file may start on the point of another.

    Without it all starts are on a grid of 1/80, and units of several groups are often equally near.
    """
    for index, group in enumerate(groups):
        ways = [(abs(group["x"] - other["x"]), abs(group["y"] - other["y"])) for other in groups[:index]]
        if any(max(way) < 11 for way in ways):
            group["y"] += 0.003 * index


def attack_point(rng: random.Random, allies: list[Json], side: int) -> list[float]:
    """Where the enemies march to: mostly a group of the agents."""
    if rng.random() < 0.75:
        return [allies[0]["x"], allies[0]["y"]]
    return [quarter(rng.uniform(2, side - 2)), quarter(rng.uniform(2, side - 2))]


def quarter(x: float) -> float:
    """Rounds to a quarter of a square: on such a grid units are often equally near."""
    return round(x * 4) / 4
