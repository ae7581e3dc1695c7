"""SMAC's interface: code that was written for `smac.env.StarCraft2Env` plays here unchanged.

    from smaclite_pool.smac import MultiAgentEnv

    env = MultiAgentEnv(map_name="2s3z", seed=1)
    obs, state = env.reset()
    terminated = False
    while not terminated:
        actions = [row.index(1) for row in env.get_avail_actions()]   # the first legal action of each agent
        reward, terminated, info = env.step(actions)
    print(info["battle_won"], env.get_stats())
    env.close()

Code that imports SMAC itself stays as it is when it is run by

    python -m smaclite_pool.smac src/main.py --config=qmix --env-config=sc2 with env_args.map_name=MMM2

or needs one line before its first import of SMAC: `import smaclite_pool.smac; smaclite_pool.smac.install()`. EPyMARL
imports `smaclite` too, whatever it runs; the stand-in for that one goes in front:

    PYTHONPATH=$(python -m smaclite_pool.drop_in) python -m smaclite_pool.smac src/main.py --config=qmix \\
        --env-config=sc2 with env_args.map_name=MMM2

One environment is a pool of its own; arrays that come from it are the caller's. For many at once use a batch:
`smaclite_pool.make`, or `smaclite_pool.epymarl` for EPyMARL and PyMARL.
"""

from __future__ import annotations

import logging
import os
import secrets
import sys
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from types import ModuleType
from typing import Any, Literal, SupportsInt, cast

import numpy as np
from numpy.typing import NDArray

from ._draw import Window, draw
from ._layout import Bools, Floats
from ._native import Batch, make, scenario
from ._smac_queries import Queries
from ._smac_replay import Recording
from ._smac_reward import Reward, RewardOptions, Toll, Unavailable
from ._smac_units import Heuristic, Unit
from ._smac_views import ViewOptions, Views
from .errors import InvalidRequest

__all__ = ["MultiAgentEnv", "StarCraft2Env", "Unavailable", "Unit", "get_map_params", "install"]

_log = logging.getLogger(__name__)

_FOLDER = Path(__file__).parent / "_stand_in"  # put first in PYTHONPATH, it makes `import smac` get this module

# Options of SMAC that speak of StarCraft II: the values that change nothing, and why others cannot be meant.
_FIXED: dict[str, tuple[tuple[object, ...], str]] = {
    "step_mul": ((8, None), "a step is 8 ticks by the rules of the game"),
    "move_amount": ((2,), "a move order is 2 squares long by the rules of the game"),
    "difficulty": (("7",), "the enemies follow the rules of the game; only StarCraft II's own player has difficulties"),
    "game_version": (
        (None, "latest"),
        "there is no StarCraft II here; `rules` chooses between the rules that there are",
    ),
}


class MultiAgentEnv(Queries):
    """One battle by SMAC's interface; every option of SMAC by its name and default.

    Args:
        map_name: a standard scenario (see `smaclite_pool.scenarios()`) or the path of a scenario file.
        step_mul, move_amount, difficulty, game_version: only at their defaults; the error says why.
        seed: plays, for the same actions, the very episodes of the published environment of that seed; None draws one.
        continuing_episode: mark an episode that ran out of time by `info["episode_limit"]`.
        obs_all_health, obs_own_health: health and shields in observations (one's own are there if either is set).
        obs_last_action: the last actions of the allies in sight.
        obs_pathing_grid: whether 8 squares around are walkable (or off the map).
        obs_terrain_height: the heights of 9 squares around: 0, as all maps are flat, and 1 off the map.
        obs_timestep_number, state_timestep_number: steps so far, divided by the episode limit.
        obs_instead_of_state: the state is all observations, one after the other.
        state_last_action: the last actions in the state.
        reward_sparse: 1 for a victory, -1 for a defeat, 0 otherwise. `reward_scale` scales it too, as in SMAC.
        reward_only_positive: if False, losses of allies are subtracted: health and shields lost in the step (less what
            was regained in it) and `reward_death_value` for each death, times `reward_negative_scale`.
        reward_death_value, reward_win, reward_defeat: points for a kill, a victory, a defeat.
        reward_scale, reward_scale_rate: divide by (the most an episode can earn / rate).
        replay_dir, replay_prefix: where `save_replay` writes, and how the file's name begins (default: the map's).
        window_size_x, window_size_y: size of the window of `render()`, in pixels.
        heuristic_ai: play SMAC's non-learning player in place of the actions of `step`, into which its own are written.
            Needs `heuristic_rest`: orders at targets out of reach are not legal here.
        debug: log actions and rewards, at level DEBUG.
        rules, episode_limit: as in `smaclite_pool.make`; not in SMAC.

    Raises Unavailable for what cannot be meant here, ScenarioError for a wrong scenario, InvalidRequest for a value
    that cannot be. Rewards beyond the defaults are computed from the pool's reward and the state (see `_smac_reward`).

    An ally is a unit of the agents, by agent; unit types are places in the type one-hot, as `scenario()` tells them.
    """

    def __init__(
        self,
        map_name: str | PathLike[str] = "8m",
        step_mul: int | None = 8,
        move_amount: float = 2,
        difficulty: str = "7",
        game_version: str | None = None,
        seed: int | None = None,
        continuing_episode: bool = False,
        obs_all_health: bool = True,
        obs_own_health: bool = True,
        obs_last_action: bool = False,
        obs_pathing_grid: bool = False,
        obs_terrain_height: bool = False,
        obs_instead_of_state: bool = False,
        obs_timestep_number: bool = False,
        state_last_action: bool = True,
        state_timestep_number: bool = False,
        reward_sparse: bool = False,
        reward_only_positive: bool = True,
        reward_death_value: float = 10,
        reward_win: float = 200,
        reward_defeat: float = 0,
        reward_negative_scale: float = 0.5,
        reward_scale: bool = True,
        reward_scale_rate: float = 20,
        replay_dir: str | None = "",
        replay_prefix: str | None = "",
        window_size_x: int = 1920,
        window_size_y: int = 1200,
        heuristic_ai: bool = False,
        heuristic_rest: bool = False,
        debug: bool = False,
        *,
        rules: Literal["smaclite", "paper"] = "smaclite",
        episode_limit: int | Literal["default"] | None = "default",
    ) -> None:
        _only_default(step_mul=step_mul, move_amount=move_amount, difficulty=difficulty, game_version=game_version)
        if heuristic_ai and not heuristic_rest:
            raise Unavailable(
                "heuristic_ai=True gives orders at targets out of reach, which are not legal actions here; "
                "heuristic_rest=True keeps to legal ones"
            )
        self.map_name = str(map_name)
        self._views = Views(
            map_name,
            ViewOptions(
                all_health=obs_all_health,
                own_health=obs_own_health or obs_all_health,
                last_action=obs_last_action,
                pathing_grid=obs_pathing_grid,
                terrain_height=obs_terrain_height,
                timestep_number=obs_timestep_number,
                instead_of_state=obs_instead_of_state,
                state_last_action=state_last_action,
                state_timestep_number=state_timestep_number,
            ),
        )
        options = RewardOptions(
            sparse=reward_sparse,
            only_positive=reward_only_positive,
            death_value=reward_death_value,
            win=reward_win,
            defeat=reward_defeat,
            negative_scale=reward_negative_scale,
            scale=reward_scale,
            scale_rate=reward_scale_rate,
        )
        self._reward = Reward(self._views.layout, options)
        self.max_reward = self._reward.max_reward
        self.continuing_episode = continuing_episode
        self.heuristic_ai, self.heuristic_rest, self.debug = heuristic_ai, heuristic_rest, debug
        self._heuristic = Heuristic(self._views.layout)
        self.replay_dir, self.replay_prefix = replay_dir or "", replay_prefix or ""
        self.window_size = (window_size_x, window_size_y)
        self._seed = secrets.randbits(32) if seed is None else int(seed)
        self._next_seed: int | None = None
        self._envs = make(
            map_name,
            1,
            seed=self._seed,
            threads=1,
            wait="block",  # many battles a machine, each with a learner: who spins takes time from the others
            autoreset="disabled",
            episode_limit=episode_limit,
            rules=rules,
            max_held_batches=2,
        )
        self.n_agents, self.n_enemies, self.n_actions = self._envs.n_agents, self._envs.n_enemies, self._envs.n_actions
        self.episode_limit = self._envs.episode_limit
        self._views.count_steps_to(self.episode_limit)
        self.battles_won = self.battles_game = self.timeouts = self.force_restarts = 0
        self._avail: Bools = np.zeros((self.n_agents, self.n_actions), np.bool_)
        nothing = np.zeros((self.n_agents, self._envs.obs_size), np.float32)
        self._views.see(nothing, np.zeros(self._envs.state_size, np.float32), 0)  # until the first reset
        self._recording = Recording(self.map_name, rules)
        self._window: Window | None = None

    def reset(self) -> tuple[list[Floats], Floats]:
        """Begin a new episode; returns `get_obs()` and `get_state()`. The generator goes on, unless `seed` set it."""
        batch = self._envs.reset(seed=self._next_seed)
        self._next_seed = None
        self._heuristic.forget()
        self._see(batch)
        self._recording.begin(self._seed, batch)
        return self.get_obs(), self.get_state()

    def step(self, actions: Sequence[SupportsInt] | NDArray[Any]) -> tuple[float, bool, dict[str, Any]]:
        """Play one action for each agent; returns reward, whether the episode ended, and `info`.

        `info`: `battle_won`, `dead_allies`, `dead_enemies`, and `episode_limit` (True) if the episode ran out of time
        and `continuing_episode` is set. Raises IllegalAction, and nothing is stepped.
        """
        chosen = self._chosen(actions)
        before = self._toll()
        batch = self._envs.step([chosen])
        self._see(batch)
        self._recording.add(chosen, batch)
        terminated, truncated = bool(batch.terminated[0]), bool(batch.truncated[0])
        won = bool(batch.battle_won[0])
        info: dict[str, Any] = {
            "battle_won": won,
            "dead_allies": int(batch.dead_allies[0]),
            "dead_enemies": int(batch.dead_enemies[0]),
        }
        self.battles_game += terminated or truncated
        self.battles_won += won
        self.timeouts += truncated
        if truncated and self.continuing_episode:
            info["episode_limit"] = True
        reward = self._reward(float(batch.reward[0]), terminated, won, before, self._toll())
        if self.debug:
            _log.debug("actions %s, reward %s, info %s", chosen, reward, info)
        return reward, terminated or truncated, info

    def _chosen(self, actions: Sequence[SupportsInt] | NDArray[Any]) -> list[int]:
        if self.heuristic_ai:
            chosen = self._heuristic.actions(self._views.field, self._avail)
            if hasattr(actions, "__setitem__"):
                for agent, action in enumerate(chosen):
                    cast(Any, actions)[agent] = action  # as SMAC does, so that what is learnt from is what was done
            return chosen
        chosen = [int(action) for action in actions]
        if any(whole != given for whole, given in zip(chosen, actions, strict=True)):
            raise InvalidRequest(f"actions are whole numbers, one an agent; given were {list(actions)}")
        return chosen

    def _see(self, batch: Batch) -> None:
        self._views.see(batch.obs[0].copy(), batch.state[0].copy(), int(batch.episode_length[0]))
        self._avail = batch.avail_actions[0].copy()

    def _toll(self) -> Toll:
        health = self._views.field.health + self._views.field.shield
        return Toll(health[: self.n_agents], health[self.n_agents :])

    # --- Everything else ---

    def get_stats(self) -> dict[str, float]:
        """Battles since the start: won, fought, ended by time; `win_rate` is 0 before the first."""
        return {
            "battles_won": self.battles_won,
            "battles_game": self.battles_game,
            "battles_draw": self.timeouts,
            "win_rate": self.battles_won / max(self.battles_game, 1),
            "timeouts": self.timeouts,
            "restarts": self.force_restarts,
        }

    def seed(self, seed: int | None = None) -> int:
        """The seed. If one is given, the next `reset` begins with it."""
        if seed is not None:
            self._seed = self._next_seed = int(seed)
        return self._seed

    def render(self, mode: Literal["human", "rgb_array"] = "human") -> NDArray[np.uint8] | bool:
        """The battle from above, north at the top: "rgb_array" returns uint8 [height, width, 3]; "human" shows it in a
        window (needs pygame) and returns whether that is still open.
        """
        width, height = self.window_size
        picture = draw(self._views.layout, self._views.field, width, height)
        if mode == "rgb_array":
            return picture
        if mode != "human":
            raise InvalidRequest(f'mode={mode!r}: "human" or "rgb_array"')
        self._window = self._window or Window(f"smaclite_pool: {self.map_name}", width, height)
        return self._window.show(picture)

    def save_replay(self) -> Path:
        """Write the episode so far and return the file, `<replay_prefix>_<time>.npz` in `replay_dir`.

        It has `scenario`, `rules`, `seed`, `actions` int32 [T, A], `rewards` float32 [T], and the pool's `states`
        float32 [T + 1, state_size].
        """
        return self._recording.save(Path(self.replay_dir), self.replay_prefix or Path(self.map_name).stem)

    def close(self) -> None:
        """End the pool, and the window. A second time does nothing."""
        self._envs.close()
        if self._window is not None:
            self._window.close()
            self._window = None

    def full_restart(self) -> None:
        """SMAC's way out when StarCraft II hangs: here, a new episode."""
        self.reset()
        self.force_restarts += 1


StarCraft2Env = MultiAgentEnv


def get_map_params(map_name: str) -> dict[str, Any]:
    """What SMAC's function of that name tells of a scenario: `n_agents`, `n_enemies`, `limit`, `unit_type_bits`."""
    info = scenario(map_name)
    return {
        "n_agents": len(info["allies"]),
        "n_enemies": len(info["enemies"]),
        "limit": info["episode_limit"],
        "unit_type_bits": info["num_unit_types"],
    }


def install() -> None:
    """Let `smac`, `smac.env`, `smac.env.starcraft2` and its `maps` be this module, in this process and its children.

    For code that imports SMAC itself. Raises InvalidRequest if the published package is imported already.
    """
    this = sys.modules[__name__]
    loaded = sys.modules.get("smac.env")
    if loaded not in (None, this):
        raise InvalidRequest(f"`smac` of {loaded.__file__} is imported already; install this before that")
    if str(_FOLDER) not in sys.path:
        sys.path.insert(0, str(_FOLDER))  # processes that start anew get it from here
    package = ModuleType("smac", install.__doc__)
    package.__path__ = [str(_FOLDER)]
    sys.modules["smac"] = package
    for name in ("env", "env.multiagentenv", "env.starcraft2", "env.starcraft2.starcraft2"):
        sys.modules[f"smac.{name}"] = this
    for name in ("env.starcraft2.maps", "env.starcraft2.maps.smac_maps"):
        sys.modules[f"smac.{name}"] = this
    package.__dict__["env"] = this


def main() -> None:
    """Become Python with `smac` as this module and run the given script; alone, print the folder that does it."""
    if not sys.argv[1:]:
        print(_FOLDER)
        return
    paths = [str(_FOLDER), *filter(None, [os.environ.get("PYTHONPATH")])]
    os.environ["PYTHONPATH"] = os.pathsep.join(paths)
    os.execv(sys.executable, [sys.executable, *sys.argv[1:]])


def _only_default(**options: object) -> None:
    for name, value in options.items():
        values, reason = _FIXED[name]
        if value not in values:
            raise Unavailable(f"{name}={value!r}: only {values[0]!r} is possible here, as {reason}")


if __name__ == "__main__":
    main()
