"""Where and when enemies come to stand, which is where they begin to fire.

An enemy is seen at the orders to attack it. It stands where it is seen at the same place in two steps, one
after the other; what counts is the first time. Our battles are looked at in the same way: at the steps at
which it is ordered to be attacked in the recording. The distance is that to the nearest agent whose place is
known then: from an order to walk, or because it has stood there until its next one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .cast import Cast
from .free import Played
from .recordings import LOOPS

SAME_PLACE = 0.01


class Stands(NamedTuple):
    """Where enemies of one type come to stand."""

    loop: NDArray[np.float64]
    distance: NDArray[np.float64]
    """Between centres, to the nearest agent, in squares."""


def real(cast: Cast) -> dict[str, Stands]:
    """In the recordings."""
    recorded = cast.course
    died = recorded.died[:, None]
    steps = recorded.places.shape[1]
    alive = np.isnan(died) | (died > LOOPS * np.arange(steps)[None, :, None])
    return stands(cast, recorded.places, recorded.stood, alive)


def ours(cast: Cast, played: Played) -> dict[str, Stands]:
    """In battles that were played, in all copies."""
    recorded = cast.course
    steps = recorded.places.shape[1]
    battles = played.places.shape[0] * played.places.shape[1]
    places = played.places[:, :, :steps].reshape(battles, steps, -1, 2).astype(float)
    alive = played.alive[:, :, :steps].reshape(battles, steps, -1)
    seen, known = (np.repeat(np.isnan(each), cast.copies, 0) for each in (recorded.places, recorded.stood))
    return stands(cast, np.where(seen, np.nan, places), np.where(known, np.nan, places), alive)


def stands(
    cast: Cast, seen: NDArray[np.float64], known: NDArray[np.float64], alive: NDArray[np.bool_]
) -> dict[str, Stands]:
    """Of battles with these places, [B, T + 1, U, 2]: those of enemies that are seen, and those of agents
    that are known, NaN otherwise."""
    n_agents = cast.course.n_agents
    enemies, living = seen[:, :, n_agents:], alive[:, :, n_agents:]
    still = np.hypot(*np.moveaxis(np.diff(enemies, axis=1), 3, 0)) < SAME_PLACE  # NaN is not
    still &= living[:, :-1] & living[:, 1:]
    battle, enemy = np.nonzero(still.any(1))
    step = still.argmax(1)[battle, enemy]
    agents = np.where(alive[battle, step, :n_agents, None], known[battle, step, :n_agents], np.nan)
    gaps = np.hypot(*np.moveaxis(agents - enemies[battle, step, enemy][:, None], 2, 0))
    distance = np.where(np.isnan(gaps), np.inf, gaps).min(1)
    found = {}
    names = np.array([name for side, name in cast.kinds if side == "enemies"])
    for name in sorted(set(names)):
        here = (names[enemy] == name) & np.isfinite(distance)
        if here.any():
            found[str(name)] = Stands(LOOPS * step[here].astype(float), distance[here])
    return found
