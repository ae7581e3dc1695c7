"""The playground of `smaclite-pool play` in a browser: battles by mouse, keys and touch, their replays."""

from __future__ import annotations

import functools
import json
import re
import signal
import socket
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from conftest import PROGRAM, program
from pages import PHONE, WINDOW, BattlePage, browser, pytestmark
from play import duel
from test_page import Page

__all__ = ["browser", "pytestmark"]  # a fixture and marks that pytest finds here


class PlayPage(BattlePage):
    """`smaclite-pool play` and its page, with the whole map."""

    def __init__(self, browser: Any, *args: str, **options: Any) -> None:
        self.command = [*PROGRAM, "play", *args]
        self.start()
        super().__init__(browser.new_page(**WINDOW | options), self.url)
        self.press("m")

    def start(self) -> None:
        self.process = subprocess.Popen(self.command, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        self.url = self.process.stdout.readline().strip()

    def stop(self) -> None:
        self.process.send_signal(signal.SIGINT)
        assert self.process.wait(30) == 0
        assert self.process.stdout is not None
        self.process.stdout.close()

    def __exit__(self, *_: object) -> None:
        try:
            super().__exit__()
        finally:
            self.stop()

    def is_paused_after(self, step: int) -> bool:
        return self.step > step and self.result != "Running"

    @property
    def result(self) -> str:
        return self.text("#result").split(",")[0]

    @property
    def is_over(self) -> bool:
        return self.result in ("Won", "Lost", "Time limit")

    def one_step(self) -> None:
        """Plays a step, unless the battle is over."""
        before = self.step
        self.press(".")
        self.wait(lambda: self.step > before and self.result != "Running")

    def place(self, faction: int, unit: int) -> tuple[float, float]:
        """Where a unit is, in squares, by its card; an agent is selected by that, if it is not."""
        who = f"{'enemy' if faction else 'agent'} {unit}"
        if not self.has_card or self.text("#unit .who") != who:
            self.page.click(f"#roster{faction} .chip >> nth={unit}")
            self.settle()
        x, y = map(float, self.text("#unit .pairs dd >> nth=0").split(", "))
        return x, y

    @property
    def has_card(self) -> bool:
        return bool(self.page.locator("#unit .who").count())

    def box(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        self.page.mouse.move(*self.at(*start))
        self.page.mouse.down()
        self.page.mouse.move(*self.at(*end), steps=5)
        self.settle()
        self.page.mouse.up()
        self.settle()

    def command_to(self, x: float, y: float) -> None:
        self.page.mouse.click(*self.at(x, y), button="right")
        self.settle()

    @property
    def selected(self) -> list[int]:
        """The numbers of the selected agents."""
        chips = self.page.locator("#roster0 .chip")
        return [i for i in range(chips.count()) if chips.nth(i).get_attribute("aria-pressed") == "true"]

    def seen(self) -> list[int]:
        """The numbers of the living enemies that agents see."""
        names = [
            str(name)
            for name in self.page.locator("#roster1 .chip").evaluate_all(
                "(chips) => chips.map((chip) => chip.className)"
            )
        ]
        return [i for i, name in enumerate(names) if "unseen" not in name and "dead" not in name]

    def save(self, click: Callable[[], None], file: Path) -> None:
        with self.page.expect_download() as download:
            click()
        assert download.value.suggested_filename.endswith(".smreplay")
        download.value.save_as(file)


def replayed(file: Path, to: Path) -> str:
    """Verifies a replay and makes a page of it; what that prints."""
    text = program("replay", file).stdout
    program("replay", file, "--to", to)
    return text


def test_a_battle_by_mouse_from_the_first_command_to_its_replay(browser: Any, tmp_path: Path) -> None:
    with PlayPage(browser, "2s3z", "--against", "random", "--seed", "3") as page:
        assert (page.result, page.step, page.seen()) == ("Paused", 0, [])
        page.box((1, 9), (15, 23))
        assert page.selected == [0, 1, 2, 3, 4] and "2 stalker, 3 zealot" in page.text("#unit")
        page.command_to(20, 16)
        while not page.seen():
            page.one_step()
            assert page.step < 20, "they walk towards the enemies"
        while not page.is_over:
            page.press("Control+a")
            if page.seen():
                page.command_to(*page.place(1, page.seen()[0]))
            page.one_step()
        assert page.result == "Won", "a team that commands beats one that does not"
        steps = page.step
        file = tmp_path / "mine.smreplay"
        page.save(lambda: page.page.click("#save"), file)
        printed = replayed(file, tmp_path / "mine.html")
        assert f"{steps} steps" in printed and "won" in printed, printed

        # The page shows any tick of the battle; and then begins another one, with the next seed.
        page.press("Home")
        assert page.step == 0
        page.page.click("#again")
        page.wait(lambda: page.page.input_value("#seed") == "4")
        assert page.step == 0 and "you play 5 of 5" in page.text("#result"), "they stay the person's"
    with Page(browser, tmp_path / "mine.html") as replay:
        assert replay.text("#result") == "Won" and replay.last == steps * 8


def test_clicks_select_units(browser: Any) -> None:
    with PlayPage(browser, "2s3z") as page:
        zealot = page.at(*page.place(0, 3))
        stalker = page.at(*page.place(0, 0))
        page.press("Escape")
        assert page.selected == []
        page.page.mouse.click(*zealot)
        page.settle()
        assert page.selected == [3] and page.text("#unit .who") == "agent 3"
        page.page.wait_for_timeout(400)  # not a double click
        page.page.keyboard.down("Shift")
        page.page.mouse.click(*stalker)
        page.page.keyboard.up("Shift")
        page.settle()
        assert page.selected == [0, 3]
        page.page.wait_for_timeout(400)
        page.page.mouse.dblclick(*zealot)
        page.settle()
        assert page.selected == [2, 3, 4]
        page.page.mouse.click(*page.at(16, 25))
        page.settle()
        assert page.selected == []
        page.page.click("#roster0 .chip >> nth=1")
        page.settle()
        assert page.selected == [1]


def test_keys_select_and_command(browser: Any, tmp_path: Path) -> None:
    with PlayPage(browser, "3m", "--seed", "2") as page:
        page.press("1")
        assert page.selected == [1]
        page.press("Shift+2")
        assert page.selected == [1, 2]
        page.page.focus("#battle")
        page.press("Escape", "Tab", "Tab")
        assert page.selected == [1]
        page.press("Shift+Tab")
        assert page.selected == [0]
        page.press("Tab", "Tab", "Tab")
        assert page.page.evaluate("document.activeElement.id") != "battle", "Tab leaves the map"
        page.press("]", "]")
        x, y = page.place(0, 1)
        page.press("ArrowUp")
        page.one_step()
        page.one_step()
        moved = page.place(0, 1)
        assert moved[1] > y + 0.5 and abs(moved[0] - x) < 0.5

        # An arrow of the slider moves the slider: it was an order, and the steps after it were lost.
        steps = page.step
        page.page.focus("#scrub")
        page.press("Home", "ArrowRight")
        page.press("End")
        assert page.step == steps and page.selected
        page.page.focus("#battle")

        # Those without an order defend themselves; those that are stopped do not.
        page.press("Control+a", "s")
        while not page.seen():
            page.one_step()
        for _ in range(4):
            page.one_step()
        health = page.page.get_attribute("#bar1", "style")
        assert "scaleX(1)" in health
        page.press("a")
        for _ in range(4):
            page.one_step()
        assert "scaleX(1)" not in page.page.get_attribute("#bar1", "style")
        page.save(lambda: page.press("Control+s"), tmp_path / "part.smreplay")
        assert f"{page.step} steps" in replayed(tmp_path / "part.smreplay", tmp_path / "part.html")


def test_time_runs_and_stops(browser: Any) -> None:
    with PlayPage(browser, "3m") as page:
        page.press("Space")
        page.wait(lambda: page.step >= 3)
        assert page.result == "Running"
        page.press("Space")
        paused = page.tick
        page.page.wait_for_timeout(400)
        assert page.tick == paused and page.result == "Paused"
        page.press("Space", *"+" * 4)
        page.wait(lambda: page.is_over)


def test_what_no_unit_sees_is_hidden(browser: Any) -> None:
    with PlayPage(browser, "3m") as page:
        page.box((21, 12), (25, 20))
        assert page.seen() == []
        enemy = "#roster1 .chip >> nth=0"
        assert "out of sight" in page.page.get_attribute(enemy, "aria-label")
        page.page.click(enemy)
        page.settle()
        assert not page.has_card
        page.press("f")
        assert page.seen() == [0, 1, 2] and page.page.get_attribute("#reveal", "aria-pressed") == "true"
        page.page.click(enemy)
        page.settle()
        assert page.text("#unit .who") == "enemy 0"
        page.press("f")
        page.wait(lambda: not page.has_card)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_battle_by_touch(browser: Any, scheme: str) -> None:
    with PlayPage(browser, "3m", "--seed", "5", color_scheme=scheme, **PHONE) as page:
        page.page.click("#all")
        page.settle()
        assert page.selected == [0, 1, 2]
        x, y = page.place(0, 1)
        page.press("Escape")
        page.page.touchscreen.tap(*page.at(x, y))
        page.settle()
        assert page.selected == [1]
        page.page.touchscreen.tap(*page.at(x, y + 6))
        page.settle()
        before = page.step
        for step in range(1, 7):
            page.page.click("[data-go=forward]")
            page.wait(functools.partial(page.is_paused_after, before + step - 1))
        assert page.place(0, 1)[1] > y + 4 and page.selected == [1]
        fits = "document.documentElement.scrollWidth <= innerWidth"
        assert page.page.evaluate(fits)
        page.page.click("#all")
        for _ in range(4):
            page.page.click("[data-speed='1']")
        page.page.click("#play")
        page.wait(lambda: page.is_over)


def test_a_battle_goes_on_when_the_program_comes_back(
    browser: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    monkeypatch.setenv("SMACLITE_POOL_TOKEN", "a" * 32)
    with PlayPage(browser, "3m", "--seed", "7", "--port", str(port)) as page:
        page.press("Control+a", "ArrowRight")
        for _ in range(5):
            page.one_step()
        before = page.place(0, 0)
        page.stop()
        page.page.wait_for_selector("#message:visible")
        page.press("Space")  # which hides the message, and once ended the battle for good
        page.page.wait_for_selector("#message:visible")
        assert "connection to smaclite-pool is lost" in page.text("#message")
        page.start()
        page.page.wait_for_selector("#message", state="hidden")
        page.settle()
        assert (page.step, page.place(0, 0)) == (5, before)
        page.one_step()
        page.save(lambda: page.page.click("#save"), tmp_path / "on.smreplay")
        page.press("Space")
        page.wait(lambda: page.step > 6)
        # The browser says so when a connection is refused.
        refused = re.compile(r"WebSocket connection to .* failed|ERR_CONNECTION_REFUSED")
        page.problems = [text for text in page.problems if not refused.search(text)]
    assert "6 steps" in replayed(tmp_path / "on.smreplay", tmp_path / "on.html")


def test_a_trained_team_plays_the_enemies(browser: Any, tmp_path: Path) -> None:
    with PlayPage(browser, "3m", "--against", "zoo:3m", "--rules", "starcraft") as page:
        assert page.page.input_value("#opponent") == "zoo:3m" and "starcraft" in page.text("#facts")
        page.press("Control+a", "s", "f", "Space", *"+" * 4)
        page.wait(lambda: page.is_over)
        assert page.result == "Lost", "agents that only stand"
        page.save(lambda: page.page.click("#save"), tmp_path / "lost.smreplay")
        assert f"{page.step} steps" in replayed(tmp_path / "lost.smreplay", tmp_path / "lost.html")
        # Who gives all agents back watches two teams.
        page.page.click("#again")
        page.wait(lambda: page.page.input_value("#seed") == "1")
        page.page.click("#release")
        page.wait(lambda: "you play" not in page.text("#result"))
        page.press("Space")
        page.wait(lambda: page.is_over)


def test_orders_stay_when_another_agent_gets_one_at_an_earlier_step(browser: Any) -> None:
    """The battle is begun again there, and all orders were forgotten."""
    with PlayPage(browser, "3m") as page:
        page.press("0")
        page.command_to(2, 15.6)
        page.one_step()
        page.one_step()
        page.press("Escape", "Shift+ArrowLeft")
        assert page.step == 1
        page.press("1", "ArrowDown")
        x, y = page.place(0, 0)
        for _ in range(3):
            page.one_step()
        assert page.place(0, 0)[0] < x - 2 and abs(page.place(0, 0)[1] - y) < 1
        # Once more, to a step that was played before that.
        page.press("Escape", *["Shift+ArrowLeft"] * 3)
        assert page.step == 1
        page.press("1", "ArrowUp")
        x, y = page.place(0, 0)
        for _ in range(3):
            page.one_step()
        assert page.place(0, 0)[0] < x - 2


def test_a_scenario_that_no_trained_team_reads_is_played(browser: Any, tmp_path: Path) -> None:
    """The page did not start: the team that plays every map cannot tell types apart that have no numbers."""
    scenario = duel(allies=2)
    scenario["groups"][0]["units"] = {"ZEALOT": 1, "STALKER": 1}
    file = tmp_path / "duel.json"
    file.write_text(json.dumps(scenario))
    with PlayPage(browser, str(file)) as page:
        assert page.page.input_value("#team") == "nearest"
        page.press("Control+a", "a", "Space", *"+" * 4)
        page.wait(lambda: page.is_over)
