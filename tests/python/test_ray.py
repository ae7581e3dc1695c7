"""A fleet of pools on a Ray cluster of two nodes, both on this machine."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import textwrap
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp

from conftest import left_over, program

ray = pytest.importorskip("ray")

import smaclite_pool.integrations.ray
from ray.cluster_utils import Cluster
from smaclite_pool.integrations.ray import (
    MAX_BACKOFF,
    Fleet,
    Supervisor,
    actor_name,
    attach,
    back_off,
    free_seeds,
    start,
)


@pytest.fixture(autouse=True)
def runtime_dir() -> None:
    """Not one per test: nodes keep the runtime directory that they were started with."""


@pytest.fixture(scope="module")
def cluster() -> Iterator[Cluster]:
    """Two nodes of two cores. Their pools use a separate runtime directory, which must end empty."""
    root = Path(tempfile.mkdtemp(prefix="sp-", dir="/tmp")).resolve()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SMACLITE_POOL_ROOT", str(root))
        patch.setenv("PYTHONPATH", str(Path(__file__).parent))  # actors find this module
        head = {"num_cpus": 2, "object_store_memory": 100 << 20}
        cluster = Cluster(initialize_head=True, head_node_args=head)
        cluster.add_node(num_cpus=2, object_store_memory=100 << 20)
        ray.init(cluster.address, log_to_driver=False)
        yield cluster
        ray.shutdown()
        cluster.shutdown()
        program("clean")  # Ray kills actors
    left = left_over(root)
    shutil.rmtree(root)
    assert not left


@pytest.fixture
def fleet(cluster: Cluster) -> Iterator[Fleet]:
    with start("2s3z", 4, lanes=2, threads=1, seed=100, serve=("--max-held-batches", "8")) as started:
        yield started


@ray.remote(num_cpus=0.1)
class Player:
    """A rollout actor."""

    def __init__(self, timeout: float = 60.0) -> None:
        self.lane = attach(timeout=timeout)
        self.reset()

    def reset(self) -> None:
        self.batch = self.lane.envs.reset(seed=self.lane.seed)

    def where(self) -> dict[str, Any]:
        envs, lane = self.lane.envs, self.lane
        where = {
            "node": ray.get_runtime_context().get_node_id(),
            "pool": envs.spec.pool,
            "pid": envs.spec.pid,
        }
        where |= {"lane": lane.name, "seed": lane.seed, "generation": lane.generation}
        return where | {"process": os.getpid()}

    def play(self, steps: int) -> dict[str, np.ndarray[Any, Any]]:
        rewards = []
        for _ in range(steps):
            self.batch = self.lane.envs.step(self.lane.envs.sample_actions(), timeout=60)
            rewards.append(self.batch.reward.copy())
        return {"reward": np.stack(rewards), "obs": self.batch.obs.copy()}

    def play_on(self, steps: int) -> tuple[bool, int]:
        """Plays; returns whether the pool died, and the generation at the end."""
        try:
            self.play(steps)
        except sp.errors.PoolDied:
            self.lane.reattach()
            self.reset()
            self.play(3)
            return True, self.lane.generation
        return False, self.lane.generation


def ends(process: int) -> bool:
    """Whether a process ends within ten seconds; zombies count as ended."""
    status = Path(f"/proc/{process}/status")
    for _ in range(100):
        if not status.exists() or "State:\tZ" in status.read_text():
            return True
        time.sleep(0.1)
    return False


def test_each_node_plays_in_its_own_pool(fleet: Fleet) -> None:
    players = fleet.spawn(Player)
    seen = ray.get([player.where.remote() for player in players])
    running = fleet.running()
    assert len(running) == 2 and len(players) == 4
    for where in seen:
        here = running[where["node"]]
        assert (where["pool"], where["pid"], where["generation"]) == (here.pool, here.pid, 1)
        assert where["node"].startswith(here.pool.removeprefix("smaclite-"))
        assert ray.get_actor(actor_name("smaclite", where["node"])) == fleet.supervisors[where["node"]]
    assert len({(where["node"], where["lane"]) for where in seen}) == 4, "one actor per lane"
    assert sorted(where["seed"] for where in seen) == [100, 104, 108, 112], (
        "all environments have different seeds"
    )
    learners = [lane["learner_pid"] for node in fleet.status().values() for lane in node["lanes"]]
    assert sorted(filter(None, learners)) == sorted(where["process"] for where in seen), (
        "attached themselves, not through an actor"
    )
    played = ray.get([player.play.remote(5) for player in players])
    assert all(part["reward"].shape == (5, 4) and part["obs"].shape == (4, 5, 80) for part in played)


def test_a_taken_lane_is_waited_for_and_then_refused(fleet: Fleet) -> None:
    players = fleet.spawn(Player)
    ray.get([player.where.remote() for player in players])
    extra = fleet.spawn(Player, timeout=0.5)[0]
    with pytest.raises(ray.exceptions.RayActorError, match="LaneTaken"):
        ray.get(extra.where.remote())
    waiting = fleet.spawn(Player)[0]
    ray.kill(players[0])
    assert ray.get(waiting.where.remote())["lane"] in ("lane-0", "lane-1")


def test_players_attach_again_when_a_pool_was_killed(fleet: Fleet) -> None:
    players = fleet.spawn(Player)
    seen = ray.get([player.where.remote() for player in players])
    hit = seen[0]["node"]
    playing = [player.play_on.remote(20_000) for player in players if player is players[0]]
    # Actors of a node take its lanes in any order.
    (lane,) = [lane for lane in (0, 1) if seen[0]["lane"] == f"lane-{lane}"]
    while fleet.status()[hit]["lanes"][lane]["stats"]["steps"] == 0:
        time.sleep(0.01)
    os.kill(fleet.running()[hit].pid, signal.SIGKILL)
    assert ray.get(playing) == [(True, 2)]
    after = ray.get([player.where.remote() for player in players])
    assert {where["generation"] for where in after if where["node"] != hit} == {1}, (
        "the other node does not notice"
    )
    assert fleet.running()[hit].generation == 2


def test_a_killed_actor_is_restarted_and_leaves_no_second_pool(fleet: Fleet) -> None:
    players = fleet.spawn(Player)
    where = ray.get(players[0].where.remote())
    ray.kill(fleet.supervisors[where["node"]], no_restart=False)
    assert ray.get(players[0].play_on.remote(100_000))[0], "the pool ends with its actor"
    again = ray.get(players[0].where.remote())
    assert (
        again["pool"] == where["pool"] and again["pid"] == fleet.running()[where["node"]].pid != where["pid"]
    )
    assert ends(where["pid"])


def test_seeds_of_pools_of_other_sizes_do_not_overlap() -> None:
    """A second start looked for first seeds alone: with fewer environments it gave some to two pools."""
    used = [range(108, 116), range(100, 108)]
    assert free_seeds(100, 6, used) == range(116, 122)
    assert free_seeds(90, 10, used) == range(90, 100)
    assert free_seeds(90, 11, used) == range(116, 127)


def test_an_actor_that_has_ended_is_an_error_that_names_its_node(cluster: Cluster) -> None:
    """It was Ray's own error."""
    with start("2s3z", 2, name="ended") as fleet:
        [node, *_] = fleet.supervisors
        ray.kill(fleet.supervisors[node])
        for call in (fleet.running, fleet.status):
            with pytest.raises(sp.errors.PoolDied, match=f"of node {node} has ended.*start the fleet again"):
                call()


def test_a_pool_that_cannot_start_says_why(cluster: Cluster) -> None:
    with pytest.raises(sp.errors.StartError, match="2s3zz.* is neither a standard scenario"):
        start("2s3zz", name="wrong")
    with pytest.raises(sp.errors.InvalidRequest, match="lanes must be at least 1, got 0"):
        start("2s3z", 2, lanes=0, name="wrong")
    start("2s3z", 2, name="wrong").stop()  # nothing is in the way


class Watched(Supervisor):
    """A supervisor outside an actor, whose pool is the given program."""

    def __init__(self, program: str) -> None:
        self.starts = 0
        self._pool, self._seeds, self._command = "watched", {}, [sys.executable, "-c", program]
        self._begin()

    def _run_once(self) -> str:
        self.starts += 1
        return super()._run_once()


def test_a_pool_that_cannot_run_is_not_started_without_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """It was started twenty times per second, without end, and all of its output was kept."""
    monkeypatch.setattr("smaclite_pool.integrations.ray.MAX_FAILURES", 5)
    watched = Watched("import sys; sys.exit('x' * 100_000 + ' no luck')")
    watched._watch.join(60)
    assert not watched._watch.is_alive() and watched.starts == 5
    pauses = [back_off(failures) for failures in (1, 2, 3, 4, 100)]
    assert pauses == [0.05, 0.1, 0.2, 0.4, MAX_BACKOFF]
    with pytest.raises(sp.errors.StartError, match=r"given up after 5 starts.*no luck") as caught:
        watched.running(timeout=1)
    assert len(str(caught.value)) < 5000
    watched.stop()


def test_a_pool_that_ignores_its_end_is_killed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("smaclite_pool.integrations.ray.STOP_TIMEOUT", 0.5)
    ignores = tmp_path / "ignores"
    watched = Watched(f"""
import pathlib, signal, time
signal.signal(signal.SIGTERM, signal.SIG_IGN)
pathlib.Path({str(ignores)!r}).touch()
time.sleep(100)
""")
    while not ignores.exists():
        time.sleep(0.01)
    watched.stop()
    assert watched._child is not None and watched._child.returncode is not None


def test_started_again_it_is_the_same_fleet(fleet: Fleet) -> None:
    before = {node: running.pid for node, running in fleet.running().items()}
    again = start("2s3z", 4, lanes=2)
    assert {node: running.pid for node, running in again.running().items()} == before


def test_nodes_can_join_and_leave(cluster: Cluster, fleet: Fleet) -> None:
    before = {node: running.pid for node, running in fleet.running().items()}
    joined = cluster.add_node(num_cpus=1, object_store_memory=100 << 20)
    # Of this node alone: it got the seeds of another one.
    alone = start("2s3z", 4, lanes=2, threads=1, seed=100, nodes=[joined.node_id])
    [only] = alone.running().values()
    assert sorted(only.seeds.values()) == [116, 120]
    wider = start("2s3z", 4, lanes=2, threads=1, seed=100)
    running = wider.running()
    [new] = set(running) - set(before)
    assert before.items() <= {node: one.pid for node, one in running.items()}.items()
    assert sorted(seed for one in running.values() for seed in one.seeds.values()) == [
        100,
        104,
        108,
        112,
        116,
        120,
    ]
    cluster.remove_node(joined)
    assert ends(running[new].pid)
    assert set(wider.running()) == set(wider.status()) == set(before)
    wider.stop()


def of_cluster(cluster: Cluster, *command: str) -> str:
    """The output of a separate driver."""
    environment = {**os.environ, "RAY_ADDRESS": cluster.address}
    done = subprocess.run(
        [sys.executable, *command], env=environment, capture_output=True, text=True, timeout=240
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_first_example_runs(cluster: Cluster) -> None:
    documentation = smaclite_pool.integrations.ray.__doc__
    assert documentation is not None
    text = textwrap.dedent("\n".join(documentation.split("\n")[2:]).split("\nOne actor per node")[0])
    assert re.fullmatch(r"\[\d+\.\d+, \d+\.\d+\]\n", of_cluster(cluster, "-c", text))


def test_the_example_trains_on_both_nodes(cluster: Cluster) -> None:
    options = ("--num-envs=4", "--threads=1", "--updates=2", "--steps=70")
    printed = of_cluster(cluster, "-m", "smaclite_pool.examples.ray_rollouts", "2s_vs_1sc", *options)
    assert "2 nodes, 2 rollout actors" in printed and "update 1: 560 steps" in printed, printed
