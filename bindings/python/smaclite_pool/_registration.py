"""Gymnasium's ids of this package, known as soon as Gymnasium is: `import smaclite_pool` alone does not import it."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType

from ._native import scenarios

REGISTRY = "gymnasium.envs.registration"
FACE = "smaclite_pool.gymnasium"


def register() -> None:
    """Make Gymnasium know `smaclite_pool/<scenario>-v0` and `smaclite_pool/custom-v0`; a second time does nothing."""
    registry = importlib.import_module(REGISTRY)
    battles: dict[str, dict[str, str]] = {name: {"scenario": name} for name in scenarios()}
    for name, kwargs in {**battles, "custom": {}}.items():
        id = f"smaclite_pool/{name}-v0"
        if id not in registry.registry:
            one, many = f"{FACE}:BattleEnv", f"{FACE}:make_vector"
            registry.register(id, entry_point=one, vector_entry_point=many, kwargs=kwargs)


def register_when_imported() -> None:
    """`register` now if Gymnasium is imported already, else when it is."""
    if REGISTRY in sys.modules:
        register()
    else:
        sys.meta_path.insert(0, Watch())


class Watch:
    """Sees imports go by until Gymnasium's registry does, and registers after it."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """The registry's own spec with `register` at the end of its execution; None for every other module."""
        if name != REGISTRY:
            return None
        sys.meta_path.remove(self)
        spec = importlib.util.find_spec(name)
        if spec is None or spec.loader is None:
            return spec
        execute = spec.loader.exec_module

        def execute_and_register(module: ModuleType) -> None:
            execute(module)
            register()

        spec.loader.exec_module = execute_and_register  # type: ignore[method-assign]
        return spec
