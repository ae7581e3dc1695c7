"""The Gymnasium integration, with Gymnasium's own checkers, wrappers and vector environments."""

from __future__ import annotations

import copy
import json
import pickle
import warnings
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp

pytest.importorskip("gymnasium")

import gymnasium
from gymnasium.utils.env_checker import check_env
from smaclite_pool._render import Window
from smaclite_pool.integrations.gymnasium import BattleEnv, make_vector

from conftest import run_script
from play import duel

MODULE = "smaclite_pool.integrations.gymnasium"


@pytest.fixture(autouse=True)
def no_warnings() -> Iterator[None]:
    """Gymnasium's checkers report by warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # JAX warns of every fork, once a test before has imported it. Those here do not use it.
        warnings.filterwarnings("ignore", message=r"os\.fork\(\) was called")
        yield


@pytest.mark.parametrize("scenario", sp.scenarios())
def test_gymnasium_accepts_one_environment(scenario: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Window, "show", lambda *_: True)  # the checker tries every render mode
    # The checker uses an action of one state in another, where it may not be available.
    env = gymnasium.make(f"smaclite_pool/{scenario}-v0", render_mode="rgb_array", illegal_actions="stop")
    check_env(env.unwrapped)
    env.close()


def test_a_window_shows_every_step_of_an_id(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[Any] = []
    monkeypatch.setattr(Window, "show", lambda _, picture: shown.append(picture))
    with closing(gymnasium.make("smaclite_pool/3m-v0", render_mode="human")) as env:
        env.reset(seed=1)
        env.step(np.ones(3, np.int64))
        assert env.render_mode == "human" and env.render() is None
    assert [picture.shape for picture in shown] == [(640, 640, 3)] * 3


def test_an_id_has_one_interface() -> None:
    """Once `make` had tuples without masks, and `make_vec` of the same id a dict with masks."""
    single: Any = gymnasium.make("smaclite_pool/2s3z-v0")
    observation, _ = single.reset(seed=1)
    with closing(make_vector("2s3z", 2)) as vector:
        assert single.observation_space == vector.single_observation_space
        assert single.action_space == vector.single_action_space
        observations, _ = vector.reset(seed=1)
        np.testing.assert_equal(observation, {name: rows[0] for name, rows in observations.items()})
        actions = vector.action_space.sample()
        observations, rewards, *_, infos = vector.step(actions)
        observation, reward, *_, info = single.step(actions[0])
        np.testing.assert_equal(observation, {name: rows[0] for name, rows in observations.items()})
        assert reward == rewards[0]
        assert info == {name: infos[name][0] for name in infos if not name.startswith("_")}
    single.close()


def test_spaces_are_those_learners_expect() -> None:
    with closing(make_vector("MMM2", 2)) as envs:
        assert envs.single_action_space == gymnasium.spaces.MultiDiscrete([18] * 10)
        assert list(envs.single_observation_space) == ["action_mask", "obs", "state"]


def test_samples_are_available_and_seeded() -> None:
    with closing(make_vector("2s3z", 4)) as envs:
        played = []
        for _ in range(2):
            envs.reset(seed=5)
            envs.action_space.seed(9)
            actions = []
            for _ in range(60):
                actions.append(envs.action_space.sample())
                assert actions[-1] in envs.action_space
                envs.step(actions[-1])
            played.append(actions)
        np.testing.assert_array_equal(played[0], played[1])
        for duplicate in (copy.deepcopy(envs.action_space), pickle.loads(pickle.dumps(envs.action_space))):
            assert duplicate == envs.action_space and type(duplicate) is gymnasium.spaces.Box
    assert envs.action_space.sample() in envs.action_space, "closed environments still have a space"
    env = BattleEnv("2s3z")
    assert type(copy.deepcopy(env.action_space)) is gymnasium.spaces.MultiDiscrete
    env.close()
    assert env.action_space.sample() in env.action_space


@pytest.mark.parametrize("make", [lambda: BattleEnv("2s3z"), lambda: make_vector("2s3z", 4)])
def test_a_space_takes_the_seed_that_it_returned(make: Callable[[], Any]) -> None:
    """It was refused as too large, and `seed(None)` did not seed what `sample()` draws."""

    def draw(seed: Any) -> tuple[Any, list[Any]]:
        used = envs.action_space.seed(seed)
        return used, [envs.action_space.sample().tolist() for _ in range(8)]

    with closing(make()) as envs:
        envs.reset(seed=1)
        used, drawn = draw(None)
        assert draw(used) == (used, drawn)
        assert draw(3) == draw(3) != draw(4)
        assert draw(None)[1] != draw(None)[1]


def test_copies_of_spaces_draw_as_their_originals_would() -> None:
    """Their random state was lost: two copies of a seeded space drew different samples."""
    env = BattleEnv("3m")
    with closing(make_vector("3m", 2)) as envs:
        for space in (env.action_space, envs.action_space, envs.single_action_space):
            space.seed(5)
            copies: list[Any] = [
                copy.deepcopy(space),
                copy.deepcopy(space),
                pickle.loads(pickle.dumps(space)),
            ]
            assert all(made == space and space == made for made in copies)
            assert {type(made).__module__.split(".")[0] for made in copies} == {"gymnasium"}
            drawn = [[made.sample().tolist() for _ in range(9)] for made in copies]
            assert drawn[0] == drawn[1] == drawn[2]
            assert not hasattr(copies[0], "_envs")
    env.close()


def test_an_illegal_action_is_an_error_or_a_stop() -> None:
    everyone_attacks = np.full((2, 5), 6)
    with closing(make_vector("2s3z", 2)) as envs:
        envs.reset(seed=1)
        with pytest.raises(sp.errors.IllegalAction, match="environment 0, agent 0: action 6"):
            envs.step(everyone_attacks)
    stopping = make_vector("2s3z", 2, illegal_actions="stop")
    with closing(stopping) as lenient, closing(make_vector("2s3z", 2)) as strict:
        lenient.reset(seed=1)
        strict.reset(seed=1)
        given = np.array([[6, 2, -1, 99, 0]] * 2)
        seen, *_ = lenient.step(given)
        expected, *_ = strict.step(np.where(given == 2, 2, 1))
        np.testing.assert_equal(seen, expected)
        for _ in range(150):  # agents die meanwhile
            lenient.step(everyone_attacks)
    with pytest.raises(sp.errors.InvalidRequest, match="'ignore'"):
        make_vector("2s3z", 2, illegal_actions="ignore")  # type: ignore[arg-type]


@pytest.mark.parametrize("illegal_actions", ["error", "stop"])
@pytest.mark.parametrize("actions", [[1, 1], [[1, 1, 1]], [1.0, 1.0, 1.0], None])
def test_wrong_shapes_and_dtypes_are_named_in_both_modes(illegal_actions: Any, actions: Any) -> None:
    """With "stop", NumPy's errors about indices came out."""
    with closing(gymnasium.make("smaclite_pool/3m-v0", illegal_actions=illegal_actions)) as env:
        env.reset(seed=1)
        with pytest.raises((sp.errors.InvalidRequest, TypeError), match="actions"):
            env.step(actions)
        env.step([1, 1, 1])


def test_a_single_battle_has_all_fields() -> None:
    with pytest.raises(sp.errors.InvalidRequest, match="remove `fields`"):
        gymnasium.make("smaclite_pool/3m-v0", fields=["obs"])


def test_seeds() -> None:
    """Without a seed the environment has the one that it drew; the first reset uses the constructor's."""

    def play(env: gymnasium.Env[Any, Any], **kwargs: Any) -> float:
        env.reset(**kwargs)
        env.action_space.seed(1)
        total = 0.0
        for _ in range(30):
            _, reward, terminated, *_ = env.step(env.action_space.sample())
            total += float(reward)
            if terminated:
                break
        env.close()
        return total

    assert play(BattleEnv("2s3z", seed=4)) == play(BattleEnv("2s3z", seed=5), seed=4)
    unseeded = BattleEnv("2s3z")
    assert play(BattleEnv("2s3z", seed=unseeded.np_random_seed)) == play(unseeded)
    env = BattleEnv("2s3z", seed=4)
    with pytest.raises(sp.errors.InvalidRequest, match="seed must be at most"):
        env.reset(seed=1 << 64)
    assert env.np_random_seed == 4
    env.reset(seed=np.int64(6))  # type: ignore[arg-type]
    assert env.np_random_seed == 6


def test_a_custom_scenario(tmp_path: Path) -> None:
    file = tmp_path / "duel.json"
    file.write_text(json.dumps(duel()))
    for make in (gymnasium.make, gymnasium.make_vec):
        env: Any = make("smaclite_pool/custom-v0", map_file=str(file))
        env.reset(seed=1)
        env.close()
        with pytest.raises(sp.errors.InvalidRequest, match="map_file"):
            make("smaclite_pool/custom-v0")
        # It played the file, and said 3m.
        with pytest.raises(sp.errors.InvalidRequest, match="'3m' and map_file cannot be combined"):
            make("smaclite_pool/3m-v0", map_file=str(file))


def test_an_episode_that_runs_out_of_time_is_truncated() -> None:
    env = BattleEnv("3s_vs_5z", episode_limit=2, seed=1)
    env.reset()
    stop = [1] * 3
    assert env.step(stop)[2:4] == (False, False)
    assert env.step(stop)[2:4] == (False, True)
    with pytest.raises(sp.errors.InvalidRequest, match="reset"):
        env.step(stop)
    env.close()
    with closing(make_vector("3s_vs_5z", 2, max_episode_steps=1)) as envs:
        envs.reset(seed=1)
        assert envs.step(np.ones((2, 3), int))[3].all()


@pytest.mark.parametrize(
    "imports",
    [
        "import gymnasium, smaclite_pool.integrations.gymnasium",
        "import smaclite_pool.integrations.gymnasium, gymnasium",
        f"import gymnasium; gymnasium.make('{MODULE}:smaclite_pool/2s3z-v0').close()",
        f"import gymnasium; gymnasium.make_vec('{MODULE}:smaclite_pool/2s3z-v0', num_envs=2).close()",
    ],
)
def test_importing_the_integration_registers_the_ids(imports: str) -> None:
    done = run_script(
        f"import warnings; warnings.simplefilter('error'); {imports}\n"
        "gymnasium.make('smaclite_pool/2s3z-v0').close()\n"
        "gymnasium.make_vec('smaclite_pool/2s3z-v0', num_envs=2).close()\n"
        "import smaclite_pool\n"
        "ids = {f'smaclite_pool/{name}-v0' for name in [*smaclite_pool.scenarios(), 'custom']}\n"
        "assert {id for id in gymnasium.registry if id.startswith('smaclite_pool/')} == ids\n"
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("imports", ["import smaclite_pool, gymnasium", "import gymnasium, smaclite_pool"])
def test_importing_the_package_registers_nothing_and_installs_no_hook(imports: str) -> None:
    done = run_script(
        "import sys\n"
        "finders = sys.meta_path[:]\n"
        f"{imports}\n"
        "assert sys.meta_path == finders\n"
        "assert not [id for id in gymnasium.registry if 'smaclite' in id]\n"
    )
    assert done.returncode == 0, done.stderr


def test_an_illegal_action_passes_through_gymnasiums_processes() -> None:
    """AsyncVectorEnv raises the exception of a process again from its class and message."""
    warnings.simplefilter("ignore")  # it warns of the error, and that it closes in the middle of a step
    envs = gymnasium.make_vec("smaclite_pool/2s3z-v0", 2, vectorization_mode="async")
    try:
        envs.reset(seed=1)
        with pytest.raises(sp.errors.IllegalAction, match="agent 0: action 0 is not available"):
            envs.step(np.zeros((2, 5), np.int64))
    finally:
        envs.close()


def test_one_side_is_all_that_gymnasium_can_play() -> None:
    for make in (
        lambda: gymnasium.make_vec("smaclite_pool/3m-v0", num_envs=2, sides="both"),
        lambda: gymnasium.make("smaclite_pool/3m-v0", sides="both"),
    ):
        with pytest.raises(
            sp.errors.InvalidRequest, match="sides must be 'allies' here, got 'both'.*TorchRL"
        ):
            make()


def test_save_and_restore_through_what_gymnasium_makes() -> None:
    """The page said `env.save()`, which wrappers do not hand on, and they did not see a `restore`."""
    env: Any = gymnasium.make("smaclite_pool/3m-v0", max_episode_steps=5, episode_limit=30)
    with pytest.raises(AttributeError):
        env.save()
    env.reset(seed=1)
    env.step([1, 1, 1])
    snapshot, begin = env.unwrapped.save(), env.unwrapped._battle.last.obs.copy()
    for _ in range(4):
        *_, truncated, _ = env.step(env.action_space.sample())
    assert truncated, "by the wrapper"
    observation, info = env.reset(options={"snapshot": snapshot})
    assert np.array_equal(observation["obs"], begin) and info["episode_length"] == 1
    for step in range(1, 6):
        *_, truncated, info = env.step(env.action_space.sample())
        assert truncated == (step == 5), "the wrapper counts from the reset"
    assert info["episode_length"] == 6, "the battle from its begin, and so does episode_limit"
    env.close()

    other: Any = gymnasium.make("smaclite_pool/3m-v0")
    other.unwrapped.restore(snapshot)
    with pytest.raises(gymnasium.error.ResetNeeded):
        other.step([1, 1, 1])
    observation, _ = other.reset(options={"snapshot": snapshot})
    assert np.array_equal(observation["obs"], begin)
    other.close()


def test_a_restored_battle_ended_as_it_did() -> None:
    """With SMACv2's published code, which terminates at the limit, restored battles were truncated there."""
    for published in (False, True):
        env = BattleEnv("protoss_5_vs_5", episode_limit=2, seed=1, smacv2={"published": published})
        env.reset()
        stop = [1] * 5
        env.step(stop)
        *_, terminated, truncated, _ = env.step(stop)
        assert (terminated, truncated) == (published, not published)
        env.restore(env.save())
        assert (env._battle.last.terminated, env._battle.last.truncated) == (terminated, truncated)
        env.close()


def test_an_environment_is_copied_by_its_arguments_before_its_first_reset() -> None:
    env = BattleEnv("3m", seed=3, episode_limit=7)
    copies = [copy.deepcopy(env), pickle.loads(pickle.dumps(env))]
    first, _ = env.reset()
    for made in copies:
        assert made is not env and np.array_equal(made.reset()[0]["obs"], first["obs"])
        assert made._battle.envs.spec.episode_limit == 7
    for broken in (copy.deepcopy, pickle.dumps):
        with pytest.raises(TypeError, match=r"after its first reset: `save` and `restore` .* `Envs.fork`"):
            broken(env)
    for made in [env, *copies]:
        made.close()
    unseeded = BattleEnv("terran_5_vs_5")
    another = copy.deepcopy(unseeded)
    assert not np.array_equal(unseeded.reset()[0]["state"], another.reset()[0]["state"])
    unseeded.close()
    another.close()
    wrapped: Any = gymnasium.make("smaclite_pool/3m-v0", seed=1)
    again = copy.deepcopy(wrapped)
    assert again.reset()[0]["obs"].shape == (3, 30)
    wrapped.close()
    again.close()


def test_a_vector_has_one_limit() -> None:
    """Of the two names, one was ignored."""
    with closing(make_vector("3m", 1, episode_limit=5)) as envs:
        assert envs._envs.spec.episode_limit == 5
    with pytest.raises(sp.errors.InvalidRequest, match="give one of them"):
        make_vector("3m", 1, episode_limit=5, max_episode_steps=50)


@pytest.mark.parametrize("name", ["num_envs", "autoreset_mode", "fields", "lanes"])
def test_settings_that_an_integration_decides_are_named(name: str) -> None:
    """They were errors of Python, about arguments of another function or a list without `spec`."""
    settings: dict[str, Any] = {name: {"autoreset_mode": "NextStep", "fields": ["obs"]}.get(name, 2)}
    with pytest.raises(sp.errors.InvalidRequest, match=f"remove .*`{name}`|`{name}` .*remove"):
        BattleEnv("3m", **settings)
    if name == "lanes":
        with pytest.raises(sp.errors.InvalidRequest, match="`lanes` is for smaclite_pool.make alone"):
            gymnasium.make_vec("smaclite_pool/3m-v0", num_envs=2, lanes=2)


def test_a_seed_of_numpy_is_a_seed() -> None:
    seed: Any = np.int64(4)
    fields = ["obs", "state", "avail_actions", "snapshot"]
    with closing(make_vector("3m", 3, fields=fields)) as envs:
        envs.reset(seed=seed, options={"reset_mask": np.array([True, True, True])})
        one = envs.save()
        envs.reset(seed=4, options={"reset_mask": np.array([True, True, True])})
        np.testing.assert_array_equal(one, envs.save())
        envs.reset(seed=seed, options={"snapshot": one})


def test_masks_are_flat_for_maskable_ppo() -> None:
    env: Any = gymnasium.make("smaclite_pool/3m-v0")
    observation, _ = env.reset(seed=1)
    masks = env.get_wrapper_attr("action_masks")()
    assert masks.dtype == np.bool_ and np.array_equal(masks, observation["action_mask"].reshape(-1))
    env.close()
