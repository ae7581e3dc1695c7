"""Gymnasium's face: many battles as a `VectorEnv`, one as an `Env` (extra `gymnasium`).

    import gymnasium
    import smaclite_pool  # Gymnasium knows smaclite_pool/<scenario>-v0 and smaclite_pool/custom-v0 from here on

    envs = gymnasium.make_vec("smaclite_pool/2s3z-v0", num_envs=64)
    observations, infos = envs.reset(seed=1)
    for _ in range(200):
        actions = envs.action_space.sample()  # legal ones; observations["action_mask"] says which are
        observations, rewards, terminations, truncations, infos = envs.step(actions)
    envs.close()

Scenarios of one's own: `gymnasium.make_vec("smaclite_pool/custom-v0", num_envs=64, map_file="my_map.json")`. Where a
name is all one can give, "smaclite_pool:smaclite_pool/2s3z-v0" imports the package first.

`RecordEpisodeStatistics` works with every autoreset mode, but before Gymnasium 1.4 forgets the first step after a
same-step reset; `episode_return` and `episode_length` in `infos` need no wrapper.
"""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from typing import Any, Literal, TypeAlias

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from ._draw import draw
from ._layout import ScenarioLayout
from ._native import Batch, Envs, make
from ._registration import register
from ._smac_units import Field, Unit
from ._sights import SIGHTS
from ._spaces import (
    LegalActions,
    LegalActionsBatch,
    batched_action_space,
    batched_observation_space,
    single_action_space,
    single_observation_space,
)
from .errors import InvalidRequest

__all__ = ["BattleEnv", "BattleVectorEnv", "make_vector", "register"]

Arrays: TypeAlias = dict[str, NDArray[Any]]
Scenario: TypeAlias = "str | PathLike[str]"
JointAction: TypeAlias = Sequence["int | np.integer[Any]"]
Illegal: TypeAlias = Literal["error", "stop"]

STATISTICS = ("battle_won", "dead_allies", "dead_enemies", "episode_return", "episode_length")
MODES = {
    "next_step": AutoresetMode.NEXT_STEP,
    "same_step": AutoresetMode.SAME_STEP,
    "disabled": AutoresetMode.DISABLED,
}


def stops(illegal_actions: Illegal) -> bool:
    """Do units stop that are given an action which is not available?"""
    if illegal_actions not in ("error", "stop"):
        raise InvalidRequest(f'illegal_actions={illegal_actions!r}: "error" and "stop" are possible')
    return illegal_actions == "stop"


def made_legal(actions: Any, batch: Batch | None) -> NDArray[Any]:
    """`actions` [num_envs, n_agents] with a stop (of the dead a no-op) for each that is not available after `batch`."""
    given = np.asarray(actions)
    if batch is None:
        return given
    n_actions = batch.avail_actions.shape[-1]
    known = np.clip(given, 0, n_actions - 1)
    legal = np.take_along_axis(batch.avail_actions, known[..., None], axis=-1)[..., 0] & (known == given)
    stop = batch.avail_actions[..., 1].astype(given.dtype)  # the action's number is 1, the no-op's 0
    return np.where(legal, given, stop)


class BattleVectorEnv(gymnasium.vector.VectorEnv[Arrays, NDArray[Any], NDArray[Any]]):
    """The environments of a lane as a `gymnasium.vector.VectorEnv`.

    Observations are a dict: `obs` float32 [num_envs, n_agents, obs_size], `state` float32 [num_envs, state_size],
    `action_mask` int8 [num_envs, n_agents, n_actions]. Actions are integers [num_envs, n_agents]. Rewards are float64
    [num_envs], the team's. `infos` has battle_won, dead_allies, dead_enemies, episode_return and episode_length of the
    step just made, each [num_envs] with a `_key` mask. With same-step autoreset `final_obs` (an object array of dicts)
    and `final_info` are about the episodes that ended in the step, and observations of the next ones.

    Args:
        envs: a synchronous lane, from `smaclite_pool.make` or `smaclite_pool.connect`; closed with this object.
        illegal_actions: "error": a step with an action that is not available raises. "stop": who is given one stops,
            for learners that know no masks.
        copy: True: arrays are yours to keep and change. False: observations are read-only views of shared memory,
            and as many may be held as the lane's `max_held_batches`.
    """

    observation_space: spaces.Dict
    action_space: LegalActionsBatch
    single_observation_space: spaces.Dict
    single_action_space: spaces.MultiDiscrete

    def __init__(self, envs: Envs, *, illegal_actions: Illegal = "error", copy: bool = True) -> None:
        self.closed = True  # should this fail, the lane is still its owner's
        if envs.batch_size != envs.num_envs:
            raise InvalidRequest(
                f"a lane with batch_size={envs.batch_size} of {envs.num_envs} is asynchronous; a VectorEnv steps all "
                "environments at once (smaclite_pool.envpool does not)"
            )
        self._envs, self._copy = envs, copy
        self._stops = stops(illegal_actions)
        self._last: Batch | None = None  # what illegal actions are told by
        self.num_envs = envs.num_envs
        self.metadata = {"render_modes": [], "autoreset_mode": MODES[envs.autoreset]}
        self.single_observation_space = single_observation_space(envs)
        self.single_action_space = single_action_space(envs)
        self.observation_space = batched_observation_space(envs)
        self.action_space = batched_action_space(envs)
        fields = envs.fields
        self._sights = {name: field for name, field in SIGHTS.items() if field in fields}
        self._statistics = [name for name in STATISTICS if name in fields]
        self.closed = False

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Arrays, dict[str, Any]]:
        """Begin new episodes: in all environments, or where `options["reset_mask"]`, bool [num_envs], says so.

        With a seed, environment i is seeded with seed + i; without one its generator goes on.
        """
        super().reset(seed=seed)
        mask = (options or {}).get("reset_mask")
        if mask is not None and not np.any(mask):
            raise InvalidRequest("options['reset_mask'] chooses no environment; at least one must be True")
        batch = self._envs.reset(seed, mask=mask)
        self._last = batch if self._stops else None
        present = np.ones(self.num_envs, np.bool_) if mask is None else mask
        return self._observations(batch, ""), self._infos(batch, present)

    def step(
        self, actions: NDArray[Any]
    ) -> tuple[Arrays, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Step every environment by the actions of its agents, integers [num_envs, n_agents].

        Raises IllegalAction for an action that is not available; then nothing was stepped. With next-step autoreset
        the actions of an environment whose episode has just ended are ignored.
        """
        batch = self._envs.step(made_legal(actions, self._last) if self._stops else actions)
        self._last = batch if self._stops else None
        infos = self._infos(batch, np.ones(self.num_envs, np.bool_))
        if self._envs.autoreset == "same_step":
            self._add_final(infos, batch)
        terminated, truncated = batch.terminated.copy(), batch.truncated.copy()
        return self._observations(batch, ""), batch.reward.astype(np.float64), terminated, truncated, infos

    def _observations(self, batch: Batch, prefix: Literal["", "final_"]) -> Arrays:
        seen: Arrays = {}
        for name, field in self._sights.items():
            array = getattr(batch, prefix + field)
            array = array.copy() if self._copy else array
            seen[name] = array.view(np.int8) if array.dtype == np.bool_ else array
        return seen

    def _infos(self, batch: Batch, present: NDArray[np.bool_]) -> dict[str, Any]:
        infos: dict[str, Any] = {}
        for name in self._statistics:
            array = getattr(batch, name)
            infos[name] = np.where(present, array, array.dtype.type(0))
            infos[f"_{name}"] = present.copy()
        return infos

    def _add_final(self, infos: dict[str, Any], batch: Batch) -> None:
        ended = batch.terminated | batch.truncated
        if not ended.any():
            return
        last = self._observations(batch, "final_")
        final_obs = np.full(self.num_envs, None, dtype=object)
        for env in np.flatnonzero(ended):
            final_obs[env] = {name: array[env] for name, array in last.items()}
        infos["final_obs"], infos["_final_obs"] = final_obs, ended
        infos["final_info"], infos["_final_info"] = self._infos(batch, ended), ended.copy()

    def close_extras(self, **kwargs: Any) -> None:
        """Close the environments."""
        self._envs.close()


def make_vector(
    scenario: Scenario | None = None,
    num_envs: int = 1,
    *,
    map_file: Scenario | None = None,
    autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
    max_episode_steps: int | None = None,
    seed: int | None = None,
    illegal_actions: Illegal = "error",
    copy: bool = True,
    **settings: Any,
) -> BattleVectorEnv:
    """A pool within this process as a `VectorEnv`: what `gymnasium.make_vec` calls.

    Args:
        scenario, map_file: a standard scenario, or the path of a scenario file; one of them.
        num_envs: environments.
        autoreset_mode: an `AutoresetMode`, its value ("NextStep") or this package's word for it ("next_step").
        max_episode_steps: steps after which an episode is truncated; None for the scenario's own limit.
        seed: environment i is seeded with seed + i until a reset says otherwise; None for a random seed.
        illegal_actions, copy: as in `BattleVectorEnv`.
        settings: `threads`, `rules`, `fields`, `wait` and the like, as `smaclite_pool.make` takes them.
    """
    words = {mode.value: word for word, mode in MODES.items()}
    wanted = autoreset_mode.value if isinstance(autoreset_mode, AutoresetMode) else autoreset_mode
    if max_episode_steps is not None:
        settings["episode_limit"] = max_episode_steps
    settings.update(seed=_seed_or_random(seed), autoreset=words.get(wanted, wanted))
    envs = make(_one_of(scenario, map_file), num_envs, **settings)
    return BattleVectorEnv(envs, illegal_actions=illegal_actions, copy=copy)


class BattleEnv(gymnasium.Env[tuple[NDArray[np.float32], ...], JointAction]):
    """One battle with the spaces, types and methods of the published environment.

    An observation is a tuple of float32 [obs_size], one an agent; so is an action of integers. `info` holds numbers
    only: battle_won, dead_allies, dead_enemies, and `episode_limit` on the step that this environment truncates.
    One battle is a slow way to play; to train fast, step many at once with `gymnasium.make_vec`.

    Args:
        scenario, map_file: a standard scenario, or the path of a scenario file; one of them.
        seed: of the first reset that gives none; None for one drawn from NumPy's global generator.
        episode_limit: steps after which an episode is truncated; None for no limit; "default" for the scenario's own.
        illegal_actions: "error" or "stop", as in `BattleVectorEnv`.
        render_mode: "rgb_array" for pictures; Gymnasium makes "human" of it (needs pygame).
        settings: `rules`, `wait` and the like, as `smaclite_pool.make` takes them.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 2}  # a step is half a second
    picture_size = (640, 640)
    observation_space: spaces.Tuple  # type: ignore[type-arg] # not generic at run time before gymnasium 1.4
    action_space: LegalActions

    def __init__(
        self,
        scenario: Scenario | None = None,
        *,
        map_file: Scenario | None = None,
        seed: int | None = None,
        episode_limit: int | Literal["default"] | None = "default",
        illegal_actions: Illegal = "error",
        render_mode: str | None = None,
        **settings: Any,
    ) -> None:
        self._stops = stops(illegal_actions)
        name = _one_of(scenario, map_file)
        self._layout = ScenarioLayout(name)
        self._next_seed: int | None = _seed_or_random(seed)
        self._np_random, self._np_random_seed = seeding.np_random(self._next_seed)
        # One battle a process and many processes is how this is used: who spins takes time from the others.
        settings = {"threads": 1, "wait": "block", **settings}
        self._envs = make(name, 1, autoreset="disabled", episode_limit=episode_limit, **settings)
        self._batch: Batch | None = None
        self.render_mode = render_mode
        self.n_agents, self.n_enemies = self._envs.n_agents, self._envs.n_enemies
        self.n_actions = self._envs.n_actions
        self.obs_size, self.state_size = self._envs.obs_size, self._envs.state_size
        self.observation_space = spaces.Tuple(
            [spaces.Box(-1.0, 1.0, (self.obs_size,), np.float32) for _ in range(self.n_agents)]
        )
        targets = [self.n_agents - 1 if unit["healer"] else self.n_enemies for unit in self._layout.ally_figures]
        self.action_space = LegalActions(self._envs, [6 + each for each in targets])

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[tuple[NDArray[np.float32], ...], dict[str, Any]]:
        """Begin a new battle; with a seed the generator starts anew, without one it goes on. `options` are ignored."""
        super().reset(seed=seed)
        self._batch = self._envs.reset(self._next_seed if seed is None else seed)
        self._next_seed = None
        return self.get_obs(), self._info()

    def step(
        self, action: JointAction
    ) -> tuple[tuple[NDArray[np.float32], ...], float, bool, bool, dict[str, Any]]:
        """Step the battle by one action an agent, of the dead too (their no-op).

        Raises IllegalAction for an action that is not available, and InvalidRequest after the battle's end; then
        nothing was stepped.
        """
        actions: Any = made_legal([action], self._batch) if self._stops else [action]
        batch = self._batch = self._envs.step(actions)
        truncated = batch.truncated[0].item()
        info = self._info()
        if truncated:
            info["episode_limit"] = True
        return self.get_obs(), batch.reward[0].item(), batch.terminated[0].item(), truncated, info

    def _info(self) -> dict[str, Any]:
        return {name: getattr(self._now(), name)[0].item() for name in ("battle_won", "dead_allies", "dead_enemies")}

    def _now(self) -> Batch:
        if self._batch is None:
            raise InvalidRequest("no battle is on: reset begins one")
        return self._batch

    def get_obs(self) -> tuple[NDArray[np.float32], ...]:
        """What each agent observes, float32 [obs_size]; zeros for the dead."""
        return tuple(self._now().obs[0].copy())

    def get_state(self) -> NDArray[np.float32]:
        """The global state, float32 [state_size], for training only."""
        state: NDArray[np.float32] = self._now().state[0].copy()
        return state

    def get_avail_actions(self) -> list[NDArray[np.float64]]:
        """Which actions each agent may take, 0 or 1 [n_actions]."""
        return list(self._now().avail_actions[0].astype(np.float64))

    @property
    def agents(self) -> dict[int, Unit]:
        """The living agents' units by their ids; none before the first reset."""
        return self._living(0, self.n_agents)

    @property
    def enemies(self) -> dict[int, Unit]:
        """The living enemies by their ids; none before the first reset."""
        return self._living(self.n_agents, self.n_enemies)

    def _living(self, first: int, count: int) -> dict[int, Unit]:
        if self._batch is None:
            return {}
        field = self._field()
        return {i: field.unit(first + i) for i in range(count) if field.health[first + i] > 0}

    def _field(self) -> Field:
        field = Field(self._layout)
        field.see(self._layout.state(self._now().state[0]))
        return field

    def render(self) -> Any:
        """The battle from above, uint8 [640, 640, 3]."""
        return draw(self._layout, self._field(), *self.picture_size)

    def close(self) -> None:
        """End the battle. A second time does nothing."""
        self._envs.close()


def _one_of(scenario: Scenario | None, map_file: Scenario | None) -> Scenario:
    if map_file is not None:
        return map_file
    if scenario is None:
        raise InvalidRequest("which battle? give map_file, the path of a scenario file")
    return scenario


def _seed_or_random(seed: int | None) -> int:
    # From the global generator, as the published environment does it, so that numpy.random.seed decides.
    return int(np.random.randint(2**31 - 1)) if seed is None else seed
