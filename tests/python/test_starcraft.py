"""Rules `starcraft` at the seams: what is stored names their version and plays again with the same bits."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
import pytest
import smaclite_pool as sp
from smaclite_pool._layout import field_bounds
from smaclite_pool.marl import smac

from conftest import Serve, program, recorded, replayed

Rules: TypeAlias = Literal["smaclite", "starcraft"]
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


def test_a_pool_in_another_process_shows_the_same_bits(serve: Serve) -> None:
    serve("MMM2:4", "--name", "war", "--rules", "starcraft", "--fields", ",".join(FIELDS))
    with sp.make("MMM2", 4, rules="starcraft-1", threads=2, fields=FIELDS) as envs, sp.connect("war") as war:
        assert envs.spec.rules == war.spec.rules == "starcraft-1"
        played = play(envs, 60)
        assert_equal(played, play(war, 60))
    with sp.make("MMM2", 4, fields=FIELDS) as envs:
        assert not np.array_equal(played[-1]["state"], play(envs, 60)[-1]["state"])


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
    with sp.make("so_many_baneling", 1, rules="starcraft") as envs, recorded(envs, file):
        play(envs, 60)
    # Every tick is played again; the returns are compared.
    assert "starcraft-1" in replayed(file)
    run = tmp_path / "run"
    program("train", "3m", "--rules", "starcraft", "--steps", "4096", "--out", run)
    assert json.loads((run / "run.json").read_text())["rules"] == "starcraft-1"
    team = sp.load_team(run, seed=0)
    with sp.make("3m", 4, **team.settings) as envs:
        assert envs.spec.rules == "starcraft-1"
        assert len(sp.evaluate(envs, team, episodes=4, seed=1)) == 4


@pytest.mark.parametrize("scenario", ["3m", "corridor"])
def test_a_script_plays_the_enemies_of_both_sides(scenario: str) -> None:
    """The sizes of the enemies lacked the phases of attacks, so that every batch was one of another lane."""
    with sp.make(scenario, 4, rules="starcraft", sides="both") as envs:
        batch = envs.reset(seed=1)
        agents = sp.ScriptedPolicy("nearest", envs)
        enemies = sp.ScriptedPolicy("nearest", envs, side="enemies")
        for _ in range(20):
            batch = envs.step(np.concatenate([agents(batch), enemies(batch)], axis=1))
        assert batch.episode_return.any()


@pytest.mark.parametrize("rules", ["smaclite", "starcraft"])
@pytest.mark.parametrize("scenario", ["2s3z", "2s_vs_1sc", "protoss_5_vs_5"])
def test_the_described_scenario_is_that_of_the_rules(scenario: str, rules: Rules) -> None:
    """Starts were 2 squares off, and cooldowns were those of SMAClite."""
    with sp.make(scenario, 8, rules=rules, seed=1, fields=[*FIELDS, "final_state"]) as envs:
        told = sp.scenario(envs)
        batch = envs.reset()
        units = told["allies"] + told["enemies"]
        if not told["teams_are_drawn"]:
            starts = sp.snapshot_columns(batch.snapshot[0])["pos"]
            np.testing.assert_allclose([unit["position"] for unit in units], starts, atol=1e-6)
        low, high = field_bounds(envs)["state"]
        allies = next(part for part in told["state_layout"] if part["name"] == "allies")
        at = allies["features"].index("energy/cooldown")
        # Where teams are drawn, the environments have other units.
        scales = None if told["teams_are_drawn"] else [unit["max_cooldown"] for unit in told["allies"]]
        for _ in range(60):
            batch = envs.step(envs.sample_actions())
            assert (batch.state >= low).all() and (batch.state <= high).all()
            if scales is not None:
                rows = batch.state[0][allies["start"] :][: np.prod(allies["shape"])].reshape(allies["shape"])
                columns = sp.snapshot_columns(batch.snapshot[0])
                alive = columns["alive"][: len(scales)].astype(bool)
                left = columns["cooldown"][: len(scales)][alive]
                np.testing.assert_allclose((rows[:, at] * scales)[alive], left, atol=1e-5)


def test_the_units_of_the_interface_of_smac_have_the_cooldowns_of_the_rules() -> None:
    """The cooldown that was left was 30 % too short."""
    env = smac.MultiAgentEnv("2s3z", rules="starcraft", seed=1)
    env.reset()
    east, first_target = 4, 6
    for _ in range(30):
        masks = env.get_avail_actions()
        env.step(
            [
                int(np.argmax(mask[first_target:])) + first_target if any(mask[first_target:]) else east
                for mask in masks
            ]
        )
        left = sp.snapshot_columns(env._battle.last.snapshot)["cooldown"][:5]
        if left.any():
            break
    agent = int(left.argmax())
    assert left[agent] > 0
    assert env.get_unit_by_id(agent).weapon_cooldown == pytest.approx(left[agent], abs=1e-5)
    env.close()
