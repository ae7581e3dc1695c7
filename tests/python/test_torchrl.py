"""The TorchRL integration, with TorchRL's own check, rollouts, collector and wrappers."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp

from conftest import Serve

torch = pytest.importorskip("torch")
pytest.importorskip("torchrl")

from smaclite_pool._render import Window
from smaclite_pool.integrations._common import INFO_FIELDS
from smaclite_pool.integrations.torchrl import PoolEnv
from tensordict.nn import TensorDictModule
from torchrl.collectors import Collector
from torchrl.envs import ActionMask, RewardSum, TransformedEnv
from torchrl.envs.utils import RandomPolicy, check_env_specs
from torchrl.modules import MaskedCategorical, ProbabilisticActor


@pytest.fixture
def env() -> Iterator[PoolEnv]:
    made = PoolEnv("2s3z", 4)
    yield made
    made.close()


@pytest.mark.parametrize("scenario", ["2s3z", "MMM2"])
def test_torchrl_accepts_it(scenario: str) -> None:
    env = PoolEnv(scenario, 3)
    check_env_specs(env, seed=1, break_when_any_done="both")
    env.close()


def test_the_keys_are_those_of_multi_agent_environments(env: PoolEnv) -> None:
    played = env.rollout(2)
    shapes = {key: tuple(played[key].shape) for key in played.keys(True, True) if key[0] != "next"}
    expected: dict[Any, tuple[int, ...]] = {
        ("agents", "observation"): (4, 2, 5, 80),
        ("agents", "action_mask"): (4, 2, 5, 11),
        ("agents", "action"): (4, 2, 5),
        "state": (4, 2, 120),
        **{("info", name): (4, 2) for name in INFO_FIELDS},
        **{name: (4, 2, 1) for name in ("done", "terminated", "truncated")},
    }
    assert shapes == expected
    assert played["next", "reward"].shape == (4, 2, 1)
    assert env.group_map == {"agents": [f"agent_{i}" for i in range(5)]}


@pytest.mark.parametrize("scenario", ["3m", "5m_vs_6m"])
def test_the_enemies_are_a_group(scenario: str) -> None:
    env = PoolEnv(scenario, 3, sides="mirrored")
    check_env_specs(env, seed=1, break_when_any_done="both")
    assert list(env.group_map) == ["agents", "enemies"]
    env.set_seed(5)
    played = env.rollout(60, break_when_any_done=False)
    with sp.make(scenario, 3, autoreset_mode="Disabled", sides="mirrored") as envs:
        batch = envs.reset(5)
        for step in range(20):
            assert np.array_equal(played[:, step]["enemies", "observation"], batch.enemy_obs)
            assert np.array_equal(played[:, step]["enemies", "action_mask"], batch.enemy_avail_actions)
            each = [played[:, step][group, "action"].numpy() for group in ("agents", "enemies")]
            batch = envs.step(np.concatenate(each, axis=1))
            rewards = played[:, step]["next", "enemies", "reward"]
            assert rewards.shape == (3, envs.spec.n_enemies, 1)
            assert (rewards[..., 0].numpy() == batch.enemy_reward[:, None]).all()
    env.close()


def test_q_learning_knows_the_kind_of_actions(env: PoolEnv) -> None:
    """TorchRL looks for exact types: "action_space was not specified/not compatible"."""
    from torchrl.modules import QValueModule

    keys = [("agents", name) for name in ("action", "action_value", "chosen_action_value")]
    module = QValueModule(spec=env.full_action_spec, action_value_key=keys[1], out_keys=keys)
    assert module.action_space == "categorical"


def test_specifications_can_be_those_of_one_environment(env: PoolEnv) -> None:
    """ "list index out of range", by an axis that TorchRL took for a value."""
    assert env.full_observation_spec_unbatched["info", "battle_won"].shape == ()
    for name in ("action", "done", "observation", "reward"):
        assert getattr(env, f"full_{name}_spec_unbatched").shape == ()


def test_a_rollout_is_the_pools_own_play(env: PoolEnv) -> None:
    """Environments whose episode ends are reset separately."""
    env.set_seed(7)
    torch.manual_seed(1)
    played = env.rollout(150, break_when_any_done=False)
    ended = played["next", "done"].squeeze(-1)
    assert ended.any(1).all() and not ended.any(0).all(), "resets were not of some environments only"
    with sp.make("2s3z", 4, autoreset_mode="Disabled") as envs:
        batch = envs.reset(seed=7)
        for step in range(150):
            now, then = played[:, step], played[:, step]["next"]
            assert np.array_equal(now["agents", "observation"].numpy(), batch.obs), step
            assert np.array_equal(now["agents", "action_mask"].numpy(), batch.avail_actions), step
            assert np.array_equal(now["state"].numpy(), batch.state), step
            batch = envs.step(now["agents", "action"].numpy())
            assert np.array_equal(then["reward"].squeeze(-1).numpy(), batch.reward), step
            assert np.array_equal(then["agents", "observation"].numpy(), batch.obs), step
            assert np.array_equal(then["info", "episode_return"].numpy(), batch.episode_return), step
            over = batch.terminated | batch.truncated
            assert np.array_equal(then["done"].squeeze(-1).numpy(), over), step
            if over.any():
                batch = envs.reset(env_id=over)


def test_a_mask_resets_some_environments_and_leaves_the_others(env: PoolEnv) -> None:
    data = env.rollout(5)[:, -1]["next"].clone()
    mask = torch.tensor([[True], [False], [True], [False]])
    after = env.reset(data.set("_reset", mask))
    assert after["info", "episode_length"].tolist() == [0, 5, 0, 5]
    assert torch.equal(after["state"][1::2], data["state"][1::2])
    env.step(env.rand_action(after))


def test_steps_of_some_environments_are_refused(env: PoolEnv) -> None:
    """TorchRL marks who is to be stepped, and `PoolEnv` stepped all of them."""
    step = env.rand_action(env.reset(seed=1))
    step["_step"] = torch.arange(len(env.envs)) > 0
    with pytest.raises(sp.errors.InvalidRequest, match="PoolEnv steps all its environments, but `_step`"):
        env.step(step)
    step["_step"] = torch.ones(env.batch_size, dtype=torch.bool)
    assert (env.step(step)["next", "info", "episode_length"] == 1).all()


def test_a_step_without_actions_says_what_is_missing(env: PoolEnv) -> None:
    with pytest.raises(sp.errors.InvalidRequest, match=r'has no \("agents", "action"\)'):
        env.step(env.reset(seed=1))


def test_a_saved_state_has_the_same_future_again() -> None:
    with closing(
        PoolEnv("2s3z", 4, fields=["obs", "state", "avail_actions", "snapshot", *INFO_FIELDS])
    ) as env:
        with pytest.raises(sp.errors.InvalidRequest, match="call reset first"):
            env.save()
        now = env.rollout(5)[:, -1]["next"]
        saved = env.save()
        torch.manual_seed(2)
        first = env.rollout(6, auto_reset=False, tensordict=now.clone())["next", "state"]
        restored = env.restore(saved)
        assert torch.equal(restored["state"], now["state"]) and not restored["done"].any()
        torch.manual_seed(2)
        assert torch.equal(env.rollout(6, auto_reset=False, tensordict=restored)["next", "state"], first)
        one = env.restore(saved[:1], [2])
        assert one["info", "episode_length"].tolist() == [11, 11, 5, 11]
    with (
        closing(PoolEnv("3m", 2)) as env,
        pytest.raises(sp.errors.InvalidRequest, match="name the field `snapshot`"),
    ):
        env.save()


def test_infos_are_those_that_the_lane_has() -> None:
    """It was an error without an explanation: KeyError 'battle_won'."""
    fields = ["obs", "state", "avail_actions", "snapshot", "episode_length"]
    with closing(PoolEnv("3m", 2, fields=fields)) as env:
        check_env_specs(env, seed=1)
        assert list(env.rollout(3)["info"].keys()) == ["episode_length"]
        with pytest.raises(
            sp.errors.InvalidRequest, match="restore needs `dead_allies`, `dead_enemies` among"
        ):
            env.restore(env.save())
    with pytest.raises(
        sp.errors.InvalidRequest, match="TorchRL needs `state`, `avail_actions` among `fields`"
    ):
        PoolEnv("3m", 2, fields=["obs"])
    with pytest.raises(sp.errors.InvalidRequest, match="TorchRL needs `enemy_reward` among `fields`"):
        both = ["obs", "state", "avail_actions", "enemy_obs", "enemy_avail_actions"]
        PoolEnv("3m", 2, sides="both", fields=both)


def test_a_restore_says_which_battles_have_ended() -> None:
    """All were marked as not done, also what had ended."""
    fields = ["obs", "state", "avail_actions", "snapshot", *INFO_FIELDS]
    with closing(PoolEnv("3m", 3, fields=fields, episode_limit=12)) as env:
        data = env.reset(seed=1)
        middle = None
        while not data["done"].all():
            middle = env.save() if data["info", "episode_length"][0] == 5 else middle
            data = env.step(env.rand_action(data))["next"]
        assert data["truncated"].all()
        ended = env.save()
        assert middle is not None
        one = env.restore(middle[1:2], [1])
        assert one["done"][:, 0].tolist() == one["truncated"][:, 0].tolist() == [True, False, True]
        again = env.restore(ended)
        assert again["truncated"].all() and not again["terminated"].any()
        assert not env.restore(middle)["done"].any()
    with closing(PoolEnv("3m", 1, fields=fields, episode_limit=None)) as env:
        won = env.rollout(200)[:, -1]["next"]
        assert won["terminated"].all() and env.restore(env.save())["terminated"].all()


def test_actions_are_passed_on_as_they_are(env: PoolEnv) -> None:
    """1.9 was played as 1, and 2**32 + 1 too."""
    data = env.reset(seed=1)
    data["agents", "action"] = torch.full((4, 5), 1.9, requires_grad=True)
    with pytest.raises(TypeError, match="actions must be an integer array, got float32"):
        env.step(data)
    data["agents", "action"] = torch.full((4, 5), 2**32 + 1)
    with pytest.raises(sp.errors.InvalidRequest, match="actions must fit into int32, got 4294967297"):
        env.step(data)
    data["agents", "action"] = torch.ones((4, 5), dtype=torch.uint8)
    assert env.step(data)["next", "info", "episode_length"].tolist() == [1, 1, 1, 1]


def test_settings_that_do_not_fit_are_refused_and_leave_no_pool() -> None:
    with pytest.raises(sp.errors.InvalidRequest, match="TorchRL needs batches of all environments"):
        PoolEnv("3m", 4, batch_size=2)
    with pytest.raises(sp.errors.InvalidRequest, match="waits for a reset .*; remove `autoreset_mode`"):
        PoolEnv("3m", 4, autoreset_mode="NextStep")
    with sp.make("3m", 4, autoreset_mode="Disabled") as envs:
        with pytest.raises(sp.errors.InvalidRequest, match="its own settings; remove num_envs"):
            PoolEnv(envs, 8)
        assert PoolEnv(envs, 4).batch_size == (4,)
    assert sp.pools() == []


def test_a_reset_takes_a_seed_and_nothing_else() -> None:
    """`reset(seed=3)` was ignored, as any other argument."""
    with pytest.raises(TypeError, match="did you mean `device`"):
        PoolEnv("3m", devise="cpu")
    with closing(PoolEnv("terran_5_vs_5", 3)) as env:
        wrapped = TransformedEnv(env, RewardSum())
        first = env.reset(seed=3)["state"]
        env.set_seed(8)
        assert torch.equal(wrapped.reset(seed=3)["state"], first)
        assert not torch.equal(env.reset()["state"], first), "goes on"
        some = env.reset(env.rollout(1)[:, -1].set("_reset", torch.tensor([[False], [True], [True]])), seed=3)
        assert torch.equal(some["state"][1:], first[1:]) and not torch.equal(some["state"][0], first[0])
        env.set_seed(3)
        assert torch.equal(env.reset()["state"], first)
        with pytest.raises(TypeError, match="foo"):
            env.reset(foo=3)


def test_a_seed_gives_the_same_rollout_again(env: PoolEnv) -> None:
    def play(seed: int) -> Any:
        env.set_seed(seed)
        torch.manual_seed(0)
        return env.rollout(10)["next", "state"]

    first = play(3)
    assert torch.equal(play(3), first) and not torch.equal(play(4), first)


def test_a_time_out_is_truncation() -> None:
    env = PoolEnv("2s3z", 2, episode_limit=3)
    last = env.rollout(10)[:, -1]["next"]
    assert last["truncated"].all() and last["done"].all() and not last["terminated"].any()
    assert last["info", "episode_length"].tolist() == [3, 3]
    env.close()


def test_an_unavailable_action_is_refused(env: PoolEnv) -> None:
    data = env.reset()
    data["agents", "action"] = torch.zeros(4, 5, dtype=torch.int64)
    with pytest.raises(sp.errors.IllegalAction):
        env.step(data)


def test_a_collector_keeps_more_batches_than_a_lane_allows() -> None:
    env = PoolEnv("2s3z", 4)
    logits = TensorDictModule(torch.nn.Linear(80, 11), [("agents", "observation")], [("agents", "logits")])
    policy = ProbabilisticActor(
        logits,
        in_keys={"logits": ("agents", "logits"), "mask": ("agents", "action_mask")},
        out_keys=[("agents", "action")],
        distribution_class=MaskedCategorical,
    )
    collector = Collector(env, policy, frames_per_batch=400, total_frames=800)
    gathered = list(collector)
    assert [data.numel() for data in gathered] == [400, 400]
    assert any(data["next", "done"].any() for data in gathered)
    collector.shutdown()
    assert sp.pools() == []


def bare(env: PoolEnv) -> Any:
    return env


def summed(env: PoolEnv) -> Any:
    return TransformedEnv(env, RewardSum())


def masked(env: PoolEnv) -> Any:
    mask = ActionMask(action_key=("agents", "action"), mask_key=("agents", "action_mask"))
    return TransformedEnv(env, mask)


def moved(env: PoolEnv) -> Any:
    """To another device, at least for TorchRL."""
    return env.to("cpu:0")


def moved_inside(env: PoolEnv) -> Any:
    """During an episode, and after it was wrapped."""
    wrapped = summed(env)
    env.reset()
    env.to("cpu:0")
    return wrapped


@pytest.mark.parametrize("wrap", [bare, summed, masked, moved, moved_inside])
@pytest.mark.parametrize("policy", ["rollout", "none", "lazy", "random", "rand_action"])
@pytest.mark.parametrize("device", [None, "cpu", "cpu:0"])
def test_random_actions_are_available_ones(env: PoolEnv, wrap: Any, policy: str, device: str | None) -> None:
    """TorchRL copies the specification of the actions, and the copies once kept the mask of another step. A
    collector with a device first makes its policy and then moves the environment."""
    wrapped = wrap(env)
    if policy == "rollout":
        played = wrapped.rollout(150, break_when_any_done=False)
        assert played["next", "done"].any()
        chosen = played["agents", "action_mask"].gather(-1, played["agents", "action"].unsqueeze(-1))
        assert chosen.all()
        return
    policies = {
        "none": lambda: None,
        "lazy": RandomPolicy,
        "random": lambda: RandomPolicy(wrapped.full_action_spec),
        "rand_action": lambda: wrapped.rand_action,
    }
    collector = Collector(wrapped, policies[policy](), frames_per_batch=600, total_frames=600, device=device)
    assert [data.numel() for data in collector] == [600]
    collector.shutdown()


def test_a_running_pool_is_attached_to(serve: Serve) -> None:
    serve("2s3z:3", "--name", "train", "--autoreset-mode", "Disabled", "--threads", "1")
    env = PoolEnv(sp.connect("train"))
    check_env_specs(env)
    env.close()
    serve("2s3z:3", "--name", "other", "--threads", "1")
    with sp.connect("other") as envs, pytest.raises(sp.errors.InvalidRequest, match="NextStep"):
        PoolEnv(envs)


def test_torchrl_wraps_the_pettingzoo_integration() -> None:
    pytest.importorskip("pettingzoo")
    from smaclite_pool.integrations.pettingzoo import parallel_env
    from torchrl.envs import PettingZooWrapper

    env = PettingZooWrapper(parallel_env("2s3z"), use_mask=True, return_state=True, categorical_actions=True)
    check_env_specs(env)
    played = env.rollout(200)
    assert played["next", "done"][-1].all() and played["agent", "action_mask"].shape[1:] == (5, 11)
    env.close()


def test_torchrl_makes_a_single_battle_from_an_id() -> None:
    pytest.importorskip("gymnasium")
    from torchrl.envs import GymEnv

    name = "smaclite_pool.integrations.gymnasium:smaclite_pool/2s3z-v0"
    env = GymEnv(name, illegal_actions="stop")  # TorchRL makes a specification without a mask
    assert env.rollout(5)["obs"].shape[1:] == (5, 80)
    env.close()


def test_torchrl_wraps_the_vector_environment() -> None:
    """It failed without the attribute `autoreset_mode`, which Gymnasium's vector environments have."""
    pytest.importorskip("gymnasium")
    from smaclite_pool.integrations.gymnasium import make_vector
    from torchrl.envs import GymWrapper

    options: dict[str, Any] = {"max_episode_steps": 8, "illegal_actions": "stop"}
    with closing(make_vector("2s3z", 3, seed=1, autoreset_mode="Disabled", **options)) as vector:
        played = GymWrapper(vector).rollout(20, break_when_any_done=False)
    assert played["obs"].shape == played["next", "obs"].shape == (3, 20, 5, 80)
    done = played["next", "done"][..., 0].nonzero().tolist()
    assert done == [[env, step] for env in range(3) for step in (7, 15)]
    assert torch.equal(played["obs"][:, 1:8], played["next", "obs"][:, :7])
    assert not torch.equal(played["next", "obs"][:, 7], played["obs"][:, 8]), "the last of an episode"
    assert torch.equal(played["obs"][:, 0], played["obs"][:, 8]), "start positions are fixed"


def test_torchrl_refuses_a_vector_that_resets_in_the_next_step() -> None:
    pytest.importorskip("gymnasium")
    from smaclite_pool.integrations.gymnasium import make_vector
    from torchrl.envs import GymWrapper

    with closing(make_vector("2s3z", 2)) as vector:
        with pytest.raises(RuntimeError, match="auto-reset mode must be one of SAME_STEP or DISABLED"):
            GymWrapper(vector)


def test_pictures_of_all_environments(monkeypatch: pytest.MonkeyPatch) -> None:
    from torchrl.record import PixelRenderTransform

    env = PoolEnv("2s3z", 2, render_mode="rgb_array").append_transform(PixelRenderTransform())
    pixels = env.rollout(3)["pixels"]
    assert pixels.shape == (2, 3, 256, 256, 3) and pixels.dtype == torch.uint8
    assert not torch.equal(pixels[:, 0], pixels[:, 1])
    env.close()

    shown: list[Any] = []
    monkeypatch.setattr(Window, "show", lambda _, picture: shown.append(picture))
    with closing(PoolEnv("2s3z", 2, render_mode="human", render_speed=0.5)) as env:
        env.rollout(3)
    assert len(shown) == 4 and shown[0].shape[1] > 2 * 256
    with closing(PoolEnv("2s3z", 1)) as plain:
        assert plain.render() is None
    wrong: list[dict[str, Any]] = [{"render_mode": "ansi"}, {"render_speed": 0}]
    for option in wrong:
        with pytest.raises(sp.errors.InvalidRequest, match=f"{next(iter(option))} must be"):
            PoolEnv("2s3z", 1, **option)
