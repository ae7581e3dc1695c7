"""Drop-in replacements for the packages `smaclite`, `smac` and `smacv2`, for code that should run unchanged.

Run a program with all replacements first on Python's path:

    python -m smaclite_pool.compat src/main.py --config=qmix --env-config=smaclite with env_args.map_name=MMM

`--smaclite`, `--smac` and `--smacv2` select some of them. Without a program the command prints the value for
PYTHONPATH. In code, call `install_smaclite`, `install_smac` or `install_smacv2` before the first import of
the package:

    from smaclite_pool import compat

    compat.install_smaclite()  # from now on `import smaclite` gets the replacement, in child processes too

    import gymnasium
    import smaclite

    env = gymnasium.make("smaclite/MMM2-v0", seed=1, use_cpp_rvo2=True)
    observations, info = env.reset()
    available = env.unwrapped.get_avail_actions()
    observations, reward, terminated, truncated, info = env.step([int(agent.argmax()) for agent in available])
    env.close()

Without any of this, these imports get the published packages, if they are installed.

The replacement of `smac` is `smaclite_pool.marl.smac`, that of `smacv2` is `smaclite_pool.marl.smacv2`.

That of `smaclite` is `smaclite_pool.compat.smaclite`, which needs gymnasium. Like the published environment
it has no episode limit: callers wrap it in Gymnasium's `TimeLimit`, and only `truncated` distinguishes a
time-out from a defeat. EPyMARL reads `info["episode_limit"]` instead, and so stores every time-out as a
defeat. With `episode_limit=150` the environment truncates episodes itself and sets that key. Where the
arguments of the constructor are out of reach, the environment variable SMACLITE_POOL_EPISODE_LIMIT or the
option `--episode-limit` is the default; EPyMARL needs the same number as its time limit:

    python -m smaclite_pool.compat --episode-limit 150 src/main.py ... with env_args.time_limit=150 ...
"""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

from ..errors import InvalidRequest

__all__ = ["EPISODE_LIMIT_VARIABLE", "FOLDERS", "install_smac", "install_smaclite", "install_smacv2"]

FOLDERS = {name: Path(__file__).parent / name for name in ("smaclite", "smac", "smacv2")}
"""By package, the folder that contains its replacement. First on the path, it takes precedence."""

EPISODE_LIMIT_VARIABLE = "SMACLITE_POOL_EPISODE_LIMIT"
"""Environment variable with the default of `episode_limit` of the replacement for `smaclite`."""


def install_smaclite() -> None:
    """Let `import smaclite` get the replacement from now on, in this process and in child processes.

    Raises InvalidRequest if the published package was imported before.
    """
    _install("smaclite")


def install_smac() -> None:
    """Let `import smac` get the replacement from now on, in this process and in child processes.

    Raises InvalidRequest if the published package was imported before.
    """
    _install("smac")


def install_smacv2() -> None:
    """Let `import smacv2` get the replacement from now on, in this process and in child processes.

    Raises InvalidRequest if the published package was imported before.
    """
    _install("smacv2")


def _install(package: str) -> None:
    folder = FOLDERS[package]
    loaded = sys.modules.get(package)
    if loaded is not None and folder not in Path(loaded.__file__ or "").parents:
        raise InvalidRequest(
            f"`{package}` was imported already, from {loaded.__file__}; install the replacement before that"
        )
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))  # multiprocessing passes the path on to child processes
    importlib.import_module(package)
