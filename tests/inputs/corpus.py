"""Packs the inputs that fuzzing found, and unpacks them for more fuzzing: `corpus.py pack|unpack TARGET`.

`tests/fuzz/corpus` is the fuzzers' own; `tests/inputs/corpus` has an archive per target, for the tests.
"""

import sys
import zipfile
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]


def main(action: str, target: str) -> None:
    folder = TESTS / "fuzz" / "corpus" / target
    archive = TESTS / "inputs" / "corpus" / f"{target}.zip"
    if action == "unpack":
        folder.mkdir(parents=True, exist_ok=True)
        with zipfile.ZipFile(archive) as inputs:
            inputs.extractall(folder)
        return
    archive.parent.mkdir(exist_ok=True)
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as inputs:
        # Names are hashes of contents, and times are left out: equal inputs make equal archives.
        for file in sorted(folder.iterdir()):
            inputs.writestr(zipfile.ZipInfo(file.name), file.read_bytes(), zipfile.ZIP_DEFLATED)


if __name__ == "__main__":
    main(*sys.argv[1:])
