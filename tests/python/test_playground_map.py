"""The map that visitors paint in the playground, in a real browser."""

from __future__ import annotations

from typing import Any

from pages import PHONE, browser
from playground_kit import Playground, pytestmark

__all__ = ["browser", "pytestmark"]  # a fixture and marks that pytest finds here


def blocked(scenario: dict[str, Any]) -> set[tuple[int, int]]:
    rows = enumerate(scenario["terrain"])
    return {(x, y) for y, row in rows for x, square in enumerate(row) if square == "X"}


def test_the_map_is_painted_by_mouse_and_shared(browser: Any) -> None:
    with Playground(browser, "scenario=3m&seed=4") as page:
        page.wait_until_played()
        before = page.last
        page.page.click("#paint")
        page.wait(lambda: page.step == 0)
        # From wall to wall, through squares that no event of the mouse names, and then a gap in the north.
        page.drag((14.5, 8.5), (16.5, 15.5), (14.5, 23.5))
        page.wait(lambda: "no path connects the agents with the enemies" in page.said)
        page.page.click("[data-tool=erase]")
        page.page.click("[data-size='1']")
        page.drag((15.5, 19.5), (15.5, 20.5))
        assert page.said == ""
        page.press("Escape")
        assert not page.shown("#brush")
        page.wait_until_played()
        assert page.last != before
        assert page.page.input_value("#team") == "all-maps", "the team plays on"
        link, scenario = page.share()
        last = page.last
    walls = blocked(scenario)
    assert "terrain_preset" not in scenario
    assert {(14, 8), (15, 12), (16, 15), (14, 23)} <= walls
    assert not {(15, 19), (15, 20), (15, 21), (16, 20), (9, 16), (23, 16)} & walls
    with Playground(browser, link) as page:
        page.wait_until_played()
        assert page.last == last
        assert blocked(page.share()[1]) == walls


def test_strokes_are_undone_and_what_cannot_be_played_is_refused(browser: Any) -> None:
    with Playground(browser, "scenario=3m&seed=4") as page:
        page.press("m")
        page.press("p")
        page.drag((3.5, 9.5), (3.5, 14.5))
        _, once = page.share()
        for _ in range(16):
            page.press("]")
        assert page.text("#size") == "15"
        page.drag((9.5, 12.5), (9.5, 20.5))
        page.wait(lambda: "on a blocked square that it may never leave" in page.said)
        page.press("Control+z")
        page.wait(lambda: page.share()[1] == once)
        page.press("p")
        page.drag(page.position_of(0), (-0.4, 16))
        page.wait(lambda: page.shown("#message"))
        assert page.share()[1] == once, "what is played stays"
        page.press("p")
        page.press("Control+z")
        page.wait(lambda: page.page.input_value("#scenario") == "3m")
        assert not page.shown("#message")
        assert page.page.is_disabled("#undo")


def test_the_map_is_painted_by_keys(browser: Any) -> None:
    with Playground(browser, "scenario=3m&seed=4") as page:
        page.page.focus("#paint")
        page.press("Enter")
        for key in ("Shift+ArrowUp", "Enter", "ArrowUp", "Enter", "ArrowRight", "Enter", "e", "Enter"):
            page.press(key)
        assert {(16, 21), (16, 22)} <= (walls := blocked(page.share()[1]))
        assert (17, 22) not in walls
        page.page.focus("#battle")
        page.press("Tab")
        assert page.page.evaluate("document.activeElement.dataset.tool") == "brush"
        page.press(" ")
        assert page.page.get_attribute("[data-tool=brush]", "aria-pressed") == "true"
        page.page.focus("#battle")
        page.press(" ")
        page.wait(lambda: page.step >= 1)
        assert not page.shown("#brush"), "who plays paints no more"


def test_the_map_is_painted_by_touch_on_a_phone(browser: Any) -> None:
    with Playground(browser, "scenario=3m&seed=4", color_scheme="light", **PHONE) as page:
        page.page.tap("#paint")
        assert page.page.evaluate("document.documentElement.scrollWidth") <= 390
        touch = page.context.new_cdp_session(page.page)

        def send(kind: str, *points: tuple[float, float]) -> None:
            places = [dict(zip("xy", page.at(*point), strict=True)) for point in points]
            touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": places})

        page.page.touchscreen.tap(*page.at(4.5, 20.5))
        send("touchStart", (15.5, 10.5))
        send("touchMove", (15.5, 14.5))
        send("touchMove", (15.5, 18.5))
        send("touchEnd")
        walls = blocked(page.share()[1])
        assert {(4, 20), *((15, y) for y in range(10, 19))} <= walls
        # Two fingers move the map, and what one of them has begun to draw is forgotten.
        send("touchStart", (20.5, 10.5))
        send("touchMove", (20.5, 14.5))
        send("touchStart", (20.5, 14.5), (24.5, 14.5))
        send("touchEnd")
        assert blocked(page.share()[1]) == walls
