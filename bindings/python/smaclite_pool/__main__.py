"""`python -m smaclite_pool` is the program `smaclite-pool`."""

import os
import signal
import sys

from ._native import run_program


def main() -> int:
    """Run the program with this process's arguments and return its exit status."""
    open_standard_streams()
    # The program handles Ctrl-C itself; Python's handler would raise KeyboardInterrupt after a clean end.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    # Scripts that complete commands call the program by this path. A module has none: its name, from PATH.
    is_script = os.path.basename(sys.argv[0]) in ("smaclite-pool", "smaclite-pool.exe")
    return run_program([sys.argv[0] if is_script else "smaclite-pool", *sys.argv[1:]])


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
