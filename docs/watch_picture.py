"""Takes docs/pictures/watch.png: the page of a pool of 2s3z, in Chromium. Run by `just picture-of-watch`."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path

from playwright.sync_api import sync_playwright

REPOSITORY = Path(__file__).resolve().parents[1]
PROGRAM = [sys.executable, "-m", "smaclite_pool"]
PICTURE = REPOSITORY / "docs" / "pictures" / "watch.png"
SECONDS = 40


def start(stack: ExitStack, *command: str) -> str:
    """Starts a program that ends with the stack; returns the first line that it prints."""
    process = stack.enter_context(subprocess.Popen(command, stdout=subprocess.PIPE, text=True))
    stack.callback(process.send_signal, signal.SIGINT)
    assert process.stdout is not None
    return process.stdout.readline().strip()


def main() -> None:
    with ExitStack() as stack:
        os.environ["SMACLITE_POOL_ROOT"] = stack.enter_context(tempfile.TemporaryDirectory(dir="/tmp"))
        start(stack, *PROGRAM, "serve", "2s3z:16", "--name", "train", "--threads", "1")
        start(stack, sys.executable, str(REPOSITORY / "tests/python/learner.py"), "train", "2s3z", "15")
        url = start(stack, *PROGRAM, "watch")
        browser = stack.enter_context(sync_playwright()).chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox"]
        )
        page = browser.new_page(viewport={"width": 1180, "height": 640}, color_scheme="dark")
        page.goto(url)
        page.wait_for_timeout(SECONDS * 1000)
        page.screenshot(path=PICTURE)
        browser.close()


main()
