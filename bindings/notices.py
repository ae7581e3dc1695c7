"""Writes THIRD-PARTY-LICENSES: the licences of all crates that the extension module contains.

`just generate` writes the file, and `just lint` fails if it is not up to date. The wheel contains it, and
`smaclite-pool licences` prints it. Of a choice of licences that includes MIT, MIT is taken.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FILE = ROOT / "THIRD-PARTY-LICENSES"
TARGETS = (
    "x86_64-unknown-linux-gnu", "aarch64-unknown-linux-gnu",
    "x86_64-apple-darwin", "aarch64-apple-darwin", "x86_64-pc-windows-gnu",
)  # fmt: skip
RULE = "=" * 100

HEAD = """Third-party licences

smaclite-pool itself is licensed under MIT or Apache-2.0. Its extension module and its program contain
the crates below, each list followed by the text of their licence. `just generate` writes this file.
"""

# Some crates have a licence, but no file with its text.
MIT = """Copyright (c) {authors}

Permission is hereby granted, free of charge, to any person obtaining a copy of this software and
associated documentation files (the "Software"), to deal in the Software without restriction, including
without limitation the rights to use, copy, modify, merge, publish, distribute, sublicense, and/or sell
copies of the Software, and to permit persons to whom the Software is furnished to do so, subject to the
following conditions:

The above copyright notice and this permission notice shall be included in all copies or substantial
portions of the Software.

THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR IMPLIED, INCLUDING BUT NOT
LIMITED TO THE WARRANTIES OF MERCHANTABILITY, FITNESS FOR A PARTICULAR PURPOSE AND NONINFRINGEMENT. IN NO
EVENT SHALL THE AUTHORS OR COPYRIGHT HOLDERS BE LIABLE FOR ANY CLAIM, DAMAGES OR OTHER LIABILITY, WHETHER
IN AN ACTION OF CONTRACT, TORT OR OTHERWISE, ARISING FROM, OUT OF OR IN CONNECTION WITH THE SOFTWARE OR
THE USE OR OTHER DEALINGS IN THE SOFTWARE.
"""


def cargo(*arguments: str) -> str:
    command = [os.environ.get("CARGO", "cargo"), *arguments, "--locked"]
    return subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout


def contained() -> set[tuple[str, str]]:
    """Name and version of every crate of others in the extension module, on any system."""
    options = (
        "tree",
        "--package",
        "smaclite-bindings",
        "--edges",
        "normal,no-proc-macro",
        "--prefix",
        "none",
    )
    trees = "".join(cargo(*options, "--target", target) for target in TARGETS)
    lines = {line.removesuffix(" (*)") for line in trees.splitlines() if line}
    words = (line.split() for line in lines if "(/" not in line and "(proc-macro)" not in line)
    return {(name, version.removeprefix("v")) for name, version, *_ in words}


def texts(package: dict[str, str]) -> list[str]:
    """The texts of the licences of a crate."""
    folder = Path(package["manifest_path"]).parent
    begins = ("LICEN", "COPYING", "NOTICE", "COPYRIGHT", "UNLICENSE")
    files = [
        file for file in sorted(folder.iterdir()) if file.is_file() and file.name.upper().startswith(begins)
    ]
    licence = package["license"] or ""
    mit = [file for file in files if "MIT" in file.name.upper()]
    if mit and "AND" not in licence:
        files = mit
    if files:
        return [file.read_text(errors="replace") for file in files]
    if "Apache-2.0" in licence:
        return [(ROOT / "LICENSE-APACHE").read_text()]
    if licence == "MIT":
        authors = ", ".join(package["authors"]) or f"the authors of {package['name']}"
        return [MIT.format(authors=authors)]
    raise SystemExit(f"error: {package['name']} ({licence}) has no file with its licence")


FONT = ROOT / "pool/view/src/render/font/OFL.txt"


def notices() -> str:
    """The whole file: crates with the same text have it in common."""
    packages = json.loads(cargo("metadata", "--format-version", "1"))["packages"]
    wanted = contained()
    users: dict[str, tuple[str, list[str]]] = {}
    for package in sorted(packages, key=lambda package: (package["name"], package["version"])):
        if (package["name"], package["version"]) in wanted:
            crate = f"{package['name']} {package['version']} ({package['license']})"
            for text in texts(package):
                shown = "\n".join(line.rstrip() for line in text.strip("\ufeff").strip().splitlines())
                users.setdefault(" ".join(text.split()), (shown, []))[1].append(crate)
    users["font"] = (FONT.read_text().strip(), ["the font Inter (OFL-1.1)"])
    parts = ["\n".join([RULE, *crates, "", shown, ""]) for shown, crates in users.values()]
    return "\n".join([HEAD, *parts])


def main() -> None:
    text = notices()
    if sys.argv[1:] == ["--check"]:
        if not FILE.exists() or FILE.read_text() != text:
            raise SystemExit("error: THIRD-PARTY-LICENSES is not up to date; `just generate` writes it")
    else:
        FILE.write_text(text)


if __name__ == "__main__":
    main()
