"""Runs the Windows program under Wine and the program of this system side by side: `just windows`.

Both must print the same and write the same bytes: replays of all standard scenarios under two rule sets, a
picture and messages. A team that is trained must come to an end; its bits are those of the system, whose
logarithms differ.

Wine before version 9 lacks a function by which Rust's standard library gets random bits; a library of one
function stands in for it.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

RANDOM_BITS = """
#include <windows.h>
BOOLEAN NTAPI SystemFunction036(PVOID bytes, ULONG length);
__declspec(dllexport) BOOL WINAPI ProcessPrng(PBYTE bytes, SIZE_T length) {
    return SystemFunction036(bytes, (ULONG)length);
}
"""


def main() -> int:
    parser = argparse.ArgumentParser("windows", description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("here", help="the program of this system", type=Path)
    parser.add_argument("windows", help="smaclite-pool.exe", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        library = random_bits(root)
        environment = {"WINEDEBUG": "-all", "WINEPATH": windows_path(library)}
        places = {"here": [str(options.here.resolve())], "windows": ["wine", str(options.windows.resolve())]}
        results = {}
        for name, program in places.items():
            (root / name).mkdir()
            results[name] = list(results_of(program, root / name, environment))
        wrong = [
            f"{one[0]}: {shown(one[1])} here, {shown(other[1])} on Windows"
            for one, other in zip(results["here"], results["windows"], strict=True)
            if one != other
        ]
    print("\n".join(wrong) or f"{len(results['here'])} results are the same")
    return 1 if wrong else 0


def shown(result: object) -> str:
    text = repr(result)
    return text if len(text) <= 300 else f"{text[:300]}..."


def results_of(program: list[str], folder: Path, environment: dict[str, str]) -> Iterator[tuple[str, object]]:
    """What is done, and what comes of it."""

    def run(*arguments: str) -> tuple[int, str]:
        done = subprocess.run(
            [*program, *arguments],
            cwd=folder,
            env=os.environ | environment | {"COLUMNS": "100"},
            capture_output=True,
            text=True,
            timeout=600,
        )
        return done.returncode, (done.stdout + done.stderr).replace("\\", "/").replace("\r", "")

    yield "version", run("--version")
    scenarios = [line.split()[0] for line in run("scenarios")[1].splitlines()[1:] if line]
    yield "scenarios", scenarios
    for rules in ("smaclite", "starcraft"):
        for scenario in scenarios:
            file = f"{scenario}-{rules}.smreplay"
            options = ["--policy", "random", "--seed", "7", "--rules", rules, "--out", file]
            ended = run("record", scenario, *options)
            yield f"record {scenario} under {rules}", (ended, read(folder / file))
    yield "picture", (run("show", "MMM", "--png", "MMM.png")[0], read(folder / "MMM.png"))
    (folder / "mine.json").write_text('{"name": "mine", "num_allied_units": -1}')
    yield "check", run("check", "mine.json")
    trained = run("train", "3m", "--steps", "20000", "--seed", "1", "--threads", "2", "--out", "team")[0]
    yield "train", (trained, len(read(folder / "team" / "weights.safetensors")))
    yield "evaluate", run("evaluate", "zoo:2s3z", "--episodes", "64", "--seed", "1", "--threads", "2")
    yield "bench", run("bench", "3m", "--mode", "embedded", "--seconds", "0.2")[0]


def read(file: Path) -> bytes:
    return file.read_bytes() if file.exists() else b""


def random_bits(folder: Path) -> Path:
    """A folder with the library."""
    library = folder / "library"
    library.mkdir()
    (library / "random.c").write_text(RANDOM_BITS)
    compiler = ["x86_64-w64-mingw32-gcc-posix", "-shared", "-O2", "-o", "bcryptprimitives.dll"]
    subprocess.run([*compiler, "random.c", "-ladvapi32"], cwd=library, check=True)
    return library


def windows_path(folder: Path) -> str:
    return "Z:" + str(folder).replace("/", "\\")


if __name__ == "__main__":
    sys.exit(main())
