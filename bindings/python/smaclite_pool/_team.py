"""Teams of `smaclite-pool train` in Python: load one, and let it play. `_training` trains them."""

from __future__ import annotations

import copy
import secrets
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from ._native import ZOO, TeamNetwork, read_team
from ._requirements import require_integer
from .errors import InvalidRequest

if TYPE_CHECKING:
    from . import Batch

Array = NDArray[np.float32]


class Team:
    """A trained team: a policy for `evaluate` and for loops of your own.

        import smaclite_pool as sp

        team = sp.load_team("runs/3m")
        with sp.make("3m", num_envs=64, **team.settings) as envs:
            print(sp.evaluate(envs, team, episodes=200, seed=1).win_rate)

    Called with a batch, it returns actions of its side, int32 [M, n_agents]: drawn by their probabilities
    from a generator of its own, or the most probable ones with `greedy`. The batch must have `obs` and
    `avail_actions`, or with `side="enemies"` `enemy_obs` and `enemy_avail_actions`. Its network is that of
    `smaclite-pool evaluate`. It can be pickled and copied; a copy draws on from the same state of the
    generator.
    """

    def __init__(
        self,
        folder: str | PathLike[str],
        *,
        weights: Literal["best", "last"] | None = None,
        greedy: bool = False,
        seed: int | None = None,
        side: Literal["allies", "enemies"] = "allies",
        map: str | None = None,
    ) -> None:
        self.folder = fspath(folder)
        self.weights = weights
        self.greedy = greedy
        self.side = side
        if weights not in (None, "best", "last"):
            raise InvalidRequest(f'weights must be None, "best" or "last", got {weights!r}')
        if side not in ("allies", "enemies"):
            raise InvalidRequest(f'side must be "allies" or "enemies", got {side!r}')
        self.seed = secrets.randbits(53) if seed is None else require_integer("seed", seed, 0)
        """Of the generator that draws actions."""
        # Another one per side: two teams with one seed would have the same noise, and so play alike.
        self._random = np.random.default_rng(self.seed if side == "allies" else [self.seed, 1])
        run = read_team(self.folder, weights, map, enemies=side == "enemies")
        self.name: str = run["name"]
        """The name of the scenario that it plays: that of its training, or `map`."""
        self.scenario: str | None = run["scenario"]
        """The same, for `make`, if it is a standard scenario as it is; None if it plays a file, or a scenario
        with changed keys: then `make` must be given the same."""
        self.config: dict[str, Any] = run["config"]
        """The hyperparameters."""
        self.settings: dict[str, Any] = {
            "rules": run["rules"],
            "episode_limit": {"scenario": "default"}.get(run["episode_limit"], run["episode_limit"]),
            "obs_last_actions": self.config["last_actions"],
        }
        """Arguments of `make` for environments as those of the training; with `side="enemies"`, for
        environments of two learners, in which the enemies see the map as the team did in its training."""
        if side == "enemies":
            self.settings |= {"sides": "mirrored"}
        else:
            self.settings["opponent"] = run["opponent"]
        self._network: TeamNetwork = run["network"]
        self._obs_shape: tuple[int, int] = tuple(run["obs_shape"])

    def __copy__(self) -> Team:
        copied = type(self).__new__(type(self))
        vars(copied).update(vars(self), _random=copy.deepcopy(self._random))
        return copied

    def __repr__(self) -> str:
        side = ", plays the enemies" if self.side == "enemies" else ""
        return f"<Team {self.folder!r}, {'greedy' if self.greedy else 'sampled'} actions{side}>"

    def logits(self, obs: Array) -> Array:
        """The network's outputs, float32 [M, n_agents, n_actions], for float32 [M, n_agents, obs_size]."""
        expected = self._obs_shape
        if obs.shape[1:] != expected:
            advice = "make environments of its scenario with `**team.settings`"
            if self.side == "enemies" and obs.shape[1:2] != expected[:1]:
                advice = "a team plays the enemies of a scenario whose two sides have equal sizes"
            raise InvalidRequest(
                f"the team of {self.name} has observations [M, {expected[0]}, {expected[1]}], got "
                f"{list(obs.shape)}: {advice}"
            )
        return self._network.logits(np.ascontiguousarray(obs, np.float32))

    def __call__(self, batch: Batch) -> NDArray[np.int32]:
        if self.side == "enemies":
            obs, available = batch.enemy_obs, batch.enemy_avail_actions
        else:
            obs, available = batch.obs, batch.avail_actions
        outputs = np.where(available, self.logits(obs), -np.inf)
        if not self.greedy:
            # The largest of outputs with Gumbel noise is drawn by the softmax.
            outputs = outputs + self._random.gumbel(size=outputs.shape)
        actions: NDArray[np.int32] = outputs.argmax(-1).astype(np.int32)
        return actions


def load_team(
    team: str | PathLike[str],
    *,
    weights: Literal["best", "last"] | None = None,
    greedy: bool = False,
    seed: int | None = None,
    side: Literal["allies", "enemies"] = "allies",
    map: str | None = None,
) -> Team:
    """A trained team: one that is part of the package, or that of a run.

        import smaclite_pool as sp

        team = sp.load_team("2s3z")
        with sp.make("2s3z", num_envs=64, **team.settings) as envs:
            print(sp.evaluate(envs, team, episodes=200, seed=1).win_rate)

    A team also plays the enemies of a scenario whose two sides have equal sizes:

        import numpy as np
        import smaclite_pool as sp

        team, rival = sp.load_team("3m"), sp.load_team("3m", side="enemies", seed=1)
        with sp.make("3m", num_envs=64, **rival.settings) as envs:
            batch = envs.reset(seed=1)
            batch = envs.step(np.concatenate([team(batch), rival(batch)], axis=1))

    Args:
        team: the name of a scenario in `ZOO`, `"all-maps"` with `map`, or a folder, as `--out` of
            `smaclite-pool train` or `out` of `train`. If there is a folder of that name, it is taken;
            `"zoo:2s3z"` is always that of the package.
        weights: those of the best evaluation of the run (`"best"`) or its last ones (`"last"`). None for the
            best ones if the run was evaluated and did not play itself, else the last.
        greedy: take the most probable actions, instead of drawing them.
        seed: of the generator that draws them, at least 0; None for a random one, which `Team.seed` has.
            Teams of the two sides draw independently, also with equal seeds.
        side: which units it plays: `"allies"`, or `"enemies"`, from `enemy_obs` and `enemy_avail_actions`.
        map: the scenario that it plays instead of that of its training, a name or a file. Its networks must
            be `universal` (`train --network universal` or `--maps`). It knows the unit types by their figures
            under the rules of its training, which `settings` has: make the environments with these.

    Raises InvalidRequest if there is no such team, its files are damaged, it does not play that map, or the
    seed is negative.
    """
    name = fspath(team)
    if "/" in name or name.startswith("zoo:") or Path(name).exists():
        return Team(name, weights=weights, greedy=greedy, seed=seed, side=side, map=map)
    if name not in ZOO:
        raise InvalidRequest(
            f"there is no folder `{name}`, and the zoo has no team `{name}`; it has {', '.join(ZOO)}"
        )
    return Team(f"zoo:{name}", weights=weights, greedy=greedy, seed=seed, side=side, map=map)
