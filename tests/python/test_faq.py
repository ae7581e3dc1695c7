"""The messages of the FAQ are those that the package raises."""

from __future__ import annotations

import os
import re
from collections.abc import Callable

import numpy as np
import pytest
import smaclite_pool as sp

from test_docs import DOCS, blocks


def errors() -> dict[str, Callable[[], object]]:
    """What the FAQ is about, and code that gets there."""
    envs = sp.make("2s3z", num_envs=4, name=f"faq-{os.getpid()}")
    few = sp.make("2s3z", num_envs=4, fields=["obs", "avail_actions"])
    asynchronous = sp.make("2s3z", num_envs=4, batch_size=2)
    disabled = sp.make("3m", num_envs=2, autoreset_mode="Disabled")
    many = sp.make("27m_vs_30m", num_envs=256)
    closed = sp.make("3m", num_envs=1)
    closed.close()
    spectators: list[sp.Spectator] = []

    def twice() -> None:
        asynchronous.async_reset(seed=1)
        ids = asynchronous.recv().env_id.copy()
        asynchronous.send(np.ones((2, 5), int), ids)
        asynchronous.send(np.ones((2, 5), int), ids)

    def hold() -> None:
        batches = [envs.reset(seed=1)]
        while True:
            batches.append(envs.step(envs.sample_actions()))

    def finish() -> None:
        disabled.reset(seed=1)
        while True:
            disabled.step(disabled.sample_actions())

    def watch() -> None:
        while True:
            spectators.append(sp.Spectator(envs.spec.pool))

    def wait_too_short() -> None:
        # Mostly not ready when the time is looked at first; else the system kept this thread from its core.
        while True:
            many.reset(seed=1, timeout=0)

    def illegal() -> None:
        envs.reset(seed=1)
        envs.step(np.full((4, 5), 9))

    return {
        "no reset": envs.sample_actions,
        "illegal": illegal,
        "shape": lambda: envs.step(np.zeros((4, 4), int)),
        "busy": twice,
        "nothing": envs.recv,
        "finished": finish,
        "autoreset": lambda: sp.make("2s3z", autoreset_mode="same-step"),  # type: ignore[call-overload]
        "fields": lambda: sp.make("2s3z", fields="obs"),  # type: ignore[call-overload]
        "float": lambda: envs.step(np.zeros((4, 5))),
        "other name": lambda: envs.reset(seed=1).observation,  # type: ignore[attr-defined]
        "omitted": lambda: few.reset(seed=1).state,
        "final": lambda: few.reset(seed=1).final_obs,
        "unknown": lambda: sp.make("3m5z"),
        "held": hold,
        "memory": lambda: sp.make("27m_vs_30m", num_envs=1_000_000),
        "pool": lambda: sp.connect("nothing"),
        "taken": lambda: sp.connect(envs.spec.pool),
        "lane": lambda: sp.connect(envs.spec.pool, lane="zz"),
        "spectators": watch,
        "name": lambda: sp.make("2s3z", name=envs.spec.pool),
        "timeout": wait_too_short,
        "closed": closed.reset,
    }


def alike(message: str) -> str:
    """A message without numbers, and without names of pools, which are others on the page."""
    message = re.sub(r"named `\w[^`]*`|running: .*|`docker[^`]*`", "", message)
    return re.sub(r"\[?\d[\d, ]*\]?", "0", message)


def test_the_messages_of_the_faq_are_the_real_ones() -> None:
    page = (DOCS / "faq.md").read_text()
    described = {alike(block.code.strip()) for block in blocks(page) if block.language == "text"}
    for name, provoke in errors().items():
        with pytest.raises(Exception) as raised:  # noqa: PT011, the message is compared below
            provoke()
        assert alike(str(raised.value)) in described, f"{name}: {raised.value}"
        kind = type(raised.value).__name__
        section = blocks(page.split(f"## {kind}\n")[1].split("\n## ")[0])
        assert alike(str(raised.value)) in [alike(block.code.strip()) for block in section], f"{name}: {kind}"
