"""The replacement for the package `smaclite`; `smaclite_pool.compat` puts it on the path. Needs gymnasium."""

from __future__ import annotations

import os
from os import PathLike
from typing import Any

import gymnasium

from ..._native import scenarios
from ...errors import InvalidRequest
from ...integrations.gymnasium import BattleEnv
from .. import EPISODE_LIMIT_VARIABLE

__all__ = ["SMACliteEnv", "register"]


class SMACliteEnv(BattleEnv):
    """An environment with constructor and methods of the published one; see `BattleEnv` for their results.

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
        settings: `illegal_actions`, `render_speed`, `rules`, `wait` and other arguments of `BattleEnv`.

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
        **settings: Any,
    ) -> None:
        if map_info is not None:
            raise InvalidRequest("map_info must be None; use map_file, the path of a scenario file")
        limit = _default_limit() if episode_limit is None else episode_limit
        super().__init__(
            scenario, map_file=map_file, seed=seed, episode_limit=limit, render_mode=render_mode, **settings
        )

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
    for name in scenarios():
        gymnasium.register(f"smaclite/{name}-v0", entry_point=entry_point, kwargs={"scenario": name})
    gymnasium.register("smaclite/custom-v0", entry_point=entry_point)
