"""Battles of the published environment: SMAClite with its C++ addon for collision avoidance."""

from __future__ import annotations

import contextlib
import io
import os
import traceback
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import rvo2  # noqa: F401  the addon; the environment itself asks for it late
import smaclite  # noqa: F401  registers the environments
from smaclite.env.units.unit_type import CustomUnitType

from .battles import Frame, PublishedFailure
from .scenarios import ScenarioFiles


class PublishedBattle:
    """A battle of the published environment: by name where it knows the scenario, else by file."""

    def __init__(self, files: ScenarioFiles, path: Path, seed: int) -> None:
        self.seed = seed
        self.reward = 0.0
        """Of the last step, before it is rounded to float32."""
        CustomUnitType.CUSTOM_UNIT_TYPES.clear()  # or a unit file would be that of an earlier scenario
        name = f"smaclite/{files.name}-v0"
        known = files.standard and name in gymnasium.registry
        unknown = {"id": "smaclite/custom-v0", "map_file": str(path)}
        scenario: dict[str, Any] = {"id": name} if known else unknown
        with working_directory(path.parent), contextlib.redirect_stdout(io.StringIO()):
            made = gymnasium.make(**scenario, use_cpp_rvo2=True, seed=seed, disable_env_checker=True)
        self.env: Any = made.unwrapped

    def reset(self) -> Frame:
        obs, _ = self.env.reset(seed=self.seed)
        return self.frame(obs, 0.0, False, False)

    def step(self, actions: list[int]) -> Frame:
        with known_stops():
            obs, self.reward, terminated, _, info = self.env.step(actions)
        return self.frame(obs, self.reward, terminated, terminated and info["battle_won"])

    def close(self) -> None:
        self.env.close()

    def frame(self, obs: Any, reward: float, terminated: bool, battle_won: bool) -> Frame:
        return Frame(
            np.stack(obs).astype(np.float32),
            self.env.get_state().astype(np.float32),
            np.array(self.env.get_avail_actions(), bool),
            np.array(reward, np.float32),
            np.array(terminated, bool),
            np.array(battle_won, bool),
        )


@contextlib.contextmanager
def known_stops() -> Iterator[None]:
    """Turns the one error that is known and left out of our engine into `PublishedFailure`: a beam with no
    unit in reach has no positions to multiply. All other errors pass."""
    try:
        yield
    except ValueError as error:
        files = [Path(frame.filename).name for frame in traceback.extract_tb(error.__traceback__)]
        if "targeter.py" not in files:
            raise
        raise PublishedFailure("a laser beam found no unit") from error


@contextlib.contextmanager
def working_directory(folder: Path) -> Iterator[None]:
    """The published environment looks for unit files from here."""
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)
