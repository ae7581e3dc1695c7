"""Actions that play both sides: fields, mirror, rewards, errors, replays and snapshots."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp

from conftest import Serve, program, recorded, replayed


def test_the_enemies_have_fields_of_their_own() -> None:
    with sp.make("MMM2", num_envs=3, sides="both", obs_agent_id=True, autoreset_mode="SameStep") as envs:
        assert (envs.spec.sides, envs.spec.opponents, envs.spec.n_actors) == (
            "both",
            {"learner": 1.0},
            10 + 12,
        )
        batch = envs.reset(seed=1)
        assert batch.enemy_obs.shape == (3, 12, envs.spec.enemy_obs_size)
        assert batch.enemy_state.shape == (3, envs.spec.enemy_state_size)
        assert batch.enemy_avail_actions.shape == (3, 12, envs.spec.n_enemy_actions)
        assert batch.enemy_alive.shape == (3, 12) and batch.enemy_alive.all()
        assert batch.enemy_reward.shape == (3,)
        assert {name for name in envs.spec.fields if "enemy" in name} >= {
            "final_enemy_obs",
            "final_enemy_state",
        }
        # The number of an enemy is the last part of its row.
        assert (batch.enemy_obs[:, :, -12:] == np.eye(12)).all()
        described = sp.status(envs.spec.pool)["lanes"][0]["description"]["enemies"]
        assert described and described["n_actions"] == envs.spec.n_enemy_actions
    with sp.make("MMM2", num_envs=1, fields=["enemy_obs", "obs"]) as envs:
        assert envs.spec.sides == "allies" and envs.spec.n_actors == 10 and envs.spec.n_enemy_actions == 0
        assert "enemy_obs" not in envs.spec.fields and envs.spec.enemy_obs_size == 0


def test_the_field_of_a_side_that_is_not_played_names_the_setting() -> None:
    """The advice was to add it to `fields`, which had been done."""
    with sp.make("3m", 2, fields=["obs", "enemy_obs"]) as envs:
        with pytest.raises(AttributeError, match='do not include `enemy_obs`; with sides="both", add it'):
            _ = envs.reset().enemy_obs


def test_a_second_side_that_no_learner_plays_is_an_error() -> None:
    """The settings of a team hold its opponent: with `sides="both"`, they made a second side that saw zeros
    and whose actions did nothing, and the team won 48 of 48 against a script that never moved."""
    team = sp.load_team("3m", seed=0)
    settings = team.settings | {"sides": "mirrored"}
    for opponent in (settings["opponent"], "kite", {"kite": 1, "attack_move": 2}):
        with pytest.raises(
            sp.errors.InvalidRequest, match=r"opponents must include `learner`, got `.*omit"
        ) as error:
            sp.make("3m", 8, **settings | {"opponent": opponent})
    assert '**team.settings | {"opponent": "learner"}' in str(error.value)
    with sp.make("3m", 8, **settings | {"opponent": "learner"}) as envs:
        assert envs.reset(seed=1).enemy_obs.any()
        result = sp.evaluate(envs, team, 16, seed=1, against="kite")
        mirrored = sp.evaluate(envs, "kite", 16, seed=1, against=team)
        assert len(result) == 16 and result.won.sum() > 4 and mirrored.lost.sum() > 4
    sp.make("3m", 1, sides="both", opponent={"learner": 1, "kite": 1}).close()


def test_serve_refuses_a_second_side_that_no_learner_plays() -> None:
    done = program("serve", "3m:1", "--name=never", "--sides=both", "--opponent=kite", check=False)
    assert done.returncode != 0 and "the opponents must include `learner`" in done.stderr


@pytest.mark.parametrize(
    ("opponent", "message"),
    [
        (["kite"], r"opponent must be a name, such as \"kite\" or \"zoo:3m\", or a dict .*, got list"),
        (
            "focusfire",
            r"unknown opponent `focusfire`; .* learner with sides `both` \(did you mean `focus_fire`\?\)",
        ),
        ("attack-move", r"\(did you mean `attack_move`\?\)"),
        ({"kite": "much"}, "the weight of opponent `kite` must be a number, got str"),
        ({3: 1.0}, "the keys of opponent must be names, got int"),
    ],
)
def test_a_wrong_opponent_says_what_is_accepted(opponent: Any, message: str) -> None:
    with pytest.raises((TypeError, sp.errors.InvalidRequest), match=message):
        sp.make("3m", 1, opponent=opponent)


def test_what_is_wrong_is_an_error_that_names_it() -> None:
    wrong: list[tuple[Any, str]] = [
        ({"sides": "enemies"}, "sides must be `allies`, `both` or `mirrored`, got `enemies`"),
        ({"opponent": "learner"}, "opponent `learner` needs sides `both`"),
    ]
    for options, expected in wrong:
        with pytest.raises(sp.errors.InvalidRequest, match=expected):
            sp.make("3m", num_envs=1, **options)
    with sp.make("3m", num_envs=2, sides="both") as envs:
        envs.reset()
        with pytest.raises(
            sp.errors.IllegalAction, match="environment 1, enemy 2: action 7 is not available"
        ) as error:
            envs.step([[1] * 6, [1] * 5 + [7]])
        assert (error.value.side, error.value.agent, error.value.env) == ("enemies", 2, 1)
        with pytest.raises(sp.errors.InvalidRequest, match=r"must be an integer array of shape \(2, 6\)"):
            envs.step([[1] * 3] * 2)
        with pytest.raises(sp.errors.InvalidRequest, match="side must be `allies` or `enemies`, got `foes`"):
            sp.ScriptedPolicy("hold", envs, side="foes")  # type: ignore[arg-type]
    with (
        sp.make("3m", num_envs=1) as envs,
        pytest.raises(sp.errors.InvalidRequest, match=r'side must be `allies` .*; make\(..., sides="both"\)'),
    ):
        sp.ScriptedPolicy("hold", envs, side="enemies")


def test_enemies_that_a_script_plays_have_no_last_actions() -> None:
    """Their state said that they did nothing, as the actions that nobody reads did."""
    fields = ["enemy_state", "avail_actions", "enemy_avail_actions", "snapshot"]
    opponent = {"learner": 1e-6, "kite": 1}
    with sp.make("3m", 1, seed=1, sides="both", opponent=opponent, fields=fields) as envs:
        envs.reset()
        columns = sp.snapshot_columns(envs.step([[1, 1, 1, 0, 0, 0]]).snapshot[0])
        assert columns["last_action"].tolist() == [1, 1, 1, -1, -1, -1]


def test_snapshots_are_the_same_whatever_enemies_see() -> None:
    """Restored where sides are not mirrored, enemies had walked north that had walked south."""
    options: dict[str, Any] = {"seed": 1, "obs_last_actions": 2}
    fields = ["enemy_obs", "enemy_state", "avail_actions", "enemy_avail_actions", "snapshot"]
    with (
        sp.make("3m", 1, sides="mirrored", fields=fields, **options) as mirrored,
        sp.make("3m", 1, sides="both", fields=fields, **options) as plain,
    ):
        mirrored.reset(), plain.reset()
        for ours, theirs in [
            ([1, 2, 2, 2, 4, 5], [1, 2, 2, 3, 5, 4]),
            ([1, 1, 1, 3, 2, 2], [1, 1, 1, 2, 3, 3]),
        ]:
            saved, played = mirrored.step([ours]), plain.step([theirs]).copy()
            assert np.array_equal(saved.snapshot, played["snapshot"])
        restored = plain.reset(snapshots=saved.snapshot)
        assert all(np.array_equal(restored[name], played[name]) for name in ("enemy_obs", "enemy_state"))


def test_snapshots_and_replays_have_both_sides(tmp_path: Path) -> None:
    file = tmp_path / "both.smreplay"
    fields = ["snapshot", "opponent", "avail_actions", "enemy_avail_actions", "enemy_obs"]
    options: Any = {"sides": "mirrored", "obs_last_actions": 2, "fields": fields}
    options["opponent"] = {"learner": 0.5, "kite": 0.5}
    with sp.make("3m", num_envs=2, **options) as envs, recorded(envs, file):
        envs.reset(seed=3)
        for _ in range(20):
            batch = envs.step(envs.sample_actions())
        saved, actions = batch.snapshot.copy(), envs.sample_actions()
        batch = envs.step(actions)
        expected = batch.enemy_obs.copy()
        envs.reset(snapshots=saved)
        assert (envs.step(actions).enemy_obs == expected).all()
        for _ in range(60):
            batch = envs.step(envs.sample_actions())
    replayed(file)


@pytest.mark.parametrize("served", [False, True])
def test_one_network_sees_the_same_from_both_sides(served: bool, serve: Serve) -> None:
    if served:
        serve("3m:4", "--name", "sides", "--sides", "mirrored", "--threads", "1")
    with sp.connect("sides", timeout=20) if served else sp.make("3m", 4, sides="mirrored") as envs:
        assert (envs.spec.sides, envs.spec.n_actors) == ("mirrored", 6)
        players = [sp.ScriptedPolicy("random", envs), sp.ScriptedPolicy("focus_fire", envs, side="enemies")]
        batch, lost = envs.reset(seed=1), 0
        np.testing.assert_allclose(batch.enemy_obs, batch.obs, atol=2e-3)  # in a mirror
        for _ in range(60):
            batch = envs.step(np.concatenate([player(batch) for player in players], axis=1))
            lost += int((batch.terminated & (batch.dead_allies == 3)).sum())
            assert not batch.battle_won.any()
    assert lost > 4
