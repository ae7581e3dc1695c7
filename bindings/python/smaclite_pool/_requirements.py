"""What is required of arguments, and what users of a lane require of it, in one wording."""

from __future__ import annotations

import inspect
import operator
from collections.abc import Callable, Iterable
from difflib import get_close_matches
from functools import wraps
from typing import Any, TypeVar, cast

from ._native import Envs
from ._spec import LaneSpec
from ._wrapper import Wrapper
from .errors import InvalidRequest

Function = TypeVar("Function", bound=Callable[..., Any])


def suggests_keywords(function: Function) -> Function:
    """`function`, whose error of an unknown keyword says which one is probably meant."""
    known = list(inspect.signature(function).parameters)

    @wraps(function)
    def checked(*args: Any, **keywords: Any) -> Any:
        for name in keywords:
            if name not in known:
                similar = get_close_matches(name, known, 1, 0.5)
                hint = f"did you mean '{similar[0]}'?" if similar else f"it has {', '.join(known)}"
                raise TypeError(f"{function.__name__}() got an unexpected keyword argument '{name}'; {hint}")
        return function(*args, **keywords)

    return cast(Function, checked)


def require_integer(name: str, value: Any, least: int | None = None) -> int:
    """The integer `value` of an argument, Python's or NumPy's; a float is none, even a whole one.

    Raises TypeError, or InvalidRequest if it is below `least`, in the words of the compiled module.
    """
    if isinstance(value, bool):
        raise TypeError(f"{name} must be an integer, got bool")
    try:
        number = operator.index(value)
    except TypeError as error:
        raise TypeError(f"{name} must be an integer, got {type(value).__name__}") from error
    if least is not None and number < least:
        bound = "not be negative" if least == 0 else f"be at least {least}"
        raise InvalidRequest(f"{name} must {bound}, got {number}")
    return number


def require_environments(envs: Any) -> None:
    """Raises TypeError unless these are environments of a lane, or a wrapper of them."""
    if not isinstance(getattr(envs, "spec", None), LaneSpec):
        raise TypeError(f"envs must be environments or a wrapper of them, got {type(envs).__name__}")


def require_synchronous(envs: Envs | Wrapper, user: str, autoreset: str | None = None) -> None:
    """Check that batches have all environments and, if it is given, the autoreset mode.

    Args:
        envs: the environments of a lane.
        user: what requires it: the subject of the message, such as "TorchRL".
        autoreset: the mode it needs; None for any.

    Raises InvalidRequest, or TypeError if they are no environments.
    """
    require_environments(envs)
    spec = envs.spec
    if spec.batch_size != spec.num_envs:
        raise InvalidRequest(
            f"{user} needs batches of all environments: batch_size must be num_envs={spec.num_envs}, "
            f"got {spec.batch_size}, which is asynchronous (`serve` without --batch-size)"
        )
    if autoreset is not None and spec.autoreset_mode != autoreset:
        raise InvalidRequest(
            f"{user} needs another autoreset mode: autoreset_mode must be {autoreset!r}, "
            f"got {spec.autoreset_mode!r} (`serve` with --autoreset-mode {autoreset})"
        )


def require_names(name: str, value: Any) -> list[str]:
    """A list of strings, as `make` reads its `fields`. A string is no list of its letters."""
    names = [*value] if isinstance(value, Iterable) and not isinstance(value, str) else None
    if names is None:
        raise TypeError(f'{name} must be a list of strings, such as ["obs"], got {type(value).__name__}')
    for each in names:
        if not isinstance(each, str):
            raise TypeError(
                f'{name} must be a list of strings, such as ["obs"], got {type(each).__name__} in it'
            )
    return names
