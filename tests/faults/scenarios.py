"""What is done while system calls fail, and what must be so afterwards."""

from __future__ import annotations

import os
import random
import re
import signal
import subprocess
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from . import clients
from .injection import FAULTS, KILL, PROGRAM, Client, End, Fault, calls, faults, new_folder, run
from .neighbour import POOL, Neighbour

SHM = Path("/dev/shm")


@dataclass(frozen=True)
class Scenario:
    """A command, in which FOLDER is an empty folder."""

    command: str
    has_neighbour: bool = False
    """Whether the command uses a pool that others use, too."""
    client: Client | None = None
    """Whom the command serves."""
    kills: bool = True
    """Whether faults kill the command."""
    check: Callable[[Path], str | None] = lambda folder: None
    """What is wrong with the files of its folder."""


def check_replay(folder: Path) -> str | None:
    """A replay is either not there or whole."""
    file = folder / "a.smreplay"
    if not file.exists():
        return None
    done = subprocess.run([PROGRAM, "replay", file], capture_output=True, text=True, check=False)
    return f"its replay: {done.stderr}" if done.returncode else None


TRAIN = "train --steps 200 --horizon 8 --epochs 1 --minibatches 1 --seed 1 --out FOLDER/run "

SCENARIOS = {
    "check": Scenario("check FOLDER/duel.json"),
    "record": Scenario("record 3m --seed 1 --out FOLDER/a.smreplay", check=check_replay),
    "dataset": Scenario("dataset record random --scenario 3m --episodes 2 --out FOLDER/a.smdata"),
    "bench": Scenario("bench 3m --mode embedded --seconds 0.01 --num-envs 4 --threads 2"),
    # The pool is another process, which goes on when the command is killed.
    "attached": Scenario("bench 3m --mode attached --seconds 0.01 --num-envs 4 --threads 1", kills=False),
    "train": Scenario(TRAIN + "3m --num-envs 4 --evaluate-every 100 --threads 2"),
    "serve": Scenario(
        f"serve 3m:2 --name {POOL} --threads 1 --fields {','.join(clients.FIELDS)}", client=clients.learner
    ),
    "edit": Scenario("edit FOLDER/duel.json", client=clients.editor),
    "learner": Scenario(TRAIN + f"--pool {POOL} --lane free --threads 1", has_neighbour=True),
    "follower": Scenario(
        f"record --pool {POOL} --lane own --out FOLDER/a.smreplay", has_neighbour=True, check=check_replay
    ),
    "watch": Scenario(f"watch {POOL}", has_neighbour=True, client=clients.viewer),
    "status": Scenario(f"status {POOL}", has_neighbour=True),
}

EXCUSED = {
    "failed to allocate an alternative stack": "the standard library ends a thread without memory",
    "memory allocation of": "as every allocation of a Rust program",
    "This should never happen": "iceoryx2 panics on errors that it holds for impossible",
    "signal-hook": "so does it, on its own pipe",
    "failed to wake I/O driver": "and tokio, on its own eventfd",
    "Bad read on self-pipe": "and on its own pipe",
}
"""Messages of panics that are not ours to prevent, and why."""


class Stage:
    """Where a scenario is played, once per fault."""

    def __init__(self, scenario: Scenario, folder: Path, neighbour: Neighbour | None) -> None:
        self._scenario = scenario
        self._folder = folder
        self.neighbour = neighbour

    def run(self, options: list[str]) -> End:
        folder = new_folder(self._folder)
        new: list[Path | str] = [PROGRAM, "new", "scenario", folder / "out/duel.json"]
        subprocess.run(new, capture_output=True, check=True)
        command = self._scenario.command.replace("FOLDER", str(folder / "out")).split()
        return run(command, folder, self._pools(), options, self._scenario.client)

    def _pools(self) -> Path:
        return self.neighbour.pools if self.neighbour else self._folder / "pools"

    def calls(self) -> dict[str, tuple[int, int]]:
        end = self.run(["-e", f"trace={','.join(FAULTS)},sigaltstack"])
        if end.status != 0 or end.problem:
            raise SystemExit(f"faults: {self._scenario.command}: {end.problem or end.stderr}")
        return calls((self._folder / "trace").read_text())

    def wrong(self, fault: Fault, end: End) -> str | None:
        """What is wrong after a fault."""
        disturbed, left = (self.neighbour.wrong(), None) if self.neighbour else (None, self.left())
        if end.status is None:
            return "it hangs"
        if disturbed or any(message in end.stderr for message in EXCUSED):
            return disturbed
        if "panicked" in end.stderr:
            return "it panics"
        if end.status not in (0, 1) and not (fault.error == KILL and end.status == -signal.SIGKILL):
            return f"exit status {end.status}"
        if end.status == 1 and not end.stderr.strip() and (fault.call, fault.error) != ("write", "ENOSPC"):
            return "it fails without a message"
        return end.problem or left or self._scenario.check(self._folder / "out")

    def left(self) -> str | None:
        """What of the command is left after `clean`."""
        cleaned = {**os.environ, "SMACLITE_POOL_ROOT": str(self._pools())}
        subprocess.run([PROGRAM, "clean"], env=cleaned, capture_output=True, check=False)
        left = {path.name for path in self._pools().iterdir()} - {"in-use"} | self._shared_memory()
        return f"it leaves {sorted(left)}" if left else None

    def _shared_memory(self) -> set[str]:
        """What the folder's pools have in shared memory; its name has 8 digits of a hash of the folder's."""
        used = re.search(rf"{SHM}/(sp[0-9a-f]{{8}})", (self._folder / "trace").read_text())
        return {path.name for path in SHM.glob(f"{used[1]}*")} if used else set()


@contextmanager
def stage(name: str, folder: Path) -> Iterator[Stage]:
    """Also fails if the neighbour's pool does not end well."""
    scenario = SCENARIOS[name]
    if not scenario.has_neighbour:
        yield Stage(scenario, folder / "f", None)
        return
    neighbour = Neighbour(folder / f"n-{name}")
    at = Stage(scenario, folder / "f", neighbour)
    try:
        yield at
    finally:
        problem = neighbour.close()
        left = at.left()
        if problem or left:
            raise SystemExit(f"faults: {name}: {problem or left}")
    print(f"{name}: the longest step of the neighbour took {neighbour.longest:.3f} s")


def test(name: str, sample: int | None, folder: Path) -> int:
    """Prints what is wrong and a line with counts. Returns how many faults were not survived."""
    results: Counter[str] = Counter()
    with stage(name, folder) as at:
        found = list(faults(at.calls(), SCENARIOS[name].kills))
        chosen = found if sample is None else random.Random(1).sample(found, min(sample, len(found)))
        for fault in chosen:
            end = at.run(fault.options())
            problem = at.wrong(fault, end)
            if problem:
                print(f"{name}: {fault}: {problem}\n{end.stderr[-2000:]}", flush=True)
            results[
                "wrong"
                if problem
                else "success"
                if end.status == 0
                else "killed"
                if fault.error == KILL
                else "error"
            ] += 1
    counts = ", ".join(f"{results[name]} {name}" for name in ("success", "error", "killed", "wrong"))
    print(f"{name}: {len(chosen)} of {len(found)} faults: {counts}", flush=True)
    return results["wrong"]
