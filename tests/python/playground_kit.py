"""The playground in a browser, as its tests use it."""

from __future__ import annotations

import base64
import json
import zlib
from typing import Any

import pytest

from conftest import REPOSITORY
from pages import TICKS_PER_STEP, WINDOW, BattlePage
from pages import pytestmark as marks_of_pages

PAGE = REPOSITORY / "target/playground/battle.html"

pytestmark = [*marks_of_pages, pytest.mark.skipif(not PAGE.exists(), reason="no page; see `just playground`")]


class Playground(BattlePage):
    """The page, with the whole map, which loads nothing else."""

    def __init__(self, browser: Any, link: str = "", **options: Any) -> None:
        self.context = browser.new_context(**WINDOW | options, offline=True, accept_downloads=True)
        super().__init__(self.context.new_page(), f"{PAGE.as_uri()}#{link}")
        self.wait(lambda: self.text("#name") != "")

    def __exit__(self, *_: object) -> None:
        super().__exit__()
        self.context.close()
        assert len([url for url in self.requests if not url.startswith(("data:", "blob:"))]) == 1

    @property
    def said(self) -> str:
        """The line above the map, while there is one."""
        return self.text("#note") if self.shown("#note") else ""

    @property
    def last(self) -> int:
        self.draw()
        return int(self.page.get_attribute("#scrub", "max")) // TICKS_PER_STEP

    def wait_for_text(self, selector: str, text: str) -> None:
        self.wait(lambda: self.text(selector) == text)

    def wait_for_value(self, selector: str, value: str) -> None:
        self.wait(lambda: self.page.input_value(selector) == value)

    def wait_for_step(self, step: int) -> None:
        """Until the battle has been played to this step, whichever is shown."""
        self.wait(lambda: self.last >= step)

    def wait_until_played(self) -> None:
        """Until the team has played the battle to its end."""

        def is_over() -> bool:
            self.press("End")
            return self.text("#result").split(",")[0] in {"Won", "Lost", "Time limit"}

        self.wait(is_over)

    def position_of(self, agent: int) -> tuple[float, float]:
        self.press("Escape")
        self.press(str(agent))
        self.wait(lambda: "Position" in self.text("#unit"))
        x, y = map(float, self.text("#unit").split("Position\n")[1].split("\n")[0].split(", "))
        return x, y

    def share(self) -> tuple[str, dict[str, Any]]:
        """The link to the battle, and the changed scenario that is in it."""
        self.page.evaluate("history.replaceState(null, '', '#')")
        self.page.click("#share")
        self.wait(lambda: "file=" in self.page.url)
        link = self.page.url.split("#")[1]
        packed = link.split("file=")[1].split("&")[0]
        text = zlib.decompress(base64.urlsafe_b64decode(packed + "=" * (-len(packed) % 4)), wbits=-15)
        return link, json.loads(text)

    def drag(self, *points: tuple[float, float]) -> None:
        """Drags the mouse from point to point of the map."""
        self.page.mouse.move(*self.at(*points[0]))
        self.page.mouse.down()
        for point in points[1:]:
            self.page.mouse.move(*self.at(*point))
        self.page.mouse.up()
