"""The scenario editor in a real browser: by mouse, by keyboard and by two fingers."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from conftest import program
from editor_kit import PAGE, Editor, EditorPage, file
from pages import PHONE, SIDE, browser, pytestmark

__all__ = ["browser", "file", "pytestmark"]  # fixtures and marks that pytest finds here


def test_a_scenario_is_edited_played_and_saved(browser: Any, file: Path) -> None:
    before = file.read_text()
    with Editor(browser, str(file)) as editor:
        # Terrain: a wall by brush, and a rectangle; the preset becomes a drawn map.
        editor.press("b")
        editor.drag((12.5, 12.5), (12.5, 18.5))
        # The status line said "walkable" until the mouse moved.
        assert editor.page.inner_text("#pointer") == "square 12, 18 · blocked"
        editor.press("Control+z")
        assert editor.page.inner_text("#pointer") == "square 12, 18 · walkable"
        editor.press("Control+y")
        assert editor.page.inner_text("#pointer") == "square 12, 18 · blocked"
        editor.press("r")
        editor.drag((18.5, 9.5), (20.5, 10.5))
        assert '"terrain_preset"' not in editor.text()
        rows = editor.json()["terrain"]
        assert len(rows) == SIDE
        assert [y for y in range(SIDE) if rows[y][12] == "X" and rows[y][13] == "_"] == list(range(12, 19))
        assert rows[9][17:22] == rows[10][17:22] == "_XXX_"

        # A group, by mouse, on the grid of half squares.
        editor.press("v")
        editor.drag((23, 16.6), (24, 14.1))
        assert editor.json()["groups"][1] == {
            "x": 24,
            "y": 13.5,
            "faction": "ENEMY",
            "units": {"STALKER": 2, "ZEALOT": 3},
        }
        editor.wait_for_state("Valid")

        # A mistake, its message, and its repair.
        editor.field("groups", 1, "units", "ZEALOT").fill("0")
        editor.wait_for_state("1 problem")
        (problem,) = editor.problem_list()
        assert "`groups[1].units.ZEALOT` is 0, but must be a whole number from 1 to 1000" in problem
        assert editor.page.is_disabled("#play")
        editor.tab("scenario")
        editor.page.click("#problems li button")
        focused = editor.page.evaluate("document.activeElement.dataset.key")
        assert focused == '-1:["groups",1,"units","ZEALOT"]'
        editor.page.keyboard.press("ControlOrMeta+A")
        editor.page.keyboard.type("4")
        editor.wait_for_state("Valid")
        assert editor.json()["num_enemy_units"] == 6

        # The battle, to its end.
        editor.page.select_option("#rules", "starcraft-1")
        editor.page.fill("#seed", "3")
        editor.page.click("#play")
        battle = editor.page.frame_locator("#arena iframe")
        editor.wait(lambda: editor.page.locator("#arena iframe").count() == 1)
        battle.locator("html[data-ready]").wait_for(state="attached")
        assert battle.locator("h1").inner_text() == "2s3z"
        for _ in range(4):
            battle.locator("[data-speed='1']").click()
        ends = ("Won", "Lost", "Time limit")
        editor.wait(lambda: battle.locator("#result").inner_text() in ends)
        assert battle.locator("#seed").input_value() == "3"
        assert "starcraft" in battle.locator("#facts").inner_text()
        # The key that ends drawing in the battle does not leave it.
        battle.locator("#battle").press("p")
        battle.locator("body.painting").wait_for()
        editor.page.keyboard.press("Escape")
        battle.locator("body:not(.painting)").wait_for()
        assert editor.page.is_visible("#arena")
        editor.page.keyboard.press("Escape")
        editor.wait(lambda: not editor.page.is_visible("#arena"))

        # Undo to the beginning and back.
        edited = editor.text()
        for _ in range(20):
            editor.press("ControlOrMeta+z")
        assert editor.text() == before
        for _ in range(20):
            editor.press("ControlOrMeta+Shift+z")
        assert editor.text() == edited

        assert file.read_text() == before
        editor.press("ControlOrMeta+s")
        editor.wait(lambda: "Saved mine.json" in editor.page.inner_text("#message"))
    assert file.read_text() == edited
    assert "5 agents against 6 enemies" in program("check", file).stdout


def test_a_unit_type_is_made_and_used(browser: Any, file: Path) -> None:
    with Editor(browser, str(file)) as editor:
        editor.tab("types")
        editor.page.click("#types button:text-is('Stalker')")
        hp = editor.field("hp", unit="STALKER")
        assert hp.input_value() == "80" and not hp.is_editable()
        editor.page.click("text=Copy as new")
        unit = "my_stalker"
        editor.field("hp", unit=unit).fill("1e2")
        editor.field("attack_range", unit=unit).fill("many")
        editor.wait_for_state("1 problem")
        message = '`attack_range` is "many", but must be a number from 0 to 1000000 or "MELEE"'
        assert editor.problem_list()[0].startswith("my_stalker.json:") and message in editor.problem_list()[0]
        editor.field("attack_range", unit=unit).fill("7")
        editor.field("bonuses", unit=unit).locator("select").select_option("LIGHT")
        editor.field("bonuses", "LIGHT", unit=unit).fill("3")
        editor.field("attributes", "PSIONIC", unit=unit).check()
        editor.field("targeter", unit=unit).select_option("KAMIKAZE")
        editor.field("targeter_kwargs", "radius", unit=unit).fill("1.5")

        editor.tab("groups")
        editor.page.click(".groups .group >> nth=0")
        editor.field("groups", 0, "units", "STALKER", "type").select_option(unit)
        editor.wait_for_state("Valid")
        scenario = editor.json()
        assert scenario["groups"][0]["units"] == {unit: 2, "ZEALOT": 3}
        assert scenario["unit_type_ids"] == {"STALKER": 0, "ZEALOT": 1, unit: 2}
        assert scenario["num_unit_types"] == 3

        # A new name here is a new name everywhere.
        editor.tab("types")
        name = editor.page.locator("#types section input >> nth=0")
        name.fill("sniper")
        name.press("Enter")
        editor.wait_for_state("Valid")
        assert editor.json()["groups"][0]["units"] == {"sniper": 2, "ZEALOT": 3}
        editor.page.click("#save")
        editor.wait(lambda: "Saved sniper.json, mine.json" in editor.page.inner_text("#message"))
    saved = json.loads((file.parent / "sniper.json").read_text())
    assert (saved["hp"], saved["attack_range"], saved["bonuses"]["LIGHT"]) == (100, 7, 3)
    assert saved["targeter_kwargs"] == {"radius": 1.5} and "PSIONIC" in saved["attributes"]
    program("check", file, file.parent / "sniper.json")


def test_units_inside_walls_are_warnings_and_can_be_played(browser: Any, file: Path) -> None:
    file.write_text(file.read_text().replace('"y": 16', '"y": 28'))
    with Editor(browser, str(file), state="2 warnings") as editor:
        first, second = editor.problem_list()
        assert "mine.json:6:" in first and "`groups[0]` puts a STALKER at (" in first
        assert "on a blocked square that it may never leave, and 4 more" in second
        assert not editor.page.is_disabled("#play")


def test_a_group_is_taken_at_its_centre(browser: Any) -> None:
    """Only units were handles: at the centre of a group, where there is none, the view moved instead."""
    with Editor(browser) as editor:

        def places() -> list[tuple[float, float]]:
            return [(group["x"], group["y"]) for group in editor.json()["groups"]]

        def goal() -> list[float]:
            return list(editor.json()["attack_point"])

        assert (places(), goal()) == ([(9, 16), (23, 16)], [9, 16])
        editor.page.mouse.click(*editor.at(23, 16))
        editor.settle()
        assert editor.field("groups", 1, "x").input_value() == "23"
        editor.drag((23, 16), (25, 18))
        assert places() == [(9, 16), (25, 18)]
        # Between the units, in the box of the selected group.
        editor.drag((25.4, 18.4), (24.4, 16.4))
        assert places() == [(9, 16), (24, 17)] or places() == [(9, 16), (24, 16)]
        # The attack point is at the centre of the allies, under its flag.
        editor.drag((9, 16), (11, 12))
        assert (places()[0], goal()) == ((11, 12), [9, 16])
        x, y = editor.at(9, 16)
        editor.page.mouse.move(x + 6, y - 20)
        editor.page.mouse.down()
        editor.page.mouse.move(x + 60, y - 60, steps=6)
        editor.page.mouse.up()
        editor.settle()
        assert goal() != [9, 16] and places()[0] == (11, 12)

        # A new group, dragged where it was just placed.
        editor.press("h")
        editor.page.mouse.click(*editor.at(16, 24))
        editor.drag((16, 24), (18, 26))
        assert places()[2] == (18, 26)
        editor.press("ControlOrMeta+z")
        assert places()[2] == (16, 24)
        # An empty place still moves the view.
        editor.drag((28, 28), (29, 29))
        assert places()[2] == (16, 24)


@pytest.mark.parametrize("width", [820, 390])
def test_nothing_of_the_editor_is_cut_off_in_a_narrow_window(browser: Any, width: int) -> None:
    """The line below the map ended at "5 agents, 5 enemies, 1"; and beside the JSON there was no map."""
    with Editor(browser, "2s3z", viewport={"width": width, "height": 900}) as editor:
        outside = """() => [...document.querySelectorAll("header *, .status span")]
            .filter((e) => e.getClientRects().length)
            .filter((e) => e.getBoundingClientRect().right > innerWidth || e.getBoundingClientRect().left < 0)
            .map((e) => e.id || e.outerHTML.slice(0, 80))"""
        assert editor.page.evaluate(outside) == []
        for tab in ("groups", "scenario", "types", "json"):
            editor.tab(tab)
            assert editor.page.evaluate("document.documentElement.scrollWidth <= innerWidth"), tab
            assert editor.page.locator("#map").bounding_box()["width"] > 250, tab
        assert editor.page.evaluate("document.getElementById('summary').scrollWidth <= innerWidth")
        help_row = "(id) => document.getElementById(id).getBoundingClientRect().top"
        assert editor.page.evaluate(help_row, "help") == editor.page.evaluate(help_row, "theme")


def test_the_keyboard_alone(browser: Any, file: Path) -> None:
    with Editor(browser, str(file)) as editor:
        editor.page.focus("#map")
        editor.press("n", "n", "ArrowRight", "Shift+ArrowUp", "Alt+ArrowLeft")
        group = editor.json()["groups"][1]
        assert (group["x"], group["y"]) == (23.49, 21)
        editor.press("ControlOrMeta+d")
        assert len(editor.json()["groups"]) == 3
        editor.press("Delete")
        assert len(editor.json()["groups"]) == 2
        # From the middle of the map: a line of three squares, then a fill around it is undone.
        editor.page.focus("#map")
        editor.press("l", "ArrowRight", "Space", "ArrowUp", "ArrowUp", "Space")
        rows = editor.json()["terrain"]
        assert [y for y in range(8, 24) if "X" in rows[y][:32]] == [16, 17, 18]
        editor.press("f", "ArrowRight", "Space")
        assert all("_" not in row for row in editor.json()["terrain"])
        editor.press("ControlOrMeta+z")
        assert editor.json()["terrain"] == rows
        editor.press("x", "e", "ArrowLeft", "Space")
        assert "X" not in editor.json()["terrain"][18]
        editor.press("?")
        assert editor.page.is_visible("#keys")
        editor.press("Escape")


def test_a_window_that_was_low_shows_the_map_again(browser: Any, file: Path) -> None:
    """The picture failed where the map has no room, and no other one was drawn."""
    picture = "document.getElementById('map').toDataURL()"
    with Editor(browser, str(file)) as editor:
        first = editor.page.evaluate(picture)
        for height in (200, 120, 80, 40, 800):
            editor.page.set_viewport_size({"width": 1280, "height": height})
            editor.settle()
        editor.wait(lambda: editor.page.evaluate(picture) == first)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_form_has_names_in_both_themes(browser: Any, file: Path, scheme: str) -> None:
    with Editor(browser, str(file), color_scheme=scheme, device_scale_factor=2) as editor:
        assert editor.page.get_attribute("html", "data-theme") == scheme
        nameless = """() => [...document.querySelectorAll("button, input, select, textarea, canvas")]
            .filter((e) => !e.getAttribute("aria-label") && !e.textContent.trim() && !e.closest("label")
                && !e.hidden)
            .map((e) => e.outerHTML.slice(0, 80))"""
        for tab in ("groups", "scenario", "types", "json"):
            editor.tab(tab)
            assert editor.page.evaluate(nameless) == []
        # The map is drawn in the size of its place with the next picture.
        sizes = """() => [document.getElementById('map').getBoundingClientRect().width * 2,
            document.getElementById('map').width]"""
        editor.wait(lambda: len({round(size) for size in editor.page.evaluate(sizes)}) == 1)


@pytest.mark.parametrize("tool", ["brush", "ally", "select"])
def test_two_fingers_move_and_zoom_the_map_and_change_nothing(browser: Any, file: Path, tool: str) -> None:
    """They drew a wall from the one finger to the other, or began a group."""
    with Editor(browser, str(file), **PHONE) as editor:
        before = editor.text()
        touch = editor.page.context.new_cdp_session(editor.page)

        def send(kind: str, *points: tuple[float, float]) -> None:
            places = [{"x": x, "y": y, "id": i} for i, (x, y) in enumerate(points)]
            touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": places})

        editor.page.tap(f"[data-tool={tool}]")
        picture = editor.page.evaluate("document.getElementById('map').toDataURL()")
        one, other = editor.at(23, 16.6), editor.at(12, 20)
        send("touchStart", one)
        send("touchMove", (one[0], one[1] - 20))  # before the second finger is down
        send("touchStart", (one[0], one[1] - 20), other)
        for by in (10, 30, 50):
            send("touchMove", (one[0] + by, one[1] - 20), (other[0] - by, other[1]))
        send("touchEnd")
        editor.settle()
        assert editor.text() == before
        assert editor.page.get_attribute(f"[data-tool={tool}]", "aria-pressed") == "true"
        editor.wait(lambda: editor.page.evaluate("document.getElementById('map').toDataURL()") != picture)
        # One finger does again what it did.
        editor.page.tap("#fit")
        editor.page.tap("[data-tool=brush]")
        editor.page.touchscreen.tap(*editor.at(10.5, 10.5))
        editor.wait(lambda: editor.text() != before)


def test_a_text_that_is_no_seed_is_marked_and_not_played(browser: Any) -> None:
    """The playground refused it, and showed its first battle, which was another scenario's."""
    with Editor(browser, "terran_5_vs_5") as editor:
        page = editor.page
        expected = "The seed must be a whole number from 0 to 18446744073709551615."
        for seed in ("abc", "-5", "1.5", "18446744073709551616"):
            for command in ("#play", "#draw"):
                page.fill("#seed", seed)
                page.click(command)
                editor.wait(lambda: str(page.inner_text("#message")) == expected)
                assert page.get_attribute("#seed", "aria-invalid") == "true"
                assert page.input_value("#seed") == seed and not page.is_visible("#arena")
                page.fill("#seed", "7")
                page.click("#theme")
                editor.wait(lambda: page.get_attribute("#seed", "aria-invalid") == "false")
                page.evaluate("document.getElementById('message').textContent = ''")
        # Numbers of a double's precision gave the same seed again.
        page.fill("#seed", "9007199254740993")
        page.click("#draw")
        assert page.input_value("#seed") == "9007199254740994"
        page.fill("#seed", "18446744073709551615")
        page.click("#draw")
        assert page.input_value("#seed") == "0"
        page.fill("#seed", "")
        page.click("#draw")
        assert page.input_value("#seed") == "1"


def test_a_number_of_units_that_was_emptied_shows_what_the_file_has(browser: Any, file: Path) -> None:
    """It stayed empty, while the file kept the number."""
    with Editor(browser, str(file)) as editor:
        editor.page.click("#groups button.group >> nth=0")
        count = editor.field("groups", 0, "units", "STALKER")
        count.fill("")
        count.press("Tab")
        assert count.input_value() == "2"
        assert editor.json()["groups"][0]["units"]["STALKER"] == 2


@pytest.mark.skipif(not PAGE.exists(), reason="no page; see `just playground`")
def test_the_skip_link_of_the_editor_keeps_the_address_of_its_scenario(browser: Any) -> None:
    """A reload then opened a new scenario."""
    with EditorPage(browser, f"{PAGE.as_uri()}#scenario=3m") as editor:
        editor.page.focus(".skip")
        editor.press("Enter")
        assert editor.page.evaluate("document.activeElement.id") == "map"
        assert editor.page.url.endswith("#scenario=3m")


@pytest.mark.skipif(not PAGE.exists(), reason="no page; see `just playground`")
def test_what_no_battle_can_have_is_named_as_by_check(browser: Any, file: Path) -> None:
    """A number that is too large was infinite, and then nothing could be checked; typed, it became null.
    Bytes that are no UTF-8 text were replaced."""
    valid = file.read_text()
    large = valid.replace('"x": 9,', '"x": 1e999,', 1)
    file.write_text(large)
    with EditorPage(browser, PAGE.as_uri()) as editor:
        editor.page.set_input_files("#files", file)
        editor.wait_for_state("1 problem")
        assert "number out of range" in editor.problem_list()[0], editor.problem_list()
        editor.tab("json")
        editor.page.fill("#text", valid)
        editor.wait_for_state("Valid")
        editor.tab("scenario")
        editor.field("episode_limit").fill("1e999")
        editor.wait_for_state("1 problem")
        assert "number out of range" in editor.problem_list()[0], editor.problem_list()
        before = editor.text()
        assert before == valid.replace('"episode_limit": 120', '"episode_limit": 1e999')
        file.write_bytes(valid.replace('"2s3z"', '"Z\u00fcrich"').encode("latin-1"))
        editor.page.set_input_files("#files", file)
        expected = "mine.json: cannot be read: it is not UTF-8 text"
        editor.wait(lambda: editor.page.inner_text("#message") == expected)
        assert editor.text() == before
