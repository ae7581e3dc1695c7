"""A trained team that plays either environment: it is asked with what an agent sees there."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import smaclite_pool as sp
from numpy.typing import NDArray

from . import scenarios
from .battles import Frame
from .scenarios import Json, ScenarioFiles

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Network:
    """From observations to the numbers of actions."""

    team: sp.Team

    def __call__(self, obs: NDArray[np.float32]) -> Floats:
        """`[n_agents, n_actions]`, of observations `[n_agents, obs_size]`."""
        numbers: Floats = self.team.logits(obs[None])[0].astype(np.float64)
        return numbers


@dataclass(frozen=True)
class Team:
    """The policy of all agents."""

    network: Callable[[NDArray[np.float32]], Floats]
    last_actions: int = 0
    """How many of its own last actions an agent sees, besides its observation."""

    def player(self, seed: int, greedy: bool) -> Player:
        """Plays an episode. The seed decides the draws."""
        return Player(self, np.random.default_rng(seed), greedy)


@dataclass
class Player:
    """Plays one episode in one environment."""

    team: Team
    rng: np.random.Generator
    greedy: bool
    played: list[list[int]] = field(default_factory=list)
    """The joint actions of all steps so far."""

    def choose(self, frame: Frame) -> list[int]:
        """The actions of all agents; a dead one has only no-op to choose."""
        logits = np.where(frame.avail_actions, self.team.network(self.inputs(frame)), -np.inf)
        if self.greedy:
            chosen = logits.argmax(axis=1)
        else:
            sums = np.exp(logits - logits.max(axis=1, keepdims=True)).cumsum(axis=1)
            # The first action at which the sum exceeds a share of the total; unavailable ones add nothing.
            thresholds = self.rng.random(len(sums)) * sums[:, -1]
            chosen = (sums > thresholds[:, None]).argmax(axis=1)
        self.played.append([int(action) for action in chosen])
        return self.played[-1]

    def inputs(self, frame: Frame) -> NDArray[np.float32]:
        """The observations, and the last actions as one-hot vectors, the newest first, as the pool appends
        them to `obs`; zeros stand for steps before the episode. Those of dead agents have no effect."""
        n_agents, n_actions = frame.avail_actions.shape
        past = np.zeros((n_agents, self.team.last_actions, n_actions), np.float32)
        for age in range(min(self.team.last_actions, len(self.played))):
            past[range(n_agents), age, self.played[-1 - age]] = 1.0
        return np.concatenate([frame.obs, past.reshape(n_agents, -1)], axis=1)


def read(folder: Path, run: Json) -> Team:
    """Reads the actor of the run in the folder, whose `run.json` is `run`.

    Raises:
        OSError: a file cannot be read.
        ValueError, KeyError: a file is damaged.
    """
    return Team(Network(sp.load_team(folder)), run["config"].get("last_actions", 0))


def scenario(run: Json) -> ScenarioFiles:
    """The scenario of a run, by name if it is a standard one."""
    text = run["files"]["text"]
    name = json.loads(text)["name"]
    standard = scenarios.STANDARD / f"{name}.json"
    if standard.is_file() and standard.read_text() == text:
        return scenarios.standard(name)
    with tempfile.TemporaryDirectory(prefix="differential-") as folder:
        for unit in run["files"]["unit_files"]:
            for key in unit["keys"] if unit["text"] else []:
                path = Path(folder) / f"{key}.json"
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(unit["text"])
        path = Path(folder) / f"{name}.json"
        path.write_text(text)
        return scenarios.read(path)
