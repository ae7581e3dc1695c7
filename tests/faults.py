"""Lets every system call of a command fail once, and kills the command there, one after the other.

    just faults                 # all commands, every call: minutes
    just faults record bench    # two of them
    just faults --sample 50     # 50 faults of each, the same in every run

After each fault the command must have ended: with success, or with exit status 1 and a message; it must not
have panicked; and after `smaclite-pool clean` nothing of it may be left in shared memory or in the folder of
pools. Faults before `main` are not injected, because they are the dynamic linker's. Needs strace.
"""

from __future__ import annotations

import argparse
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

PROGRAM = Path(__file__).parents[1] / "target" / "release" / "smaclite-pool"

SHM = Path("/dev/shm")

SCENARIOS = {
    "check": "check FOLDER/duel.json",
    "record": "record 3m --seed 1 --out FOLDER/a.smreplay",
    "dataset": "dataset record random --scenario 3m --episodes 2 --out FOLDER/a.smdata",
    "bench": "bench 3m --mode embedded --seconds 0.01 --num-envs 4 --threads 2",
    "attached": "bench 3m --mode attached --seconds 0.01 --num-envs 4 --threads 1",
    "train": "train 3m --steps 200 --num-envs 4 --horizon 8 --epochs 1 --minibatches 1 --seed 1 "
    "--evaluate-every 100 --threads 2 --out FOLDER/run",
}
"""Commands; FOLDER is an empty folder."""

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

EXCUSED = {
    "failed to allocate an alternative stack": "the standard library ends a thread without memory",
    "memory allocation of": "as every allocation of a Rust program",
    "This should never happen": "iceoryx2 panics on errors that it holds for impossible",
    "signal-hook": "so does it, on its own pipe",
}
"""Messages of panics that are not ours to prevent, and why."""

LONGEST = 20
"""Seconds after which a command hangs."""


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


def run(scenario: str, folder: Path, options: list[str]) -> tuple[int | None, str]:
    """Exit status, None if it hangs, and standard error."""
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "out").mkdir(parents=True)
    (folder / "pools").mkdir(mode=0o700)
    subprocess.run([PROGRAM, "new", "scenario", folder / "out/duel.json"], capture_output=True, check=True)
    command = SCENARIOS[scenario].replace("FOLDER", str(folder / "out")).split()
    process = subprocess.Popen(
        ["strace", "-f", "-qq", "-o", folder / "trace", *options, PROGRAM, *command],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "SMACLITE_POOL_ROOT": str(folder / "pools")},
        start_new_session=True,
    )
    try:
        _, stderr = process.communicate(timeout=LONGEST)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        return None, process.communicate()[1]
    return process.returncode, stderr


def shared_memory(folder: Path) -> set[str]:
    """What the pools of a folder have in shared memory; its name has 8 digits of a hash of the folder's."""
    used = re.search(rf"{SHM}/(sp[0-9a-f]{{8}})", (folder / "trace").read_text())
    return {path.name for path in SHM.glob(f"{used[1]}*")} if used else set()


def calls(scenario: str, folder: Path) -> dict[str, tuple[int, int]]:
    """By system call: how many of them came before `main`, and the most of one thread."""
    status, stderr = run(scenario, folder, ["-e", f"trace={','.join(FAULTS)},sigaltstack"])
    if status != 0:
        raise SystemExit(f"faults.py: {scenario}: {stderr}")
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    before: Counter[str] | None = None
    for line in (folder / "trace").read_text().splitlines():
        if match := re.match(r"(\d+) +(\w+)\(", line):
            if match[2] == "sigaltstack":  # Rust's runtime begins
                before = before or Counter({call: sum(of.values()) for call, of in counts.items()})
            else:
                counts[match[2]][match[1]] += 1
    return {call: ((before or Counter())[call], max(of.values())) for call, of in counts.items()}


def faults(scenario: str, of: dict[str, tuple[int, int]]) -> Iterator[Fault]:
    for call, (before, most) in sorted(of.items()):
        for error in FAULTS[call]:
            if error == KILL and scenario == "attached":
                continue  # the pool is another process, which goes on
            yield from (Fault(call, error, number) for number in range(before + 1, most + 1))


def wrong(fault: Fault, status: int | None, stderr: str, folder: Path) -> str | None:
    """What is wrong after a fault."""
    cleaned = {**os.environ, "SMACLITE_POOL_ROOT": str(folder / "pools")}
    subprocess.run([PROGRAM, "clean"], env=cleaned, capture_output=True, check=False)
    left = {path.name for path in (folder / "pools").iterdir()} - {"in-use"} | shared_memory(folder)
    if any(message in stderr for message in EXCUSED):
        return None
    if status is None:
        return "it hangs"
    if "panicked" in stderr:
        return "it panics"
    if status not in (0, 1) and not (fault.error == KILL and status == -signal.SIGKILL):
        return f"exit status {status}"
    if status == 1 and not stderr.strip() and (fault.call, fault.error) != ("write", "ENOSPC"):
        return "it fails without a message"
    return f"it leaves {sorted(left)}" if left else None


def test(scenario: str, sample: int | None, folder: Path) -> int:
    """Prints what is wrong and a line with counts. Returns how many faults were not survived."""
    found = list(faults(scenario, calls(scenario, folder)))
    chosen = found if sample is None else random.Random(1).sample(found, min(sample, len(found)))
    results: Counter[str] = Counter()
    for fault in chosen:
        status, stderr = run(scenario, folder, fault.options())
        problem = wrong(fault, status, stderr, folder)
        if problem:
            print(
                f"{scenario}: {fault.call} {fault.error}, call {fault.number}: {problem}\n{stderr[-2000:]}",
                flush=True,
            )
        results[
            "wrong" if problem else "success" if status == 0 else "killed" if fault.error == KILL else "error"
        ] += 1
    counts = ", ".join(f"{results[name]} {name}" for name in ("success", "error", "killed", "wrong"))
    print(f"{scenario}: {len(chosen)} of {len(found)} faults: {counts}", flush=True)
    return results["wrong"]


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        "faults.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scenarios", nargs="*", metavar="SCENARIO", help=f"{', '.join(SCENARIOS)} (all)")
    parser.add_argument("--sample", type=int, metavar="N", help="N faults of each scenario (all)")
    options = parser.parse_args(argv)
    if unknown := set(options.scenarios) - set(SCENARIOS):
        parser.error(f"unknown scenario {', '.join(sorted(unknown))}; there are {', '.join(SCENARIOS)}")
    with tempfile.TemporaryDirectory(prefix="faults") as folder:
        problems = sum(
            test(name, options.sample, Path(folder) / "f") for name in options.scenarios or SCENARIOS
        )
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
