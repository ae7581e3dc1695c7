"""SMAC's reward options among the arguments of emulations."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .._native import REWARD_DEFAULTS


def changed_rewards(arguments: Mapping[str, Any]) -> dict[str, Any] | None:
    """The reward options that are not SMAC's defaults, as `rewards` of `smaclite_pool.make`; None if none is.

    So options at their defaults are those of the scenario file.
    """
    defaults: Mapping[str, Any] = REWARD_DEFAULTS
    given = {name: arguments[name] for name in defaults if name in arguments}
    return {name: value for name, value in given.items() if value != defaults[name]} or None
