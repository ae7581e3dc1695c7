"""The page of a running pool in a real browser: pool, learner and page are separate processes."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
import smaclite_pool as sp

from conftest import PROGRAM
from pages import WINDOW, BattlePage, browser, pytestmark
from test_page import check_step_on_phones

__all__ = ["browser", "pytestmark"]  # a fixture and marks that pytest finds here

FIELDS = ["obs", "state", "avail_actions", "alive", "snapshot"]
LEARNER = Path(__file__).parent / "learner.py"


NOT_FOLLOWED = "The address cannot be followed:"


class Programs:
    """Processes of this test, which end with it."""

    def __init__(self) -> None:
        self.running: list[subprocess.Popen[str]] = []

    def start(self, *command: str | Path) -> subprocess.Popen[str]:
        process = subprocess.Popen([str(part) for part in command], stdout=subprocess.PIPE, text=True)
        self.running.append(process)
        return process

    def serve(self, *lanes: str) -> subprocess.Popen[str]:
        pool = self.start(*PROGRAM, "serve", *lanes, "--name", "train", "--threads", "1")
        assert pool.stdout is not None
        assert any(line.startswith("connect with") for line in pool.stdout)
        return pool

    def learn(self, lane: str, steps_per_s: float) -> subprocess.Popen[str]:
        learner = self.start(sys.executable, LEARNER, "train", lane, str(steps_per_s))
        assert learner.stdout is not None and learner.stdout.readline() == "playing\n"
        return learner

    def watch(self, *options: str) -> str:
        """Serves the pages; gives their URL. The process is the last of `running`."""
        watch = self.start(*PROGRAM, "watch", "train", *options)
        assert watch.stdout is not None
        return watch.stdout.readline().strip()

    def stop(self, process: subprocess.Popen[str]) -> int:
        process.send_signal(signal.SIGINT)
        assert process.stdout is not None
        process.stdout.close()
        self.running.remove(process)
        return process.wait(30)


@pytest.fixture
def programs_of_test(runtime_dir: Path) -> Iterator[Programs]:
    programs = Programs()
    yield programs
    for process in reversed(programs.running[:]):
        programs.stop(process)


class WatchPage(BattlePage):
    """A live page, which loads no other file."""

    def __init__(self, browser: Any, url: str, state: str = "", **options: Any) -> None:
        self.url = url
        self.sockets: list[str] = []
        tab = browser.new_page(**WINDOW | options)
        super().__init__(tab, f"{url}#{state}", websocket=lambda socket: self.sockets.append(socket.url))

    def __exit__(self, *_: object) -> None:
        super().__exit__()
        others = [url for url in self.requests if not url.startswith((self.url, "data:"))]
        host = self.url.removeprefix("http://").split("/")[0]
        assert others == [] and all(url.startswith(f"ws://{host}/ws?") for url in self.sockets)

    @property
    def last(self) -> int:
        """The last known tick; 0 before the first is known."""
        return int(self.page.get_attribute("#scrub", "max") or 0)

    def follow(self, env: int) -> None:
        self.page.click(f".cell >> nth={env}")
        self.wait(lambda: self.last > 0)

    def number(self, selector: str) -> float:
        """The first number in a text; NaN if there is none."""
        found = re.search(r"-?\d+(\.\d+)?", self.text(selector))
        return float(found[0]) if found else float("nan")

    def has_number_within(self, selector: str, low: float, high: float) -> bool:
        """Whether a text has a number, thousands written as k, in this range."""
        text = self.text(selector)
        found = re.search(r"-?\d+(\.\d+)?", text)
        return found is not None and low <= float(found[0]) * (1000 if " k" in text else 1) <= high

    def wait_for_texts(self, selector: str, count: int) -> None:
        """Waits until this number of different texts was seen."""
        seen: set[str] = set()

        def is_done() -> bool:
            seen.add(self.text(selector))
            return len(seen) >= count

        self.wait(is_done)


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
