"""Draws the picture of the scenario editor: `editor_picture.py PROGRAM WEBP`."""

from __future__ import annotations

import base64
import shutil
import subprocess
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

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

program, webp = sys.argv[1:]
with (
    subprocess.Popen([program, "edit", "corridor"], stdout=subprocess.PIPE, text=True) as editor,
    sync_playwright() as playwright,
):
    try:
        assert editor.stdout is not None
        url = editor.stdout.readline().strip()
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.goto(f"{url}#group=0&theme=light")
        page.wait_for_selector("#state.valid")
        # The next two frames draw the units.
        page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        png = base64.b64encode(page.screenshot()).decode()
        Path(webp).write_bytes(base64.b64decode(browser.new_page().evaluate(CONVERT, png)))
    finally:
        editor.terminate()
