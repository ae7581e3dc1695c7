"""The package is strictly typed, and the stub and signatures of the native module match the module."""

from __future__ import annotations

import ast
import inspect
import subprocess
import sys
from pathlib import Path

import pytest
import smaclite_pool as sp

from conftest import REPOSITORY


def run(*command: str) -> subprocess.CompletedProcess[str]:
    argv = [sys.executable, "-m", *command]
    return subprocess.run(argv, capture_output=True, text=True, cwd=REPOSITORY, check=False)


def check(*command: str) -> None:
    done = run(*command)
    assert done.returncode == 0, done.stdout + done.stderr


def test_mypy_strict() -> None:
    check("mypy")


@pytest.mark.parametrize("system", ["darwin", "win32"])
def test_the_package_uses_nothing_that_another_system_lacks(system: str, tmp_path: Path) -> None:
    """By the modules of the standard library; without NumPy, whose types take mypy longer than all else."""
    settings = tmp_path / "mypy.ini"
    settings.write_text(
        "[mypy]\nignore_missing_imports = true\nfollow_imports = skip\n"
        "[mypy-numpy.*]\nfollow_imports = skip\nfollow_imports_for_stubs = true\n"
    )
    probe = tmp_path / "probe.py"  # uses what both systems lack, so that the test can fail
    probe.write_text("import os\nos.sched_getaffinity(0)\n")
    cache = str(tmp_path / "cache")  # what it knows of these types is of no use to others
    argv = ["mypy", "--platform", system, "--config-file", str(settings), "--cache-dir", cache]
    done = run(*argv, "bindings/python", str(probe))
    assert " source files)" in done.stdout, done.stdout + done.stderr
    missing = [line for line in done.stdout.splitlines() if "Module has no attribute" in line]
    assert len(missing) == 1 and probe.name in missing[0], missing


def test_the_stub_matches_the_module() -> None:
    check("mypy.stubtest", "smaclite_pool._native")


def test_the_defaults_in_the_signature_of_make_are_its_defaults() -> None:
    """Its text is written by hand, because PyO3 shows only literals; stubtest compares the stub with it."""
    parameters = inspect.signature(sp.make).parameters.values()
    defaults = {p.name: p.default for p in parameters if p.default is not p.empty}
    assert len(defaults) == 17 and defaults["num_envs"] == 64
    with sp.make("2s3z") as implicit, sp.make("2s3z", **defaults) as explicit:
        names = {name for name in dir(implicit.spec) if not name.startswith("_")} - {"pool", "seed"}
        for name in sorted(names):
            assert getattr(implicit.spec, name) == getattr(explicit.spec, name), name


def test_the_stub_declares_every_key_that_make_takes() -> None:
    """`make(**battle)` takes keys of scenario files; editors and type checkers have their names from here."""
    stub = ast.parse((Path(sp.__file__).parent / "_native.pyi").read_text())
    (battle,) = (node for node in stub.body if isinstance(node, ast.ClassDef) and node.name == "_Battle")
    declared = {ast.unparse(node.target) for node in battle.body if isinstance(node, ast.AnnAssign)}
    with pytest.raises(TypeError, match="expected one of") as unknown:
        sp.make("3m", colour=2)  # type: ignore[call-overload]
    accepted = set(str(unknown.value).split("expected one of ")[1].split(", "))
    assert declared == accepted - inspect.signature(sp.make).parameters.keys()


def test_the_stub_declares_every_field_with_its_type() -> None:
    """stubtest compares names only; types and texts come from the table of fields."""
    stub = (Path(sp.__file__).parent / "_native.pyi").read_text()
    properties = {name: value for name, value in vars(sp.Batch).items() if isinstance(value, property)}
    fields = [name for name, value in properties.items() if " [M" in str(value.__doc__)]
    assert len(fields) == 30
    for name in fields:
        text = getattr(sp.Batch, name).__doc__
        dtype, described = text.split(" ", 1)
        scalar = {"bool": "bool_"}.get(dtype, dtype)
        shape = described.split("]")[0]
        assert f'def {name}(self) -> NDArray[np.{scalar}]:\n        """{dtype} {shape}]: ' in stub, text


def test_everything_public_is_documented() -> None:
    for module in (sp, sp.errors, sp.extras):
        for name in module.__all__:
            if name != "__version__":
                assert getattr(module, name).__doc__, name
    for public in (sp.Envs, sp.Batch, sp.Frame):
        for name in dir(public):
            assert name.startswith("_") or getattr(public, name).__doc__, f"{public.__name__}.{name}"
