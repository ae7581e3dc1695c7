"""The PettingZoo integration: PettingZoo's own tests, and what this project guarantees beyond them."""

from __future__ import annotations

import copy
import pickle
import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp

pytest.importorskip("pettingzoo")

import gymnasium
from pettingzoo.test import api_test, parallel_api_test, parallel_seed_test, seed_test
from smaclite_pool.integrations import pettingzoo
from smaclite_pool.integrations.pettingzoo import parallel_env


@pytest.fixture
def env() -> Iterator[parallel_env]:
    made = parallel_env("2s3z", seed=3)
    yield made
    made.close()


def play(env: parallel_env, seed: int) -> list[tuple[float, bytes, list[str]]]:
    """Attacks the last available target until the battle ends; reward, observations and agents per step."""
    seen, _ = env.reset(seed=seed)
    played = []
    while env.agents:
        actions = {agent: max(np.flatnonzero(seen[agent]["action_mask"]).tolist()) for agent in env.agents}
        seen, rewards, *_ = env.step(actions)
        [reward] = set(rewards.values())
        played.append((reward, b"".join(s["observation"].tobytes() for s in seen.values()), env.agents[:]))
    return played


@pytest.mark.parametrize("scenario", ["2s3z", "MMM2"])
def test_pettingzoo_accepts_it(scenario: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = parallel_env(scenario)
        parallel_api_test(env, num_cycles=300)
        env.close()
        parallel_seed_test(lambda: parallel_env(scenario), num_cycles=100)


def test_the_dead_stay_listed_with_the_no_op_alone(env: parallel_env) -> None:
    observations, _ = env.reset(seed=1)
    died = 0
    while env.agents:
        assert env.agents == env.possible_agents == list(observations)
        seen, _, _, _, infos = env.step({agent: env.action_space(agent).sample() for agent in env.agents})
        no_op = [agent for agent in seen if seen[agent]["action_mask"].tolist() == [1] + [0] * 10]
        assert len(no_op) == infos["agent_0"]["dead_allies"]
        assert all(not seen[agent]["observation"].any() for agent in no_op)
        assert all(env.observation_space(agent).contains(seen[agent]) for agent in seen)
        died = max(died, len(no_op))
        observations = seen
    assert died > 0, "no agent died, so nothing was tested"


def test_a_seed_gives_the_same_battle_again(env: parallel_env) -> None:
    first = play(env, 7)
    assert play(env, 7) == first != play(env, 8)
    assert first[-1][2] == [] and first[0][2] == env.possible_agents


def test_a_time_out_truncates_all_agents() -> None:
    env = parallel_env("2s3z", episode_limit=2)
    env.reset()
    for _ in range(2):
        stop = dict.fromkeys(env.agents, 1)
        _, _, terminations, truncations, _ = env.step(stop)
    assert not any(terminations.values()) and all(truncations.values()) and env.agents == []
    with pytest.raises(sp.errors.InvalidRequest, match="reset"):
        env.step({})
    env.close()


def test_a_battle_that_had_ended_begins_without_agents() -> None:
    """All agents were listed, and their first step was an error. `restore` had listed none."""
    env = parallel_env("3m", episode_limit=1)
    env.reset(seed=1)
    env.step(dict.fromkeys(env.agents, 1))
    ended = env.save()
    env.reset()
    assert env.reset(options={"snapshot": ended})[1] == {} and env.agents == []
    env.reset()
    env.restore(ended)
    assert env.agents == []
    with pytest.raises(sp.errors.InvalidRequest, match="the battle has ended"):
        env.step({})
    for constructor in (pettingzoo.raw_env, pettingzoo.env):
        in_turns: Any = constructor("3m", episode_limit=1)
        with pytest.raises(sp.errors.InvalidRequest, match="the battle of this snapshot has ended"):
            in_turns.reset(options={"snapshot": ended})
        in_turns.reset(seed=1)
        assert in_turns.agents == in_turns.possible_agents
        in_turns.close()
    env.close()


def test_a_battle_that_healers_alone_had_lost_begins_without_agents() -> None:
    """It was a battle without end: agents were alive, and every step was refused."""
    teams = {"distribution": "fixed", "teams": [["MARINE", "MEDIVAC", "MEDIVAC"]]}
    env = parallel_env("terran_5_vs_5", seed=1, num_allied_units=3, num_enemy_units=3, teams=teams)
    for _ in range(20):
        seen, _ = env.reset()
        while env.agents:
            actions = {name: int(np.flatnonzero(own["action_mask"])[-1]) for name, own in seen.items()}
            seen, _, terminated, _, infos = env.step(actions)
        info = infos["agent_0"]
        if terminated["agent_0"] and 3 not in (info["dead_allies"], info["dead_enemies"]):
            break
    else:
        pytest.fail("healers never were alone")
    env.restore(env.save())
    assert env.agents == []
    env.close()


@pytest.mark.parametrize("constructor", [pettingzoo.env, pettingzoo.raw_env])
def test_pettingzoo_accepts_the_aec_interface(constructor: Any) -> None:
    made = constructor("2s3z", seed=3)
    api_test(made, num_cycles=200)
    made.close()
    seed_test(lambda: constructor("2s3z"), num_cycles=50)


def test_the_aec_battle_is_the_parallel_one(env: parallel_env) -> None:
    aec = pettingzoo.env("2s3z")
    observations, _ = env.reset(seed=5)
    aec.reset(seed=5)
    for _ in range(30):
        actions = {}
        for agent in env.agents:
            observation, _, terminated, truncated, _ = aec.last()
            assert aec.agent_selection == agent and not (terminated or truncated)
            assert np.array_equal(observation["observation"], observations[agent]["observation"])
            actions[agent] = max(np.flatnonzero(observation["action_mask"]).tolist())
            aec.step(actions[agent])
        observations, *_ = env.step(actions)
        if not env.agents:
            break
    aec.close()


@pytest.mark.parametrize(("scenario", "sides"), [("3m", "mirrored"), ("5m_vs_6m", "both"), ("MMM2", "both")])
def test_pettingzoo_accepts_both_teams(scenario: str, sides: str) -> None:
    def make() -> parallel_env:
        return parallel_env(scenario, sides=sides)

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = make()
        parallel_api_test(env, num_cycles=300)
        env.close()
        parallel_seed_test(make, num_cycles=100)
    made = pettingzoo.env(scenario, sides=sides, seed=3)
    api_test(made, num_cycles=200)
    made.close()


def test_a_plain_observation_has_its_mask_in_the_info(env: parallel_env) -> None:
    plain = parallel_env("2s3z", seed=3, action_mask="info")
    seen: Any = env.reset()[0]
    bare: Any
    bare, infos = plain.reset()
    while env.agents:
        for agent in seen:
            assert np.array_equal(bare[agent], seen[agent]["observation"])
            assert plain.observation_space(agent).contains(bare[agent])
            assert np.array_equal(infos[agent]["action_mask"], seen[agent]["action_mask"])
        actions = {agent: env.action_space(agent).sample() for agent in env.agents}
        seen, *_ = env.step(actions)
        bare, *_, infos = plain.step(actions)
    plain.close()
    with pytest.raises(sp.errors.InvalidRequest, match='"observation" or "info", got \'obs\''):
        parallel_env("3m", action_mask="obs")  # type: ignore[arg-type]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        made = parallel_env("3m", action_mask="info")
        parallel_api_test(made, num_cycles=100)
        made.close()


@pytest.mark.parametrize("sides", ["allies", "both"])
def test_agents_stop_instead_of_an_unavailable_action(sides: str) -> None:
    env = parallel_env("5m_vs_6m", illegal_actions="stop", sides=sides)
    env.reset(seed=1)
    while env.agents:
        env.step({agent: int(env.action_space(agent).n) - 1 for agent in env.agents})
    env.close()
    with pytest.raises(sp.errors.InvalidRequest, match="illegal_actions"):
        parallel_env("3m", illegal_actions="ignore")  # type: ignore[arg-type]


def test_an_environment_is_copied_by_its_arguments_before_its_first_reset() -> None:
    """SuperSuit's `concat_vec_envs_v1` said "cannot pickle 'smaclite_pool.Envs' object"."""
    for make in (parallel_env, pettingzoo.raw_env, pettingzoo.env):
        env: Any = make("3m", seed=3)
        again = pickle.loads(pickle.dumps(copy.deepcopy(env)))
        env.reset()
        again.reset()
        assert np.array_equal(env.state(), again.state())
        with pytest.raises(TypeError, match="after its first reset: `save` and `restore`"):
            copy.deepcopy(env)
        other: Any = parallel_env("3m")
        other.reset(options={"snapshot": env.unwrapped.save()})
        assert np.array_equal(other.state(), env.state())
        for made in (env, again, other):
            made.close()


WRAPPERS = ["black_death_v3", "pad_observations_v0", "agent_indicator_v0", "frame_stack_v1", "flatten_v0"]


def test_copies_of_an_action_space_draw_as_the_original_would(env: parallel_env) -> None:
    env.reset(seed=1)
    space = env.action_space("agent_0")
    space.seed(5)
    drawn = [[int(made.sample()) for _ in range(9)] for made in (copy.deepcopy(space), copy.deepcopy(space))]
    assert drawn[0] == drawn[1] and type(copy.deepcopy(space)) is gymnasium.spaces.Discrete


@pytest.mark.parametrize("name", WRAPPERS)
def test_wrappers_of_supersuit_take_plain_observations(name: str) -> None:
    """They refused the dict of observation and mask."""
    supersuit = pytest.importorskip("supersuit")
    wrapped = getattr(supersuit, name)(parallel_env("3m", action_mask="info", illegal_actions="stop"))
    observations, infos = wrapped.reset(seed=1)
    steps, ended = 0, False
    while not ended:
        for agent, observation in observations.items():
            assert wrapped.observation_space(agent).contains(observation)
        masks = {agent: info.get("action_mask") for agent, info in infos.items()}
        actions = {agent: int(np.argmax(masks[agent])) if agent in masks else 0 for agent in wrapped.agents}
        observations, _, terminations, truncations, infos = wrapped.step(actions)
        # `black_death_v3` of SuperSuit 3.11 reports an end only to environments that terminate and truncate.
        ended = any(terminations.values()) or any(truncations.values()) or not wrapped.unwrapped.agents
        steps += 1
    assert steps > 5
    wrapped.close()


@pytest.mark.parametrize("num_cpus", [0, 2])
def test_supersuit_joins_copies_to_one_vector(num_cpus: int) -> None:
    supersuit = pytest.importorskip("supersuit")
    env = parallel_env("3m", action_mask="info", illegal_actions="stop")
    vector = supersuit.pettingzoo_env_to_vec_env_v1(env)
    envs = supersuit.concat_vec_envs_v1(vector, 2, num_cpus=num_cpus, base_class="gymnasium")
    observations, _ = envs.reset(seed=1)
    assert observations.shape == (6, 30)
    for _ in range(70):  # beyond an end
        observations, rewards, *_ = envs.step(np.full(6, 6))
        assert observations.shape == (6, 30) and rewards.shape == (6,)
    envs.close()
