"""The kit of the tests of the scenario editor: its page, with the program and without."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from conftest import PROGRAM, REPOSITORY
from pages import WINDOW, AnyPage

PAGE = REPOSITORY / "target/playground/editor.html"


class EditorPage(AnyPage):
    """The page of an editor."""

    MAP = "#map"

    def __init__(self, browser: Any, url: str, state: str = "Valid", **options: Any) -> None:
        self.questions: list[str] = []
        self.agrees = True
        super().__init__(browser.new_page(**WINDOW | options), url, dialog=self.answer)
        self.wait_for_state(state)

    def answer(self, dialog: Any) -> None:
        self.questions.append(dialog.message)
        dialog.accept() if self.agrees else dialog.dismiss()

    def rename(self, name: str) -> None:
        """Changes the name of the scenario."""
        self.tab("scenario")
        self.field("name").fill(name)
        self.settle()

    def wait_for_state(self, text: str) -> None:
        self.wait(lambda: str(self.page.inner_text("#state")) == text)

    def tab(self, name: str) -> None:
        self.page.click(f"[data-tab={name}]")

    def drag(self, start: tuple[float, float], end: tuple[float, float], **options: Any) -> None:
        self.page.mouse.move(*self.at(*start))
        self.page.mouse.down(**options)
        self.page.mouse.move(*self.at(*end), steps=6)
        self.page.mouse.up(**options)
        self.settle()

    def text(self) -> str:
        """The text of the scenario file, which its form shows; then the form that was shown before."""
        before = self.page.get_attribute("[data-tab][aria-selected=true]", "data-tab")
        focused = self.page.evaluate_handle("document.activeElement")
        # Without the mouse, which the map follows.
        show = "(name) => document.querySelector(`[data-tab=${name}]`).click()"
        self.page.evaluate(show, "json")
        text = str(self.page.input_value("#text"))
        self.page.evaluate(show, before)
        focused.evaluate("(element) => element.focus()")
        self.settle()
        return text

    def json(self) -> Any:
        return json.loads(self.text())

    def field(self, *path: str | int, unit: str | int = -1) -> Any:
        key = f"{unit}:{json.dumps(list(path), separators=(',', ':'))}"
        return self.page.locator(f"[data-key='{key}']")

    def problem_list(self) -> list[str]:
        return [str(text) for text in self.page.locator("#problems li").all_inner_texts()]


class Editor(EditorPage):
    """`smaclite-pool edit` and its page."""

    def __init__(self, browser: Any, *args: str, state: str = "Valid", **options: Any) -> None:
        command = [*PROGRAM, "edit", *args]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        super().__init__(browser, self.process.stdout.readline().strip(), state, **options)

    def __exit__(self, *_: object) -> None:
        self.page.close()
        self.process.terminate()
        try:
            self.process.wait(20)
        finally:
            self.process.kill()
        super().__exit__()


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A copy of 2s3z."""
    return Path(shutil.copy(REPOSITORY / "scenarios/data/2s3z.json", tmp_path / "mine.json"))
