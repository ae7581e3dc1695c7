"""Reads recorded battles (README.md has the format), checks them, and makes arrays of those of one map.

An error names file, battle and key.
"""

from __future__ import annotations

import gzip
import json
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

FOLDER = Path(__file__).parent / "recordings"
STOP, NORTH, SOUTH, EAST, WEST, FIRST_TARGET = range(1, 7)
"""Numbers of actions, as SMAC has them."""

MOVES = {"n": NORTH, "s": SOUTH, "e": EAST, "w": WEST}
DIRECTIONS = {"n": (0.0, 1.0), "s": (0.0, -1.0), "e": (1.0, 0.0), "w": (-1.0, 0.0)}
LOOPS = 8
"""Game loops per step of SMAC."""

LONGEST_STEP = 1.5
"""In squares: a stalker walks 1.477."""


class RecordingError(ValueError):
    """A file that does not have the format."""


class Order(NamedTuple):
    """What an agent is told to do in a step."""

    agent: int
    kind: str
    """n, s, e, w, unit or stop."""
    target: int | None
    """The id of the unit that is attacked or healed."""
    place: tuple[float, float] | None
    """Where the agent is, if it walks, and where the target is, if there is one; None if that is not sure."""


class Unit(NamedTuple):
    """A unit of a battle; its place in the list is its id."""

    species: str
    """MARINE for `Marine_RL` and `Marine`."""
    is_agent: bool
    cell: tuple[int, int]
    died: int | None
    killer: int | None


@dataclass(frozen=True)
class Battle:
    """A recorded battle."""

    file: str
    number: int
    units: list[Unit]
    steps: list[list[Order]]
    removed: int | None

    @property
    def horizon(self) -> int:
        """The loop at which a unit that lives at the end counts as dead."""
        return (self.removed or LOOPS * (len(self.steps) - 1)) + LOOPS


def read(folder: Path) -> dict[str, list[Battle]]:
    """The battles of all files of a folder, by map.

    Raises:
        RecordingError: there are no files, or one does not have the format.
    """
    maps: dict[str, list[Battle]] = defaultdict(list)
    for path in sorted(folder.glob("*.json.gz")):
        name, battles = read_file(path)
        maps[name] += battles
    if not maps:
        raise RecordingError(f"{folder}: no files *.json.gz")
    return dict(maps)


def read_file(path: Path) -> tuple[str, list[Battle]]:
    """The map and the battles of a file."""
    try:
        recording = json.loads(gzip.decompress(path.read_bytes()))
    except (OSError, EOFError, ValueError) as error:
        raise RecordingError(f"{path}: not JSON in gzip: {error}") from error
    name = member(recording, "map", str, str(path))
    battles = member(recording, "battles", list, str(path))
    return name, [battle(each, path, i) for i, each in enumerate(battles)]


def member(of: Any, key: str, kind: type | tuple[type, ...], where: str) -> Any:
    """The value of a key, which must be of this type; None is one."""
    if not isinstance(of, dict):
        raise RecordingError(f"{where}: expected an object, got {of!r:.60}")
    if key not in of:
        raise RecordingError(f"{where}: key {key!r} is missing")
    kinds = kind if isinstance(kind, tuple) else (kind,)
    # A bool is an int to Python, and not to JSON.
    if not isinstance(of[key], kinds) or isinstance(of[key], bool):
        names = " or ".join("null" if each is type(None) else each.__name__ for each in kinds)
        raise RecordingError(f"{where}: key {key!r} must be {names}, got {of[key]!r:.60}")
    return of[key]


INTEGER_OR_NULL = (int, type(None))


def battle(of: Any, path: Path, index: int) -> Battle:
    number = member(of, "battle", int, f"{path}: entry {index} of 'battles'")
    where = f"{path}: battle {number}"
    units = [unit(each, i, where) for i, each in enumerate(member(of, "units", list, where))]
    for i, each in enumerate(units):
        if each.killer is not None and not 0 <= each.killer < len(units):
            raise RecordingError(
                f"{where}: unit {i}: key 'killer' must be below {len(units)}, got {each.killer}"
            )
    rows = member(of, "steps", list, where)
    if not rows:
        raise RecordingError(f"{where}: key 'steps' is empty")
    steps = [orders(row, i, units, where) for i, row in enumerate(rows)]
    return Battle(path.name, number, units, steps, member(of, "removed", INTEGER_OR_NULL, where))


def unit(of: Any, index: int, battle_name: str) -> Unit:
    where = f"{battle_name}: unit {index}"
    if member(of, "id", int, where) != index:
        raise RecordingError(f"{where}: key 'id' must be its place in the list, got {of['id']}")
    owner = member(of, "owner", int, where)
    if owner not in (1, 2):
        raise RecordingError(f"{where}: key 'owner' must be 1 or 2, got {owner}")
    cell = member(of, "born_cell", list, where)
    if len(cell) != 2 or not all(isinstance(x, int) for x in cell):
        raise RecordingError(f"{where}: key 'born_cell' must be two integers, got {cell}")
    died, killer = (member(of, key, INTEGER_OR_NULL, where) for key in ("died", "killer"))
    return Unit(species(member(of, "type", str, where)), owner == 1, (cell[0], cell[1]), died, killer)


def species(name: str) -> str:
    """One name for a type, in recordings and scenarios alike."""
    return name.upper().removeprefix("X_").removesuffix("_RL")


def orders(row: Any, index: int, units: list[Unit], battle_name: str) -> list[Order]:
    where = f"{battle_name}: entry {index} of 'steps'"
    if not (isinstance(row, list) and len(row) == 2 and isinstance(row[1], list)):
        raise RecordingError(f"{where}: expected [loop, orders], got {row!r:.60}")
    if row[0] != LOOPS * index:
        raise RecordingError(f"{where}: the loop must be {LOOPS * index}, got {row[0]!r}")
    return [order(each, units, f"{where}: {each!r:.60}") for each in row[1]]


def order(row: Any, units: list[Unit], where: str) -> Order:
    def is_unit(value: Any) -> bool:
        return isinstance(value, int) and 0 <= value < len(units)

    def place(values: list[Any]) -> tuple[float, float]:
        if len(values) < 2 or not all(isinstance(value, int | float) for value in values[:2]):
            raise RecordingError(f"{where}: x and y are missing")
        return float(values[0]), float(values[1])

    if not (isinstance(row, list) and len(row) >= 3 and is_unit(row[0]) and units[row[0]].is_agent):
        raise RecordingError(f"{where}: an order begins with an agent's id, its kind and its ability")
    agent, kind, _, *rest = row
    if kind in MOVES:
        return Order(agent, kind, None, None if rest[-1:] == ["?"] else place(rest))
    if kind == "unit":
        if not rest or rest[0] is None:
            return Order(agent, "stop", None, None)
        if not is_unit(rest[0]):
            raise RecordingError(f"{where}: the target must be a unit's id, got {rest[0]!r}")
        return Order(agent, "unit", rest[0], place(rest[1:]))
    if kind == "stop":
        return Order(agent, "stop", None, None)
    raise RecordingError(f"{where}: the kind must be n, s, e, w, unit or stop, got {kind!r}")


@dataclass(frozen=True)
class Course:
    """Battles of one map as arrays, with the units in the order of a snapshot's columns.

    B battles, T steps of the longest one, U units, A agents.
    """

    battles: list[Battle]
    n_agents: int
    actions: NDArray[np.int32]
    """[B, T, A]: as SMAC numbers them; `STOP` without an order."""
    moves: NDArray[np.bool_]
    """[B, T, A]: whether there is an order to walk."""
    attacks: NDArray[np.bool_]
    """[B, T, A]: whether there is an order to attack."""
    places: NDArray[np.float64]
    """[B, T + 1, U, 2]: exact positions before each step; NaN if not recorded."""
    stood: NDArray[np.float64]
    """[B, T + 1, U, 2]: the same, and where agents that attacked must have stood."""
    starts: NDArray[np.float64]
    """[B, U, 2]: position at the start, or the middle of the unit's cell."""
    died: NDArray[np.float64]
    """[B, U]: loop of its death; NaN if it lives at the end."""
    killer: NDArray[np.int32]
    """[B, U]: the unit that killed it, or -1."""
    length: NDArray[np.int32]
    """[B]: steps."""
    horizon: NDArray[np.float64]
    """[B]: the loop at which the living count as dead."""

    @property
    def won(self) -> NDArray[np.bool_]:
        """[B]: whether all enemies died."""
        return np.asarray(~np.isnan(self.died[:, self.n_agents :]).any(1), bool)


def course(battles: list[Battle], columns: Sequence[dict[int, int]], n_agents: int) -> Course:
    """Arrays of battles. `columns` has, for each battle, the column of each unit id."""
    n, n_units = len(battles), len(columns[0])
    longest = max(len(each.steps) for each in battles)
    shape = (n, longest + 1, n_units, 2)
    made = Course(
        battles,
        n_agents,
        np.full((n, longest, n_agents), STOP, np.int32),
        np.zeros((n, longest, n_agents), bool),
        np.zeros((n, longest, n_agents), bool),
        np.full(shape, np.nan),
        np.full(shape, np.nan),
        np.zeros((n, n_units, 2)),
        np.full((n, n_units), np.nan),
        np.full((n, n_units), -1, np.int32),
        np.array([len(each.steps) for each in battles], np.int32),
        np.array([each.horizon for each in battles], float),
    )
    for i, (each, column) in enumerate(zip(battles, columns, strict=True)):
        fill_units(made, i, each, column)
        for t, rows in enumerate(each.steps):
            fill_step(made, i, t, rows, column)
        made.starts[i] = starts(made, i, each, column)
        made.stood[i] = with_standing(made, i)
    return made


def fill_units(made: Course, i: int, of: Battle, column: dict[int, int]) -> None:
    for unit_id, each in enumerate(of.units):
        if each.died is not None:
            made.died[i, column[unit_id]] = each.died
        if each.killer is not None:
            made.killer[i, column[unit_id]] = column[each.killer]


def fill_step(made: Course, i: int, t: int, rows: list[Order], column: dict[int, int]) -> None:
    walkers = []
    for agent, kind, target, place in rows:
        a = column[agent]
        if kind in MOVES:
            made.actions[i, t, a] = MOVES[kind]
            made.moves[i, t, a] = True
            walkers.append((a, place))
        elif target is not None:
            to = column[target]
            made.attacks[i, t, a] = to >= made.n_agents
            made.actions[i, t, a] = FIRST_TARGET + (to if to < made.n_agents else to - made.n_agents)
            made.places[i, t, to] = place
    for a, place in walkers:  # its own order says it best
        if place is not None:
            made.places[i, t, a] = place


def starts(made: Course, i: int, of: Battle, column: dict[int, int]) -> NDArray[np.float64]:
    places = made.places[i, 0].copy()
    agents, enemies = (
        [unit_id for unit_id, each in enumerate(of.units) if each.is_agent == side] for side in (True, False)
    )
    # Both sides begin in the same pattern: an enemy is as far from its partner as their cells are.
    for agent, enemy in zip(agents, enemies, strict=False):
        partner, each = of.units[agent], of.units[enemy]
        if partner.species == each.species and np.isnan(places[column[enemy], 0]):
            places[column[enemy]] = places[column[agent]] + np.subtract(each.cell, partner.cell)
    for unit_id, each in enumerate(of.units):
        if np.isnan(places[column[unit_id], 0]):
            places[column[unit_id]] = np.add(each.cell, 0.5)
    return apart(places)


def apart(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Moves units a little that are at one place, as the middles of cells can be."""
    moved = places.astype(np.float32)
    seen: set[tuple[float, ...]] = set()
    for row in moved:
        while tuple(np.round(row, 2)) in seen:
            row += np.array([0.31, 0.17], np.float32)
        seen.add(tuple(np.round(row, 2)))
    return moved.astype(float)


def with_standing(made: Course, i: int) -> NDArray[np.float64]:
    """The places of a battle, with those of agents between a walk and the next one, where only that walk
    explains how they came from one place to the other: then they stood."""
    places: NDArray[np.float64] = made.places[i].copy()
    vectors = {MOVES[kind]: np.array(vector) for kind, vector in DIRECTIONS.items()}
    for a in range(made.n_agents):
        known = np.flatnonzero(~np.isnan(made.places[i, :, a, 0]))
        for t, later in pairwise(known):
            between = slice(t + 1, later)
            if later == t + 1 or not made.moves[i, t, a] or made.moves[i, between, a].any():
                continue
            went = made.places[i, later, a] - made.places[i, t, a]
            ahead = float(went @ vectors[int(made.actions[i, t, a])])
            aside = float(np.sqrt(max(went @ went - ahead * ahead, 0.0)))
            if -0.05 <= ahead <= LONGEST_STEP and aside <= 0.15:
                places[between, a] = made.places[i, later, a]
    return places
