"""Takes all measures of a rule set, map by map."""

from __future__ import annotations

import importlib
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import smaclite_pool as sp

from . import free, measures, play, pool, restarted, rows, stands
from .cast import Player
from .pool import Setting
from .recordings import Battle
from .rows import Row

SMAX = "smax"
"""In place of a rule set."""

OF_RECORDINGS = ("battles", "stands", "walk", "drift")
MEASURES = (*OF_RECORDINGS, "random", "scripts")

Tables = dict[str, list[Row]]
"""Rows by measure."""


@dataclass
class Run:
    """The measures of a rule set. What cannot be played is told, and left out."""

    rules: str
    maps: dict[str, list[Battle]]
    """The battles that are played."""
    chosen: set[str]
    """Maps of random play and scripts; all if empty."""
    measures: list[str]
    seeds: int
    episodes: int
    scenarios: dict[str, str]
    """By map, in place of the map."""
    threads: int | None
    failed: bool = field(default=False, init=False)

    def tables(self) -> Tables:
        """All rows; none if the rule set is not known."""
        found: Tables = {}
        if self.is_known():
            if {"battles", "stands"} & set(self.measures):
                found |= self.freely()
            found["walk"] = self.walks("walk", 1, restarted.walk)
            found["drift"] = self.walks("drift", restarted.PHASES, restarted.drift)
            if self.rules != SMAX:
                found["random"] = self.random_play()
                found["scripts"] = self.scripts()
        return {name: each for name, each in found.items() if each and name in self.measures}

    def is_known(self) -> bool:
        try:
            if self.rules == SMAX:
                self.maps = {name: self.maps[name] for name in smax().maps() if name in self.maps}
                return True
            options: Any = Setting(self.rules, "3m", self.threads).options()
            sp.make("3m", 1, **options).close()
        except (sp.errors.PoolError, ValueError, ImportError) as error:
            self.tell(str(error))
            return False
        return True

    def tell(self, error: str) -> None:
        print(f"error: {self.rules}: {error}", file=sys.stderr)
        self.failed = True

    def setting(self, name: str) -> Setting:
        return Setting(self.rules, self.scenarios.get(name, name), self.threads)

    def opened(self, name: str, copies: int) -> AbstractContextManager[Player]:
        of: Callable[..., AbstractContextManager[Player]]
        of = smax().opened if self.rules == SMAX else pool.opened
        return of(self.maps[name], self.setting(name), copies)

    def of_maps(self, copies: int, of: Callable[[str, Player], None]) -> None:
        """Opens all maps, one after the other."""
        for name in self.maps:
            try:
                with self.opened(name, copies) as player:
                    for each in player.cast.skipped:
                        self.tell(f"{each.file}: battle {each.number} has other units than {name}")
                    of(name, player)
            except (sp.errors.PoolError, ValueError) as error:
                self.tell(f"{name}: {error}")

    def freely(self) -> Tables:
        """Battles that are played from their starts."""
        of_battles = rows.BattleRows(self.rules)
        of_stands: list[Row] = []

        def add(name: str, player: Player) -> None:
            played, cast = free.play(player), player.cast
            of_battles.add(name, cast.course.battles, measures.compare(cast.course, played))
            of_stands.extend(rows.stand_rows(self.rules, name, stands.real(cast), stands.ours(cast, played)))

        self.of_maps(self.seeds, add)
        return {"battles": of_battles.finish(), "stands": of_stands}

    def walks(self, kind: str, copies: int, walks: Callable[[Player], restarted.Walks]) -> list[Row]:
        """Battles that are put back to what is recorded."""
        found: list[Row] = []

        def add(name: str, player: Player) -> None:
            battles = player.cast.course.battles
            found.extend(rows.walk_rows(self.rules, name, battles, walks(player), kind == "walk"))

        if kind in self.measures:
            self.of_maps(copies, add)
        return found

    def random_play(self) -> list[Row]:
        found = [
            rows.random_row(self.rules, name, play.random_play(self.setting(name), self.episodes))
            for name in self.wanted("random", rows.maps_of_random_play())
        ]
        return [*found, rows.near_row(self.rules, found)] if found else []

    def scripts(self) -> list[Row]:
        """A fifth of the episodes each, as scripts vary less."""
        real, episodes = rows.real_scripts(), max(self.episodes // 5, 1)
        found = []
        for name in self.wanted("scripts", real):
            scripts = ("nearest", *play.SCRIPTS)
            won = {script: play.scripted(self.setting(name), script, episodes).won for script in scripts}
            found.append(rows.script_row(self.rules, name, won, real[name]))
        return [*found, rows.mean_row(f"{self.rules} mean", found)] if found else []

    def wanted(self, measure: str, maps: Any) -> Iterator[str]:
        if measure in self.measures:
            yield from (name for name in maps if not self.chosen or name in self.chosen)


def smax() -> Any:
    """The module, which needs JaxMARL."""
    return importlib.import_module(f"{__package__}.smax")


def write(folder: Path, runs: list[Tables]) -> None:
    """A CSV file per measure, with the rows of all rule sets."""
    everything: Tables = defaultdict(list)
    for tables in runs:
        for name, found in tables.items():
            everything[name] += found
    for name, found in everything.items():
        rows.write(folder / f"{name}.csv", found)
