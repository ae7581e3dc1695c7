"""Writes bindings/pypi.md: README.md as wheels carry it, for a page without a repository around it.

In the repository, links and pictures are relative, so that they work in every clone. PyPI shows the text
alone; there they lead to the repository that pyproject.toml names. `just generate` writes the file, and
`just lint` fails if it is not up to date.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "README.md"
FILE = ROOT / "bindings" / "pypi.md"
NOTE = "<!-- `just generate` makes this file of README.md: the same with whole addresses -->\n\n"


def main(argv: list[str]) -> int:
    text = NOTE + with_addresses(SOURCE.read_text(), repository())
    if "--check" not in argv:
        FILE.write_text(text)
    elif not FILE.exists() or FILE.read_text() != text:
        print(f"error: {FILE.relative_to(ROOT)} is not up to date: run `just generate`", file=sys.stderr)
        return 1
    return 0


def repository() -> str:
    """The address of the repository, such as https://github.com/OWNER/NAME."""
    found = re.search(r'^Repository = "(.*)"$', (ROOT / "pyproject.toml").read_text(), re.M)
    if not found:
        raise SystemExit("error: pyproject.toml has no `Repository`")
    return found[1]


def with_addresses(text: str, repository: str) -> str:
    """The text, whose relative links and pictures are addresses in the repository. Code stays."""
    pages = f"{repository}/blob/main/"
    files = repository.replace("https://github.com/", "https://raw.githubusercontent.com/") + "/main/"

    def address(prefix: str) -> Callable[[re.Match[str]], str]:
        def whole(found: re.Match[str]) -> str:
            target = SOURCE.name + found[2] if found[2].startswith("#") else found[2]
            return found[0] if ":" in target else f"{found[1]}{prefix}{target}{found[3]}"

        return whole

    parts = re.split(r"(^```.*?^```$)", text, flags=re.M | re.S)
    for i in range(0, len(parts), 2):
        parts[i] = re.sub(r"(!\[[^]]*\]\()([^)\s]+)(\))", address(files), parts[i])
        parts[i] = re.sub(r'(\b(?:src|srcset)=")([^"]+)(")', address(files), parts[i])
        parts[i] = re.sub(r"(?<!!)(\[(?:[^][]|\[[^]]*\])*\]\()([^)\s]+)(\))", address(pages), parts[i])
        parts[i] = re.sub(r"(^\[[^]]+\]: )(\S+)($)", address(pages), parts[i], flags=re.M)
    return "".join(parts)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
