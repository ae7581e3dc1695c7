"""Runs every Python block of the documentation and of the docstrings of modules.

Blocks whose framework is not installed are skipped, as the frameworks cannot share one environment.
"""

import ast
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "bindings/python/smaclite_pool"
PROGRAM = [sys.executable, "-m", "smaclite_pool"]


FRAMEWORKS = {"gymnasium", "pettingzoo", "safetensors", "torch", "torchrl", "tensordict", "jax", "ray"}
COMMAND = r"^(python|pip|smaclite-pool)"


def fenced(text: str, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def indented(docstring: str) -> Iterator[str]:
    """The indented blocks of a docstring that are complete Python programs."""
    for block in re.findall(r"\n\n((?: {4}.*\n|\n(?= {4}))+)", docstring + "\n"):
        code = "".join(line[4:] if line.strip() else "\n" for line in block.splitlines(keepends=True))
        try:
            tree = ast.parse(code)
        except SyntaxError:
            assert re.search(COMMAND, code, re.MULTILINE), code
            continue
        names = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
        names |= {name.name for node in ast.walk(tree) if isinstance(node, ast.Import) for name in node.names}
        if any((name or "").startswith("smaclite_pool") for name in names) and "REGISTRY" not in code:
            yield code


def examples() -> Iterator[object]:
    for page in sorted((ROOT / "docs").rglob("*.md")):
        for number, code in enumerate(fenced(page.read_text(), "python")):
            yield pytest.param(page, code, id=f"{page.relative_to(ROOT)}-{number}")
    for module in sorted(PACKAGE.rglob("*.py")):
        docstring = ast.get_docstring(ast.parse(module.read_text())) or ""
        for number, code in enumerate(indented(docstring)):
            yield pytest.param(module, code, id=f"{module.relative_to(PACKAGE)}-{number}")


@pytest.fixture
def folder() -> Iterator[Path]:
    """A folder for pools, with the files of the pages; its path is short, as it contains sockets."""
    with tempfile.TemporaryDirectory(prefix="docs-") as folder:
        for page in (ROOT / "docs").rglob("*.md"):
            file = r"^`(\w+\.json)`[^\n]*\n\n```json\n(.*?)^```"
            for name, text in re.findall(file, page.read_text(), re.M | re.S):
                (Path(folder) / name).write_text(text)
        yield Path(folder)


@pytest.mark.parametrize(("source", "code"), list(examples()))
def test_example(source: Path, code: str, folder: Path) -> None:
    environment = {**os.environ, "SMACLITE_POOL_ROOT": str(folder / "pools")}
    pool = None
    try:
        if "sp.connect(" in code:
            arguments = ["serve", "2s3z:4", "MMM2:4", "--name", "train"]
            program = [*PROGRAM, *arguments]
            pool = subprocess.Popen(program, env=environment, stdout=subprocess.PIPE, text=True)
            assert pool.stdout is not None
            assert any("smaclite_pool.connect" in line for line in pool.stdout), "the pool did not start"
        command = [sys.executable, "-c", code]
        done = subprocess.run(
            command, env=environment, cwd=folder, capture_output=True, text=True, timeout=180, check=False
        )
    finally:
        if pool is not None:
            pool.terminate()
            pool.wait(timeout=10)
    missing = re.search(r"ModuleNotFoundError: No module named '(\w+)", done.stderr)
    if missing and missing[1] in FRAMEWORKS:
        pytest.skip(f"{missing[1]} is not installed")
    assert done.returncode == 0, f"{source}:\n{code}\n{done.stderr}"


def test_the_files_of_the_tutorial_are_correct(folder: Path) -> None:
    files = sorted(str(file) for file in folder.glob("*.json"))
    assert len(files) == 2
    done = subprocess.run([*PROGRAM, "check", *files], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr


def test_the_site_names_every_page() -> None:
    named = set(re.findall(r"([\w/-]+\.md)", (ROOT / "mkdocs.yml").read_text()))
    pages = {str(page.relative_to(ROOT / "docs")) for page in (ROOT / "docs").rglob("*.md")}
    assert named == pages


def test_every_picture_exists_and_loads_fast() -> None:
    pages = [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
    named = {path for page in pages for path in pictures(page)}
    assert named == {*(ROOT / "docs/pictures").iterdir(), *(ROOT / "docs/results").glob("*.svg")}
    limits = {"battle.gif": 700_000, "maps.png": 150_000}  # the sheet has 23 pictures
    for picture in named:
        usual = 60_000 if picture.suffix == ".svg" else 40_000  # servers compress SVG to a third
        assert picture.stat().st_size < limits.get(picture.name, usual), picture


def pictures(page: Path) -> Iterator[Path]:
    """The pictures of a page, all of which have an alternative text."""
    for text, path in re.findall(r"!\[(.*?)\]\((.+?)\)", page.read_text()):
        assert text, path
        yield page.parent / path
