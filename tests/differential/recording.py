"""Records an episode of the published environment tick by tick, in the format of tests/golden/README.md.

It runs in a separate process, because some choices of the published environment depend on Python's hash
seed: `record` starts `python -m differential.recording` with a given one.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from numpy.typing import NDArray

from .episode import Episode
from .scenarios import ScenarioFiles

Recorded = dict[str, NDArray[Any]]
"""The arrays of a recording by name."""

TICKS_PER_STEP = 8
END_OF_ORDER = 255
SIZES = ("n_agents", "n_enemies", "n_actions", "obs_size", "state_size")


def record(episode: Episode, actions: list[list[int]], hash_seed: int) -> Recorded:
    """Records the episode with these actions, in a process with that hash seed, as far as the actions are
    available."""
    with tempfile.TemporaryDirectory(prefix="differential-") as folder:
        task = {
            "path": str(episode.files.write(Path(folder))),
            "name": episode.files.name,
            "standard": episode.files.standard,
            "policy": episode.policy,
            "seed": episode.seed,
            "actions": actions,
            "recording": f"{folder}/recording.npz",
        }
        package = Path(__file__).parent.parent
        paths = [str(package), *filter(None, [os.environ.get("PYTHONPATH")])]
        environment = {**os.environ, "PYTHONHASHSEED": str(hash_seed), "PYTHONPATH": os.pathsep.join(paths)}
        command = [sys.executable, "-W", "ignore", "-m", "differential.recording"]
        subprocess.run(command, input=json.dumps(task), env=environment, text=True, check=True)
        with np.load(f"{folder}/recording.npz") as arrays:
            return dict(arrays)


def first_disagreement(one: Recorded, other: Recorded) -> int | None:
    """The first tick in which two recordings of the same actions differ; None if they never do."""
    ticks = []
    for name in one:
        if name.startswith("tick_"):
            # The frames begin with that of the reset.
            first = 0 if name in ("tick_pref", "tick_reward") else -1
            length = min(len(one[name]), len(other[name]))
            rows = (array[name][:length].reshape(length, -1) for array in (one, other))
            unequal = np.flatnonzero((next(rows) != next(rows)).any(axis=1))
            ticks += [int(unequal[0]) + first] if len(unequal) else []
            ticks += [length + first] if len(one[name]) != len(other[name]) else []
    return min(ticks, default=None)


class Orders:
    """The environment's generator, remembering the execution order of each tick."""

    def __init__(self, generator: Any) -> None:
        self.generator = generator
        self.ids: list[list[int]] = []

    def shuffle(self, units: list[Any]) -> None:
        self.generator.shuffle(units)
        self.ids.append([unit.id for unit in units])


class Watch:
    """Notes what an environment does within its steps."""

    def __init__(self, env: Any) -> None:
        self.env = env
        self.units = [env.all_units[i] for i in range(len(env.all_units))]
        self.orders = env._np_random = Orders(env._np_random)
        self.frames = [self.frame()]
        self.preferred: list[NDArray[np.float32]] = []
        self.rewards: list[float] = []
        self.revived: list[bool] = []
        tick = env._SMACliteEnv__world_step
        avoid = env.velocity_updater.compute_new_velocities

        def watched_tick() -> Any:
            self.revived.append(False)
            reward = tick()
            self.rewards.append(float(reward))
            self.frames.append(self.frame())
            return reward

        def watched_avoid(all_units: dict[int, Any]) -> None:
            preferred = np.zeros((len(self.units), 2), np.float32)
            for unit in all_units.values():
                preferred[unit.id] = unit.pref_velocity
            self.preferred.append(preferred)
            avoid(all_units)

        env._SMACliteEnv__world_step = watched_tick
        env.velocity_updater.compute_new_velocities = watched_avoid

    def healing(self, heal: Any) -> Any:
        """A unit's method `heal`, noting heals of units without health."""

        def watched_heal(healer: Any, patient: Any) -> None:
            before = patient.hp
            heal(healer, patient)
            self.revived[-1] |= bool(before == 0 and patient.hp > 0)

        return watched_heal

    def frame(self) -> Recorded:
        """All units as they are."""
        units = self.units

        def column(dtype: Any, attribute: str) -> NDArray[Any]:
            return np.array([getattr(unit, attribute) for unit in units], dtype)

        return {
            "pos": column(np.float32, "pos"),
            "vel": column(np.float32, "velocity"),
            "hp": column(float, "hp"),
            "shield": column(float, "shield"),
            "energy": column(float, "energy"),
            "cooldown": column(float, "cooldown"),
            "shield_cooldown": column(float, "shield_cooldown"),
            "healing": column(float, "healing_available"),
            "target": np.array([-1 if unit.target is None else unit.target.id for unit in units], np.int16),
            "alive": np.array([self.env.all_units.get(unit.id) is unit for unit in units], np.uint8),
            "declared": column(np.uint8, "attacking"),
        }

    def cut(self, n_ticks: int) -> None:
        """Drops everything after the first `n_ticks` ticks."""
        del self.frames[n_ticks + 1 :]
        for rows in (self.orders.ids, self.preferred, self.rewards, self.revived):
            del rows[n_ticks:]

    def order(self) -> NDArray[np.uint8]:
        """The execution orders as (steps, ticks, units)."""
        order = np.full((len(self.orders.ids), len(self.units)), END_OF_ORDER, np.uint8)
        for row, ids in zip(order, self.orders.ids, strict=True):
            row[: len(ids)] = ids
        return order.reshape(-1, TICKS_PER_STEP, len(self.units))


def record_here(task: dict[str, Any]) -> Recorded:
    """Records in this process what the task says."""
    from smaclite.env.units.unit import Unit

    from .published import PublishedBattle

    path = Path(task["path"])
    files = ScenarioFiles(task["name"], json.loads(path.read_text()), standard=task["standard"])
    battle = PublishedBattle(files, path, task["seed"])
    frames = [battle.reset()]
    watch = Watch(battle.env)
    units: list[Recorded] = [watch.frames[0]]
    rewards: list[float] = []
    # A recording has a step at least.
    actions: list[list[int]] = task["actions"] or [[int(np.argmax(mask)) for mask in frames[0].avail_actions]]
    with mock.patch.object(Unit, "heal", watch.healing(Unit.heal)):
        for joint in actions:
            try:
                frames.append(battle.step(joint))
            except Exception:
                # With another hash seed the battle can have gone where this action is not available.
                break
            rewards.append(battle.reward)
            units.append(watch.frames[-1])
    watch.cut(len(rewards) * TICKS_PER_STEP)
    actions = actions[: len(rewards)]
    env = battle.env
    meta = {
        "scenario": files.name,
        "policy": task["policy"],
        "seed": task["seed"],
        "reference": "SMAClite with its C++ collision avoidance",
        "unit_types": [unit.type.stats.name for unit in watch.units],
        **{size: getattr(env, size) for size in SIZES},
        "max_reward": float(env.max_reward),
    }
    return {
        "meta": np.frombuffer(json.dumps(meta).encode(), np.uint8),
        "unit_faction": np.array([unit.faction.value != "ALLY" for unit in watch.units], np.uint8),
        "unit_id_in_faction": np.array([unit.id_in_faction for unit in watch.units], np.uint8),
        **{name: np.stack([row[name] for row in units]) for name in units[0]},
        **{f"tick_{name}": np.stack([row[name] for row in watch.frames]) for name in units[0]},
        "tick_pref": np.array(watch.preferred, np.float32).reshape(-1, len(watch.units), 2),
        "tick_reward": np.array(watch.rewards),
        "actions": np.array(actions, np.uint8).reshape(len(actions), -1),
        "order": watch.order(),
        "revived": np.array(watch.revived, np.uint8).reshape(-1, TICKS_PER_STEP).max(axis=1),
        "reward": np.array(rewards),
        "terminated": np.array([frame.terminated for frame in frames[1:]], np.uint8),
        "won": np.array([frames[-1].battle_won], np.uint8),
        "obs": np.stack([frame.obs for frame in frames]),
        "state": np.stack([frame.state for frame in frames]),
        "avail": np.stack([frame.avail_actions for frame in frames]).astype(np.uint8),
    }


def main() -> None:
    """Records what the task on standard input says, into the file that it names."""
    task: dict[str, Any] = json.load(sys.stdin)
    np.savez_compressed(task["recording"], allow_pickle=False, **record_here(task))


if __name__ == "__main__":
    main()
