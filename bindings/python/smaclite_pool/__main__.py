"""`python -m smaclite_pool` is the program `smaclite-pool`."""

import os
import signal
import sys

from ._interrupts import is_script
from ._native import run_program


def main() -> int:
    """Run the program with this process's arguments and return its exit status."""
    open_standard_streams()
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # for callers that are neither the script nor the module
    # Scripts that complete commands call the program by this path. A module has none: its name, from PATH.
    return run_program([sys.argv[0] if is_script() else "smaclite-pool", *sys.argv[1:]])


def open_standard_streams() -> None:
    """Opens what a process was started without, as daemons are: the next files that it opens would get these
    numbers, and what it prints."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # gets the lowest number that is free
            os.set_inheritable(number, True)


if __name__ == "__main__":
    sys.exit(main())
