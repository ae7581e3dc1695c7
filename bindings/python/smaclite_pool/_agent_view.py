"""What single agents see, as objects and as text, and functions of it as policies."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ._evaluation import Evaluation, evaluate
from ._layout import FeatureBlock, feature_blocks, require_told_types, unwrapped
from ._native import make
from ._native import scenario as native_scenario
from ._requirements import require_integer
from .errors import InvalidRequest
from .types import UnitType

if TYPE_CHECKING:
    from . import Envs
    from ._wrapper import Wrapper

_COMPASS = ("east", "north-east", "north", "north-west", "west", "south-west", "south", "south-east")


@dataclass(frozen=True)
class SeenUnit:
    """Another unit in sight of an agent."""

    name: str
    """Such as "enemy 3" or "ally 0", by its number in its team."""
    unit_type: str
    """Such as "ZEALOT"; "unit" if observations do not tell."""
    distance: float
    """From centre to centre, in squares."""
    dx: float
    """How far east it is, in squares."""
    dy: float
    """How far north it is, in squares."""
    health: float | None
    """Share of its maximum, 0 to 1; None if observations do not have it."""
    shield: float | None
    """Share of its maximum, 0 to 1; None if observations do not have it."""
    action: str | None
    """The name of the action on it, if that is available."""

    @property
    def direction(self) -> str:
        """The nearest of eight directions, such as "north-east"."""
        return _COMPASS[round(math.atan2(self.dy, self.dx) / (math.pi / 4)) % 8]

    def __str__(self) -> str:
        where = f"{self.distance:.1f} squares {self.direction} (dx {self.dx:+.1f}, dy {self.dy:+.1f})"
        return f"{self.name} ({self.unit_type}): {', '.join([where, *_body(self)])}"


class AgentView:
    """What one agent sees in one environment, and what it may do. `str(view)` says it in plain words.

    Everything comes from the agent's observation and its available actions, so a policy that reads only this
    is decentralised. A view holds its batch: keep what it says, not many views.
    """

    def __init__(self, views: AgentViews, batch: Any, slot: int, agent: int) -> None:
        self.env = int(batch.env_id[slot])
        """Number of the environment."""
        self.agent = agent
        """Number of the agent."""
        self.episode_limit = views.episode_limit
        """Steps after which the episode ends; None for no limit."""
        self._views, self._batch, self._slot = views, batch, slot

    @cached_property
    def step(self) -> int:
        """Steps of the episode so far; 0 in a new one."""
        is_new = self._views.begins_anew(self._batch)[self._slot]
        return 0 if is_new else int(self._batch.episode_length[self._slot])

    @cached_property
    def _obs(self) -> list[float]:
        obs: list[float] = self._batch.obs[self._slot, self.agent].tolist()
        return obs

    @cached_property
    def _own(self) -> dict[str, float]:
        own = self._views.blocks["own"]
        return dict(zip(own.features, self._obs[own.start :], strict=False))

    @cached_property
    def _type(self) -> UnitType | None:
        return self._views.type_of(self._own, self._views.allies[self.agent])

    @cached_property
    def unit_type(self) -> str:
        """Such as "STALKER"; "unit" if observations do not tell."""
        return self._type["unit_type"] if self._type else "unit"

    @property
    def health(self) -> float | None:
        """Share of its maximum, 0 to 1; 0 of the dead. None if observations do not have it.

        With `health` of `smacv2` it is the share of what is above the unit's level, and can be below 0.
        """
        return self._own.get("health")

    @property
    def shield(self) -> float | None:
        """Share of its maximum, 0 to 1; None if observations do not have it."""
        return self._own.get("shield")

    @cached_property
    def actions(self) -> dict[str, int]:
        """The available actions: names, such as "move north" or "attack enemy 3", and their numbers."""
        available = self._batch.avail_actions[self._slot, self.agent].nonzero()[0].tolist()
        heals = bool(self._type and self._type["healer"])
        return {self._views.action_name(number, heals): number for number in available}

    @cached_property
    def enemies(self) -> list[SeenUnit]:
        """The enemies in sight, the nearest first."""
        return self._seen("enemies", "enemy", range(len(self._views.enemies)))

    @cached_property
    def allies(self) -> list[SeenUnit]:
        """The other agents in sight, the nearest first."""
        others = [ally for ally in range(len(self._views.allies)) if ally != self.agent]
        return self._seen("allies", "ally", others)

    def _seen(self, block_name: str, side: str, numbers: Any) -> list[SeenUnit]:
        block, sight = self._views.blocks[block_name], self._type["sight_range"] if self._type else None
        sight = self._views.sight if sight is None else sight
        types = self._views.enemies if side == "enemy" else self._views.allies
        width, seen = len(block.features), []
        for i, number in enumerate(numbers):
            row = self._obs[block.start + i * width : block.start + (i + 1) * width]
            if not any(row):
                continue
            unit = dict(zip(block.features, row, strict=True))
            unit_type, name = self._views.type_of(unit, types[number]), f"{side} {number}"
            action = next((action for action in self.actions if action.endswith(f" {name}")), None)
            seen.append(
                SeenUnit(
                    name=name,
                    unit_type=unit_type["unit_type"] if unit_type else "unit",
                    distance=unit["distance"] * sight,
                    dx=unit["dx"] * sight,
                    dy=unit["dy"] * sight,
                    health=unit.get("health"),
                    shield=unit.get("shield"),
                    action=action,
                )
            )
        return sorted(seen, key=lambda unit: unit.distance)

    def __str__(self) -> str:
        limit = "" if self.episode_limit is None else f" of {self.episode_limit}"
        if not self.health and list(self.actions) == ["no-op"]:
            return f"Step {self.step}{limit}. You are agent {self.agent}, and your unit is dead."
        body = _body(self)
        lines = [
            f"Step {self.step}{limit}. You are agent {self.agent}, a {self.unit_type}"
            f"{' with ' if body else ''}{', '.join(body)}.",
            *_listed("Enemies in sight", self.enemies),
            *_listed("Allies in sight", self.allies),
            f"Available actions: {', '.join(self.actions)}.",
        ]
        return "\n".join(lines)

    def __repr__(self) -> str:
        return f"<smaclite_pool.extras.AgentView of agent {self.agent} in environment {self.env}>"


Function: TypeAlias = Callable[[AgentView], "int | str | np.integer[Any]"]
"""A policy of single agents: from a view to an available action, by its number or its name."""


class AgentViews:
    """What single agents see in batches of some environments.

        views = smaclite_pool.extras.AgentViews(envs)
        print(views.describe(batch, env=0, agent=2))    # in plain words
        views(batch, env=0, agent=2).enemies            # the enemies in sight, as objects

    Args:
        envs: the environments, or a wrapper of them that leaves observations as they are. Batches must have
            the fields `obs`, `avail_actions` and `episode_length`.

    Raises InvalidRequest if observations have no units (`obs_starcraft` of `smacv2` is false), or do not tell
    their types, which each episode draws (`num_unit_types` is 0).
    """

    def __init__(self, envs: Envs | Wrapper) -> None:
        info = native_scenario(unwrapped(envs))
        self.blocks: dict[str, FeatureBlock] = feature_blocks(info["obs_layout"])
        """The parts of an observation."""
        if "enemies" not in self.blocks:
            raise InvalidRequest("observations must have units, but `obs_starcraft` of `smacv2` is false")
        require_told_types(info)
        self.episode_limit: int | None = envs.spec.episode_limit
        self._is_same_step = envs.spec.autoreset_mode == "SameStep"
        types = {unit_type["unit_type"]: unit_type for unit_type in info["unit_types"]}
        self._by_id = {unit_type["type_id"]: unit_type for unit_type in info["unit_types"]}
        sides = (info["allies"], info["enemies"])
        known = [[None if info["teams_are_drawn"] else types[unit["unit_type"]] for unit in s] for s in sides]
        self.allies: list[UnitType | None] = known[0]
        """The type of each agent, if it is the same in all episodes."""
        self.enemies: list[UnitType | None] = known[1]
        """The same of the enemies."""
        self.sight: float = info["unit_types"][0]["sight_range"]
        """What distances are divided by, where the type of the agent is not known."""
        self._one_hot = [f"type_{i}" for i in range(info["num_unit_types"])]
        self._actions = info["actions"]
        self.n_actions = len(self._actions)
        """How many actions there are."""

    def __call__(self, batch: Any, env: int, agent: int) -> AgentView:
        """What an agent of an environment sees in a batch.

        Raises InvalidRequest if the batch does not have the environment, or there is no such agent.
        """
        slots = np.flatnonzero(batch.env_id == env)
        if len(slots) == 0:
            raise InvalidRequest(f"env must be in the batch, whose env_id are {batch.env_id}, got {env}")
        if not 0 <= require_integer("agent", agent) < len(self.allies):
            raise InvalidRequest(f"agent must be between 0 and {len(self.allies) - 1}, got {agent}")
        return AgentView(self, batch, int(slots[0]), agent)

    def describe(self, batch: Any, env: int, agent: int) -> str:
        """The same in plain words: `str(views(batch, env, agent))`."""
        return str(self(batch, env, agent))

    def _check_equal_sides(self, who: str) -> None:
        """Raise InvalidRequest unless both sides have the same types, of which these views speak."""
        sides = [
            [None if one is None else one["unit_type"] for one in s] for s in (self.allies, self.enemies)
        ]
        if sides[0] != sides[1]:
            raise InvalidRequest(
                f"{who} both sides must have the same unit types in the same order, got agents {sides[0]} "
                f"and enemies {sides[1]}"
            )

    def begins_anew(self, batch: Any) -> NDArray[np.bool_]:
        """bool [M]: whether the episode has ended and what is observed is of the next one."""
        ended: NDArray[np.bool_] = batch.terminated | batch.truncated
        return ended & self._is_same_step

    def type_of(self, features: Mapping[str, float], known: UnitType | None) -> UnitType | None:
        """The type of a unit with these features, or the one that it always has."""
        shown = (i for i, name in enumerate(self._one_hot) if features.get(name))
        return self._by_id.get(next(shown, -1), known)

    def action_name(self, number: int, heals: bool) -> str:
        """The name of an action of an agent, which heals or attacks."""
        name, _, target = self._actions[number].partition("_")
        if name == "target":
            return f"heal ally {target}" if heals else f"attack enemy {target}"
        names = {"no": "no-op", "look": f"look {target}"}
        return names.get(name, name if name == "stop" else f"move {name}")


class PerAgent:
    """A policy for batches that asks a function for the action of each living agent.

        def attack_nearest(view):
            attacks = [unit.action for unit in view.enemies if unit.action]
            return attacks[0] if attacks else "stop"

        policy = smaclite_pool.extras.PerAgent(envs, attack_nearest)
        result = smaclite_pool.evaluate(envs, policy, episodes=20)

    The function is called with an `AgentView`, and returns an available action: its number, or its name as in
    `view.actions`. It is not called for dead agents and in environments whose episode is over.

    Args:
        envs: as for `AgentViews`.
        function: the function. What it remembers of single agents it can keep by `view.env` and `view.agent`;
            `view.step` is 0 in a new episode.

    Calling it raises InvalidRequest if the function returns anything but the number of an action or the name
    of an available one. Whether the action of a number is available is checked when it is played, with
    IllegalAction.
    """

    def __init__(self, envs: Envs | Wrapper, function: Function) -> None:
        self.views, self.function = AgentViews(envs), function

    def __call__(self, batch: Any) -> NDArray[np.int32]:
        """The actions for a batch, int32 [M, n_agents]."""
        given, expected = batch.avail_actions.shape[1:], (len(self.views.allies), self.views.n_actions)
        if given != expected:
            raise InvalidRequest(
                f"avail_actions must have the shape [M, {expected[0]}, {expected[1]}] of the "
                f"environments of this PerAgent, got {list(batch.avail_actions.shape)}"
            )
        # The dead, for whom no-op alone is available, and environments that are reset next.
        actions: NDArray[np.int32] = batch.avail_actions.argmax(-1).astype(np.int32)
        is_over = (batch.terminated | batch.truncated) & ~self.views.begins_anew(batch)
        is_asked = ~batch.avail_actions[..., 0] & ~is_over[:, None]
        for slot, agent in zip(*(index.tolist() for index in is_asked.nonzero()), strict=True):
            view = AgentView(self.views, batch, slot, agent)
            actions[slot, agent] = self._number(view, self.function(view))
        return actions

    def _number(self, view: AgentView, action: int | str | np.integer[Any]) -> int:
        if isinstance(action, str):
            if action in view.actions:
                return view.actions[action]
        else:
            try:
                number = operator.index(action)  # not `int`, for which 6.9 is 6
            except TypeError:
                number = -1
            if 0 <= number < self.views.n_actions:
                return number
        raise InvalidRequest(
            f"action {action!r} of agent {view.agent} in environment {view.env} must be one of its "
            f"available actions, by name or number: {view.actions}"
        )


def evaluate_function(
    scenario: str | PathLike[str],
    function: Function,
    episodes: int = 200,
    *,
    seed: int = 0,
    num_envs: int | None = None,
    **options: Any,
) -> Evaluation:
    """Play a Python function as the policy of every agent, in battles of its own, and return the episodes.

        result = smaclite_pool.extras.evaluate_function("2s3z", attack_nearest, episodes=200, opponent="kite")
        print(result.win_rate)

    Args:
        scenario: a standard scenario or the path of a scenario file.
        function: as for `PerAgent`: from an `AgentView` to an action, by its number or its name.
        episodes: how many episodes count, at least 1.
        seed: environment i is seeded with seed + i; equal seeds give equal episodes.
        num_envs: number of environments; by default one per episode, at most 64.
        options: other arguments of `make`, such as `opponent`, `episode_limit` or `rules`.

    Raises as `make`, `PerAgent` and `evaluate`.
    """
    if "lanes" in options:
        raise InvalidRequest("`lanes` is for smaclite_pool.make alone; remove it")
    num_envs = min(require_integer("episodes", episodes, 1), 64) if num_envs is None else num_envs
    with make(scenario, num_envs, seed=seed, **options) as envs:
        return evaluate(envs, PerAgent(envs, function), episodes, seed)


def _body(unit: SeenUnit | AgentView) -> list[str]:
    """What observations tell of health and shield."""
    shares = {"health": unit.health, "shield": unit.shield}
    return [f"{name} {100 * share:.0f} %" for name, share in shares.items() if share is not None]


def _listed(title: str, units: list[SeenUnit]) -> list[str]:
    return [f"{title}:", *(f"- {unit}" for unit in units)] if units else [f"{title}: none."]
