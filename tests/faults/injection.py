"""Faults, and commands that meet them under `strace`."""

from __future__ import annotations

import os
import re
import select
import shutil
import signal
import subprocess
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

PROGRAM = Path(__file__).parents[2] / "target" / "release" / "smaclite-pool"

LONGEST = 20
"""Seconds after which a command hangs."""

KILL = "SIGKILL"

FAULTS: dict[str, list[str]] = {
    "accept4": ["EMFILE"],
    "bind": ["ENOSPC"],
    "clone3": ["EAGAIN"],
    "connect": ["ECONNREFUSED", KILL],
    "fallocate": ["ENOSPC", "EINTR"],
    "fchmod": ["EPERM"],
    "flock": ["EINTR", KILL],
    "fsync": ["EIO", KILL],
    "ftruncate": ["ENOSPC", KILL],
    "mkdir": ["ENOSPC", KILL],
    "mmap": ["ENOMEM", KILL],
    "openat": ["EMFILE", "EACCES", "ENOSPC", KILL],
    "pidfd_open": ["EMFILE"],
    "poll": ["EINTR"],
    "pread64": ["EIO"],
    "read": ["EIO", "EINTR"],
    "recvfrom": ["ECONNRESET"],
    "rename": ["ENOSPC", KILL],
    "socket": ["EMFILE"],
    "statx": ["EACCES"],
    "unlink": [KILL],  # in folders that nobody else can change
    "write": ["ENOSPC", "EINTR", KILL],
}
"""What is injected into each system call, if the command makes it. Not into `sendto`, by which a process
tells itself of signals: one that is lost cannot be answered."""


@dataclass(frozen=True)
class Fault:
    """Lets one call of each thread fail."""

    call: str
    error: str
    number: int

    def options(self) -> list[str]:
        what = f"signal={self.error}" if self.error == KILL else f"error={self.error}"
        # All calls that name files, to know the pool's folder in shared memory.
        return ["-e", f"trace=%file,{self.call}", "-e", f"inject={self.call}:{what}:when={self.number}"]

    def __str__(self) -> str:
        return f"{self.call} {self.error}, call {self.number}"


Client = Callable[[str, Path], "str | None"]
"""Speaks to a command that serves: gets the first line that the command printed, and the folder. Returns what
is wrong."""


@dataclass(frozen=True)
class End:
    """How a command ended."""

    status: int | None
    """`None` if it hung."""
    stderr: str
    problem: str | None = None
    """What its client found wrong."""


def run(command: list[str], folder: Path, pools: Path, options: list[str], client: Client | None) -> End:
    """Runs a command of the program to its end, with these options of strace. Where there is a client, the
    command is asked to end when that is done."""
    process = subprocess.Popen(
        ["strace", "-f", "-qq", "-o", folder / "trace", *options, PROGRAM, *command],
        stdout=subprocess.PIPE if client else subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "SMACLITE_POOL_ROOT": str(pools), "RUST_BACKTRACE": "0"},
        start_new_session=True,
    )
    problem = None
    try:
        if client and process.stdout:
            if not select.select([process.stdout], [], [], LONGEST)[0]:
                raise subprocess.TimeoutExpired(command, LONGEST)
            if line := process.stdout.readline():  # empty if it ended
                problem = client(line.strip(), folder)
            os.killpg(process.pid, signal.SIGINT)  # strace does not heed it
        _, stderr = process.communicate(timeout=LONGEST)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        return End(None, process.communicate()[1], problem)
    finally:
        if process.poll() is None:  # the client has an error of its own
            os.killpg(process.pid, signal.SIGKILL)
    return End(process.returncode, stderr, problem)


def calls(trace: str) -> dict[str, tuple[int, int]]:
    """By system call: how many of them the dynamic linker made before `main`, and the most of one thread."""
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    before: Counter[str] | None = None
    for line in trace.splitlines():
        if match := re.match(r"(\d+) +(\w+)\(", line):
            if match[2] == "sigaltstack":  # Rust's runtime begins
                before = before or Counter({call: sum(of.values()) for call, of in counts.items()})
            else:
                counts[match[2]][match[1]] += 1
    return {call: ((before or Counter())[call], max(of.values())) for call, of in counts.items()}


def faults(of: dict[str, tuple[int, int]], kills: bool) -> Iterator[Fault]:
    for call, (before, most) in sorted(of.items()):
        for error in FAULTS.get(call, []):
            if error == KILL and not kills:
                continue
            yield from (Fault(call, error, number) for number in range(before + 1, most + 1))


def new_folder(folder: Path) -> Path:
    """An empty one for a command, with folders for its files and for its pools."""
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "out").mkdir(parents=True)
    (folder / "pools").mkdir(mode=0o700)
    return folder
