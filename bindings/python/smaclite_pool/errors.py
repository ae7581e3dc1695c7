"""Exceptions, with one base class; each one is also a subclass of a matching built-in exception."""

from __future__ import annotations


class PoolError(Exception):
    """Base class of all exceptions of this package."""


class InvalidRequest(PoolError, ValueError):
    """An invalid setting, shape or environment, or a request at the wrong time. Nothing was done."""


class IllegalAction(InvalidRequest):
    """An action that is not available to its agent. No environment was stepped."""

    env: int
    """Index of the environment."""
    agent: int
    """Index of the agent in it."""
    action: int
    """The action that was given."""
    available: list[int]
    """The actions that are available to the agent."""

    def __init__(self, message: str, env: int, agent: int, action: int, available: list[int]) -> None:
        super().__init__(message)
        self.env, self.agent, self.action, self.available = env, agent, action, available

    def __reduce__(self) -> tuple[type[IllegalAction], tuple[str, int, int, int, list[int]]]:
        return type(self), (str(self), self.env, self.agent, self.action, self.available)


class ScenarioError(PoolError, ValueError):
    """An invalid scenario or unit file; the message names file, key, value and accepted values."""


class StartError(PoolError, RuntimeError):
    """A pool could not start; what it had created was removed."""


class TooLittleMemory(PoolError, MemoryError):
    """Not enough free space in /dev/shm; the message says how much is needed and how to provide it."""


class ConnectError(PoolError, ConnectionError):
    """A pool cannot be attached to, or does not answer."""


class NoSuchPool(ConnectError):
    """No pool of that name is running; the message lists the running ones."""


class LaneTaken(ConnectError):
    """The lane already has a learner."""

    holder: int
    """Process id of the learner."""

    def __init__(self, message: str, holder: int) -> None:
        super().__init__(message)
        self.holder = holder

    def __reduce__(self) -> tuple[type[LaneTaken], tuple[str, int]]:
        return type(self), (str(self), self.holder)


class PoolDied(PoolError, ConnectionError):
    """The supervisor ended. Batches that are held stay readable; connect again once it has restarted."""


class LaneFailed(PoolError, RuntimeError):
    """A worker panicked, and its lane has ended. Other lanes continue."""


class Timeout(PoolError, TimeoutError):
    """No batch arrived in time. It is still pending: call `recv` again, or `reset`."""


class TooManyBatchesHeld(PoolError, RuntimeError):
    """The learner holds `max_held_batches` batches. Release one and all its arrays, then `recv` again."""


class Forked(PoolError, RuntimeError):
    """The environments belong to the parent process; a forked child must open its own connection."""


class Busy(PoolError, RuntimeError):
    """Another thread is calling a method of these environments."""


class Closed(PoolError, ValueError):
    """The environments were closed."""
