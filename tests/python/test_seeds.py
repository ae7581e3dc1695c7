"""Each source of chance has a seed: the rows of the table in docs/concepts/reproducibility.md.

Processes once shared chance by accident: what had no seed had seed 0, or a state that a fork inherits.
"""

from __future__ import annotations

import itertools
import multiprocessing
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp
from numpy.typing import ArrayLike, NDArray

from conftest import Serve, posix

Bits = bytes


def played(envs: sp.Envs, batch: sp.Batch | None = None, **reset: Any) -> Bits:
    """What the battles show while agents attack the nearest enemies, from a batch on or from a reset."""
    policy = sp.ScriptedPolicy("nearest", envs)
    batch = envs.reset(**reset) if batch is None else batch
    seen = [batch.state.tobytes()]
    for _ in range(25):
        batch = envs.step(policy(batch))
        seen.append(batch.state.tobytes())
    return b"".join(seen)


def battles(seed: int | None, scenario: str = "terran_5_vs_5", **options: Any) -> Bits:
    with sp.make(scenario, 2, seed=seed, threads=1, **options) as envs:
        return played(envs)


def sampled(seed: int, make_seed: int = 3) -> Bits:
    with sp.make("3m", 2, seed=make_seed, threads=1) as envs:
        envs.reset()
        envs.seed_sampler(seed)
        return envs.sample_actions().tobytes() + envs.sample_actions().tobytes()


def scripted(seed: int | None, make_seed: int = 3, side: Any = "allies") -> Bits:
    with sp.make("3m", 4, seed=make_seed, threads=1, sides="both") as envs:
        policy, batch = sp.ScriptedPolicy("random", envs, seed=seed, side=side), envs.reset()
        return policy(batch).tobytes() + policy(batch).tobytes()


def team(seed: int | None) -> Bits:
    policy = sp.load_team("3m", seed=seed)
    with sp.make("3m", 8, seed=3, threads=1, **policy.settings) as envs:
        batch = envs.reset()
        return policy(batch).tobytes() + policy(batch).tobytes()


class Watched(sp.extras.Wrapper):
    """Keeps the actions of every step."""

    def __init__(self, envs: sp.Envs) -> None:
        super().__init__(envs)
        self.actions: list[NDArray[np.integer[Any]]] = []

    def change_actions(self, actions: ArrayLike) -> ArrayLike:
        self.actions.append(np.array(actions))
        return actions


def evaluated(seed: int | None) -> list[NDArray[np.integer[Any]]]:
    """The actions of agents and enemies that `random` chooses first in an evaluation."""
    with sp.make("3m", 16, seed=3, threads=1, sides="both", episode_limit=5) as envs:
        watched = Watched(envs)
        sp.evaluate(watched, "random", 16, seed, against="random")
        return np.split(watched.actions[0], 2, axis=1)


def reset_to(seed: int) -> Bits:
    with sp.make("10m_vs_11m", 2, seed=3, threads=1) as envs:
        return played(envs, seed=seed)


def reseeded(seed: int) -> Bits:
    fields = ["state", "avail_actions", "snapshot"]
    with sp.make("10m_vs_11m", 2, seed=3, threads=1, fields=fields) as envs:
        snapshots = envs.reset().snapshot.copy()
        return played(envs, envs.reset(seed=seed, snapshots=snapshots))


def opponents(seed: int) -> Bits:
    mixture = {"attack_move": 0.5, "hold": 0.5}
    fields = ["state", "avail_actions", "opponent"]
    with sp.make("3m", 32, seed=seed, threads=1, opponent=mixture, fields=fields) as envs:
        return envs.reset().opponent.tobytes()


ROWS: dict[str, Callable[[Any], Bits]] = {
    "make": battles, "reset": reset_to, "restore": reseeded, "opponents": opponents, "sampler": sampled,
    "scripted": scripted, "team": team, "evaluation": lambda seed: np.hstack(evaluated(seed)).tobytes(),
}  # fmt: skip


@pytest.mark.parametrize("row", ROWS)
def test_a_seed_repeats_its_chance_and_another_changes_it(row: str) -> None:
    draw = ROWS[row]
    assert draw(5) == draw(5)
    assert len({draw(seed) for seed in range(5, 9)}) > 1


def test_seeds_of_actions_change_no_battle_and_seeds_of_battles_no_actions() -> None:
    assert sampled(5, make_seed=3) == sampled(5, make_seed=4)
    assert scripted(5, make_seed=3) == scripted(5, make_seed=4)

    def with_sampler(seed: int) -> Bits:
        with sp.make("10m_vs_11m", 2, seed=3, threads=1) as envs:
            envs.seed_sampler(seed)
            envs.reset()
            envs.sample_actions()
            return played(envs, seed=1)

    assert with_sampler(1) == with_sampler(2)


def test_without_seeds_of_their_own_policies_follow_the_environments() -> None:
    assert scripted(None, 3) == scripted(None, 3) != scripted(None, 4)
    assert scripted(None, 3) != scripted(None, 3, side="enemies")
    with sp.make("3m", 2, seed=3, threads=1) as envs:
        envs.reset()
        first = envs.sample_actions().tobytes()
    with sp.make("3m", 2, seed=3, threads=1) as envs:
        envs.reset()
        assert envs.sample_actions().tobytes() == first


def test_one_seed_of_an_evaluation_is_not_that_of_both_sides() -> None:
    """Both `random` scripts drew the same numbers: units did the same as their enemies, which fired less than
    independent ones, and the mean return on 3m was 1.45 instead of 1.80."""
    agents, enemies = evaluated(5)
    with sp.make("3m", 16, seed=3, threads=1, sides="both") as envs:
        batch = envs.reset(seed=5)
        assert np.array_equal(batch.avail_actions, batch.enemy_avail_actions), "else they differ by chance"
        assert np.array_equal(agents, sp.ScriptedPolicy("random", envs, seed=5)(batch))
    assert (agents != enemies).mean() > 0.5


def test_evaluations_without_a_seed_draw_other_actions() -> None:
    """The scripts of every one had seed 0, so that the mean of several was no better than one of them."""
    (first, its_enemies), (second, _) = evaluated(None), evaluated(None)
    assert (first != second).mean() > 0.5 and (first != its_enemies).mean() > 0.5


def test_one_seed_of_two_teams_is_not_that_of_both_sides() -> None:
    """Both had the same noise, so that mirror images of units did the same: 73 % draws instead of 79 %."""
    team, rival = sp.load_team("3m", seed=5), sp.load_team("3m", seed=5, side="enemies")
    with sp.make("3m", 64, seed=3, threads=1, **rival.settings) as envs:
        batch = envs.reset(seed=1)
        np.testing.assert_allclose(batch.obs, batch.enemy_obs, atol=1e-6)  # else they differ by what they see
        agents, enemies = team(batch), rival(batch)
        assert (agents != enemies).mean() > 0.1
        assert np.array_equal(enemies, sp.load_team("3m", seed=5, side="enemies")(batch))
        logits = np.where(batch.avail_actions, team.logits(batch.obs), -np.inf)
        noise = np.random.default_rng(5).gumbel(size=logits.shape)
        assert np.array_equal(agents, (logits + noise).argmax(-1)), "a seed repeats its old actions"


def test_a_seed_that_was_drawn_can_be_read_and_repeats_the_run() -> None:
    with sp.make("terran_5_vs_5", 2, threads=1) as envs:
        seed, first = envs.spec.seed, played(envs)
        assert 0 <= seed < 2**53 and envs.spec.seed == seed
    assert battles(seed) == first == battles(seed)
    assert battles(None) != battles(None)
    lanes = sp.make("terran_5_vs_5", 4, threads=1, lanes=2)
    assert lanes[1].spec.seed == lanes[0].spec.seed + 2
    for lane in lanes:
        lane.close()
    drawn = sp.load_team("3m")
    assert drawn.seed != sp.load_team("3m").seed
    assert team(drawn.seed) == team(drawn.seed)


def state_of(kind: str) -> Bits:
    """The first state of an environment without a seed."""
    if kind == "envs":
        return battles(None)
    if kind == "smac":
        from smaclite_pool.marl.smac import MultiAgentEnv

        smac = MultiAgentEnv("terran_5_vs_5")
        smac.reset()
        state = smac.get_state().tobytes()
        smac.close()
        return state
    if kind == "gymnasium":
        from smaclite_pool.integrations.gymnasium import BattleEnv

        single = BattleEnv("terran_5_vs_5")
        observation, _ = single.reset()
        single.close()
        return bytes(observation["state"].tobytes())
    from smaclite_pool.integrations.pettingzoo import parallel_env

    env = parallel_env("terran_5_vs_5")
    env.reset()
    state = env.state().tobytes()
    env.close()
    return state


@pytest.mark.parametrize("kind", ["envs", "smac", "gymnasium", "pettingzoo"])
@posix
def test_forked_workers_do_not_play_the_same_battles(kind: str) -> None:
    """Forked processes inherit the state of NumPy's generator, so each had the same "random" seed."""
    if kind in ("gymnasium", "pettingzoo"):
        pytest.importorskip(kind)
    with multiprocessing.get_context("fork").Pool(2) as workers:
        first, second = workers.map(state_of, [kind, kind], chunksize=1)
    assert first != second


def test_workers_of_gymnasium_do_not_play_the_same_battles() -> None:
    gymnasium = pytest.importorskip("gymnasium")
    import smaclite_pool.integrations.gymnasium  # noqa: F401

    name = "smaclite_pool/terran_5_vs_5-v0"
    envs = gymnasium.make_vec(name, num_envs=2, vectorization_mode="async")
    observations, _ = envs.reset()
    envs.close()
    assert not np.array_equal(*observations["state"])


def test_lanes_of_a_pool_do_not_share_battles(serve: Serve) -> None:
    """Both lanes had seed 0: two learners with the same scenario had the same battles."""
    serve("a=3m:4", "b=3m:2", "--name", "numbered", "--seed", "7", "--threads", "1")
    with sp.connect("numbered", "a") as a, sp.connect("numbered", "b") as b:
        assert (a.spec.seed, b.spec.seed) == (7, 11)
    for name in ("one", "two"):
        serve("3m:1", "--name", name, "--threads", "1")
    with sp.connect("one") as one, sp.connect("two") as two:
        assert one.spec.seed != two.spec.seed


def test_programs_with_a_seed_repeat_themselves() -> None:
    def evaluated(seed: str) -> str:
        command = [
            sys.executable,
            "-m",
            "smaclite_pool",
            "evaluate",
            "zoo:3m",
            "--episodes",
            "8",
            "--seed",
            seed,
        ]
        return subprocess.run([*command, "--json"], capture_output=True, text=True, check=True).stdout

    assert evaluated("1") == evaluated("1") != evaluated("2")


def test_a_list_of_seeds_needs_no_more_batches_than_a_seed() -> None:
    """It held the batch of its earlier request, and was refused in the middle."""
    seeds = [5, 100, 7, 3]
    with sp.make("terran_5_vs_5", 4, max_held_batches=2) as envs:
        whole = envs.reset(seed=seeds).obs.copy()
        held = envs.reset(seed=1)
        assert (envs.reset(seed=seeds).obs == whole).all()
        del held


def test_a_list_of_seeds_resets_all_that_is_named_or_nothing() -> None:
    """What came before the environment that was refused was reset, and one could be named twice."""
    fields = ["snapshot", "level", "avail_actions"]
    with sp.make("terran_5_vs_5", 4, threads=1, fields=fields) as envs:
        batch = envs.reset(seed=1)
        levels = batch.level[:2].copy()
        levels[1, 0, 0] = 99
        before = batch.snapshot.copy()
        wrong: list[dict[str, Any]] = [
            {"seed": [10, 40], "env_id": [0, 9]},
            {"seed": [10, 20, 30], "env_id": [0, 9, 1]},
            {"seed": [10, 40], "env_id": [0, 0]},
            {"seed": [10, 40], "env_id": [0, 3], "levels": levels},
        ]
        for arguments in wrong:
            with pytest.raises(sp.errors.InvalidRequest, match="environment"):
                envs.reset(**arguments)
            assert (envs.fork([1], [1]).snapshot == before).all(), arguments
        envs.step(envs.sample_actions())
        named = envs.reset(seed=[10, None, 40], env_id=[3, 1, 0]).snapshot.copy()
        assert (envs.reset(seed=7, env_id=[3]).snapshot[3] == named[3]).all()
        assert (envs.reset(seed=40, env_id=[0]).snapshot[0] == named[0]).all()


@pytest.mark.parametrize("seed", [{1, 2, 3, 4}, frozenset([1, 2, 3, 4]), {0: 1, 1: 2, 2: 3, 3: 4}, b"abcd"])
def test_seeds_without_an_order_are_refused(seed: Any) -> None:
    """A set gave its seeds in any order, and a dictionary its keys."""
    with sp.make("3m", 4) as envs, pytest.raises(TypeError, match="or a list with one per environment, got"):
        envs.reset(seed=seed)


def test_the_first_reset_of_some_environments_begins_the_others_too() -> None:
    """It was refused, with the advice to call reset first, where one with snapshots was not."""
    with sp.make("3m", 4, seed=7, fields=["snapshot", "was_reset"]) as envs:
        expected = envs.reset().snapshot.copy()
        expected[2] = envs.reset(env_id=[2], seed=[40]).snapshot[2]
    for env_id in ([2], np.arange(4) == 2):
        with sp.make("3m", 4, seed=7, fields=["snapshot", "was_reset"]) as envs:
            batch = envs.reset(seed=[40], env_id=env_id)
            assert batch.was_reset.all() and (batch.snapshot == expected).all()
    with sp.make("3m", 4, batch_size=2) as envs:
        with pytest.raises(sp.errors.InvalidRequest, match="call reset first, for all of them"):
            envs.reset(env_id=[2])
        envs.reset()


def test_seeds_without_an_end_are_refused() -> None:
    with sp.make("3m", 4) as envs:
        with pytest.raises(sp.errors.InvalidRequest, match="one per environment of the request, 4; got more"):
            envs.reset(seed=itertools.count())  # type: ignore[arg-type]
        batch = envs.reset(seed=iter([1, None, 3, 4]))  # type: ignore[arg-type]
        assert batch.was_reset.all()


def test_a_session_does_not_depend_on_earlier_ones(serve: Serve) -> None:
    """The published fault of SMACv2's reward scale, which adds up over resets, went on in the next one."""
    serve("terran_5_vs_5:2", "--name", "train", "--set", 'smacv2={"published": true}')

    def play() -> Any:
        with sp.connect("train") as envs:
            envs.reset(seed=1)
            envs.seed_sampler(1)
            return np.array([envs.step(envs.sample_actions()).reward.copy() for _ in range(20)])

    first = play()
    with sp.connect("train") as envs:
        for _ in range(5):
            envs.reset(seed=9)
    assert (play() == first).all()
