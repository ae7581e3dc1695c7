"""What runs say of themselves in `run.json`, compared with what the program writes there for some options."""

from __future__ import annotations

import json
import subprocess
import tempfile
from collections.abc import Collection
from pathlib import Path
from typing import Any

from . import data

Description = dict[str, Any]
"""Values by key, such as `rules`, `config.seed` and `files.text`."""


def description(run: Path) -> Description:
    """What `run.json` in the folder of a run says, all but the version of the program."""
    found: Description = {}
    for key, value in json.loads((run / "run.json").read_text()).items():
        if key in {"config", "files"}:
            found |= {f"{key}.{name}": each for name, each in value.items()}
        else:
            found[key] = value
    del found["version"]
    return found


def trained_with(scenario: str, options: list[str]) -> Description:
    """What `run.json` says of a run of `smaclite-pool train` with these options, and one update."""
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "run"
        argv = [str(data.PROGRAM), "train", scenario, "--steps", "1", *options, "--out", str(run)]
        done = subprocess.run(argv, capture_output=True, text=True)
        if done.returncode:
            raise SystemExit(
                f"results: `train {scenario}` says of options that were to be compared: {done.stderr}"
            )
        return description(run)


def differences(run: Path, expected: Description, free: Collection[str]) -> str:
    """What `run.json` in this folder says otherwise, in words, and not of the keys in `free`; or nothing."""
    given = description(run)
    keys = [key for key in {**expected, **given} if key not in free and given.get(key) != expected.get(key)]
    return ", ".join(f"{key} is {short(given.get(key))}, not {short(expected.get(key))}" for key in keys)


def short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:60]}..."
