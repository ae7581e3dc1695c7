"""Runs the code of the documentation, page by page from top to bottom, and the examples of docstrings.

A page is a session: its blocks share a folder, files that it names are written, and a pool that it starts
runs until the page ends. What cannot be run here is in `NOT_RUN`, with the reason. Blocks whose framework is
not installed are skipped, as the frameworks cannot share one environment.

Trainings are made shorter. With `SMACLITE_WHOLE_TRAININGS` set (`just test-trainings`, every night) those of
pages that show a win rate are not, and that must be what they give: another default changes it.
"""

from __future__ import annotations

import ast
import json
import os
import re
import shlex
import shutil
import stat
import subprocess
import sys
import tempfile
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PACKAGE = ROOT / "bindings/python/smaclite_pool"
PAGES = sorted(DOCS.rglob("*.md"))

FRAMEWORKS = {"gymnasium", "pettingzoo", "safetensors", "torch", "torchrl", "tensordict", "jax", "ray"}
FRAMEWORKS |= {"wandb", "tree"}  # RLlib requires `tree`, which the extra `ray` does not install

CLONE = "builds in a clone of the repository"
DOCKER = "needs Docker and an image"
INSTALLS = "installs packages"
SERVES = "serves a page until Ctrl-C; test_watch.py, test_editor.py and test_play.py run it"
OTHER_CODE = "needs another code base"
FRAGMENT = "a fragment, whose names are explained around it"

NOT_RUN: dict[str, dict[str, str]] = {
    "concepts/fidelity.md": {"export SMACLITE_PYTHON": "needs the published environment"},
    "frameworks/epymarl.md": {
        "python -m smaclite_pool.compat": OTHER_CODE,
        "git clone": OTHER_CODE,
        "python -m smaclite_pool.examples": OTHER_CODE,
    },
    "frameworks/smacv2.md": {
        "python -m smaclite_pool.compat": OTHER_CODE,
        "cd examples": OTHER_CODE,
        "scenario_args": OTHER_CODE,
    },
    "frameworks/index.md": {"+from smaclite_pool": OTHER_CODE},
    "how-to/datasets.md": {
        "smaclite-pool train": "needs a run that wins; test_dataset.py and the tests of the program record",
        "python -m": "needs the dataset above; test_dataset.py runs it",
        "smaclite-pool dataset export": "needs the dataset above; test_dataset.py runs it",
    },
    "how-to/operating.md": {
        "[Unit]": "needs systemd",
        "systemctl": "needs systemd",
        "SMACLITE_POOL_ROOT": "needs the service above",
        "docker build": DOCKER,
        "docker run --rm": DOCKER,
        "docker run -d": DOCKER,
        "docker compose": DOCKER,
        "sbatch": "needs a cluster",
        "ray start": "needs a cluster",
        "python -m": "test_ray.py runs the program",
    },
    "how-to/pytorch-learners.md": {
        "pip install": INSTALLS,
        "smaclite-pool train 2s3z --steps 1 ": "needs the weights of the run before, which is not run",
    },
    "how-to/training.md": {"export SMACLITE_PYTHON": "needs the published environment"},
    "playground.md": {
        "smaclite-pool play": SERVES,
        "smaclite-pool replay": "needs a battle that a person played; test_play.py has one",
        "smaclite-pool edit": SERVES,
    },
    "reference/policies.md": {
        "let mut policy": "an excerpt; the documentation of the crate has a test",
        "just figures": CLONE,
    },
    "reference/rust.md": {"just docs": CLONE, "[dependencies]": "a project that builds all crates again"},
    "results.md": {
        "just results-train": "trains for hours",
        "just results-search": CLONE,
        "just figures": CLONE,
    },
    "tutorials/installation.md": {
        "pip install dist": INSTALLS,
        "python3 -m venv": INSTALLS,
        "pip install '.[": INSTALLS,
    },
    "tutorials/watching.md": {
        "smaclite-pool watch": SERVES,
        "ssh": "needs another machine",
        "smaclite-pool record --pool": "follows a learner that plays; test_recorder.py runs it",
    },
    # Docstrings, by module.
    "_agent_view.py": {
        "views = ": FRAGMENT,
        "def attack_nearest": FRAGMENT,
        "result = ": FRAGMENT,
    },
    "_entities.py": {"entities = ": FRAGMENT},
    "_evaluation.py": {"result = ": FRAGMENT},
    "_rollout.py": {"rollout = ": FRAGMENT},
    "_team.py": {
        "import smaclite_pool as sp\n\nteam = sp.load_team": "needs a trained team; test_team.py has one"
    },
    "_wrapper.py": {"class Scaled": FRAGMENT},
    "examples/__init__.py": {"python -m": "tests of each run it"},
    "examples/behaviour_cloning.py": {"smaclite-pool dataset": "test_dataset.py runs it"},
    "examples/epymarl_speed.py": {"python -m": OTHER_CODE},
    "examples/ray_rollouts.py": {"python -m": "test_ray.py runs it"},
    "compat/__init__.py": {
        "python -m smaclite_pool.compat src": OTHER_CODE,
        "python -m smaclite_pool.compat --ep": OTHER_CODE,
    },
    "integrations/minari.py": {
        "smaclite-pool dataset": "test_dataset.py runs it",
        "import os": "needs the dataset above; test_dataset.py reads one",
    },
    "integrations/vault.py": {
        "smaclite-pool dataset": "test_dataset.py runs it",
        "from flashbax": "needs the vault above; test_dataset.py reads one",
    },
    "integrations/torch.py": {"envs = sp.connect": "needs a GPU"},
    "marl/epymarl.py": {"from smaclite_pool.marl.epymarl import PoolRunner; REG": OTHER_CODE},
    "marl/smac/__init__.py": {"python -m": OTHER_CODE},
    "marl/smacv2/__init__.py": {"python -m": OTHER_CODE},
}
"""The beginnings of blocks that are not run, by page, and why."""

BEFORE = {
    "how-to/training.md": "smaclite-pool train 2s3z --steps 500000 --out runs/2s3z",
    "how-to/pictures.md": "smaclite-pool new scenario my_scenario.json",
}
"""Commands whose results a page takes for granted."""

SHORTER = {
    r"--steps \d+": "--steps 5000",
    r"\bsteps=\d[\d_]*": "steps=5000",
    r"(examples\.planning \w+)": r"\1 --steps 20000",
    r"--seeds \d+": "--seeds 2",
    r"--threads 16": "--threads 2",
    r"--seconds \d": "--seconds 0.2",
}
"""Commands and code are run with fewer steps and seeds of training than on the page."""

WHOLE_TRAININGS = "SMACLITE_WHOLE_TRAININGS" in os.environ

OTHER_PROCESSOR = 10.0
"""How far a win rate in percent may be from that of a page: a team learns otherwise on another processor."""


class Block(NamedTuple):
    language: str
    code: str
    file: str
    """The name in the line before the block, as in "`sniper.json`:", or empty."""

    @property
    def is_output(self) -> bool:
        """What a program prints, not code."""
        return self.language == "text" or self.language.startswith("{ .text")

    @property
    def is_printed(self) -> bool:
        """What the block before prints: everywhere the same (`.printed`), or with other numbers (`.like`)."""
        return ".printed" in self.language or ".like" in self.language


def place(page: Path) -> str:
    return str(page.relative_to(DOCS))


def blocks(text: str) -> list[Block]:
    """The fenced blocks of a page."""
    pattern = r"^(?P<indent> *)```([^\n`]*)\n(.*?)^(?P=indent)```$"
    found = []
    for match in re.finditer(pattern, text, re.M | re.S):
        name = re.search(r"`(\w+\.\w+)`[^\n]*\n\n\Z", text[: match.start()])
        found.append(Block(match[2].strip(), textwrap.dedent(match[3]), name[1] if name else ""))
    return found


def without_numbers(text: str) -> str:
    """Tables without the widths of their columns, and battles without their outcome."""
    numbers, outcomes = r"\d[\d,.:]*|(?<= )-(?= )", r"\b(won|lost|truncated)\b"
    text = re.sub(r"\[ +", "[", text)  # NumPy aligns the numbers of an array
    return re.sub(r" +", " ", re.sub(outcomes, "", re.sub(numbers, "0", text)))


def is_shown(shown: str, printed: str) -> bool:
    """Whether a block shows all that was printed; a line `...` stands for any lines."""
    lines = re.split(r"^\.\.\.\n", shown, flags=re.M)
    return re.fullmatch("(?:.*\n)*?".join(map(re.escape, lines)), printed) is not None


def win_rates(text: str) -> list[float]:
    return [float(number) for number in re.findall(r"([\d.]+) %", text)]


def shorter(code: str) -> str:
    if WHOLE_TRAININGS:
        return code
    for pattern, short in SHORTER.items():
        code = re.sub(pattern, short, code)
    return code


def reason(where: str, code: str) -> str | None:
    """Why a block of a page or module is not run."""
    return next((why for start, why in NOT_RUN.get(where, {}).items() if code.startswith(start)), None)


class Session:
    """A folder with the program, in which the blocks of a page run."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.servers: list[subprocess.Popen[str]] = []
        self.missing: set[str] = set()
        self.printed = ""
        commands = folder / "bin"
        commands.mkdir()
        python = shlex.quote(sys.executable)
        for name, command in {"smaclite-pool": f"{python} -m smaclite_pool", "python": python}.items():
            (commands / name).write_text(f'#!/bin/sh\nexec {command} "$@"\n')
            (commands / name).chmod(stat.S_IRWXU)
        (folder / ".venv/bin").mkdir(parents=True)
        (folder / ".venv/bin/activate").touch()
        self.environment = {
            **os.environ,
            "PATH": f"{commands}:{os.environ['PATH']}",
            "SMACLITE_POOL_ROOT": str(folder / "pools"),
            "SLURM_JOB_ID": f"test-{os.getpid()}",
            "SLURM_ARRAY_TASK_ID": "1",
            "WANDB_MODE": "offline",
        }

    def run(self, block: Block) -> None:
        """Runs a block, checks that it is what the block before printed, or that it is data of its kind."""
        code = block.code
        if block.is_printed:
            change = str if ".printed" in block.language else without_numbers
            same = is_shown(change(code), change(self.printed))
            if WHOLE_TRAININGS:
                rates = win_rates(self.printed)[: len(win_rates(code))]
                same = same and win_rates(code) == pytest.approx(rates, abs=OTHER_PROCESSOR)
            assert self.missing or same, f"shown:\n{code}\nprinted:\n{self.printed}"
        elif block.language == "python" and block.file.endswith(".py"):
            (self.folder / block.file).write_text(code)  # a command of the page runs it
        elif block.language == "python":
            code = shorter(code)
            self.execute([sys.executable, "-c", code], code)
        elif block.language == "sh" and code.startswith("smaclite-pool serve"):
            self.serve(code)
        elif block.language == "sh":
            code = shorter(code)
            self.execute(["bash", "-euo", "pipefail", "-c", code], code)
        elif block.language == "json":
            json.loads(code)
            if block.file:
                (self.folder / block.file).write_text(code)
        else:
            pytest.fail(f"a block in `{block.language}` cannot be run; add it to NOT_RUN:\n{code}")

    def serve(self, code: str) -> None:
        """Starts a pool that runs until the page ends."""
        argv = ["bash", "-c", f"exec {code}"]
        pool = subprocess.Popen(
            argv, env=self.environment, cwd=self.folder, stdout=subprocess.PIPE, text=True
        )
        self.servers.append(pool)
        assert pool.stdout is not None
        assert any("smaclite_pool.connect" in line for line in pool.stdout), f"no pool started:\n{code}"

    def execute(self, argv: list[str], code: str) -> None:
        done = subprocess.run(
            argv,
            env=self.environment,
            cwd=self.folder,
            capture_output=True,
            text=True,
            timeout=1800 if WHOLE_TRAININGS else 180,
        )
        missing = re.search(r"ModuleNotFoundError: No module named '(\w+)", done.stderr)
        if missing and missing[1] in FRAMEWORKS:
            self.missing.add(missing[1])
        else:
            assert done.returncode == 0, f"{code}\n{done.stdout}\n{done.stderr}"
            self.printed = done.stdout

    def end(self) -> None:
        for pool in self.servers:
            pool.terminate()
            assert pool.wait(timeout=10) == 0
        # Tensors that live when their interpreter ends leave their shared memory.
        self.execute(["smaclite-pool", "clean"], "smaclite-pool clean")
        # The root folder of a page's Slurm jobs.
        shutil.rmtree(f"/tmp/smaclite-{self.environment['SLURM_JOB_ID']}", ignore_errors=True)


@pytest.fixture
def session() -> Iterator[Session]:
    """A folder for pools; its path is short, as it contains sockets."""
    with tempfile.TemporaryDirectory(prefix="docs-") as folder:
        session = Session(Path(folder))
        try:
            yield session
        finally:
            session.end()


def runnable(page: Path) -> list[Block]:
    """The blocks of a page that are run, and what they print; other `text` is output of another kind."""
    found = [block for block in blocks(page.read_text()) if block.is_printed or not block.is_output]
    return [block for block in found if not reason(place(page), block.code)]


def is_tested(page: Path) -> bool:
    if WHOLE_TRAININGS:
        return any(".like" in block.language and win_rates(block.code) for block in runnable(page))
    return bool(runnable(page))


@pytest.mark.parametrize("place", [place(page) for page in PAGES if is_tested(page)])
def test_page(place: str, session: Session) -> None:
    if before := BEFORE.get(place):
        session.run(Block("sh", before, ""))
    for block in runnable(DOCS / place):
        session.run(block)
    if session.missing:
        pytest.skip(f"not installed: {', '.join(sorted(session.missing))}")


@pytest.mark.parametrize(
    "place", [place(page) for page in PAGES if "until smaclite-pool" in page.read_text()]
)
def test_a_script_that_waits_for_its_pool_ends_without_it(place: str, session: Session) -> None:
    """It waited for a pool that could not start until the job's time was over."""
    [block] = [block for block in runnable(DOCS / place) if "until smaclite-pool" in block.code]
    # Sockets have short paths, so there is no pool.
    code = re.sub(r"(?<=SMACLITE_POOL_ROOT=).*", f"{session.folder}/{'x' * 100}", block.code)
    argv = ["bash", "-c", code]
    done = subprocess.run(argv, env=session.environment, cwd=session.folder, capture_output=True, timeout=30)
    assert done.returncode == 1 and b"at most 60 bytes long" in done.stderr, done.stderr


def docstrings(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            yield ast.get_docstring(node) or ""


def indented(docstring: str) -> list[str]:
    """The indented blocks of a docstring."""
    found = re.findall(r"\n\n((?: {4}.*\n|\n(?= {4}))+)", docstring + "\n")
    return [textwrap.dedent(block) for block in found]


def examples() -> Iterator[tuple[str, str]]:
    """Module and code of the examples in docstrings. Those of the native module are in no file."""
    for module in sorted(PACKAGE.rglob("*.py")):
        for docstring in docstrings(ast.parse(module.read_text())):
            for code in indented(docstring):
                yield str(module.relative_to(PACKAGE)), code


RUN_EXAMPLES = [(module, code) for module, code in examples() if not reason(module, code)]


@pytest.mark.parametrize(("module", "code"), RUN_EXAMPLES, ids=[module for module, _ in RUN_EXAMPLES])
def test_docstring(module: str, code: str, session: Session) -> None:
    session.run(Block("sh" if code.startswith("python -") else "python", code, ""))
    if session.missing:
        pytest.skip(f"not installed: {', '.join(sorted(session.missing))}")


def test_what_is_not_run_is_there() -> None:
    there = {(place(page), block.code) for page in PAGES for block in blocks(page.read_text())}
    there |= set(examples())
    stale = [
        (where, start)
        for where, starts in NOT_RUN.items()
        for start in starts
        if not any(there_is == where and code.startswith(start) for there_is, code in there)
    ]
    assert not stale


def test_quoted_sizes_of_pools_are_those_that_serve_prints(session: Session) -> None:
    page = (DOCS / "concepts/batches.md").read_text()
    sizes = re.findall(r"(\w+) with (\d+) environments (?:needs )?([\d.]+) MB", " ".join(page.split()))
    assert len(sizes) == 3
    for scenario, num_envs, megabytes in sizes:
        if float(megabytes) < 50:  # containers have 64
            argv = ["smaclite-pool", "serve", f"{scenario}:{num_envs}", "--threads", "1", "--name", num_envs]
            with subprocess.Popen(argv, env=session.environment, stdout=subprocess.PIPE, text=True) as pool:
                assert pool.stdout is not None
                try:
                    assert f" {megabytes} MB of shared memory" in pool.stdout.readline()
                finally:
                    pool.terminate()
