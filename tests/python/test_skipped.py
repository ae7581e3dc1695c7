"""`.ci/skipped.py`: a run in which every job skips a test fails. Skipped tests counted as passed before."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from conftest import REPOSITORY

SCRIPT = REPOSITORY / ".ci/skipped.py"
RAN = "ran\ttests/python/test_a.py::test_one\t\n"
ABSENT = "skipped\ttests/python/test_b.py\tSkipped: could not import 'jax.numpy': No module named 'jax'\n"
PAGE = "skipped\ttests/python/test_docs.py::test_page[a.md]\tSkipped: not installed: torchrl, jax\n"
RUST = "skipped\trust::other_users::a_link\tonly root can give a link to another user\n"


def check(folder: Path, *jobs: str, options: tuple[str, ...] = ()) -> subprocess.CompletedProcess[str]:
    for index, text in enumerate(jobs):
        (folder / f"{index}.tsv").write_text(text)
    command = [sys.executable, str(SCRIPT), str(folder), *options]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_what_another_job_ran_is_not_skipped(tmp_path: Path) -> None:
    assert check(tmp_path, RAN + ABSENT, "ran\ttests/python/test_b.py::test_two\t\n").returncode == 0


def test_what_every_job_skipped_is_named(tmp_path: Path) -> None:
    done = check(tmp_path, RAN + RUST, ABSENT)
    assert done.returncode == 1
    assert "skipped in every job: rust::other_users::a_link: only root can" in done.stdout
    assert "error: 2 tests were skipped in every job" in done.stderr


def test_packages_of_other_jobs_excuse_what_only_needs_them(tmp_path: Path) -> None:
    assert check(tmp_path, RAN + ABSENT + PAGE, options=("--elsewhere",)).returncode == 0
    other = PAGE.replace("torchrl", "numpy").replace("jax", "something")
    done = check(tmp_path, RAN + other, options=("--elsewhere",))
    assert done.returncode == 1 and "not installed: numpy, something" in done.stdout


def test_no_notes_are_an_error(tmp_path: Path) -> None:
    assert "no test noted" in check(tmp_path).stderr
