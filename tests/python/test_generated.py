"""Battles whose units are drawn for each episode, and lanes with SMACv2's options."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp

from conftest import recorded, replayed

FIELDS = ["obs", "state", "avail_actions", "alive", "reward", "snapshot", "level"]
HIDDEN = {"prob_obs_enemy": 0.5, "conic_fov": True, "attack": {"lower_bound": 0.3, "upper_bound": 0.9}}


def test_a_seed_gives_the_same_teams_and_battles_on_any_number_of_threads() -> None:
    found: list[list[Any]] = [[], []]
    for threads, batches in enumerate(found, 1):
        with sp.make("protoss_5_vs_5", 6, seed=0, threads=threads, fields=FIELDS, smacv2=HIDDEN) as envs:
            batch = envs.reset(seed=3)
            for _ in range(60):
                batches.append(batch.copy())
                batch = envs.step(envs.sample_actions())
    for one, other in zip(*found, strict=True):
        assert all(np.array_equal(one[name], other[name]) for name in FIELDS)
    teams = np.array([batch["level"][..., 0] for batch in found[0]]).reshape(-1, 10)
    assert len(np.unique(teams, axis=0)) > 6  # each episode has another team


def test_distributions_on_a_map_of_fixed_teams() -> None:
    starts = {"distribution": "surrounded_and_reflect", "p": 0.5}
    with sp.make("3s5z", 16, fields=FIELDS, start_positions=starts) as envs:
        levels = envs.reset(seed=1).level
        assert len(np.unique(levels[:, 0, 1:3], axis=0)) > 4
        assert (levels[:, :, 0] == levels[0, :, 0]).all()  # the teams are those of the groups
    teams = {"distribution": "all_teams", "unit_types": ["STALKER", "ZEALOT"]}
    with sp.make("3s5z", 16, fields=FIELDS, teams=teams, start_positions=starts) as envs:
        n_stalkers = (envs.reset(seed=1).level[:, :8, 0] == 0).sum(-1)
        assert len(set(n_stalkers.tolist())) > 3


@pytest.mark.parametrize("resets", [1, 2, 3])
def test_after_refused_resets_some_environments_can_be_reset(resets: int) -> None:
    """After two, the client took the lane for reset, and waited without end for a batch of another epoch."""
    with sp.make("terran_5_vs_5", 3, seed=1, fields=FIELDS) as envs:
        for _ in range(resets):
            envs.async_reset(levels=np.full((3, 10, 5), -1, np.float32))
        with pytest.raises(sp.errors.InvalidRequest):
            envs.recv(timeout=10)
        assert envs.reset(env_id=[0], timeout=60).was_reset.all()
        assert len(envs.step(envs.sample_actions(), timeout=60)) == 3


def test_levels_have_the_shape_of_their_field() -> None:
    """As many numbers in another order were once mixed up silently."""
    with sp.make("2s3z", 3, fields=FIELDS) as envs, sp.make("2s3z", 3) as plain:
        levels = envs.reset(seed=1).level.copy()
        shape = r"levels must be a float32 array of shape \(3, 10, 5\), got "
        for wrong in (levels.transpose(1, 0, 2), levels.reshape(3, 50), levels[:2]):
            with pytest.raises(sp.errors.InvalidRequest, match=shape):
                envs.reset(levels=wrong)
        envs.reset(levels=levels[1:2], env_id=[1])
        mask = np.array([True, False, True])
        envs.reset(levels=levels[mask], env_id=mask)
        with pytest.raises(sp.errors.InvalidRequest, match="name the field `level`"):
            plain.reset(levels=levels)


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"teams": {"distribution": "fair"}}, "must be one of weighted_teams, all_teams, fixed"),
        ({"smacv2": {"prob_obs_enemy": 2}}, "`smacv2.prob_obs_enemy` is 2"),
        ({"smacv2": {"prob_obs": 0.5}}, "unknown key `smacv2.prob_obs`; expected one of use_unit_ranges"),
    ],
)
def test_what_is_wrong_with_a_distribution_or_an_option_is_said(options: Any, expected: str) -> None:
    with pytest.raises(sp.errors.ScenarioError, match=expected):
        sp.make("terran_5_vs_5", 1, **options)


def test_the_interface_is_that_of_agents() -> None:
    with pytest.raises(sp.errors.InvalidRequest, match="sides must be `allies`"):
        sp.make("terran_5_vs_5", 1, sides="both")
    with pytest.raises(sp.errors.InvalidRequest, match=r"smacv2 must be as in a scenario file \(JSON\)"):
        sp.make("terran_5_vs_5", 1, smacv2={"attack": object()})
    with pytest.raises(
        sp.errors.InvalidRequest,
        match=r"rewards must be as in a scenario file \(JSON\): `reward_win`: .*Out of range",
    ):
        sp.make("terran_5_vs_5", 1, rewards={"reward_win": float("nan")})


def test_a_replay_plays_generated_battles_again(tmp_path: Path) -> None:
    path = tmp_path / "drawn.smreplay"
    with sp.make("terran_5_vs_5", 2, seed=0, smacv2=HIDDEN) as envs, recorded(envs, path):
        envs.reset(seed=1)
        for _ in range(120):
            envs.step(envs.sample_actions())
    episodes = [line for line in replayed(path).splitlines() if line.startswith("episode ")]
    assert len(episodes) > 2


OPTIONS: list[dict[str, Any]] = [
    {},
    {"obs_last_actions": 2, "obs_agent_id": True},
    {"smacv2": {"health": {"lower_bound": 0.1, "upper_bound": 0.4}, "obs_own_pos": True}},
    {"smacv2": {"fully_observable": True, "obs_timestep_number": True, "state_timestep_number": True}},
]


@pytest.mark.parametrize("options", OPTIONS)
def test_observations_are_in_the_declared_spaces(options: dict[str, Any]) -> None:
    """The own x and y of agents that are pushed off the map were up to 1.047, and declared up to 1."""
    from smaclite_pool.integrations._spaces import batched_observation_space

    for name in sp.scenarios(generated=True if "smacv2" in options else None):
        with sp.make(name, 4, seed=5, **options) as envs:
            space: Any = batched_observation_space(envs)
            low, high = space["obs"].low, space["obs"].high
            batch = envs.reset(seed=5)
            for _ in range(60):
                assert np.all(batch.obs >= low) and np.all(batch.obs <= high), name
                assert np.all(batch.state >= space["state"].low), name
                assert np.all(batch.state <= space["state"].high), name
                batch = envs.step(envs.sample_actions())
