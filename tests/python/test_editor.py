"""The scenario editor in a real browser: by mouse, by keyboard and by text, and the files that it saves."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from conftest import PROGRAM, REPOSITORY, program
from pages import PHONE, SIDE, WINDOW, AnyPage, browser, pytestmark

__all__ = ["browser", "pytestmark"]  # a fixture and marks that pytest finds here

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


def test_text_and_forms_show_the_same_file(browser: Any, file: Path) -> None:
    # What the editor does not know, and how the text is written, stays.
    odd = file.read_text().replace('"name": "2s3z",', '"name": "odd",   "a.b": [1.50, {"c": null}],')
    file.write_text(odd)
    with Editor(browser, str(file), state="1 problem") as editor:
        assert "unknown key `a.b`" in editor.problem_list()[0]
        editor.tab("scenario")
        editor.field("episode_limit").fill("7")
        editor.field("attack_point", 0).fill("")
        editor.field("attack_point", 0).fill("9.5")
        expected = odd.replace('"episode_limit": 120', '"episode_limit": 7')
        assert editor.text() == expected.replace("[9, 16],\n", "[9.5, 16],\n")
        editor.page.click("#problems li button")
        selected = "(e) => e.value.slice(e.selectionStart, e.selectionEnd)"
        assert editor.page.eval_on_selector("#text", selected).startswith('"a.b": [1.50')

        # Text that is no JSON keeps its place; then the forms follow the text.
        editor.page.fill("#text", '{ "name": ')
        editor.wait(lambda: "mine.json:1:" in editor.problem_list()[0])
        text = expected.replace('   "a.b": [1.50, {"c": null}],', "").replace('"x": 9,', '"x": 11,')
        editor.page.fill("#text", text)
        editor.wait_for_state("Valid")
        editor.page.click("#format")
        editor.tab("groups")
        assert editor.page.locator(".groups .group >> nth=0").inner_text().endswith("11, 16")


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


def test_text_that_is_no_json_keeps_the_last_map(browser: Any, file: Path) -> None:
    """The map was empty while the text had a mistake."""
    with Editor(browser, str(file)) as editor:
        editor.press("b")
        editor.drag((12.5, 12.5), (12.5, 18.5))
        editor.press("v")
        editor.tab("json")
        text = str(editor.page.input_value("#text"))
        canvas = "document.getElementById('map').toDataURL()"
        editor.page.mouse.move(5, 5)
        editor.settle()
        picture = editor.page.evaluate(canvas)
        editor.page.fill("#text", text.replace('"groups": [', '"groups": [,'))
        editor.wait_for_state("1 problem")
        editor.page.mouse.move(6, 6)
        editor.settle()
        assert editor.page.evaluate(canvas) == picture
        assert editor.page.inner_text("#stale") == "mine.json is no valid JSON: this is its last valid map."
        opacity = "getComputedStyle(document.getElementById('map')).opacity"
        assert float(editor.page.evaluate(opacity)) < 1
        editor.tab("groups")
        assert editor.page.locator(".groups .group").count() == 2
        assert editor.page.evaluate("document.getElementById('groups').inert")

        # What is shown cannot be edited, only undone.
        broken = editor.text()
        editor.drag((23, 16), (25, 18))
        editor.press("b")
        editor.drag((20.5, 12.5), (20.5, 18.5))
        editor.press("v", "n", "Delete", "ControlOrMeta+d")
        assert editor.text() == broken
        editor.press("ControlOrMeta+z")
        editor.wait_for_state("Valid")
        assert editor.text() == text and not editor.page.is_visible("#stale")
        editor.press("m")
        editor.drag((23, 16.6), (24, 14.1))
        assert editor.json()["groups"][1]["x"] == 24


def test_a_unit_type_of_the_scenarios_name_is_not_saved_over_it(browser: Any, file: Path) -> None:
    before = file.read_text()
    with Editor(browser, str(file)) as editor:
        editor.tab("types")
        editor.page.click("#types button:text-is('Stalker')")
        editor.page.click("text=Copy as new")
        name = editor.page.locator("#types section input >> nth=0")
        name.fill("mine")
        name.press("Enter")
        editor.page.click("#save")
        editor.wait(lambda: "the unit type `mine` would be written to" in editor.page.inner_text("#message"))
        editor.page.click("#download")
        editor.wait(lambda: "two files would have the name mine.json" in editor.page.inner_text("#message"))
    assert file.read_text() == before


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


def test_files_are_opened_and_downloaded(browser: Any, tmp_path: Path) -> None:
    scout = (REPOSITORY / "units/data/MARINE.json").read_text()
    files = {
        "duel.json": (REPOSITORY / "scenarios/data/3m.json").read_text().replace("MARINE", "units/scout"),
        "scout.json": scout,
    }
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    with Editor(browser) as editor:
        assert editor.page.inner_text("h1") == "new_scenario"
        editor.page.set_input_files("#files", [tmp_path / name for name in files])
        editor.wait(lambda: str(editor.page.inner_text("h1")) == "3m")
        editor.wait_for_state("Valid")
        downloads: list[Any] = []
        editor.page.on("download", lambda download: downloads.append(download))
        editor.page.click("#save")
        editor.wait(lambda: len(downloads) == 2)
        for download in downloads:
            assert Path(download.path()).read_text() == files[download.suggested_filename]
        editor.page.click("#new")
        editor.page.click("#choices button:text-is('corridor')")
        editor.wait(lambda: str(editor.page.inner_text("h1")) == "corridor")
        editor.wait_for_state("Valid")
        editor.tab("scenario")
        assert editor.field("terrain_preset").input_value() == "CORRIDOR"
        editor.field("terrain_preset").select_option("NARROW")
        assert editor.json()["terrain_preset"] == "NARROW"
        editor.field("terrain_preset").select_option("")
        editor.field("width").fill("40")
        assert {len(row) for row in editor.json()["terrain"]} == {40} and editor.json()["width"] == 40


def test_a_generated_scenario_file_is_opened_as_a_scenario(browser: Any, tmp_path: Path) -> None:
    """It has teams instead of groups, and was taken for a unit type."""
    file = tmp_path / "mine.json"
    program("new", "scenario", file, "--generated", "--agents", "4xMARINE,1xMEDIVAC")
    with Editor(browser) as editor:
        editor.page.set_input_files("#files", file)
        editor.wait(lambda: str(editor.page.inner_text("h1")) == "mine")
        editor.wait_for_state("Valid")
        assert editor.page.is_visible("#draw")


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


def test_files_are_checked_up_to_the_size_that_they_may_have(browser: Any, file: Path) -> None:
    """Those of more than 4 MiB could be opened, and neither checked nor saved."""
    with Editor(browser, str(file)) as editor:
        editor.tab("json")
        text = str(editor.page.input_value("#text"))
        fill = "(area, text) => { area.value = text; area.dispatchEvent(new Event('input')); }"
        editor.page.eval_on_selector("#text", fill, text + " " * 9_000_000)
        editor.wait(lambda: "larger than 8192 KiB" in editor.page.inner_text("#problems"))
        editor.page.eval_on_selector("#text", fill, text + " " * 5_000_000)
        editor.wait_for_state("Valid")


def test_a_generated_scenario_shows_what_the_seed_draws(browser: Any) -> None:
    with Editor(browser, "terran_5_vs_5") as editor:
        picture = "document.getElementById('map').toDataURL()"
        assert editor.page.is_visible("#draw")
        editor.page.mouse.move(0, 0)  # the map shows what is under the pointer
        editor.settle()
        first = editor.page.evaluate(picture)
        editor.page.click("#draw")
        assert editor.page.input_value("#seed") == "1"
        editor.wait(lambda: editor.page.evaluate(picture) != first)
        editor.page.fill("#seed", "0")
        editor.page.press("#seed", "Tab")
        editor.wait(lambda: editor.page.evaluate(picture) == first)
    with Editor(browser, "2s3z") as editor:
        assert not editor.page.is_visible("#draw")


def test_what_was_saved_elsewhere_since_a_page_opened_it_is_not_replaced_unasked(
    browser: Any, file: Path
) -> None:
    """What one page saved was known to the program, and so not asked about in another page."""
    with Editor(browser, str(file)) as editor, EditorPage(browser, editor.page.url) as other:
        other.rename("other")
        other.press("ControlOrMeta+s")
        other.wait(lambda: "Saved mine.json" in other.page.inner_text("#message"))
        editor.rename("mine")
        editor.agrees = False
        editor.press("ControlOrMeta+s")
        editor.wait(lambda: len(editor.questions) == 1)
        assert editor.questions[0].startswith("Changed elsewhere") and "mine.json" in editor.questions[0]
        assert json.loads(file.read_text())["name"] == "other" and other.questions == []
        editor.agrees = True
        editor.press("ControlOrMeta+s")
        editor.wait(lambda: "Saved mine.json" in editor.page.inner_text("#message"))
        assert json.loads(file.read_text())["name"] == "mine" and len(editor.questions) == 2
        editor.rename("again")  # what a page has saved itself needs no question
        editor.press("ControlOrMeta+s")
        editor.wait(lambda: json.loads(file.read_text())["name"] == "again")
        assert len(editor.questions) == 2

        # Another program, after which a page is opened; it was then known to the program.
        file.write_text(file.read_text().replace('"again"', '"program"'))
        with EditorPage(browser, editor.page.url):
            editor.rename("last")
            editor.agrees = False
            editor.press("ControlOrMeta+s")
            editor.wait(lambda: len(editor.questions) == 3)
        assert json.loads(file.read_text())["name"] == "program"


def test_new_and_open_ask_before_they_lose_what_is_not_saved(browser: Any, file: Path) -> None:
    """They lost it without a question, and Undo did not bring it back."""
    with Editor(browser, str(file)) as editor:

        def begin_anew() -> None:
            editor.page.click("#new")
            editor.page.click("#choices button >> nth=0")
            editor.settle()

        begin_anew()  # nothing is lost
        assert editor.page.inner_text("h1") == "new_scenario" and editor.questions == []
        editor.rename("precious")
        editor.agrees = False
        begin_anew()
        editor.page.set_input_files("#files", file)
        editor.wait(lambda: len(editor.questions) == 2)
        assert editor.questions == ["Lose the changes that are not saved?"] * 2
        assert editor.json()["name"] == "precious"
        editor.agrees = True
        editor.page.set_input_files("#files", file)
        editor.wait(lambda: str(editor.page.inner_text("h1")) == "2s3z")


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


def test_names_of_unit_types_that_cannot_be_saved_are_refused_by_the_page(browser: Any, file: Path) -> None:
    """`..` and `.x` were accepted, and then not saved; and the focus was lost with the name."""
    with Editor(browser, str(file)) as editor:
        editor.tab("types")
        editor.page.click("text=Copy as new")
        name = editor.page.locator("#types [data-key=name]")
        before = name.input_value()
        for bad in ("..", ".x", "a b", "x" * 101, "STALKER"):
            name.fill(bad)
            name.press("Enter")
            assert "The name is part of a file" in name.evaluate("(input) => input.validationMessage")
            assert editor.page.inner_text("#types .title small") == f"{before}.json"
        longest = "x" * 100
        name.fill(longest)
        name.press("Enter")
        editor.wait(lambda: str(editor.page.inner_text("#types .title small")) == f"{longest}.json")
        assert editor.page.evaluate("document.activeElement.dataset.key") == "name"
        editor.press("ControlOrMeta+s")
        editor.wait(lambda: longest in editor.page.inner_text("#message"))
        assert file.with_name(f"{longest}.json").exists()


@pytest.mark.skipif(not PAGE.exists(), reason="no page; see `just playground`")
@pytest.mark.parametrize("link", ["scenario=nope", "file=abc", "check=00&scenario=3m", "rules=x&scenario=3m"])
def test_an_editor_whose_link_is_bad_begins_with_a_new_scenario(browser: Any, link: str) -> None:
    """It never began, or opened what the checksum of a link denies."""
    with EditorPage(browser, f"{PAGE.as_uri()}#{link}") as editor:
        assert editor.page.inner_text("h1") == "new_scenario"
        assert editor.page.inner_text("#message").startswith("The scenario of this link cannot be opened: ")


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


@pytest.mark.skipif(not PAGE.exists(), reason="no page; see `just playground`")
def test_the_editor_needs_no_program(browser: Any, tmp_path: Path) -> None:
    """A page of the documentation: it checks, places, plays and saves by itself, also from a folder."""
    with EditorPage(browser, f"{PAGE.as_uri()}#scenario=3m") as editor:
        assert editor.page.inner_text("h1") == "3m"
        assert "3 agents, 3 enemies" in editor.page.inner_text("#summary")
        field = editor.field("groups", 1, "units", "MARINE")
        editor.page.click(".groups .group >> nth=1")
        field.fill("0")
        editor.wait_for_state("2 problems")
        field.fill("2")
        editor.wait_for_state("Valid")
        editor.page.click("#play")
        battle = editor.page.frame_locator("#arena iframe")
        ends = ("Won", "Lost", "Time limit")
        for _ in range(4):
            battle.locator("[data-speed='1']").click()
        editor.wait(lambda: battle.locator("#result").inner_text() in ends)
        editor.page.click("#leave")
        with editor.page.expect_download() as download:
            editor.page.click("#save")
        download.value.save_as(tmp_path / "own.json")
    assert "3 agents against 2 enemies" in program("check", tmp_path / "own.json").stdout
