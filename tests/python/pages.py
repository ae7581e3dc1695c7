"""The kit of the tests of pages: a browser, and what every page must and can do in it."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from typing_extensions import Self

playwright = pytest.importorskip(
    "playwright.sync_api", reason="playwright is not installed; see `just test-page`"
)

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
BROWSER = next(filter(None, map(shutil.which, BROWSERS)), None)
TICKS_PER_STEP = 8
SIDE = 32  # of the maps of most scenarios

WINDOW: dict[str, Any] = {"viewport": {"width": 1280, "height": 800}, "color_scheme": "dark"}
PHONE: dict[str, Any] = {"viewport": {"width": 390, "height": 844}, "has_touch": True, "is_mobile": True}

pytestmark = [
    pytest.mark.skipif(BROWSER is None, reason=f"no browser: none of {', '.join(BROWSERS)} is in PATH"),
]


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with playwright.sync_playwright() as started:
        # The pages are our own, and a container's root has no other way to start it.
        browser = started.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"])
        yield browser
        browser.close()


class AnyPage:
    """A page of a new tab, which must report no error."""

    MAP = "#battle"

    def __init__(self, tab: Any, url: str, **events: Callable[[Any], object]) -> None:
        self.page = tab
        self.problems: list[str] = []
        self.requests: list[str] = []
        self.page.on("console", lambda message: self.problems.append(message.text))
        self.page.on("pageerror", lambda error: self.problems.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        for name, call in events.items():
            self.page.on(name, call)
        self.page.goto(url)
        self.page.wait_for_selector("html[data-ready]", state="attached", timeout=60_000)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.page.close()
        assert self.problems == []

    def settle(self) -> None:
        """Waits until two more pictures are drawn."""
        self.page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def wait(self, is_done: Callable[[], object]) -> None:
        """Waits for a condition; the browser's own way needs `eval`, which the page forbids."""
        end = time.monotonic() + 60
        while not is_done():
            assert time.monotonic() < end
            self.settle()

    def press(self, *keys: str) -> None:
        for key in keys:
            self.page.keyboard.press(key)
        self.settle()

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Where a point of a map of 32 x 32 squares is in the window, if all of it is shown: with 8 pixels
        around it."""
        box = self.page.locator(self.MAP).bounding_box()
        scale = (min(box["width"], box["height"]) - 16) / SIDE
        across, up = (x - SIDE / 2) * scale, (y - SIDE / 2) * scale
        return box["x"] + box["width"] / 2 + across, box["y"] + box["height"] / 2 - up


class BattlePage(AnyPage):
    """A page that shows a battle."""

    def scrub(self, tick: int) -> None:
        script = "(e, tick) => { e.value = tick; e.dispatchEvent(new Event('input')); }"
        self.page.eval_on_selector("#scrub", script, tick)
        self.settle()

    def draw(self) -> None:
        """Waits until the next picture is drawn: the pages write what they show in words with it."""
        self.page.evaluate("new Promise(requestAnimationFrame)")

    def text(self, selector: str) -> str:
        """What the page says when all that was done to it is drawn, which a busy computer does late."""
        self.draw()
        return str(self.page.inner_text(selector))

    def shown(self, selector: str) -> bool:
        self.draw()
        return bool(self.page.is_visible(selector))

    @property
    def step(self) -> int:
        return int(self.text("#time b >> nth=0"))

    @property
    def tick(self) -> int:
        return int(self.text("#time b >> nth=1"))

    @property
    def last(self) -> int:
        return int(self.page.get_attribute("#scrub", "max"))

    def colours(self) -> int:
        """Number of different colours on the canvas of the battle."""
        script = """() => {
            const canvas = document.getElementById("battle");
            const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
            return new Set(new Uint32Array(data.buffer)).size;
        }"""
        return int(self.page.evaluate(script))
