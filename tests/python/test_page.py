"""The page of a replay in a real browser: what it draws, and what clicks and keys do."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from conftest import program
from pages import TICKS_PER_STEP, WINDOW, BattlePage, browser, pytestmark

__all__ = ["browser", "pytestmark"]  # a fixture and marks that pytest finds here


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with 2s3z.html, of three episodes, and others."""
    folder = tmp_path_factory.mktemp("pages")
    for name, episodes in {"2s3z": 3, "27m_vs_30m": 1, "MMM": 1, "bane_vs_bane": 1, "2c_vs_64zg": 1}.items():
        replay = folder / f"{name}.smreplay"
        program("record", name, "--policy=nearest", "--episodes", episodes, "--seed=1", "--out", replay)
        program("replay", replay, "--to", folder / f"{name}.html")
    return folder


class Page(BattlePage):
    """A replay page, which asks for no other file."""

    def __init__(self, browser: Any, file: Path, state: str = "", **options: Any) -> None:
        super().__init__(browser.new_page(**WINDOW | options), f"{file.as_uri()}#{state}")
        self.settle()

    def __exit__(self, *_: object) -> None:
        super().__exit__()
        others = [url for url in self.requests if not url.startswith(("file:", "data:"))]
        assert len(self.requests) >= 1 and others == []


def check_step_on_phones(page: BattlePage, shown: str) -> None:
    """The last step of a battle once read "step 1" on a phone, because the rest of its text was cut off."""
    script = """() => {
        const time = document.getElementById("time"), range = document.createRange();
        range.selectNodeContents(time);
        const text = range.getBoundingClientRect();
        const others = [...document.querySelectorAll("footer > :not(#time)")];
        const covers = ({ left, right, top, bottom }) =>
            left < text.right && right > text.left && top < text.bottom - 1 && bottom > text.top + 1;
        return {
            isWhole: text.left >= 0 && text.right <= innerWidth && time.scrollWidth <= time.clientWidth,
            lines: Math.round(text.height / parseFloat(getComputedStyle(time).lineHeight)),
            covered: others.filter((other) => covers(other.getBoundingClientRect())).map((e) => e.className),
            outside: others.filter((other) => other.getBoundingClientRect().right > innerWidth).length,
            scrolls: document.documentElement.scrollWidth > innerWidth,
        };
    }"""
    for width in (320, 360, 390, 400, 412, 430, 600, 601, 820):
        page.page.set_viewport_size({"width": width, "height": 800})
        page.settle()
        assert page.text("#time").startswith(shown), width
        fits = {"isWhole": True, "lines": 1, "covered": [], "outside": 0, "scrolls": False}
        assert page.page.evaluate(script) == fits, width


def test_a_phone_shows_the_whole_step_of_a_replay(browser: Any, pages: Path) -> None:
    with Page(browser, pages / "27m_vs_30m.html") as page:
        page.press("End")
        steps = page.last // TICKS_PER_STEP
        check_step_on_phones(page, f"step {steps} / {steps} \u00b7 tick {page.last} \u00b7 ")


def test_the_skip_link_goes_to_the_controls_and_keeps_the_address(browser: Any, pages: Path) -> None:
    """It became `#play`, which says of a replay what the page cannot show."""
    with Page(browser, pages / "2s3z.html", "episode=1") as page:
        page.page.focus(".skip")
        page.press("Enter")
        assert page.page.evaluate("document.activeElement.id") == "play"
        assert page.page.url.endswith("#episode=1")


def test_another_address_is_followed_and_what_is_wrong_in_it_is_named(browser: Any, pages: Path) -> None:
    """Only the first address was read: another `#episode=` in the address bar changed nothing."""
    with Page(browser, pages / "2s3z.html", "unit=0&speed=2") as page:
        page.press("ArrowRight")
        page.page.evaluate("location.hash = 'episode=1&tick=20&fit=map'")
        page.page.wait_for_selector("#episodes li:nth-child(2) [aria-current=true]")
        page.wait(lambda: page.tick == 20)
        assert page.text("#speed").startswith("2") and page.text("#unit .who") == "agent 0", "they stay"
        assert page.page.get_attribute("#fit", "aria-pressed") == "true"
        page.page.evaluate("location.hash = 'episode='")
        page.wait(lambda: page.shown("#message"))
        assert page.text("#message").endswith("`episode` must be a whole number from 0 to 2, got ``.")
        assert page.tick == 0
        for theme in ("light", "dark"):
            page.page.evaluate(f"location.hash = 'theme={theme}'")
            page.page.wait_for_selector(f"html[data-theme={theme}]")
        assert not page.shown("#message"), "this address can be followed"
        # The first one waited for its episode, and then showed its tick in place of the second one's.
        first, second = "episode=2&tick=30", "episode=2&tick=12&speed=1.0"
        page.page.evaluate(f"location.hash = '{first}'; location.hash = '{second}'")
        page.wait(lambda: page.tick == 12 and page.text("#speed").startswith("1\u00d7"))


def test_an_address_can_let_a_battle_play_and_stop(browser: Any, pages: Path) -> None:
    with Page(browser, pages / "2s3z.html", "play=1&speed=0.50") as page:
        page.wait(lambda: page.tick > 1)
        page.page.evaluate("location.hash = 'play=0&tick=40'")
        page.wait(lambda: page.tick == 40 and page.shown("#start") is False)
        page.settle()
        assert page.tick == 40
        page.page.evaluate(f"location.hash = 'play=1&tick={page.last}'")
        page.wait(lambda: 0 < page.tick < 40)  # from the start again


def test_a_style_sheet_of_the_browser_leaves_the_colours(browser: Any, pages: Path) -> None:
    """The page read the colours of its first style sheet, which an extension may add; it stayed blank."""
    tab = browser.new_page(**WINDOW)
    tab.add_init_script("""new MutationObserver((_, observer) => {
        if (!document.head) return;
        observer.disconnect();
        document.head.prepend(document.createElement("style"));
        document.head.firstChild.textContent = "a { color: red }";
    }).observe(document, { childList: true, subtree: true })""")
    with BattlePage(tab, (pages / "2s3z.html").as_uri()) as page:
        assert page.page.evaluate("document.styleSheets.length") == 2
        page.settle()
        assert page.colours() > 50


def test_the_tick_of_an_address_counts_from_the_start_of_the_battle(
    browser: Any, pages: Path, tmp_path: Path
) -> None:
    """It counted from the start of the recording, and the page from that of the battle."""
    whole = (pages / "2s3z.html").read_text()
    midway = whole.replace('"first_step":0', '"first_step":10')
    assert midway != whole
    (tmp_path / "midway.html").write_text(midway)
    first = 10 * TICKS_PER_STEP
    with Page(browser, tmp_path / "midway.html", f"tick={first + 5}") as page:
        assert (page.step, page.tick) == (10, first + 5)
        page.page.evaluate(f"location.hash = 'tick={first - 1}'")
        page.wait(lambda: page.shown("#message"))
        wrong = f"`tick` must be a whole number from {first} to {first + page.last}, got `{first - 1}`."
        assert page.text("#message").endswith(wrong)


def test_a_window_that_was_low_shows_the_battle_again(browser: Any, pages: Path) -> None:
    """Every picture failed where the map has no room, and the page stood still until it was loaded again."""
    with Page(browser, pages / "2s3z.html", "unit=0") as page:
        for height in (200, 120, 100, 80, 40, 800):
            page.page.set_viewport_size({"width": 1280, "height": height})
            page.settle()
            page.press("ArrowRight")
        assert page.tick == 6 and page.colours() > 50


def test_every_episode_has_one_line(browser: Any, pages: Path) -> None:
    """A time limit took two lines, with half of the row empty."""
    with Page(browser, pages / "2s3z.html") as page:
        results = "#episodes .dot >> nth={}"
        one, two = (page.page.locator(results.format(i)) for i in (0, 1))
        one.evaluate("(cell) => (cell.textContent = 'Time limit')")
        two.evaluate("(cell) => (cell.textContent = 'Won')")
        assert one.bounding_box()["height"] == two.bounding_box()["height"]


@pytest.mark.parametrize("name", ["2s3z", "27m_vs_30m", "MMM", "bane_vs_bane", "2c_vs_64zg"])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_moment_is_drawn_without_an_error(browser: Any, pages: Path, name: str, scheme: str) -> None:
    with Page(browser, pages / f"{name}.html", "unit=0", color_scheme=scheme, device_scale_factor=2) as page:
        assert page.text("h1") == name
        assert page.page.get_attribute("html", "data-theme") == scheme
        # One unit is one element of the rosters.
        assert page.page.locator(".chip").count() == sum(
            int(page.text(f"#alive{faction}").split()[0]) for faction in (0, 1)
        )
        for tick in range(0, page.last, 11):
            page.scrub(tick)
        assert page.tick == tick
        assert page.colours() > 50
        width = page.page.evaluate("document.getElementById('battle').getBoundingClientRect().width")
        assert page.page.evaluate("document.getElementById('battle').width") == round(2 * width)


def test_keys_move_through_time(browser: Any, pages: Path) -> None:
    with Page(browser, pages / "2s3z.html") as page:
        assert (page.tick, page.shown("#start")) == (0, True)
        page.press("ArrowRight", "ArrowRight", "ArrowRight", "ArrowLeft")
        assert (page.tick, page.shown("#start")) == (2, False)
        page.press("Shift+ArrowRight")
        assert page.tick == TICKS_PER_STEP
        page.press("Shift+ArrowRight", "Shift+ArrowLeft", "Shift+ArrowLeft")
        assert page.tick == 0
        page.press("End")
        assert page.tick == page.last and page.last % TICKS_PER_STEP == 0
        assert page.text("#alive1").startswith("0 of 5"), "the battle is won"
        page.press("ArrowRight")
        assert page.tick == page.last
        page.press("Home")
        assert page.tick == 0


def test_playing_pausing_and_speed(browser: Any, pages: Path) -> None:
    with Page(browser, pages / "2s3z.html") as page:
        page.press("Space")
        assert page.page.get_attribute("#play", "aria-label") == "Pause"
        page.wait(lambda: page.tick > TICKS_PER_STEP)
        page.press("Space")
        paused = page.tick
        page.page.wait_for_timeout(200)
        assert page.tick == paused and page.page.get_attribute("#play", "aria-label") == "Play"
        page.press("-")
        assert page.text("#speed") == "0.5\u00d7"
        page.press(*"-" * 5)
        assert page.text("#speed") == "0.25\u00d7"
        page.press(*"+" * 9)
        assert page.text("#speed") == "16\u00d7"
        page.page.click("#play")
        page.settle()
        page.wait(lambda: page.page.get_attribute("#play", "aria-label") == "Play")
        assert page.tick == page.last, "it stops at the end"
        page.press("Space")
        assert page.tick < page.last, "and starts again from there"
        page.press("Space")
        page.page.click(".chip >> nth=0")
        page.press("Space")
        assert page.page.get_attribute("#play", "aria-label") == "Pause", "a click leaves the space bar free"


def test_a_click_selects_the_unit_under_it(browser: Any, pages: Path) -> None:
    with Page(browser, pages / "2s3z.html", "fit=map") as page:
        page.page.click(".enemy .chip >> nth=3")
        page.settle()
        assert page.text("#unit h2") == "Zealot" and page.text("#unit .who") == "enemy 3"
        assert "Shield" in page.text("#unit") and page.page.locator("#unit .actions").count() == 0
        x, y = map(float, page.text("#unit .pairs dd >> nth=0").split(", "))
        page.press("Escape")
        assert "Click a unit" in page.text("#unit")

        # The map of 32 x 32 squares is in the middle of the canvas, with 8 pixels around it.
        box = page.page.locator("#battle").bounding_box()
        scale = (min(box["width"], box["height"]) - 16) / 32
        at = (box["width"] / 2 + (x - 16) * scale, box["height"] / 2 - (y - 16) * scale)
        page.page.click("#battle", position={"x": at[0], "y": at[1]})
        page.settle()
        assert page.text("#unit .who") == "enemy 3"
        page.page.click("#battle", position={"x": 20, "y": box["height"] - 80})
        page.settle()
        assert "Click a unit" in page.text("#unit")


def test_an_agent_shows_its_action_and_what_it_could_choose(browser: Any, pages: Path) -> None:
    with Page(browser, pages / "2s3z.html", "tick=60&unit=0") as page:
        assert page.text("#unit .who") == "agent 0"
        available = page.page.locator("#unit .actions span").all_inner_texts()
        chosen = page.page.locator("#unit .actions .chosen").all_inner_texts()
        assert len(chosen) == 1 and chosen[0] in available and "stop" in available
        assert page.text("#unit h3") == f"Action of step 7: {chosen[0]}"
        page.press("]")
        assert page.text("#unit .who") == "agent 1"
        page.press("[", "[")
        assert page.text("#unit .who") == "enemy 4", "from the first unit to the last"
        page.page.click("#unit .link")
        page.settle()
        assert page.text("#unit .who").startswith("agent"), "its target"


def test_episodes_theme_map_and_help(browser: Any, pages: Path) -> None:
    with Page(browser, pages / "2s3z.html") as page:
        first = page.text("#facts")
        page.press("ArrowRight", "2")
        page.page.wait_for_selector("#episodes li:nth-child(2) [aria-current=true]")
        page.settle()
        assert page.tick == 0 and page.text("#facts") != first
        page.press("9")
        assert page.page.get_attribute("#episodes li:nth-child(2) button", "aria-current") == "true"
        page.page.click("#episodes li:nth-child(1) button")
        page.settle()
        assert page.text("#facts") == first

        page.press("t")
        assert page.page.get_attribute("html", "data-theme") == "light"
        page.press("m")
        assert page.page.get_attribute("#fit", "aria-pressed") == "true"
        page.press("?")
        assert page.shown("#keys") and "one step" in page.text("#keys")
        page.press("Escape")
        assert not page.shown("#keys")


def test_zoom_and_drag(browser: Any, pages: Path) -> None:
    with Page(browser, pages / "2s3z.html") as page:
        box = page.page.locator("#battle").bounding_box()
        middle = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 3)  # beside the large button
        pictures = [page.page.locator("#battle").screenshot()]
        page.page.mouse.move(*middle)
        page.page.mouse.wheel(0, -400)
        page.settle()
        pictures.append(page.page.locator("#battle").screenshot())
        page.page.mouse.down()
        page.page.mouse.move(middle[0] + 120, middle[1] + 40, steps=4)
        page.page.mouse.up()
        page.settle()
        pictures.append(page.page.locator("#battle").screenshot())
        assert len(set(pictures)) == 3
        assert "Click a unit" in page.text("#unit"), "a drag selects nothing"


def test_every_control_has_a_name(browser: Any, pages: Path) -> None:
    with Page(browser, pages / "MMM.html", "unit=0&tick=30") as page:
        nameless = """() => [...document.querySelectorAll("button, input, canvas:not([aria-hidden]), dialog")]
            .filter((e) => !e.getAttribute("aria-label") && !e.textContent.trim())
            .map((e) => e.outerHTML.slice(0, 80))"""
        assert page.page.evaluate(nameless) == []
        focused = set()
        for _ in range(40):
            page.page.keyboard.press("Tab")
            focused.add(page.page.evaluate("document.activeElement.id || document.activeElement.className"))
        assert {"play", "scrub", "fit", "theme", "battle", "chip"} <= focused


def test_reduced_motion_is_drawn(browser: Any, pages: Path) -> None:
    with Page(browser, pages / "bane_vs_bane.html", "tick=50", reduced_motion="reduce") as page:
        assert page.colours() > 50


def test_a_page_without_its_data_says_so(browser: Any, pages: Path, tmp_path: Path) -> None:
    text = (pages / "2s3z.html").read_text()
    start = text.index('"moments":"') + len('"moments":"')
    broken = tmp_path / "broken.html"
    broken.write_text(text[: start + 40] + "!!" + text[start + 42 :])
    page = browser.new_page()
    page.goto(broken.as_uri())
    page.wait_for_selector("#message:visible")
    assert "The replay cannot be shown" in page.inner_text("#message")
    page.close()
