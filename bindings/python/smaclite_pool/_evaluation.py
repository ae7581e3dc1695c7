"""Evaluation of a policy: a given number of episodes, without favour for short ones."""

from __future__ import annotations

import secrets
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._layout import limit_ends, loses_draws, unwrapped
from ._native import OPPONENTS, Batch, Envs, ScriptedPolicy, scenario
from ._requirements import require_environments, require_integer, suggests_keywords
from ._team import Team
from ._wrapper import Wrapper
from .errors import InvalidRequest

Policy = Callable[[Any], ArrayLike]

_LEARNER = OPPONENTS.index("learner")


@dataclass(frozen=True)
class Evaluation:
    """The episodes that `evaluate` counted, ordered by environment and, within each, by time."""

    env_id: NDArray[np.int32]
    """int32 [episodes]: the environment of each episode."""
    returns: NDArray[np.float32]
    """float32 [episodes]: the sum of rewards of each."""
    lengths: NDArray[np.int32]
    """int32 [episodes]: the number of steps of each."""
    won: NDArray[np.bool_]
    """bool [episodes]: whether the agents won it."""
    lost: NDArray[np.bool_]
    """bool [episodes]: whether the enemies won it. What neither side won is a draw."""

    def __len__(self) -> int:
        return len(self.returns)

    @property
    def win_rate(self) -> float:
        """The share of episodes that the agents won, 0 to 1."""
        return float(self.won.mean())

    @property
    def loss_rate(self) -> float:
        """The share of episodes that the enemies won, 0 to 1."""
        return float(self.lost.mean())

    @property
    def draw_rate(self) -> float:
        """The share of episodes that neither side won, such as those that reached the limit of steps."""
        return float(1 - (self.won | self.lost).mean())

    @property
    def mean_return(self) -> float:
        """The mean of `returns`."""
        return float(self.returns.mean(dtype=np.float64))

    @property
    def mean_length(self) -> float:
        """The mean of `lengths`."""
        return float(self.lengths.mean())


@suggests_keywords
def evaluate(
    envs: Envs | Wrapper,
    policy: Policy | str,
    episodes: int,
    seed: int | None = None,
    *,
    against: Policy | str | None = None,
) -> Evaluation:
    """Play a policy and return the episodes.

    Of every environment the first episodes count, the same number in each (to within one). To count the first
    episodes that end anywhere would favour short ones.

        result = smaclite_pool.evaluate(envs, policy, episodes=200, seed=1)
        print(result.win_rate, result.mean_return)

    Args:
        envs: the environments, or a wrapper of them, with the fields `battle_won`, `dead_allies`,
            `dead_enemies`, `episode_return` and `episode_length`, and with autoreset. All of them are reset
            first; afterwards they are somewhere in an episode.
        policy: a function from a batch to its actions, integers [M, n_agents], such as a team; or the name of
            a scripted policy. Whether it draws actions or takes the most probable ones is its own matter.
        episodes: how many episodes count, at least 1.
        seed: as for `Envs.reset`: environment i is seeded with seed + i. A `policy` that is given by name
            draws by it too, and such an `against` by another seed that follows from it. With None they draw
            by new random seeds in every call.
        against: who plays the enemies, as `policy`, in environments that `sides="both"` made. The function
            gets batches as the enemies see them: `obs`, `state`, `avail_actions`, `alive` and `reward` are
            those of `enemy_obs` and so on. With `sides="mirrored"` a team can play either side.

    Where a policy or a trained team plays the enemies (`against`, `make(opponent="zoo:3m")`), an episode
    whose last units die in the same step is a draw; else the agents have won it, as in SMAClite, or nobody,
    with SMACv2's interface. Where units can be healers in that interface, the agents have lost it in either
    case. Where a team takes turns with scripts, the lane must have the field `opponent`, which tells whose
    episode it was.

    Raises:
        InvalidRequest: `episodes` is below 1, the environments have no autoreset or no episode limit, or
            their actions do not play the sides of these policies.
        TypeError: an argument has the wrong type.
        AttributeError: the lane omits a field.
        IllegalAction: the policy chose an action that is not available.
    """
    _check(envs, policy, episodes)
    seed = None if seed is None else require_integer("seed", seed, 0)
    spec = envs.spec
    player = _player(envs, policy, against, seed)
    quota = np.full(spec.num_envs, episodes // spec.num_envs)
    quota[: episodes % spec.num_envs] += 1
    counts = np.zeros(spec.num_envs, np.int64)
    counted: list[tuple[int, int, float, int, bool, bool]] = []
    teams_meet = against is not None or spec.opponent_team is not None
    takes_turns = teams_meet and len(spec.opponents) > 1  # with scripts, by episode
    counts_draws, at_limit = loses_draws(scenario(unwrapped(envs))), limit_ends(envs)
    batch = envs.reset(seed=seed)
    while True:
        decided = batch.terminated & ~at_limit(batch)
        against_team = batch.opponent == _LEARNER if takes_turns else np.full(len(batch.env_id), teams_meet)
        for slot in np.flatnonzero(batch.terminated | batch.truncated):
            env = int(batch.env_id[slot])
            if counts[env] < quota[env]:
                dead = (batch.dead_allies[slot], batch.dead_enemies[slot])
                is_draw = dead == (spec.n_agents, spec.n_enemies)
                won = bool(batch.battle_won[slot]) and not (is_draw and against_team[slot])
                lost = not won and bool(decided[slot]) and (counts_draws or not is_draw)
                result = (batch.episode_return[slot], batch.episode_length[slot], won, lost)
                counted.append((env, int(counts[env]), *result))
            counts[env] += 1
        if len(counted) == episodes:
            break
        batch = envs.step(player(batch), batch.env_id)
    env_id, _, returns, lengths, wins, losses = zip(*sorted(counted), strict=True)
    return Evaluation(
        np.array(env_id, np.int32),
        np.array(returns, np.float32),
        np.array(lengths, np.int32),
        np.array(wins, np.bool_),
        np.array(losses, np.bool_),
    )


def _check(envs: Any, policy: Any, episodes: int) -> None:
    if isinstance(policy, (Envs, Wrapper)):
        raise TypeError(f"the environments come first: evaluate(envs, policy, episodes), got {envs!r}")
    require_environments(envs)
    require_integer("episodes", episodes, 1)
    if envs.spec.autoreset_mode == "Disabled":
        raise InvalidRequest('evaluate needs autoreset_mode="NextStep" or "SameStep", got "Disabled"')
    if envs.spec.episode_limit is None:
        raise InvalidRequest("evaluate needs an episode limit, or it may never end: make(episode_limit=...)")


def _player(envs: Envs | Wrapper, policy: Any, against: Any, seed: int | None) -> Policy:
    """A function from a batch to joint actions."""
    plays_both = envs.spec.sides != "allies"
    if against is None:
        agents = _as_policy(envs, "policy", policy, "allies", seed)
        return _for_both_sides(envs, agents) if plays_both else agents
    if not plays_both or set(envs.spec.opponents) != {"learner"}:
        raise InvalidRequest(
            "against needs environments whose actions play both sides in all episodes: "
            'make(..., sides="both")'
        )
    agents = _as_policy(envs, "policy", policy, "allies", seed)
    enemies = _as_policy(envs, "against", against, "enemies", seed)

    def both(batch: Batch) -> ArrayLike:
        is_script = isinstance(enemies, ScriptedPolicy)  # it reads `enemy_state` by that name
        theirs = enemies(batch if is_script else _as_enemies_see_it(batch))
        return np.concatenate([np.asarray(agents(batch)), np.asarray(theirs)], axis=1)

    return both


def _as_policy(
    envs: Envs | Wrapper, name: str, policy: Any, side: Literal["allies", "enemies"], seed: int | None
) -> Policy:
    if isinstance(policy, str):
        script: Any = policy
        return ScriptedPolicy(script, envs, seed=_script_seed(seed, side), side=side)
    if not callable(policy):
        raise TypeError(
            f"{name} must be a function from a batch to its actions, or the name of a scripted policy, got "
            f"{type(policy).__name__}"
        )
    if isinstance(policy, ScriptedPolicy) and policy.side != side:
        raise InvalidRequest(
            f'{name} must be a ScriptedPolicy(..., side="{side}"), got one with side="{policy.side}"'
        )
    from ._agent_view import PerAgent  # which imports this module

    if isinstance(policy, PerAgent) and side == "enemies":
        policy.views._check_equal_sides(f"{name} is a PerAgent, which sees the enemies as agents, so")
    # A team of the agents may play the enemies: it sees them as agents.
    if isinstance(policy, Team) and side == "allies" and policy.side != side:
        raise InvalidRequest(f'{name} must be a team of the agents, got one with side="{policy.side}"')
    result: Policy = policy
    return result


def _script_seed(seed: int | None, side: Literal["allies", "enemies"]) -> int:
    """Another one for each side: with equal ones, two `random` scripts would draw the same actions."""
    if seed is None:
        return secrets.randbits(64)
    if side == "allies":
        return seed
    return int(np.random.SeedSequence([seed, 1]).generate_state(1, np.uint64)[0])


def _for_both_sides(envs: Envs | Wrapper, policy: Policy) -> Policy:
    """A policy of all units, which may not be one of the agents alone."""

    spec = envs.spec

    def checked(batch: Batch) -> ArrayLike:
        actions = policy(batch)
        if np.shape(actions)[1:] == (spec.n_agents,) != (spec.n_actors,):
            raise InvalidRequest(
                "the actions of these environments play both sides, and policy chose those of the agents "
                f"alone: pass the policy of the enemies as against=, or make it return [M, {spec.n_actors}]"
            )
        return actions

    return checked


def _as_enemies_see_it(batch: Batch) -> Batch:
    """With their fields by the names of the agents'."""
    theirs = {name.removeprefix("enemy_"): name for name in batch.keys() if name.startswith("enemy_")}
    return batch.replace(**{name: batch[field] for name, field in theirs.items()})
