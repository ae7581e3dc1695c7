"""`python -m smaclite_pool.drop_in SCRIPT ...` runs a script with the stand-in; alone it prints the stand-in's folder."""

from __future__ import annotations

import os
import sys

from . import FOLDER


def main() -> None:
    """Print the folder, or become Python with the folder first in PYTHONPATH."""
    if not sys.argv[1:]:
        print(FOLDER)
        return
    paths = [str(FOLDER), *filter(None, [os.environ.get("PYTHONPATH")])]
    os.environ["PYTHONPATH"] = os.pathsep.join(paths)
    os.execv(sys.executable, [sys.executable, *sys.argv[1:]])


if __name__ == "__main__":
    main()
