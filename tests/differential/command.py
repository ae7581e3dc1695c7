"""What the commands need: the packages, and numbers as arguments."""

from __future__ import annotations

import argparse
import importlib
import sys

REQUIRED = {
    "smaclite_pool": "run `python -m pip install .` in this checkout with this interpreter",
    "rvo2": "it is the published environment's C++ addon, github.com/micadam/SMAClite-Python-RVO2",
    "smaclite.env.units.unit": "it is the published environment, github.com/uoe-agents/smaclite",
}


def missing_package() -> str | None:
    """Names a package that this interpreter lacks, and the remedy."""
    for name, remedy in REQUIRED.items():
        try:
            importlib.import_module(name)
        except ImportError as error:
            return f"{sys.executable} cannot import {name} ({error}): {remedy}"
    return None


def natural(text: str) -> int:
    if not text.isascii() or not text.isdigit():
        raise argparse.ArgumentTypeError(f"expected a whole number from 0, got {text!r}")
    return int(text)


def positive(text: str) -> int:
    if natural(text) == 0:
        raise argparse.ArgumentTypeError("expected a whole number from 1, got 0")
    return int(text)
