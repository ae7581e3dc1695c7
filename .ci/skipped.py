"""Fails if a test was skipped in every job of a run.

    .ci/skipped.py FOLDER [--elsewhere]

Every test process of the jobs adds a file to FOLDER, which SMACLITE_TEST_LOG names: lines of `ran` or
`skipped`, the test or module, and the reason, separated by tabs. With `--elsewhere`, a test may also run in
the jobs of the workflow that need an environment of their own; the last job of the workflow looks at the
files of all jobs, without that option.
"""

from __future__ import annotations

import argparse
import re
from pathlib import Path

# Packages that a `just test-integration NAME` installs, and `.ci/run` does not before it runs most tests.
ELSEWHERE = {
    *("flashbax", "h5py", "jax", "marl_eval", "minari"),
    *("ray", "rliable", "safetensors", "tensordict", "torch", "torchrl", "tree"),
}

# What no job can run, and why.
NOWHERE = {
    "tests/python/test_torch.py::test_pinned_memory_reaches_the_gpu": "needs a GPU",
    "tests/python/test_docs.py::test_page[how-to/training.md]": "sends its curves to Weights & Biases",
    "tests/python/test_epymarl.py::test_epymarls_own_runner_plays_the_same": "EPyMARL is not on PyPI",
}


def notes(folder: Path) -> tuple[set[str], dict[str, str]]:
    """The names of the tests and modules that ran, and of those that were skipped, with the reason."""
    ran: set[str] = set()
    skipped = {}
    for file in sorted(folder.rglob("*.tsv")):
        for line in file.read_text(encoding="utf-8").splitlines():
            outcome, name, reason = line.split("\t")
            if outcome == "ran":
                ran.update((name, name.partition("::")[0]))
            else:
                skipped[name] = reason
    return ran, skipped


def runs_elsewhere(reason: str) -> bool:
    """Whether other jobs install the packages that the test was skipped for, in pytest's words or ours."""
    found = re.search(r"could not import '(\w+)|not installed: (.*)", reason)
    return found is not None and set((found[1] or found[2]).split(", ")) <= ELSEWHERE


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--elsewhere", action="store_true", help="other jobs of the workflow count")
    options = parser.parse_args()
    ran, skipped = notes(options.folder)
    if not ran:
        raise SystemExit(f"error: no test noted in {options.folder} that it ran")
    never = {name: reason for name, reason in skipped.items() if name not in ran}
    left = {name for name in never if name in NOWHERE}
    if options.elsewhere:
        left |= {name for name, reason in never.items() if runs_elsewhere(reason)}
    bad = sorted(never.keys() - left)
    for name in bad:
        print(f"skipped in every job: {name}: {never[name]}")
    if bad:
        raise SystemExit(f"error: {len(bad)} tests were skipped in every job")
    print(f"{len(ran)} tests and modules ran; {len(left)} are left to jobs with more packages or hardware")


if __name__ == "__main__":
    main()
