"""A stand-in for the published package `smaclite`, for code that is to stay as it is.

    from smaclite_pool import drop_in

    drop_in.install()  # from here on `import smaclite` gets the stand-in, in child processes too

    import gymnasium
    import smaclite

    env = gymnasium.make("smaclite/MMM2-v0", seed=1, use_cpp_rvo2=True)
    observations, info = env.reset()
    available = env.unwrapped.get_avail_actions()
    observations, reward, terminated, truncated, info = env.step([int(agent.argmax()) for agent in available])
    env.close()

Without touching any code, from the command line, as for EPyMARL:

    python -m smaclite_pool.drop_in src/main.py --config=qmix --env-config=smaclite with env_args.map_name=MMM

That runs Python with the stand-in's folder first in PYTHONPATH; `python -m smaclite_pool.drop_in` alone prints the
folder. Whoever does neither gets the published package, if it is installed: the two live side by side.

Like the published environment this one has no time limit: callers wrap it in Gymnasium's `TimeLimit`, and only
`truncated` tells a time-out from a defeat. EPyMARL looks for `info["episode_limit"]` instead and so takes every
time-out for a defeat. With `episode_limit=150` the environment truncates by itself and marks it. Where the
constructor's arguments are not in one's hands, the variable SMACLITE_POOL_EPISODE_LIMIT is the default, or for EPyMARL,
with the same number as its time limit:

    python -m smaclite_pool.drop_in --episode-limit 150 src/main.py ... with env_args.time_limit=150 ...
"""

from __future__ import annotations

import importlib
import os
import sys
from os import PathLike
from pathlib import Path
from typing import Any

import gymnasium

from .._draw import Window
from .._native import scenarios
from ..errors import InvalidRequest
from ..gymnasium import BattleEnv

__all__ = ["FOLDER", "LIMIT", "SMACliteEnv", "install", "register"]

FOLDER = Path(__file__).parent
"""Put first in PYTHONPATH, it makes `import smaclite` get the stand-in."""


LIMIT = "SMACLITE_POOL_EPISODE_LIMIT"
"""The variable that is the default of `episode_limit`."""


class SMACliteEnv(BattleEnv):
    """The published environment by its constructor's and its methods' names; see `BattleEnv` for what they return.

    Args:
        map_file: the path of a scenario file; `scenario`, a standard one's name, is set by the registered ids.
        seed: plays the very episodes of the published environment of that seed; None for one drawn from NumPy's global
            generator.
        use_cpp_rvo2: has no effect; battles are those of the published environment with it.
        render_mode: of `render()`: "human" shows a window (needs pygame), "rgb_array" returns a picture.
        episode_limit: steps after which an episode is truncated and marked in `info`; None for what the environment
            variable SMACLITE_POOL_EPISODE_LIMIT says, or no limit.
        settings: `illegal_actions`, `rules`, `wait` and the like, as `BattleEnv` takes them.
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
            raise InvalidRequest("map_info: objects of the published package are not known here; give map_file")
        limit = limit_from_environment() if episode_limit is None else episode_limit
        super().__init__(
            scenario, map_file=map_file, seed=seed, episode_limit=limit, render_mode=render_mode, **settings
        )
        self._window: Window | None = None

    def seed(self, seed: int | None = None) -> None:
        """Seed the generator anew from the next reset on."""
        if seed is not None:
            self._next_seed = seed

    def render(self) -> Any:
        """Show the battle in a window and return None, or in render mode "rgb_array" return uint8 [640, 640, 3]."""
        picture = super().render()
        if self.render_mode == "rgb_array":
            return picture
        if self._window is None:
            self._window = Window(self._envs.scenario, *self.picture_size)
        self._window.show(picture)
        return None

    def close(self) -> None:
        """End the battle. A second time does nothing."""
        if self._window is not None:
            self._window.close()
            self._window = None
        super().close()


def limit_from_environment() -> int | None:
    """What SMACLITE_POOL_EPISODE_LIMIT says; None if it is not there."""
    text = os.environ.get(LIMIT)
    if not text:
        return None
    if not text.isdecimal():
        raise InvalidRequest(f"{LIMIT}={text}: a number of steps is wanted")
    return int(text)


def register() -> None:
    """Make Gymnasium know `smaclite/<scenario>-v0` and `smaclite/custom-v0`; importing the stand-in does it."""
    for name in scenarios():
        gymnasium.register(f"smaclite/{name}-v0", entry_point="smaclite.env:SMACliteEnv", kwargs={"scenario": name})
    gymnasium.register("smaclite/custom-v0", entry_point="smaclite.env:SMACliteEnv")


def install() -> None:
    """Make `import smaclite` get the stand-in from here on, in this process and its children.

    Raises InvalidRequest if the published package is imported already.
    """
    loaded = sys.modules.get("smaclite")
    if loaded is not None and FOLDER not in Path(loaded.__file__ or "").parents:
        raise InvalidRequest(f"`smaclite` of {loaded.__file__} is imported already; install the drop-in before that")
    if str(FOLDER) not in sys.path:
        sys.path.insert(0, str(FOLDER))
    importlib.import_module("smaclite")
