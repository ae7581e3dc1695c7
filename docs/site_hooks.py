"""What pages take from the installed package when the site is built, so that it is written once.

A line `<!-- insert: NAME -->` of a page is replaced. NAME is `batch-fields` for the table of the fields of a
batch, `snapshot-columns` for the columns of a snapshot, `dataset-arrays` for the arrays of a dataset,
`unit-keys` and `scenario-keys` for the keys of these files, `commands` for the help of every command,
`playground` and `editor` for the pages of `just playground`.
"""

from __future__ import annotations

import json
import os
import posixpath
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import smaclite_pool

PAGES = Path(__file__).resolve().parents[1] / "target/playground"
"""The pages of `just playground`, beside docs/playground.md on the site."""
PLAYGROUND, EDITOR = PAGES / "battle.html", PAGES / "editor.html"

COLUMNS = "90"
"""Characters per line of the help."""


def on_config(config: Any) -> Any:
    """Called by MkDocs first. Without mike, which sets this variable, there is no versions.json to load."""
    if "MIKE_DOCS_VERSION" not in os.environ:
        config.extra.pop("version", None)
    return config


def on_files(files: Any, config: Any) -> Any:
    """Called by MkDocs with all files of the site."""
    from mkdocs.structure.files import File  # the tests of this file do without MkDocs

    for page in (PLAYGROUND, EDITOR):
        if page.exists():
            files.append(File.generated(config, f"playground/{page.name}", abs_src_path=str(page)))
    return files


def on_post_page(output: str, **_: Any) -> str:
    """Called by MkDocs with every whole page. Pages load nothing of others, such as GitHub's stars."""
    return output.replace(' data-md-component="source"', "")


def on_page_markdown(markdown: str, page: Any, config: Any, **_: Any) -> str:
    """Called by MkDocs with the text of every page."""
    linked = with_addresses(markdown, posixpath.dirname(page.file.src_uri), config.repo_url)
    return re.sub(r"^<!-- insert: (\S+) -->$", lambda found: INSERTS[found[1]](), linked, flags=re.M)


def with_addresses(markdown: str, folder: str, repository: str) -> str:
    """The text of a page in a folder of docs. What it links to outside of docs, which is not part of the
    site, gets its address in the repository."""

    def link(found: re.Match[str]) -> str:
        path = posixpath.normpath(posixpath.join("docs", folder, found[1]))
        return found[0] if path.startswith("docs/") else f"]({repository}/blob/main/{path}{found[2] or ''})"

    return re.sub(r"\]\((\.\./[^)#\s]*)(#[^)]*)?\)", link, markdown)


def on_page_content(html: str, page: Any, files: Any, **_: Any) -> str:
    """Called by MkDocs with the HTML of every page. In a notebook, links still lead to Markdown files."""
    if not page.file.src_uri.endswith(".ipynb"):
        return html

    def link(found: re.Match[str]) -> str:
        path = posixpath.normpath(posixpath.join(posixpath.dirname(page.file.src_uri), found[1]))
        if (file := files.get_file_from_path(path)) is None:
            raise ValueError(f"{page.file.src_uri}: a link to {found[1]}, which is no page")
        return f'href="{file.url_relative_to(page.file)}{found[2] or ""}"'

    return re.sub(r'href="([^":#]+\.md)(#[^"]*)?"', link, html)


def batch_fields() -> str:
    """The table of fields, from the docstrings of the native module."""
    lines = ["| field | type | shape | meaning |", "| --- | --- | --- | --- |"]
    for name, member in vars(smaclite_pool.Batch).items():
        field = re.match(r"(\w+) (\[M[^]]*\]): (.*)\. Read-only, in place\.$", member.__doc__ or "")
        if field:
            dtype, shape, meaning = field.groups()
            lines.append(f"| `{name}` | {dtype} | {shape} | {meaning} |")
    if len(lines) < 4:
        raise ValueError("no fields found: the docstrings of smaclite_pool.Batch have another form")
    return "\n".join(lines)


def snapshot_columns() -> str:
    """The table of the columns of a snapshot, from the native module."""
    lines = ["| column | type | shape | meaning |", "| --- | --- | --- | --- |"]
    for name, dtype, shape, meaning in smaclite_pool._native.SNAPSHOT_COLUMNS:
        lines.append(f"| `{name}` | {dtype} | [{shape}] | {meaning} |")
    return "\n".join(lines)


def dataset_arrays() -> str:
    """The table of the arrays of a dataset, from the native module."""
    lines = ["| array | type | shape | meaning |", "| --- | --- | --- | --- |"]
    for name, dtype, shape, meaning in smaclite_pool.DATASET_ARRAYS:
        lines.append(f"| `{name}` | {dtype} | [{shape}] | {meaning} |")
    return "\n".join(lines)


def keys(kind: str) -> str:
    """The table of the keys of a kind of file, from its JSON Schema."""
    schema = json.loads(run("schema", kind))
    lines = ["| key | default | meaning |", "| --- | --- | --- |"]
    properties = schema["properties"].items()
    for name, key in sorted(properties, key=lambda item: item[0] not in schema["required"]):
        default = "required" if name in schema["required"] else key.get("default", "")
        values = f" One of `{'`, `'.join(key['enum'])}`." if "enum" in key else ""
        lines.append(f"| `{name}` | {default} | {key['description']}{values} |")
    return "\n".join(lines)


def commands() -> str:
    """What `--help` prints, for the program and for each of its commands."""
    overview = run("--help")
    listed = overview.split("Commands:")[1].split("Options:")[0]
    names = [name for name in re.findall(r"^  ([\w-]+)", listed, re.M) if name != "help"]
    parts = [f"```text\n{overview}```"]
    parts += [f"## {name}\n\n```text\n{run(name, '--help')}```" for name in names]
    return "\n\n".join(parts)


def playground() -> str:
    """The playground in a frame, or how to build it."""
    if not PLAYGROUND.exists():
        return (
            "!!! note\n    The playground is not part of this build of the site: `just playground` makes it."
        )
    return (
        '<iframe class="playground" src="battle.html" title="Playground" loading="lazy" '
        'allow="clipboard-write"></iframe>\n\n'
        '<a class="md-button" href="battle.html">Open it in a page of its own</a>'
    )


def editor() -> str:
    """Where the editor is on the site, if it is."""
    if not EDITOR.exists():
        return "The documentation site has it as a page of its own (`just playground` makes it)."
    page = "[a page of this site](playground/editor.html)"
    return f"Without an installation, it is {page}, which saves by download."


def run(*command: str) -> str:
    """What the program prints."""
    argv = [sys.executable, "-m", "smaclite_pool", *command]
    environment = {**os.environ, "COLUMNS": COLUMNS}
    return subprocess.run(argv, env=environment, capture_output=True, text=True, check=True).stdout


INSERTS = {
    "batch-fields": batch_fields,
    "snapshot-columns": snapshot_columns,
    "dataset-arrays": dataset_arrays,
    "unit-keys": lambda: keys("unit"),
    "scenario-keys": lambda: keys("scenario"),
    "commands": commands,
    "playground": playground,
    "editor": editor,
}
