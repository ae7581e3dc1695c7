"""Ends the program, `smaclite-pool` or `python -m smaclite_pool`, by Ctrl-C from its first import on.

The program handles Ctrl-C itself. Python's handler would print a traceback while the package is imported, and
raise KeyboardInterrupt after a clean end. Programs that import the package keep their handlers.
"""

import os
import signal
import sys
import threading

ARGV = [*map(str, getattr(sys, "argv", []))]
"""A program that has Python inside may have set none, or other ones."""


def is_script() -> bool:
    """Whether this process runs the script `smaclite-pool`."""
    return os.path.basename("".join(ARGV[:1])) in ("smaclite-pool", "smaclite-pool.exe")


def is_module() -> bool:
    """Whether this process runs `python -m smaclite_pool`, whose module is not found yet."""
    if ARGV[:1] != ["-m"]:
        return False
    return sys.orig_argv[-len(ARGV) :][:1] in (["smaclite_pool"], ["-msmaclite_pool"])


def is_free() -> bool:
    """Whether Ctrl-C still has Python's own handler, and this thread can change it."""
    is_main = threading.current_thread() is threading.main_thread()
    return is_main and signal.getsignal(signal.SIGINT) is signal.default_int_handler


if (is_script() or is_module()) and is_free():
    signal.signal(signal.SIGINT, signal.SIG_DFL)
