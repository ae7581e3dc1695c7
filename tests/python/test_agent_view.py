"""Rows of units, views of single agents and functions as policies, compared with observations and states."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp

ONE_SIDE_HAS_SHIELDS = "2s_vs_1sc"


def nearest(view: sp.extras.AgentView) -> str | int:
    """Attacks or heals the nearest unit, or goes east."""
    targets = [unit.action for unit in view.enemies + view.allies if unit.action]
    return targets[0] if targets else view.actions.get("move east", view.actions["stop"])


@pytest.mark.parametrize(
    "name", ["2s3z", "MMM", ONE_SIDE_HAS_SHIELDS, "3s5z", *sp.scenarios(generated=True)[:2]]
)
def test_rows_of_units_hold_every_feature_of_observations(name: str) -> None:
    layout = {part["name"]: part for part in sp.scenario(name)["obs_layout"]}
    with sp.make(name, 3, obs_last_actions=1) as envs:
        entities = sp.extras.Entities(envs)
        n_others = envs.spec.n_agents + envs.spec.n_enemies - 1
        batch = envs.reset(seed=1)
        seen = 0
        for _ in range(30):
            batch = envs.step(envs.sample_actions())
            rows = entities(batch)
            assert rows.features.shape == (3, envs.spec.n_agents, n_others, len(entities.features))
            assert np.shares_memory(rows.features, batch.obs) == entities.is_view
            for side, where in (("enemies", entities.enemies), ("allies", entities.allies)):
                part = layout[side]
                size = math.prod(part["shape"])
                block = batch.obs[..., part["start"] : part["start"] + size]
                block = block.reshape(3, envs.spec.n_agents, *part["shape"])
                for i, feature in enumerate(part["features"]):
                    column = entities.features.index(feature if i else "seen")
                    assert np.array_equal(rows.features[:, :, where, column], block[..., i])
                assert np.array_equal(rows.mask[:, :, where], block.any(-1))
                absent = [n for n in entities.features[1:] if n not in part["features"]]
                for feature in absent:
                    assert not rows.features[:, :, where, entities.features.index(feature)].any()
            together = np.concatenate((rows.moves, rows.own), axis=-1)
            start = layout["own"]["start"]
            assert np.array_equal(together, batch.obs[..., [*range(4), *range(start, envs.spec.obs_size)]])
            seen += int(rows.mask.sum())
        assert seen > 0
        assert not rows.features.flags.writeable or not entities.is_view


def test_only_rows_of_equal_width_are_a_view() -> None:
    assert sp.extras.Entities("2s3z").is_view
    assert sp.extras.Entities("MMM").is_view
    info = sp.scenario("3s_vs_5z")
    assert info["ally_has_shields"] == info["enemy_has_shields"] == sp.extras.Entities("3s_vs_5z").is_view
    differ = [n for n in sp.scenarios() if not sp.extras.Entities(n).is_view]
    assert differ
    for name in differ:
        info = sp.scenario(name)
        assert info["ally_has_shields"] != info["enemy_has_shields"]


def test_rows_of_states_are_the_units_of_the_battle() -> None:
    with sp.make("MMM2", 2, seed=0) as envs:
        entities = sp.extras.Entities(envs)
        batch = envs.reset(seed=1)
        for _ in range(80):
            batch = envs.step(envs.sample_actions())
        rows, alive = entities.state(batch)
        assert rows.shape == (2, envs.spec.n_agents + envs.spec.n_enemies, len(entities.state_features))
        assert np.array_equal(alive[:, : envs.spec.n_agents], batch.alive)
        assert ((~alive[:, envs.spec.n_agents :]).sum(1) == batch.dead_enemies).all()
        cooldown = entities.state_features.index("energy/cooldown")
        assert (
            rows[:, : envs.spec.n_agents, cooldown].any()
            and not rows[:, envs.spec.n_agents :, cooldown].any()
        )


def test_units_below_their_level_of_health_are_alive_until_they_die() -> None:
    """Their health in states is negative, and they were said to be dead."""
    options = {"health": {"lower_bound": 0.1, "upper_bound": 0.5}}
    with sp.make("terran_5_vs_5", 64, seed=0, smacv2=options) as envs:
        entities = sp.extras.Entities(envs)
        health, are_below = entities.state_features.index("health"), 0
        envs.seed_sampler(0)
        batch = envs.reset(seed=0)
        for _ in range(40):
            rows, alive = entities.state(batch)
            assert np.array_equal(alive[:, : envs.spec.n_agents], batch.alive)
            are_below += int((alive & (rows[..., health] <= 0)).sum())
            batch = envs.step(envs.sample_actions())
    assert are_below > 0


class AppendsOne(sp.extras.Wrapper):
    """Changes observations, which rows of units do not allow."""

    def change_batch(self, batch: Any) -> Any:
        return batch.replace(obs=np.pad(batch.obs, [(0, 0), (0, 0), (0, 1)]))


def test_rows_of_another_scenario_are_refused() -> None:
    """A batch of 8m was cut into rows as if it were one of 3m, without a word."""
    with sp.make("8m", 2) as other, sp.make("3m", 2, obs_last_actions=1) as envs:
        batch = other.reset(seed=1)
        for entities in (sp.extras.Entities("3m"), sp.extras.Entities(envs)):
            with pytest.raises(sp.errors.InvalidRequest, match=r"of 3m .*, \[M, 3, \d+\], got \[2, 8, 80\]"):
                entities(batch)
            with pytest.raises(
                sp.errors.InvalidRequest, match=r"states must be those of 3m .*\[M, 48\], got \[2, "
            ):
                entities.state(batch)
        assert sp.extras.Entities(envs)(envs.reset(seed=1)).own.shape[-1] == 1 + 9, (
            "the last actions belong to it"
        )
        with pytest.raises(sp.errors.InvalidRequest, match=r"\[M, 3, 30\], got \[2, 3, 39\]"):
            sp.extras.Entities("3m")(envs.reset(seed=1))
        appended = AppendsOne(envs)
        with pytest.raises(sp.errors.InvalidRequest, match=r"\[M, 3, 39\], got \[2, 3, 40\]"):
            sp.extras.Entities(appended)(appended.reset(seed=1))


def test_scenarios_without_units_in_observations_are_refused() -> None:
    options = {"obs_starcraft": False, "obs_timestep_number": True}
    with sp.make("3m", 1, smacv2=options) as envs:
        for of_units in (sp.extras.Entities, sp.extras.AgentViews):
            with pytest.raises(sp.errors.InvalidRequest, match="obs_starcraft"):
                of_units(envs)
    with sp.make("3m", 1, smacv2={"obs_instead_of_state": True}) as envs:
        entities, batch = sp.extras.Entities(envs), envs.reset(seed=1)
        assert entities(batch).features.shape == (1, 3, 5, 5)
        with pytest.raises(sp.errors.InvalidRequest, match="obs_instead_of_state"):
            entities.state(batch)


def test_a_view_says_what_the_observation_has() -> None:
    """Distances and directions are compared with the positions in the state."""
    info = sp.scenario("MMM")
    with sp.make("MMM", 2) as envs:
        views = sp.extras.AgentViews(envs)
        policy = sp.extras.PerAgent(envs, nearest)
        batch = envs.reset(seed=1)
        compared = healed = attacked = 0
        for _ in range(60):
            batch = envs.step(policy(batch))
            rows, alive = sp.extras.Entities(envs).state(batch)
            squares = rows[..., [2, 3]] * [info["width"], info["height"]]
            for agent in np.flatnonzero(batch.alive[1]):
                view = views(batch, env=1, agent=int(agent))
                assert view.unit_type == info["allies"][agent]["unit_type"]
                assert list(view.actions.values()) == np.flatnonzero(batch.avail_actions[1, agent]).tolist()
                for unit in view.enemies + view.allies:
                    side, number = unit.name.split()
                    index = int(number) + (envs.spec.n_agents if side == "enemy" else 0)
                    dx, dy = squares[1, index] - squares[1, agent]
                    assert alive[1, index] and np.allclose((unit.dx, unit.dy), (dx, dy), atol=1e-3)
                    assert math.isclose(unit.distance, math.hypot(dx, dy), abs_tol=1e-3)
                    units = info["enemies"] if side == "enemy" else info["allies"]
                    assert unit.unit_type == units[int(number)]["unit_type"]
                    assert str(unit) in str(view)
                    compared += 1
                    if unit.action:
                        heals = unit.action.startswith("heal ally")
                        assert heals == info["allies"][agent]["healer"]
                        assert view.actions[unit.action] == 6 + int(number)
                        healed, attacked = healed + heals, attacked + (not heals)
        assert min(compared, healed, attacked) > 0


def test_a_view_in_words() -> None:
    with sp.make("2s3z", 1) as envs:
        batch = envs.reset(seed=1)
        text = sp.extras.AgentViews(envs).describe(batch, env=0, agent=4)
        lines = text.splitlines()
        assert lines[0] == "Step 0 of 120. You are agent 4, a ZEALOT with health 100 %, shield 100 %."
        assert "Enemies in sight: none." in lines and "Allies in sight:" in lines
        assert lines[-1].startswith("Available actions: stop, move ")
        for env, agent, message in [(1, 0, "env must be in the batch"), (0, 5, "between 0 and 4")]:
            with pytest.raises(sp.errors.InvalidRequest, match=message):
                sp.extras.AgentViews(envs)(batch, env=env, agent=agent)


def test_health_that_is_not_observed_is_not_told() -> None:
    hidden = {"obs_all_health": False, "obs_own_health": False}
    with sp.make("3m", 1, smacv2=hidden) as envs:
        view = sp.extras.AgentViews(envs)(envs.reset(seed=1), env=0, agent=0)
        assert view.health is None and {unit.health for unit in view.allies} == {None}
        assert str(view).startswith("Step 0 of 60. You are agent 0, a MARINE.\n")
        assert "health" not in str(view)


def test_directions_are_those_of_a_compass() -> None:
    def direction(dx: float, dy: float) -> str:
        return sp.extras.SeenUnit("enemy 0", "ZEALOT", math.hypot(dx, dy), dx, dy, 1.0, None, None).direction

    assert [direction(1, 0), direction(0, 1), direction(-1, 0), direction(0, -1)] == [
        "east", "north", "west", "south",
    ]  # fmt: skip
    assert [direction(1, 1), direction(-2, -2.1), direction(-1, 0.1)] == ["north-east", "south-west", "west"]


def test_types_that_are_drawn_come_from_the_observation() -> None:
    name = sp.scenarios(generated=True)[0]
    with sp.make(name, 4, fields=["obs", "avail_actions", "episode_length", "snapshot", "level"]) as envs:
        names = [unit["unit_type"] for unit in sp.scenario(envs)["unit_types"]]
        batch = envs.reset(seed=1)
        views = sp.extras.AgentViews(envs)
        for env in range(4):
            for agent in range(envs.spec.n_agents):
                drawn = names[int(batch.level[env, agent, 0])]
                assert views(batch, env, agent).unit_type == drawn


@pytest.mark.parametrize("autoreset", ["NextStep", "SameStep"])
def test_a_function_plays_as_the_same_policy_does(autoreset: Any) -> None:
    """A function of views chooses what it would choose of the arrays: in every step of every episode."""

    def lowest(view: sp.extras.AgentView) -> int:
        assert view.step == 0 or view.step < 60
        return max(view.actions.values())

    with sp.make("3s_vs_5z", 4, autoreset_mode=autoreset) as envs:
        expected = sp.evaluate(
            envs, lambda b: b.avail_actions.shape[-1] - 1 - b.avail_actions[..., ::-1].argmax(-1), 12, seed=5
        )
    function = sp.extras.evaluate_function(
        "3s_vs_5z", lambda view: max(view.actions.values()), 12, seed=5, num_envs=4, autoreset_mode=autoreset
    )
    assert np.array_equal(function.returns, expected.returns) and len(function) == 12
    assert np.array_equal(function.lengths, expected.lengths)
    with sp.make("3s_vs_5z", 4, autoreset_mode=autoreset, episode_limit=60) as envs:
        assert len(sp.evaluate(envs, sp.extras.PerAgent(envs, lowest), 12, seed=5)) == 12


def test_a_function_plays_the_enemies_only_where_it_sees_them_as_they_are() -> None:
    """Zealots that played the enemies of 3s_vs_3z were told that they and their enemies were other units."""
    seen = set()

    def stop(view: sp.extras.AgentView) -> str:
        seen.add((view.unit_type, *(unit.unit_type for unit in view.enemies)))
        return "stop"

    for scenario in ("3s_vs_3z", "2s_vs_1sc"):
        with sp.make(scenario, 2, sides="both", episode_limit=30) as envs:
            with pytest.raises(sp.errors.InvalidRequest, match="against is a PerAgent.*STALKER.*enemies"):
                sp.evaluate(envs, "nearest", 2, seed=1, against=sp.extras.PerAgent(envs, stop))
    assert not seen
    with sp.make("3m", 2, sides="both", episode_limit=30) as envs:
        policy = sp.extras.PerAgent(envs, stop)
        assert len(sp.evaluate(envs, "nearest", 2, seed=1, against=policy)) == 2
        with sp.make("2s3z", 2) as others, pytest.raises(sp.errors.InvalidRequest, match="shape"):
            policy(others.reset())
    assert {name for names in seen for name in names} == {"MARINE"}


def test_a_function_is_evaluated_in_one_call(tmp_path: Path) -> None:
    result = sp.extras.evaluate_function("3m", nearest, episodes=20, opponent="random")
    assert len(result) == 20 and result.win_rate >= 0.9
    again = sp.extras.evaluate_function("3m", nearest, episodes=20, opponent="random")
    assert np.array_equal(result.returns, again.returns)


@pytest.mark.parametrize("action", ["attack enemy 0", 6.9, 1.0, None, 2**40, -1, 9, np.float32(1), [1], "1"])
def test_a_wrong_action_of_a_function_is_an_error_that_says_what_is_available(action: Any) -> None:
    """6.9 was 6, another legal action; others were errors of Python and NumPy that named no agent."""
    with pytest.raises(sp.errors.InvalidRequest) as raised:
        sp.extras.evaluate_function("3m", lambda view: action, episodes=1)
    expected = f"action {action!r} of agent 0 in environment 0 must be one of its available actions"
    assert str(raised.value).startswith(expected) and "'stop': 1, 'move north': 2" in str(raised.value)


def test_a_number_is_any_integer_and_checked_when_it_is_played() -> None:
    numbers: list[Any] = [1, np.int64(1), np.uint8(1), np.array(1)]
    result = sp.extras.evaluate_function(
        "3m", lambda view: numbers[view.step], 1, num_envs=1, episode_limit=4
    )
    assert result.mean_length == 4
    with pytest.raises(sp.errors.IllegalAction, match="agent 0"):
        sp.extras.evaluate_function("3m", lambda view: 8, episodes=1)
