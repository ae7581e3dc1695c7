"""Rules `starcraft` at the seams: what is stored names their version and plays again with the same bits."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp

from conftest import Serve, replayed

FIELDS = ["obs", "state", "avail_actions", "alive", "snapshot"]


def play(envs: sp.Envs, steps: int) -> list[dict[str, Any]]:
    """Copies of the batches of seeded random play."""
    envs.seed_sampler(1)
    envs.reset(seed=1)
    return [envs.step(envs.sample_actions()).copy() for _ in range(steps)]


def assert_equal(one: list[dict[str, Any]], other: list[dict[str, Any]]) -> None:
    for left, right in zip(one, other, strict=True):
        for name, values in left.items():
            assert values.tobytes() == right[name].tobytes(), name


@pytest.mark.parametrize("scenario", ["MMM2", "bane_vs_bane", "2c_vs_64zg", "terran_5_vs_5"])
def test_the_bits_depend_on_no_number_of_threads_and_no_process(scenario: str, serve: Serve) -> None:
    serve(f"{scenario}:4", "--name", "war", "--rules", "starcraft", "--fields", ",".join(FIELDS))
    with sp.make(scenario, 4, rules="starcraft", threads=1, fields=FIELDS) as envs:
        one = play(envs, 60)
        assert envs.spec.rules == "starcraft-1"
    with sp.make(scenario, 4, rules="starcraft-1", threads=3, fields=FIELDS) as envs:
        assert_equal(one, play(envs, 60))
    with sp.connect("war") as attached:
        assert_equal(one, play(attached, 60))
    with sp.make(scenario, 4, threads=1, fields=FIELDS) as envs:
        assert not np.array_equal(one[-1]["state"], play(envs, 60)[-1]["state"])


def test_a_battle_goes_on_from_the_middle_of_its_attacks() -> None:
    with sp.make("3s5z", 8, rules="starcraft", fields=FIELDS) as envs:
        middle = play(envs, 25)[-1]["snapshot"]
        all_columns = [sp.snapshot_columns(snapshot) for snapshot in middle]
        assert all(columns["rules"] == 2 and columns["n_phases"] == 16 for columns in all_columns)
        for name in ("windup", "backswing", "hits"):
            assert any(columns[name].any() for columns in all_columns), name
        actions = [envs.sample_actions()]
        expected = envs.step(actions[0]).copy()
        envs.reset(snapshots=middle)
        assert_equal([expected], [envs.step(actions[0]).copy()])
        # Edited columns are packed, and checked: a hit cannot be in flight to a unit that does not exist.
        columns = all_columns[0]
        columns["hit_target"][:] = 99
        with pytest.raises(
            sp.errors.InvalidRequest, match="'hit_target' must be between -1 and 15 for unit 0"
        ):
            sp.pack_snapshot(columns, envs)


def test_replays_and_runs_name_the_version_and_play_again(tmp_path: Path) -> None:
    file = tmp_path / "war.smreplay"
    with sp.make("so_many_baneling", 1, rules="starcraft", record=file) as envs:
        play(envs, 60)
    # Every tick is played again; the returns are compared.
    assert "starcraft-1" in replayed(file)
    run = tmp_path / "run"
    command = [sys.executable, "-m", "smaclite_pool", "train", "3m", "--rules", "starcraft"]
    command += ["--steps", "4096", "--out", str(run)]
    subprocess.run(command, check=True, capture_output=True, timeout=300)
    assert json.loads((run / "run.json").read_text())["rules"] == "starcraft-1"
    team = sp.load_team(run, seed=0)
    with sp.make("3m", 4, **team.settings) as envs:
        assert envs.spec.rules == "starcraft-1"
        assert len(sp.evaluate(envs, team, episodes=4, seed=1)) == 4
