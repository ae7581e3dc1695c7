"""Measures another program that steps environments in turn with this one.

    cargo build --release
    PYTHON benches/peers.py published 2s3z 27m_vs_30m      # PYTHON: an interpreter that can import the peer
    PYTHON benches/peers.py smax 3m --rounds 5 --seconds 3
    PYTHON benches/peers.py envpool

Each round measures the peer, in every configuration of it that was its best somewhere, and then this program
on the same cores; the result is the median over the rounds of the best configuration. A step includes the
choice of random available actions and all that the peer gives to a learner. EnvPool and PufferLib have none
of the battles: they are compared with environments that do nothing.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

RELEASE = Path(__file__).parents[1] / "target" / "release"

Step = Callable[[], int]
"""Steps a number of environments and returns this number."""

Configuration = Callable[[], AbstractContextManager[Step]]
"""Makes ready what steps. What is inside must not use a core outside of measurements."""

CORES = sorted(os.sched_getaffinity(0))
FREE_ENVS = 64


class Peer(NamedTuple):
    packages: Callable[[], list[str]]
    """Imports the peer and names the packages whose versions matter."""
    scenarios: Callable[[], list[str]] | None
    """Names of its scenarios; None if its environments do no work."""
    configurations: list[str]
    one_process_per_core: bool
    make: Callable[[str], list[Configuration]]
    """Makes what `configurations` describes, for a scenario."""


def import_published() -> list[str]:
    import smaclite as _  # registers its scenarios

    return ["smaclite", "gymnasium", "numpy", *(["pyrvo2"] if has_addon() else [])]


def has_addon() -> bool:
    """Is its C++ addon there, without which it is slower?"""
    return find_spec("rvo2") is not None


def published_scenarios() -> list[str]:
    from smaclite.env.maps.map import MapPreset

    return [preset.value.name for preset in MapPreset]


def make_published(scenario: str) -> list[Configuration]:
    import gymnasium
    import numpy as np

    options: dict[str, Any] = {"use_cpp_rvo2": has_addon(), "disable_env_checker": True}
    env: Any = gymnasium.make(f"smaclite/{scenario}-v0", **options).unwrapped
    random = np.random.default_rng(CORES.index(min(os.sched_getaffinity(0))))
    env.reset()
    length = 0

    def step() -> int:
        nonlocal length
        actions = [int(random.choice(np.flatnonzero(mask))) for mask in env.get_avail_actions()]
        *_, terminated, _, _ = env.step(actions)
        length += 1
        if terminated or length == 200:
            env.reset()
            length = 0
        return 1

    return [lambda: nullcontext(step)]


def import_smax() -> list[str]:
    import jaxmarl as _

    return ["jaxmarl", "jax"]


def smax_scenarios() -> list[str]:
    from jaxmarl.environments.smax.smax_env import MAP_NAME_TO_SCENARIO

    return list(MAP_NAME_TO_SCENARIO)


SMAX_ENVS = [16, 64]
"""Environments per process: the better of them counts. On 2s3z, two processes with 8, 16, 32, 64 and 256
reached 52,000, 65,500, 43,000, 46,000 and 45,000 steps/s together, and one process with XLA's threads and
256 reached 20,000 (one measurement each)."""


def make_smax(scenario: str) -> list[Configuration]:
    return [smax_configuration(scenario, num_envs) for num_envs in SMAX_ENVS]


def smax_configuration(scenario: str, num_envs: int) -> Configuration:
    """`lax.scan` over steps of environments under `vmap`, compiled ahead. Observations and world state are in
    the carry, so that they are computed in every step, as a learner needs them."""
    import jax
    import jax.numpy as jnp
    import jaxmarl
    from jaxmarl.environments.smax import map_name_to_scenario

    env = jaxmarl.make("HeuristicEnemySMAX", scenario=map_name_to_scenario(scenario))
    length = max(1, 512 // num_envs)

    def advance(carry: Any, _: None) -> Any:
        key, state, _ = carry
        key, of_actions, of_steps = jax.random.split(key, 3)
        masks = jax.vmap(env.get_avail_actions)(state)
        mask = jnp.stack([masks[agent] for agent in env.agents], axis=1)
        chosen = jnp.argmax(jax.random.uniform(of_actions, mask.shape) * mask, axis=-1)
        actions = {agent: chosen[:, i] for i, agent in enumerate(env.agents)}
        keys = jax.random.split(of_steps, num_envs)
        obs, state, rewards, dones, _ = jax.vmap(env.step)(keys, state, actions)
        return (key, state, obs), (rewards, dones)

    def begin(key: Any) -> Any:
        obs, state = jax.vmap(env.reset)(jax.random.split(key, num_envs))
        return key, state, obs

    carry = jax.jit(begin)(jax.random.key(min(os.sched_getaffinity(0))))
    scan = jax.jit(lambda carry: jax.lax.scan(advance, carry, None, length=length)).lower(carry).compile()

    def step() -> int:
        nonlocal carry
        carry, _ = jax.block_until_ready(scan(carry))
        return length * num_envs

    return lambda: nullcontext(step)


def import_envpool() -> list[str]:
    import envpool as _

    return ["envpool", "gymnasium", "numpy"]


def make_envpool(_: str) -> list[Configuration]:
    return [lambda: nullcontext(envpool_step(FREE_ENVS)), lambda: nullcontext(envpool_step(FREE_ENVS // 2))]


def envpool_step(batch_size: int) -> Step:
    import envpool
    import numpy as np

    envs = envpool.make(
        "CartPole-v1", env_type="gymnasium", num_envs=FREE_ENVS, batch_size=batch_size, num_threads=len(CORES)
    )
    actions = np.arange(batch_size, dtype=np.int32) % 2
    envs.async_reset()
    env_id = envs.recv()[-1]["env_id"]

    def step() -> int:
        nonlocal env_id
        envs.send(actions, env_id)
        env_id = envs.recv()[-1]["env_id"]
        return batch_size

    return step


def import_pufferlib() -> list[str]:
    import pufferlib as _
    import pufferlib.vector as _

    return ["pufferlib", "numpy"]


def make_pufferlib(_: str) -> list[Configuration]:
    return [pufferlib_workers]


@contextmanager
def pufferlib_workers() -> Iterator[Step]:
    """Environments that do nothing in a worker process. More workers would be as many processes as there are
    cores or more, all of which spin."""
    import gymnasium
    import numpy as np
    import pufferlib.vector
    from pufferlib.environment import PufferEnv

    class Free(PufferEnv):  # type: ignore[misc]
        """All environments in one object, with the sizes of 2s3z: 5 agents, 80 numbers, 11 actions."""

        def __init__(self, buf: Any = None, seed: int = 0) -> None:
            self.single_observation_space = gymnasium.spaces.Box(-1, 1, (80,), np.float32)
            self.single_action_space: Any = gymnasium.spaces.Discrete(11)
            self.num_agents = FREE_ENVS * 5
            self.emulated: dict[str, Any] = {}
            self.done, self.buf = False, buf
            if PufferEnv.__init__ is not object.__init__:  # from version 2 on; it takes the buffers
                super().__init__(buf)

        def results(self) -> tuple[Any, ...]:
            arrays = self if self.buf is None else self.buf
            return arrays.observations, arrays.rewards, arrays.terminals, arrays.truncations, []

        def reset(self, seed: int | None = None) -> tuple[Any, list[Any]]:
            return self.results()[0], []

        def step(self, actions: Any) -> tuple[Any, ...]:
            return self.results()

        def close(self) -> None: ...

    multiprocessing.set_start_method("fork", force=True)  # as PufferLib expects
    backend = pufferlib.vector.Multiprocessing
    envs = pufferlib.vector.make(Free, backend=backend, num_envs=1, num_workers=1)
    actions = np.zeros(envs.action_space.shape, np.int64)
    envs.reset(seed=1)

    def step() -> int:
        envs.step(actions)
        return FREE_ENVS

    try:
        yield step
    finally:
        envs.close()


PEERS = {
    "published": Peer(import_published, published_scenarios, ["1 environment"], True, make_published),
    "smax": Peer(import_smax, smax_scenarios, [f"{n} environments" for n in SMAX_ENVS], True, make_smax),
    "envpool": Peer(
        import_envpool,
        None,
        [
            f"CartPole-v1, {len(CORES)} threads, {FREE_ENVS} environments{batches}"
            for batches in ("", f" in batches of {FREE_ENVS // 2}")
        ],
        False,
        make_envpool,
    ),
    "pufferlib": Peer(
        import_pufferlib, None, [f"1 worker process, {FREE_ENVS} environments"], False, make_pufferlib
    ),
}


def version_of(package: str) -> str:
    """The version of a package; of one that was built in place, without metadata, it is not known."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "unknown"


def rate(step: Step, seconds: float) -> float:
    """Steps per second."""
    step()  # warms up
    begin, steps, elapsed = time.perf_counter(), 0, 0.0
    while elapsed < seconds:
        steps += step()
        elapsed = time.perf_counter() - begin
    return steps / elapsed


def work(name: str, scenario: str, index: int, pipe: Any) -> None:
    """One process of a peer: answers numbers of configurations and seconds with steps per second."""
    peer = PEERS[name]
    try:
        if peer.one_process_per_core:
            os.sched_setaffinity(0, {CORES[index]})
        peer.packages()  # what it imports registers its environments
        configurations = peer.make(scenario)
        pipe.send("ready")
        while (asked := pipe.recv()) is not None:
            configuration, seconds = asked
            with configurations[configuration]() as step:
                pipe.send(rate(step, seconds))
    except Exception as error:  # becomes the message of the program
        pipe.send(f"{type(error).__name__}: {error}")


def answers(pipes: list[Any]) -> list[Any]:
    """An answer of each process."""
    try:
        found = [pipe.recv() for pipe in pipes]
    except EOFError:
        raise SystemExit("peers.py: a process of the peer ended without an answer") from None
    if errors := {answer for answer in found if isinstance(answer, str) and answer != "ready"}:
        raise SystemExit(f"peers.py: {'; '.join(sorted(errors))}")
    return found


@contextmanager
def running(name: str, scenario: str) -> Iterator[Callable[[int, float], float]]:
    """Starts the processes of a peer. What is inside measures a configuration: steps/s of all of them."""
    context = multiprocessing.get_context("spawn")
    pipes, processes = [], []
    for index in range(len(CORES) if PEERS[name].one_process_per_core else 1):
        ours, theirs = context.Pipe()
        # A worker of PufferLib has processes of its own, which daemons may not have.
        process = context.Process(
            target=work, args=(name, scenario, index, theirs), daemon=name != "pufferlib"
        )
        process.start()
        theirs.close()
        pipes.append(ours)
        processes.append(process)

    def measure(configuration: int, seconds: float) -> float:
        for pipe in pipes:
            pipe.send((configuration, seconds))
        return sum(answers(pipes))

    try:
        answers(pipes)  # everything is compiled
        yield measure
    finally:
        for pipe in pipes:
            with suppress(OSError):
                pipe.send(None)
        for process in processes:
            process.join(10)
            process.kill()


def here(scenario: str | None, seconds: float) -> float:
    """Steps/s of an embedded pool of this program; without a scenario, of environments that do nothing."""
    command = (
        ["smaclite-benches", "idle"] if scenario is None else ["smaclite-pool", "bench", scenario, "--json"]
    )
    command = [str(RELEASE / command[0]), *command[1:], "--seconds", str(seconds)]
    done = subprocess.run(command, stdout=subprocess.PIPE, check=True, text=True)
    return float(json.loads(done.stdout)["steps_per_s"])


def compare(name: str, scenario: str | None, rounds: int, seconds: float) -> str:
    """Medians of measurements in turn, as a line."""
    peer = PEERS[name]
    theirs: list[list[float]] = [[] for _ in peer.configurations]
    ours = []
    with running(name, scenario or "") as measure:
        for _ in range(rounds):
            for index, results in enumerate(theirs):
                results.append(measure(index, seconds))
            ours.append(here(scenario, seconds))
    best, configuration = max(zip(map(median, theirs), peer.configurations, strict=True))
    processes = f"{len(CORES)} processes on a core each, " if peer.one_process_per_core else ""
    return (
        f"{scenario or 'no work'}: {name} {best:.0f} steps/s ({processes}{configuration}), "
        f"here {median(ours):.0f}, {median(ours) / best:.2f} x"
    )


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        "peers.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("peer", choices=PEERS)
    parser.add_argument("maps", metavar="MAP", nargs="*", help="maps that the peer has (all)")
    parser.add_argument("--rounds", type=int, default=3, metavar="N", help="rounds of measurements (3)")
    parser.add_argument("--seconds", type=float, default=3.0, metavar="S", help="of each measurement (3)")
    options = parser.parse_args(argv)
    peer = PEERS[options.peer]
    try:
        packages = peer.packages()
    except ImportError as error:
        raise SystemExit(f"peers.py: {sys.executable} cannot import the peer: {error}") from None
    print(", ".join(f"{package} {version_of(package)}" for package in packages))
    known = peer.scenarios() if peer.scenarios else None
    if absent := [name for name in options.maps if name not in (known or [])]:
        raise SystemExit(f"peers.py: {options.peer} has no {', '.join(absent)}; its maps are {known}")
    for scenario in options.maps or known or [None]:
        print(compare(options.peer, scenario, options.rounds, options.seconds), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
