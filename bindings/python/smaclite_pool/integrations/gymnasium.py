"""Gymnasium: many battles as a `VectorEnv`, or one as an `Env` (extra `gymnasium`).

    import gymnasium
    import smaclite_pool.integrations.gymnasium  # registers smaclite_pool/2s3z-v0 and the other ids

    envs = gymnasium.make_vec("smaclite_pool/2s3z-v0", num_envs=64)
    observations, infos = envs.reset(seed=1)
    for _ in range(200):
        actions = envs.action_space.sample()  # available actions, see observations["action_mask"]
        observations, rewards, terminations, truncations, infos = envs.step(actions)
    envs.close()

Importing this module registers `smaclite_pool/<scenario>-v0` for each standard scenario, and
`smaclite_pool/custom-v0` for scenario files:
`gymnasium.make_vec("smaclite_pool/custom-v0", num_envs=64, map_file="my_map.json")`. Where only a name can be
given, as in configuration files, put the module in front, and Gymnasium imports it:
"smaclite_pool.integrations.gymnasium:smaclite_pool/2s3z-v0".

Each id serves both functions of Gymnasium, with the same observations and actions:

- `gymnasium.make_vec` returns a `BattleVectorEnv`, one pool that steps all battles at once. Use it for
  training. (Its `vectorization_mode` "sync" or "async" combines single environments instead, which is
  slower.)
- `gymnasium.make` returns a `BattleEnv`, a single battle. For the interface of the published SMAClite, with
  tuples per agent, see `smaclite_pool.compat`.

`RecordEpisodeStatistics` works with every autoreset mode, but before Gymnasium 1.4 it loses the first step
after a same-step reset; `episode_return` and `episode_length` in `infos` need no wrapper. TorchRL's
`GymWrapper` needs `autoreset_mode="Disabled"`, and renames the key `state` to `observation`; the module
`smaclite_pool.integrations.torchrl` needs no wrapper.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from os import PathLike
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._extra import extra
from .._layout import unwrapped
from .._native import Batch, Envs, Renderer, make, scenarios
from .._render import (
    RENDER_FPS,
    RENDER_MODES,
    BattleViewer,
    LaneViewer,
    Picture,
    check_rendering,
)
from .._requirements import require_integer, require_names, require_synchronous
from ..errors import InvalidRequest
from ._common import (
    FIXED_SETTINGS,
    INFO_FIELDS,
    OBSERVATION_KEYS,
    CopiedByArguments,
    IllegalActions,
    SingleBattle,
    TimeStep,
    check_keywords,
    check_one_side,
    require_fields,
    stop_unavailable,
    stops,
)

with extra("gymnasium"):
    import gymnasium
    from gymnasium import spaces
    from gymnasium.utils import seeding
    from gymnasium.vector import AutoresetMode

    from ._spaces import (
        AvailableBox,
        AvailableMultiDiscrete,
        batched_action_space,
        batched_observation_space,
        single_action_space,
        single_observation_space,
    )

__all__ = ["BattleEnv", "BattleVectorEnv", "make_vector"]

Arrays: TypeAlias = dict[str, NDArray[Any]]
Scenario: TypeAlias = "str | PathLike[str]"


class BattleVectorEnv(gymnasium.vector.VectorEnv[Arrays, NDArray[Any], NDArray[Any]]):
    """The environments of a lane as a `gymnasium.vector.VectorEnv`.

    Observations are a dict of `obs` float32 [num_envs, n_agents, obs_size], `state` float32 [num_envs,
    state_size] and `action_mask` int8 [num_envs, n_agents, n_actions]. Actions are integers [num_envs,
    n_agents]. Rewards are float64 [num_envs], one per team. `infos` contains battle_won, dead_allies,
    dead_enemies, episode_return and episode_length after the step, each [num_envs] and with a `_key` mask.
    With same-step autoreset, `final_obs` (an object array of dicts) and `final_info` describe the episodes
    that ended in the step, and the observations belong to the next episodes.

    Args:
        envs: a synchronous lane, from `smaclite_pool.make` or `smaclite_pool.connect`; closed with this
            object.
        illegal_actions: "error": a step with an unavailable action raises IllegalAction. "stop": agents given
            an unavailable action stop instead; use it with algorithms that ignore action masks.
        copy: True: arrays are copies that you can keep and change. False: observations are read-only views of
            shared memory; at most the lane's `max_held_batches` can be held.
        render_mode: None; "rgb_array": `render()` returns a picture per environment; "human": a window shows
            every step of all environments (needs pygame and a display). With a render mode, this object holds
            one batch.
        render_speed: of the window: 1 for the speed of the battle, two steps per second; 0.25 for slow
            motion; None for no waiting.
        renderer: how to draw; by default 256 x 256 pixels per environment.

    Raises InvalidRequest for an asynchronous lane, another value of `illegal_actions`, `render_mode` or
    `render_speed`, or if the lane omits a field that is needed: `state` by a render mode, `avail_actions` by
    "stop", and with same-step autoreset the `final_` field of each observation.
    """

    observation_space: spaces.Dict
    action_space: AvailableBox
    single_observation_space: spaces.Dict
    single_action_space: spaces.MultiDiscrete
    autoreset_mode: AutoresetMode
    """What Gymnasium's vector environments have beside `metadata`; TorchRL reads it."""

    def __init__(
        self,
        envs: Envs,
        *,
        illegal_actions: IllegalActions = "error",
        copy: bool = True,
        render_mode: str | None = None,
        render_speed: float | None = 1.0,
        renderer: Renderer | None = None,
    ) -> None:
        self.closed = True  # if this fails, the caller still owns the lane
        spec = envs.spec
        check_one_side(envs)
        require_synchronous(envs, "a VectorEnv")
        self._envs, self._copy = envs, copy
        self._stops = stops(illegal_actions)
        self._last: Batch | None = None  # only with "stop" or snapshots
        self.num_envs = spec.num_envs
        self.autoreset_mode = AutoresetMode(spec.autoreset_mode)
        self.metadata = {
            "render_modes": list(RENDER_MODES),
            "render_fps": RENDER_FPS,
            "autoreset_mode": self.autoreset_mode,
        }
        self.render_mode = render_mode
        self._viewer = LaneViewer(envs, render_mode, render_speed, renderer)
        self.single_observation_space = single_observation_space(envs)
        self.single_action_space = single_action_space(envs)
        self.observation_space = batched_observation_space(envs)
        self.action_space = batched_action_space(envs)
        self._np_random, self._np_random_seed = seeding.np_random(spec.seed)
        self._keys = {key: field for key, field in OBSERVATION_KEYS.items() if field in spec.fields}
        self._info_fields = [name for name in INFO_FIELDS if name in spec.fields]
        if self._stops:
            require_fields(envs, 'illegal_actions="stop"', ["avail_actions"])
        if spec.autoreset_mode == "SameStep":
            require_fields(envs, 'autoreset_mode="SameStep"', _final(self._keys.values()))
        self.closed = False

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Arrays, dict[str, Any]]:
        """Begin new episodes in all environments, or where `options["reset_mask"]` is True, bool [num_envs].

        With a seed, environment i is seeded with seed + i, or with seed[i] if it is a list; without one its
        random generator continues. With `options["snapshot"]`, uint8 [num_envs, snapshot_size], the battles
        continue from snapshots, as by `restore`, and wrappers begin to count anew. Raises InvalidRequest for
        another number of seeds, a mask of another shape or without any True, and a mask beside snapshots.
        """
        seed = int(seed) if isinstance(seed, np.integer) else seed
        options = options or {}
        mask, snapshot = options.get("reset_mask"), options.get("snapshot")
        if snapshot is not None:
            if mask is not None:
                raise InvalidRequest("options['snapshot'] and options['reset_mask'] exclude each other")
            return self.restore(snapshot, seed=seed)
        if mask is None:
            present, batch = np.ones(self.num_envs, np.bool_), self._envs.reset(seed)
            self._note_seed(seed)
        else:
            present = np.asarray(mask)
            if present.dtype != np.bool_ or present.shape != (self.num_envs,):
                got = f"{present.dtype} of shape {present.shape}"
                raise InvalidRequest(
                    f"options['reset_mask'] must be bool of shape ({self.num_envs},), got {got}"
                )
            if not present.any():
                raise InvalidRequest("options['reset_mask'] must be True for at least one environment")
            if isinstance(seed, Sequence | np.ndarray):
                if len(seed) != self.num_envs:
                    raise InvalidRequest(
                        f"seed must have one per environment, {self.num_envs}; got {len(seed)}"
                    )
                # Here, where an error says which one of all.
                seed = [s if s is None else require_integer(f"seed[{i}]", s, 0) for i, s in enumerate(seed)]
                seed = [own for own, is_reset in zip(seed, present, strict=True) if is_reset]
            batch = self._envs.reset(seed, present)
        self._keep(batch)
        return self._observations(batch, ""), self._infos(batch, present)

    def step(
        self, actions: NDArray[Any]
    ) -> tuple[Arrays, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Step every environment by the actions of its agents, integers [num_envs, n_agents].

        Raises IllegalAction for an unavailable action; nothing is stepped then. With next-step autoreset the
        actions of an environment whose episode has just ended are ignored.
        """
        if self._stops and self._last is not None:
            actions = stop_unavailable(actions, self._last.avail_actions)
        batch = self._envs.step(actions)
        self._keep(batch)
        infos = self._infos(batch, np.ones(self.num_envs, np.bool_))
        if self._envs.spec.autoreset_mode == "SameStep":
            self._add_final(infos, batch)
        terminated, truncated = batch.terminated.copy(), batch.truncated.copy()
        return self._observations(batch, ""), batch.reward.astype(np.float64), terminated, truncated, infos

    def save(self) -> NDArray[np.uint8]:
        """The battles as they are now, uint8 [num_envs, snapshot_size], for `restore`.

        Gymnasium's wrappers do not hand the method on: call `envs.unwrapped.save()` on a wrapped environment.
        Raises InvalidRequest before the first reset, or if the lane has no field `snapshot`.
        """
        if "snapshot" not in self._envs.spec.fields:
            raise InvalidRequest("the lane has no snapshots: name the field `snapshot` among `fields`")
        if self._last is None:
            raise InvalidRequest("no battle has begun; call reset first")
        return self._last.snapshot.copy()

    def restore(
        self,
        snapshots: NDArray[np.uint8],
        env_id: ArrayLike | None = None,
        *,
        seed: int | Sequence[int | None] | None = None,
    ) -> tuple[Arrays, dict[str, Any]]:
        """Continue from snapshots, uint8 [K, snapshot_size], in all environments or those of `env_id`.

        Wrappers do not know of it: on a wrapped environment, `envs.reset(options={"snapshot": snapshots})`
        does the same for all environments, and wrappers begin to count anew.

        Returns observations and infos of all environments as after a reset. Without a seed the battles go on
        as they would have gone on; with one, environment i has the execution orders of seed + i, and a list
        has one seed per environment. Raises InvalidRequest as `Envs.reset`.
        """
        batch = self._envs.reset(seed, env_id=env_id, snapshots=snapshots)
        if env_id is None:
            self._note_seed(seed)
        self._keep(batch)
        return self._observations(batch, ""), self._infos(batch, np.ones(self.num_envs, np.bool_))

    def _note_seed(self, seed: int | Sequence[int | None] | None) -> None:
        """What `np_random_seed` says: the seed of the environments, or a tuple with one for each."""
        if isinstance(seed, int):
            self._np_random, self._np_random_seed = seeding.np_random(seed)
        elif seed is not None:
            self._np_random_seed = tuple(seed)  # type: ignore[assignment] # as SyncVectorEnv's

    def _keep(self, batch: Batch) -> None:
        self._last = batch if self._stops or "snapshot" in batch.keys() else None
        self._viewer.observe(batch)

    def render(self) -> tuple[Picture, ...] | None:  # type: ignore[override]  # the type of gymnasium 1.2
        """A picture per environment, uint8 [256, 256, 3] each, or all of them in a window with "human".

        Raises InvalidRequest before the first reset, and PoolError if a window is needed and pygame is not
        installed or there is no display.
        """
        pictures = self._viewer.render()
        return None if pictures is None else tuple(pictures)

    def _observations(self, batch: Batch, prefix: Literal["", "final_"]) -> Arrays:
        observations: Arrays = {}
        for key, field in self._keys.items():
            array = getattr(batch, prefix + field)
            array = array.copy() if self._copy else array
            observations[key] = array.view(np.int8) if array.dtype == np.bool_ else array
        return observations

    def _infos(self, batch: Batch, present: NDArray[np.bool_]) -> dict[str, Any]:
        infos: dict[str, Any] = {}
        for name in self._info_fields:
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
            final_obs[env] = {key: array[env] for key, array in last.items()}
        infos["final_obs"], infos["_final_obs"] = final_obs, ended
        infos["final_info"], infos["_final_info"] = self._infos(batch, ended), ended.copy()

    def __repr__(self) -> str:
        return f"<BattleVectorEnv of {self._envs!r}>"

    def __reduce_ex__(self, protocol: Any) -> Any:
        # Here, as the end of a half-made or shallow copy would close the environments.
        return unwrapped(self._envs).__reduce_ex__(protocol)  # raises TypeError and says what to use

    def close_extras(self, **kwargs: Any) -> None:
        """Close the environments and the window."""
        self._last = None
        self._viewer.close()
        self._envs.close()


def make_vector(
    scenario: Scenario | None = None,
    num_envs: int = 1,
    *,
    map_file: Scenario | None = None,
    autoreset_mode: AutoresetMode | Literal["NextStep", "SameStep", "Disabled"] = AutoresetMode.NEXT_STEP,
    max_episode_steps: int | None = None,
    seed: int | None = None,
    illegal_actions: IllegalActions = "error",
    copy: bool = True,
    render_mode: str | None = None,
    render_speed: float | None = 1.0,
    **settings: Any,
) -> BattleVectorEnv:
    """Start a pool within this process; `gymnasium.make_vec` calls this.

    Args:
        scenario, map_file: a standard scenario, or the path of a scenario file; exactly one of them.
        num_envs: number of environments.
        autoreset_mode: an `AutoresetMode` or its value, such as "NextStep".
        max_episode_steps: steps after which an episode is truncated; None for the limit of the scenario.
        seed: environment i is seeded with seed + i until a reset with another seed; None for a random seed.
        illegal_actions, copy, render_mode, render_speed: as in `BattleVectorEnv`.
        settings: `threads`, `rules`, `fields`, `wait` and other arguments of `smaclite_pool.make`. Same-step
            autoreset adds the `final_` field of each observation to `fields`.

    Raises InvalidRequest, ScenarioError and StartError.
    """
    check_keywords(make_vector, settings)
    if settings.get("fields") is not None and autoreset_mode in (AutoresetMode.SAME_STEP, "SameStep"):
        fields = require_names("fields", settings["fields"])
        settings["fields"] = list(dict.fromkeys([*fields, *_final(fields)]))
    if max_episode_steps is not None:
        if "episode_limit" in settings:
            raise InvalidRequest("episode_limit and max_episode_steps are one limit here; give one of them")
        settings["episode_limit"] = max_episode_steps
    check_rendering(render_mode, render_speed)
    return BattleVectorEnv(
        make(_one_of(scenario, map_file), num_envs, seed=seed, autoreset_mode=autoreset_mode, **settings),
        illegal_actions=illegal_actions,
        copy=copy,
        render_mode=render_mode,
        render_speed=render_speed,
    )


class BattleEnv(CopiedByArguments, gymnasium.Env[Any, Any]):
    """One battle: a row of a `BattleVectorEnv`, without the axis of the environments.

    Observations are a dict of `obs` float32 [n_agents, obs_size], `state` float32 [state_size] and
    `action_mask` int8 [n_agents, n_actions]. Actions are integers [n_agents], and dead agents use 0 (no-op).
    The reward is that of the team. `info` contains battle_won, dead_allies, dead_enemies, episode_return and
    episode_length after the step. Single battles are slow; for training, step many at once with
    `gymnasium.make_vec`. Before the first reset, an environment can be copied and pickled: by its arguments.

    Args:
        scenario, map_file: a standard scenario, or the path of a scenario file; exactly one of them.
        seed: for the first reset without a seed; None for a random one.
        episode_limit: steps after which an episode is truncated; None for no limit, "default" for the limit
            of the scenario.
        illegal_actions: "error" or "stop", as in `BattleVectorEnv`.
        render_mode: None; "rgb_array": `render()` returns a picture; "human": a window shows every step
            (needs pygame and a display).
        render_speed: of the window, as in `BattleVectorEnv`.
        settings: `rules`, `wait` and other arguments of `smaclite_pool.make`.

    Raises InvalidRequest, ScenarioError and StartError.
    """

    metadata = {"render_modes": list(RENDER_MODES), "render_fps": RENDER_FPS}
    picture_size = (640, 640)

    def __init__(
        self,
        scenario: Scenario | None = None,
        *,
        map_file: Scenario | None = None,
        seed: int | None = None,
        episode_limit: int | Literal["default"] | None = "default",
        illegal_actions: IllegalActions = "error",
        render_mode: str | None = None,
        render_speed: float | None = 1.0,
        **settings: Any,
    ) -> None:
        check_keywords(type(self), settings, FIXED_SETTINGS)
        self._stops = stops(illegal_actions)
        check_rendering(render_mode, render_speed)
        name = _one_of(scenario, map_file)
        self.render_mode = render_mode
        self._battle = SingleBattle(name, {"seed": seed, "episode_limit": episode_limit, **settings})
        self._viewer = BattleViewer(self._battle.envs, *self.picture_size, render_mode, render_speed)
        self._np_random, self._np_random_seed = seeding.np_random(self._battle.envs.spec.seed)
        self.observation_space, self.action_space = self._spaces(name, self._battle.envs)

    def _spaces(self, scenario: Scenario, envs: Envs) -> tuple[spaces.Space[Any], spaces.Space[Any]]:
        return single_observation_space(envs), AvailableMultiDiscrete(envs)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin a new battle. Without a seed the random generator continues.

        With `options["snapshot"]` the battle continues from a snapshot, as by `restore`, and wrappers begin
        to count anew. Other options are ignored.
        """
        seed = int(seed) if isinstance(seed, np.integer) else seed
        now = self._battle.reset(seed, options)
        super().reset(seed=seed)  # last: a seed that is refused is not that of the battle
        self._show()
        return self._observation(now), self._info(now)

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Step the battle by one action per agent.

        Raises IllegalAction for an unavailable action, and InvalidRequest before the first reset and after
        the end of the battle; nothing is stepped then.
        """
        if self._stops:
            action = stop_unavailable(action, self._battle.last.avail_actions)
        now = self._battle.step(action)
        self._show()
        return self._observation(now), now.reward, now.terminated, now.truncated, self._info(now)

    def save(self) -> NDArray[np.uint8]:
        """The battle as it is now, uint8 [snapshot_size], for `restore` of an environment of this scenario.

        Gymnasium's wrappers, which `gymnasium.make` adds, do not hand the method on: call
        `env.unwrapped.save()`. Raises InvalidRequest before the first reset.
        """
        return self._battle.last.snapshot.copy()

    def restore(self, snapshot: NDArray[np.uint8], *, seed: int | None = None) -> tuple[Any, dict[str, Any]]:
        """Continue from a snapshot, and return observation and info as after a reset.

        Without a seed the battle goes on as it would have gone on; with one it has other execution orders.
        Wrappers do not know of it: those of `gymnasium.make` refuse the next step if they were not reset, and
        go on counting steps if they were. `env.reset(options={"snapshot": snapshot})` does the same and is
        seen by all of them. Raises InvalidRequest for a snapshot of another scenario or rule set.
        """
        now = self._battle.restore(snapshot, seed)
        self._show()
        return self._observation(now), self._info(now)

    def action_masks(self) -> NDArray[np.bool_]:
        """bool [n_agents * n_actions]: the available actions, agent after agent, as `MaskablePPO` of
        sb3-contrib asks for them.

        Raises InvalidRequest before the first reset.
        """
        return self._battle.last.avail_actions.reshape(-1).copy()

    def _observation(self, now: TimeStep) -> Any:
        mask = now.avail_actions.astype(np.int8)
        return {"obs": now.obs.copy(), "state": now.state.copy(), "action_mask": mask}

    def _info(self, now: TimeStep) -> dict[str, Any]:
        return now.totals

    def _show(self) -> None:
        self._viewer.observe(self._battle.last.state)

    def render(self) -> Any:
        """The battle from above: uint8 [640, 640, 3] with "rgb_array", or in a window with "human".

        Raises InvalidRequest before the first reset, and PoolError if a window is needed and pygame is not
        installed or there is no display.
        """
        return self._viewer.render(self._battle.last.state)

    def __repr__(self) -> str:
        return self._battle.description(self)

    def close(self) -> None:
        """End the pool and close the window. Calling it again has no effect."""
        self._viewer.close()
        self._battle.close()


def _final(fields: Iterable[str]) -> list[str]:
    """The fields of the last observations of episodes, for those among `fields` that are observations."""
    return [f"final_{field}" for field in fields if field in OBSERVATION_KEYS.values()]


def _one_of(scenario: Scenario | None, map_file: Scenario | None) -> Scenario:
    if map_file is not None and scenario is not None:
        raise InvalidRequest(
            f"scenario {str(scenario)!r} and map_file cannot be combined; for a scenario file use "
            "smaclite_pool/custom-v0, or leave map_file out"
        )
    if map_file is not None:
        return map_file
    if scenario is None:
        raise InvalidRequest("map_file must be the path of a scenario file, got None")
    return scenario


def _register() -> None:
    battles: dict[str, dict[str, str]] = {name: {"scenario": name} for name in scenarios()}
    for name, kwargs in {**battles, "custom": {}}.items():
        single, vector = f"{__name__}:BattleEnv", f"{__name__}:make_vector"
        gymnasium.register(
            f"smaclite_pool/{name}-v0", entry_point=single, vector_entry_point=vector, kwargs=kwargs
        )


_register()
