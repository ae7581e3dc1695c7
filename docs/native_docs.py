"""Docstrings for the site: those of the native module, whose stub has only types, and examples in colour."""

from __future__ import annotations

import ast
import inspect
import re
from operator import attrgetter
from typing import Any

import griffe
import smaclite_pool._native

PARSER_OPTIONS = {"warn_unknown_params": False, "warn_missing_types": False}
"""As in mkdocs.yml, which holds for the docstrings that griffe finds by itself."""


class NativeDocs(griffe.Extension):
    """Gives every public object of `smaclite_pool._native` the docstring that `help()` shows."""

    def on_package(self, *, pkg: griffe.Module, **_: Any) -> None:
        """Called by griffe after it has read a package."""
        if pkg.path == "smaclite_pool":
            native = pkg["_native"]
            join_overloads(native)
            describe(native, smaclite_pool._native.__name__)
            missing = set(smaclite_pool.__all__) & set(dir(smaclite_pool._native)) - set(native.members)
            if missing:
                raise ValueError(f"not in the reference: {', '.join(sorted(missing))}")
            colour(pkg)


def join_overloads(module: griffe.Module) -> None:
    """Makes one function of several overloads: a stub has no other function of that name."""
    for name, overloads in module.overloads.items():
        parameters = {parameter.name: parameter for each in overloads for parameter in each.parameters}
        for parameter in parameters.values():
            variants = [each.parameters[parameter.name] for each in reversed(overloads)]
            parameter.annotation = " | ".join(dict.fromkeys(str(each.annotation) for each in variants))
            parameter.default = next((each.default for each in variants if each.default is not None), None)
        returns = " | ".join(dict.fromkeys(str(each.returns) for each in overloads))
        joined = griffe.Function(name, parameters=griffe.Parameters(*parameters.values()), returns=returns)
        module.set_member(name, joined)


def describe(parent: griffe.Module | griffe.Class, path: str) -> None:
    for name, member in parent.members.items():
        if name.startswith("_") or member.is_alias:
            continue
        text = inspect.getdoc(attrgetter(member.path.removeprefix(path + "."))(smaclite_pool._native))
        # A constant has only the docstring of its type.
        if text and (not member.is_attribute or member.has_labels("property")):
            member.docstring = griffe.Docstring(
                text, parent=member, parser="google", parser_options=PARSER_OPTIONS
            )
        if isinstance(member, griffe.Class):
            describe(member, path)


def colour(parent: griffe.Object) -> None:
    """Fences the indented examples of all docstrings, so that the site knows their language."""
    if parent.docstring:
        parent.docstring.value = fenced(parent.docstring.value)
    for member in parent.members.values():
        if not member.is_alias:
            colour(member)


def fenced(docstring: str) -> str:
    """The docstring with fences around its indented blocks, which follow an empty line."""

    def fence(found: re.Match[str]) -> str:
        code = inspect.cleandoc(found[1])
        return f"\n\n```{'python' if is_python(code) else 'sh'}\n{code}\n```\n"

    return re.sub(r"\n\n((?: {4}.*(?:\n|$)|\n(?= {4}))+)", fence, docstring)


def is_python(code: str) -> bool:
    try:
        ast.parse(code)
    except SyntaxError:
        return False
    return True
