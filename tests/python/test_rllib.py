"""The RLlib integration: spaces and dicts, and PPO with action masking on the new API stack."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import smaclite_pool as sp

pytest.importorskip("ray.rllib")
pytest.importorskip("torch")

import ray
import smaclite_pool.integrations.rllib
from ray.rllib.env.env_context import EnvContext
from smaclite_pool.integrations.rllib import BattleMultiAgentEnv


@pytest.fixture
def env() -> Iterator[BattleMultiAgentEnv]:
    made = BattleMultiAgentEnv({"scenario": "2s3z", "seed": 3})
    yield made
    made.close()


def configured(policies: list[str], settings: dict[str, Any]) -> Any:
    """PPO of these policies, each of which plays the agents whose names begin with its own."""
    from ray.rllib.algorithms.ppo import PPOConfig
    from ray.rllib.core.rl_module.multi_rl_module import MultiRLModuleSpec
    from ray.rllib.core.rl_module.rl_module import RLModuleSpec
    from ray.rllib.examples.rl_modules.classes.action_masking_rlm import ActionMaskingTorchRLModule

    model = {"head_fcnet_hiddens": [16]}
    modules = {
        policy: RLModuleSpec(module_class=ActionMaskingTorchRLModule, model_config=model)
        for policy in policies
    }
    return (
        PPOConfig()
        .environment(BattleMultiAgentEnv, env_config=settings)
        .multi_agent(
            policies=set(policies), policy_mapping_fn=lambda agent, episode, **_: agent.split("_")[0]
        )
        .rl_module(rl_module_spec=MultiRLModuleSpec(rl_module_specs=modules))
    )


def test_a_policy_per_side_learns(runtime_dir: Path) -> None:
    ray.init(num_cpus=2, log_to_driver=False, include_dashboard=False, object_store_memory=100 << 20)
    try:
        config = (
            configured(["agent", "enemy"], {"scenario": "5m_vs_6m", "sides": "both"})
            .env_runners(num_env_runners=0, rollout_fragment_length=100)
            .training(train_batch_size=200, minibatch_size=100, num_epochs=1)
        )
        algorithm = config.build_algo()
        learners = algorithm.train()["learners"]
        algorithm.stop()
    finally:
        ray.shutdown()
    assert {"agent", "enemy"} <= set(learners)


def test_runners_play_different_battles() -> None:
    """By default RLlib resets without a seed."""
    seeds = []
    for worker, vector in [(1, 0), (1, 1), (2, 0)]:
        env = BattleMultiAgentEnv(EnvContext({"seed": 1}, worker_index=worker, vector_index=vector))
        [pool] = sp.pools()
        seeds.append(sp.status(pool)["lanes"][0]["description"]["seed"])
        env.close()
    assert len(set(seeds)) == 3


def runner(worker: int, settings: dict[str, Any], seed: int | None = None, battles: int = 3) -> Any:
    """An env runner as RLlib makes it, which has checked its environments."""
    from ray.rllib.env.multi_agent_env_runner import MultiAgentEnvRunner

    config = (
        configured(["agent"], {"scenario": "zerg_5_vs_5", **settings})
        .env_runners(num_env_runners=0, num_envs_per_env_runner=battles)
        .debugging(seed=seed)
    )
    return MultiAgentEnvRunner(config=config, worker_index=worker)


def first_states(made: Any, resets: int = 2) -> list[bytes]:
    """What the battles of a runner begin with, in each of its first episodes."""
    states = []
    for reset in range(resets):
        made.env.reset(seed=None if reset else made._seed)  # as its `sample` does
        states += [env.unwrapped._battle.last.state.tobytes() for env in made.env.envs]
    made.stop()
    return states


def test_every_battle_of_every_runner_has_its_own_seed() -> None:
    """RLlib's check resets every environment with seed 42, and all battles once went on from there."""
    made = runner(1, {"seed": 5})
    seeds = [env.unwrapped._battle.envs.spec.seed for env in made.env.envs]
    assert seeds == [10_005, 10_006, 10_007]
    first = first_states(made)
    assert first_states(runner(1, {"seed": 5})) == first
    others = [runner(1, {"seed": 6}), runner(2, {"seed": 5}), runner(1, {}), runner(1, {})]
    states = first + [state for other in others for state in first_states(other)]
    # Neighbours share seeds: those of 6 are 10,006 to 10,008.
    assert len(states) == 30 and len(set(states)) == 26


def test_the_battles_of_a_runner_begin_as_those_of_their_seeds() -> None:
    states = first_states(runner(0, {"seed": 5}, battles=2))
    with sp.make("zerg_5_vs_5", 2, seed=5, autoreset_mode="Disabled") as envs:
        expected = [row.tobytes() for _ in range(2) for row in envs.reset().state]
    assert states == expected


def test_rllibs_own_seed_goes_before_that_of_the_environment() -> None:
    first = first_states(runner(1, {}, seed=3))
    assert first_states(runner(1, {"seed": 5}, seed=3)) == first
    assert len(set(first)) == 6 and set(first_states(runner(1, {}, seed=9))).isdisjoint(first)


def test_a_seed_that_is_no_integer_is_named() -> None:
    with pytest.raises(TypeError, match=re.escape("env_config['seed'] must be an integer, got str")):
        BattleMultiAgentEnv({"seed": "a"})
    with pytest.raises(sp.errors.InvalidRequest, match=re.escape("env_config['seed'] must not be negative")):
        BattleMultiAgentEnv({"seed": -1})
    with pytest.raises(
        TypeError, match=r"env_config\(\) got an unexpected keyword argument 'render_mod'; did you"
    ):
        BattleMultiAgentEnv({"render_mod": None})


def test_ppo_learns_with_masks(runtime_dir: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The example: an unavailable action would have raised."""
    text = smaclite_pool.integrations.rllib.__doc__
    assert text is not None
    ray.init(num_cpus=2, log_to_driver=False, include_dashboard=False, object_store_memory=100 << 20)
    try:
        scope: dict[str, object] = {}
        exec(textwrap.dedent("\n".join(text.split("\n")[2:]).split("\nAgents are")[0]), scope)
    finally:
        ray.shutdown()
    team_return, win_rate = map(float, capsys.readouterr().out.split()[-2:])
    metrics: Any = scope["metrics"]
    everyone = metrics["episode_return_mean"]
    assert team_return == pytest.approx(everyone / 5, rel=1e-4) and 0 < team_return < 25
    assert 0 <= win_rate <= 1
