"""Observations and states as rows of equal width, one per unit, for graph and attention networks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._layout import Bools, FeatureBlock, Floats, feature_blocks, unwrapped
from ._native import Envs
from ._native import scenario as native_scenario
from .errors import InvalidRequest

if TYPE_CHECKING:
    from ._wrapper import Wrapper


class EntityRows(NamedTuple):
    """The units that each agent sees, and what it knows of itself."""

    features: Floats
    """float32 [M, A, n, F]: a row per other unit, zeros for those that the agent does not see."""
    mask: Bools
    """bool [M, A, n]: which of them it sees."""
    own: Floats
    """float32 [M, A, own]: the rest of the observation from the agent's own features on, a view."""
    moves: Floats
    """float32 [M, A, moves]: its first features, about moves and the terrain around, a view."""


class Entities:
    """A function from batches to rows of equal width, one row per unit.

        entities = smaclite_pool.extras.Entities(envs)
        rows = entities(batch)                  # rows.features, rows.mask, rows.own, rows.moves

    The rows of an observation are those of the enemies by id, `entities.enemies`, and then those of the other
    agents by id, `entities.allies`. If both sides have the same features, `features` is a read-only view of
    `batch.obs`, and nothing is copied. Otherwise it is a copy, in which features that a side does not have
    are zeros: for instance shields, if only one side has them. `is_view` says which of the two it is.

    Args:
        scenario: environments, or a wrapper of them that leaves observations as they are; or a standard
            scenario or the path of a scenario file, whose observations nothing changes.

    A batch of other numbers of agents or features is refused with InvalidRequest.

    Raises:
        ScenarioError: the scenario is unknown or invalid.
        InvalidRequest: its observations have no units (`obs_starcraft` of `smacv2` is false).
    """

    features: list[str]
    """Names of the last axis of the rows. The first, "seen", is whether the target action of an enemy is
    available, and 1 for allies in sight."""
    enemies: slice
    """The rows of the enemies."""
    allies: slice
    """The rows of the other agents."""
    is_view: bool
    """Whether the rows are a view of `batch.obs`."""
    state_features: list[str]
    """Names of the last axis of the rows of `state`."""

    def __init__(self, scenario: str | PathLike[str] | Envs | Wrapper) -> None:
        envs = unwrapped(scenario)
        info = native_scenario(envs)
        blocks, state = feature_blocks(info["obs_layout"]), feature_blocks(info["state_layout"])
        self._name, self._n_agents = info["name"], len(info["allies"])
        # Environments append features that the layout does not have, such as the last actions.
        spec = envs.spec if isinstance(envs, Envs) else None
        self._obs_size = spec.obs_size if spec else _size(blocks)
        self._state_size = spec.state_size if spec else _size(state)
        if "enemies" not in blocks:
            raise InvalidRequest("observations must have units, but `obs_starcraft` of `smacv2` is false")
        enemies, allies = blocks["enemies"], blocks["allies"]
        self._moves, self._own, self._blocks = blocks["moves"], blocks["own"].start, (enemies, allies)
        n_enemies, n_allies = enemies.shape[0], allies.shape[0]
        self.enemies, self.allies = slice(0, n_enemies), slice(n_enemies, n_enemies + n_allies)
        names = [["seen", *block.features[1:]] for block in self._blocks]
        self.features = list(dict.fromkeys(name for side in names for name in side))
        self.is_view = names[0] == names[1]
        self._columns = [[self.features.index(name) for name in side] for side in names]
        self._state = [state[name] for name in ("allies", "enemies") if name in state]
        self.state_features = list(dict.fromkeys(name for block in self._state for name in block.features))

    def __call__(self, batch: Any) -> EntityRows:
        """The rows of `batch.obs`, float32 [M, A, obs_size]."""
        obs: Floats = batch.obs
        self._check("observations", obs, (self._n_agents, self._obs_size))
        if self.is_view:
            start, end = self._blocks[0].start, self._own
            features = obs[..., start:end].reshape(*obs.shape[:-1], -1, len(self.features))
        else:
            features = _padded(obs, self._blocks, self._columns, len(self.features))
        mask: Bools = np.any(features != 0, axis=-1)
        return EntityRows(features, mask, obs[..., self._own :], self._moves.view(obs))

    def state(self, batch: Any) -> tuple[Floats, Bools]:
        """The rows of `batch.state`: agents by id, then enemies by id, with the features `state_features`.

        Returns float32 [M, A + E, F], a copy, as agents have features that enemies do not have; and bool
        [M, A + E]: which of them are alive. Raises InvalidRequest if states have no rows of units
        (`obs_instead_of_state` of `smacv2`).
        """
        if not self._state:
            raise InvalidRequest("states must have units, but `obs_instead_of_state` of `smacv2` is true")
        columns = [[self.state_features.index(name) for name in block.features] for block in self._state]
        self._check("states", batch.state, (self._state_size,))
        rows = _padded(batch.state, self._state, columns, len(self.state_features))
        # Not health above 0: with SMACv2's `health` a unit below its level lives until the end of the step.
        return rows, np.any(rows != 0, axis=-1)

    def _check(self, name: str, array: Floats, expected: tuple[int, ...]) -> None:
        """A batch of another scenario would be cut into rows of nonsense."""
        if array.shape[-len(expected) :] != expected:
            axes = ", ".join(map(str, ("M", *expected)))
            raise InvalidRequest(
                f"{name} must be those of {self._name} as the environments give them, [{axes}], got "
                f"{list(array.shape)}"
            )


def _size(blocks: dict[str, FeatureBlock]) -> int:
    """How many features the blocks have together."""
    return max((block.start + math.prod(block.shape) for block in blocks.values()), default=0)


def _padded(
    array: Floats, blocks: Sequence[FeatureBlock], columns: list[list[int]], width: int
) -> NDArray[np.float32]:
    """The rows of blocks, one after the other, with features in these columns and zeros elsewhere."""
    n_rows = sum(block.shape[0] for block in blocks)
    rows = np.zeros((*array.shape[:-1], n_rows, width), np.float32)
    first = 0
    for block, own in zip(blocks, columns, strict=True):
        rows[..., first : first + block.shape[0], own] = block.view(array)
        first += block.shape[0]
    return rows
