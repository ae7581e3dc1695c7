"""Docstrings of the native module for the site: the stub has its types, the built module its docstrings."""

from __future__ import annotations

import inspect
from operator import attrgetter
from typing import Any

import griffe
import smaclite_pool._native


class NativeDocs(griffe.Extension):
    """Gives every public object of `smaclite_pool._native` the docstring that `help()` shows."""

    def on_package(self, *, pkg: griffe.Module, **_: Any) -> None:
        """Called by griffe after it has read a package."""
        if pkg.path == "smaclite_pool":
            describe(pkg["_native"], smaclite_pool._native.__name__)


def describe(parent: griffe.Module | griffe.Class, path: str) -> None:
    for name, member in parent.members.items():
        if name.startswith("_") or member.is_alias:
            continue
        text = inspect.getdoc(attrgetter(member.path.removeprefix(path + "."))(smaclite_pool._native))
        # A constant has only the docstring of its type.
        if text and (not member.is_attribute or member.has_labels("property")):
            member.docstring = griffe.Docstring(text, parent=member, parser="google")
        if isinstance(member, griffe.Class):
            describe(member, path)
