"""What users of Gymnasium, EnvPool, PettingZoo and SMAC write out of habit works, or the error says how here.

A user wrote `make(autoreset_mode=...)`, `num_workers=`, `batch.action_mask`, `len(envs)` and so on, and got
lists of 28 names, or nothing.
"""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp

from conftest import program

Call = Callable[[Any], object]


@pytest.fixture(scope="module")
def lane(tmp_path_factory: pytest.TempPathFactory) -> Iterator[sp.Envs]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SMACLITE_POOL_ROOT", str(tmp_path_factory.mktemp("p")))
        with sp.make("3m", 2, threads=1) as envs:
            envs.reset(seed=1)
            yield envs


KEYWORDS = {
    "autoreset": "autoreset_mode", "num_threads": "threads", "num_workers": "threads",
    "max_episode_steps": "episode_limit", "map_name": "scenario", "map_file": "scenario",
    "task_id": "scenario",
    "render_mode": r"envs\.render\(\)", "reward_sparse": "rewards", "difficulty": "opponent",
    "capability_config": "teams", "n_envs": "num_envs", "env_type": "leave it out",
}  # fmt: skip


@pytest.mark.parametrize("name", KEYWORDS)
def test_a_keyword_of_another_package_is_translated(name: str) -> None:
    make: Any = sp.make
    for arguments in [("3m",), ()]:  # without a scenario, too, as in make(map_name="3m")
        with pytest.raises(TypeError, match=rf"make\(\) got an unexpected .* '{name}'; .*{KEYWORDS[name]}"):
            make(*arguments, **{name: 1})
    with pytest.raises(TypeError, match=r"make\(\) needs the argument 'scenario'"):
        make()


@pytest.mark.parametrize(
    ("call", "match"),
    [
        (lambda e: e.reset(options={}), r"reset\(\) .* 'options'; use `env_id`"),
        (lambda e: e.reset(env_ids=[0]), "use `env_id`"),
        (lambda e: e.reset(sed=1), r"did you mean `seed`\?"),
        (lambda e: e.step(action=[[1] * 3] * 2), r"step\(\) .*use `actions`"),
        (lambda e: e.step([[1] * 3] * 2, env_ids=[0]), "use `env_id`"),
        (lambda e: e.send(acton=1), r"send\(\) .*did you mean `actions`"),
        (lambda e: sp.connect(name="train"), "use `pool`, the first argument"),  # type: ignore[call-arg]
        (lambda e: sp.connect("train", num_envs=3), "serve` sets it"),  # type: ignore[call-arg]
        (copy.copy, "`fork` copies battles"),
        (pickle.dumps, "`reset` carry them"),
    ],
)
def test_a_call_out_of_habit_says_what_to_call(lane: sp.Envs, call: Call, match: str) -> None:
    with pytest.raises(TypeError, match=match):
        call(lane)


ATTRIBUTES = {
    "action_space": "BattleVectorEnv", "single_observation_space": "BattleVectorEnv", "save": "snapshot",
    "clone": "fork", "get_env_info": "spec", "get_avail_actions": "avail_actions",
    "n_envs": "num_envs", "autoreset": "autoreset_mode", "max_episode_steps": "episode_limit",
    "agents": "n_agents", "step_async": "send", "n_agent": r"did you mean `spec\.n_agents`",
}  # fmt: skip


@pytest.mark.parametrize("name", ATTRIBUTES)
def test_an_attribute_of_other_environments_is_translated(lane: sp.Envs, name: str) -> None:
    with pytest.raises(
        AttributeError, match=f"'Envs' object has no attribute '{name}'; .*{ATTRIBUTES[name]}"
    ):
        getattr(lane, name)
    assert not hasattr(lane, name) and not hasattr(lane, "_nothing")


FIELDS = {
    "action_mask": "`avail_actions`", "rewards": "`reward`", "done": "`terminated` and `truncated`",
    "dones": "`terminated` and `truncated`", "observations": "`obs`", "infos": "`battle_won`",
    "env_ids": "`env_id`", "elapsed_step": "`episode_length`",
}  # fmt: skip


@pytest.mark.parametrize("name", FIELDS)
def test_a_field_of_other_batches_is_translated(lane: sp.Envs, name: str) -> None:
    batch = lane.reset(seed=1)
    with pytest.raises(AttributeError, match=f"no `{name}`; .*{FIELDS[name]}"):
        getattr(batch, name)
    with pytest.raises(KeyError, match=f"no field '{name}'; .*{FIELDS[name]}"):
        batch[name]


def test_the_length_of_environments_is_their_number(lane: sp.Envs) -> None:
    assert len(lane) == lane.spec.num_envs == 2


def test_a_dataset_says_that_it_is_expanded_first(tmp_path: Path) -> None:
    file = tmp_path / "k.smdata"
    # In this process it would leave its handlers of signals.
    program("dataset", "record", "nearest", "--scenario", "3m", "--episodes", "2", "--out", file)
    dataset: Any = sp.Dataset(file)
    with pytest.raises(TypeError, match=r'use expand\(\)\["obs"\]'):
        dataset["obs"]
    with pytest.raises(TypeError, match=r'use expand\(\)\["reward"\]'):
        dataset["rewards"]
    with pytest.raises(AttributeError, match="use expand"):
        _ = dataset.observations


def test_the_autoreset_mode_has_gymnasiums_name_and_values() -> None:
    gymnasium = pytest.importorskip("gymnasium")
    for mode in gymnasium.vector.AutoresetMode:
        for given in (mode, mode.value):
            with sp.make("3m", 1, threads=1, autoreset_mode=given) as envs:
                assert gymnasium.vector.AutoresetMode(envs.spec.autoreset_mode) is mode
    for wrong in ("next_step", "same-step"):
        with pytest.raises(
            sp.errors.InvalidRequest, match="must be `NextStep`, `SameStep` or `Disabled`, got"
        ):
            sp.make("3m", 1, autoreset_mode=wrong)  # type: ignore[call-overload]
    with pytest.raises(TypeError, match="must be a string or an AutoresetMode, got int"):
        sp.make("3m", 1, autoreset_mode=1)  # type: ignore[call-overload]


def test_environments_of_integrations_name_themselves_and_translate() -> None:
    """`parallel_env(map_name="3m")` said that make() got a wrong keyword, and listed those of `make`."""
    pytest.importorskip("pettingzoo")
    from smaclite_pool.integrations import envpool
    from smaclite_pool.integrations.gymnasium import BattleEnv, make_vector
    from smaclite_pool.integrations.pettingzoo import parallel_env

    makers: list[Any] = [parallel_env, BattleEnv, make_vector]
    for make in makers:
        name = make.__name__
        with pytest.raises(TypeError, match=rf"{name}\(\) got an unexpected .* 'map_name'; use `scenario`"):
            make(map_name="3m")
        with pytest.raises(TypeError, match=rf"{name}\(\) .*did you mean `render_mode`"):
            make("3m", rendermode=None)
        with pytest.raises(TypeError, match=rf"{name}\(\) .*use `threads`"):
            make("3m", num_threads=1)
    with pytest.raises(TypeError, match=r"make\(\) .*'threads'; use `num_threads`"):
        envpool.make("3m", threads=1)


def test_environments_tell_what_they_are() -> None:
    """They were "object at 0x7e..."."""
    pytest.importorskip("pettingzoo")
    import gymnasium
    from smaclite_pool.integrations.gymnasium import make_vector
    from smaclite_pool.integrations.pettingzoo import parallel_env
    from smaclite_pool.marl.smac import MultiAgentEnv
    from smaclite_pool.marl.smacv2 import StarCraft2Env, StarCraftCapabilityEnvWrapper

    made: list[Any] = [
        gymnasium.make("smaclite_pool/3m-v0", seed=4).unwrapped,
        parallel_env("3m", seed=4),
        MultiAgentEnv("3m", seed=4),
        make_vector("3m", 2, seed=4),
        StarCraft2Env("3m", seed=4),
        StarCraftCapabilityEnvWrapper(map_name="3m", seed=4),
    ]
    texts = [repr(env) for env in made]
    for env in made:
        env.close()
    assert texts[0] == "<BattleEnv 3m, 3 agents, seed 4>"
    assert texts[1:3] == ["<parallel_env 3m, 3 agents, seed 4>", "<MultiAgentEnv 3m, 3 agents, seed 4>"]
    assert texts[3].startswith("<BattleVectorEnv of <smaclite_pool.Envs 2 x 3m, embedded")
    assert texts[4] == "<StarCraft2Env 3m, 3 agents against 3, seed 4>"
    assert texts[5] == f"<StarCraftCapabilityEnvWrapper of {texts[4]}>"


def test_a_reset_takes_a_seed_per_environment() -> None:
    """Gymnasium's vector environments take a list; ours refused it."""
    seeds = [7, 3, None, 2**64 - 1, 8, 3]
    single = {}
    for seed in {given for given in seeds if given is not None}:
        with sp.make("terran_5_vs_5", 1, threads=1) as envs:
            single[seed] = [envs.reset(seed=seed).state[0].copy(), envs.step(stops(envs)).obs[0].copy()]
    with sp.make("terran_5_vs_5", 6, seed=100, threads=1) as envs:
        with sp.make("terran_5_vs_5", 6, seed=100, threads=1) as same:
            expected = same.reset().state[2].copy()
        first = envs.reset(seed=seeds)
        assert np.array_equal(first.state[2], expected), "without a seed it begins as make says"
        assert first.was_reset.all()
        state, after = first.state.copy(), envs.step(stops(envs)).obs
        for i, given in enumerate(seeds):
            if given is not None:
                assert np.array_equal(state[i], single[given][0])
                assert np.array_equal(after[i], single[given][1])
        kept = after[0].copy()
        batch = envs.reset(seed=np.array([8, 7]), env_id=[3, 1])
        assert np.array_equal(batch.state[3], single[8][0]) and np.array_equal(batch.state[1], single[7][0])
        assert np.array_equal(batch.obs[0], kept), "others go on"
        for wrong, match in [
            ([1, 2], "one per environment of the request, 6; got 2"),
            ([0.5] * 6, r"seed\[0\]"),
        ]:
            with pytest.raises((sp.errors.InvalidRequest, TypeError), match=match):
                envs.reset(seed=wrong)  # type: ignore[arg-type]
    # Those of an asynchronous lane once had to be consecutive.
    with sp.make("terran_5_vs_5", 4, batch_size=2, threads=1) as envs:
        batches = [envs.reset(seed=[8, 3, 8, 7]), envs.recv()]
        for batch in batches:
            for env, state in zip(batch.env_id, batch.state, strict=True):
                assert np.array_equal(state, single[[8, 3, 8, 7][env]][0])


def stops(envs: sp.Envs) -> np.ndarray[Any, Any]:
    return np.ones((envs.spec.num_envs, envs.spec.n_agents), np.int32)


def test_seeds_per_environment_go_with_levels() -> None:
    fields = ["obs", "state", "avail_actions", "level"]
    with sp.make("terran_5_vs_5", 3, threads=1, fields=fields) as envs:
        levels = envs.reset(seed=4).level.copy()[[2, 0, 1]]
        batch = envs.reset(seed=[9, 1, 9], levels=levels)
        assert np.array_equal(batch.level, levels)
