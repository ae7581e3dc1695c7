"""The page of a running pool when pools, programs and other pages come and go."""

from __future__ import annotations

import json
import signal
import sys
from pathlib import Path
from typing import Any

import pytest

from pages import browser, pytestmark
from watch_kit import Programs, WatchPage, programs_of_test

__all__ = ["browser", "programs_of_test", "pytestmark"]  # fixtures and marks that pytest finds here


def test_a_pool_that_ends_and_runs_again_is_shown_again(browser: Any, programs_of_test: Programs) -> None:
    pool = programs_of_test.serve("3m:3")
    learner = programs_of_test.learn("3m", 20)
    with WatchPage(browser, programs_of_test.watch()) as page:
        page.follow(1)
        assert programs_of_test.stop(pool) == 0
        programs_of_test.stop(learner)
        page.wait(lambda: "no pool named `train`" in page.text("#notice"))
        assert "This page goes on when the pool runs again." in page.text("#notice")
        programs_of_test.serve("3m:3")
        programs_of_test.learn("3m", 20)
        page.wait(lambda: not page.shown("#notice"))
        page.wait(lambda: page.text("h1") == "Battle 1" and page.last > 0)
        page.press("g")
        page.wait(lambda: "step" in page.text(".cell >> nth=2") and page.text("#state") == "Live")


PLAYER = """
import signal
import smaclite_pool as sp
from time import sleep

ended = []
signal.signal(signal.SIGUSR1, lambda *_: ended.append(None))
for number, rules in enumerate(["smaclite", "starcraft"]):
    with sp.make("3m", 2, name="train", rules=rules, threads=1) as envs:
        envs.reset(seed=1)
        print("playing", flush=True)
        while len(ended) <= number:
            envs.step(envs.sample_actions())
            sleep(0.05)
"""


def test_a_pool_that_the_same_process_makes_again_is_another_one(
    browser: Any, programs_of_test: Programs
) -> None:
    """As a notebook cell that is run twice does. A page that followed a battle went on with the rules of the
    first pool, and the curves mixed the counts of both."""
    player = programs_of_test.start(sys.executable, "-c", PLAYER)
    assert player.stdout is not None and player.stdout.readline() == "playing\n"
    with WatchPage(browser, programs_of_test.watch()) as page:
        page.follow(1)
        assert "smaclite rules" in page.text("#lane-facts")
        player.send_signal(signal.SIGUSR1)
        assert player.stdout.readline() == "playing\n"
        page.wait(lambda: "starcraft" in page.text("#lane-facts"))
        page.wait(lambda: page.text("h1") == "Battle 1" and page.last > 0)
        page.wait(lambda: not page.shown("#notice"))  # that no step was made yet


def test_a_pool_that_runs_again_with_other_lanes_is_shown(browser: Any, programs_of_test: Programs) -> None:
    """The page said that the pool was gone, had no list of lanes, and its address kept the old one."""
    pool = programs_of_test.serve("2s3z:4")
    with WatchPage(browser, programs_of_test.watch(), "env=1") as page:
        page.wait(lambda: page.text("h1") == "Battle 1")
        pool.kill()
        page.wait(lambda: page.text("#state") == "Pool gone")
        programs_of_test.stop(pool)
        other = programs_of_test.serve("terran_5_vs_5:2")
        page.wait(lambda: page.text("#lane-facts").startswith("2 battles of terran_5_vs_5"))
        page.wait(lambda: page.text("#state") == "No learner")
        assert page.text("h1") == "train" and page.page.url.endswith("#lane=terran_5_vs_5")

        programs_of_test.stop(other)
        programs_of_test.serve("3m:2", "8m:3")
        page.wait(lambda: page.text("#state") == "No lane")
        assert page.text("#notice") == "The pool has no lane `terran_5_vs_5`: choose one of `3m`, `8m`."
        assert page.text("#lane-status") == "" and page.text("#plot-steps b") == "–"
        page.page.select_option("#lane", "8m")
        page.wait(lambda: page.text("#lane-facts").startswith("3 battles of 8m"))


def test_a_lane_of_the_address_that_no_pool_has_is_no_lane(browser: Any, programs_of_test: Programs) -> None:
    """It said that the pool had no such lane any more, and was never ready."""
    programs_of_test.serve("3m:2", "8m:3")
    with WatchPage(browser, programs_of_test.watch(), "lane=nope&env=1") as page:
        assert page.text("#notice") == "The pool has no lane `nope`: choose one of `3m`, `8m`."
        page.page.select_option("#lane", "3m")
        page.wait(lambda: page.text("#lane-facts").startswith("2 battles of 3m"))
        assert page.text("h1") == "train", "the battle was one of no lane"


def test_a_page_too_many_says_so_until_another_is_closed(browser: Any, programs_of_test: Programs) -> None:
    """It only said that the connection is lost, and tried again without end."""
    programs_of_test.serve("3m:2")
    url = programs_of_test.watch()
    others = [browser.new_page() for _ in range(16)]
    for other in others:
        other.goto(url)
        other.wait_for_selector("html[data-ready]", state="attached")
    page = browser.new_page()
    page.goto(url)
    page.wait_for_selector("#notice:has-text('16 pages of this program are open')")
    page.wait_for_timeout(2500)
    assert page.inner_text("#state") == "Refused"
    assert page.is_visible("#notice") and "16 pages of this program are open" in page.inner_text("#notice")
    others.pop().close()
    page.wait_for_selector("html[data-ready]", state="attached")
    page.wait_for_selector("#state:has-text('No learner')")
    for other in (*others, page):
        other.close()


def endless_scenario(folder: Path) -> Path:
    """A scenario whose battles never end: both sides fly, and cannot attack each other."""
    group = {"y": 16, "units": {"MEDIVAC": 1}}
    scenario = {
        "name": "endless",
        "num_allied_units": 1,
        "num_enemy_units": 1,
        "groups": [{"x": 9, "faction": "ALLY", **group}, {"x": 23, "faction": "ENEMY", **group}],
        "attack_point": [9, 16],
        "terrain_preset": "SIMPLE",
        "num_unit_types": 0,
        "ally_has_shields": False,
        "enemy_has_shields": False,
    }
    path = folder / "endless.json"
    path.write_text(json.dumps(scenario))
    return path


def test_a_page_whose_program_ends_while_steps_are_missing_stays_alive_and_recovers(
    browser: Any, programs_of_test: Programs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The page once asked for the missing steps again at once, without end, and froze."""
    monkeypatch.setenv("SMACLITE_POOL_TOKEN", "0123456789abcdef" * 2)
    programs_of_test.serve(f"{endless_scenario(tmp_path)}:1")
    programs_of_test.learn("endless", 400)
    url = programs_of_test.watch()
    program = programs_of_test.running[-1]
    page = WatchPage(browser, url)
    page.follow(0)
    # The page has up to 128 steps more than the clock needs; there must be others.
    page.wait(lambda: page.number("#episode-list span >> nth=2") > page.last / 8 + 200)
    assert programs_of_test.stop(program) == 0
    page.wait(lambda: page.text("#state") == "Disconnected")
    page.press("End")
    assert "Trying again" in page.text("#notice")
    end = page.last
    port = url.removeprefix("http://127.0.0.1:").split("/")[0]
    assert programs_of_test.watch("--port", port) == url
    page.wait(lambda: page.text("#state") == "Live" and not page.shown("#notice"))
    page.wait(lambda: page.text("h1") == "Battle 0" and page.last > 0)
    assert end > 0
    # A browser itself reports connections that fail.
    page.problems = [text for text in page.problems if "WebSocket connection to" not in text]
    page.__exit__()
