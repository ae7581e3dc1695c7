"""Writes recorded.json: scores of two algorithms, and what rliable says of them.

    pip install rliable==1.2.0 'pandas<3' 'numpy<2.3'
    python bindings/learn/tests/rliable/record.py

rliable draws from NumPy's global generator, whatever `random_state` it is given, so that is seeded.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from rliable import library, metrics

RUNS, TASKS = 10, 4
REPETITIONS = 20_000
THRESHOLDS = [i / 20 for i in range(21)]


def scores() -> dict[str, Any]:
    """Win rates over 32 episodes, so that there are equal ones: tasks of different difficulty, and one that
    the second algorithm does not learn in some runs."""
    random = np.random.default_rng(3)
    rates = {"a": [0.95, 0.6, 0.3, 0.8], "b": [0.9, 0.65, 0.2, 0.7]}
    found = {name: random.binomial(32, rate, (RUNS, TASKS)) / 32 for name, rate in rates.items()}
    found["b"][:4, 3] = 0.0
    return found


def as_lists(estimates: dict[str, Any], intervals: dict[str, Any], name: str) -> list[list[float]]:
    """Rows of value, lower and upper end."""
    return np.vstack([np.atleast_1d(estimates[name]), intervals[name]]).T.tolist()


def main() -> None:
    found = scores()
    np.random.seed(1)
    means = library.get_interval_estimates(
        found, lambda x: np.array([metrics.aggregate_iqm(x)]), reps=REPETITIONS
    )
    profiles = library.create_performance_profile(found, THRESHOLDS, reps=REPETITIONS // 4)
    pair = {"a,b": (found["a"], found["b"])}
    improvement = library.get_interval_estimates(
        pair, lambda x, y: np.array([metrics.probability_of_improvement(x, y)]), reps=REPETITIONS // 4
    )
    recorded = {
        # By task, as the statistics take them.
        "scores": {name: of_runs.T.tolist() for name, of_runs in found.items()},
        "thresholds": THRESHOLDS,
        "interquartile_means": {name: as_lists(*means, name)[0] for name in found},
        "profiles": {name: as_lists(*profiles, name) for name in found},
        "improvement": as_lists(*improvement, "a,b")[0],
    }
    Path(__file__).with_name("recorded.json").write_text(json.dumps(recorded, indent=1) + "\n")


if __name__ == "__main__":
    main()
