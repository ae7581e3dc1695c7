"""Several machines with Ray: a pool on every node, read in place by the actors of that node (extra `ray`).

    import ray
    from smaclite_pool.ray import attach, start

    @ray.remote
    class Rollout:
        def __init__(self):
            self.lane = attach()                        # a free lane of this node's pool
            self.batch = self.lane.envs.reset(seed=self.lane.seed)

        def collect(self, steps):                       # shared memory only; Ray sees what it returns
            rewards = 0.0
            for _ in range(steps):
                self.batch = self.lane.envs.step(self.lane.envs.sample_actions())
                rewards += float(self.batch.reward.sum())
            return rewards

    ray.init()
    with start("2s3z", num_envs=64) as fleet:
        rollouts = fleet.spawn(Rollout)                 # one actor a lane, each on the node of its pool
        print(ray.get([rollout.collect.remote(100) for rollout in rollouts]))

An actor a node, named after Ray's id of the node, starts the pool and watches it: it costs no CPU, and no
step passes through it. When a pool dies it is started again, with empty lanes: a rollout actor gets PoolDied,
calls `lane.reattach()` and resets. The pause before each start doubles while starts fail, up to 30 s; after
ten failures in a row there is no further one, and `running` raises StartError with the pool's last words.
When the driver ends, so do actors and pools. `bindings/examples/ray_rollouts.py` trains by PPO this way.

Sizing. Give every lane an actor, and a node as many worker threads (`threads`) as it has cores less its lanes: learner
and workers take turns at a batch, so one lane of many environments is better than several small ones unless the
policy's own work keeps a core busy. Environments beyond some thousand steps a batch buy little. Tell Ray of the worker
threads' cores by starting the node with fewer `--num-cpus`. Every node needs /dev/shm for its frames
(`smaclite-pool status` tells how much; Ray's object store takes its share there too), and this package, the scenario's
files and SMACLITE_POOL_ROOT, if set, must be the same for all processes of a node. Send weights once an update with
`ray.put`, and return whole rollouts: an array of 450 KB costs milliseconds through Ray and microseconds in place.
"""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Any

import ray
from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

from ._native import Envs, connect, status
from .errors import ConnectError, LaneTaken, NoSuchPool, PoolDied, PoolError, StartError

__all__ = ["Fleet", "Lane", "Supervisor", "attach", "on", "start"]

LOOK_AGAIN = 0.05
"""Seconds between looks at something that is awaited."""

HOPELESS = 3
"""Starts in a row that failed, after which callers are told that the pool does not run."""

MAX_FAILURES = 10
"""Starts in a row that failed, after which the pool is not started again."""

LONGEST_PAUSE = 30.0
"""Seconds between two starts at most: the pause is LOOK_AGAIN at first and doubles with each failure."""

HEALTHY = 10.0
"""Seconds of life after which a pool that ends counts as one that had started."""

LAST_WORDS = 4096
"""Bytes of a pool's messages that are kept, the last ones."""

TIME_TO_STOP = 10.0
"""Seconds a pool has to end cleanly before it is killed."""

GONE = ray.exceptions.ActorUnschedulableError
"""What an actor that is tied to a node says when the node has left the cluster."""

# The kernel ends the pool with the thread that started it, so a killed actor leaves none behind.
PROGRAM = """
import ctypes, signal, sys
ctypes.CDLL(None).prctl(1, signal.SIGTERM)  # PR_SET_PDEATHSIG
from smaclite_pool.__main__ import main
sys.exit(main())
"""


def on(node: str) -> NodeAffinitySchedulingStrategy:
    """Schedules an actor on the node with this id of Ray's, or not at all."""
    return NodeAffinitySchedulingStrategy(node, soft=False)


def actor_name(fleet: str, node: str) -> str:
    """The name of the actor that watches the node's pool."""
    return f"smaclite_pool.{fleet}.{node}"


@dataclass(frozen=True)
class Running:
    """A pool that answers."""

    pool: str
    """Its name, which has the node's id: several nodes may share a machine."""
    pid: int
    """Its process."""
    generation: int
    """How many pools its actor has started by then."""
    seeds: dict[str, int]
    """A seed for each lane, such that no two environments of the fleet have the same."""


class Supervisor:
    """What runs in a node's named actor: it starts the node's pool and starts it again whenever it dies."""

    def __init__(self, fleet: str, arguments: Sequence[str], seeds: dict[str, int]) -> None:
        node = ray.get_runtime_context().get_node_id()
        self._pool = f"{fleet}-{node[:16]}"  # a pool's name has 40 characters at most
        self._command = [sys.executable, "-c", PROGRAM, "serve", *arguments, "--name", self._pool]
        self._seeds = seeds
        self._begin()

    def _begin(self) -> None:
        self._child: subprocess.Popen[bytes] | None = None
        self._generation = 0
        self._failures = 0  # in a row
        self._last_words = ""
        self._stopped = threading.Event()
        self._watch = threading.Thread(target=self._keep_running, daemon=True)
        self._watch.start()

    def _keep_running(self) -> None:
        while not self._stopped.is_set() and self._failures < MAX_FAILURES:
            begin = time.monotonic()
            try:
                told = self._run_once()
            except OSError as error:  # no memory or file for another process
                told = str(error)
            if time.monotonic() - begin >= HEALTHY:
                self._failures = 0
            self._failures, self._last_words = self._failures + 1, told
            self._stopped.wait(min(LOOK_AGAIN * 2 ** (self._failures - 1), LONGEST_PAUSE))

    def _run_once(self) -> str:
        """Starts the pool, waits for its end and returns its last words."""
        child = subprocess.Popen(self._command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, bufsize=0)
        self._child, self._generation = child, self._generation + 1
        if self._stopped.is_set():
            child.terminate()  # `stop` may not have seen it
        tail = b""
        assert child.stderr is not None
        with child.stderr as told:
            while some := told.read(LAST_WORDS):
                tail = (tail + some)[-LAST_WORDS:]
        code = child.wait()
        return tail.decode(errors="replace").strip() or f"the pool ended with {code}"

    def running(self, timeout: float = 60.0) -> Running:
        """The node's pool, once it answers. Raises StartError if it cannot start or does not answer in time."""
        end = time.monotonic() + timeout
        while True:
            generation, pid = self._generation, self._answering(max(end - time.monotonic(), LOOK_AGAIN))
            if pid is not None and self._child is not None and pid == self._child.pid:
                self._failures = 0
                return Running(self._pool, pid, generation, self._seeds)
            if time.monotonic() >= end or self._failures >= HOPELESS:
                break
            time.sleep(LOOK_AGAIN)
        why = self._last_words if self._failures else f"it did not answer within {timeout:g} s"
        given_up = f" (given up after {MAX_FAILURES} starts)" if self._failures >= MAX_FAILURES else ""
        raise StartError(f"pool `{self._pool}` does not run{given_up}: {why}")

    def _answering(self, timeout: float) -> int | None:
        try:
            return int(status(self._pool, timeout=timeout)["pid"])
        except PoolError:
            return None

    def status(self) -> dict[str, Any]:
        """What the node's pool is doing, as `smaclite_pool.status` says it."""
        return status(self._pool)

    def stop(self) -> None:
        """Ends the pool for good."""
        self._stopped.set()
        if self._child is not None:
            self._child.terminate()
        self._watch.join(TIME_TO_STOP)
        if self._watch.is_alive() and self._child is not None:
            self._child.kill()
            self._watch.join()


class Fleet:
    """The pools of a cluster. Ends them at the end of a `with` block, or by `stop`."""

    def __init__(self, name: str, lanes: int, supervisors: dict[str, Any]) -> None:
        self.name = name
        self.lanes = lanes
        self.supervisors = supervisors
        """The actor of each node, by Ray's id of the node."""

    def running(self, timeout: float = 60.0) -> dict[str, Running]:
        """The pool of each node, once all answer; nodes that left are left out. Raises StartError."""
        return _of_each({node: actor.running.remote(timeout) for node, actor in self.supervisors.items()})

    def spawn(self, actor_class: Any, *args: Any, **kwargs: Any) -> list[Any]:
        """Makes an actor of a `@ray.remote` class for every lane, on the node of its pool; node by node, a list."""
        nodes = [node for node in self.supervisors for _ in range(self.lanes)]
        return [actor_class.options(scheduling_strategy=on(node)).remote(*args, **kwargs) for node in nodes]

    def status(self) -> dict[str, dict[str, Any]]:
        """What each node's pool is doing, as `smaclite_pool.status` says it; nodes that left are left out."""
        return _of_each({node: actor.status.remote() for node, actor in self.supervisors.items()})

    def stop(self) -> None:
        """Ends pools and their actors, on nodes that are still there. A second time does nothing."""
        for actor in self.supervisors.values():
            try:
                ray.get(actor.stop.remote())
                ray.kill(actor)
            except (GONE, ray.exceptions.RayActorError):
                pass
        self.supervisors = {}

    def __enter__(self) -> Fleet:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()


def _of_each(asked: dict[str, Any]) -> dict[str, Any]:
    """The answers of nodes that are still there."""
    answers = {}
    for node, answer in asked.items():
        try:
            answers[node] = ray.get(answer)
        except GONE:
            pass
    return answers


def start(
    scenario: str = "2s3z",
    num_envs: int = 64,
    *,
    lanes: int = 1,
    threads: int | None = None,
    seed: int = 0,
    name: str = "smaclite",
    nodes: Sequence[str] | None = None,
    serve: Sequence[str] = (),
    timeout: float = 60.0,
) -> Fleet:
    """Starts a pool on every node of the cluster and waits until all answer.

    Args:
        scenario: a standard scenario or a file that every node has.
        num_envs: environments of each lane.
        lanes: lanes of each pool; a lane is for one rollout actor.
        threads: worker threads of each pool; by default the cores of its node, less one.
        seed: where the seeds of the lanes begin; environments of different lanes get different ones.
        name: what to call the fleet, at most 23 letters, digits, `-`, `_` or `.`.
        nodes: Ray's ids of the nodes; all living ones, if None.
        serve: more arguments of `smaclite-pool serve`, as in `("--autoreset", "same_step")`.
        timeout: seconds to wait for the pools.

    Called again with the same name, it starts pools on nodes that have joined since, and leaves the others be.
    Raises StartError with what the program says, and then nothing of the fleet is left.
    """
    given = [f"lane-{lane}={scenario}:{num_envs}" for lane in range(lanes)] + [f"--seed={seed}", *serve]
    if threads is not None:
        given.append(f"--threads={threads}")
    nodes = list(nodes or sorted(node["NodeID"] for node in ray.nodes() if node["Alive"]))
    there = {node for node in nodes if _supervisor(name, node) is not None}
    ranks = iter(range(len(there), len(nodes)))
    fleet = Fleet(name, lanes, {})
    remote: Any = ray.remote  # Ray's types leave options out
    actor_class = remote(num_cpus=0, max_restarts=-1, max_task_retries=-1, max_concurrency=16)(Supervisor)
    for node in nodes:
        rank = 0 if node in there else next(ranks)
        seeds = {f"lane-{lane}": seed + (rank * lanes + lane) * num_envs for lane in range(lanes)}
        options = {"name": actor_name(name, node), "get_if_exists": True, "scheduling_strategy": on(node)}
        fleet.supervisors[node] = actor_class.options(**options).remote(name, given, seeds)
    try:
        fleet.running(timeout)
    except BaseException:
        fleet.stop()
        raise
    return fleet


def _supervisor(fleet: str, node: str) -> Any | None:
    try:
        return ray.get_actor(actor_name(fleet, node))
    except ValueError:
        return None


class Lane:
    """A lane of this node's pool, held by this process."""

    envs: Envs
    """Its environments."""
    name: str
    """Its name in the pool."""
    seed: int
    """The seed for `envs.reset`, such that no two environments of the fleet have the same."""
    generation: int
    """How many pools the node's actor had started when this lane was attached to."""

    def __init__(self, fleet: str, lane: str | None, timeout: float) -> None:
        self._fleet, self._wanted, self._timeout = fleet, lane, timeout
        self.reattach()

    def reattach(self) -> Envs:
        """Attaches anew, to the same pool or to the one in its place; then `reset`. Raises as `attach` does."""
        self.close()
        end = time.monotonic() + self._timeout
        node = ray.get_runtime_context().get_node_id()
        while True:
            try:
                return self._attach(node, max(0.0, end - time.monotonic()))
            except (ConnectError, PoolDied):  # no actor or pool yet, or an earlier holder is still on its way out
                if time.monotonic() >= end:
                    raise
                time.sleep(LOOK_AGAIN)

    def _attach(self, node: str, timeout: float) -> Envs:
        supervisor = _supervisor(self._fleet, node)
        if supervisor is None:
            raise NoSuchPool(f"no fleet `{self._fleet}` on this node ({node}): smaclite_pool.ray.start begins one")
        running: Running = ray.get(supervisor.running.remote(timeout))
        lanes = list(running.seeds) if self._wanted is None else [self._wanted]
        for lane in lanes:
            try:
                self.envs = connect(running.pool, lane)
            except LaneTaken:
                if lane == lanes[-1]:
                    raise
            else:
                self.name, self.seed, self.generation = lane, running.seeds[lane], running.generation
                break
        return self.envs

    def close(self) -> None:
        """Gives the lane back. A second time does nothing."""
        if hasattr(self, "envs"):
            self.envs.close()


def attach(lane: str | None = None, *, fleet: str = "smaclite", timeout: float = 60.0) -> Lane:
    """Attaches this process to a lane of its own node's pool: to `lane`, or to one that is free.

    Raises NoSuchPool if no such fleet is on this node, LaneTaken if no lane became free within `timeout` seconds, and
    StartError if the pool does not start.
    """
    return Lane(fleet, lane, timeout)
