"""What can go wrong, under one base class; each is also the built-in that fits it."""

from __future__ import annotations


class PoolError(Exception):
    """Base of every error of this package."""


class InvalidRequest(PoolError, ValueError):
    """A value that cannot be: a setting, a shape, an environment, a request out of turn. Nothing was done."""


class IllegalAction(InvalidRequest):
    """An action that is not available to its agent. Nothing was stepped, in no environment."""

    env: int
    """The environment."""
    agent: int
    """The agent in it."""
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
    """A scenario or unit file that is wrong; the message names file, key, value and what would be right."""


class StartError(PoolError, RuntimeError):
    """A pool could not start. Nothing of it is left."""


class TooLittleMemory(PoolError, MemoryError):
    """/dev/shm has too little room; the message says how much is needed and how to get it."""


class ConnectError(PoolError, ConnectionError):
    """A pool could not be attached to or asked."""


class NoSuchPool(ConnectError):
    """No pool of that name runs; the message names those that do."""


class LaneTaken(ConnectError):
    """The lane has a learner already."""

    holder: int
    """The learner's process."""

    def __init__(self, message: str, holder: int) -> None:
        super().__init__(message)
        self.holder = holder

    def __reduce__(self) -> tuple[type[LaneTaken], tuple[str, int]]:
        return type(self), (str(self), self.holder)


class PoolDied(PoolError, ConnectionError):
    """The supervisor is gone. Batches that are held stay readable; connect anew once it is back."""


class LaneFailed(PoolError, RuntimeError):
    """A worker failed inside; the lane serves no more. Other lanes go on."""


class Timeout(PoolError, TimeoutError):
    """Nothing came in time. The batch is still under way: `recv` it, or `reset`."""


class TooManyBatchesHeld(PoolError, RuntimeError):
    """As many batches are held as the lane allows. Drop one and every array over it, then `recv` again."""


class Forked(PoolError, RuntimeError):
    """The environments belong to the process that attached; after a fork the child connects by itself."""


class Busy(PoolError, RuntimeError):
    """Another thread is in a call of these environments."""


class Closed(PoolError, ValueError):
    """The environments were closed."""
