"""What users of a lane require of it, in one wording."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from difflib import get_close_matches
from functools import wraps
from typing import Any, TypeVar, cast

from ._native import Envs
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


def require_synchronous(envs: Envs | Wrapper, user: str, autoreset: str | None = None) -> None:
    """Check that batches have all environments and, if it is given, the autoreset mode.

    Args:
        envs: the environments of a lane.
        user: what requires it: the subject of the message, such as "TorchRL".
        autoreset: the mode it needs; None for any.

    Raises InvalidRequest.
    """
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
