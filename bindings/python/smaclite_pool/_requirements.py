"""What users of a lane require of it, in one wording."""

from __future__ import annotations

from ._native import Envs
from ._wrapper import Wrapper
from .errors import InvalidRequest


def require_synchronous(envs: Envs | Wrapper, user: str, autoreset: str | None = None) -> None:
    """Check that batches have all environments and, if it is given, the autoreset mode.

    Args:
        envs: the environments of a lane.
        user: what requires it: the subject of the message, such as "TorchRL".
        autoreset: the mode it needs; None for any.

    Raises InvalidRequest.
    """
    if envs.batch_size != envs.num_envs:
        raise InvalidRequest(
            f"{user} needs batches of all environments: batch_size must be num_envs={envs.num_envs}, "
            f"got {envs.batch_size}, which is asynchronous (`serve` without --batch-size)"
        )
    if autoreset is not None and envs.autoreset != autoreset:
        raise InvalidRequest(
            f"{user} needs another autoreset mode: autoreset must be {autoreset!r}, got {envs.autoreset!r} "
            f"(`serve` with --autoreset {autoreset})"
        )
