"""SMACv2's interface: what its environments do, with scripted battles and with real ones."""

from __future__ import annotations

import copy
import inspect
import pickle
from collections.abc import Iterator
from typing import Any, cast

import numpy as np
import pytest
import smaclite_pool as sp
from smaclite_pool._render import Window
from smaclite_pool.marl import smacv2
from smaclite_pool.marl.smacv2 import StarCraft2Env, StarCraftCapabilityEnvWrapper, Unavailable

from smacv2_kit import SMACV2_DEFAULTS, ScriptedBattle, standard


@pytest.fixture
def scripted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Environments play scripted battles."""
    monkeypatch.setattr("smaclite_pool.marl.smacv2.env.CapabilityBattle", ScriptedBattle)


def made(**options: Any) -> tuple[StarCraftCapabilityEnvWrapper, ScriptedBattle]:
    given = {"map_name": "10gen_terran", "capability_config": standard(), **options}
    env = StarCraftCapabilityEnvWrapper(**given)
    return env, cast(ScriptedBattle, env.env._battle)


# --- Playing


def idle(env: Any) -> list[int]:
    return [1] * env.n_agents


@pytest.mark.usefixtures("scripted")
def test_options_arrive_in_the_scenario() -> None:
    changed = {
        "move_amount": 3,
        "prob_obs_enemy": 0.5,
        "conic_fov": True,
        "reward_win": 100,
        "published": True,
    }
    _, battle = made(**changed)
    options = battle.scenario["smacv2"]
    assert {name: options[name] for name in changed} == changed
    assert set(options) - {"observe_team"} <= set(SMACV2_DEFAULTS) | {"published"}
    unchanged = made()[1].scenario["smacv2"]
    assert {name: unchanged[name] for name in changed} == {
        "move_amount": 2, "prob_obs_enemy": 1.0, "conic_fov": False, "reward_win": 200, "published": False
    }  # fmt: skip


@pytest.mark.usefixtures("scripted")
def test_env_info_and_attributes() -> None:
    env, battle = made(conic_fov=True)
    info = env.get_env_info()
    sizes = {name: info[name] for name in ("state_shape", "obs_shape", "cap_shape", "n_agents", "n_actions")}
    assert sizes == {"state_shape": 5, "obs_shape": 7, "cap_shape": 3, "n_agents": 5, "n_actions": 23}
    assert info["episode_limit"] == env.episode_limit == 200
    assert info["agent_features"][:4] == ["health", "energy/cooldown", "rel_x", "rel_y"]
    assert info["enemy_features"] == ["health", "rel_x", "rel_y", "type_0", "type_1", "type_2"]
    assert (env.n_actions_no_attack, env.map_type, env.unit_type_bits) == (18, "terran_gen", 3)
    assert (env.shield_bits_ally, env.reward_death_value, env.max_reward) == (0, 10, 1000)
    assert env.env.n_enemies == env.n_enemies == 5
    assert env.get_state().tolist() == [0.0] * 5  # as in SMACv2, before the first reset
    assert env.agents == {} and env.get_unit_types() == []
    with pytest.raises(AttributeError, match="no_such"):
        _ = env.no_such
    assert battle.steps == 0


@pytest.mark.usefixtures("scripted")
def test_units() -> None:
    env, _ = made()
    env.reset()
    env.step(idle(env))
    agents, enemies = env.agents, env.env.enemies
    assert list(agents) == list(enemies) == [0, 1, 2, 3, 4]
    of_agents = [agents[agent].unit_type for agent in range(3)]
    assert of_agents == [env.marine_id, env.marauder_id, env.medivac_id] == env.get_unit_types()[:3]
    assert enemies[0].unit_type == 54 and enemies[0].name == "MEDIVAC" and enemies[0].owner == 2
    assert agents[3].pos == (3.0, 1.0) and agents[3].pos.x == 3.0
    assert agents[0].health == 99 and env.previous_ally_units[0].health == 100
    assert env.previous_enemy_units[0].health == 100
    # Ids of agents ascend by the name of the type, as agents are ordered by them.
    names = [
        "baneling",
        "colossus",
        "hydralisk",
        "marauder",
        "marine",
        "medivac",
        "stalker",
        "zealot",
        "zergling",
    ]
    ids = [getattr(env, f"{name}_id") for name in names]
    assert ids == sorted(set(ids))


@pytest.mark.usefixtures("scripted")
def test_what_a_reset_and_a_step_return() -> None:
    env, battle = made()
    obs, state = env.reset()
    assert isinstance(obs, list) and len(obs) == 5 and obs[0].dtype == state.dtype == np.float32
    available = env.get_avail_actions()
    assert type(available[0][0]) is int and available[2] == env.get_avail_agent_actions(2)
    reward, terminated, info = env.step(np.array([1, 2, 3, 4, 5.9]))  # numbers are truncated, as in SMACv2
    env.step(np.array([[5], [4], [3], [2], [1]]))  # as HARL passes them
    assert (reward, terminated, battle.actions) == (0.5, False, [[1, 2, 3, 4, 5], [5, 4, 3, 2, 1]])
    assert info == {"battle_won": False, "dead_allies": 0, "dead_enemies": 0}
    seen = env.get_visibility_matrix()
    assert seen.shape == (5, 10) and seen.dtype == np.bool_
    assert env.get_capabilities().shape == (15,) and env.get_capabilities_agent(1).tolist() == [3, 4, 5]


@pytest.mark.usefixtures("scripted")
def test_an_unavailable_action_is_an_assertion_error_with_smacv2s_text() -> None:
    """TorchRL compares the text, to tell its users about masks."""
    env, battle = made()
    with pytest.raises(sp.errors.InvalidRequest, match="call reset first"):
        env.step(idle(env))
    env.reset()
    for action in (0, -1, 11):
        with pytest.raises(AssertionError, match=rf"^Agent 2 cannot perform action {action}") as caught:
            env.step([1, 1, action, 1, 1])
        assert isinstance(caught.value, sp.errors.IllegalAction)
        again = pickle.loads(pickle.dumps(caught.value))
        assert (again.agent, again.action, again.available) == (2, action, list(range(1, 11)))
    with pytest.raises(sp.errors.InvalidRequest, match="one per agent, 5, got 4"):
        env.step([1] * 4)
    assert battle.steps == 0


@pytest.mark.usefixtures("scripted")
def test_time_outs_and_statistics() -> None:
    for continuing in (False, True):
        env, battle = made(continuing_episode=continuing)
        assert env.get_stats()["win_rate"] == 0
        battle.ends = {2: {"over": True, "battle_won": True}}
        env.reset()
        ends = [env.step(idle(env)) for _ in range(2)]
        assert [ended for _, ended, _ in ends] == [False, True]
        with pytest.raises(sp.errors.InvalidRequest, match="has ended"):
            env.step(idle(env))
        battle.ends = {1: {"episode_limit": True}}
        env.reset()
        _, ended, info = env.step(idle(env))
        assert ended and info.get("episode_limit") == (True if continuing else None)
        assert (env.env.win_counted, env.env.defeat_counted, env.env._episode_steps) == (False, False, 1)
        assert env.env.timeouts == 1
        assert env.get_stats() == {
            "battles_won": 1, "battles_game": 2, "battles_draw": 1, "win_rate": 0.5, "timeouts": 1,
            "restarts": 0,
        }  # fmt: skip


@pytest.mark.usefixtures("scripted")
@pytest.mark.parametrize("published", [False, True])
def test_agents_look_at_each_observation_in_the_published_code_only(published: bool) -> None:
    """EPyMARL gets observations twice per step; in the published code the second ones can be others."""
    env, _ = made(published=published)
    looks = [env.reset()[0], env.get_obs()]
    env.step(idle(env))
    looks += [env.get_obs(), env.get_obs(), [env.get_obs_agent(0)]]
    assert [int(obs[0][0]) for obs in looks] == ([1, 2, 3, 4, 4] if published else [1, 1, 2, 2, 2])


@pytest.mark.usefixtures("scripted")
def test_the_time_is_double_in_the_published_code_only() -> None:
    for published, kind in ((False, np.float32), (True, np.float64)):
        env, _ = made(published=published, obs_timestep_number=True)
        env.reset()
        env.step(idle(env))
        obs = env.get_obs()[1]
        assert obs.dtype == kind and (obs[-1] == 1 / 3) is np.bool_(published)


def test_options_that_json_cannot_say_are_refused() -> None:
    for name in ("3m", "10gen_terran"):
        with pytest.raises(sp.errors.ScenarioError):
            StarCraft2Env(
                name, capability_config=standard() if "gen" in name else None, reward_win=float("nan")
            )


@pytest.mark.parametrize("name", ["corridor", "bane_vs_bane", "2s_vs_1sc", "MMM2"])
def test_maps_of_smac_have_the_battles_of_make(name: str) -> None:
    """Where a map lists its enemies first, units had other ids, and battles other bits."""
    env = StarCraft2Env(name, seed=4)
    env.reset()
    with sp.make(name, 1, seed=4, smacv2=env._scenario["smacv2"]) as envs:
        batch, generator = envs.reset(), np.random.default_rng(0)
        for _ in range(20):
            assert np.array_equal(env.get_state(), batch.state[0])
            actions = [int(generator.choice(np.flatnonzero(row))) for row in env.get_avail_actions()]
            env.step(actions)
            batch = envs.step([actions])
    env.close()


@pytest.mark.usefixtures("scripted")
def test_seeds_reach_the_battle() -> None:
    env, battle = made(seed=3)
    assert env.seed() == 3
    env.reset()
    env.reset()
    assert env.seed(8) == 8
    env.reset()
    env.reset()
    assert battle.seeds == [3, 8]
    one, other = (made()[1].seeds[0] for _ in range(2))
    assert one != other


@pytest.mark.usefixtures("scripted")
def test_what_is_not_offered_says_so() -> None:
    env, _ = made()
    env.reset()
    for call, what in ((env.save_replay, "save_replay"), (env.full_restart, "full_restart")):
        with pytest.raises(Unavailable, match=f"{what} is not offered"):
            call()
    with pytest.raises(Unavailable, match="team_gen cannot be given"):
        env.env.reset({"team_gen": {"ally_team": ["marine"] * 5}})
    env.env.reset(smacv2.get_distribution("weighted_teams")({"env_key": "team_gen"}).generate())
    for options, what in (({"heuristic_ai": True}, "heuristic_ai"), ({"step_mul": 4}, "step_mul must be 8")):
        with pytest.raises(Unavailable, match=what):
            made(**options)
    env.close()
    env.close()


@pytest.mark.usefixtures("scripted")
def test_the_wrapper_can_be_copied() -> None:
    """In SMACv2 a copy ends in endless recursion, as its wrapper asks itself for its environment."""
    env, _ = made()
    env.reset()
    assert copy.copy(env).env is env.env
    again = copy.deepcopy(env)
    again.step(idle(again))
    assert (again.agents[0].health, env.agents[0].health) == (99, 100)


def test_the_base_class_has_no_methods() -> None:
    assert issubclass(StarCraft2Env, smacv2.MultiAgentEnv)
    assert issubclass(StarCraftCapabilityEnvWrapper, smacv2.MultiAgentEnv)
    assert not issubclass(StarCraftCapabilityEnvWrapper, StarCraft2Env)
    with pytest.raises(NotImplementedError):
        smacv2.MultiAgentEnv().get_obs()


def test_the_wrapper_has_the_methods_of_its_environment() -> None:
    of_class = {
        name: method for name, method in vars(StarCraftCapabilityEnvWrapper).items() if name[0] != "_"
    }
    base = {name for name in vars(smacv2.MultiAgentEnv) if name[0] != "_"}
    assert {*base, "get_obs_feature_names", "get_state_feature_names", "get_stats"} == {*of_class}
    for name, method in of_class.items():
        assert inspect.signature(method) == inspect.signature(getattr(StarCraft2Env, name))
        assert method.__qualname__ == f"StarCraftCapabilityEnvWrapper.{name}"
        assert method.__doc__ == f"As `StarCraft2Env.{name}`."


# --- With real battles


@pytest.fixture
def env() -> Iterator[StarCraftCapabilityEnvWrapper]:
    made = StarCraftCapabilityEnvWrapper(map_name="10gen_terran", capability_config=standard(), seed=5)
    yield made
    made.close()


def test_pictures(monkeypatch: pytest.MonkeyPatch, env: StarCraftCapabilityEnvWrapper) -> None:
    with pytest.raises(sp.errors.InvalidRequest, match="call reset first"):
        env.render()
    small = StarCraft2Env(
        "10gen_zerg", capability_config=standard("zerg"), seed=0, window_size_x=64, window_size_y=48
    )
    small.reset()
    picture = small.render("rgb_array")
    assert isinstance(picture, np.ndarray) and picture.shape == (48, 64, 3) and picture.dtype == np.uint8
    shown: list[Any] = []
    monkeypatch.setattr(Window, "show", lambda _, picture: shown.append(picture))
    small.render()
    assert np.array_equal(shown, [picture])
    small.reset()
    assert not np.array_equal(small.render("rgb_array"), picture)
    with pytest.raises(sp.errors.InvalidRequest, match="got 'ansi'"):
        small.render("ansi")
    small.close()
    tiny = StarCraft2Env("3m", window_size_x=8)
    tiny.reset()
    with pytest.raises(sp.errors.InvalidRequest, match="16"):
        tiny.render("rgb_array")


def random_episode(env: Any, rng: np.random.Generator) -> list[Any]:
    """Everything of an episode of random available actions."""
    found: list[Any] = [env.reset(), env.get_unit_types()]
    terminated = False
    while not terminated:
        actions = [int(rng.choice(np.flatnonzero(row))) for row in env.get_avail_actions()]
        found.append((env.step(actions), env.get_obs(), env.get_state()))
        terminated = found[-1][0][1]
    return found


def test_seeds_reproduce_episodes(env: StarCraftCapabilityEnvWrapper) -> None:
    first = [random_episode(env, np.random.default_rng(0)) for _ in range(2)]
    assert first[0][1] != first[1][1] or not np.array_equal(first[0][0][1], first[1][0][1])
    env.seed(5)
    np.testing.assert_equal(random_episode(env, np.random.default_rng(0)), first[0])
    env.close()
    with pytest.raises(sp.errors.Closed):
        env.reset()


@pytest.mark.parametrize("published", [False, True])
def test_the_greatest_return_is_of_one_reset_or_of_all(published: bool) -> None:
    """TorchRL resets twice before the first step; in the published code, rewards are scaled down by that."""
    config = standard("protoss")
    env = StarCraft2Env("10gen_protoss", capability_config=config, seed=1, published=published)
    greatest = [5 * 10 + 200.0]
    for _ in range(2):
        env.reset()
        worth = sum(enemy.health_max + enemy.shield_max for enemy in env.enemies.values())
        greatest.append((greatest[-1] if published else greatest[0]) + worth)
        assert env.max_reward == greatest[-1]
    env.close()


@pytest.mark.parametrize(
    "map_name", ["10gen_terran", "10gen_zerg", "10gen_protoss", "MMM2", "3m", "bane_vs_bane"]
)
@pytest.mark.parametrize("options", [{}, {"conic_fov": True, "obs_last_action": True}, {"published": True}])
def test_sizes_agree_with_what_comes(map_name: str, options: dict[str, Any]) -> None:
    race = map_name.removeprefix("10gen_")
    config = standard(race, 5, 6) if race != map_name else {}
    env = StarCraftCapabilityEnvWrapper(map_name=map_name, capability_config=config, seed=1, **options)
    obs, state = env.reset()
    info = env.get_env_info()
    assert [len(row) for row in obs] == [info["obs_shape"]] * info["n_agents"]
    assert state.shape == (info["state_shape"],)
    assert len(env.get_obs_feature_names()) == info["obs_shape"]
    assert len(env.get_state_feature_names()) == info["state_shape"]
    assert env.get_capabilities().shape == (info["n_agents"] * info["cap_shape"],)
    assert np.array(env.get_avail_actions()).shape == (info["n_agents"], info["n_actions"])
    random_episode(env, np.random.default_rng(1))
    assert env.get_stats()["battles_game"] == 1
    env.close()
