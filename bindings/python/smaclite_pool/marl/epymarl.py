"""EPyMARL and PyMARL: a runner over one pool, instead of a process and a pipe per environment.

Register it in EPyMARL's `src/runners/__init__.py` with one line, and choose it on the command line:

    from smaclite_pool.marl.epymarl import PoolRunner; REGISTRY["pool"] = PoolRunner

    python -m smaclite_pool.compat src/main.py --config=qmix --env-config=smaclite with \\
        env_args.map_name=MMM2 env_args.time_limit=180 runner=pool batch_size_run=10

EPyMARL imports `smaclite` with any environment; `smaclite_pool.compat` provides a drop-in replacement. Where
the published package is installed, `python src/main.py ...` works too. EPyMARL's configuration ends episodes
after 150 steps unless `time_limit` is set.

The runner does the same as EPyMARL's parallel runner with `batch_size_run` environments that are seeded with
`seed`, `seed + 1` and so on: the same episodes for the same actions, the same batches, the same log.
Observations are copied from shared memory into the tensors of the batch.

Keys of `env_args` are those of EPyMARL's `src/config/envs/smaclite.yaml` and a few more. The command line
takes only keys that the file has, so write the others into it first (`pool: null` under `env_args`):

- `map_name`: a standard scenario or the path of a scenario file.
- `seed`: environment i is seeded with seed + i; without one, with a random seed.
- `time_limit` or `episode_limit`: steps of an episode; by default the limit of the scenario.
- `continuing_episode`: an episode that reaches its limit is not stored as terminated (an option of SMAC),
  default False.
- `state_last_action`: the state contains the last actions, default True.
- `pool`, `lane`: attach to a running pool instead of starting one. `map_name`, if it is set, and the limit
  must be those of the pool. Start it with `smaclite-pool serve MMM2:10 --episode-limit 180 --batch-size 1
  --autoreset-mode Disabled --name train`.
- `threads`: worker threads of a pool that this runner starts.
- `reward_sparse`, `reward_win` and SMAC's other reward options: what agents are rewarded for; a running pool
  has its own.
- `use_cpp_rvo2` and the other options of SMAC: only with values that match what a pool does.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from .._layout import feature_blocks, limit_ends
from .._native import REWARD_DEFAULTS, Envs, Recorder, connect, make, scenario
from ..errors import InvalidRequest
from ..integrations._common import INFO_FIELDS, OUTCOME_FIELDS, check_one_side, require_fields
from ._replay import save_replay
from ._rewards import changed_rewards

__all__ = ["PoolRunner"]

_KEYS = {"map_name", "seed", "time_limit", "episode_limit", "continuing_episode", "state_last_action"}
_KEYS |= {"pool", "lane", "threads", "replay_dir", "replay_prefix"} | REWARD_DEFAULTS.keys()

# Keys of the configurations of EPyMARL and SMAC, with the values that match what a pool does.
_SAME: dict[str, tuple[object, ...]] = {
    "step_mul": (8, None),
    "move_amount": (2,),
    "difficulty": ("7",),
    "game_version": (None, "latest"),
    "obs_all_health": (True,),
    "obs_own_health": (True, False),  # obs_all_health includes it
    "obs_last_action": (False,),
    "obs_pathing_grid": (False,),
    "obs_terrain_height": (False,),
    "obs_instead_of_state": (False,),
    "obs_timestep_number": (False,),
    "state_timestep_number": (False,),
    "heuristic_ai": (False,),
}
_WITHOUT_EFFECT = {"use_cpp_rvo2", "heuristic_rest", "debug"}


class PoolRunner:
    """EPyMARL's runner interface over the environments of one lane.

    `args` and `logger` are those that EPyMARL passes to runners. Raises InvalidRequest for an unknown key of
    `env_args`, for a value that is not supported, and for a running pool with other settings than this runner
    needs.
    """

    def __init__(self, args: Any, logger: Any) -> None:
        if not getattr(args, "common_reward", True):
            raise InvalidRequest("common_reward must be True, as the agents of a battle share one reward")
        if getattr(args, "render", False):
            raise InvalidRequest("render must be False; use runner=episode with smaclite_pool.marl.smac")
        self.args = args
        self.logger = logger
        self.batch_size: int = args.batch_size_run
        settings = _checked(args.env_args)
        self._envs = _attached(settings, self.batch_size)
        self._first_seed: int | None = settings.get("seed")
        self._marks_timeouts = bool(settings.get("continuing_episode", False))
        envs = self._envs
        if envs.spec.episode_limit is None:
            envs.close()
            raise InvalidRequest(f"{envs.spec.scenario} has no episode limit; set env_args.time_limit")
        self.episode_limit = envs.spec.episode_limit
        self._rows = _Rows(envs, settings.get("state_last_action", True))
        self._state_size = self._rows.state_size
        self._recorder = Recorder(envs.spec.pool, envs.spec.lane)
        self._replay_file = (
            settings.get("replay_dir") or "",
            settings.get("replay_prefix") or envs.spec.scenario,
        )
        self.t = 0
        self.t_env = 0
        self.train_returns: list[float] = []
        self.test_returns: list[float] = []
        self.train_stats: dict[str, float] = {}
        self.test_stats: dict[str, float] = {}
        self.log_train_stats_t = -100000  # as in EPyMARL, so that the first episodes are logged

    def setup(self, scheme: Any, groups: Any, preprocess: Any, mac: Any) -> None:
        """Store what EPyMARL builds from `get_env_info`."""
        episode_batch: Callable[..., Any] = importlib.import_module("components.episode_buffer").EpisodeBatch
        self.new_batch = partial(
            episode_batch,
            scheme,
            groups,
            self.batch_size,
            self.episode_limit + 1,
            preprocess=preprocess,
            device=self.args.device,
        )
        self.mac = mac
        self._torch = importlib.import_module("torch")
        self._dtypes = {name: info.get("dtype", self._torch.float32) for name, info in scheme.items()}

    def get_env_info(self) -> dict[str, Any]:
        """Sizes and the episode limit."""
        return {
            "state_shape": self._state_size,
            "obs_shape": self._envs.spec.obs_size,
            "n_actions": self._envs.spec.n_actions,
            "n_agents": self._envs.spec.n_agents,
            "episode_limit": self.episode_limit,
        }

    def save_replay(self) -> None:
        """Write the last 100 episodes of environment 0 to a replay in `env_args.replay_dir`."""
        save_replay(self._recorder, *self._replay_file)

    def close_env(self) -> None:
        """Close the environments."""
        self._recorder.close()
        self._envs.close()

    def reset(self) -> None:
        """Begin a new batch of episodes."""
        self.batch = self.new_batch()
        self._envs.async_reset(seed=self._first_seed)
        self._first_seed = None
        self._rows.receive(self._envs, self.batch_size)
        self.t = 0
        self._store(self._rows.before_action(list(range(self.batch_size))), slice(None))

    def run(self, test_mode: bool = False) -> Any:
        """Play one episode in every environment and return their batch."""
        self.reset()
        self.mac.init_hidden(batch_size=self.batch_size)
        ends: list[dict[str, float]] = []
        shown = running = list(range(self.batch_size))
        while True:
            # As in EPyMARL, the controller selects actions also for episodes that have just ended.
            actions = self.mac.select_actions(
                self.batch, t_ep=self.t, t_env=self.t_env, bs=shown, test_mode=test_mode
            )
            self.batch.update({"actions": actions.unsqueeze(1)}, bs=shown, ts=self.t, mark_filled=False)
            if not running:
                break
            chosen = actions.to("cpu").numpy()
            if len(running) < len(shown):
                chosen = chosen[[env in running for env in shown]]
            self._envs.send(chosen, env_id=running)
            self._rows.receive(self._envs, len(running))
            self._store(self._rows.after_action(running, self._marks_timeouts), running, mark_filled=False)
            self.t += 1
            self._store(self._rows.before_action(running), running)
            ended = self._rows.ended(running)
            ends += [self._rows.info(env, self._marks_timeouts) for env in ended]
            shown, running = running, [env for env in running if env not in ended]
        if not test_mode:
            self.t_env += self._rows.steps()
        self._record(ends, test_mode)
        return self.batch

    def _store(self, rows: Mapping[str, NDArray[Any]], envs: Any, mark_filled: bool = True) -> None:
        """Store arrays [rows, ...] in the batch at the current step."""
        tensors = {
            name: self._torch.from_numpy(array).to(self.args.device, self._dtypes[name]).unsqueeze(1)
            for name, array in rows.items()
        }
        self.batch.update(tensors, bs=envs, ts=self.t, mark_filled=mark_filled)

    def _record(self, ends: list[dict[str, float]], test_mode: bool) -> None:
        """Add to the statistics, and log them if the interval has passed."""
        stats = self.test_stats if test_mode else self.train_stats
        returns = self.test_returns if test_mode else self.train_returns
        totals = {"n_episodes": float(self.batch_size), "ep_length": float(self._rows.steps())}
        for numbers in [*ends, totals]:
            for name, value in numbers.items():
                stats[name] = stats.get(name, 0) + value
        returns.extend(self._rows.returns())
        n_test = max(1, self.args.test_nepisode // self.batch_size) * self.batch_size
        if test_mode and len(self.test_returns) == n_test:
            self._log(returns, stats, "test_")
        elif self.t_env - self.log_train_stats_t >= self.args.runner_log_interval:
            self._log(returns, stats, "test_" if test_mode else "")
            selector = self.mac.action_selector
            if hasattr(selector, "epsilon"):
                self.logger.log_stat("epsilon", selector.epsilon, self.t_env)
            self.log_train_stats_t = self.t_env

    def _log(self, returns: list[float], stats: dict[str, float], prefix: str) -> None:
        self.logger.log_stat(prefix + "return_mean", np.mean(returns), self.t_env)
        self.logger.log_stat(prefix + "return_std", np.std(returns), self.t_env)
        returns.clear()
        episodes = stats.pop("n_episodes")
        for name, value in stats.items():
            self.logger.log_stat(prefix + name + "_mean", value / episodes, self.t_env)
        stats.clear()


class _Rows:
    """The last results of every environment, one row per environment."""

    FIELDS = ("obs", "state", "avail_actions", "reward", "terminated", "truncated", *INFO_FIELDS)

    def __init__(self, envs: Envs, state_has_last_action: bool) -> None:
        kept = np.ones(envs.spec.state_size, np.float32)
        last_action = feature_blocks(scenario(envs)["state_layout"]).get("last_action")
        if last_action is not None:
            last_action.view(kept)[...] = state_has_last_action
        self._state: slice | NDArray[np.intp] = slice(None) if kept.all() else np.flatnonzero(kept)
        self.state_size = int(kept.sum())
        fields = envs.spec.fields
        self._fields: dict[str, NDArray[Any]] = {}
        for name in self.FIELDS:
            dtype, (_, *shape) = fields[name]
            self._fields[name] = np.zeros((envs.spec.num_envs, *shape), dtype)
        self._at_limit = np.zeros(envs.spec.num_envs, np.bool_)
        self._limit_ends = limit_ends(envs)

    def receive(self, envs: Envs, count: int) -> None:
        """Receive the next `count` environments that have finished a step."""
        while count > 0:
            batch = envs.recv()
            rows = batch.env_id
            for name, array in self._fields.items():
                array[rows] = getattr(batch, name)
            self._at_limit[rows] = self._limit_ends(batch)
            count -= len(rows)

    def before_action(self, rows: list[int]) -> dict[str, NDArray[Any]]:
        """The arrays that EPyMARL stores before an action: [rows, ...], copies."""
        fields = self._fields
        state = fields["state"][rows][:, self._state]
        return {"state": state, "avail_actions": fields["avail_actions"][rows], "obs": fields["obs"][rows]}

    def after_action(self, rows: list[int], marks_timeouts: bool) -> dict[str, NDArray[Any]]:
        """The arrays that it stores after an action: [rows, 1]."""
        fields = self._fields
        ended = fields["terminated"][rows, None] | fields["truncated"][rows, None]
        if marks_timeouts:
            ended = ended & ~self._at_limit[rows, None]
        return {"reward": fields["reward"][rows, None], "terminated": ended}

    def ended(self, rows: list[int]) -> list[int]:
        """Those of `rows` whose last step ended an episode."""
        ended = (self._fields["terminated"] | self._fields["truncated"]).tolist()
        return [row for row in rows if ended[row]]

    def info(self, row: int, marks_timeouts: bool) -> dict[str, float]:
        """`info` of the last step of an environment whose episode ended."""
        info = {name: float(self._fields[name][row]) for name in OUTCOME_FIELDS}
        if marks_timeouts and self._at_limit[row]:
            info["episode_limit"] = 1.0
        return info

    def returns(self) -> list[float]:
        """The return so far of every environment's episode."""
        returns: list[float] = self._fields["episode_return"].tolist()
        return returns

    def steps(self) -> int:
        """The total number of steps of all environments' episodes."""
        return int(self._fields["episode_length"].sum())


def _checked(env_args: Mapping[str, Any]) -> Mapping[str, Any]:
    for name, value in env_args.items():
        if name in _SAME and value not in _SAME[name]:
            raise InvalidRequest(
                f"env_args.{name} must be {_SAME[name][0]!r} with this runner, got {value!r}; "
                "for other values use smaclite_pool.marl.smac with runner=parallel"
            )
        if name not in _KEYS | _SAME.keys() | _WITHOUT_EFFECT:
            known = ", ".join(sorted(_KEYS))
            raise InvalidRequest(f"env_args.{name} is not known; the keys are {known} and those of SMAC")
    if env_args.get("map_name") is None and env_args.get("pool") is None:
        raise InvalidRequest("set env_args.map_name or env_args.pool")
    return env_args


def _attached(settings: Mapping[str, Any], num_envs: int) -> Envs:
    """Environments with batch size 1, since the episodes of a batch end at different times."""
    limit = _limit(settings)
    if settings.get("pool") is None:
        return make(
            settings["map_name"],
            num_envs,
            batch_size=1,
            seed=settings.get("seed"),
            threads=settings.get("threads"),
            autoreset_mode="Disabled",
            episode_limit=limit,
            rewards=changed_rewards(settings),
        )
    if changed := changed_rewards(settings):
        raise InvalidRequest(f"a running pool has its own rewards; remove {', '.join(changed)} from env_args")
    if settings.get("threads") is not None:
        raise InvalidRequest("a running pool has its own threads; remove `threads` from env_args")
    wanted = settings.get("map_name")
    told = None if wanted is None else scenario(wanted)
    envs = connect(settings["pool"], settings.get("lane"), timeout=10)
    spec = envs.spec
    name, steps = (
        (spec.scenario, spec.episode_limit) if told is None else (told["name"], told["episode_limit"])
    )
    if limit != "default":
        steps = limit
    served = (spec.scenario, spec.num_envs, spec.episode_limit, spec.batch_size, spec.autoreset_mode)
    if served != (name, num_envs, steps, 1, "Disabled"):
        envs.close()
        option = "" if steps is None else f" --episode-limit {steps}"
        raise InvalidRequest(
            "scenario, num_envs, episode_limit, batch_size and autoreset_mode of pool "
            f"`{spec.pool}` are {served}; this runner needs `smaclite-pool serve "
            f"{wanted or name}:{num_envs}{option} --batch-size 1 --autoreset-mode Disabled "
            f"--name {spec.pool}`, or other values of `map_name`, `batch_size_run` and `time_limit`"
        )
    try:
        require_fields(check_one_side(envs), "PoolRunner", _Rows.FIELDS)
    except InvalidRequest:
        envs.close()
        raise
    return envs


def _limit(settings: Mapping[str, Any]) -> int | Literal["default"]:
    given = {
        name: settings[name] for name in ("time_limit", "episode_limit") if settings.get(name) is not None
    }
    if len({*given.values()}) > 1:
        raise InvalidRequest(f"time_limit and episode_limit are the same limit, got {given}; remove one")
    limits: list[int] = list(given.values())
    return limits[0] if limits else "default"
