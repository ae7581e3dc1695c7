"""Runs the notebook of the documentation from top to bottom, with less training."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from conftest import REPOSITORY

NOTEBOOK = REPOSITORY / "docs/tutorials/notebook.ipynb"


def code_cells(notebook: dict[str, Any]) -> list[dict[str, Any]]:
    return [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]


def printed(cell: dict[str, Any]) -> str:
    return "".join("".join(output["text"]) for output in cell["outputs"] if output["output_type"] == "stream")


def shown(cell: dict[str, Any]) -> set[str]:
    """What a cell shows besides text: pictures and pages."""
    kinds = [kind for output in cell["outputs"] for kind in output.get("data", {})]
    return {kind for kind in kinds if kind in ("image/png", "text/html")}


def check(notebook: dict[str, Any]) -> None:
    """Every cell ran once, in order, and what the text promises was shown."""
    cells = code_cells(notebook)
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
    text = "".join(map(printed, cells))
    for part in ["obs            float32  (16, 5, 80)", "valid scenario: 7 agents", "focus_fire", "complete",
                 "win rate", "episode 0: "]:  # fmt: skip
        assert part in text, text
    assert [shown(cell) for cell in cells if shown(cell)] == [{"image/png"}] * 3 + [{"text/html"}]
    page = "".join(cells[-1]["outputs"][-1]["data"]["text/html"])
    assert page.startswith("<div><iframe srcdoc=") and "&lt;canvas" in page


def test_the_stored_outputs_are_of_one_run() -> None:
    notebook = json.loads(NOTEBOOK.read_text())
    check(notebook)
    assert NOTEBOOK.stat().st_size < 300_000, "every run adds the outputs to the repository"


def test_the_notebook_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    nbclient = pytest.importorskip("nbclient", reason="`just test-notebook` installs it")
    nbformat = pytest.importorskip("nbformat")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    [steps] = [cell for cell in code_cells(notebook) if cell["source"].startswith("STEPS = ")]
    steps["source"] = "STEPS = 5_000"
    for cell in code_cells(notebook):
        cell.update(outputs=[], execution_count=None)
    nbclient.NotebookClient(notebook, timeout=100).execute()
    check(notebook)
