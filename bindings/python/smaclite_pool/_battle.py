"""One battle, agent by agent, for frameworks that name agents: what the PettingZoo and RLlib faces have in common."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np
from gymnasium.spaces import Discrete
from numpy.typing import NDArray

from ._native import Batch, make
from .errors import InvalidRequest

INFO = ("battle_won", "dead_allies", "dead_enemies")


@dataclass(frozen=True)
class Moment:
    """A battle after a step or reset, in memory of its own: learners keep it, and a lane lets hold few frames."""

    obs: NDArray[np.float32]
    """[n_agents, obs_size]."""
    legal: NDArray[np.bool_]
    """[n_agents, n_actions]: which actions are available."""
    state: NDArray[np.float32]
    """[state_size]."""
    reward: float
    """The team's."""
    terminated: bool
    truncated: bool
    info: dict[str, Any]
    """`battle_won`, `dead_allies` and `dead_enemies`."""

    @staticmethod
    def of(batch: Batch) -> Moment:
        """The only environment of a batch."""
        copies = (batch.obs[0].copy(), batch.avail_actions[0].copy(), batch.state[0].copy())
        ends = (batch.terminated[0].item(), batch.truncated[0].item())
        return Moment(*copies, batch.reward[0].item(), *ends, {name: getattr(batch, name)[0].item() for name in INFO})


class Battle:
    """A pool of one environment, which waits for its reset when the battle is over."""

    def __init__(self, scenario: str | PathLike[str], settings: Mapping[str, Any]) -> None:
        # Frameworks run many of these on one machine: who spins takes time from the others.
        self.envs = make(scenario, 1, autoreset="disabled", **{"threads": 1, "wait": "block", **settings})
        self.agents = [f"agent_{agent}" for agent in range(self.envs.n_agents)]
        self.is_on = False

    def reset(self, seed: int | None) -> Moment:
        """Begins a battle; with a seed the generator starts anew, without one it goes on."""
        batch = self.envs.reset(seed)
        self.is_on = True
        return Moment.of(batch)

    def step(self, actions: Mapping[str, int | np.integer[Any]]) -> Moment:
        """Steps by an action of every agent, the dead too. Raises IllegalAction and InvalidRequest."""
        if not self.is_on:
            raise InvalidRequest("no battle is on: reset begins one")
        if missing := [agent for agent in self.agents if agent not in actions]:
            raise InvalidRequest(f"no action was given for {', '.join(missing)}; the dead take 0, the no-op")
        now = Moment.of(self.envs.step([[int(actions[agent]) for agent in self.agents]]))
        self.is_on = not (now.terminated or now.truncated)
        return now

    def close(self) -> None:
        """Ends the pool. A second time does nothing."""
        self.is_on = False
        self.envs.close()


class LegalActions(Discrete):
    """`Discrete(n_actions)` whose `sample()`, called without a mask, draws what is legal in the battle just now."""

    def __init__(self, n_actions: int) -> None:
        super().__init__(n_actions)
        self.legal = np.ones(n_actions, np.int8)

    def sample(self, mask: Any = None, probability: Any = None) -> np.int64:
        """A random action: under `mask`, int8 [n_actions], or by `probability`; with neither, of the legal ones."""
        if mask is None and probability is None:
            mask = self.legal
        return super().sample(mask, probability)

    def __reduce__(self) -> tuple[type[Discrete], tuple[int]]:
        return Discrete, (int(self.n),)  # a copy knows of no battle


def show_legal(spaces: Mapping[str, LegalActions], masks: NDArray[np.int8]) -> None:
    """Tells the agents' spaces what is legal now, [n_agents, n_actions]."""
    for space, mask in zip(spaces.values(), masks, strict=True):
        space.legal = mask
