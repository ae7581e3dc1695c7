"""Run Python with drop-in replacements for `smaclite`, `smac` and `smacv2` first on its path."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

from . import EPISODE_LIMIT_VARIABLE, FOLDERS

USAGE = """\
usage: python -m smaclite_pool.compat [--smaclite] [--smac] [--smacv2]
                                      [--episode-limit STEPS] [SCRIPT | -m MODULE | -c CODE] [ARGUMENTS ...]

Runs Python with drop-in replacements for the packages `smaclite`, `smac` and `smacv2`.
Without a script it prints the value for PYTHONPATH that has the same effect.

  --smaclite             replace `smaclite`; without these options all three packages are replaced
  --smac                 replace `smac`
  --smacv2               replace `smacv2`
  --episode-limit STEPS  smaclite: truncate episodes after STEPS and set info["episode_limit"]"""


def main() -> int:
    """Print the path, or run Python with the path set. Returns the exit status."""
    arguments, packages = sys.argv[1:], set()
    # Not argparse: the arguments after the options belong to Python and to the script, also -m and -c.
    while arguments and arguments[0].startswith("--"):
        option = arguments.pop(0)
        if option == "--help":
            print(USAGE)
            return 0
        if option.removeprefix("--") in FOLDERS:
            packages.add(option.removeprefix("--"))
        elif option == "--episode-limit":
            if not "".join(arguments[:1]).isdecimal():
                return _error("--episode-limit must be followed by a number of steps")
            os.environ[EPISODE_LIMIT_VARIABLE] = arguments.pop(0)
        else:
            return _error(f"unknown option {option}")
    folders = [str(folder) for package, folder in FOLDERS.items() if package in packages or not packages]
    if not arguments:
        print(os.pathsep.join(folders))
        return 0
    os.environ["PYTHONPATH"] = os.pathsep.join([*folders, *filter(None, [os.environ.get("PYTHONPATH")])])
    command = [sys.executable, *arguments]
    if sys.platform == "win32":  # where nobody waits for the process that replaces this one
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # the script gets Ctrl-C too, and decides
        return subprocess.run(command, check=False).returncode
    os.execv(sys.executable, command)


def _error(message: str) -> int:
    print(f"{message}\n\n{USAGE}", file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main())
