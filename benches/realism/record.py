"""Records battles that a trained team plays in the pool, as those of the real game are recorded:

    python -m realism.record runs/3m FOLDER

What a rule set scores on recordings of its own, played again with other random numbers, says how much chance
alone takes from a perfect copy.
"""

from __future__ import annotations

import argparse
import gzip
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import smaclite_pool as sp

from .__main__ import count
from .columns import Columns
from .play import Actor
from .recordings import FIRST_TARGET, LOOPS, MOVES

KINDS = {number: kind for kind, number in MOVES.items()}
FIELDS = ["obs", "state", "avail_actions", "snapshot"]
ABILITIES = {"move": 42, "stop": 40, "attack": 45, "heal": 134}
"""Of the game's orders."""


def record(envs: sp.Envs, batch: sp.Batch, actor: Actor) -> list[dict[str, Any]]:
    """The battles of all environments, from this batch to their ends; it has all of `FIELDS`."""
    about = sp.scenario(envs)
    if about["teams_are_drawn"]:
        raise sp.errors.InvalidRequest(
            "recordings are of maps whose teams are fixed; those of this map are drawn"
        )
    healers = [unit["healer"] for unit in about["allies"]]
    columns = Columns(batch.snapshot[0])
    places = columns.read(batch.snapshot, "pos")
    battles = [new_battle(i, about, places[i]) for i in range(len(batch))]
    goes_on = np.ones(len(batch), bool)
    while goes_on.any():
        places, alive = (columns.read(batch.snapshot, name) for name in ("pos", "alive"))
        actions = actor(batch)
        batch = envs.step(actions)
        dead = alive & ~columns.read(batch.snapshot, "alive")
        for i in np.flatnonzero(goes_on):
            agents = np.flatnonzero(alive[i, : len(healers)])
            of_battle = [order(int(a), int(actions[i, a]), healers, places[i].tolist()) for a in agents]
            steps = battles[i]["steps"]
            steps.append([LOOPS * len(steps), of_battle])
            battles[i]["removed"] = steps[-1][0] + LOOPS + 1  # as SMAC does it
            for unit in np.flatnonzero(dead[i]):
                battles[i]["units"][unit]["died"] = LOOPS * len(steps)
        goes_on &= ~(batch.terminated | batch.truncated)
    return battles


def new_battle(number: int, about: Any, places: Any) -> dict[str, Any]:
    units = [(unit, 1) for unit in about["allies"]] + [(unit, 2) for unit in about["enemies"]]
    rows = [
        {
            "id": i,
            "type": unit["unit_type"] + ("_RL" if owner == 1 else ""),
            "owner": owner,
            "born_cell": [int(x) for x in places[i]],
            "died": None,
            "killer": None,
        }
        for i, (unit, owner) in enumerate(units)
    ]
    return {"battle": number, "removed": None, "units": rows, "steps": []}


def order(agent: int, action: int, healers: list[bool], places: list[list[float]]) -> list[Any]:
    if action in KINDS:
        return [agent, KINDS[action], ABILITIES["move"], *places[agent]]
    if action >= FIRST_TARGET:
        target = action - FIRST_TARGET + (0 if healers[agent] else len(healers))
        ability = ABILITIES["heal" if healers[agent] else "attack"]
        return [agent, "unit", ability, target, *places[target]]
    return [agent, "stop", ABILITIES["stop"]]


def write(recording: Any, path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(gzip.compress(json.dumps(recording).encode(), mtime=0))
    return path


def main(argv: list[str] | None = None) -> int:
    about = "Records battles that a trained team plays."
    parser = argparse.ArgumentParser("realism.record", description=about)
    add = parser.add_argument
    add("team", help="folder of a run of `smaclite-pool train`, or the name of a team of the zoo")
    add("folder", type=Path, help="folder of the recording, MAP.json.gz")
    add("--battles", type=count, default=40, help="default: 40")
    add("--seed", type=int, default=1, help="of the battles and of the team's actions (default: 1)")
    options = parser.parse_args(argv)
    try:
        team = sp.load_team(options.team, seed=options.seed)
        if team.scenario is None:
            raise sp.errors.InvalidRequest(f"{options.team} plays no standard scenario as it is")
        with sp.make(team.scenario, options.battles, **{**team.settings, "fields": FIELDS}) as envs:
            battles = record(envs, envs.reset(seed=options.seed), team)
            recording = {"map": team.scenario, "version": envs.spec.rules, "battles": battles}
        path = write(recording, options.folder / f"{Path(team.scenario).stem}.json.gz")
    except (sp.errors.PoolError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(path)
    return 0


if __name__ == "__main__":
    sys.exit(main())
