"""The files of the scenario editor, in a real browser: as text, opened, saved and downloaded."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from conftest import REPOSITORY, program
from editor_kit import PAGE, Editor, EditorPage, file
from pages import browser, pytestmark

__all__ = ["browser", "file", "pytestmark"]  # fixtures and marks that pytest finds here


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


def copy_of_a_type(editor: Editor) -> Any:
    """Copies the stalker, and returns the field with the name of the copy."""
    editor.tab("types")
    editor.page.click("#types button:text-is('Stalker')")
    editor.page.click("text=Copy as new")
    return editor.page.locator("#types section input >> nth=0")


def test_a_download_saves_nothing(browser: Any, file: Path) -> None:
    """It counted as saved, so the page was left without a question and the change was lost."""
    before = file.read_text()
    with Editor(browser, str(file)) as editor:
        name = copy_of_a_type(editor)
        name.fill("scout.json")
        name.press("Enter")
        assert "end with `.json`" in name.evaluate("input => input.validationMessage")
        name.fill("scout")
        name.press("Enter")
        is_unsaved = "document.querySelector('#save').classList.contains('unsaved')"
        editor.wait(lambda: bool(editor.page.evaluate(is_unsaved)))
        with editor.page.expect_download():
            editor.page.click("#download")
        assert editor.page.evaluate(is_unsaved)
    assert file.read_text() == before


def test_a_unit_type_of_the_scenarios_name_is_not_saved_over_it(browser: Any, file: Path) -> None:
    before = file.read_text()
    with Editor(browser, str(file)) as editor:
        name = copy_of_a_type(editor)
        name.fill("mine")
        name.press("Enter")
        editor.page.click("#save")
        editor.wait(lambda: "the unit type `mine` would be written to" in editor.page.inner_text("#message"))
        editor.page.click("#download")
        editor.wait(lambda: "two files would have the name mine.json" in editor.page.inner_text("#message"))
    assert file.read_text() == before


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
        # The walls of a map whose side was typed anew were those before an earlier change, or were gone.
        editor.tab("scenario")
        before = editor.json()["terrain"]
        walls = ["X" * 40, *before[1:]]
        editor.tab("json")
        editor.page.fill("#text", json.dumps(editor.json() | {"terrain": walls}))
        editor.tab("scenario")
        editor.field("width").click()
        editor.press("ControlOrMeta+a", "Backspace")
        editor.page.keyboard.type("50")
        assert [row[:40] for row in editor.json()["terrain"]] == walls


def test_a_generated_scenario_file_is_opened_as_a_scenario(browser: Any, tmp_path: Path) -> None:
    """It has teams instead of groups, and was taken for a unit type."""
    file = tmp_path / "mine.json"
    program("new", "scenario", file, "--generated", "--agents", "4xMARINE,1xMEDIVAC")
    with Editor(browser) as editor:
        editor.page.set_input_files("#files", file)
        editor.wait(lambda: str(editor.page.inner_text("h1")) == "mine")
        editor.wait_for_state("Valid")
        assert editor.page.is_visible("#draw")


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


def test_an_opened_unit_type_whose_name_cannot_be_saved_is_a_warning(browser: Any, file: Path) -> None:
    """It was called valid until the first save was refused."""
    unit = file.with_name("my unit.json")
    with Editor(browser, str(file)) as editor:
        unit.write_text((REPOSITORY / "units/data/MARINE.json").read_text())
        editor.page.set_input_files("#files", unit)
        editor.wait_for_state("1 warning")
        (warning,) = editor.problem_list()
        assert "my unit.json" in warning and "cannot be saved: use 1 to 100 letters" in warning
        editor.tab("types")
        name = editor.page.locator("#types [data-key=name]")
        name.fill("my_unit")
        name.press("Enter")
        editor.wait_for_state("Valid")


def test_problems_that_are_not_listed_are_counted(browser: Any, file: Path) -> None:
    """The page said 100, whatever there were."""
    with Editor(browser, str(file)) as editor:
        ghosts = {"x": 1, "y": 1, "faction": "ALLY", "units": {"GHOST": 1}}
        text = json.dumps(editor.json() | {"groups": [ghosts] * 150})
        editor.tab("json")
        editor.page.fill("#text", text)
        editor.wait(lambda: str(editor.page.inner_text("#problems h2")).startswith("15"))
        *listed, more = editor.problem_list()
        total = int(editor.page.inner_text("#problems h2").split()[0])
        assert len(listed) == 100 and more == f"and {total - 100} more"


@pytest.mark.skipif(not PAGE.exists(), reason="no page; see `just playground`")
@pytest.mark.parametrize("link", ["scenario=nope", "file=abc", "check=00&scenario=3m", "rules=x&scenario=3m"])
def test_an_editor_whose_link_is_bad_begins_with_a_new_scenario(browser: Any, link: str) -> None:
    """It never began, or opened what the checksum of a link denies."""
    with EditorPage(browser, f"{PAGE.as_uri()}#{link}") as editor:
        assert editor.page.inner_text("h1") == "new_scenario"
        assert editor.page.inner_text("#message").startswith("The scenario of this link cannot be opened: ")


@pytest.mark.skipif(not PAGE.exists(), reason="no page; see `just playground`")
def test_an_editor_shows_the_group_and_tab_of_its_link_and_names_what_there_is_not(browser: Any) -> None:
    """The group of a link with a scenario was forgotten, and one that there is not was ignored."""
    with EditorPage(browser, f"{PAGE.as_uri()}#scenario=3m&group=1") as editor:
        assert editor.page.get_attribute(".groups .group >> nth=1", "aria-expanded") == "true"
    with EditorPage(browser, f"{PAGE.as_uri()}#scenario=3m&group=2&tab=types") as editor:
        assert "`group` must be a whole number from 0 to 1, got `2`" in editor.page.inner_text("#message")
        assert editor.page.get_attribute('[data-tab="types"]', "aria-selected") == "true"


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
