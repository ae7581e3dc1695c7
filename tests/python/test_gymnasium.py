"""The Gymnasium integration, with Gymnasium's own checkers, wrappers and vector environments."""

from __future__ import annotations

import copy
import gc
import json
import pickle
import sys
import warnings
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp

pytest.importorskip("gymnasium")

import gymnasium
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv
from gymnasium.vector.utils import batch_space
from gymnasium.wrappers.vector import RecordEpisodeStatistics
from smaclite_pool._render import Window
from smaclite_pool.integrations.gymnasium import BattleEnv, BattleVectorEnv, make_vector

from conftest import Serve, run_script
from play import duel

MODULE = "smaclite_pool.integrations.gymnasium"


@pytest.fixture(autouse=True)
def no_warnings() -> Iterator[None]:
    """Gymnasium's checkers report by warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


@pytest.mark.parametrize("scenario", sp.scenarios())
def test_gymnasium_accepts_one_environment(scenario: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Window, "show", lambda *_: True)  # the checker tries every render mode
    # The checker uses an action of one state in another, where it may not be available.
    env = gymnasium.make(f"smaclite_pool/{scenario}-v0", render_mode="rgb_array", illegal_actions="stop")
    check_env(env.unwrapped)
    env.close()


@pytest.mark.parametrize("mode", [None, "sync", "async"])
def test_gymnasium_makes_a_vector(mode: str | None) -> None:
    envs = gymnasium.make_vec("smaclite_pool/2s3z-v0", num_envs=3, vectorization_mode=mode)
    expected = {None: BattleVectorEnv, "sync": SyncVectorEnv, "async": AsyncVectorEnv}[mode]
    assert isinstance(envs, expected) and isinstance(envs, gymnasium.vector.VectorEnv)
    observations, _ = envs.reset(seed=1)
    assert observations in envs.observation_space
    assert envs.observation_space == batch_space(envs.single_observation_space, 3)
    assert envs.action_space == batch_space(envs.single_action_space, 3)
    observations, rewards, terminated, truncated, infos = envs.step(np.ones((3, 5), np.int64))
    assert observations in envs.observation_space
    assert infos["episode_length"].tolist() == [1, 1, 1]
    assert [array.shape for array in (rewards, terminated, truncated)] == [(3,)] * 3
    assert [array.dtype for array in (rewards, terminated, truncated)] == [np.float64, np.bool_, np.bool_]
    envs.close()


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


@pytest.mark.parametrize("mode", ["sync", "async"])
def test_a_vector_of_single_battles_can_stop_what_is_unavailable(mode: Any) -> None:
    """Gymnasium makes its action space, which knows no mask."""
    made = gymnasium.make_vec(
        "smaclite_pool/2s3z-v0", 2, vectorization_mode=mode, illegal_actions="stop", episode_limit=9
    )
    with closing(made) as envs:
        envs.action_space.seed(1)
        envs.reset(seed=1)
        ends = sum(envs.step(envs.action_space.sample())[3].sum() for _ in range(30))
    assert ends == 6


def test_a_vector_draws_every_environment() -> None:
    envs: Any = gymnasium.make_vec("smaclite_pool/2s3z-v0", num_envs=3, render_mode="rgb_array")
    assert envs.metadata["render_modes"] == ["human", "rgb_array"] and envs.metadata["render_fps"] == 2
    with pytest.raises(sp.errors.InvalidRequest, match="call reset first"):
        envs.render()
    first_state = envs.reset(seed=1)[0]["state"]
    first = envs.render()
    assert isinstance(first, tuple) and [picture.shape for picture in first] == [(256, 256, 3)] * 3
    assert np.array_equal(first[1], sp.Renderer("2s3z", 256, 256).render(first_state[1]))
    envs.step(np.ones((3, 5), np.int64))
    for before, after in zip(first, envs.render(), strict=True):
        assert not np.array_equal(before, after)
    envs.close()
    with closing(make_vector("2s3z", 1)) as plain:
        plain.reset()
        assert plain.render() is None
    with pytest.raises(sp.errors.InvalidRequest, match="render_mode must be None"):
        make_vector("2s3z", 1, render_mode="ansi")
    with pytest.raises(sp.errors.InvalidRequest, match="field `state`, which this lane omits"):
        make_vector("2s3z", 1, render_mode="rgb_array", fields=["obs"])


def test_a_window_shows_every_step_of_a_vector(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[Any] = []
    monkeypatch.setattr(Window, "show", lambda _, picture: shown.append(picture))
    with closing(make_vector("2s3z", 4, render_mode="human")) as envs:
        states = [envs.reset(seed=1)[0]["state"], envs.step(np.ones((4, 5), np.int64))[0]["state"]]
    expected = [sp.Renderer("2s3z", 256, 256).sheet(state) for state in states]
    assert len(shown) == 2 and all(map(np.array_equal, shown, expected))


def test_a_window_shows_every_step_of_a_battle(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[Any] = []
    monkeypatch.setattr(Window, "show", lambda _, picture: shown.append(picture))
    env: Any = gymnasium.make("smaclite_pool/2s3z-v0", render_mode="human", render_speed=0.5)
    assert env.unwrapped.metadata["render_modes"] == ["human", "rgb_array"]
    states = [env.reset(seed=1)[0]["state"], env.step([1] * 5)[0]["state"]]
    assert env.render() is None
    renderer = sp.Renderer("2s3z", 640, 640)
    assert len(shown) == 3 and all(map(np.array_equal, shown, map(renderer.render, [*states, states[1]])))
    env.close()
    plain = BattleEnv("2s3z")
    plain.reset()
    assert plain.render() is None
    plain.close()
    for make in (BattleEnv, make_vector):
        with pytest.raises(sp.errors.InvalidRequest, match="render_mode must be None"):
            make("2s3z", render_mode="ansi")
        with pytest.raises(sp.errors.InvalidRequest, match="render_speed must be a number above 0"):
            make("2s3z", render_mode="human", render_speed=0)


def test_a_picture_shows_the_units_of_the_options() -> None:
    """Those of the scenario were drawn, or the state had the wrong size for them."""
    drawn: dict[str, Any] = {
        "teams": {"distribution": "all_teams", "unit_types": ["MARINE", "MARAUDER", "MEDIVAC"]},
        "start_positions": {"distribution": "reflect_position"},
    }
    env = BattleEnv("3m", seed=1, render_mode="rgb_array", **drawn)
    state = env.reset()[0]["state"]
    with sp.make("3m", 1, **drawn) as envs:
        assert np.array_equal(env.render(), sp.Renderer(envs, *env.picture_size).render(state))
    env.close()
    for option in ({"render_mode": "ansi"}, {"render_speed": 0}):
        with pytest.raises(sp.errors.InvalidRequest, match=f"{next(iter(option))} must be"):
            BattleEnv("3m", **option)  # type: ignore[arg-type]


def test_spaces_are_those_learners_expect() -> None:
    with closing(make_vector("MMM2", 2)) as envs:
        assert envs.single_action_space == gymnasium.spaces.MultiDiscrete([18] * 10)
        assert list(envs.single_observation_space) == ["action_mask", "obs", "state"]


def first_available(masks: np.ndarray[Any, Any], rng: np.random.Generator) -> np.ndarray[Any, Any]:
    """Available actions from a given generator."""
    actions: np.ndarray[Any, Any] = (rng.random(masks.shape) * masks).argmax(-1)
    return actions


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_it_plays_as_gymnasiums_own_vector_does(mode: AutoresetMode) -> None:
    """Three battles of the pool beside three single ones that Gymnasium combines: the same bits."""
    n_envs, rng = 3, np.random.default_rng(7)
    ours = make_vector("2s3z", n_envs, autoreset_mode=mode, max_episode_steps=40)
    theirs: Any = SyncVectorEnv([lambda: BattleEnv("2s3z", episode_limit=40)] * n_envs, autoreset_mode=mode)
    assert ours.metadata["autoreset_mode"] is mode and ours.autoreset_mode is theirs.autoreset_mode
    seen, _ = ours.reset(seed=11)
    expected, _ = theirs.reset(seed=11)
    episodes = 0
    for _ in range(130):
        np.testing.assert_equal(seen, expected)
        actions = first_available(seen["action_mask"], rng)
        seen, rewards, terminated, truncated, infos = ours.step(actions)
        expected, *rest, expected_infos = theirs.step(actions)
        ours_by_name = {"reward": rewards, "terminated": terminated, "truncated": truncated}
        for (name, got), wanted in zip(ours_by_name.items(), rest, strict=True):
            np.testing.assert_array_equal(got, wanted, err_msg=name)
        ended = terminated | truncated
        episodes += ended.sum()
        if mode is AutoresetMode.SAME_STEP:
            compare_final(infos, expected_infos)
        if mode is AutoresetMode.DISABLED and ended.any():
            seen, _ = ours.reset(options={"reset_mask": ended})
            expected, _ = theirs.reset(options={"reset_mask": ended.copy()})
    assert episodes >= 6
    ours.close()
    theirs.close()


def compare_final(infos: dict[str, Any], expected: dict[str, Any]) -> None:
    assert ("final_obs" in infos) == ("final_obs" in expected)
    if "final_obs" not in infos:
        return
    for key in ("_final_obs", "_final_info"):
        np.testing.assert_array_equal(infos[key], expected[key])
    assert infos["final_obs"].dtype == object
    for env in np.flatnonzero(infos["_final_obs"]):
        np.testing.assert_equal(infos["final_obs"][env], expected["final_obs"][env])
    for env in np.flatnonzero(~infos["_final_obs"]):
        assert infos["final_obs"][env] is None
    for name in ("battle_won", "dead_allies", "dead_enemies", "episode_return", "episode_length"):
        np.testing.assert_array_equal(infos["final_info"][name], expected["final_info"][name])
        np.testing.assert_array_equal(infos["final_info"][f"_{name}"], expected["final_info"][f"_{name}"])


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_record_episode_statistics_agrees(mode: AutoresetMode) -> None:
    if mode is AutoresetMode.SAME_STEP and tuple(map(int, gymnasium.__version__.split(".")[:2])) < (1, 4):
        pytest.skip("this wrapper forgets the first step after a same-step reset before Gymnasium 1.4")
    made = gymnasium.make_vec("smaclite_pool/2s3z-v0", num_envs=4, autoreset_mode=mode.value)
    envs: Any = RecordEpisodeStatistics(made)
    envs.action_space.seed(3)
    envs.reset(seed=2)
    episodes = 0
    for _ in range(200):
        _, _, terminated, truncated, infos = envs.step(envs.action_space.sample())
        ended = terminated | truncated
        if ended.any():
            episodes += ended.sum()
            np.testing.assert_array_equal(infos["_episode"], ended)
            np.testing.assert_allclose(
                infos["episode"]["r"][ended], infos["episode_return"][ended], rtol=1e-5
            )
            np.testing.assert_array_equal(infos["episode"]["l"][ended], infos["episode_length"][ended])
            if mode is AutoresetMode.DISABLED:
                envs.reset(options={"reset_mask": ended})
    assert episodes >= 8
    envs.close()


def test_a_masked_reset_leaves_the_others_alone() -> None:
    with closing(make_vector("2s3z", 3, autoreset_mode="Disabled")) as envs:
        envs.reset(seed=1)
        for _ in range(5):
            before, *_ = envs.step(envs.action_space.sample())
        mask = np.array([False, True, False])
        after, infos = envs.reset(seed=1, options={"reset_mask": mask})
        np.testing.assert_array_equal(after["obs"][~mask], before["obs"][~mask])
        assert infos["_battle_won"].tolist() == mask.tolist()
        assert (after["state"][1] != before["state"][1]).any()
        with pytest.raises(sp.errors.InvalidRequest, match="at least one environment"):
            envs.reset(options={"reset_mask": ~mask & mask})
        with pytest.raises(sp.errors.InvalidRequest, match="shape"):
            envs.reset(options={"reset_mask": mask[:2]})


def test_arrays_are_copies_unless_copy_is_false() -> None:
    with closing(make_vector("2s3z", 2)) as envs:
        first, _ = envs.reset(seed=1)
        kept = copy.deepcopy(first)
        held = [envs.step(np.ones((2, 5), int))[0] for _ in range(10)]
        assert all(array.flags.writeable for array in first.values())
        np.testing.assert_equal(first, kept)
        assert len(held) == 10
    with closing(make_vector("2s3z", 2, copy=False, max_held_batches=3)) as envs:
        views, _ = envs.reset(seed=1)
        assert not any(array.flags.writeable for array in views.values())
        held = [views]
        with pytest.raises(sp.errors.TooManyBatchesHeld):
            held.extend(envs.step(np.ones((2, 5), int))[0] for _ in range(5))
        assert len(held) == 3


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


def test_a_vector_that_cannot_be_copied_says_so_once() -> None:
    """A half-made copy was closed, which failed in `__del__`, and a shallow one closed the environments."""
    failed: list[Any] = []
    hook, sys.unraisablehook = sys.unraisablehook, failed.append
    try:
        with closing(make_vector("3m", 1)) as envs:
            for make_copy in (copy.deepcopy, copy.copy, pickle.dumps):
                with pytest.raises(TypeError, match="`fork` copies battles"):
                    make_copy(envs)
                gc.collect()
            envs.reset()
    finally:
        sys.unraisablehook = hook
    assert failed == []


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
    assert BattleEnv("2s3z", seed=4).np_random_seed == 4


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


def test_an_attached_lane_is_a_vector_too(serve: Serve) -> None:
    serve("2s3z:2", "--name", "gym")
    with pytest.raises(sp.errors.InvalidRequest, match="asynchronous"):
        BattleVectorEnv(sp.make("2s3z", 4, batch_size=2))
    envs = BattleVectorEnv(sp.connect("gym"))
    envs.reset(seed=3)
    seen, *_ = envs.step(envs.action_space.sample())
    assert seen["obs"].shape == (2, 5, 80)
    envs.close()


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


def test_a_vector_continues_from_snapshots_at_a_reset() -> None:
    fields = ["obs", "state", "avail_actions", "episode_length", "snapshot"]
    envs: Any = gymnasium.make_vec("smaclite_pool/3m-v0", num_envs=3, fields=fields)
    wrapped = RecordEpisodeStatistics(envs)
    wrapped.reset(seed=1)
    envs.step(np.ones((3, 3), np.int64))
    snapshots, state = envs.unwrapped.save(), envs.unwrapped._last.state.copy()
    wrapped.step(np.ones((3, 3), np.int64))
    observations, infos = wrapped.reset(options={"snapshot": snapshots})
    assert np.array_equal(observations["state"], state) and infos["episode_length"].tolist() == [1, 1, 1]
    with pytest.raises(sp.errors.InvalidRequest, match="exclude each other"):
        envs.reset(options={"snapshot": snapshots, "reset_mask": [True] * 3})
    with pytest.raises(sp.errors.InvalidRequest, match="one integer or None, got a list"):
        envs.reset(options={"snapshot": snapshots}, seed=[1, 2, 3])
    wrapped.close()


@pytest.mark.parametrize("mode", [AutoresetMode.SAME_STEP, "SameStep"])
@pytest.mark.parametrize("more", [[], ["final_obs", "episode_length"]])
def test_fields_of_same_step_autoreset_are_added(mode: Any, more: list[str]) -> None:
    """The first end of an episode was an error about a field that the caller had not named."""
    fields = ["obs", "state", "avail_actions", "snapshot", *more]
    options: dict[str, Any] = {"autoreset_mode": mode, "max_episode_steps": 3, "seed": 1}
    with (
        closing(make_vector("3m", 2, fields=fields, **options)) as envs,
        closing(make_vector("3m", 2, **options)) as complete,
    ):
        envs.reset()
        complete.reset()
        for _ in range(3):
            *_, infos = envs.step(np.ones((2, 3), np.int64))
            *_, expected = complete.step(np.ones((2, 3), np.int64))
        np.testing.assert_equal(infos["final_obs"][1], expected["final_obs"][1])
        assert set(infos["final_obs"][1]) == {"obs", "state", "action_mask"}
    with closing(make_vector("3m", 1, fields=["state"], autoreset_mode=mode)) as envs:
        assert set(envs._envs.spec.fields) & {"final_obs", "final_state"} == {"final_state"}
    with pytest.raises(TypeError, match="fields must be a list of strings"):
        make_vector("3m", 1, fields="obs", autoreset_mode=mode)


def test_a_lane_without_the_fields_that_are_needed_is_refused() -> None:
    """They were missed in the first step, or at the first end of an episode."""
    with (
        sp.make("3m", 2, fields=["obs", "state", "final_obs"], autoreset_mode="SameStep") as envs,
        pytest.raises(sp.errors.InvalidRequest, match='"SameStep" needs `final_state` among `fields`'),
    ):
        BattleVectorEnv(envs)
    with pytest.raises(sp.errors.InvalidRequest, match='"stop" needs `avail_actions` among `fields`'):
        make_vector("3m", 2, fields=["obs"], illegal_actions="stop")


def test_seeds_are_a_list_as_for_gymnasiums_vectors() -> None:
    """`reset(seed=[1, 2, 3, 4])` was refused with "Seed must be a python integer"."""
    seeds = [4, 9, None, 4]
    name = "smaclite_pool/terran_5_vs_5-v0"
    theirs = gymnasium.make_vec(name, num_envs=4, vectorization_mode="sync")
    ours = gymnasium.make_vec(name, num_envs=4)
    expected, _ = theirs.reset(seed=seeds)  # type: ignore[arg-type]
    got, _ = ours.reset(seed=seeds)  # type: ignore[arg-type]
    for i in (0, 1, 3):
        assert np.array_equal(got["obs"][i], expected["obs"][i])
    options = {"reset_mask": [False, False, True, True]}
    again, infos = ours.reset(seed=[8, 8, 8, 9], options=options)  # type: ignore[arg-type]
    assert np.array_equal(again["obs"][3], expected["obs"][1]) and not np.array_equal(
        again["obs"][2], got["obs"][2]
    )
    assert np.array_equal(again["obs"][0], got["obs"][0])
    assert infos["_battle_won"].tolist() == [False, False, True, True], "was the list that the caller passed"
    theirs.close()
    ours.close()


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
