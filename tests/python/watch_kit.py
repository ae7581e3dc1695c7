"""What tests of the page of a running pool share: pools and learners in other processes, and the page."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from conftest import PROGRAM
from pages import WINDOW, BattlePage

LEARNER = Path(__file__).parent / "learner.py"


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
