"""Ends the program, `smaclite-pool` or `python -m smaclite_pool`, by Ctrl-C from its first import on.

The program handles Ctrl-C itself. Python's handler would print a traceback while the package is imported, and
raise KeyboardInterrupt after a clean end. Programs that import the package keep their handlers.
"""

import os
import signal
import sys


def is_script() -> bool:
    """Whether this process runs the script `smaclite-pool`."""
    return os.path.basename("".join(sys.argv[:1])) in ("smaclite-pool", "smaclite-pool.exe")


def is_module() -> bool:
    """Whether this process runs `python -m smaclite_pool`, whose module is not found yet."""
    return sys.argv[:1] == ["-m"] and sys.orig_argv[-len(sys.argv)].removeprefix("-m") == "smaclite_pool"


if is_script() or is_module():
    signal.signal(signal.SIGINT, signal.SIG_DFL)
