"""What a step costs in Python beyond the Rust client: one environment of an embedded pool with one thread.

    just python-share 2s_vs_1sc --rounds 9

Both sample random available actions and step. The difference is Python's share of two calls. What
`sample_actions` takes in Python is measured too, so that the rest is the share of `step`, but for the few
nanoseconds of the sampling itself.
"""

import argparse
import json
import statistics
import subprocess
import time
from collections.abc import Callable

import smaclite_pool as sp

CALLS_BETWEEN_TIMES = 100


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("scenario", nargs="?", default="2s_vs_1sc", help="default: 2s_vs_1sc")
    parser.add_argument("--program", required=True, help="path of smaclite-pool, the Rust client")
    parser.add_argument("--seconds", type=float, default=1.0, help="of each measurement (default: 1)")
    parser.add_argument("--rounds", type=int, default=5, help="measurements of each in turn (default: 5)")
    return parser.parse_args()


def of_rust(program: str, scenario: str, seconds: float) -> float:
    """Microseconds per step."""
    options = ["--num-envs", "1", "--threads", "1", "--seconds", str(seconds), "--json"]
    command = [program, "bench", scenario, *options]
    result = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    return 1e6 / float(json.loads(result.stdout)["steps_per_s"])


def of_python(scenario: str, seconds: float) -> tuple[float, float]:
    """Microseconds per step, and per call of `sample_actions` alone."""
    with sp.make(scenario, 1, threads=1) as envs:
        envs.seed_sampler(0)
        envs.reset(seed=1)
        actions = envs.sample_actions()
        step = time_of(lambda: envs.step(envs.sample_actions(out=actions)), seconds)
        sampling = time_of(lambda: envs.sample_actions(out=actions), seconds / 4)
        return step, sampling - time_of(nothing, seconds / 4)


def nothing() -> None:
    """What is measured is called by a function, which costs as much as to call this one."""


def time_of(call: Callable[[], object], seconds: float) -> float:
    """Microseconds per call."""
    calls = 0
    elapsed = 0.0
    begin = time.perf_counter()
    while elapsed < seconds:
        for _ in range(CALLS_BETWEEN_TIMES):
            call()
        calls += CALLS_BETWEEN_TIMES
        elapsed = time.perf_counter() - begin
    return 1e6 * elapsed / calls


def main() -> None:
    options = arguments()
    rounds = []
    for _ in range(options.rounds):
        rust = of_rust(options.program, options.scenario, options.seconds)
        python, sampling = of_python(options.scenario, options.seconds)
        rounds.append((rust, python, python - rust, sampling))
        print(described(*rounds[-1]))
    print("median:", described(*(statistics.median(column) for column in zip(*rounds, strict=True))))


def described(rust: float, python: float, difference: float, sampling: float) -> str:
    shares = f"sample_actions {sampling:.2f} us, step {difference - sampling:.2f} us"
    return f"Rust {rust:.2f} us, Python {python:.2f} us, difference {difference:.2f} us: {shares}"


if __name__ == "__main__":
    main()
