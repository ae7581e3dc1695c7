"""Draws editor.webp, watch.webp and play.webp: the pages of these commands, in Chromium.

    page_pictures.py FOLDER

`just pictures` runs it with the installed package.
"""

from __future__ import annotations

import base64
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from playwright.sync_api import sync_playwright

PROGRAM = [sys.executable, "-m", "smaclite_pool"]
LEARNER = Path(__file__).resolve().parents[1] / "tests" / "python" / "learner.py"

# For how long the pool is watched, so that its curves have a past.
WATCHED_MS = 40_000

# After how many steps of a battle the sides fight.
PLAYED_STEPS = 7

# A screenshot is PNG or JPEG; as WebP, which browsers can write, it is half as large and as sharp.
CONVERT = """async (png) => {
    const image = new Image();
    image.src = `data:image/png;base64,${png}`;
    await image.decode();
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [image.width, image.height];
    canvas.getContext("2d").drawImage(image, 0, 0);
    return canvas.toDataURL("image/webp", 0.75).split(",")[1];
}"""


def start(stack: ExitStack, *command: str) -> str:
    """Starts a program that ends with the stack; returns the first line that it prints."""
    process = stack.enter_context(subprocess.Popen(command, stdout=subprocess.PIPE, text=True))
    stack.callback(process.send_signal, signal.SIGINT)
    assert process.stdout is not None
    return process.stdout.readline().strip()


def save(browser: Any, page: Any, path: Path) -> None:
    png = base64.b64encode(page.screenshot()).decode()
    path.write_bytes(base64.b64decode(browser.new_page().evaluate(CONVERT, png)))


def draw_editor(stack: ExitStack, browser: Any, path: Path) -> None:
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    page.goto(f"{start(stack, *PROGRAM, 'edit', 'corridor')}#group=0&theme=light")
    page.wait_for_selector("#state.valid")
    # The next two frames draw the units.
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    save(browser, page, path)


def draw_watch(stack: ExitStack, browser: Any, path: Path) -> None:
    os.environ["SMACLITE_POOL_ROOT"] = stack.enter_context(tempfile.TemporaryDirectory(dir="/tmp"))
    start(stack, *PROGRAM, "serve", "2s3z:16", "--name", "train", "--threads", "1")
    start(stack, sys.executable, str(LEARNER), "train", "2s3z", "15")
    page = browser.new_page(viewport={"width": 1180, "height": 640}, color_scheme="dark")
    page.goto(start(stack, *PROGRAM, "watch"))
    page.wait_for_timeout(WATCHED_MS)
    save(browser, page, path)


def draw_play(stack: ExitStack, browser: Any, path: Path) -> None:
    page = browser.new_page(viewport={"width": 1180, "height": 640}, color_scheme="dark")
    page.goto(start(stack, *PROGRAM, "play", "2s3z", "--seed", "1"))
    page.wait_for_selector("html[data-ready]", state="attached")
    page.keyboard.press("Control+a")
    for step in range(1, PLAYED_STEPS + 1):
        page.keyboard.press("a")
        page.keyboard.press(".")
        page.wait_for_selector(f"#time:has-text('step {step} /')")
    page.wait_for_selector("#result:has-text('Paused')")
    page.keyboard.press("a")
    page.wait_for_timeout(500)
    save(browser, page, path)


folder = Path(sys.argv[1])
with ExitStack() as stack:
    chromium = stack.enter_context(sync_playwright()).chromium
    browser = chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
    draw_editor(stack, browser, folder / "editor.webp")
    draw_watch(stack, browser, folder / "watch.webp")
    draw_play(stack, browser, folder / "play.webp")
    browser.close()
