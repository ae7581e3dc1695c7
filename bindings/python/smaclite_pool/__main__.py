"""`python -m smaclite_pool` is the program `smaclite-pool`."""

import signal
import sys

from ._native import run_program


def main() -> int:
    """Run the program with this process's arguments and return its exit status."""
    # The program handles Ctrl-C itself; Python's handler would raise KeyboardInterrupt after a clean end.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return run_program(["smaclite-pool", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
