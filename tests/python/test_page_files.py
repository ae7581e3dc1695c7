"""Files and links between the playground, the program and the pages: what one writes, the others open, and
what cannot be opened says why."""

from __future__ import annotations

import gzip
import json
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from conftest import REPOSITORY, program
from pages import PHONE, browser
from playground_kit import Playground, pytestmark
from test_page import Page

__all__ = ["browser", "pytestmark"]

ZOO = REPOSITORY / "bindings/learn/zoo"


def contains(page: Playground, reason: str) -> bool:
    return reason in page.text("#message")


@pytest.fixture(scope="module")
def keep(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a map of its own, a unit of its own, and a team that was trained there."""
    folder = tmp_path_factory.mktemp("keep")
    program("new", "unit", folder / "guard.json", "--like", "STALKER")
    scenario = json.loads((REPOSITORY / "scenarios/data/3m.json").read_text())
    scenario["name"] = "keep"
    scenario["groups"][0]["units"] = {"guard": 3}
    (folder / "keep.json").write_text(json.dumps(scenario))
    program("train", folder / "keep.json", "--out", folder / "team", "--steps", 3000)
    return folder


def team_of(folder: Path) -> list[Path]:
    return [folder / "run.json", next(iter(folder.glob("*.safetensors")))]


def save(page: Playground, file: Path) -> Path:
    with page.page.expect_download() as download:
        page.press("Control+s")
    download.value.save_as(file)
    return file


def test_a_team_of_an_own_map_with_own_units_plays_there(browser: Any, keep: Path, tmp_path: Path) -> None:
    """It played on the map that was shown before, by a script, and nothing was said."""
    with Playground(browser) as page:
        page.page.set_input_files("#files", [keep / "team/run.json", keep / "team/weights.safetensors"])
        page.wait_for_text("#name", "keep")
        assert page.page.input_value("#team") == "keep, seed 0"
        assert not page.shown("#message")
        assert "Guard, agent 0" in str(page.page.get_attribute("#roster0 .chip >> nth=0", "title"))
        page.wait_until_played()
        last = page.last
        saved = save(page, tmp_path / "keep.smreplay")
        page.page.select_option("#scenario", "3m")
        assert page.page.input_value("#team") == "all-maps"
        page.page.select_option("#team", "keep, seed 0")
        assert page.text("#name") == "keep", "a team that is chosen brings its map"
        page.page.evaluate("history.replaceState(null, '', '#')")
        page.page.click("#share")
        page.wait(lambda: "file=" in page.page.url)
        link = page.page.url.split("#")[1]
        # After a replay of it, too.
        page.page.set_input_files("#files", saved)
        page.wait(lambda: "verified" in page.said)
        page.page.select_option("#team", "keep, seed 0")
        assert not page.shown("#message"), page.text("#message")
        assert page.text("#name") == "keep"
        page.wait_until_played()
        assert page.last == last
    with Playground(browser, link) as page:
        assert page.text("#name") == "keep" and not page.shown("#message")
    assert "keep" in program("replay", saved).stdout


def test_two_teams_of_one_map_and_seed_stay_apart(browser: Any, keep: Path, tmp_path: Path) -> None:
    """The second one replaced the first, because both have the same name."""
    other = tmp_path / "other"
    program("train", keep / "keep.json", "--out", other, "--steps", 6000)
    named = "all => all.map((one) => one.value).filter((name) => name.startsWith('keep'))"
    with Playground(browser) as page:
        for folder, name in ((keep / "team", ""), (other, " (2)"), (keep / "team", "")):
            page.page.set_input_files("#files", [folder / "run.json", folder / "weights.safetensors"])
            page.wait_for_value("#team", f"keep, seed 0{name}")
        names = page.page.eval_on_selector_all("#team option", named)
        assert sorted(names) == ["keep, seed 0", "keep, seed 0 (2)"]
        assert not page.shown("#message")


def test_a_replay_without_the_team_of_its_enemies_says_so(browser: Any, tmp_path: Path) -> None:
    """With another seed a script played the enemies, and `n` did nothing, both without a message."""
    with Playground(browser, "scenario=3m&seed=4&opponent=all-maps") as page:
        page.wait_until_played()
        saved = save(page, tmp_path / "3m.smreplay")
    with Playground(browser) as page:
        page.page.set_input_files("#files", saved)
        page.wait(lambda: "verified" in page.said)
        page.press("n")
        page.wait(lambda: "choose an opponent for a new battle" in page.said)
        page.page.fill("#seed", "5")
        page.page.press("#seed", "Tab")
        page.wait(lambda: "Attack move plays them here" in page.said)
        page.page.focus("#battle")
        page.press("n")
        page.wait_for_value("#seed", "6")
        assert page.said == ""


def test_a_scenario_is_opened_with_its_unit_files(browser: Any, keep: Path) -> None:
    with Playground(browser) as page:
        page.page.set_input_files("#files", [keep / "guard.json", keep / "keep.json"])
        page.wait_for_text("#name", "keep")
        page.press("m")
        page.drag(page.position_of(0), (11, 17), (12, 18))
        page.wait_until_played()
        assert not page.shown("#message")
        page.page.set_input_files("#files", keep / "keep.json")
        page.wait(lambda: page.shown("#message"))
        assert "open its unit files together with it" in page.text("#message")
        assert page.text("#name") == "keep", "what is shown stays"
        page.page.set_input_files("#files", keep / "team/run.json")
        page.wait(lambda: "together with it" in page.text("#message") and "run.json" in page.text("#message"))


def test_a_saved_battle_is_read_by_the_program(browser: Any, tmp_path: Path) -> None:
    """A battle of the playground as the program converts it, and as a branch of it comes back."""
    with Playground(browser, "scenario=3m&seed=4") as page:
        page.wait_until_played()
        saved = save(page, tmp_path / "3m.smreplay")
    assert "3m" in program("replay", saved).stdout
    for suffix in ("html", "gif", "snapshot"):
        program("replay", saved, "--to", tmp_path / f"3m.{suffix}")
    with Page(browser, tmp_path / "3m.html", "tick=16&unit=1") as shown:
        assert shown.tick == 16 and not shown.shown("#message")
    assert "3m" in program("show", tmp_path / "3m.snapshot").stdout
    branch = tmp_path / "branch.smreplay"
    program("record", "--from", tmp_path / "3m.snapshot", "--policy", "kite", "--out", branch)
    with Playground(browser) as page:
        page.page.set_input_files("#files", branch)
        page.wait(lambda: "verified" in page.said)
        assert page.text("#name") == "3m"


@pytest.mark.parametrize(
    ("link", "reason"),
    [
        ("scenario=3m&actions=AAAA", "the link is incomplete or was changed; copy all of it"),
        ("check=00000000&scenario=3m", "the link is incomplete or was changed; copy all of it"),
        ("nonsense", "it has no `nonsense`"),
        ("scenario=3m&taken=x", "`taken` must be numbers of agents"),
    ],
)
def test_a_link_that_cannot_be_played_says_why(browser: Any, link: str, reason: str) -> None:
    """The page said "Failed to fetch" or "Failed to execute 'atob'", or nothing at all."""
    with Playground(browser, link) as page:
        assert reason in page.text("#message") and page.text("#name") == "2s3z"
        page.page.evaluate("location.hash = 'scenario=8m'")
        page.wait_for_text("#name", "8m")
        assert not page.shown("#message")
        page.page.evaluate(f"location.hash = {json.dumps(link)}")
        page.wait(lambda: page.shown("#message") and reason in page.text("#message"))


def test_a_damaged_file_is_named_with_what_is_wrong(browser: Any, tmp_path: Path) -> None:
    """The page said "Failed to fetch"."""
    with Playground(browser, "scenario=3m&seed=4") as page:
        page.wait_until_played()
        whole = save(page, tmp_path / "whole.smreplay").read_bytes()
        weights = bytearray((ZOO / "3m/best.safetensors").read_bytes())
        weights[-1] ^= 1
        damaged = [
            ("cut.smreplay", whole[:-20], "cut.smreplay is damaged or incomplete"),
            ("text.smreplay", b"{}", "text.smreplay is not a replay"),
            ("other.smreplay", gzip.compress(b"{}"), "other.smreplay: expected a replay"),
            ("best.safetensors", bytes(weights), "the checksum differs, so they are damaged"),
        ]
        for name, content, reason in damaged:
            (tmp_path / name).write_bytes(content)
            files = [tmp_path / name, *([ZOO / "3m/run.json"] if "safetensors" in name else [])]
            page.page.set_input_files("#files", files)
            page.wait(partial(contains, page, reason))


def test_an_address_of_a_replay_that_cannot_be_shown_says_why(browser: Any, tmp_path: Path) -> None:
    replay, page_file = tmp_path / "3m.smreplay", tmp_path / "3m.html"
    program("record", "3m", "--policy", "nearest", "--episodes", 2, "--out", replay)
    program("replay", replay, "--to", page_file)
    with Page(browser, page_file, "nonsense&episode=7&tick=8") as page:
        assert page.tick == 8, "the rest is shown"
        said = page.text("#message")
        assert (
            "it has no `nonsense`" in said and "`episode` must be a whole number from 0 to 1, got `7`" in said
        )
        page.press("ArrowRight")
        assert not page.shown("#message")
    with Page(browser, page_file, **PHONE) as page:
        assert page.text("#unit") == "Tap a unit to see its numbers."


def boxes(page: Playground) -> dict[str, dict[str, float]]:
    places = ("header", "#choices", "#battle", "#orders", "#release", "footer", "#scrub", "#play")
    return {place: page.page.locator(place).bounding_box() for place in places}


@pytest.mark.parametrize("width", [320, 360, 390, 412, 430])
def test_nothing_moves_on_a_phone_when_the_first_order_is_given(browser: Any, width: int) -> None:
    """Map and controls moved down by 38 pixels, because the state of the battle pushed buttons into a second
    row; and the help was hidden."""
    phone = {**PHONE, "viewport": {"width": width, "height": 844}}
    with Playground(browser, **phone) as page:
        before = boxes(page)
        page.page.tap("#fit")
        page.page.tap("#all")
        page.page.touchscreen.tap(*page.at(28, 16))
        page.wait(lambda: "you play 5 of 5" in page.text("#result"))
        assert boxes(page) == before
        page.page.tap("#play")
        page.wait(lambda: page.step >= 2)
        assert boxes(page) == before
        page.page.tap("#help")
        assert page.shown("#keys")


OUTSIDE = """() => [...document.querySelectorAll("header *, #choices *, footer *")]
    .filter((e) => e.getClientRects().length && getComputedStyle(e).visibility !== "hidden")
    .filter((e) => e.matches("button, select, input") && e.getBoundingClientRect().right > innerWidth)
    .map((e) => e.id || e.outerHTML.slice(0, 80))"""


@pytest.mark.parametrize("width", [1280, 1000, 820, 390])
def test_long_names_push_no_control_out_of_the_window(browser: Any, width: int) -> None:
    """On bane_vs_bane the help was outside of a window of 1000 pixels, and with a long name much more."""
    with Playground(browser, "scenario=bane_vs_bane", viewport={"width": width, "height": 800}) as page:
        assert page.page.evaluate(OUTSIDE) == []
        page.page.evaluate("document.querySelector('h1').textContent = 'name '.repeat(20)")
        assert page.page.evaluate(OUTSIDE) == []
        assert page.page.evaluate("document.documentElement.scrollWidth <= innerWidth")


COLOURED = """() => ["marks", "chart"].map((id) => {
    const canvas = document.getElementById(id);
    const context = new OffscreenCanvas(canvas.width, canvas.height).getContext("2d");
    context.drawImage(canvas, 0, 0);
    const { data } = context.getImageData(0, 0, canvas.width, canvas.height);
    let coloured = 0;
    for (let at = 0; at < data.length; at += 4) {
        const [r, g, b, a] = data.slice(at, at + 4);
        if (a > 100 && Math.max(r, g, b) - Math.min(r, g, b) > 90) coloured++;
    }
    return coloured;
})"""


def test_the_future_is_not_shown_before_it_is_seen(browser: Any) -> None:
    """The team plays ahead, and at step 0 the chart and the marks of deaths already told who would win."""
    with Playground(browser, "scenario=3m&seed=4") as page:
        page.wait_for_step(10)
        page.page.wait_for_timeout(300)
        marks, chart = page.page.evaluate(COLOURED)
        assert marks == 0
        page.wait_until_played()
        page.press("Home")
        page.wait(lambda: page.step == 0)
        seen_marks, seen_chart = page.page.evaluate(COLOURED)
        assert seen_marks > 0 and seen_chart > 2 * chart, "what was seen stays"
        page.press("n")
        page.wait_for_step(10)
        page.page.wait_for_timeout(300)
        assert page.page.evaluate(COLOURED)[0] == 0


def test_every_battle_waits_for_play(browser: Any, keep: Path) -> None:
    """A chosen map began at once, the first page and replays did not."""
    with Playground(browser) as page:
        for open_battle in (
            lambda: page.page.select_option("#scenario", "8m"),
            lambda: page.press("n"),
            lambda: page.page.set_input_files("#files", team_of(ZOO / "3m")),
        ):
            open_battle()
            page.page.wait_for_timeout(700)
            assert page.step == 0 and page.text("#result") == "Paused"
