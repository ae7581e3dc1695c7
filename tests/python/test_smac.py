"""SMAC's interface: sizes, options, rewards, queries and errors, compared with the arrays of the pool."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp
from smaclite_pool.marl.on_policy import ShareVecEnv
from smaclite_pool.marl.smac import Direction, MultiAgentEnv, Unavailable, get_map_params

from conftest import changed_scenario, replayed

# All options of SMAC with their defaults.
SMAC_DEFAULTS: dict[str, object] = {
    "map_name": "8m", "step_mul": 8, "move_amount": 2, "difficulty": "7", "game_version": None, "seed": None,
    "continuing_episode": False, "obs_all_health": True, "obs_last_action": False, "obs_pathing_grid": False,
    "obs_own_health": True, "obs_terrain_height": False, "obs_instead_of_state": False,
    "obs_timestep_number": False, "state_last_action": True, "state_timestep_number": False,
    "reward_sparse": False, "reward_only_positive": True, "reward_death_value": 10, "reward_win": 200,
    "reward_defeat": 0, "reward_negative_scale": 0.5, "reward_scale": True, "reward_scale_rate": 20,
    "replay_dir": "", "replay_prefix": "", "window_size_x": 1920, "window_size_y": 1200,
    "heuristic_ai": False, "heuristic_rest": False, "debug": False,
}  # fmt: skip


def legal(env: MultiAgentEnv, rng: np.random.Generator) -> list[int]:
    return [int(rng.choice(np.flatnonzero(row))) for row in env.get_avail_actions()]


def play(envs: list[MultiAgentEnv], steps: int, seed: int = 0) -> list[list[float]]:
    """The same random available actions in all environments, for at most an episode; the rewards of each."""
    rng = np.random.default_rng(seed)
    for env in envs:
        env.reset()
    rewards: list[list[float]] = [[] for _ in envs]
    for _ in range(steps):
        actions = legal(envs[0], rng)
        results = [env.step(actions) for env in envs]
        for own, (reward, _, _) in zip(rewards, results, strict=True):
            own.append(reward)
        assert len({ended for _, ended, _ in results}) == 1
        if results[0][1]:
            break
    return rewards


def test_takes_every_option_of_smac_with_its_default() -> None:
    parameters = inspect.signature(MultiAgentEnv).parameters.values()
    ours = {p.name: p.default for p in parameters if p.kind is not p.KEYWORD_ONLY}
    assert ours == SMAC_DEFAULTS


def test_smacs_default_map_plays() -> None:
    # The examples of SMAC name no map and get 8m. That map was missing, so they failed on their first line.
    env = MultiAgentEnv()
    env.reset()
    assert (env.map_name, env.n_agents, env.n_enemies, env.episode_limit) == ("8m", 8, 8, 120)
    env.step([1] * 8)
    env.close()


# SMAC's table of maps: agents, enemies, limit, and length of the type one-hot.
MAP_PARAMS = {
    "3m": (3, 3, 60, 0), "8m": (8, 8, 120, 0), "25m": (25, 25, 150, 0), "5m_vs_6m": (5, 6, 70, 0),
    "8m_vs_9m": (8, 9, 120, 0), "10m_vs_11m": (10, 11, 150, 0), "27m_vs_30m": (27, 30, 180, 0),
    "MMM": (10, 10, 150, 3), "MMM2": (10, 12, 180, 3), "2s3z": (5, 5, 120, 2), "3s5z": (8, 8, 150, 2),
    "3s5z_vs_3s6z": (8, 9, 170, 2), "3s_vs_3z": (3, 3, 150, 0), "3s_vs_4z": (3, 4, 200, 0),
    "3s_vs_5z": (3, 5, 250, 0), "1c3s5z": (9, 9, 180, 3), "2m_vs_1z": (2, 1, 150, 0),
    "corridor": (6, 24, 400, 0), "6h_vs_8z": (6, 8, 150, 0), "2s_vs_1sc": (2, 1, 300, 0),
    "so_many_baneling": (7, 32, 100, 0), "bane_vs_bane": (24, 24, 200, 2), "2c_vs_64zg": (2, 64, 400, 0),
}  # fmt: skip


def test_knows_every_map_of_smac() -> None:
    assert set(MAP_PARAMS) == set(sp.scenarios(generated=False))
    for name, expected in MAP_PARAMS.items():
        params = get_map_params(name)
        found = (params["n_agents"], params["n_enemies"], params["limit"], params["unit_type_bits"])
        assert found == expected, name


@pytest.mark.parametrize("scenario", sp.scenarios(generated=False))
def test_default_observations_and_state_are_the_pools(scenario: str) -> None:
    env = MultiAgentEnv(scenario, seed=3)
    envs = sp.make(scenario, 1, seed=3, threads=1, autoreset_mode="Disabled")
    obs, state = env.reset()
    batch = envs.reset()
    info = env.get_env_info()
    names = {"n_agents": "n_agents", "obs_shape": "obs_size", "state_shape": "state_size"}
    names |= {"n_actions": "n_actions", "episode_limit": "episode_limit"}
    assert {key: info[key] for key in names} == {key: getattr(envs.spec, names[key]) for key in names}
    rng = np.random.default_rng(1)
    for _ in range(30):
        np.testing.assert_array_equal(np.stack(obs), batch.obs[0])
        np.testing.assert_array_equal(state, batch.state[0])
        np.testing.assert_array_equal(env.get_avail_actions(), batch.avail_actions[0])
        assert state.dtype == np.float32 and all(row.shape == (envs.spec.obs_size,) for row in obs)
        actions = legal(env, rng)
        reward, ended, _ = env.step(np.array(actions))  # numpy's integers are legal
        batch = envs.step([actions])
        assert reward == batch.reward[0] and ended == (batch.terminated[0] or batch.truncated[0])
        if ended:
            break
        obs, state = env.get_obs(), env.get_state()
    env.close()
    envs.close()


OPTIONS: list[dict[str, Any]] = [
    {"obs_last_action": True},
    {"obs_all_health": False},
    {"obs_all_health": False, "obs_own_health": False},
    {"obs_pathing_grid": True, "obs_terrain_height": True},
    {"obs_timestep_number": True, "state_timestep_number": True, "state_last_action": False},
    {
        "obs_instead_of_state": True,
        "obs_last_action": True,
        "obs_timestep_number": True,
        "obs_pathing_grid": True,
    },
]


@pytest.mark.parametrize("options", OPTIONS, ids=lambda options: "-".join(options))
@pytest.mark.parametrize("scenario", ["MMM2", "2s3z", "2c_vs_64zg", "corridor"])
def test_sizes_agree_with_what_comes(scenario: str, options: dict[str, Any]) -> None:
    env = MultiAgentEnv(scenario, seed=1, **options)
    play([env], 8)
    assert [len(row) for row in env.get_obs()] == [env.get_obs_size()] * env.n_agents
    assert env.get_state().shape == (env.get_state_size(),)
    assert env.get_obs_agent(1).tolist() == env.get_obs()[1].tolist()
    env.close()


def test_options_cut_and_add_where_smac_does() -> None:
    options: dict[str, Any] = dict.fromkeys(
        ["obs_last_action", "obs_pathing_grid", "obs_terrain_height", "obs_timestep_number"], True
    )
    plain, rich = MultiAgentEnv("2s3z", seed=1), MultiAgentEnv("2s3z", seed=1, **options)
    bare = MultiAgentEnv("2s3z", seed=1, obs_all_health=False, obs_own_health=False)
    play([plain, rich, bare], 5)
    enemies, allies, own = 5 * 8, 4 * 8, 4
    for agent in range(5):
        base, more, less = plain.get_obs_agent(agent), rich.get_obs_agent(agent), bare.get_obs_agent(agent)
        moves, rest = more[: 4 + 8 + 9], more[4 + 8 + 9 :]
        np.testing.assert_array_equal(moves[:4], base[:4])
        np.testing.assert_array_equal(moves[12:], np.zeros(9))  # no agent is near the edge of the map
        np.testing.assert_array_equal(rest[:enemies], base[4 : 4 + enemies])
        others = rest[enemies : enemies + 4 * (8 + 11)].reshape(4, 19)
        np.testing.assert_array_equal(others[:, :8].ravel(), base[4 + enemies : 4 + enemies + allies])
        last = np.delete(rich.get_state_dict()["last_action"], agent, axis=0)
        np.testing.assert_array_equal(others[:, 8:], last * others[:, :1])
        np.testing.assert_array_equal(rest[-own - 1 : -1], base[-own:])
        assert rest[-1] == np.float32(5 / 120)
        cut = np.delete(base[4 : 4 + enemies].reshape(5, 8), [4, 5], axis=1)
        np.testing.assert_array_equal(less[4 : 4 + 5 * 6], cut.ravel())
        np.testing.assert_array_equal(less[-2:], base[-2:])
    for env in (plain, rich, bare):
        env.close()


def test_pathing_grid_is_the_map_around() -> None:
    env = MultiAgentEnv("2s_vs_1sc", seed=1, obs_pathing_grid=True)
    play([env], 20, seed=2)
    walkable = np.array(sp.scenario("2s_vs_1sc")["walkable"])
    around = [(0, 4), (0, -4), (4, 0), (-4, 0), (2, 2), (-2, -2), (2, -2), (-2, 2)]
    seen = set()
    for agent, unit in env.agents.items():
        x, y = int(unit.pos.x), int(unit.pos.y)
        points = [(x + east, y + north) for east, north in around]
        expected = [not (0 <= x < 32 and 0 <= y < 32) or bool(walkable[y, x]) for x, y in points]
        assert env.get_obs_agent(agent)[4:12].tolist() == expected == env.get_surrounding_pathing(unit)
        seen |= set(expected)
    assert seen == {True, False}
    env.close()


@pytest.mark.parametrize("scenario", ["MMM2", "2s3z", "bane_vs_bane"])
def test_visibility_and_positions_of_units(scenario: str) -> None:
    env = MultiAgentEnv(scenario, seed=1)
    info = sp.scenario(scenario)
    env.reset()
    for unit, start in zip(env.agents.values(), info["allies"], strict=True):
        assert np.allclose(unit.pos, start["position"], atol=1e-5)
        assert unit.health == unit.health_max == start["hp"]
    assert env.get_unit_types() == [unit["type_id"] for unit in info["allies"] + info["enemies"]]
    play([env], 25)
    units = [*env.agents.values(), *env.enemies.values()]
    seen = env.get_visibility_matrix()
    for agent, own in env.agents.items():
        for index, other in enumerate(units):
            near = env.distance(*own.pos, *other.pos) < env.unit_sight_range(agent)
            assert seen[agent, index] == (near and own.health > 0 and other.health > 0 and index != agent)
    assert seen.any()
    env.close()


@pytest.mark.parametrize("scenario", ["terran_5_vs_5", "zerg_5_vs_5"])
def test_units_that_are_drawn_are_those_of_the_episode(scenario: str) -> None:
    types = sp.scenario(scenario)["unit_types"]
    teams, healed = set(), 0.0
    for seed in range(6):
        with sp.make(scenario, 1, seed=seed, fields=["level"]) as envs:
            drawn = [types[int(index)] for index in envs.reset().level[0, :, 0]]
        env = MultiAgentEnv(scenario, seed=seed, heuristic_ai=True, heuristic_rest=True)
        env.reset()
        units = [*env.agents.values(), *env.enemies.values()]
        assert [unit.name for unit in units] == [stats["unit_type"] for stats in drawn]
        assert [unit.health for unit in units] == [stats["hp"] for stats in drawn]
        assert env.get_unit_types() == [stats["type_id"] for stats in drawn]
        of_enemies = sum(stats["hp"] + stats["shield"] for stats in drawn[env.n_agents :])
        assert env.max_reward == 10 * env.n_enemies + 200 + of_enemies
        for agent, stats in enumerate(drawn[: env.n_agents]):
            assert env.unit_sight_range(agent) == stats["sight_range"]
            assert env.unit_shoot_range(agent) == stats["targeting_range"]
        ended = False
        while not ended:
            before = {agent: unit.health for agent, unit in env.agents.items()}
            _, ended, _ = env.step([0] * env.n_agents)
            healed += sum(max(unit.health - before[agent], 0.0) for agent, unit in env.agents.items())
        # Also of the dead, whose types the state does not show.
        assert [unit.name for unit in env.agents.values()] == [
            stats["unit_type"] for stats in drawn[: env.n_agents]
        ]
        teams.add(env.map_type)
        assert getattr(env, f"{types[0]['unit_type'].lower()}_id") == types[0]["type_id"]
        env.close()
    assert len(teams) > 1
    if scenario == "terran_5_vs_5":  # zerg units regenerate
        assert healed > 0  # a medivac that the heuristic takes for another unit never heals


def test_the_opponent_is_the_scenarios_own() -> None:
    scenario = "zerg_5_vs_5"
    with sp.make(scenario, 1) as envs:
        expected = envs.spec.opponents
    assert expected != {"attack_move": 1.0}
    env = MultiAgentEnv(scenario)
    assert env._battle.envs.spec.opponents == expected
    env.close()
    vector = ShareVecEnv(scenario, 1)
    assert vector._envs.spec.opponents == expected
    vector.close()


@pytest.mark.parametrize(
    ("scenario", "keys", "words"),
    [
        ("zerg_5_vs_5", {"smacv2": {"obs_timestep_number": True}}, "`obs` the parts.*time.*this class reads"),
        ("terran_5_vs_5", {"smacv2": {"conic_fov": True}}, "`conic_fov` .* in the scenario is not false"),
        ("terran_5_vs_5", {"smacv2": {"obs_all_health": False}}, "`obs_all_health` .* is not true"),
        (
            "terran_5_vs_5",
            {"smacv2": {"health": {"lower_bound": 0.3, "upper_bound": 0.6}}},
            "`health` of `smacv2` in the scenario is not null",
        ),
        ("terran_5_vs_5", {"num_unit_types": 0, "unit_type_ids": {}}, "must tell the types of units, which"),
    ],
)
def test_what_smac_cannot_tell_is_refused(
    scenario: str, keys: dict[str, Any], words: str, tmp_path: Path
) -> None:
    """The scripted player looked around instead of attacking; units that lived were dead, with -11 health;
    and units, pictures and rewards were those of a sample, not of the episode."""
    path = changed_scenario(tmp_path, scenario, **keys)
    with pytest.raises(sp.errors.InvalidRequest, match=words):
        MultiAgentEnv(path)
    if "num_unit_types" in keys:
        with sp.make(path, 1) as envs, pytest.raises(sp.errors.InvalidRequest, match=words):
            sp.extras.AgentViews(envs)


def test_attributes_of_rewards_are_those_of_the_scenario(tmp_path: Path) -> None:
    env = MultiAgentEnv(changed_scenario(tmp_path, "3m", rewards={"reward_win": 50}))
    assert env.reward_win == 50 and env.reward_scale_rate == 20
    env.close()


def test_options_of_rewards_are_those_of_the_battle() -> None:
    """What they do is tested in tests/battles/rewards.rs."""
    options: dict[str, Any] = {name: SMAC_DEFAULTS[name] for name in SMAC_DEFAULTS if "reward" in name}
    other: dict[str, Any] = {
        name: not value if isinstance(value, bool) else value + 1.5 for name, value in options.items()
    }
    for given in (options, other):
        env = MultiAgentEnv("2s3z", **given)
        assert env._battle.envs.spec.rewards == given
        env.close()


@pytest.mark.parametrize("published", [False, True])
def test_time_out_is_terminated_and_marked_only_if_asked(published: bool, tmp_path: Path) -> None:
    """With SMACv2's published code it was a defeat, and never marked."""
    scenario = changed_scenario(tmp_path, "3s_vs_5z", smacv2={"published": True}) if published else "3s_vs_5z"
    for continuing in (False, True):
        env = MultiAgentEnv(scenario, seed=1, episode_limit=3, continuing_episode=continuing)
        env.reset()
        for step in range(3):
            _, terminated, info = env.step([1, 1, 1])
            assert terminated == (step == 2)
        assert info.get("episode_limit", False) is continuing
        assert not info["battle_won"] and info["dead_allies"] == info["dead_enemies"] == 0
        stats = env.get_stats()
        assert (stats["battles_game"], stats["battles_draw"], stats["timeouts"]) == (1, 1, 1)
        assert not env.defeat_counted
        env.reset()
        assert not env.step([1, 1, 1])[1]
        env.close()


def test_unsupported_options_are_refused_with_the_reason() -> None:
    refused: dict[str, tuple[object, str]] = {
        "step_mul": (4, "8 ticks"),
        "move_amount": (3, "2 squares"),
        "difficulty": ("A", "fixed script"),
        "game_version": ("4.10", "StarCraft"),
        "heuristic_ai": (True, "heuristic_rest"),
    }
    for name, (value, reason) in refused.items():
        options: dict[str, Any] = {name: value}
        with pytest.raises(Unavailable, match=reason) as caught:
            MultiAgentEnv("2s3z", **options)
        assert isinstance(caught.value, sp.errors.PoolError | NotImplementedError)
    with pytest.raises(sp.errors.ScenarioError, match="2s3z"):
        MultiAgentEnv("no_such_map")
    with pytest.raises(sp.errors.InvalidRequest, match="episode limit"):
        MultiAgentEnv("2s3z", obs_timestep_number=True, episode_limit=None)
    with pytest.raises(sp.errors.ScenarioError, match="reward_scale_rate"):
        MultiAgentEnv("2s3z", reward_scale_rate=0)


def test_an_illegal_action_steps_nothing() -> None:
    env = MultiAgentEnv("2s3z", seed=1)
    env.reset()
    before = env.get_state()
    with pytest.raises(sp.errors.IllegalAction) as caught:
        env.step([1, 1, 0, 1, 1])  # no-op is for dead agents
    assert (caught.value.agent, caught.value.action) == (2, 0)
    wrong_actions: list[Any] = [
        [1, 1, 1.5, 1, 1],
        [1, 1, 1, 1],
        [1, 1, None, 1, 1],
        [1, 1, np.nan, 1, 1],
        np.ones((5, 2), int),
    ]
    for wrong in wrong_actions:
        with pytest.raises(sp.errors.InvalidRequest):
            env.step(wrong)
    np.testing.assert_array_equal(env.get_state(), before)
    env.step([1.0, np.int64(1), np.float32(1), True, 1])
    env.step(np.ones((5, 1), int))
    env.close()


def test_stats_before_the_first_battle_and_close_twice() -> None:
    env = MultiAgentEnv("MMM")
    assert not np.any(env.get_obs()) and not np.any(env.get_state()) and not env.get_visibility_matrix().any()
    assert env.get_stats()["win_rate"] == 0 and env.get_total_actions() == env.n_actions == 16
    assert get_map_params("MMM") == {"n_agents": 10, "n_enemies": 10, "limit": 150, "unit_type_bits": 3}
    assert env.get_env_info()["agent_features"][-3:] == ["type_0", "type_1", "type_2"]
    assert len(env.get_env_info()["enemy_features"]) == env.get_enemy_num_attributes() == 6
    env.close()
    env.close()


def test_the_seed_determines_the_episodes() -> None:
    envs = [MultiAgentEnv("MMM2", seed=seed, heuristic_ai=True, heuristic_rest=True) for seed in (7, 7, 8)]
    first, second, other = (play([env], 30)[0] for env in envs)
    assert first == second != other and envs[0].seed() == 7
    assert play([envs[0]], 30)[0] != first  # the random generator continues
    assert envs[0].seed(7) == 7
    assert play([envs[0]], 30)[0] == first
    assert MultiAgentEnv("MMM2").seed() != MultiAgentEnv("MMM2").seed()
    for env in envs:
        env.close()


@pytest.mark.parametrize("scenario", ["MMM2", "corridor", "2s_vs_1sc", "bane_vs_bane", "3m"])
def test_the_heuristic_uses_available_actions_and_writes_them_back(scenario: str) -> None:
    env = MultiAgentEnv(scenario, seed=1, heuristic_ai=True, heuristic_rest=True)
    env.reset()
    ended, attacks = False, 0
    while not ended:
        actions = [0] * env.n_agents
        _, ended, info = env.step(actions)
        np.testing.assert_array_equal(env.get_state_dict()["last_action"].argmax(axis=1), actions)
        attacks += sum(action >= 6 for action in actions)
    assert attacks > 0 and info["dead_allies"] + info["dead_enemies"] > 0
    assert info["battle_won"] == (scenario == "3m")
    assert env.battles_won == env.get_stats()["win_rate"] == info["battle_won"]
    # on-policy and PARL read these.
    assert env.win_counted == info["battle_won"]
    assert env.defeat_counted == (info["dead_allies"] == env.n_agents and not env.win_counted)
    assert env._episode_steps == env._total_steps > 1 and env._episode_count == 1
    env.reset()
    assert not env.win_counted and not env.defeat_counted and env._episode_steps == 0 < env._total_steps
    env.close()


def test_a_saved_replay_plays_again(tmp_path: Path) -> None:
    env = MultiAgentEnv("2s3z", seed=4, replay_dir=str(tmp_path / "new"), replay_prefix="mine")
    with pytest.raises(sp.errors.InvalidRequest, match="reset"):
        env.save_replay()
    play([env], 12)
    path = env.save_replay()
    assert path.name.startswith("mine_") and path.suffix == ".smreplay"
    assert "recorded for 12 steps" in replayed(path)
    env.close()


def test_a_picture_shows_units_where_they_stand() -> None:
    env = MultiAgentEnv("2s_vs_1sc", seed=1, window_size_x=640, window_size_y=320)
    env.reset()
    picture = env.render(mode="rgb_array")
    assert isinstance(picture, np.ndarray) and picture.shape == (320, 640, 3) and picture.dtype == np.uint8

    red, _, blue = picture.astype(int).transpose(2, 0, 1)
    allies, enemies = np.argwhere(blue - red > 45), np.argwhere(red - blue > 45)
    assert len(allies) > 20 and len(enemies) > 20
    (y, x), (enemy_y, enemy_x) = allies.mean(0), enemies.mean(0)
    ally, enemy = np.mean([unit.pos for unit in env.agents.values()], axis=0), env.enemies[0].pos
    to_enemy = np.array([enemy_x - x, y - enemy_y])  # in pixels, y north
    offset = np.array(enemy) - ally
    assert to_enemy @ offset > 0.98 * np.linalg.norm(to_enemy) * np.linalg.norm(offset)
    env.step([4, 4])
    assert not np.array_equal(picture, env.render(mode="rgb_array"))
    with pytest.raises(sp.errors.InvalidRequest, match="mode must be"):
        env.render(mode="ansi")  # type: ignore[arg-type]
    env.close()


def test_scripts_read_the_attributes_of_smac() -> None:
    """SMAC's environment has `can_move`, `last_action` and `death_tracker_ally`; the replacement had not."""
    env = MultiAgentEnv("corridor", seed=1, obs_last_action=True, reward_win=100)
    assert not env.death_tracker_ally.any() and not env.death_tracker_enemy.any()
    env.reset()
    assert env.obs_last_action is True and env.obs_pathing_grid is False and env.reward_win == 100
    assert env.last_action.shape == (6, env.n_actions) and not env.last_action.any()
    grid = env.pathing_grid
    assert grid.shape == env.terrain_height.shape == (env.map_x, env.map_y) and 0 < grid.mean() < 1
    assert env.check_bounds(0, 0) and not env.check_bounds(env.map_x, 0)
    rng, died = np.random.default_rng(1), 0.0
    while True:
        for agent, unit in env.agents.items():
            points = env.get_surrounding_points(unit, include_self=True)
            assert len(points) == 9 and points[8] == (int(unit.pos.x), int(unit.pos.y))
            values = [grid[x, y] if env.check_bounds(x, y) else True for x, y in points[:8]]
            assert values == env.get_surrounding_pathing(unit)
            if unit.health > 0:
                moves = [env.can_move(unit, direction) for direction in Direction]
                assert moves == [bool(is_on) for is_on in env.get_avail_agent_actions(agent)[2:6]]
        assert env.can_move(env.enemies[0], Direction.NORTH) in (True, False)
        actions = legal(env, rng)
        _, ended, info = env.step(actions)
        assert env.last_action.argmax(1).tolist() == actions and env.last_action.sum() == 6
        assert env.death_tracker_ally.sum() == info["dead_allies"]
        assert env.death_tracker_enemy.sum() == info["dead_enemies"]
        died = max(died, env.death_tracker_ally.sum())
        if ended:
            break
    assert died > 0
    env.close()


def test_what_belongs_to_starcraft_says_what_to_use() -> None:
    env = MultiAgentEnv("MMM", seed=1)
    for name, match in {"previous_ally_units": "keep `agents`", "reward_battle": "`step` returns it"}.items():
        with pytest.raises(AttributeError, match=match):
            getattr(env, name)
        assert not hasattr(env, name)
    with pytest.raises(AttributeError, match="no attribute 'nothing'$"):
        _ = env.nothing
    types = {unit.unit_type for unit in env.agents.values()}
    assert {env.marine_id, env.marauder_id, env.medivac_id} == types and env.zealot_id == -1
    env.close()
