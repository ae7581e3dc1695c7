"""The package as it is installed: that it is the one under test, and what importing it imports."""

from __future__ import annotations

import subprocess
import sys
import sysconfig
from importlib.metadata import version
from pathlib import Path

import smaclite_pool as sp


def test_the_installed_package_is_tested_and_not_the_source_tree() -> None:
    """A wheel that lacks a file would pass if its modules were found in a clone of the repository."""
    folders = {sysconfig.get_path("purelib"), sysconfig.get_path("platlib")}
    assert str(Path(sp.__file__).parents[1]) in folders
    assert version("smaclite-pool") == sp.__version__


def test_importing_the_package_imports_only_numpy() -> None:
    """Frameworks take seconds to import, and may not be installed."""
    code = (
        "import sys\n"
        "before = set(sys.modules)\n"
        "import smaclite_pool\n"
        "print(*{name.split('.')[0] for name in set(sys.modules) - before} - sys.stdlib_module_names)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert set(done.stdout.split()) == {"numpy", "smaclite_pool"}
