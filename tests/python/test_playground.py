"""The playground in a real browser, from a folder and without a network: watched, played, shared, opened."""

from __future__ import annotations

import gzip
import json
import re
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from conftest import REPOSITORY, program
from pages import PHONE, browser
from playground_kit import Playground, pytestmark

__all__ = ["browser", "pytestmark"]  # a fixture and marks that pytest finds here


def test_a_battle_is_played_to_its_end_and_scrubbed(browser: Any) -> None:
    with Playground(browser) as page:
        page.wait_until_played()
        assert page.text("#name") == "2s3z"
        last = page.step
        assert last == page.last > 20
        page.press("Home")
        page.wait(lambda: page.step == 0)
        for speed in ("2×", "4×", "8×", "16×"):
            page.press("+")
            page.wait_for_text("#speed", speed)
        page.press(" ")
        page.wait(lambda: page.step == last)
        page.press("Home")
        page.wait(lambda: page.step == 0)
        page.press("]")
        page.wait(lambda: page.shown("#obs table >> nth=0"))
        assert "agent 0" in page.text("#unit")
        assert page.text("#obs").startswith("Observation before step 0")


def test_every_map_and_team_begins(browser: Any) -> None:
    with Playground(browser) as page:
        for choice in ("#scenario", "#team"):
            values = page.page.eval_on_selector_all(f"{choice} option", "all => all.map((one) => one.value)")
            assert len(values) >= 9
            for value in values:
                page.page.select_option(choice, value)
                assert page.page.input_value(choice) == value
                assert not page.shown("#message"), page.text("#message")
        assert page.page.input_value("#seed") == "1"
        page.press("n")
        page.wait(lambda: page.page.input_value("#seed") == "2")
        page.page.fill("#seed", "-3")
        page.page.press("#seed", "Tab")
        page.wait(lambda: page.shown("#message"))
        assert "seed must be a whole number" in page.text("#message")
        assert page.page.input_value("#seed") == "2"


def test_a_chosen_map_is_played_by_its_team_or_by_that_of_all_maps(browser: Any) -> None:
    zoo = REPOSITORY / "bindings/learn/zoo/3m"
    with Playground(browser) as page:
        assert page.page.input_value("#team") == "all-maps"
        page.page.set_input_files("#files", [zoo / "run.json", zoo / "best.safetensors"])
        page.wait(lambda: page.page.input_value("#team") == "3m, seed 1")
        page.press(" ")
        page.wait(lambda: page.step >= 2)
        page.page.select_option("#scenario", "25m")
        assert page.page.input_value("#team") == "all-maps"
        page.page.select_option("#scenario", "3m")
        assert page.page.input_value("#team") == "3m, seed 1"
        page.page.select_option("#team", "all-maps")
        assert page.text("#name") == "3m", "a team that plays every map stays there"
        page.page.select_option("#team", "kite")
        page.page.select_option("#scenario", "2s3z")
        assert page.page.input_value("#team") == "kite", "a chosen script stays"


def test_a_unit_is_taken_over_by_mouse_and_given_back(browser: Any, tmp_path: Path) -> None:
    with Playground(browser) as page:
        page.wait_until_played()
        page.press("Home")
        page.press("m")
        for _ in range(3):
            page.press("Shift+ArrowRight")
        page.wait(lambda: page.step == 3)
        page.press("0")
        page.page.mouse.click(*page.at(3, 28), button="right")
        page.wait(lambda: "you play 1 of 5" in page.text("#result"))
        assert page.last == 3, "what followed is another battle"
        page.press(" ")
        page.wait(lambda: page.step >= 6)
        page.press(" ")
        with page.page.expect_download() as download:
            page.page.click("#save")
        download.value.save_as(tmp_path / "battle.smreplay")
        replay = json.loads(gzip.decompress((tmp_path / "battle.smreplay").read_bytes()))
        assert set(replay["episodes"][0]["actions"][3 * 5 : 5 * 5 : 5]) <= {2, 5}, "north or west"
        page.press("Escape")
        page.page.click("#release")
        page.wait_until_played()
        assert "you play" not in page.text("#result")


def test_a_team_is_taken_over_by_touch_on_a_phone(browser: Any) -> None:
    with Playground(browser, color_scheme="light", **PHONE) as page:
        width = page.page.evaluate("document.documentElement.scrollWidth")
        assert width <= 390, "nothing is wider than the screen"
        page.page.tap("#fit")
        page.page.tap("#all")
        page.page.touchscreen.tap(*page.at(28, 3))
        page.wait(lambda: "you play 5 of 5" in page.text("#result"))
        page.page.tap("#play")
        page.wait(lambda: page.step >= 3)
        page.page.tap("#release")  # the selected ones: all
        page.wait(lambda: "you play" not in page.text("#result"))


def test_a_unit_is_dragged_elsewhere_at_the_start(browser: Any) -> None:
    with Playground(browser, "scenario=3m&seed=4") as page:
        page.wait_until_played()
        before = page.last
        page.press("Home")
        page.press("m")
        page.wait(lambda: page.step == 0)
        page.drag(page.position_of(0), (11, 17), (12, 18))
        page.press("0")
        page.wait(lambda: re.search(r"Position\n1[12]\.[019]\d, 1[78]\.[019]", page.text("#unit")))
        page.wait_until_played()
        assert page.last != before
        assert page.page.input_value("#team") == "all-maps", "the team plays on"
        page.page.click("#share")
        page.wait(lambda: "file=" in page.page.url)
        link = page.page.url.split("#")[1]
        last = page.last
    with Playground(browser, link) as page:
        assert page.last == last


def test_a_battle_that_never_ends_is_played_a_bounded_time_ahead(browser: Any, tmp_path: Path) -> None:
    """It was played on and on, also while it was paused, until the memory of the tab was full."""
    scenario = json.loads((REPOSITORY / "scenarios/data/3m.json").read_text())
    del scenario["episode_limit"]
    scenario["num_allied_units"] = scenario["num_enemy_units"] = 1
    scenario["groups"] = [
        {"x": 9, "y": 16, "faction": "ALLY", "units": {"MEDIVAC": 1}},
        {"x": 23, "y": 16, "faction": "ENEMY", "units": {"ZEALOT": 1}},
    ]
    file = tmp_path / "endless.json"
    file.write_text(json.dumps(scenario))
    with Playground(browser) as page:
        page.page.set_input_files("#files", file)
        page.wait(lambda: page.page.input_value("#scenario").startswith("{"))
        page.press(" ")
        page.press("Home")
        page.wait_for_step(240)
        page.page.wait_for_timeout(500)
        first = page.last
        assert first <= 240 + 12, "it waits for whoever watches"
        page.press("End")
        page.wait_for_step(first + 240)
        assert page.text("#result") == "Running"


def test_a_link_has_the_battle_of_a_person(browser: Any) -> None:
    with Playground(browser, "scenario=3m&seed=4&team=hold") as page:
        page.press("0")
        page.press("ArrowUp")
        page.wait(lambda: "you play 1 of 3" in page.text("#result"))
        for step in range(1, 5):
            page.press(".")
            page.wait_for_step(step)
        page.page.click("#share")
        page.wait(lambda: "actions=" in page.page.url)
        link, last = page.page.url.split("#")[1], page.last
    with Playground(browser, link) as page:
        assert (page.text("#name"), page.page.input_value("#seed"), page.last) == ("3m", "4", last)
        assert "you play 1 of 3" in page.text("#result")
    with Playground(browser, "scenario=3n&seed=4") as page:
        assert "did you mean `3m`?" in page.text("#message")
        assert page.text("#name") == "2s3z"


def test_a_link_of_a_team_that_was_dropped_on_another_page_has_its_battle(browser: Any) -> None:
    """The engine refused the team, although the link has all actions."""
    zoo = REPOSITORY / "bindings/learn/zoo/3m"
    with Playground(browser, "scenario=3m&seed=4") as page:
        page.page.set_input_files("#files", [zoo / "run.json", zoo / "best.safetensors"])
        page.wait(lambda: "seed" in page.page.input_value("#team"))
        page.wait_until_played()
        page.page.click("#share")
        page.wait(lambda: "actions=" in page.page.url)
        link, last, result = page.page.url.split("#")[1], page.last, page.text("#result")
    with Playground(browser, link) as page:
        assert not page.shown("#message")
        assert 'no team "3m, seed' in page.text("#note") and "Nearest plays on" in page.text("#note")
        assert page.last == last
        page.press("End")
        page.wait_for_text("#result", result)
        page.page.evaluate("location.hash = 'scenario=8m&team=nobody'")
        page.wait_for_text("#name", "8m")
        assert 'no team "nobody"' in page.text("#note")
    with Playground(browser, "scenario=8m&team=nobody&play=1") as page:
        page.wait_for_step(1)
        assert 'no team "nobody"' in page.text("#note"), "also if it plays at once"


def test_a_new_battle_after_a_replay_is_one_of_its_scenario(browser: Any, tmp_path: Path) -> None:
    """It was one of the standard scenario of the same name, and the choice of the map was blank."""
    scenario = json.loads((REPOSITORY / "scenarios/data/3m.json").read_text())
    scenario["groups"][0]["y"] = 20
    file, saved = tmp_path / "changed.json", tmp_path / "changed.smreplay"
    file.write_text(json.dumps(scenario))
    with Playground(browser) as page:
        page.page.set_input_files("#files", file)
        page.wait(lambda: page.page.input_value("#scenario").startswith("{"))
        page.wait_until_played()
        with page.page.expect_download() as download:
            page.press("Control+s")
        download.value.save_as(saved)
    with Playground(browser) as page:
        page.page.set_input_files("#files", saved)
        page.wait(lambda: "verified" in page.text("#note"))
        assert json.loads(page.page.input_value("#scenario")) == scenario
        for seed in ("2", "3"):
            page.page.click("#again")
            page.wait_for_value("#seed", seed)
            assert json.loads(page.page.input_value("#scenario")) == scenario
        page.page.select_option("#opponent", "kite")
        assert not page.shown("#message")


def test_the_types_of_a_generated_battle_are_those_that_are_shown(browser: Any) -> None:
    """What was selected was counted by the sample of the scenario, in which all are marines."""
    with Playground(browser, "scenario=terran_5_vs_5&seed=3") as page:
        page.press("Control+a")
        chips = page.page.locator("#roster0 .chip").evaluate_all("all => all.map((chip) => chip.title)")
        counts = Counter(str(title).split(",")[0].lower() for title in chips)
        assert len(counts) > 1
        units = ", ".join(f"{count} {name}" for name, count in counts.items())
        page.wait(lambda: page.text("#unit") == f"5 units: {units}.")


def test_files_are_opened(browser: Any, tmp_path: Path) -> None:
    with Playground(browser, "scenario=3m&seed=4") as page:
        page.wait_until_played()
        with page.page.expect_download() as download:
            page.press("Control+s")
        file = tmp_path / "3m.smreplay"
        download.value.save_as(file)
        steps = page.last
    replay = json.loads(gzip.decompress(file.read_bytes()))
    replay["episodes"][0]["checksum"] = "0" * 16
    (tmp_path / "other.smreplay").write_bytes(gzip.compress(json.dumps(replay).encode()))
    scenario = json.loads((REPOSITORY / "scenarios/data/2s3z.json").read_text())
    (tmp_path / "mine.json").write_text(json.dumps({**scenario, "name": "mine"}))
    with Playground(browser) as page:
        page.page.set_input_files("#files", file)
        page.wait(lambda: "verified" in page.text("#note"))
        assert (page.text("#name"), page.last) == ("3m", steps)
        page.page.set_input_files("#files", tmp_path / "other.smreplay")
        page.wait(lambda: page.shown("#message"))
        assert "otherwise" in page.text("#message") or "checksum" in page.text("#message")
        page.page.set_input_files("#files", tmp_path / "mine.json")
        page.wait(lambda: page.text("#name") == "mine")
        zoo = REPOSITORY / "bindings/learn/zoo/3m"
        page.page.set_input_files("#files", [zoo / "run.json", zoo / "best.safetensors"])
        page.wait(lambda: page.text("#name") == "3m" and not page.shown("#message"))
        page.wait_until_played()


def test_the_scenario_of_a_battle_is_edited(browser: Any) -> None:
    with Playground(browser, "scenario=MMM&rules=paper&seed=4") as page:
        with page.context.expect_page() as opened:
            page.page.click("#edit")
        editor = opened.value
        editor.wait_for_selector("#state:text-is('Valid')")
        assert (editor.input_value("#rules"), editor.input_value("#seed")) == ("paper", "4")
        assert editor.inner_text("h1") == "MMM" and "10 agents" in editor.inner_text("#summary")
        editor.close()
        page.requests = [url for url in page.requests if "editor.html" not in url]


def test_a_window_that_was_low_plays_on(browser: Any) -> None:
    """Every picture failed where the map has no room, and the page stood still until it was loaded again."""
    with Playground(browser, "scenario=3m&seed=4") as page:
        page.press("0")
        for height in (200, 150, 120, 100, 80, 40, 800):
            page.page.set_viewport_size({"width": 1280, "height": height})
            page.settle()
        page.press(" ")
        page.wait(lambda: page.step >= 2)


def test_the_skip_link_goes_to_the_controls_and_keeps_the_battle(browser: Any) -> None:
    """Its address, #play, was read as a link to a battle: the first one, from its start."""
    with Playground(browser, "scenario=3m&seed=7") as page:
        page.wait_for_step(3)
        page.scrub(16)
        page.page.focus(".skip")
        page.press("Enter")
        assert page.page.evaluate("document.activeElement.id") == "play"
        page.settle()
        assert (page.text("#name"), page.step) == ("3m", 2)
        assert page.page.url.endswith("#scenario=3m&seed=7")


def test_a_link_after_a_replay_leaves_no_list_of_its_episodes(browser: Any, tmp_path: Path) -> None:
    replay = tmp_path / "episodes.smreplay"
    program("record", "3m", "--policy", "nearest", "--episodes", "2", "--out", replay)
    with Playground(browser) as page:
        page.page.set_input_files("#files", replay)
        page.wait(lambda: page.page.locator("#episodes li").count() == 2)
        page.page.evaluate("location.hash = 'scenario=2s3z&seed=5'")
        page.wait_for_text("#name", "2s3z")
        page.wait(lambda: not page.shown("#episodes"))


def test_only_a_link_that_says_so_plays_at_once(browser: Any) -> None:
    """`play=0` did too."""
    for link, plays in {"play=0": False, "play=1": True}.items():
        with Playground(browser, f"scenario=3m&{link}") as page:
            page.wait_for_step(1)
            assert page.page.evaluate("document.body.classList.contains('playing')") == plays


@pytest.mark.parametrize("width", [390, 800])
def test_what_has_the_focus_is_not_behind_the_bar_at_the_bottom(browser: Any, width: int) -> None:
    """It was in narrow windows, where the bar stays while the page scrolls."""
    with Playground(browser, viewport={"width": width, "height": 600}) as page:
        page.wait_for_step(1)
        hidden = """() => {
            const at = document.activeElement, bar = document.querySelector("body > footer");
            if (at === document.body || bar.contains(at)) return null;
            const { top, bottom } = at.getBoundingClientRect();
            return bottom - top < 300 && bottom > bar.getBoundingClientRect().top + 1 ? at.outerHTML : null;
        }"""
        count = page.page.locator("button, input, select, canvas").count()
        for _ in range(count):
            page.press("Tab")
            assert page.page.evaluate(hidden) is None


def test_the_help_on_a_phone_begins_at_its_top(browser: Any) -> None:
    """The button that closes it, at its end, had the focus, so it was scrolled to its end."""
    with Playground(browser, viewport={"width": 390, "height": 600}) as page:
        page.page.click("#help")
        page.settle()
        height = "(keys) => [keys.scrollTop, keys.scrollHeight > keys.clientHeight]"
        assert page.page.eval_on_selector("#keys", height) == [0, True]


def test_rules_of_a_link_stay_by_the_name_that_the_choices_have(browser: Any) -> None:
    """The choice was blank, and with another seed the rules were those of the map."""
    with Playground(browser, "scenario=3m&rules=starcraft") as page:
        assert page.page.input_value("#rules") == "starcraft-1"
        page.page.fill("#seed", "2")
        page.page.press("#seed", "Tab")
        page.wait(lambda: "2" in page.text("#facts"))
        assert page.page.input_value("#rules") == "starcraft-1" and "starcraft-1" in page.text("#facts")


def test_another_team_and_other_rules_play(browser: Any) -> None:
    with Playground(browser, "scenario=3m") as page:
        page.page.select_option("#opponent", "all-maps")
        page.page.select_option("#team", "hold")
        page.page.select_option("#rules", "starcraft-1")
        page.wait_until_played()
        assert page.text("#result") == "Lost", "a trained team beats a script that does not fight together"
        assert "All-maps" in page.text("#facts") and "starcraft-1" in page.text("#facts")
        last = page.last
        page.page.click("#share")
        page.wait(lambda: "rules=starcraft-1" in page.page.url and "opponent=all-maps" in page.page.url)
        link = page.page.url.split("#")[1]
    with Playground(browser, link) as page:
        page.wait_for_step(last)
        assert page.last == last
