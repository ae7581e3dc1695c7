"""A runner for EPyMARL (and PyMARL) over one pool, in place of a process and a pipe for every environment.

Register it in EPyMARL's `src/runners/__init__.py` with one line, and choose it on the command line:

    from smaclite_pool.epymarl import PoolRunner; REGISTRY["pool"] = PoolRunner

    python -m smaclite_pool.drop_in src/main.py --config=qmix --env-config=smaclite with \\
        env_args.map_name=MMM2 env_args.time_limit=180 runner=pool batch_size_run=10

EPyMARL imports `smaclite` whatever it runs, hence the stand-in; where the published package is installed,
`python src/main.py ...` does. Its configuration ends episodes after 150 steps unless `time_limit` says otherwise.

What it does is what EPyMARL's parallel runner does with `batch_size_run` environments of the seeds `seed`, `seed + 1`
and so on: the same episodes for the same actions, the same batches, the same log. Observations go from shared memory
into the tensors of the batch.

Keys of `env_args`, those of `config/envs/smaclite.yaml` and a few more:

- `map_name`: a standard scenario or the path of a scenario file.
- `seed`: environment i begins with seed + i.
- `time_limit` or `episode_limit`: steps of an episode; by default the scenario's own.
- `continuing_episode`: a time-out is not stored as the end of the episode (SMAC's option of that name), default False.
- `state_last_action`: the state has the last actions, default True.
- `pool`, `lane`: attach to a running pool in place of starting one. Serve it with
  `smaclite-pool serve MMM2:10 --batch-size 1 --autoreset disabled --name train`.
- `threads`: worker threads of a pool that is started here.
- `use_cpp_rvo2` and the options of SMAC: only what changes nothing.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ._native import Envs, connect, make
from .errors import InvalidRequest

__all__ = ["PoolRunner"]

_OWN_KEYS = {"map_name", "seed", "time_limit", "episode_limit", "continuing_episode", "state_last_action"}
_OWN_KEYS |= {"pool", "lane", "threads"}

# Keys of EPyMARL's and SMAC's own configurations, with the values that are what a pool does anyhow.
_SAME: dict[str, tuple[object, ...]] = {
    "step_mul": (8, None),
    "move_amount": (2,),
    "difficulty": ("7",),
    "game_version": (None, "latest"),
    "obs_all_health": (True,),
    "obs_own_health": (True, False),  # obs_all_health has it
    "obs_last_action": (False,),
    "obs_pathing_grid": (False,),
    "obs_terrain_height": (False,),
    "obs_instead_of_state": (False,),
    "obs_timestep_number": (False,),
    "state_timestep_number": (False,),
    "reward_sparse": (False,),
    "reward_only_positive": (True,),
    "reward_death_value": (10,),
    "reward_win": (200,),
    "reward_defeat": (0,),
    "reward_scale": (True,),
    "reward_scale_rate": (20,),
    "heuristic_ai": (False,),
}
_WITHOUT_EFFECT = {"use_cpp_rvo2", "reward_negative_scale", "replay_dir", "replay_prefix", "heuristic_rest", "debug"}


class PoolRunner:
    """EPyMARL's runner interface over the environments of one lane.

    `args` and `logger` are what EPyMARL gives to a runner. Raises InvalidRequest for a key of `env_args` that it does
    not know or a value that it cannot serve, and for a pool that is served in another way than this runner needs.
    """

    def __init__(self, args: Any, logger: Any) -> None:
        if not getattr(args, "common_reward", True):
            raise InvalidRequest("common_reward=False: the agents of a battle share one reward")
        if getattr(args, "render", False):
            raise InvalidRequest("render=True: this runner draws nothing; use runner=episode with smaclite_pool.smac")
        self.args = args
        self.logger = logger
        self.batch_size: int = args.batch_size_run
        settings = _checked(args.env_args)
        self._envs = _attached(settings, self.batch_size)
        self._first_seed: int | None = settings.get("seed")
        self._marks_timeouts = bool(settings.get("continuing_episode", False))
        envs = self._envs
        if envs.episode_limit is None:
            envs.close()
            raise InvalidRequest(f"{envs.scenario} has no episode limit; give env_args.time_limit")
        self.episode_limit = envs.episode_limit
        keeps_actions = settings.get("state_last_action", True)
        self._state_size = envs.state_size - (0 if keeps_actions else envs.n_agents * envs.n_actions)
        self._now = _Rows(envs, self._state_size)
        self.t = 0
        self.t_env = 0
        self.train_returns: list[float] = []
        self.test_returns: list[float] = []
        self.train_stats: dict[str, float] = {}
        self.test_stats: dict[str, float] = {}
        self.log_train_stats_t = -100000  # EPyMARL's: the first episodes are logged

    def setup(self, scheme: Any, groups: Any, preprocess: Any, mac: Any) -> None:
        """Take what EPyMARL builds once it knows the sizes."""
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
            "obs_shape": self._envs.obs_size,
            "n_actions": self._envs.n_actions,
            "n_agents": self._envs.n_agents,
            "episode_limit": self.episode_limit,
        }

    def save_replay(self) -> None:
        """Not in this runner."""
        raise InvalidRequest("save_replay: this runner saves none; use runner=episode with smaclite_pool.smac")

    def close_env(self) -> None:
        """Give the pool back."""
        self._envs.close()

    def reset(self) -> None:
        """Begin a new batch of episodes."""
        self.batch = self.new_batch()
        self._envs.async_reset(seed=self._first_seed)
        self._first_seed = None
        self._now.receive(self._envs, self.batch_size)
        self.t = 0
        self._store(self._now.before_action(list(range(self.batch_size))), slice(None))

    def run(self, test_mode: bool = False) -> Any:
        """Play one episode in every environment and return their batch."""
        self.reset()
        self.mac.init_hidden(batch_size=self.batch_size)
        ends: list[dict[str, float]] = []
        shown = running = list(range(self.batch_size))
        while True:
            # Environments that just ended are asked for an action once more: their last step is part of the batch.
            actions = self.mac.select_actions(self.batch, t_ep=self.t, t_env=self.t_env, bs=shown, test_mode=test_mode)
            self.batch.update({"actions": actions.unsqueeze(1)}, bs=shown, ts=self.t, mark_filled=False)
            if not running:
                break
            chosen = actions.to("cpu").numpy()
            if len(running) < len(shown):
                chosen = chosen[[env in running for env in shown]]
            self._envs.send(chosen, env_id=running)
            self._now.receive(self._envs, len(running))
            self._store(self._now.after_action(running, self._marks_timeouts), running, mark_filled=False)
            self.t += 1
            self._store(self._now.before_action(running), running)
            ended = self._now.ended(running)
            ends += [self._now.info(env, self._marks_timeouts) for env in ended]
            shown, running = running, [env for env in running if env not in ended]
        if not test_mode:
            self.t_env += self._now.steps()
        self._record(ends, test_mode)
        return self.batch

    def _store(self, rows: Mapping[str, NDArray[Any]], envs: Any, mark_filled: bool = True) -> None:
        """Put arrays [rows, ...] into the batch at the present step."""
        tensors = {
            name: self._torch.from_numpy(array).to(self.args.device, self._dtypes[name]).unsqueeze(1)
            for name, array in rows.items()
        }
        self.batch.update(tensors, bs=envs, ts=self.t, mark_filled=mark_filled)

    def _record(self, ends: list[dict[str, float]], test_mode: bool) -> None:
        """Add to the figures of the log, and write them when it is time to."""
        stats, returns = (self.test_stats, self.test_returns) if test_mode else (self.train_stats, self.train_returns)
        totals = {"n_episodes": float(self.batch_size), "ep_length": float(self._now.steps())}
        for figures in [*ends, totals]:
            for name, value in figures.items():
                stats[name] = stats.get(name, 0) + value
        returns.extend(self._now.returns())
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
    """What was last received of every environment, a row each."""

    FIELDS = (
        *("obs", "state", "avail_actions", "reward", "terminated", "truncated", "battle_won"),
        *("dead_allies", "dead_enemies", "episode_return", "episode_length"),
    )

    def __init__(self, envs: Envs, state_size: int) -> None:
        self._state_size = state_size
        known = envs.fields
        self._fields: dict[str, NDArray[Any]] = {}
        for name in self.FIELDS:
            dtype, (_, *shape) = known[name]
            self._fields[name] = np.zeros((envs.num_envs, *shape), dtype)

    def receive(self, envs: Envs, count: int) -> None:
        """Take in the next `count` environments that are done."""
        while count > 0:
            batch = envs.recv()
            rows = batch.env_id
            for name, own in self._fields.items():
                own[rows] = getattr(batch, name)
            count -= len(rows)

    def before_action(self, rows: list[int]) -> dict[str, NDArray[Any]]:
        """What EPyMARL stores before an action: [rows, ...], copies."""
        own = self._fields
        state = own["state"][rows, : self._state_size]
        return {"state": state, "avail_actions": own["avail_actions"][rows], "obs": own["obs"][rows]}

    def after_action(self, rows: list[int], marks_timeouts: bool) -> dict[str, NDArray[Any]]:
        """What it stores after one: [rows, 1]."""
        own = self._fields
        ended = own["terminated"][rows, None]
        if not marks_timeouts:
            ended = ended | own["truncated"][rows, None]
        return {"reward": own["reward"][rows, None], "terminated": ended}

    def ended(self, rows: list[int]) -> list[int]:
        """For which of these was the last step the end of an episode?"""
        over = (self._fields["terminated"] | self._fields["truncated"]).tolist()
        return [row for row in rows if over[row]]

    def info(self, row: int, marks_timeouts: bool) -> dict[str, float]:
        """The last step's `info` of an environment that ended."""
        info = {name: float(self._fields[name][row]) for name in ("battle_won", "dead_allies", "dead_enemies")}
        if marks_timeouts and self._fields["truncated"][row]:
            info["episode_limit"] = 1.0
        return info

    def returns(self) -> list[float]:
        """The sum of rewards so far of every environment's episode."""
        returns: list[float] = self._fields["episode_return"].tolist()
        return returns

    def steps(self) -> int:
        """The steps so far of all environments' episodes."""
        return int(self._fields["episode_length"].sum())


def _checked(env_args: Mapping[str, Any]) -> Mapping[str, Any]:
    for name, value in env_args.items():
        if name in _SAME and value not in _SAME[name]:
            raise InvalidRequest(
                f"env_args.{name}={value!r}: this runner serves only {_SAME[name][0]!r}; use smaclite_pool.smac "
                "with runner=parallel"
            )
        if name not in _OWN_KEYS | _SAME.keys() | _WITHOUT_EFFECT:
            known = ", ".join(sorted(_OWN_KEYS))
            raise InvalidRequest(f"env_args.{name}={value!r} is not known; known are {known} and SMAC's options")
    if env_args.get("map_name") is None and env_args.get("pool") is None:
        raise InvalidRequest("env_args.map_name or env_args.pool says which environments to run")
    return env_args


def _attached(settings: Mapping[str, Any], num_envs: int) -> Envs:
    """Environments that are stepped and received one by one, since a batch's episodes end at different times."""
    limit: int | Literal["default"] = settings.get("time_limit") or settings.get("episode_limit") or "default"
    if settings.get("pool") is None:
        return make(
            settings["map_name"],
            num_envs,
            batch_size=1,
            seed=settings.get("seed") or 0,
            threads=settings.get("threads"),
            autoreset="disabled",
            episode_limit=limit,
        )
    envs = connect(settings["pool"], settings.get("lane"), timeout=10)
    served = (envs.num_envs, envs.batch_size, envs.autoreset)
    if served != (num_envs, 1, "disabled"):
        pool, scenario = envs.name, envs.scenario
        envs.close()
        raise InvalidRequest(
            f"pool `{pool}` serves (environments, batch size, autoreset) = {served}; this runner needs "
            f"`smaclite-pool serve {scenario}:{num_envs} --batch-size 1 --autoreset disabled --name {pool}`"
        )
    return envs
