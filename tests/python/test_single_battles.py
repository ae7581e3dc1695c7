"""Single battles whose agents have names, in PettingZoo and RLlib, beside the pool."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp

from play import battle_of

OBSERVATION = {"parallel_env": "observation", "rllib": "observations"}


@pytest.mark.parametrize("adapter", OBSERVATION)
@pytest.mark.parametrize("sides", ["allies", "both"])
def test_a_battle_is_that_of_the_pool(adapter: str, sides: Any) -> None:
    env = battle_of(adapter, "5m_vs_6m", sides=sides)
    with sp.make("5m_vs_6m", 1, autoreset_mode="Disabled", sides=sides) as envs:
        seen, infos = env.reset(seed=5)
        batch = envs.reset(seed=5)
        names = [f"agent_{i}" for i in range(5)] + [f"enemy_{i}" for i in range(6)] * (sides == "both")
        while not (batch.terminated[0] or batch.truncated[0]):
            assert list(seen) == list(infos) == env.possible_agents == env.agents == names
            rows, masks = [*batch.obs[0]], [*batch.avail_actions[0]]
            players = [sp.ScriptedPolicy("nearest", envs)]
            if sides == "both":
                rows += [*batch.enemy_obs[0]]
                masks += [*batch.enemy_avail_actions[0]]
                players.append(sp.ScriptedPolicy("nearest", envs, side="enemies"))
            for name, row, mask in zip(names, rows, masks, strict=True):
                assert env.observation_spaces[name].contains(seen[name])
                assert np.array_equal(seen[name][OBSERVATION[adapter]], row)
                assert np.array_equal(seen[name]["action_mask"], mask)
            if adapter == "parallel_env":
                assert np.array_equal(env.state(), batch.state[0])
            actions = np.concatenate([player(batch) for player in players], axis=1)
            given = dict(zip(names, actions[0], strict=True))
            assert all(env.action_spaces[name].contains(action) for name, action in given.items())
            seen, earned, terminated, truncated, infos = env.step(given)
            batch = envs.step(actions)
            rewards = [batch.reward[0]] * 5
            if sides == "both":
                rewards += [batch.enemy_reward[0]] * 6
            assert earned == dict(zip(names, rewards, strict=True))
            assert {*terminated.values()} == {batch.terminated[0]}
            assert {*truncated.values()} == {batch.truncated[0]}
        assert infos["agent_1"]["dead_allies"] == batch.dead_allies[0]
    env.close()


@pytest.mark.parametrize(
    ("adapter", "options"),
    [("parallel_env", {}), ("parallel_env", {"illegal_actions": "stop"}), ("rllib", {})],
)
def test_wrong_calls_are_refused_and_step_nothing(adapter: str, options: dict[str, Any]) -> None:
    """An action for an agent that there is not, as of a misspelt name, was ignored."""
    env = battle_of(adapter, "2s3z", **options)
    early = [lambda: env.step({}), env.render, *([env.state] if adapter == "parallel_env" else [])]
    for call in early:
        with pytest.raises(sp.errors.InvalidRequest, match="call reset first"):
            call()
    env.reset(seed=1)
    if adapter == "rllib":
        assert env.render_mode == "rgb_array" and env.render().shape == (640, 640, 3)
    state, stop = env._battle.last.state.copy(), dict.fromkeys(env.agents, 1)
    refused: dict[str, dict[Any, Any]] = {
        "missing agent_4": dict(list(stop.items())[:4]),
        "contain 'agent_5', 0; agents are agent_0, agent_1": stop | {"agent_5": 1, 0: 1},
    }
    refused |= {
        f"agent_1 must be an integer, got {bad!r}": stop | {"agent_1": bad} for bad in (1.9, "1", None)
    }
    for text, given in refused.items():
        with pytest.raises(sp.errors.InvalidRequest, match=text):
            env.step(given)
    with pytest.raises(TypeError, match="actions must be a dict of agents and actions, got list"):
        env.step([1] * 5)
    if not options:
        with pytest.raises(sp.errors.IllegalAction) as caught:
            env.step(dict.fromkeys(env.agents, 0))
        assert caught.value.agent == 0 and 1 in caught.value.available
    assert np.array_equal(env._battle.last.state, state)
    env.close()
