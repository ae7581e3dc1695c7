"""Ray: several machines, with a pool on every node that the actors of the node read in place (extra `ray`).

    import ray
    from smaclite_pool.integrations.ray import attach, start

    @ray.remote
    class Rollout:
        def __init__(self):
            self.lane = attach()                        # a free lane of this node's pool
            self.batch = self.lane.envs.reset(seed=self.lane.seed)

        def collect(self, steps):                       # shared memory only; Ray sees the result
            rewards = 0.0
            for _ in range(steps):
                self.batch = self.lane.envs.step(self.lane.envs.sample_actions())
                rewards += float(self.batch.reward.sum())
            return rewards

    ray.init()
    with start("2s3z", num_envs=64) as fleet:
        rollouts = fleet.spawn(Rollout)                 # one actor per lane, on the node of its pool
        print(ray.get([rollout.collect.remote(100) for rollout in rollouts]))

One actor per node starts the node's pool and watches it. The actor is named after Ray's id of the node and
reserves no CPU, and no step passes through it. When a pool dies, the actor starts it again with free lanes: a
rollout actor gets PoolDied, calls `lane.reattach()` and resets. The pause before each start doubles while
starts fail, up to 30 s; after ten failures in a row the actor gives up, and `running` raises StartError with
the last output of the pool. When the driver ends, its actors and pools end too.
`smaclite_pool.examples.ray_rollouts` trains with PPO this way.

Sizing: use one actor per lane, and per node as many worker threads (`threads`) as it has cores, minus its
lanes. Learner and workers take turns at a batch, so one lane with many environments is better than several
small ones, unless the policy itself keeps a core busy. Beyond some thousand steps per batch, more
environments gain little. Start the node with a lower `--num-cpus`, so that Ray leaves cores to the worker
threads. Every node needs space in /dev/shm for its frames (`smaclite-pool status` shows how much; Ray's
object store uses /dev/shm too). This package, the scenario files and SMACLITE_POOL_ROOT, if set, must be the
same for all processes of a node. Send weights once per update with `ray.put`, and return whole rollouts: an
array of 450 KB takes milliseconds through Ray, and microseconds in place.
"""

from __future__ import annotations

import secrets
import subprocess
import sys
import threading
import time
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from types import TracebackType
from typing import Any

from .._extra import extra
from .._native import Envs, connect, status
from ..errors import ConnectError, InvalidRequest, LaneTaken, NoSuchPool, PoolDied, PoolError, StartError
from ..types import PoolStatus

with extra("ray"):
    import ray
    from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

__all__ = ["Fleet", "Lane", "attach", "on", "start"]

POLL_INTERVAL = 0.05
"""Seconds between two checks while waiting."""

FAILURES_TO_REPORT = 3
"""Failed starts in a row after which `running` raises."""

MAX_FAILURES = 10
"""Failed starts in a row after which the pool is not started again."""

MAX_BACKOFF = 30.0
"""Longest pause between two starts in seconds; it begins at POLL_INTERVAL and doubles with each failure."""

HEALTHY = 10.0
"""Seconds after which a pool that ends counts as started, and earlier failures are forgotten."""

OUTPUT_TAIL = 4096
"""Number of last bytes of a pool's output that are kept for error messages."""

STOP_TIMEOUT = 10.0
"""Seconds that a pool has to end before it is killed."""

NODE_LEFT = ray.exceptions.ActorUnschedulableError
"""The error of an actor that is bound to a node, after the node has left the cluster."""

# The kernel ends the pool when the thread that started it ends, so a killed actor leaves no pool behind.
PROGRAM = """
import ctypes, signal, sys
ctypes.CDLL(None).prctl(1, signal.SIGTERM)  # PR_SET_PDEATHSIG
from smaclite_pool.__main__ import main
sys.exit(main())
"""


def on(node: str) -> NodeAffinitySchedulingStrategy:
    """Schedule an actor on the node with this Ray id, and on no other."""
    return NodeAffinitySchedulingStrategy(node, soft=False)


def actor_name(fleet: str, node: str) -> str:
    """Name of the actor that watches the node's pool."""
    return f"smaclite_pool.{fleet}.{node}"


def back_off(failures: int) -> float:
    """Seconds to wait before the next start, after so many failures in a row, at least 1."""
    return min(POLL_INTERVAL * 2 ** (failures - 1), MAX_BACKOFF)


@dataclass(frozen=True)
class Running:
    """A pool that answers requests."""

    pool: str
    """Its name; contains the node's id, as several nodes may share a machine."""
    pid: int
    """Its process id."""
    generation: int
    """How many pools its actor has started so far."""
    seeds: dict[str, int]
    """A seed per lane, chosen so that all environments of the fleet have different seeds."""


class Supervisor:
    """Runs in the named actor of a node: starts the node's pool, and starts it again whenever it dies."""

    def __init__(self, fleet: str, arguments: Sequence[str], seeds: dict[str, int], own: range) -> None:
        node = ray.get_runtime_context().get_node_id()
        self._pool = f"{fleet}-{node[:16]}"  # names of pools have at most 40 characters
        self._command = [sys.executable, "-c", PROGRAM, "serve", *arguments, "--name", self._pool]
        self._seeds, self._own_seeds = seeds, own
        self._begin()

    def _begin(self) -> None:
        self._child: subprocess.Popen[bytes] | None = None
        self._generation = 0
        self._failures = 0  # in a row
        self._last_output = ""
        self._stopped = threading.Event()
        self._watch = threading.Thread(target=self._keep_running, daemon=True)
        self._watch.start()

    def _keep_running(self) -> None:
        while not self._stopped.is_set() and self._failures < MAX_FAILURES:
            begin = time.monotonic()
            try:
                output = self._run_once()
            except OSError as error:  # no memory or file descriptor for another process
                output = str(error)
            if time.monotonic() - begin >= HEALTHY:
                self._failures = 0
            self._failures, self._last_output = self._failures + 1, output
            self._stopped.wait(back_off(self._failures))

    def _run_once(self) -> str:
        """Start the pool, wait for its end, and return the end of its output."""
        child = subprocess.Popen(self._command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, bufsize=0)
        self._child, self._generation = child, self._generation + 1
        if self._stopped.is_set():
            child.terminate()  # `stop` may have come before the child
        tail = b""
        assert child.stderr is not None
        with child.stderr as output:
            while some := output.read(OUTPUT_TAIL):
                tail = (tail + some)[-OUTPUT_TAIL:]
        code = child.wait()
        return tail.decode(errors="replace").strip() or f"the pool ended with exit status {code}"

    def running(self, timeout: float = 60.0) -> Running:
        """Wait for the node's pool. Raises StartError if it cannot start or does not answer in time."""
        end = time.monotonic() + timeout
        while True:
            generation, pid = self._generation, self._answering(max(end - time.monotonic(), POLL_INTERVAL))
            if pid is not None and self._child is not None and pid == self._child.pid:
                self._failures = 0
                return Running(self._pool, pid, generation, self._seeds)
            if time.monotonic() >= end or self._failures >= FAILURES_TO_REPORT:
                break
            time.sleep(POLL_INTERVAL)
        why = self._last_output if self._failures else f"it did not answer within {timeout:g} s"
        given_up = f" (given up after {MAX_FAILURES} starts)" if self._failures >= MAX_FAILURES else ""
        raise StartError(f"pool `{self._pool}` does not run{given_up}: {why}")

    def _answering(self, timeout: float) -> int | None:
        try:
            return status(self._pool, timeout=timeout)["pid"]
        except PoolError:
            return None

    def own_seeds(self) -> range:
        """The seeds of all environments of the node's pool."""
        return self._own_seeds

    def status(self) -> PoolStatus:
        """The status of the node's pool, as `smaclite_pool.status` returns it."""
        return status(self._pool)

    def stop(self) -> None:
        """End the pool and do not start it again."""
        self._stopped.set()
        if self._child is not None:
            self._child.terminate()
        self._watch.join(STOP_TIMEOUT)
        if self._watch.is_alive() and self._child is not None:
            self._child.kill()
            self._watch.join()


class Fleet:
    """The pools of a cluster; they end with a `with` block, or by `stop`."""

    def __init__(self, name: str, lanes: int, supervisors: dict[str, Any]) -> None:
        self.name = name
        self.lanes = lanes
        self.supervisors = supervisors
        """The actor of each node, by Ray's id of the node."""

    def running(self, timeout: float = 60.0) -> dict[str, Running]:
        """Wait for the pool of each node, except nodes that have left.

        Raises StartError, and PoolDied if the actor of a node has ended.
        """
        return _get_each({node: actor.running.remote(timeout) for node, actor in self.supervisors.items()})

    def spawn(self, actor_class: Any, *args: Any, **kwargs: Any) -> list[Any]:
        """Create an actor of a `@ray.remote` class per lane, on the node of its pool; a list by node."""
        nodes = [node for node in self.supervisors for _ in range(self.lanes)]
        return [actor_class.options(scheduling_strategy=on(node)).remote(*args, **kwargs) for node in nodes]

    def status(self) -> dict[str, PoolStatus]:
        """The status of each node's pool as of `smaclite_pool.status`, except nodes that have left.

        Raises as `smaclite_pool.status` does, and PoolDied if the actor of a node has ended.
        """
        return _get_each({node: actor.status.remote() for node, actor in self.supervisors.items()})

    def stop(self) -> None:
        """End all pools and their actors, on nodes that have not left. Calling it again has no effect."""
        for actor in self.supervisors.values():
            with suppress(NODE_LEFT, ray.exceptions.RayActorError):
                ray.get(actor.stop.remote())
                ray.kill(actor)
        self.supervisors = {}

    def __enter__(self) -> Fleet:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()


def _get_each(results: dict[str, Any]) -> dict[str, Any]:
    """The results of the actors of nodes that have not left."""
    present = {}
    for node, result in results.items():
        with suppress(NODE_LEFT):
            present[node] = _of_actor(node, result)
    return present


def _of_actor(node: str, result: Any) -> Any:
    """A result of the actor that watches the pool of a node. Raises PoolDied if the actor has ended."""
    try:
        return ray.get(result)
    except ray.exceptions.RayActorError as error:
        raise PoolDied(
            f"the Ray actor that watches the pool of node {node} has ended, and its pool with it; start the "
            "fleet again with the same name and arguments"
        ) from error


def free_seeds(begin: int, count: int, used: Iterable[range]) -> range:
    """The first `count` consecutive seeds from `begin` on of which none is used."""
    for taken in sorted(used, key=lambda taken: taken.start):
        if begin < taken.stop and taken.start < begin + count:
            begin = taken.stop
    return range(begin, begin + count)


def start(
    scenario: str = "2s3z",
    num_envs: int = 64,
    *,
    lanes: int = 1,
    threads: int | None = None,
    seed: int | None = None,
    name: str = "smaclite",
    nodes: Sequence[str] | None = None,
    serve: Sequence[str] = (),
    timeout: float = 60.0,
) -> Fleet:
    """Start a pool on every node of the cluster and wait until all answer.

    Args:
        scenario: a standard scenario, or the path of a file that every node has.
        num_envs: number of environments per lane.
        lanes: number of lanes per pool; each lane is for one rollout actor.
        threads: worker threads per pool; by default one less than the cores of its node.
        seed: seed of the first environment; all environments of the fleet get different seeds. None for a
            random one.
        name: name of the fleet, at most 23 letters, digits, `-`, `_` or `.`.
        nodes: Ray ids of the nodes; None for all living nodes.
        serve: further arguments of `smaclite-pool serve`, such as `("--autoreset-mode", "SameStep")`.
        timeout: seconds to wait for the pools.

    A second call with the same name and arguments starts pools on nodes that have joined since, and leaves
    the others running. Raises InvalidRequest for less than one lane, StartError with the output of the
    program, and PoolDied if the actor of a node has ended. If a pool does not answer, the whole fleet is
    stopped.
    """
    if lanes < 1:
        raise InvalidRequest(f"lanes must be at least 1, got {lanes}")
    arguments = [f"lane-{lane}={scenario}:{num_envs}" for lane in range(lanes)] + [*serve]
    seed = secrets.randbits(32) if seed is None else seed
    if threads is not None:
        arguments.append(f"--threads={threads}")
    alive = sorted(node["NodeID"] for node in ray.nodes() if node["Alive"])
    actors = {node: actor for node in alive if (actor := _supervisor(name, node)) is not None}
    used = [*_get_each({node: actor.own_seeds.remote() for node, actor in actors.items()}).values()]
    fleet = Fleet(name, lanes, {})
    remote: Any = ray.remote  # Ray's type hints lack some options
    actor_class = remote(num_cpus=0, max_restarts=-1, max_task_retries=-1, max_concurrency=16)(Supervisor)
    for node in nodes or alive:
        free = free_seeds(seed, lanes * num_envs, used)  # not read if the node's actor runs
        if node not in actors:
            used.append(free)
        seeds = {f"lane-{lane}": free[lane * num_envs] for lane in range(lanes)}
        own = [*arguments, f"--seed={seeds['lane-0']}"]  # `serve` numbers environments through its lanes
        options = {"name": actor_name(name, node), "get_if_exists": True, "scheduling_strategy": on(node)}
        fleet.supervisors[node] = actor_class.options(**options).remote(name, own, seeds, free)
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
    """A lane of this node's pool, attached to by this process."""

    envs: Envs
    """Its environments."""
    name: str
    """Its name in the pool."""
    seed: int
    """The seed for `envs.reset`; all environments of the fleet get different seeds."""
    generation: int
    """How many pools the node's actor had started when this lane was attached to."""

    def __init__(self, fleet: str, lane: str | None, timeout: float) -> None:
        self._fleet, self._lane, self._timeout = fleet, lane, timeout
        self.reattach()

    def reattach(self) -> Envs:
        """Attach again, to the same pool or its successor; call `reset` next. Raises as `attach` does."""
        self.close()
        end = time.monotonic() + self._timeout
        node = ray.get_runtime_context().get_node_id()
        while True:
            try:
                return self._attach(node, max(0.0, end - time.monotonic()))
            except (ConnectError, PoolDied):  # no actor or pool yet, or the previous learner is still ending
                if time.monotonic() >= end:
                    raise
                time.sleep(POLL_INTERVAL)

    def _attach(self, node: str, timeout: float) -> Envs:
        supervisor = _supervisor(self._fleet, node)
        if supervisor is None:
            raise NoSuchPool(
                f"no fleet `{self._fleet}` runs on this node ({node}); start one with "
                "smaclite_pool.integrations.ray.start"
            )
        running: Running = _of_actor(node, supervisor.running.remote(timeout))
        lanes = list(running.seeds) if self._lane is None else [self._lane]
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
        """Release the lane. Calling it again has no effect."""
        if hasattr(self, "envs"):
            self.envs.close()


def attach(lane: str | None = None, *, fleet: str = "smaclite", timeout: float = 60.0) -> Lane:
    """Attach this process to a lane of its node's pool: to `lane`, or to any free lane.

    Raises NoSuchPool if no such fleet runs on this node, LaneTaken if no lane became free within `timeout`
    seconds, StartError if the pool does not start, and PoolDied if the node's actor has ended.
    """
    return Lane(fleet, lane, timeout)
