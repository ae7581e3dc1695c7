"""Links and pictures of README and documents: in a clone, on the site, and in the text that wheels carry.

README and pages linked to files of the repository by its address, which did not exist for readers of a clone
whose repository was elsewhere or not public: badges and pictures were missing, documents were dead links.
"""

from __future__ import annotations

import importlib.util
import json
import re
from collections.abc import Iterator
from importlib.metadata import metadata
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
NAMES = [
    "README.md",
    "ARCHITECTURE.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
    "SECURITY.md",
    "benches/README.md",
]
PAGES = [ROOT / name for name in NAMES] + sorted((ROOT / "docs").rglob("*.md"))
NOTEBOOKS = sorted((ROOT / "docs").rglob("*.ipynb"))
NATIVE = "smaclite_pool"
"""Anchors that begin so are those of mkdocstrings; MkDocs checks them when it builds the site."""

OWN = re.compile(
    r"github\.com/smaclite-pool/smaclite-pool/(?:blob|tree|raw)/|"
    r"raw\.githubusercontent\.com/smaclite-pool/|smaclite-pool\.github\.io"
)
"""Addresses of what a clone contains."""


def module(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec and spec.loader
    loaded = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded


def text(page: Path) -> str:
    """A page without its code, or the text of a notebook."""
    source = page.read_text()
    if page.suffix == ".ipynb":
        cells = json.loads(source)["cells"]
        source = "\n\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown")
    source = re.sub(r"^( *)```.*?^\1```$", "", source, flags=re.M | re.S)
    return re.sub(r"`[^`\n]*`", "`code`", source)


def targets(source: str) -> Iterator[str]:
    """What a text links to, pictures included."""
    yield from re.findall(r"\]\(([^)\s]+)\)", source)
    yield from re.findall(r"^\[[^]]+\]: (\S+)$", source, re.M)
    yield from re.findall(r'\b(?:href|src|srcset)="([^"]+)"', source)


def anchors(page: Path) -> set[str]:
    """Of the headings of a page: those that both GitHub and the site give them."""
    source = re.sub(r"^( *)```.*?^\1```$", "", page.read_text(), flags=re.M | re.S)
    headings = re.findall(r"^#+ (.*?)(?: \{ *#[\w-]+ *\})?$", source, re.M)
    plain = [re.sub(r"<!--.*?-->|\]\([^)]*\)|[\[`]", "", heading).strip() for heading in headings]
    github = {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in plain}
    site = {re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", heading).strip().lower()) for heading in plain}
    return github & site if "docs" in page.relative_to(ROOT).parts[:1] else github


@pytest.mark.parametrize("page", PAGES + NOTEBOOKS, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_to_files_and_headings_of_a_clone(page: Path) -> None:
    for target in targets(text(page)):
        assert not OWN.search(target), f"{target}: a link relative to the page works without the repository"
        path, _, anchor = target.partition("#")
        if ":" in path:
            continue
        file = (page.parent / path).resolve() if path else page
        generated = file == ROOT / "docs/playground/battle.html"
        assert file.exists() or generated, f"{target}: there is no such file"
        assert file.is_relative_to(ROOT), f"{target}: outside of the repository"
        named = anchor and file.suffix == ".md" and not anchor.startswith(NATIVE)
        assert not named or anchor in anchors(file), f"{target}: no heading has this anchor"


def test_every_reference_is_defined_and_used() -> None:
    source = text(ROOT / "README.md")
    defined = set(re.findall(r"^\[([^]]+)\]: \S+$", source, re.M))
    assert len(defined) > 20
    assert set(re.findall(r"\]\[([^]]+)\]", source)) == defined


def test_what_wheels_carry_works_where_there_is_no_repository() -> None:
    """PyPI shows this text alone: relative links lead nowhere there, and relative pictures are missing."""
    readme = module(ROOT / "bindings/readme.py")
    assert readme.main(["--check"]) == 0, "run `just generate`"
    source = text(readme.FILE)
    found = [*targets(source)]
    assert len(found) > 20 and not [target for target in found if not target.startswith("https://")]
    assert (
        "https://raw.githubusercontent.com/smaclite-pool/smaclite-pool/main/docs/pictures/maps.png" in found
    )
    assert "https://github.com/smaclite-pool/smaclite-pool/blob/main/docs/faq.md" in found


def test_the_installed_package_carries_it() -> None:
    message: Any = metadata("smaclite-pool")  # an email message, whose body is the description
    described: str = message.get_payload()
    assert described.strip() == (ROOT / "bindings/pypi.md").read_text().strip()


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("[a](docs/faq.md#b)", "[a](https://github.com/a/b/blob/main/docs/faq.md#b)"),
        ("[a](#b)", "[a](https://github.com/a/b/blob/main/README.md#b)"),
        ("![a](x.png)", "![a](https://raw.githubusercontent.com/a/b/main/x.png)"),
        (
            "[![a](https://c/d.svg)](LICENSE)",
            "[![a](https://c/d.svg)](https://github.com/a/b/blob/main/LICENSE)",
        ),
        ('<img src="x.svg">', '<img src="https://raw.githubusercontent.com/a/b/main/x.svg">'),
        ("[a]: docs/faq.md", "[a]: https://github.com/a/b/blob/main/docs/faq.md"),
        ("[a](https://c/d)", "[a](https://c/d)"),
        ("```sh\n[a](b)\n```", "```sh\n[a](b)\n```"),
    ],
)
def test_relative_links_get_the_address_of_the_repository(source: str, expected: str) -> None:
    readme = module(ROOT / "bindings/readme.py")
    assert readme.with_addresses(source, "https://github.com/a/b") == expected
