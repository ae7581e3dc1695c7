"""Teams of `smaclite-pool train` in Python: train one, load one, and let it play."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from ._native import ZOO, zoo_file
from .errors import InvalidRequest

if TYPE_CHECKING:
    from . import Batch

Array = NDArray[np.float32]

HIDDEN: dict[str, Callable[[Array], Array]] = {
    "relu": lambda x: np.maximum(x, 0, dtype=np.float32),
    "tanh": np.tanh,
}
"""The non-linearities that `run.json` can name."""

BEST = "best.safetensors"
"""The file of the weights of the best evaluation."""

LINE_INTERVAL = 2.0
"""Seconds between two lines of progress."""


class Team:
    """A trained team: a policy for `evaluate` and for loops of your own.

        import smaclite_pool as sp

        team = sp.load_team("runs/3m")
        with sp.make("3m", num_envs=64, **team.settings) as envs:
            print(sp.evaluate(envs, team, episodes=200, seed=1).win_rate)

    Called with a batch, it returns actions, int32 [M, n_agents]: drawn by their probabilities from a
    generator of its own, or the most probable ones with `greedy`. The batch must have `obs` and
    `avail_actions`. It computes in NumPy what `smaclite-pool evaluate` computes in Rust, up to rounding.
    """

    def __init__(
        self,
        folder: str | PathLike[str],
        *,
        weights: Literal["best", "last"] | None = None,
        greedy: bool = False,
        seed: int = 0,
    ) -> None:
        self.folder = str(folder)
        self.greedy = greedy
        if weights not in (None, "best", "last"):
            raise InvalidRequest(f'weights must be None, "best" or "last", got {weights!r}')
        try:
            run = json.loads(read(f"{folder}/run.json"))
            file = weights_file(self.folder, run["config"], weights)
            arrays = read_safetensors(read(f"{folder}/{file}"))
            self.config: dict[str, Any] = run["config"]
            """The hyperparameters."""
            self.settings: dict[str, Any] = {
                "rules": run["rules"],
                "episode_limit": {"scenario": "default"}.get(run["episode_limit"], run["episode_limit"]),
                "opponent": run.get("opponents", "attack_move"),
                "obs_last_actions": self.config["last_actions"],
            }
            """Arguments of `make` for environments as those of the training."""
            layers = range(len(self.config["hidden"]) + 1)
            self._layers = [(arrays[f"actor.{i}.weight"].T, arrays[f"actor.{i}.bias"]) for i in layers]
            self._id_bias = arrays["actor.id_bias"]
            self._hidden = HIDDEN[self.config["activation"]]
        except (OSError, KeyError, ValueError) as error:
            raise InvalidRequest(f"`{folder}` is not the folder of a trained team: {error}") from error
        self._random = np.random.default_rng(seed)

    def __repr__(self) -> str:
        return f"<Team {str(self.folder)!r}, {'greedy' if self.greedy else 'sampled'} actions>"

    def logits(self, obs: Array) -> Array:
        """The network's outputs, float32 [M, n_agents, n_actions], for float32 [M, n_agents, obs_size]."""
        expected = (len(self._id_bias), len(self._layers[0][0]))
        if obs.shape[1:] != expected:
            raise InvalidRequest(
                f"the team's observations are [M, {expected[0]}, {expected[1]}], got {list(obs.shape)}: make "
                "environments of its scenario with `**team.settings`"
            )
        x = obs
        for i, (weight, bias) in enumerate(self._layers):
            x = x @ weight + bias
            if i == 0:
                x += self._id_bias
            if i < len(self._layers) - 1:
                x = self._hidden(x)
        return x

    def __call__(self, batch: Batch) -> NDArray[np.int32]:
        outputs = np.where(batch.avail_actions, self.logits(batch.obs), -np.inf)
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
    seed: int = 0,
) -> Team:
    """A trained team: one that is part of the package, or that of a run.

        import smaclite_pool as sp

        team = sp.load_team("2s3z")
        with sp.make("2s3z", num_envs=64, **team.settings) as envs:
            print(sp.evaluate(envs, team, episodes=200, seed=1).win_rate)

    Args:
        team: the name of a scenario in `ZOO`, or a folder, as `--out` of `smaclite-pool train` or `out` of
            `train`. If there is a folder of that name, it is taken; `"zoo:2s3z"` is always that of the
            package.
        weights: those of the best evaluation of the run (`"best"`) or its last ones (`"last"`). None for the
            best ones if the run was evaluated and did not play itself, else the last.
        greedy: take the most probable actions, instead of drawing them.
        seed: of the generator that draws them.

    Raises InvalidRequest if there is no such team.
    """
    if team in ZOO and not Path(team).is_dir():
        team = f"zoo:{team}"
    return Team(team, weights=weights, greedy=greedy, seed=seed)


def train(
    scenario: str | PathLike[str],
    out: str | PathLike[str],
    *,
    steps: int | None = None,
    seed: int = 0,
    opponent: str | PathLike[str] | Mapping[str, float] = "attack_move",
    on_update: Callable[[dict[str, Any]], object] | None = None,
    **options: object,
) -> Team:
    """Train a team, as `smaclite-pool train` in another process, and return it.

        import smaclite_pool as sp

        team = sp.train("3m", "runs/3m", steps=200_000, seed=1)

    Args:
        scenario: a standard scenario or the path of a scenario file.
        out: the folder of the run, which must not hold one.
        steps: environment steps; by default as many as the program makes.
        seed: of weights, environments, actions and minibatches.
        opponent: who plays the enemies, as in `make`; or the folder of another run, `"self"` or `"league"`.
        on_update: called with the record of every update, the columns of `log.csv`; by default a line with
            steps, return and win rate is printed every two seconds.
        options: other options of the program, such as `num_envs=128` or `actor_lr=5e-4`; but not `seeds` or
            `resume`, which do not train one new team, or `json`, which is always given.

    Ctrl-C ends the training; `smaclite-pool train --resume OUT` continues it. Raises InvalidRequest with the
    program's message if it fails.
    """
    refused = [name for name in options if name in {"seeds", "resume", "json"}]
    if refused:
        raise InvalidRequest(
            f"`{refused[0]}` is no option of `train`, which trains one new team: run "
            f"`smaclite-pool train --{refused[0]}`"
        )
    if isinstance(opponent, Mapping):
        opponent = ",".join(f"{name}={weight}" for name, weight in opponent.items())
    given = {"out": out, "seed": seed, "opponent": opponent, **options}
    if steps is not None:
        given["steps"] = steps
    arguments = [f"--{name.replace('_', '-')}={value}" for name, value in given.items()]
    argv = [sys.executable, "-m", "smaclite_pool", "train", str(scenario), "--json", *arguments]
    printed = -LINE_INTERVAL
    with subprocess.Popen(argv, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None and process.stderr is not None
        try:
            for line in process.stdout:
                record = json.loads(line)
                if on_update is not None:
                    on_update(record)
                elif (now := time.monotonic()) - printed > LINE_INTERVAL:
                    printed = now
                    print(progress(record, total_steps(out)), flush=True)
        except BaseException:
            process.send_signal(signal.SIGINT)  # it writes a checkpoint
            raise
        message = process.stderr.read().strip()
    if process.returncode != 0:
        raise InvalidRequest(message.removeprefix("smaclite-pool: ").removeprefix("error: "))
    return load_team(out)


def total_steps(out: str | PathLike[str]) -> int:
    """After how many steps the run in a folder is complete."""
    steps: int = json.loads(Path(out, "run.json").read_bytes())["config"]["steps"]
    return steps


def progress(record: dict[str, Any], steps: int) -> str:
    """A line about an update."""
    if record["episodes"] == 0:
        return f"{record['steps']} of {steps} steps"
    wins = f"return {record['mean_return']:.2f}, wins {100 * record['win_rate']:.1f} %"
    return f"{record['steps']} of {steps} steps, {wins}"


def read(path: str) -> bytes:
    """The bytes of a file of a run, or of a team of the package."""
    file = zoo_file(path)
    return Path(path).read_bytes() if file is None else file


def weights_file(folder: str, config: dict[str, Any], weights: str | None) -> str:
    """The file of the weights that play, as the program chooses them."""
    if weights is None:
        # The evaluations of a team that plays itself are against a script that it does not learn to beat.
        plays_itself = "self_play" in config.get("enemies", {})
        is_evaluated = zoo_file(f"{folder}/{BEST}") is not None or Path(folder, BEST).exists()
        weights = "best" if is_evaluated and not plays_itself else "last"
    return BEST if weights == "best" else "weights.safetensors"


def read_safetensors(data: bytes) -> dict[str, Array]:
    """The arrays of a file in the safetensors format: a length, a JSON header, and the numbers."""
    size = int.from_bytes(data[:8], "little")
    header = json.loads(data[8 : 8 + size])
    header.pop("__metadata__", None)
    arrays = {}
    for name, tensor in header.items():
        begin, end = tensor["data_offsets"]
        numbers = np.frombuffer(data[8 + size + begin : 8 + size + end], "<f4")
        arrays[name] = numbers.reshape(tensor["shape"])
    return arrays
