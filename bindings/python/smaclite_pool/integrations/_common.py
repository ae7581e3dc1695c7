"""Shared by several integrations: names of observations and infos, and single battles. Needs no framework."""

from __future__ import annotations

import inspect
import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from os import PathLike
from typing import Any, Literal, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from .._layout import Bounds, field_bounds, limit_ends, loses_draws, terminates_at_limit
from .._native import NO_OP, STOP, Batch, Envs, check_settings, make, scenario, snapshot_columns
from ..errors import InvalidRequest

IllegalActions: TypeAlias = Literal["error", "stop"]

Copied = TypeVar("Copied", bound="CopiedByArguments")

OBSERVATION_KEYS = {"obs": "obs", "state": "state", "action_mask": "avail_actions"}
"""Keys of the observations of vector environments, and the field of a batch that each one contains."""

ENEMY_OBSERVATION_KEYS = {
    "enemy_obs": "enemy_obs",
    "enemy_state": "enemy_state",
    "enemy_action_mask": "enemy_avail_actions",
}
"""The same of the enemies, where actions play both sides."""

OUTCOME_FIELDS = ("battle_won", "dead_allies", "dead_enemies")
"""Fields of a batch in the info of a single battle."""

INFO_FIELDS = (*OUTCOME_FIELDS, "episode_return", "episode_length")
"""Fields of a batch in the infos of vector environments. `Envs.spec.fields` has their dtypes."""


ENEMY_FIELDS = ("enemy_obs", "enemy_avail_actions", "enemy_reward")
"""Fields of the enemies, where actions play both sides."""

SHARE_FIELDS = ("reward_agents", "enemy_reward_agents")
"""Fields of the shares of single units in the rewards."""

SINGLE_BATTLE_FIELDS = (*OBSERVATION_KEYS.values(), *INFO_FIELDS, *ENEMY_FIELDS, "snapshot")
"""Fields of the lane of a single battle; a lane leaves those out that it cannot have."""


def check_one_side(envs: Envs) -> Envs:
    """The environments, if a script plays their enemies. Raises InvalidRequest if actions play them, too."""
    if envs.spec.sides != "allies":
        raise InvalidRequest(
            f"sides must be 'allies' here, got '{envs.spec.sides}'; smaclite_pool.make, PettingZoo, RLlib, "
            "TorchRL and the EnvPool API play both sides"
        )
    return envs


WAITS_FOR_RESET = "waits for a reset when it has ended"
"""Why an environment takes no `autoreset_mode`."""


FIXED_SETTINGS = {
    "fields": "has all fields",
    "num_envs": "is one environment",
    "autoreset_mode": WAITS_FOR_RESET,
    "lanes": "has one lane",
}
"""Settings that a single battle decides itself, and why."""


def refuse_settings(user: str, fixed: Mapping[str, str], settings: Mapping[str, Any]) -> None:
    """Raise InvalidRequest, in the name of the user, for settings that it decides; `fixed` says why."""
    for name, why in fixed.items():
        if name in settings:
            raise InvalidRequest(f"{user} {why}; remove `{name}`")


def require_fields(envs: Envs, user: str, names: Iterable[str]) -> None:
    """Raise InvalidRequest, in the name of the user, for fields among `names` that the lane omits."""
    missing = [f"`{name}`" for name in names if name not in envs.spec.fields]
    if missing:
        raise InvalidRequest(f"{user} needs {', '.join(missing)} among `fields`, which this lane omits")


def check_keywords(
    made_by: Callable[..., Any], settings: Mapping[str, Any], refused: Iterable[str] = ()
) -> None:
    """Raise TypeError, in the name of a function or class, for settings that `smaclite_pool.make` lacks.

    The error lists what is accepted, without the settings of `make` that are `refused` later. Raises
    InvalidRequest for several lanes, which are several environments to learners.
    """
    # Metaclasses, such as TorchRL's, hide the arguments of a class.
    is_class = isinstance(made_by, type)
    parameters = list(inspect.signature(made_by.__init__ if is_class else made_by).parameters.values())
    own = [
        parameter.name for parameter in parameters[is_class:] if parameter.kind is not parameter.VAR_KEYWORD
    ]
    check_settings(made_by.__name__, dict(settings), own, ["lanes", *refused])
    if "lanes" in settings:
        raise InvalidRequest("`lanes` is for smaclite_pool.make alone; remove it")


def stop_unavailable(actions: Any, avail_actions: NDArray[np.bool_]) -> NDArray[Any]:
    """Replace every unavailable action by a stop, or by a no-op if the agent is dead.

    `actions` are integers [..., n_agents], `avail_actions` [..., n_agents, n_actions]. Actions of another
    shape or dtype are returned as they are; the pool refuses them with an error that says what is accepted.
    """
    given = np.asarray(actions)
    if given.shape != avail_actions.shape[:-1] or not np.issubdtype(given.dtype, np.integer):
        return given
    known = np.clip(given, 0, avail_actions.shape[-1] - 1)
    available = np.take_along_axis(avail_actions, known[..., None], axis=-1)[..., 0] & (known == given)
    fallback = np.where(avail_actions[..., STOP], STOP, NO_OP).astype(given.dtype)
    return np.where(available, given, fallback)


def stops(illegal_actions: IllegalActions) -> bool:
    if illegal_actions not in ("error", "stop"):
        raise InvalidRequest(f'illegal_actions must be "error" or "stop", got {illegal_actions!r}')
    return illegal_actions == "stop"


class Ends:
    """Says of restored battles which have ended: batches say how a step ended a battle, and there was none.

    Args:
        envs: the environments of the lane; batches must have the fields of `FIELDS`.
    """

    FIELDS = ("dead_allies", "dead_enemies", "episode_length", "snapshot")

    def __init__(self, envs: Envs) -> None:
        self._spec, info = envs.spec, scenario(envs)
        self._heals = np.array([unit_type["healer"] for unit_type in info["unit_types"]])
        # With SMACv2's interface, healers alone have lost.
        self._has_fighters = loses_draws(info)
        self._terminates_late = terminates_at_limit(info)

    def __call__(self, batch: Batch) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Whether each battle has terminated and whether it was truncated, bool [M]."""
        spec = self._spec
        terminated = (batch.dead_allies == spec.n_agents) | (batch.dead_enemies == spec.n_enemies)
        if self._has_fighters:
            lost = [self._has_healers_alone(record) for record in batch.snapshot]
            terminated |= np.array(lost) & (batch.episode_length > 0)
        is_late = batch.episode_length >= (np.inf if spec.episode_limit is None else spec.episode_limit)
        if self._terminates_late:
            return terminated | is_late, np.zeros_like(terminated)
        return terminated, ~terminated & is_late

    def _has_healers_alone(self, record: NDArray[np.uint8]) -> bool:
        columns = snapshot_columns(record)
        fights = columns["alive"].astype(np.bool_) & ~self._heals[columns["unit_type"]]
        n_agents = self._spec.n_agents
        return not (fights[:n_agents].any() and fights[n_agents:].any())


class CopiedByArguments:
    """Mixed into single environments: before the first reset, a copy is made anew from the same arguments.

    So are most environments of Gymnasium and PettingZoo copied. Without a seed among the arguments, each copy
    draws its own.
    """

    _battle: SingleBattle
    _arguments: tuple[tuple[Any, ...], dict[str, Any]]
    __signature__: inspect.Signature

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        # Else `help` would show the arguments of `__new__`.
        signature = inspect.signature(cls.__init__)
        cls.__signature__ = signature.replace(parameters=[*signature.parameters.values()][1:])

    def __new__(cls: type[Copied], *args: Any, **kwargs: Any) -> Copied:
        made = super().__new__(cls)
        made._arguments = args, kwargs
        return made

    def __reduce_ex__(self, protocol: Any) -> tuple[Any, ...]:
        if self._battle.has_begun:
            raise TypeError(
                f"{type(self).__name__} cannot be copied or pickled after its first reset: "
                "`save` and `restore` carry its battle to another environment with the same arguments, and "
                "`Envs.fork` of smaclite_pool.make copies battles inside a pool"
            )
        args, kwargs = self._arguments
        return _made_again, (type(self), args, kwargs)


def _made_again(made: type[Copied], args: tuple[Any, ...], kwargs: dict[str, Any]) -> Copied:
    return made(*args, **kwargs)


@dataclass(frozen=True)
class TimeStep:
    """A battle after a reset or step. Arrays are copies, as a lane limits the batches that can be held."""

    obs: NDArray[np.float32]
    """float32 [n_agents, obs_size]."""
    avail_actions: NDArray[np.bool_]
    """bool [n_agents, n_actions]."""
    state: NDArray[np.float32]
    """float32 [state_size]."""
    reward: float
    """The team reward."""
    terminated: bool
    truncated: bool
    at_limit: bool
    """Whether the step ended the episode by its limit alone."""
    episode_return: float
    """Sum of rewards so far."""
    episode_length: int
    """Steps so far."""
    snapshot: NDArray[np.uint8]
    """uint8 [snapshot_size]: the battle, to restore it later."""
    info: dict[str, Any]
    """`battle_won` (bool), `dead_allies` and `dead_enemies` (int)."""
    shares: list[float] | None
    """The share of each unit of `rows` in the reward of its team, if the battle has them."""
    enemy_obs: Sequence[NDArray[np.float32]] = ()
    """Those of each enemy, if actions play both sides; so are the next two."""
    enemy_avail_actions: Sequence[NDArray[np.bool_]] = ()
    enemy_reward: float = 0.0

    @property
    def ended(self) -> bool:
        """Whether the episode has ended."""
        return self.terminated or self.truncated

    @property
    def rows(self) -> list[NDArray[np.float32]]:
        """The observation of each agent, and then of each enemy if actions play both sides."""
        return [*self.obs, *self.enemy_obs]

    @property
    def masks(self) -> list[NDArray[np.bool_]]:
        """The available actions of the units of `rows`."""
        return [*self.avail_actions, *self.enemy_avail_actions]

    @property
    def rewards(self) -> list[float]:
        """The reward of the team of each unit of `rows`."""
        return [self.reward] * len(self.obs) + [self.enemy_reward] * len(self.enemy_obs)

    @property
    def totals(self) -> dict[str, Any]:
        """`info` with `episode_return` and `episode_length`."""
        return {**self.info, "episode_return": self.episode_return, "episode_length": self.episode_length}

    @staticmethod
    def of(batch: Batch, at_limit: bool = False) -> TimeStep:
        """The only environment of a batch."""
        enemies: dict[str, Any] = {name: batch[name][0].copy() for name in ENEMY_FIELDS if name in batch}
        if enemies:
            enemies["enemy_reward"] = enemies["enemy_reward"].item()
        shares = [name for name in SHARE_FIELDS if name in batch]
        return TimeStep(
            obs=batch.obs[0].copy(),
            avail_actions=batch.avail_actions[0].copy(),
            state=batch.state[0].copy(),
            reward=batch.reward[0].item(),
            terminated=batch.terminated[0].item(),
            truncated=batch.truncated[0].item(),
            at_limit=at_limit,
            episode_return=batch.episode_return[0].item(),
            episode_length=batch.episode_length[0].item(),
            snapshot=batch.snapshot[0].copy(),
            info={name: getattr(batch, name)[0].item() for name in OUTCOME_FIELDS},
            shares=[share for name in shares for share in getattr(batch, name)[0].tolist()] or None,
            **enemies,
        )


class SingleBattle:
    """A pool of one environment, which waits for a reset when its battle has ended.

    A reset uses the seed that it is given, or else the seed of `seed_next_reset`. Without either the first
    reset uses the seed of `settings`, or a random one, and later ones continue the random generator.

    Args:
        scenario: a standard scenario or the path of a scenario file.
        settings: `seed`, `episode_limit`, `rules` and other arguments of `smaclite_pool.make`, except
            `num_envs`, `fields`, `autoreset_mode` and `lanes`.
        both_sides: whether `sides="both"` is accepted among them; then `agents` has the enemies too.
        shares: whether steps have the `shares` of single units.

    Raises InvalidRequest, ScenarioError and StartError.
    """

    def __init__(
        self,
        scenario: str | PathLike[str],
        settings: Mapping[str, Any],
        *,
        both_sides: bool = False,
        shares: bool = False,
    ) -> None:
        refuse_settings("a single battle", FIXED_SETTINGS, settings)
        fields = [*SINGLE_BATTLE_FIELDS, *(SHARE_FIELDS if shares else ())]
        # Frameworks run many of these per machine, where a thread that spins takes CPU time from the others.
        defaults = {"threads": 1, "wait": "block", "max_held_batches": 2}
        self.envs: Envs = make(
            scenario, 1, autoreset_mode="Disabled", fields=fields, **{**defaults, **settings}
        )
        if not both_sides:
            check_one_side(self.envs)
        self._limit_ends = limit_ends(self.envs)
        spec = self.envs.spec
        self.agents = [f"agent_{agent}" for agent in range(spec.n_agents)]
        if spec.sides != "allies":
            self.agents += [f"enemy_{enemy}" for enemy in range(spec.n_enemies)]
        self._next_seed: int | None = None
        self._last: TimeStep | None = None

    @property
    def last(self) -> TimeStep:
        """The result of the last step or reset. Raises InvalidRequest before the first reset."""
        if self._last is None:
            raise InvalidRequest("no battle has begun; call reset first")
        return self._last

    @property
    def has_begun(self) -> bool:
        """Whether there was a reset."""
        return self._last is not None

    def seed_next_reset(self, seed: int) -> None:
        """Use this seed for the next reset that is not given one."""
        self._next_seed = seed

    def reset(self, seed: int | None = None, options: Mapping[str, Any] | None = None) -> TimeStep:
        """Begin a battle, or continue from `options["snapshot"]`."""
        snapshot = (options or {}).get("snapshot")
        if snapshot is not None:
            return self.restore(snapshot, seed)
        self._last = TimeStep.of(self.envs.reset(self._next_seed if seed is None else seed))
        self._next_seed = None
        return self._last

    @cached_property
    def _ends(self) -> Ends:
        return Ends(self.envs)

    def restore(self, snapshot: NDArray[np.uint8], seed: int | None = None) -> TimeStep:
        """Continue from a snapshot; with a seed, with execution orders drawn from it.

        Raises InvalidRequest for a snapshot of another scenario or rule set.
        """
        batch = self.envs.reset(seed, snapshots=snapshot)
        terminated, truncated = self._ends(batch)
        self._last = replace(
            TimeStep.of(batch), terminated=terminated[0].item(), truncated=truncated[0].item()
        )
        return self._last

    def step(self, actions: Sequence[int | np.integer[Any]] | NDArray[Any]) -> TimeStep:
        """Step by one action per agent, including dead agents.

        Raises IllegalAction for an unavailable action, and InvalidRequest for a wrong number of actions or
        after the end of the battle; nothing is stepped then.
        """
        if self.last.ended:
            raise InvalidRequest("the battle has ended; call reset first")
        given, expected = np.asarray(actions).shape, (len(self.agents),)
        if given != expected:
            raise InvalidRequest(f"actions must have one integer per agent, shape {expected}, got {given}")
        joint: Any = [actions]
        batch = self.envs.step(joint)
        self._last = TimeStep.of(batch, self._limit_ends(batch)[0].item())
        return self._last

    def step_by_name(self, actions: Mapping[str, int | np.integer[Any]]) -> TimeStep:
        """`step` by a dict with an action for every name in `agents`."""
        if not isinstance(actions, Mapping):
            raise TypeError(f"actions must be a dict of agents and actions, got {type(actions).__name__}")
        if not self.last.ended and (missing := [agent for agent in self.agents if agent not in actions]):
            raise InvalidRequest(
                f"actions must contain every agent, missing {', '.join(missing)}; dead agents use 0 (no-op)"
            )
        if unknown := [agent for agent in actions if agent not in self.agents]:
            raise InvalidRequest(
                f"actions contain {', '.join(map(repr, unknown))}; agents are {', '.join(self.agents)}"
            )
        return self.step([self._action(agent, actions.get(agent, 0)) for agent in self.agents])

    @staticmethod
    def _action(agent: str, action: Any) -> int:
        try:
            return operator.index(action)  # not int, for which 1.9 is 1
        except TypeError:
            got = action.item() if isinstance(action, np.ndarray) and action.ndim == 0 else action
            raise InvalidRequest(f"the action of {agent} must be an integer, got {got!r}") from None

    @property
    def sizes(self) -> dict[str, tuple[int, int]]:
        """`obs_size` and `n_actions` by name."""
        spec = self.envs.spec
        own = dict.fromkeys(self.agents[: spec.n_agents], (spec.obs_size, spec.n_actions))
        sizes = (spec.enemy_obs_size, spec.n_enemy_actions)
        return own | dict.fromkeys(self.agents[spec.n_agents :], sizes)

    @property
    def obs_bounds(self) -> dict[str, Bounds]:
        """The least and the greatest values of observations by name."""
        bounds, n_agents = field_bounds(self.envs), self.envs.spec.n_agents
        own = dict.fromkeys(self.agents[:n_agents], bounds["obs"])
        return own | dict.fromkeys(self.agents[n_agents:], bounds["enemy_obs"])

    def description(self, of: object) -> str:
        """The `repr` of the environment `of`, which plays this battle."""
        spec = self.envs.spec
        return f"<{type(of).__name__} {spec.scenario}, {len(self.agents)} agents, seed {spec.seed}>"

    def close(self) -> None:
        """End the pool. Calling it again has no effect."""
        self.envs.close()
