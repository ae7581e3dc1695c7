"""Draws the picture of the scenario editor: `editor_picture.py PROGRAM PNG`."""

from __future__ import annotations

import shutil
import subprocess
import sys

from playwright.sync_api import sync_playwright

program, png = sys.argv[1:]
with (
    subprocess.Popen([program, "edit", "corridor"], stdout=subprocess.PIPE, text=True) as editor,
    sync_playwright() as playwright,
):
    try:
        assert editor.stdout is not None
        url = editor.stdout.readline().strip()
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.goto(f"{url}#group=0&theme=dark")
        page.wait_for_selector("#state.valid")
        # The next two frames draw the units.
        page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        page.screenshot(path=png)
    finally:
        editor.terminate()
