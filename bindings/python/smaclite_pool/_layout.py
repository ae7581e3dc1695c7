"""Named parts of observations and state, and the map; offsets and names come from the native module."""

from __future__ import annotations

import json
import math
import operator
from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._native import Envs, scenario
from .errors import InvalidRequest
from .types import LayoutPart, Scenario

if TYPE_CHECKING:
    from ._wrapper import Wrapper

Floats = NDArray[np.float32]
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class FeatureBlock:
    """A part of an observation or of the state."""

    start: int
    """Index of its first feature."""
    shape: tuple[int, ...]
    """[features], or [units, features]."""
    features: list[str]
    """Names of its last axis."""

    def view(self, array: Floats) -> Floats:
        """This part of arrays [..., size], as a view [..., *shape]."""
        part = array[..., self.start : self.start + math.prod(self.shape)]
        return part.reshape(*array.shape[:-1], *self.shape)

    def column(self, array: Floats, feature: str) -> Floats:
        """One feature of this part of arrays [..., size], as a view [..., *shape[:-1]].

        Zeros if the part has no feature of that name.
        """
        part = self.view(array)
        if feature not in self.features:
            return np.broadcast_to(np.float32(0), part.shape[:-1])
        return part[..., self.features.index(feature)]


class ObservationBlocks(NamedTuple):
    """The parts of an observation, in order."""

    moves: FeatureBlock
    """[4]: whether a move north, south, east, west is available."""
    enemies: FeatureBlock
    """[E, features]: targetable, distance, dx, dy, health, shield, type; zeros for the unseen."""
    allies: FeatureBlock
    """[A - 1, features]: visible, distance, dx, dy, health, shield, type; without the agent itself."""
    own: FeatureBlock
    """[features]: health, shield, type."""


class StateBlocks(NamedTuple):
    """The parts of the state, in order."""

    allies: FeatureBlock
    """[A, features]: health, energy/cooldown, rel_x, rel_y, shield, type."""
    enemies: FeatureBlock
    """[E, features]: health, rel_x, rel_y, shield, type."""
    last_action: FeatureBlock
    """[A, N]: the last action of each agent, one-hot."""


_PLAIN_OPTIONS = {
    "conic_fov": False,
    "obs_all_health": True,
    "obs_own_health": True,
    "enemy_mask": None,
    "health": None,
}
"""Options of `smacv2` with which actions and health mean what they mean in SMAC."""

_OTHERS = "smaclite_pool.make and its Gymnasium environments accept all options"


def require_told_types(info: Scenario) -> None:
    """Raise InvalidRequest if the types of units are drawn, and observations and state do not tell them."""
    if info["teams_are_drawn"] and info["num_unit_types"] == 0 and len(info["unit_types"]) > 1:
        raise InvalidRequest(
            f"{info['name']}: observations and state must tell the types of units, which each episode draws, "
            "but `num_unit_types` is 0"
        )


class ScenarioLayout:
    """A scenario's units, its map, and the layout of its observations and state.

    It is that of environments, with the figures of their rules, or one by its name or path. Raises
    InvalidRequest if observations and state have other parts, or do not tell the types that are drawn.
    """

    def __init__(self, of: Envs | str | PathLike[str]) -> None:
        self.info = scenario(of)
        require_told_types(self.info)
        self._check_options()
        self.allies = self.info["allies"]
        self.enemies = self.info["enemies"]
        self.n_agents = len(self.allies)
        self.n_enemies = len(self.enemies)
        self.obs = ObservationBlocks(**self._blocks("obs", ObservationBlocks._fields))
        self.state = StateBlocks(**self._blocks("state", StateBlocks._fields))
        self.type_bits: int = self.info["num_unit_types"]
        self.shield_bits_ally = int(self.info["ally_has_shields"])
        self.shield_bits_enemy = int(self.info["enemy_has_shields"])
        self.map_size = np.array([self.info["width"], self.info["height"]], np.float32)
        self.walkable: Bools = np.array(self.info["walkable"], np.bool_)
        """[height, width]: `walkable[y, x]`, the southern row first."""

    def _check_options(self) -> None:
        options = self.info["smacv2"] or {}
        for name, plain in _PLAIN_OPTIONS.items():
            if options.get(name, plain) != plain:
                raise InvalidRequest(
                    f"{self.info['name']}: `{name}` of `smacv2` in the scenario is not {json.dumps(plain)}; "
                    f"{_OTHERS}"
                )

    def _blocks(self, field: Literal["obs", "state"], expected: tuple[str, ...]) -> dict[str, FeatureBlock]:
        blocks = feature_blocks(self.info["obs_layout" if field == "obs" else "state_layout"])
        if tuple(blocks) != expected:
            raise InvalidRequest(
                f"{self.info['name']}: options of `smacv2` in the scenario give `{field}` the parts "
                f"{', '.join(blocks)}, but this class reads {', '.join(expected)}; {_OTHERS}"
            )
        return blocks

    def squares(self, rel_x: Floats, rel_y: Floats) -> Floats:
        """Positions [..., 2] in squares, of `rel_x` and `rel_y` [...] as in the state.

        The features of the state are rounded, so a position may be off by a millionth of a square.
        """
        squares: Floats = np.stack((rel_x, rel_y), axis=-1) * self.map_size + self.map_size / np.float32(2)
        return squares

    def on_map(self, points: NDArray[np.int64]) -> Bools:
        """[...]: whether points [..., 2] lie on the map."""
        inside: Bools = np.all((points >= 0) & (points < self.map_size), axis=-1)
        return inside

    def off_or_walkable(self, points: NDArray[np.int64]) -> Bools:
        """[...]: whether points [..., 2] are walkable squares, or off the map."""
        inside = self.on_map(points)
        x, y = np.where(inside, points[..., 0], 0), np.where(inside, points[..., 1], 0)
        walkable: Bools = ~inside | self.walkable[y, x]
        return walkable


def feature_blocks(layout: list[LayoutPart]) -> dict[str, FeatureBlock]:
    """The parts of a layout by name, in order."""
    return {part["name"]: _block(**part) for part in layout}


def _block(name: str, start: int, shape: list[int], features: list[str], **_: list[float]) -> FeatureBlock:
    return FeatureBlock(start, tuple(shape), features)


def loses_draws(info: Scenario) -> bool:
    """Whether the agents have lost where the last units of both sides die together. SMACv2 looks at them
    first: where units can be healers, a side without one that fights has lost."""
    return info["smacv2"] is not None and any(unit_type["healer"] for unit_type in info["unit_types"])


def terminates_at_limit(info: Scenario) -> bool:
    """Whether episodes at their limit have terminated, as in SMACv2's published code."""
    return info["smacv2"] is not None and bool(info["smacv2"]["published"])


def limit_ends(envs: Envs | Wrapper) -> Callable[[Any], Bools]:
    """A function that says which steps of a batch ended an episode by its limit alone, bool [M].

    That is `truncated`, except with SMACv2's published code, which terminates such episodes. Batches do not
    tell whether healers alone live then, who have lost: such steps count as ended by the limit.
    """
    spec = envs.spec
    if not terminates_at_limit(scenario(unwrapped(envs))):
        return operator.attrgetter("truncated")

    def ended_by_limit(batch: Any) -> Bools:
        ends: Bools = batch.terminated & (batch.episode_length == spec.episode_limit)
        ends &= ~batch.battle_won & (batch.dead_allies < spec.n_agents)
        return ends

    return ended_by_limit


Bounds = tuple[Floats, Floats]
"""The least and the greatest values, float32 [size] each."""


def field_bounds(envs: Envs | Wrapper) -> dict[str, Bounds]:
    """The bounds of each float of `obs`, `state`, `enemy_obs` and `enemy_state`.

    Most features are between -1 and 1. Those of SMACv2's interface that can be beyond are the position of an
    agent on or near the map, distances if all units are shown, and health below a level of health. What a
    wrapper that changes batches makes of them has no bounds.
    """
    spec = envs.spec
    if _changes_batches(envs):
        sizes = [spec.obs_size, spec.state_size, spec.enemy_obs_size, spec.enemy_state_size]
        unbounded = [(np.full(n, -np.inf, np.float32), np.full(n, np.inf, np.float32)) for n in sizes]
        return dict(zip(("obs", "state", "enemy_obs", "enemy_state"), unbounded, strict=True))
    info = scenario(envs)
    state = layout_bounds(info["state_layout"], spec.state_size)
    # Enemies see what agents do without SMACv2: positions alone can be beyond, those of both sides by
    # as much.
    farthest = max(np.abs(bound).max(initial=1.0) for bound in state)
    of_enemies = np.full(spec.enemy_state_size, farthest, np.float32)
    return {
        "obs": layout_bounds(info["obs_layout"], spec.obs_size),
        "state": state,
        "enemy_obs": layout_bounds([], spec.enemy_obs_size),
        "enemy_state": (-of_enemies, of_enemies),
    }


def _changes_batches(envs: Envs | Wrapper) -> bool:
    from ._wrapper import Wrapper  # whose module imports this one

    if not isinstance(envs, Wrapper):
        return False
    return type(envs).change_batch is not Wrapper.change_batch or _changes_batches(envs.envs)


def layout_bounds(layout: list[LayoutPart], size: int) -> Bounds:
    """The bounds of floats with this layout, and of those that a lane appends: 0 or 1."""
    low, high = np.full(size, -1.0, np.float32), np.full(size, 1.0, np.float32)
    for part in layout:
        end = part["start"] + math.prod(part["shape"])
        rows = math.prod(part["shape"][:-1])
        low[part["start"] : end] = np.tile(np.array(part["low"], np.float32), rows)
        high[part["start"] : end] = np.tile(np.array(part["high"], np.float32), rows)
    return low, high


def unwrapped(scenario: Any) -> Any:
    """The environments below wrappers; the name or path of a scenario as it is."""
    return getattr(scenario, "unwrapped", scenario)
