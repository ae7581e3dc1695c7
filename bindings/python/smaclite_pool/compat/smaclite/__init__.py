"""The replacement for the package `smaclite`; `smaclite_pool.compat` puts it on the path. Needs gymnasium."""

from __future__ import annotations

import os
from os import PathLike
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..._extra import extra
from ..._layout import ScenarioLayout, field_bounds
from ..._native import FIRST_TARGET, Envs, scenarios
from ..._units import Unit, UnitsView
from ...errors import InvalidRequest
from ...integrations._common import TimeStep
from .. import EPISODE_LIMIT_VARIABLE

with extra("gymnasium"):
    import gymnasium
    from gymnasium import spaces

    from ...integrations._spaces import AvailableTuple
    from ...integrations.gymnasium import BattleEnv

__all__ = ["SMACliteEnv", "register"]


class SMACliteEnv(BattleEnv):
    """An environment with the constructor, spaces, types and methods of the published one.

    An observation is a tuple of float32 [obs_size], one per agent; an action is a tuple of integers, one per
    agent. `info` contains battle_won, dead_allies, dead_enemies, and `episode_limit` (True) in a step that
    truncates the episode; all values are numbers.

    Args:
        map_info: must be None, as classes of the published package are not supported.
        map_file: the path of a scenario file. The registered ids set `scenario`, a standard scenario,
            instead.
        seed: seed of the first reset; with the same actions, its episodes equal those of the published
            environment with that seed. None to draw one from NumPy's global generator.
        use_cpp_rvo2: has no effect; battles equal those of the published environment with True.
        render_mode: of `render()`: "human" shows a window (needs pygame and a display), "rgb_array" returns a
            picture.
        episode_limit: steps after which an episode is truncated and `info["episode_limit"]` is set; None for
            the environment variable SMACLITE_POOL_EPISODE_LIMIT, or else no limit.
        illegal_actions: "error": an unavailable action raises IllegalAction, a ValueError as that of the
            published environment. "stop": agents given an unavailable action stop instead; for callers that
            ignore which actions are available, as EPyMARL with `--env-config=gymma`.
        settings: `render_speed`, `rules`, `wait` and other arguments of `BattleEnv`.

    Raises InvalidRequest, ScenarioError and StartError.
    """

    metadata = {"render_modes": ["human", "rgb_array"], "render_fps": 60}

    def __init__(
        self,
        map_info: None = None,
        map_file: str | PathLike[str] | None = None,
        seed: int | None = None,
        use_cpp_rvo2: bool = False,
        render_mode: str | None = "human",
        *,
        scenario: str | None = None,
        episode_limit: int | None = None,
        illegal_actions: Literal["error", "stop"] = "error",
        **settings: Any,
    ) -> None:
        if map_info is not None:
            raise InvalidRequest("map_info must be None; use map_file, the path of a scenario file")
        limit = _default_limit() if episode_limit is None else episode_limit
        super().__init__(
            scenario if map_file is None else None,  # as the published package, whose ids set a scenario, too
            map_file=map_file,
            # As the published environment, so that numpy.random.seed determines it.
            seed=int(np.random.randint(2**31 - 1)) if seed is None else seed,
            episode_limit=limit,
            illegal_actions=illegal_actions,
            render_mode=render_mode,
            **settings,
        )
        spec = self._battle.envs.spec
        self.n_agents, self.n_enemies, self.n_actions = spec.n_agents, spec.n_enemies, spec.n_actions
        self.obs_size, self.state_size = spec.obs_size, spec.state_size

    def _spaces(
        self, scenario: str | PathLike[str], envs: Envs
    ) -> tuple[spaces.Space[Any], spaces.Space[Any]]:
        spec = envs.spec
        self._layout = ScenarioLayout(envs)
        allies = self._layout.allies
        if self._layout.info["teams_are_drawn"]:  # then `allies` are one sample
            n_targets = [spec.n_actions - FIRST_TARGET] * spec.n_agents
        else:
            n_targets = [spec.n_agents - 1 if unit["healer"] else spec.n_enemies for unit in allies]
        low, high = field_bounds(envs)["obs"]
        boxes = [spaces.Box(low, high, dtype=np.float32) for _ in allies]
        return spaces.Tuple(boxes), AvailableTuple(envs, [FIRST_TARGET + n for n in n_targets])

    def _observation(self, now: TimeStep) -> tuple[NDArray[np.float32], ...]:
        return tuple(now.obs.copy())

    def _info(self, now: TimeStep) -> dict[str, Any]:
        return {**now.info, "episode_limit": True} if now.truncated else now.info.copy()

    def get_obs(self) -> tuple[NDArray[np.float32], ...]:
        """The observation of each agent, float32 [obs_size]; zeros for dead agents."""
        return self._observation(self._battle.last)

    def get_state(self) -> NDArray[np.float32]:
        """The global state, float32 [state_size], for training only."""
        return self._battle.last.state.copy()

    def get_avail_actions(self) -> list[NDArray[np.float64]]:
        """Which actions are available, 0 or 1 [n_actions] per agent."""
        return list(self._battle.last.avail_actions.astype(np.float64))

    @property
    def agents(self) -> dict[int, Unit]:
        """The living units of the agents by id; empty before the first reset."""
        return self._living(0, self.n_agents)

    @property
    def enemies(self) -> dict[int, Unit]:
        """The living enemies by id; empty before the first reset."""
        return self._living(self.n_agents, self.n_enemies)

    def _living(self, first: int, count: int) -> dict[int, Unit]:
        if not self._battle.has_begun:
            return {}
        units = UnitsView(self._layout)
        units.update(self._battle.last.state)
        return {i: units.unit(first + i) for i in range(count) if units.health[first + i] > 0}

    def seed(self, seed: int | None = None) -> None:
        """Set the seed of the next reset."""
        if seed is not None:
            self._battle.seed_next_reset(seed)

    def _show(self) -> None:
        """The window is updated by `render()` only, as in the published environment."""


def _default_limit() -> int | None:
    text = os.environ.get(EPISODE_LIMIT_VARIABLE)
    if not text:
        return None
    if not text.isdecimal():
        raise InvalidRequest(f"{EPISODE_LIMIT_VARIABLE} must be a number of steps, got {text!r}")
    return int(text)


def register() -> None:
    """Register `smaclite/<scenario>-v0` and `smaclite/custom-v0`; importing the replacement does it."""
    entry_point = "smaclite.env:SMACliteEnv"
    for name in scenarios(generated=False):
        gymnasium.register(f"smaclite/{name}-v0", entry_point=entry_point, kwargs={"scenario": name})
    gymnasium.register("smaclite/custom-v0", entry_point=entry_point)
