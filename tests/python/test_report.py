"""`smaclite-pool report`: marl-eval loads metrics.json unmodified, and numbers are those of rliable."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from conftest import program

processing = pytest.importorskip("marl_eval.utils.data_processing_utils")
diagnosis = pytest.importorskip("marl_eval.utils.diagnose_data_errors")
metrics = pytest.importorskip("rliable.metrics")

SEEDS, STEPS, EVERY = 3, 20_000, 5_000
NORMALISED = ["return"]


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of two algorithms on two maps."""
    folder = tmp_path_factory.mktemp("benchmark")
    train = f"--seeds {SEEDS} --steps {STEPS} --evaluate-every {EVERY}"
    for scenario in ("3m", "2m_vs_1z"):
        program(*f"train {scenario} --out runs/ippo/{scenario} {train}".split(), cwd=folder)
        mappo = f"train {scenario} --out runs/MAPPO/{scenario} --algorithm mappo {train}"
        program(*mappo.split(), cwd=folder)
    program(*["report", "runs/ippo", "runs/MAPPO", "--out", "report", "--actions", "sampled"], cwd=folder)
    return folder / "report"


@pytest.fixture
def matrices(report: Path) -> tuple[Any, Any]:
    """What marl-eval makes of the file: arrays [runs, tasks], and [runs, tasks, steps]."""
    data = json.loads((report / "metrics.json").read_text())
    processed = processing.data_process_pipeline(data, NORMALISED)
    found: tuple[Any, Any] = processing.create_matrices_for_rliable(processed, "smaclite", NORMALISED)
    return found


def test_marl_eval_finds_nothing_wrong(report: Path) -> None:
    data = json.loads((report / "metrics.json").read_text())
    checks = diagnosis.DiagnoseData(data).check_data()
    assert list(checks) == ["smaclite"]
    assert all(checks["smaclite"].values()) and len(checks["smaclite"]) == 5, checks


def test_marl_eval_has_every_run_and_step(matrices: tuple[Any, Any]) -> None:
    final, curves = matrices
    assert set(final) == {"mean_win_rate", "mean_norm_return"}
    for metric in final:
        assert set(final[metric]) == {"ippo", "mappo"}  # marl-eval makes names lower case
        assert all(array.shape == (SEEDS, 2) for array in final[metric].values())
        assert all(array.shape == (SEEDS, 2, 5) for array in curves[metric].values())
    assert curves["extra"]["number_of_runs"] == SEEDS
    assert curves["extra"]["number_of_steps"] == STEPS // EVERY + 1


def test_aggregates_and_curves_are_those_of_rliable(report: Path, matrices: tuple[Any, Any]) -> None:
    final, curves = matrices

    def rows(name: str, metric: str) -> list[dict[str, str]]:
        with (report / name).open() as file:
            return [row for row in csv.DictReader(file) if row["metric"] == metric and not row.get("task")]

    # marl-eval adds 1e-6 to the range by which it divides returns.
    for metric, theirs in (("win_rate", "mean_win_rate"), ("normalised_return", "mean_norm_return")):
        for row in rows("aggregates.csv", metric):
            expected = metrics.aggregate_iqm(final[theirs][row["algorithm"].lower()])
            assert float(row["interquartile_mean"]) == pytest.approx(expected, abs=2e-6), row
        by_step = rows("curves.csv", metric)
        assert len(by_step) == 2 * 5
        for row in by_step:
            frame = curves[theirs][row["algorithm"].lower()][..., int(row["steps"]) // EVERY]
            expected = metrics.aggregate_iqm(frame)
            assert float(row["interquartile_mean"]) == pytest.approx(expected, abs=2e-6), row
        for row in rows("profiles.csv", metric):
            scores = final[theirs][row["algorithm"].lower()]
            threshold = float(row["threshold"])
            if np.abs(scores - threshold).min() > 2e-6:
                assert float(row["share_above"]) == pytest.approx((scores > threshold).mean(), abs=1e-6), row
        for row in rows("improvement.csv", metric):
            pair = [final[theirs][row[name].lower()] for name in ("better", "than")]
            expected = metrics.probability_of_improvement(*pair)
            assert float(row["probability"]) == pytest.approx(expected, abs=1e-6), row
