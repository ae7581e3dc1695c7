"""Exceptions of this package. All derive from `PoolError` and from a fitting built-in exception.

All can be pickled, and raised again from their class and message, as libraries do that pass them from one
process to another; attributes are then unknown.
"""

from __future__ import annotations

from collections.abc import Sequence

__all__ = [
    "Busy",
    "Closed",
    "ConnectError",
    "Forked",
    "IllegalAction",
    "InvalidRequest",
    "LaneFailed",
    "LaneTaken",
    "NoSuchPool",
    "PoolDied",
    "PoolError",
    "ScenarioError",
    "StartError",
    "Timeout",
    "TooLittleMemory",
    "TooManyBatchesHeld",
]


class PoolError(Exception):
    """Base class of all exceptions of this package."""


class InvalidRequest(PoolError, ValueError):
    """A setting, shape, environment id or request is invalid. The call had no effect."""


class IllegalAction(InvalidRequest):
    """An action is not available to its agent. No environment was stepped."""

    env: int
    """Id of the environment; -1 if unknown."""
    agent: int
    """Index of the agent in the environment; -1 if unknown."""
    action: int
    """The invalid action; -1 if unknown."""
    available: list[int]
    """The actions that are available to the agent, in ascending order; empty if unknown."""
    side: str
    """Whose the index `agent` is: "allies", or "enemies" for the index of an enemy."""

    def __init__(
        self,
        message: str,
        env: int = -1,
        agent: int = -1,
        action: int = -1,
        available: Sequence[int] = (),
        side: str = "allies",
    ) -> None:
        super().__init__(message)
        self.env, self.agent, self.action, self.available = env, agent, action, list(available)
        self.side = side

    def __reduce__(self) -> tuple[type[IllegalAction], tuple[str, int, int, int, list[int], str]]:
        return type(self), (str(self), self.env, self.agent, self.action, self.available, self.side)


class ScenarioError(PoolError, ValueError):
    """A scenario is unknown, or a scenario or unit file is invalid; the message names file, key and value."""


class StartError(PoolError, RuntimeError):
    """A pool could not start. Everything it had created is removed."""


class TooLittleMemory(PoolError, MemoryError):
    """/dev/shm has too little free space, or the system gives this process too little memory. The message
    says how much is needed, and what to do."""


class ConnectError(PoolError, ConnectionError):
    """Attaching to a pool, or requesting its status, failed."""


class NoSuchPool(ConnectError):
    """No pool of that name is running; the message lists the running pools."""


class LaneTaken(ConnectError):
    """The lane already has a learner."""

    learner_pid: int
    """Process id of that learner; 0 if unknown."""

    def __init__(self, message: str, learner_pid: int = 0) -> None:
        super().__init__(message)
        self.learner_pid = learner_pid

    def __reduce__(self) -> tuple[type[LaneTaken], tuple[str, int]]:
        return type(self), (str(self), self.learner_pid)


class PoolDied(PoolError, ConnectionError):
    """The pool's supervisor has ended. Held batches stay readable. Restart the pool and connect again."""


class LaneFailed(PoolError, RuntimeError):
    """An internal error stopped the lane. Other lanes of the pool continue."""


class Timeout(PoolError, TimeoutError):
    """No batch arrived in time. It is still being computed: `recv` it, or `reset` to discard it."""


class TooManyBatchesHeld(PoolError, RuntimeError):
    """`max_held_batches` batches are in use. Release one and all arrays over it, then call `recv` again."""


class Forked(PoolError, RuntimeError):
    """The environments belong to the parent process. After a fork, the child must connect itself."""


class Busy(PoolError, RuntimeError):
    """Another thread is using these environments."""


class Closed(PoolError, ValueError):
    """The environments are closed."""
