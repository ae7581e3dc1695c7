"""Log and evaluations of a learner in PyTorch while it trains, for ppo.py and value_decomposition.py.

The files are those of `smaclite-pool train --evaluate-every`, so `smaclite-pool report` reads them
(docs/how-to/benchmark.md): `evaluations.csv`, `evaluation_episodes.csv`, `evaluations/`,
`best.safetensors` and `final.json`. `time_to_win.json` says when the team first won, which the report
cannot find out by itself, as it does not know the learner's networks.

Evaluations have environments and seeds of their own, and leave PyTorch's random numbers as they were: they
change no bit of the training.
"""

from __future__ import annotations

import copy
import csv
import json
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import smaclite_pool as sp
from smaclite_pool.examples.options import extra

with extra("torch"):
    import torch
    from safetensors.torch import save_file

EPISODES = 32
"""Of an evaluation, with each kind of actions."""
FINAL_EPISODES = 320
"""Of the best weights at the end, with each kind."""

WIN_EPISODES, ENOUGH_WINS = 200, 189
"""A team has won if the lower end of the 95 % interval (Wilson) of its win rate is at least 90 %. Of 200
episodes, 189 wins are enough: the lower end is 90.4 %; with 188 wins it is 89.8 %."""
WIN_BLOCK = 40
"""Episodes that are played before the losses are counted."""

ROW = ["win_rate", "mean_return", "mean_length"]
COLUMNS = [
    "steps",
    "trained_steps",
    "updates",
    *(f"{kind}_{name}" for kind in ("greedy", "sampled") for name in ROW),
]
COLUMNS += ["seconds", "cpu_seconds"]


class Clock:
    """Time and processor time of the training; the latter includes the pool."""

    def __init__(self) -> None:
        self.begin, self.cpu_begin = time.perf_counter(), time.process_time()

    def read(self) -> dict[str, float]:
        seconds, cpu_seconds = time.perf_counter() - self.begin, time.process_time() - self.cpu_begin
        return {"seconds": seconds, "cpu_seconds": cpu_seconds}

    @contextmanager
    def paused(self) -> Iterator[None]:
        at = self.read()
        yield
        self.begin = time.perf_counter() - at["seconds"]
        self.cpu_begin = time.process_time() - at["cpu_seconds"]


class Log:
    """`log.csv` in the folder of the run, TensorBoard's file if its package is installed, and progress."""

    def __init__(self, folder: Path) -> None:
        self.file = (folder / "log.csv").open("w", buffering=1)  # line by line
        self.clock, self.printed = Clock(), 0.0
        self.tensorboard: Any = None
        try:
            from torch.utils.tensorboard import SummaryWriter

            self.tensorboard = SummaryWriter(str(folder))
        except ImportError:
            pass

    def write(self, row: dict[str, float], speed: dict[str, float]) -> None:
        """Adds a row, with time and processor time of the run, without evaluations."""
        times = self.clock.read()
        row = row | times | speed
        if self.tensorboard is not None:
            for name, value in row.items():
                self.tensorboard.add_scalar(name, value, int(row["steps"]))
        writer = csv.DictWriter(self.file, row)
        if self.file.tell() == 0:
            writer.writeheader()
        writer.writerow({name: "" if value != value else value for name, value in row.items()})
        if times["seconds"] > self.printed + 2:
            self.printed = times["seconds"]
            print(
                f"{row['steps']:9,} steps, {row['steps'] / row['cpu_seconds']:7,.0f} per CPU second, "
                f"return {row['mean_return']:5.2f}, wins {100 * row['win_rate']:5.1f} %",
                flush=True,
            )


def recent(episodes: deque[tuple[float, bool, int]]) -> dict[str, float]:
    """Means over the newest episodes."""
    names = ("mean_return", "win_rate", "mean_length")
    means = np.mean(episodes, axis=0) if episodes else [float("nan")] * 3
    return {name: float(value) for name, value in zip(names, means, strict=True)}


class Evaluations:
    """The evaluations of a run: at 0 steps, at every multiple of `options.evaluate_every`, and at the end.
    If that is 0, there are none.

    Args:
        folder: the folder of the run.
        options: `seed`, `steps` and `evaluate_every`.
        team: the networks; their weights are those of the training.
        make_envs: makes so many environments.
        make_policy: from environments, and whether actions are greedy, to a function from batches to actions.
        clock: of the training.
    """

    def __init__(
        self,
        folder: Path,
        options: Any,
        team: Any,
        make_envs: Callable[[int], Any],
        make_policy: Callable[[Any, bool], Callable[[Any], Any]],
        clock: Clock,
    ) -> None:
        self.folder, self.options, self.team, self.clock = folder, options, team, clock
        self.make_envs, self.make_policy = make_envs, make_policy
        self.due = 0 if options.evaluate_every > 0 else None
        """The step count of the next evaluation."""
        self.best: tuple[list[float], int, int, Any] = ([], 0, 0, None)
        """Merit, step count, steps of training and weights of the best evaluation."""
        self.wins: dict[str, Any] = {"greedy": None, "sampled": None}
        """When the team first won."""
        if self.due is not None:
            (folder / "evaluations").mkdir()
            self.write("evaluations.csv", [COLUMNS])
            episodes = ["steps", "actions", "episode", "return", "length", "won"]
            self.write("evaluation_episodes.csv", [episodes])

    def play_due(self, trained_steps: int, updates: int) -> None:
        """Plays the evaluations that are due after so many steps of training."""
        with self.clock.paused():
            while self.due is not None and self.due <= trained_steps:
                self.play(self.due, trained_steps, updates)
                every, total = self.options.evaluate_every, self.options.steps
                self.due = min((self.due // every + 1) * every, total) if self.due < total else None

    def play(self, steps: int, trained_steps: int, updates: int) -> None:
        """The evaluation at a step count, of the present weights."""
        weights = copy.deepcopy(self.team.state_dict())
        save_file(weights, self.folder / f"evaluations/{steps:012}.safetensors")
        played = [self.episodes(EPISODES, greedy, [steps]) for greedy in (True, False)]
        times = self.clock.read()
        for kind, result in zip(("greedy", "sampled"), played, strict=True):
            won = result.won.astype(int)
            columns = zip(range(EPISODES), result.returns, result.lengths, won, strict=True)
            self.write("evaluation_episodes.csv", ([steps, kind, *column] for column in columns))
        means = [value for result in played for value in summary(result).values()]
        self.write("evaluations.csv", [[steps, trained_steps, updates, *means, *times.values()]])
        greedy, sampled = played
        merit = [greedy.win_rate, sampled.win_rate, greedy.mean_return + sampled.mean_return]
        if merit >= self.best[0]:
            self.best = merit, steps, trained_steps, weights
            save_file(weights, self.folder / "best.safetensors")
        for kind, time_to_win in self.wins.items():
            if time_to_win is None and (wins := self.enough_wins(steps, kind == "greedy")) is not None:
                self.wins[kind] = {"steps": steps, "wins": wins, "episodes": WIN_EPISODES, **times}
        (self.folder / "time_to_win.json").write_text(json.dumps(self.wins))

    def finish(self, trained_steps: int, updates: int) -> None:
        """Plays what is due at the end of the training, and the final episodes with the best weights."""
        if self.options.evaluate_every == 0:
            return
        self.play_due(trained_steps, updates)
        with self.clock.paused():
            last = copy.deepcopy(self.team.state_dict())
            _, steps, best_steps, weights = self.best
            self.team.load_state_dict(weights)
            greedy, sampled = (self.episodes(FINAL_EPISODES, is_greedy, []) for is_greedy in (True, False))
            self.team.load_state_dict(last)
        result: dict[str, Any] = {
            "steps": steps,
            "trained_steps": best_steps,
            "run_steps": trained_steps,
            **self.clock.read(),
        }
        result |= {"greedy": summary(greedy), "sampled": summary(sampled)}
        result |= {"greedy_episodes": as_objects(greedy), "sampled_episodes": as_objects(sampled)}
        (self.folder / "final.json").write_text(json.dumps(result))

    def enough_wins(self, steps: int, greedy: bool) -> int | None:
        """The wins of the present weights, if they are enough; otherwise not all episodes are played."""
        wins = 0
        for block in range(WIN_EPISODES // WIN_BLOCK):
            wins += int(self.episodes(WIN_BLOCK, greedy, [steps, block]).won.sum())
            if wins + WIN_EPISODES - WIN_BLOCK * (block + 1) < ENOUGH_WINS:
                return None
        return wins

    def episodes(self, count: int, greedy: bool, occasion: list[int]) -> sp.Evaluation:
        """Plays episodes with the present weights. Run, occasion and weights decide them."""
        words = [self.options.seed, len(occasion), *occasion, greedy]
        seed = int(np.random.SeedSequence(words).generate_state(1, np.uint64)[0])
        with torch.random.fork_rng(), self.make_envs(min(count, 64)) as envs:
            torch.manual_seed(seed % 2**63)
            envs.seed_sampler(seed)
            return sp.evaluate(envs, self.make_policy(envs, greedy), count, seed=seed)

    def write(self, name: str, rows: Any) -> None:
        with (self.folder / name).open("a", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows(rows)


def summary(result: sp.Evaluation) -> dict[str, float]:
    """Means of episodes."""
    return {name: getattr(result, name) for name in ROW}


def as_objects(result: sp.Evaluation) -> list[dict[str, Any]]:
    """The episodes as `final.json` has them."""
    columns = (result.returns.tolist(), result.lengths.tolist(), result.won.tolist())
    names = ("episode_return", "length", "won")
    return [dict(zip(names, values, strict=True)) for values in zip(*columns, strict=True)]
