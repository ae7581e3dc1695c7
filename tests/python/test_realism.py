"""The distance of rule sets from recorded battles (benches/realism), on recordings of this engine's own
battles."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp

from realism import __main__ as command
from realism import measures, play, record, recordings, restarted, rows, runs
from realism.columns import Columns
from realism.free import play as play_freely
from realism.pool import SEED, Setting, opened
from realism.recordings import RecordingError

SETTING = Setting("smaclite", "3m", threads=1)
# Middles of cells, as what is not recorded of starts is put there.
STARTS = [[9.5, 14.5], [9.5, 16.5], [9.5, 18.5], [20.5, 14.5], [20.5, 16.5], [20.5, 18.5]]


def recorded() -> dict[str, Any]:
    """A battle of 3m as a recording, with all that one of the real game has."""
    with sp.make("3m", 1, threads=1, fields=record.FIELDS) as envs:
        columns = sp.snapshot_columns(envs.reset(seed=SEED).snapshot[0])
        columns["pos"][:] = STARTS
        batch = envs.reset(seed=SEED, snapshots=sp.pack_snapshot(columns, envs))
        battles = record.record(envs, batch, sp.ScriptedPolicy("nearest", envs))
    return {"map": "3m", "version": "0", "battles": battles}


def measured(recording: Any, folder: Path) -> tuple[dict[str, float], restarted.Walks, restarted.Walks]:
    """Means of battles that are played from their start, and walks."""
    _, battles = recordings.read_file(record.write(recording, folder / "3m.json.gz"))
    with opened(battles, SETTING, 1) as player:
        values = measures.compare(player.cast.course, play_freely(player))
    with opened(battles, SETTING, 1) as player:
        walks = restarted.walk(player)
    with opened(battles, SETTING, restarted.PHASES) as player:
        drifts = restarted.drift(player)
    return {key: float(each.mean()) for key, each in values.items()}, walks, drifts


def test_a_battle_of_this_engine_has_no_distance_from_itself(tmp_path: Path) -> None:
    values, walks, drifts = measured(recorded(), tmp_path)
    assert values["winner"] == values["fate"] == 1
    assert values["enemies"] == values["agents"] == values["death"] == 0
    assert values["end"] == 9  # a recording ends with the removal of the survivors
    assert values["first_death"] == values["first_death_real"] > 0
    assert walks["agents", "MARINE", 1].error.max() < 1e-4
    assert np.median(walks["agents", "MARINE", 1].real) == pytest.approx(1.575, abs=0.01)
    for (side, _, steps), pairs in drifts.items():
        assert np.median(pairs.error) < 1e-4, (side, steps)
    assert {("agents", "MARINE", 1), ("enemies", "MARINE", 1), ("enemies", "MARINE", 4)} <= set(drifts)


def test_battles_of_a_team_are_recorded_and_played_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its orders are played with other random numbers, so a part of the battles ends otherwise."""
    assert record.main(["3m", str(tmp_path), "--battles", "8"]) == 0
    assert capsys.readouterr().out.strip() == str(tmp_path / "3m.json.gz")
    _, battles = recordings.read_file(tmp_path / "3m.json.gz")
    with opened(battles, SETTING, 4) as player:
        played = play_freely(player)
        assert player.cast.course.won.mean() > 0.8
        assert played.died.shape == (8, 4, 6) and np.isfinite(played.died).any()
    assert record.main(["no_such_team", str(tmp_path)]) == 1
    assert "no_such_team" in capsys.readouterr().err


def test_a_battle_with_a_slower_clock_is_found_to_be_far(tmp_path: Path) -> None:
    """Units that walk 1/1.4 of the way, and die 40 loops later: the game's clock beside SMAClite's."""
    recording = recorded()
    for _, orders in recording["battles"][0]["steps"]:
        for row in orders:
            if len(row) > 3:
                start = STARTS[row[0] if row[1] != "unit" else row[3]]
                row[-2:] = [s + (x - s) / 1.4 for s, x in zip(start, row[-2:], strict=True)]
    for unit in recording["battles"][0]["units"]:
        unit["died"] = unit["died"] and unit["died"] + 40
    recording["battles"][0]["removed"] += 40
    values, walks, drifts = measured(recording, tmp_path)
    assert values["death"] == 20  # of those that die 40, of the others 0
    assert np.median(walks["agents", "MARINE", 1].error) == pytest.approx(1.575 * (1 - 1 / 1.4), abs=0.05)
    assert np.median(drifts["enemies", "MARINE", 4].error) > 0.1


def test_columns_that_are_written_are_those_that_pack_snapshot_writes() -> None:
    with sp.make("MMM", 3, fields=["snapshot"]) as envs:
        snapshots = envs.reset(seed=1).snapshot.copy()
        columns = Columns(snapshots[0])
        places = columns.read(snapshots, "pos") + np.float32(0.25)
        packed = [{**sp.snapshot_columns(row), "pos": at} for row, at in zip(snapshots, places, strict=True)]
        columns.write(snapshots, "pos", places)
        np.testing.assert_array_equal(snapshots, [sp.pack_snapshot(each, envs) for each in packed])
        envs.reset(snapshots=snapshots)


def change(*path: Any, to: Any) -> Callable[[Any], None]:
    def edit(recording: Any) -> None:
        for key in path[:-1]:
            recording = recording[key]
        if to is None:
            del recording[path[-1]]
        else:
            recording[path[-1]] = to

    return edit


@pytest.mark.parametrize(
    ("edit", "error"),
    [
        (change("map", to=None), "3m.json.gz: key 'map' is missing"),
        (change("battles", to={}), "3m.json.gz: key 'battles' must be list, got {}"),
        (change("battles", 0, "battle", to=True), "entry 0 of 'battles': key 'battle' must be int, got True"),
        (change("battles", 0, "steps", to=[]), "battle 0: key 'steps' is empty"),
        (change("battles", 0, "units", 4, "died", to=None), "battle 0: unit 4: key 'died' is missing"),
        (change("battles", 0, "units", 4, "owner", to=3), "unit 4: key 'owner' must be 1 or 2, got 3"),
        (change("battles", 0, "units", 4, "killer", to=6), "unit 4: key 'killer' must be below 6, got 6"),
        (change("battles", 0, "steps", 1, 0, to=16), "entry 1 of 'steps': the loop must be 8, got 16"),
        (change("battles", 0, "steps", 1, 1, to=[[0, "n", 42]]), "'n', 42]: x and y are missing"),
        (
            change("battles", 0, "steps", 1, 1, to=[[0, "up", 42]]),
            "the kind must be n, s, e, w, unit or stop",
        ),
        (change("battles", 0, "steps", 1, 1, to=[[5, "stop", 40]]), "an order begins with an agent's id"),
    ],
)
def test_a_recording_with_another_format_is_refused(
    edit: Callable[[Any], None], error: str, tmp_path: Path
) -> None:
    recording = recorded()
    edit(recording)
    with pytest.raises(RecordingError) as raised:
        recordings.read(record.write(recording, tmp_path / "3m.json.gz").parent)
    assert error in str(raised.value) and str(tmp_path) in str(raised.value)


def test_the_command_goes_on_after_an_unknown_rule_set(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record.write(recorded(), tmp_path / "3m.json.gz")
    options = ["--rules", "warcraft", "smaclite", "--seeds", "2", "--maps", "3m", "--episodes", "5"]
    assert command.main([str(tmp_path), *options, "--csv", str(tmp_path / "numbers")]) == 1
    printed = capsys.readouterr()
    assert "error: warcraft: " in printed.err
    # No agent is known to stand anywhere: none walks again after its first attack.
    for name in set(runs.MEASURES) - {"stands"}:
        assert f"smaclite: {name}" in printed.out
        text = (tmp_path / "numbers" / f"{name}.csv").read_text()
        assert text.startswith("row,") and "smaclite 3m" in text
    assert command.main([str(tmp_path / "numbers")]) == 1
    assert "no files *.json.gz" in capsys.readouterr().err
    assert command.main([str(tmp_path), "--maps", "4m"]) == 1
    assert "there is no map '4m', but 10m_vs_11m" in capsys.readouterr().err


def test_the_recordings_of_the_repository_have_units_of_their_maps() -> None:
    for name, battles in recordings.read(recordings.FOLDER).items():
        with opened(battles, Setting("smaclite", name), 1) as player:
            assert not player.cast.skipped and len(player.goes_on) == len(battles)
    assert set(rows.real_scripts()) <= set(sp.scenarios())


def test_scripts_attack_what_they_say() -> None:
    """The weakest is the one with the least health, wherever it is; the closest is the nearest."""
    with sp.make("3m", 1, threads=1, fields=["state", "avail_actions", "snapshot"]) as envs:
        columns = sp.snapshot_columns(envs.reset(seed=1).snapshot[0])
        columns["pos"][:] = [*STARTS[:3], [13.5, 14.5], [13.5, 16.5], [13.5, 18.5]]
        columns["hp"][4] = 1
        batch = envs.reset(snapshots=sp.pack_snapshot(columns, envs))
        first = recordings.FIRST_TARGET
        for script, expected in (
            ("attack_closest", [first, first + 1, first + 2]),
            ("attack_weakest", [first + 1] * 3),
            ("focus_fire", [first + 1, first, first]),
        ):
            assert play.SCRIPTS[script](envs)(batch)[0].tolist() == expected, script
