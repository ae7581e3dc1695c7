"""One episode, played on both sides with the same actions until something differs."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .battles import Frame, OpenBattle, PoolBattle, PublishedFailure, difference
from .scenarios import ScenarioFiles

FIRST_TARGET = 6
"""The action that targets unit 0; before it: no-op, stop, north, south, east, west."""


@dataclass(frozen=True)
class Episode:
    """An episode to play: scenario, policy, seed, and the maximum number of steps."""

    files: ScenarioFiles
    policy: str
    seed: int
    steps: int

    @property
    def name(self) -> str:
        return f"{self.files.name}-{self.policy}-{self.seed}"


@dataclass(frozen=True)
class Outcome:
    """How far both sides agree."""

    kind: str
    """`same`, `different`, `published stops` (by a known error), or `refused` (by smaclite_pool)."""
    what: str = ""
    """What differs, or the error."""
    actions: list[list[int]] = field(default_factory=list)
    """The joint actions of all steps until then."""


def play(episode: Episode, open_published: OpenBattle) -> Outcome:
    """Plays the episode on both sides."""
    actions: list[list[int]] = []
    with tempfile.TemporaryDirectory(prefix="differential-") as folder:
        path = episode.files.write(Path(folder))
        try:
            ours = PoolBattle(episode.files, path, episode.seed)
        except ValueError as error:
            return Outcome("refused", str(error))
        try:
            published = open_published(episode.files, path, episode.seed)
            frames = published.reset(), ours.reset()
            what = difference(*frames)
            choose = policy(episode)
            while what is None and len(actions) < episode.steps and not frames[0].terminated:
                actions.append(choose(frames[0]))
                frames = published.step(actions[-1]), ours.step(actions[-1])
                what = difference(*frames)
            published.close()
        except PublishedFailure as error:
            return Outcome("published stops", str(error), actions)
        finally:
            ours.close()
    if what is None:
        return Outcome("same", actions=actions)
    return Outcome("different", f"after {len(actions)} steps, {what}", actions)


def policy(episode: Episode) -> Callable[[Frame], list[int]]:
    """The players, which see what learners see.

    `random` takes any action. `nearest` takes the nearest target and `focus` the weakest; without a target
    both walk towards the nearest enemy, and one action in seven is random.
    """
    rng = np.random.default_rng(episode.seed + 7)
    healers = np.array([episode.files.heals(unit) for unit in episode.files.roster("ALLY")])
    sides = Sides(episode.files)

    def choose(frame: Frame) -> list[int]:
        (ally_health, allies), (enemy_health, enemies) = sides.read(frame.state)
        actions = []
        for agent, mask in enumerate(frame.avail_actions):
            available = np.flatnonzero(mask)
            targets = available[available >= FIRST_TARGET]
            if not ally_health[agent] or episode.policy == "random" or rng.random() < 0.15:
                actions.append(int(rng.choice(available)))
                continue
            to_enemies = enemies - allies[agent]
            distances = np.hypot(*(allies - allies[agent] if healers[agent] else to_enemies).T)
            health = ally_health if healers[agent] else enemy_health
            if len(targets):
                worth = health if episode.policy == "focus" else distances
                actions.append(int(targets[np.argmin(worth[targets - FIRST_TARGET])]))
            elif enemy_health.any():
                nearest = np.argmin(np.where(enemy_health > 0, np.hypot(*to_enemies.T), np.inf))
                moves = [move for move in towards(to_enemies[nearest]) if mask[move]]
                actions.append(moves[0] if moves else int(rng.choice(available)))
            else:
                actions.append(int(available[0]))
        return actions

    return choose


def towards(way: NDArray[np.float64]) -> list[int]:
    """The two moves that lead there, the longer one first."""
    east_west, north_south = 4 if way[0] > 0 else 5, 2 if way[1] > 0 else 3
    return [north_south, east_west] if abs(way[1]) > abs(way[0]) else [east_west, north_south]


class Sides:
    """Where in the state of a scenario the units are."""

    def __init__(self, files: ScenarioFiles) -> None:
        scenario = files.scenario
        types = scenario["num_unit_types"] if scenario["num_unit_types"] > 1 else 0
        self.n_agents: int = scenario["num_allied_units"]
        self.n_enemies: int = scenario["num_enemy_units"]
        self.per_agent = 4 + scenario["ally_has_shields"] + types  # health, cooldown, x, y
        self.per_enemy = 3 + scenario["enemy_has_shields"] + types  # health, x, y
        self.size = np.array([scenario.get("width", 32), scenario.get("height", 32)], float)

    def read(self, state: NDArray[np.float32]) -> list[tuple[NDArray[np.float32], NDArray[np.float64]]]:
        """Health ratio and position of agents and of enemies; dead units have health 0."""
        middle = self.n_agents * self.per_agent
        end = middle + self.n_enemies * self.per_enemy
        agents = state[:middle].reshape(self.n_agents, self.per_agent)
        enemies = state[middle:end].reshape(self.n_enemies, self.per_enemy)
        return [(agents[:, 0], agents[:, 2:4] * self.size), (enemies[:, 0], enemies[:, 1:3] * self.size)]
