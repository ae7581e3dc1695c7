"""Plays recorded battles in SMAX of JaxMARL (0.2.0), on those of its maps that SMAC has: `--rules smax`.

Its battles are plain data, so a player needs no snapshots. It has no ranges beyond those of weapons: an order
to attack what is out of reach does nothing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import jaxmarl
import numpy as np
from jaxmarl.environments.smax.smax_env import MAP_NAME_TO_SCENARIO
from numpy.typing import NDArray

from .cast import Cast, Moment, Role, cast
from .pool import EPISODE_LIMIT, HEALTH_OF_REVIVED, SEED, Setting
from .recordings import EAST, FIRST_TARGET, NORTH, SOUTH, STOP, WEST, Battle

ACTIONS = {STOP: 4, NORTH: 0, SOUTH: 2, EAST: 1, WEST: 3}
"""Numbers of its actions by those of SMAC."""

FIRST_SHOT = 5
"""What is added to the number of an enemy."""


def maps() -> list[str]:
    return list(MAP_NAME_TO_SCENARIO)


@contextmanager
def opened(battles: list[Battle], setting: Setting, copies: int) -> Iterator[SmaxPlayer]:
    """As `pool.opened`; its one opponent is the script."""
    scenario = MAP_NAME_TO_SCENARIO[setting.scenario]
    env = jaxmarl.make("HeuristicEnemySMAX", scenario=scenario, max_steps=EPISODE_LIMIT)
    types = np.asarray(scenario.unit_types)
    health = np.asarray(env.unit_type_health)
    roles = [Role(env.unit_type_names[each].upper(), float(health[each]), False) for each in types]
    n_agents = scenario.num_allies
    yield SmaxPlayer(cast(battles, roles[:n_agents], roles[n_agents:], copies), env)


class SmaxPlayer:
    """A `Player`."""

    def __init__(self, of: Cast, env: Any) -> None:
        self.cast, self.env = of, env
        self.n_agents = of.course.n_agents
        count = len(of.course.battles) * of.copies
        self.key = jax.random.PRNGKey(SEED)
        _, self.state = jax.vmap(env.reset)(jax.random.split(self.key, count))
        self.goes_on = np.ones(count, bool)
        self.set(unit_positions=of.repeat(of.course.starts))

    def set(self, **columns: NDArray[Any]) -> None:
        """Replaces columns of the battles."""
        battle = self.state.state
        new = {name: jnp.asarray(each, getattr(battle, name).dtype) for name, each in columns.items()}
        self.state = self.state.replace(state=battle.replace(**new))

    def now(self) -> Moment:
        battle = self.state.state
        shot = np.asarray(battle.prev_attack_actions) - FIRST_SHOT
        target = np.where(
            np.arange(shot.shape[1]) < self.n_agents, shot + self.n_agents, self.n_agents - 1 - shot
        )
        columns = (battle.unit_positions, battle.unit_alive, battle.unit_weapon_cooldowns)
        places, alive, cooldown = (np.array(each) for each in columns)
        return Moment(places, alive, np.where(shot >= 0, target, -1).astype(np.int32), cooldown.astype(float))

    def step(self, t: int) -> NDArray[np.int32]:
        actions = self.cast.orders(t)
        own = np.where(actions >= FIRST_TARGET, actions - FIRST_TARGET + FIRST_SHOT, ACTIONS[STOP])
        for action, number in ACTIONS.items():
            own[actions == action] = number
        self.key, key = jax.random.split(self.key)
        keys = jax.random.split(key, len(actions))
        self.state, done = stepped(self.env, keys, self.state, jnp.asarray(own), jnp.asarray(self.goes_on))
        self.goes_on = self.goes_on & ~np.asarray(done)
        return actions

    def put(
        self,
        rows: NDArray[np.intp],
        places: NDArray[np.float64],
        alive: NDArray[np.bool_] | None = None,
    ) -> NDArray[np.intp]:
        battle = self.state.state
        positions, living, health = (
            np.array(each) for each in (battle.unit_positions, battle.unit_alive, battle.unit_health)
        )
        if alive is not None:
            both = alive[:, : self.n_agents].any(1) & alive[:, self.n_agents :].any(1)
            rows, places, alive = rows[both], places[both], alive[both]
            revived = HEALTH_OF_REVIVED * np.array([role.health for role in self.cast.roles])
            health[rows] = np.where(alive, np.where(living[rows], health[rows], revived), 0)
            living[rows] = alive
        known = ~np.isnan(places) & living[rows][..., None]
        positions[rows] = np.where(known, places, positions[rows])
        self.set(unit_positions=positions, unit_alive=living, unit_health=health)
        self.goes_on[rows] = True
        return rows


@partial(jax.jit, static_argnums=0)
def stepped(env: Any, keys: Any, state: Any, actions: Any, goes_on: Any) -> tuple[Any, Any]:
    """All battles after a step; those that are over stay as they are."""
    by_name = {agent: actions[:, i] for i, agent in enumerate(env.agents)}
    _, new, _, done, _ = jax.vmap(env.step_env)(keys, state, by_name)

    def kept(after: Any, before: Any) -> Any:
        return jnp.where(goes_on.reshape(-1, *[1] * (after.ndim - 1)), after, before)

    return jax.tree.map(kept, new, state), done["__all__"]
