"""Runs Python with the stand-in for `smaclite`; alone it prints the stand-in's folder."""

from __future__ import annotations

import os
import sys

from . import FOLDER, LIMIT

USAGE = """usage: python -m smaclite_pool.drop_in [--episode-limit STEPS] [SCRIPT | -m MODULE | -c CODE] [ARGUMENTS ...]

Runs Python with the stand-in for `smaclite` first on its path. Without a script it prints the stand-in's folder, for
PYTHONPATH. --episode-limit truncates episodes after STEPS and marks them: info["episode_limit"]."""


def main() -> int:
    """Print the folder, or become Python with the folder first in PYTHONPATH."""
    arguments = sys.argv[1:]
    if arguments[:1] in (["-h"], ["--help"]):
        print(USAGE)
        return 0
    if arguments[:1] == ["--episode-limit"]:
        if not "".join(arguments[1:2]).isdecimal():
            print(f"--episode-limit takes a number of steps\n\n{USAGE}", file=sys.stderr)
            return 2
        os.environ[LIMIT] = arguments[1]
        del arguments[:2]
    if not arguments:
        print(FOLDER)
        return 0
    os.environ["PYTHONPATH"] = os.pathsep.join([str(FOLDER), *filter(None, [os.environ.get("PYTHONPATH")])])
    os.execv(sys.executable, [sys.executable, *arguments])


if __name__ == "__main__":
    sys.exit(main())
