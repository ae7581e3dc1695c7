"""How far battles that were played from their starts are from the recorded ones. README.md has the
definitions."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .free import Played
from .recordings import LOOPS, Course

Values = dict[str, NDArray[np.float64]]
"""A number per battle and copy, [B, S], by its name; NaN where there is none."""


def compare(recorded: Course, played: Played) -> Values:
    """Every measure."""
    n_agents, copies = recorded.n_agents, played.died.shape[1]
    sides = {"agents": slice(None, n_agents), "enemies": slice(n_agents, None)}
    real = np.repeat(recorded.died[:, None], copies, 1)
    ours = played.died
    horizon = np.repeat(recorded.horizon[:, None], copies, 1)
    values: Values = {}
    values["won_real"] = np.repeat(recorded.won[:, None], copies, 1).astype(float)
    values["won"] = (~np.isnan(ours[..., sides["enemies"]])).all(2).astype(float)
    values["winner"] = (values["won_real"] == values["won"]).astype(float)
    for side, units in sides.items():
        for name, died in (("_dead_real", real), ("_dead", ours)):
            values[side + name] = (~np.isnan(died[..., units])).mean(2)
        values[side] = np.abs(values[f"{side}_dead_real"] - values[f"{side}_dead"])
    errors = [
        np.abs(times(real[..., units], horizon) - times(ours[..., units], horizon))
        for units in sides.values()
    ]
    values["death"] = np.median(np.concatenate(errors, 2), 2)
    values["fate"] = (np.isnan(real) == np.isnan(ours)).mean(2)
    values["end"] = np.abs(horizon - played.ended)
    values |= first_deaths(recorded, played)
    values["killer"] = share_of_killers(recorded, played)
    for side, units in sides.items():
        values[f"killers_of_{side}_real"] = number_of_killers(real_killers(recorded, copies)[:, :, units])
        values[f"killers_of_{side}"] = number_of_killers(played.killers[:, :, units])
    return values


def times(died: NDArray[np.float64], horizon: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sorted times of death, with the horizon for those that live."""
    return np.sort(np.where(np.isnan(died), horizon[..., None], died), 2)


def first_deaths(recorded: Course, played: Played) -> Values:
    """Loops from the first order to attack to the first death, of either side. Our deaths are known to the
    step, so recorded ones are rounded up to it."""
    real = np.ceil(least(recorded.died) / LOOPS) * LOOPS - LOOPS * first(recorded.attacks.any(axis=2))
    copies = played.died.shape[1]
    return {
        "first_death_real": np.repeat(real[:, None], copies, 1),
        "first_death": least(played.died) - LOOPS * first(played.fired),
    }


def first(flags: Any) -> NDArray[np.float64]:
    """Index of the first true flag along the last axis; NaN if there is none."""
    return np.where(flags.any(-1), flags.argmax(-1), np.nan)


def least(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """The least along the last axis; NaN if there is none."""
    smallest = np.where(np.isnan(values), np.inf, values).min(-1)
    return np.where(np.isinf(smallest), np.nan, smallest)


def real_killers(recorded: Course, copies: int) -> NDArray[np.float32]:
    """As `Played.killers`."""
    n_units = recorded.killer.shape[1]
    shares = (recorded.killer[..., None] == np.arange(n_units)).astype(np.float32)
    return np.repeat(shares[:, None], copies, 1)


def share_of_killers(recorded: Course, played: Played) -> NDArray[np.float64]:
    """Of the units that die in both with known killers, the share that the same unit kills."""
    real = real_killers(recorded, played.died.shape[1])
    same = (real * played.killers).sum(3)
    both = (real.sum(3) > 0) & (played.killers.sum(3) > 0)
    return mean(same, both)


def number_of_killers(shares: NDArray[np.float32]) -> NDArray[np.float64]:
    """The effective number of killers, [B, S]: 1 / the sum of the squares of their shares; NaN without
    deaths."""
    kills = shares.sum(2, dtype=np.float64)
    total = kills.sum(2)
    squares = (kills**2).sum(2)
    return ratio(total**2, squares)


def mean(values: NDArray[np.floating], where: NDArray[np.bool_]) -> NDArray[np.float64]:
    """The mean along the last axis of what is valid; NaN without any."""
    number = where.sum(-1)
    total = np.where(where, values, 0).sum(-1, dtype=np.float64)
    return ratio(total, number)


def ratio(numerator: NDArray[np.float64], denominator: NDArray[Any]) -> NDArray[np.float64]:
    """NaN where the denominator is 0."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(denominator > 0, numerator / denominator, np.nan)


def interval(maps: list[NDArray[np.float64]], draws: int = 2000) -> tuple[float, float]:
    """The 95 % bootstrap interval of the mean over maps: in each, battles are drawn anew with all their
    copies."""
    random = np.random.default_rng(1)
    total = np.zeros(draws)
    for values in maps:
        battles = values.mean(1)
        total += battles[random.integers(len(battles), size=(draws, len(battles)))].mean(1)
    low, high = np.quantile(total / len(maps), [0.025, 0.975])
    return float(low), float(high)
