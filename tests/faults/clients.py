"""Clients of commands that serve while faults meet them: a learner, and pages of the browser."""

from __future__ import annotations

import base64
import http.client
import json
import os
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from .injection import LONGEST

FIELDS = ["obs", "state", "avail_actions", "snapshot"]

LEARNER = f"""
FIELDS = {FIELDS}
import numpy as np
import smaclite_pool as sp

def compare(batch, expected):
    for name in envs.spec.fields:
        np.testing.assert_array_equal(batch[name], expected[name], name)

with sp.make("3m", 2, fields=FIELDS) as twin:
    try:
        with sp.connect("faults", timeout=5) as envs:
            compare(envs.reset(seed=1), twin.reset(seed=1))
            with sp.Spectator("faults") as spectator:
                for _ in range(20):
                    actions = twin.sample_actions()
                    compare(envs.step(actions), twin.step(actions))
                    assert spectator.latest() is not None
            snapshots = twin.reset(seed=2).snapshot
            compare(envs.reset(snapshots=snapshots), twin.reset(snapshots=snapshots))
            for _ in range(20):
                actions = twin.sample_actions()
                compare(envs.step(actions), twin.step(actions))
    except sp.errors.PoolError as error:
        print(error)
"""


def learner(_line: str, folder: Path) -> str | None:
    """Attaches to the pool `faults`, plays, restores and watches, and compares every batch with one of a pool
    of its own. Errors of the package are accepted, as the pool may end."""
    environment = {**os.environ, "SMACLITE_POOL_ROOT": str(folder / "pools")}
    command = [sys.executable, "-c", LEARNER]
    try:
        done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=LONGEST)
    except subprocess.TimeoutExpired:
        return "its learner hangs"
    return f"its learner: {done.returncode}: {done.stderr}" if done.returncode else None


class PageSocket:
    """The WebSocket of a page."""

    def __init__(self, url: str, path: str = "/ws") -> None:
        parts = urlsplit(url)
        assert parts.hostname and parts.port
        self._socket = socket.create_connection((parts.hostname, parts.port), timeout=LONGEST)
        self._file = self._socket.makefile("rb")
        self._id = 0
        key = base64.b64encode(os.urandom(16)).decode()
        headers = {
            "Host": parts.netloc,
            "Origin": f"http://{parts.netloc}",
            "Upgrade": "websocket",
            "Connection": "Upgrade",
            "Sec-WebSocket-Version": "13",
            "Sec-WebSocket-Key": key,
        }
        lines = [
            f"GET {path}?{parts.query} HTTP/1.1",
            *(f"{name}: {value}" for name, value in headers.items()),
        ]
        self._socket.sendall("\r\n".join([*lines, "", ""]).encode())
        if b"101" not in self._file.readline():
            raise ConnectionError("the WebSocket is refused")
        while self._file.readline().strip():
            pass

    def close(self) -> None:
        self._file.close()
        self._socket.close()

    def receive(self) -> Any:
        """The next message; an error if the connection ends."""
        head = self._read(2)
        size = head[1] & 127
        if size > 125:
            size = int.from_bytes(self._read(2 if size == 126 else 8), "big")
        text = self._read(size)
        if head[0] & 15 != 1:
            raise ConnectionError("the WebSocket is closed")
        return json.loads(text)

    def _read(self, count: int) -> bytes:
        data = self._file.read(count)
        if len(data) < count:
            raise ConnectionError("the WebSocket ends")
        return data

    def request(self, kind: str, **arguments: Any) -> Any:
        """The response to a request, after events that came before it."""
        self._id += 1
        text = json.dumps({"id": self._id, "request": {"type": kind, **arguments}}).encode()
        size = len(text).to_bytes(1 if len(text) < 126 else 2 if len(text) < 65536 else 8, "big")
        size = size if len(size) == 1 else bytes([126 if len(size) == 2 else 127]) + size
        mask = bytes(4)
        self._socket.sendall(b"\x81" + bytes([size[0] | 128]) + size[1:] + mask + text)
        while True:
            message = self.receive()
            if message.get("id") == self._id:
                return message


def page(url: str) -> PageSocket:
    """Loads a page and opens its WebSocket."""
    parts = urlsplit(url)
    connection = http.client.HTTPConnection(parts.netloc, timeout=LONGEST)
    connection.request("GET", f"{parts.path}?{parts.query}")
    document = connection.getresponse().read()
    connection.close()
    if b"</html>" not in document:
        raise ConnectionError("the page is not whole")
    opened = PageSocket(url)
    if "error" in (greeting := opened.request("hello", version=VERSION)):
        raise AssertionError(greeting["error"])
    return opened


VERSION = 8
"""Of the messages, as in bindings/cli/src/web/protocol."""


def editor(url: str, folder: Path) -> str | None:
    """Saves a changed scenario. Its file is then the old or the new one, and the new one if that was said."""
    file = folder / "out" / "duel.json"
    old = file.read_text()
    new = old.replace('"name"', '"name" ')
    is_saved = False
    try:
        opened = page(url)
        if begun := opened.request("open_files").get("response"):
            files = {**begun["files"], "text": new}
            saved = opened.request("save_files", files=files, base=begun["base"], replace=False)
            is_saved = "saved" in saved.get("response", {})
        opened.close()
    except TimeoutError:
        return "its page hangs"
    except (OSError, http.client.HTTPException):
        pass
    text = file.read_text()
    if text not in (old, new):
        return f"its file is neither the old nor the new one: {text[:200]!r}"
    return "its page said that it was saved" if is_saved and text == old else None


def viewer(url: str, _folder: Path) -> str | None:
    """Watches a lane until an environment of it is drawn, or the page says that it cannot be."""
    try:
        opened = page(url)
        opened.request("select_lane", name="own")
        opened.request("set_view", first=0, count=2, visible=True)
        end = time.monotonic() + LONGEST
        event: Any = {}
        while event.get("type") not in ("grid", "lost"):
            if time.monotonic() > end:
                raise TimeoutError
            event = opened.receive().get("event", {})
        opened.close()
    except TimeoutError:
        return "its page hangs"
    except (OSError, http.client.HTTPException):
        pass
    return None
