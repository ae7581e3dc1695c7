"""The page of a running pool in a real browser: pool, learner and page are separate processes."""

from __future__ import annotations

import re
import subprocess
import time
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
import smaclite_pool as sp

from conftest import PROGRAM
from pages import browser, pytestmark
from test_page import check_step_on_phones
from watch_kit import Programs, WatchPage, programs_of_test

__all__ = ["browser", "programs_of_test", "pytestmark"]  # fixtures and marks that pytest finds here

FIELDS = ["obs", "state", "avail_actions", "alive", "snapshot"]
NOT_FOLLOWED = "The address cannot be followed:"


def colours(page: WatchPage, canvas: str) -> int:
    """Number of different colours on a canvas."""
    script = """canvas => {
        const { width, height } = canvas;
        const copy = new OffscreenCanvas(width, height).getContext("2d", { willReadFrequently: true });
        copy.drawImage(canvas, 0, 0);
        return new Set(new Uint32Array(copy.getImageData(0, 0, width, height).data.buffer)).size;
    }"""
    return int(page.page.eval_on_selector(canvas, script))


def has_colours(page: WatchPage, canvas: str) -> bool:
    return colours(page, canvas) > 5


def test_the_grid_shows_every_battle_and_the_panel_what_the_lane_does(
    browser: Any, programs_of_test: Programs
) -> None:
    programs_of_test.serve("2s3z:70", "3m:2")
    learner = programs_of_test.learn("2s3z", 30)
    with WatchPage(browser, programs_of_test.watch()) as page:
        assert page.text("h1") == "train" and page.text("#lane-facts") == "70 battles of 2s3z, smaclite rules"
        assert page.page.locator(".cell").count() == 64
        page.wait(lambda: "step" in page.text(".cell >> nth=0"))
        page.wait(lambda: colours(page, ".cell canvas >> nth=0") > 20)
        # Cells move on: at least five of the next numbers differ.
        page.wait_for_texts(".cell >> nth=1", 6)
        page.wait(lambda: page.page.locator(".cell .dot.lost, .cell .dot.won").count() > 2)

        # All that is shown changes with every step, and a busy computer makes it late: so it is waited for.
        page.wait(lambda: page.text("#state") == "Live")
        page.wait(lambda: f"process {learner.pid}" in page.text("#lane-status"))
        ranges = {"steps": (1, 3000), "wins": (0, 100), "returns": (0, 20), "lengths": (5, 121)}
        for plot, (low, high) in ranges.items():
            newest, curve = f"#plot-{plot} b", f"#plot-{plot} canvas"
            page.wait(partial(page.has_number_within, newest, low, high))
            page.wait(partial(has_colours, page, curve))

        page.press("PageDown")
        assert page.text("#range") == "battles 64 to 69 of 70" and page.page.locator(".cell").count() == 6
        page.wait(lambda: "step" in page.text(".cell >> nth=5"))
        page.page.click("#previous")
        page.press("ArrowRight", "ArrowRight", "ArrowDown", "ArrowLeft", "Enter")
        page.wait(lambda: page.text("h1").startswith("Battle "))
        assert page.shown("#battle")
        page.press("Escape")
        assert page.text("h1") == "train" and not page.shown("#battle")

        page.page.select_option("#lane", "3m")
        page.wait(lambda: page.text("#lane-facts").startswith("2 battles of 3m"))
        page.wait(lambda: page.text("#state") == "No learner")
        assert "No learner is attached" in page.text("#notice")
        programs_of_test.stop(learner)


def test_a_grid_shows_the_outcome_of_the_last_episode_or_none(
    browser: Any, programs_of_test: Programs
) -> None:
    """A learner is faster than the page, which showed an older outcome where it missed an end."""
    generator, n_envs = np.random.default_rng(1), 12
    with sp.make("3m", n_envs, name="train", threads=1, seed=3) as envs:
        policies = [sp.ScriptedPolicy(name, envs) for name in ("focus_fire", "hold")]
        batch = envs.reset()
        with WatchPage(browser, programs_of_test.watch()) as page:
            page.wait(lambda: page.page.locator(".cell").count() == n_envs)
            outcomes, plays = ["none"] * n_envs, generator.integers(0, 2, n_envs)
            for _ in range(250):
                actions = np.stack([policy(batch) for policy in policies])
                batch = envs.step(actions[plays, np.arange(n_envs)])
                for env in np.flatnonzero(batch.terminated | batch.truncated).tolist():
                    lost = "lost" if batch.terminated[env] else "time limit"
                    outcomes[env] = "won" if batch.battle_won[env] else lost
                    plays[env] = generator.integers(0, 2)
                time.sleep(0.02)
            steps = batch.episode_length.tolist()
            del batch  # Playwright keeps the frames of its callers

            def label(env: int) -> str:
                return page.page.get_attribute(f".cell >> nth={env}", "aria-label") or ""

            page.wait(lambda: all(f", step {steps[env]}," in label(env) for env in range(n_envs)))
            shown = [re.search("last episode: (.*)", label(env)) for env in range(n_envs)]
            assert [it[1] if it else outcomes[env] for env, it in enumerate(shown)] == outcomes


def test_the_card_is_that_of_the_battle_that_is_followed(browser: Any, programs_of_test: Programs) -> None:
    """It stayed that of the battle before while the learner paused."""
    with sp.make("MMM", 4, name="train", threads=1, seed=1) as envs:
        policy = sp.ScriptedPolicy("nearest", envs)
        batch = envs.reset()
        for _ in range(25):
            batch = envs.step(policy(batch))
        info = sp.scenario(envs)
        allies = info["state_layout"][0]
        assert allies["features"][0] == "health"
        every = batch.state[:, allies["start"] :: len(allies["features"])][:, : len(info["allies"])]
        living = [agent for agent in range(len(info["allies"])) if every[:, agent].all()]
        agent = max(living, key=[len(np.unique(column)) for column in every.T].__getitem__)
        health = every[:, agent].copy()
        assert len({*health.tolist()}) > 2
        del batch, every  # Playwright keeps the frames of its callers
        with WatchPage(browser, programs_of_test.watch()) as page:
            for env in (3, 1, 2, 0):
                page.page.click(f".cell >> nth={env}")
                page.wait(partial(has_text, page, "h1", f"Battle {env}"))
                if env == 3:
                    page.wait(lambda: "Click a unit" in page.text("#unit"))
                    page.press("]")
                    while page.text("#unit .who") != f"agent {agent}":
                        page.press("]")
                expected = float(np.ceil(health[env] * info["allies"][agent]["hp"]))
                page.wait(partial(has_number, page, "#unit .meter >> nth=0", expected))
                page.press("g")


def has_text(page: WatchPage, selector: str, text: str) -> bool:
    return page.text(selector) == text


def has_number(page: WatchPage, selector: str, number: float) -> bool:
    return page.page.locator(selector).count() > 0 and page.number(selector) == number


def test_a_fast_learner_is_followed_episode_by_episode(browser: Any, programs_of_test: Programs) -> None:
    programs_of_test.serve("2s3z:4")
    programs_of_test.learn("2s3z", 60)
    with WatchPage(browser, programs_of_test.watch()) as page:
        page.follow(2)
        assert page.text("h1") == "Battle 2" and "env=2" in page.page.evaluate("location.hash")
        page.wait(lambda: "ago" in page.text("#age") and page.tick > 0)
        page.wait(lambda: page.text("#result") == "Lost" or page.text("#result") == "Won")
        assert page.colours() > 50 and page.text("#facts").startswith("episode")

        # Pause, ticks, steps, ends, scrubbing and speed are those of a replay.
        page.press(" ")
        paused = page.tick
        page.press("ArrowRight")
        assert page.tick == paused + 1
        page.press("Home")
        assert page.tick == 0
        page.press("Shift+ArrowRight")
        assert page.tick == 8
        page.scrub(33)
        assert page.tick == 33
        for _ in range(8):
            page.press("+")
        assert page.text("#speed") == "16×"
        for _ in range(8):
            page.press("-")
        assert page.text("#speed") == "0.25×"

        # How episodes ended that were never opened: the list once said "Over" for them.
        page.wait(lambda: page.page.locator("#episode-list li").count() > 8)
        results = "all => all.map((row) => row.querySelector('.dot').textContent)"
        rows = "#episode-list li:nth-child(n+3)"
        ends = {"Won", "Lost", "Time limit"}
        page.wait(lambda: ends >= set(page.page.eval_on_selector_all(rows, results)))

        # An earlier episode, and back to the newest.
        shown = page.text("#episode-list [aria-current=true] span >> nth=0")
        page.press("n")
        page.wait(lambda: page.text("#episode-list [aria-current=true] span >> nth=0") != shown)
        page.press("PageUp")
        page.wait(lambda: page.page.locator("#episode-list li").count() > 2)
        row = page.page.locator("#episode-list li >> nth=2")
        row.hover()
        chosen = row.inner_text().split()[0]
        row.locator("button").click()
        page.wait(lambda: page.text("#facts dd >> nth=0") == chosen)
        page.page.mouse.move(300, 300)
        for _ in range(8):
            page.press("+")
        # At the end of an episode the newest one begins.
        page.wait_for_texts("#facts dd >> nth=0", 3)
        page.press("g")
        assert not page.shown("#battle")


def test_a_slow_learner_is_followed_live(browser: Any, programs_of_test: Programs) -> None:
    programs_of_test.serve("3m:2")
    # A battle has 2 steps per second, so the page keeps up with this learner.
    learner = programs_of_test.learn("3m", 1.5)
    with WatchPage(browser, programs_of_test.watch(), "env=1") as page:
        page.wait(lambda: page.text("#age") == "live")
        page.wait(lambda: page.last > 24)
        programs_of_test.stop(learner)
        page.wait(lambda: page.text("#age").startswith("waiting for the learner"))


def test_an_agent_shows_its_numbers_and_its_observation_by_name(
    browser: Any, programs_of_test: Programs
) -> None:
    programs_of_test.serve("2s3z:4")
    programs_of_test.learn("2s3z", 60)
    with WatchPage(browser, programs_of_test.watch(), "env=0") as page:
        page.wait(lambda: page.last > 100)
        page.press(" ")
        page.scrub(40)
        page.press("]")
        assert page.text("#unit .who") == "agent 0" and "stop" in page.text("#unit .actions")
        page.wait(lambda: page.text("#obs h2") == "Observation before step 5")
        names = page.page.locator("#obs thead th").all_inner_texts()
        assert names[:5] == ["moves", "north", "south", "east", "west"]
        assert names[5:10] == ["enemies", "targetable", "distance", "dx", "dy"]
        assert page.page.locator("#obs td").count() == 80, "the size of the observation"
        # What the card says of the agent's health is what the observation says.
        health = page.text("#unit .meter >> nth=0").split()
        own = page.page.locator("#obs table >> nth=3").locator("td").all_inner_texts()
        assert abs(float(own[0]) - float(health[1]) / float(health[3])) < 0.02
        page.press("ArrowRight", "Shift+ArrowRight")
        page.wait(lambda: page.text("#obs h2") == "Observation before step 6")
        page.press("[")
        assert page.text("#unit .who") == "enemy 4" and not page.shown("#obs")
        page.press("Escape")
        assert "Click a unit" in page.text("#unit") and page.shown("#battle")


def test_a_phone_shows_the_whole_step(browser: Any, programs_of_test: Programs) -> None:
    programs_of_test.serve("2s3z:4")
    programs_of_test.learn("2s3z", 60)
    with WatchPage(browser, programs_of_test.watch(), "env=1") as page:
        page.wait(lambda: page.last > 100)
        page.press(" ")
        page.scrub(97)
        shown = page.text("#time").split(" / ")[0]  # of the battle, which may have begun before the page
        assert int(shown.removeprefix("step ")) >= 12
        check_step_on_phones(page, f"{shown} / ")


@pytest.mark.parametrize("sides", ["allies", "both"])
def test_a_shown_moment_is_saved_as_the_snapshot_that_the_pool_made(
    browser: Any, programs_of_test: Programs, tmp_path: Path, sides: Literal["allies", "both"]
) -> None:
    """Those of two-sided battles could not be read by other commands; `record --from` goes on from them."""
    fields = [*FIELDS, "enemy_avail_actions"] if sides == "both" else FIELDS
    with sp.make("2s3z", 2, name="train", fields=fields, sides=sides, obs_last_actions=2) as envs:
        envs.reset(seed=1)
        with WatchPage(browser, programs_of_test.watch(), "env=1") as page:
            page.wait(lambda: page.page.locator("#episode-list li").count() == 1)
            snapshots = []
            for _ in range(12):
                snapshots.append(envs.step(envs.sample_actions()).snapshot[1].copy())
            page.wait(lambda: page.last == 12 * 8)
            page.press(" ")
            page.scrub(5 * 8 + 3)  # within the sixth step: before it, five are played
            for step, save in (
                (5, lambda: page.page.keyboard.press("b")),
                (12, lambda: page.page.click("#branch")),
            ):
                with page.page.expect_download() as download:
                    save()  # type: ignore[no-untyped-call]
                assert download.value.suggested_filename == f"2s3z-step{step}.snapshot"
                file = tmp_path / "saved.snapshot"
                download.value.save_as(file)
                saved = np.fromfile(file, np.uint8)
                assert np.array_equal(saved, snapshots[step - 1])
                page.press("End")
        programs_of_test.stop(programs_of_test.running[-1])
        state = envs.reset(env_id=[0], snapshots=saved[None]).state.copy()
        assert np.array_equal(state[0], state[1]), "environment 1 is still there"
    branch = str(tmp_path / "branch.smreplay")
    argv = [*PROGRAM, "record", "--from", str(file), "--policy", "kite", "--out", branch]
    subprocess.run(argv, check=True, timeout=100)


def test_a_reload_of_a_followed_battle_keeps_its_page_of_the_grid(
    browser: Any, programs_of_test: Programs
) -> None:
    """All battles were then those of the first page."""
    programs_of_test.serve("3m:70")
    url = programs_of_test.watch()
    with WatchPage(browser, url, "lane=3m&env=67") as page:
        page.wait(lambda: page.text("h1") == "Battle 67")
        page.press("g")
        page.wait(lambda: page.text("#range") == "battles 64 to 69 of 70")
        assert page.page.evaluate("document.activeElement.querySelector('b').textContent") == "67"
    with WatchPage(browser, url, "env=67&theme=dark") as page:  # the other theme came with a reload
        page.wait(lambda: page.text("h1") == "Battle 67")
        page.wait(lambda: page.page.url.endswith("#lane=3m&env=67&theme=dark"))
    with WatchPage(browser, url, "env=67&theme=pink") as page:
        page.wait(lambda: page.page.url.endswith("#lane=3m&env=67"))
    # 0.5 was sent to the program, which answered with the words of its parser.
    # An empty one was 0; the others were ignored without a word.
    for env in ("0.5", "70", "-1", "abc", ""):
        with WatchPage(browser, url, f"lane=3m&env={env}") as page:
            assert page.text("#range") == "battles 0 to 63 of 70" and page.text("h1") == "train"
            ignored = f"`env` must be a whole number from 0 to 69, got `{env}`."
            page.page.locator("#notice", has_text=f"{NOT_FOLLOWED} {ignored}").wait_for()
            page.page.evaluate("location.hash = 'env=68'")
            page.wait(lambda: page.text("h1") == "Battle 68")
            page.wait(lambda: NOT_FOLLOWED not in page.text("#notice"))
            assert page.page.url.endswith("#lane=3m&env=68")


def test_the_header_of_a_followed_battle_has_one_row(browser: Any, programs_of_test: Programs) -> None:
    """It had two where the facts did not fit beside the buttons, and jumped between one and two."""
    programs_of_test.serve("3m:2")
    with WatchPage(browser, programs_of_test.watch()) as page:
        programs_of_test.learn("3m", 20.0)
        page.follow(0)
        page.page.evaluate("document.getElementById('notice').style.display = 'none'")  # a row of its own
        fill = """(facts) => facts.replaceChildren(...[..."abcdef"].map((name) => {
            const pair = document.createElement("div");
            pair.innerHTML = `<dt>a long name ${name}</dt><dd>its value</dd>`;
            return pair;
        }))"""
        measure = """(header) => [header.getBoundingClientRect().height,
            document.documentElement.scrollWidth <= innerWidth,
            document.getElementById("help").getBoundingClientRect().right <= innerWidth]"""
        for width in (1280, 1101, 1000, 821):
            page.page.set_viewport_size({"width": width, "height": 800})
            page.page.eval_on_selector("#facts", fill)
            height, *fits = page.page.eval_on_selector("header", measure)
            assert height < 60 and all(fits), (width, height, fits)


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 390])
def test_every_view_fits_its_window(
    browser: Any, programs_of_test: Programs, scheme: str, width: int
) -> None:
    programs_of_test.serve("MMM:4")
    programs_of_test.learn("MMM", 60)
    viewport = {"width": width, "height": 800}
    options: dict[str, Any] = {"viewport": viewport, "color_scheme": scheme, "device_scale_factor": 2}
    nameless = """() => [...document.querySelectorAll("button, input, select, canvas:not([aria-hidden])")]
        .filter((e) => !e.getAttribute("aria-label") && !e.textContent.trim())
        .map((e) => e.outerHTML.slice(0, 80))"""
    wide = "document.documentElement.scrollWidth - innerWidth"
    with WatchPage(browser, programs_of_test.watch(), **options) as page:
        page.wait(lambda: colours(page, ".cell canvas >> nth=0") > 20)
        assert page.page.get_attribute("html", "data-theme") == scheme
        assert page.page.evaluate(nameless) == [] and page.page.evaluate(wide) <= 0
        page.follow(0)
        page.press("]")
        page.wait(lambda: page.shown("#obs table"))
        assert page.page.evaluate(nameless) == [] and page.page.evaluate(wide) <= 0
