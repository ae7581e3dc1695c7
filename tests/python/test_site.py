"""The site and the documents: they name every page, module, picture and public name, and what they insert."""

from __future__ import annotations

import ast
import importlib.util
import re
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest
import smaclite_pool as sp

from results import benchmarks
from test_docs import DOCS, PACKAGE, PAGES, ROOT, blocks, place


def test_code_fits_the_column_of_the_site() -> None:
    """Lines that do not fit are broken anywhere, which commands stand better than expressions."""
    for page in PAGES:
        for block in blocks(page.read_text()):
            limit = 90 if block.language == "python" else 100
            lines = [] if block.is_output else block.code.splitlines()
            assert not [line for line in lines if len(line) > limit], page


def test_the_site_names_every_page() -> None:
    nav = (ROOT / "mkdocs.yml").read_text().split("\nnav:")[1]
    assert set(re.findall(r"([\w/-]+\.md)", nav)) == {place(page) for page in PAGES}


@pytest.mark.parametrize(
    "name", ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "SECURITY.md", "benches/README.md"]
)
def test_files_that_are_named_are_there(name: str) -> None:
    text = (ROOT / name).read_text()
    paths = set(re.findall(r"`([\w./-]+/[\w.-]+\.(?:rs|py|pyi|md|csv))`", text))
    assert not [path for path in paths if not (ROOT / path).exists()]


RUST = "units scenarios pool/engine pool pool/view ipc bindings/learn bindings/lab bindings benches"


@pytest.mark.parametrize("crate", RUST.split())
def test_the_architecture_has_every_module(crate: str) -> None:
    text = (ROOT / "ARCHITECTURE.md").read_text()
    section = text.split(f"\n## `{crate}`:")[1].split("\n## ")[0]
    named = set(re.findall(r"`(\w+)(?:\.rs|/)?`", section))
    ignored = {"lib", "main", "tests"}
    files = [*(ROOT / crate / "src").iterdir()]
    modules = {file.stem for file in files if file.suffix in {"", ".rs"}} - ignored
    assert not {module for module in modules if module not in named and not module.endswith("_tests")}


def test_every_picture_exists_and_loads_fast() -> None:
    named = {path for page in [ROOT / "README.md", *PAGES] for path in pictures(page)}
    drawn = [*DOCS.glob("pictures/*"), *DOCS.glob("results/**/*.svg"), *DOCS.glob("benchmarks/*.svg")]
    assert named == set(drawn)
    limits = {"battle.gif": 700_000, "maps.png": 150_000}  # the sheet has 23 pictures
    for picture in named:
        usual = 60_000 if picture.suffix == ".svg" else 40_000  # servers compress SVG to a third
        assert picture.stat().st_size < limits.get(picture.name, usual), picture


def test_charts_fit_light_and_dark_pages() -> None:
    """On a dark page, the charts were white boxes. Each is there twice, and the page shows one of them."""
    for page in PAGES:
        charts = re.findall(r"^!\[(.*?)\]\((.*?)\.svg(.*?)\)$", page.read_text(), re.M)
        for light, dark in zip(charts[::2], charts[1::2], strict=True):
            assert light[2] == "#gh-light-mode-only", page
            assert dark == (light[0], f"{light[1]}-dark", "#gh-dark-mode-only"), page


def pictures(page: Path) -> Iterator[Path]:
    """The pictures of a page, all of which have an alternative text. Badges are elsewhere."""
    source = re.sub(r'<img alt="(.*?)" src="(.*?)">', r"![\1](\2)", page.read_text())
    for text, path in re.findall(r"!\[([^]]*)\]\((?!https:)(.+?)\)", source):
        assert text, path
        yield (page.parent / path.partition("#")[0]).resolve()
    for path in re.findall(r'srcset="(.*?)"', source):
        yield (page.parent / path).resolve()


def test_the_reference_has_every_public_name() -> None:
    page = (DOCS / "reference/python.md").read_text()
    listed = {name.strip() for names in re.findall(r"members: \[(.*)\]", page) for name in names.split(",")}
    for module in re.findall(r"::: smaclite_pool\.(?!_native)(\w+)", page):
        tree = ast.parse((PACKAGE / f"{module}.py").read_text())
        listed |= {node.name for node in tree.body if isinstance(node, ast.ClassDef | ast.FunctionDef)}
    modules = {"errors", "extras"}
    assert {*sp.__all__, *sp.errors.__all__, *sp.extras.__all__} - listed == {"__version__", *modules}


def test_lists_of_members_are_complete() -> None:
    listed = r"::: smaclite_pool\.((?:integrations|marl)\S+)\n    options:\n      members: \[(.*)\]"
    for page in PAGES:
        for path, names in re.findall(listed, page.read_text()):
            module = PACKAGE / path.replace(".", "/")
            file = module / "__init__.py" if module.is_dir() else module.with_suffix(".py")
            [public] = re.findall(r"^__all__ = (\[.*?\])$", file.read_text(), re.M | re.S)
            aliases = {"StarCraft2Env"}
            quoted = {"on": '"on"'}  # YAML takes `on` for True
            listed_names = {quoted.get(name, name) for name in ast.literal_eval(public)}
            assert listed_names - aliases <= set(names.split(", ")), page


def site_hooks() -> ModuleType:
    """The module that MkDocs calls."""
    spec = importlib.util.spec_from_file_location("site_hooks", DOCS / "site_hooks.py")
    assert spec and spec.loader
    hooks = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(hooks)
    return hooks


def test_a_site_without_versions_asks_for_nothing_that_is_not_there(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every page asked for versions.json, which only mike writes, and GitHub for a number of stars."""
    hooks = site_hooks()
    monkeypatch.delenv("MIKE_DOCS_VERSION", raising=False)
    config = SimpleNamespace(extra={"version": {"provider": "mike"}})
    assert not hooks.on_config(config).extra
    monkeypatch.setenv("MIKE_DOCS_VERSION", "0.1")
    config = SimpleNamespace(extra={"version": {"provider": "mike"}})
    assert hooks.on_config(config).extra
    link = '<a href="https://github.com/a/b" class="md-source" data-md-component="source">'
    assert hooks.on_post_page(link) == '<a href="https://github.com/a/b" class="md-source">'


def test_pages_get_what_they_take_from_the_package() -> None:
    hooks = site_hooks()
    config = SimpleNamespace(repo_url="https://github.com/a/b")
    files = {place(page): SimpleNamespace(file=SimpleNamespace(src_uri=place(page))) for page in PAGES}
    pages = {
        name: hooks.on_page_markdown((DOCS / name).read_text(), page, config) for name, page in files.items()
    }
    assert "[Dockerfile](https://github.com/a/b/blob/main/Dockerfile)" in pages["how-to/operating.md"]
    assert "| `obs` | float32 | [M, n_agents, obs_size] |" in pages["concepts/batches.md"]
    assert "| `terrain_preset` |" in pages["reference/scenario-files.md"]
    assert "| `hp` | float64 | [n_units] |" in pages["reference/snapshots.md"]
    assert "Usage: smaclite-pool serve" in pages["reference/cli.md"]
    assert not any("<!-- insert" in text for text in pages.values())
    fields = [member for member in vars(sp.Batch).values() if re.match(r"\w+ \[M", member.__doc__ or "")]
    assert pages["concepts/batches.md"].count("| [M") == len(fields)


def test_tables_of_benchmarks_are_those_of_the_files() -> None:
    page, details = benchmarks.PAGE.read_text(), benchmarks.DETAILS.read_text()
    assert benchmarks.page(page) == page, "run `just generate`"
    assert benchmarks.whole_tables(details) == details, "run `just generate`"
