"""`sp.evaluate`: which episodes it counts, and who has won them."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp
from numpy.typing import NDArray
from smaclite_pool._native import NO_OP, STOP

from conftest import changed_scenario, each_case


def first_episodes(policy: str, counts: list[int], seed: int) -> list[tuple[float, int, bool]]:
    """Returns, lengths and victories, played one environment after the other."""
    episodes = []
    for env, count in enumerate(counts):
        with sp.make("MMM", 1, autoreset_mode="Disabled") as envs:
            chosen = sp.ScriptedPolicy(policy, envs)  # type: ignore[arg-type]
            for number in range(count):
                batch = envs.reset(seed=seed + env) if number == 0 else envs.reset()
                while not (batch.terminated[0] or batch.truncated[0]):
                    batch = envs.step(chosen(batch))
                length, won = int(batch.episode_length[0]), bool(batch.battle_won[0])
                episodes.append((float(batch.episode_return[0]), length, won))
    return episodes


def test_an_evaluation_counts_the_first_episodes_of_every_environment() -> None:
    """The same episodes, however the environments are stepped: none is preferred for being short."""
    expected = first_episodes("nearest", [3, 3, 2, 2], seed=7)
    assert len({length for _, length, _ in expected}) > 1
    modes: list[dict[str, Any]] = [{}, {"autoreset_mode": "SameStep"}, {"batch_size": 1}, {"batch_size": 3}]
    for mode in modes:
        with sp.make("MMM", 4, **mode) as envs:
            result = sp.evaluate(envs, sp.ScriptedPolicy("nearest", envs), 10, seed=7)
        assert result.env_id.tolist() == [0, 0, 0, 1, 1, 1, 2, 2, 3, 3]
        episodes = zip(result.returns.tolist(), result.lengths.tolist(), result.won.tolist(), strict=True)
        assert list(episodes) == expected
        assert len(result) == 10 and result.win_rate == result.won.mean()
        assert result.mean_return == pytest.approx(result.returns.mean())
        assert result.mean_length == result.lengths.mean()


def test_who_has_won_if_the_last_units_die_together(tmp_path: Path) -> None:
    """With SMACv2's interface it was a defeat, and against a trained team of a lane a victory."""
    groups = [
        {"x": x, "y": 16, "faction": faction, "units": {"BANELING": 1}}
        for x, faction in [(15, "ALLY"), (17, "ENEMY")]
    ]
    sizes = {"num_allied_units": 1, "num_enemy_units": 1}
    path = changed_scenario(tmp_path, "3m", groups=groups, attack_point=[15, 16], **sizes)

    def rates(against: Any = None, **options: Any) -> tuple[float, float, float]:
        with sp.make(path, 2, seed=1, **options) as envs:
            result = sp.evaluate(envs, "nearest", 4, seed=1, against=against)
            return result.win_rate, result.draw_rate, result.loss_rate

    assert rates() == (1, 0, 0)
    assert rates(smacv2={}) == (0, 1, 0)
    assert rates(sides="both", against="nearest") == (0, 1, 0)
    assert rates(opponent="zoo:all-maps") == (0, 1, 0)
    # Where a team takes turns with a script, the script's episodes were draws, too.
    needed = ["obs", "state", "avail_actions", "alive", "battle_won", "dead_allies", "dead_enemies"]
    fields = [*needed, "episode_return", "episode_length", "opponent"]
    turns: dict[str, Any] = {"opponent": {"zoo:all-maps": 1, "attack_move": 1}}
    for mode in ("NextStep", "SameStep"):
        won, drawn, lost = rates(**turns, fields=fields, autoreset_mode=mode)
        assert won > 0 and drawn > 0 and lost == 0
    with pytest.raises(AttributeError, match="opponent"):
        rates(**turns)


def test_errors_of_an_evaluation() -> None:
    with sp.make("3m", 2, autoreset_mode="Disabled") as envs:
        policy = sp.ScriptedPolicy("nearest", envs)
        with pytest.raises(sp.errors.InvalidRequest, match="episodes must be at least 1, got 0"):
            sp.evaluate(envs, policy, 0)
        with pytest.raises(sp.errors.InvalidRequest, match='needs autoreset_mode="NextStep" or "SameStep"'):
            sp.evaluate(envs, policy, 1)
    # A list was taken with a function, and refused with the name of a script.
    wrong: Any = [1, 2]
    with sp.make("3m", 2) as envs, pytest.raises(TypeError, match="seed must be an integer, got list"):
        sp.evaluate(envs, lambda batch: batch.avail_actions.argmax(-1), 1, seed=wrong)
    with sp.make("3m", 2) as envs, pytest.raises(sp.errors.IllegalAction, match="agent 0: action 0"):
        sp.evaluate(envs, lambda batch: np.full((len(batch), 3), NO_OP), 1)


def stop_or_no_op(batch: Any) -> Any:
    return np.where(batch.avail_actions[..., STOP], STOP, NO_OP)


@pytest.mark.parametrize("published", [False, True])
def test_nobody_loses_at_the_limit(published: bool) -> None:
    """SMACv2's published code terminates episodes at their limit, which counted as defeats."""
    with sp.make("protoss_5_vs_5", 8, episode_limit=5, smacv2={"published": published}) as envs:
        result = sp.evaluate(envs, stop_or_no_op, 16, seed=1)
        assert (result.win_rate, result.loss_rate, result.draw_rate) == (0, 0, 1)
    with sp.make("protoss_5_vs_5", 8, smacv2={"published": published}) as envs:
        assert sp.evaluate(envs, stop_or_no_op, 16, seed=1).loss_rate == 1


def test_the_agents_lose_with_the_last_enemies_where_units_can_be_healers() -> None:
    """Such episodes counted as draws, and their rewards were those of a defeat."""
    banelings = {"distribution": "fixed", "teams": [["BANELING", "BANELING"], ["BANELING", "MEDIVAC"]]}
    starts = {"distribution": "uniform", "allies": [15, 15, 16, 16], "enemies": [17, 15, 18, 16]}
    keys: dict[str, Any] = {
        "num_allied_units": 2,
        "num_enemy_units": 2,
        "teams": banelings,
        "start_positions": starts,
        "num_unit_types": 2,
        "unit_type_ids": {"BANELING": 0, "MEDIVAC": 1},
    }
    ended: set[tuple[bool, float]] = set()

    def attack(batch: Any) -> Any:
        for slot in np.flatnonzero(batch.terminated & (batch.dead_allies == 2) & (batch.dead_enemies == 2)):
            ended.add((bool(batch.battle_won[slot]), round(float(batch.reward[slot]), 2)))
        mask = batch.avail_actions
        return mask.shape[-1] - 1 - mask[..., ::-1].argmax(-1)

    with sp.make("terran_5_vs_5", 8, smacv2={}, rewards={"reward_sparse": True}, **keys) as envs:
        result = sp.evaluate(envs, attack, 80, seed=1)
    assert ended and all(not won and reward < 0 for won, reward in ended)
    assert result.draw_rate == 0


def test_two_policies_are_evaluated_against_each_other() -> None:
    """What shoots beats what does not from either side, and two that do not shoot draw."""
    with sp.make("3s_vs_4z", 8, sides="both", episode_limit=150) as envs:

        def idle(batch: sp.Batch) -> NDArray[np.int64]:
            """Stop, or no-op of the dead."""
            return np.where(batch.avail_actions[..., STOP], STOP, NO_OP)

        drawn = sp.evaluate(envs, idle, 8, seed=1, against=idle)
        assert (drawn.draw_rate, drawn.win_rate, drawn.loss_rate) == (1, 0, 0)
        lost = sp.evaluate(envs, idle, 8, seed=1, against="nearest")
        assert lost.loss_rate == 1 and lost.lost.all() and not lost.won.any()
        won = sp.evaluate(envs, "nearest", 8, seed=1, against=idle)
        assert won.win_rate == 1 and won.draw_rate == 0
        scripts = sp.ScriptedPolicy("nearest", envs, side="enemies")
        same = sp.evaluate(envs, idle, 8, seed=1, against=scripts)
        assert np.array_equal(same.returns, lost.returns)
        joint = sp.evaluate(envs, lambda b: np.concatenate([idle(b), scripts(b)], axis=1), 8, seed=1)
        assert np.array_equal(joint.returns, lost.returns)


def test_mistakes_in_a_call_of_evaluate_say_what_is_meant() -> None:
    evaluate: Any = sp.evaluate
    with sp.make("3m", 2) as envs, sp.make("3m", 2, sides="both") as both:
        policy = sp.ScriptedPolicy("nearest", envs)
        assert len(evaluate(envs, "nearest", 2, seed=1)) == 2
        of_enemies, allies = sp.load_team("3m", side="enemies"), sp.ScriptedPolicy("nearest", both)
        cases: dict[type[Exception], list[tuple[str, Any]]] = {
            TypeError: [
                (r"the environments come first: evaluate\(envs, policy", lambda: evaluate(policy, envs, 2)),
                ("'n_episodes'; did you mean 'episodes'?", lambda: evaluate(envs, policy, n_episodes=2)),
                ("policy must be a function from a batch .* got int", lambda: evaluate(envs, 3, 2)),
            ],
            sp.errors.InvalidRequest: [
                ("unknown policy `neares`; .*did you mean `nearest`", lambda: evaluate(envs, "neares", 2)),
                (
                    r"against needs environments .* make\(..., sides=\"both\"\)",
                    lambda: evaluate(envs, policy, 2, against=policy),
                ),
                (
                    r'against must be a ScriptedPolicy\(..., side="enemies"\)',
                    lambda: evaluate(both, policy, 2, against=allies),
                ),
                ('policy must be a team .* side="enemies"', lambda: evaluate(envs, of_enemies, 2)),
                (
                    r'side must be `allies` .* make\(..., sides="both"\)',
                    lambda: sp.ScriptedPolicy("kite", envs, side="enemies"),
                ),
            ],
        }
        for error, match, call in each_case(cases):
            with pytest.raises(error, match=match):
                call()
        for alone in (policy, "nearest", lambda batch: np.ones((2, 3), int)):
            with pytest.raises(sp.errors.InvalidRequest, match=r"pass the policy of the enemies as against="):
                evaluate(both, alone, 2)
    assert list(inspect.signature(evaluate).parameters) == ["envs", "policy", "episodes", "seed", "against"]
