"""Plays battles and compares batches, for several tests."""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np
import smaclite_pool as sp
from numpy.typing import NDArray


def bits(batch: sp.Batch) -> bytes:
    """A digest of all bits of a batch."""
    digest = hashlib.sha256()
    for name, array in batch.copy().items():
        digest.update(name.encode() + array.tobytes())
    return digest.digest()


def play(envs: sp.Envs, steps: int, seed: int) -> list[bytes]:
    """Plays random available actions; returns the digest of every batch."""
    envs.seed_sampler(seed)
    played = [bits(envs.reset(seed=seed))]
    for _ in range(steps):
        played.append(bits(envs.step(envs.sample_actions())))
    return played


def play_in_part_batches(envs: sp.Envs, steps: int, seed: int) -> dict[int, list[bytes]]:
    """Plays `first_legal` asynchronously; returns the bytes of obs and reward of each environment's steps."""
    envs.async_reset(seed=seed)
    seen: dict[int, list[bytes]] = {env: [] for env in range(envs.num_envs)}
    while any(len(own) <= steps for own in seen.values()):
        batch = envs.recv(timeout=60)
        for slot, env in enumerate(batch.env_id.tolist()):
            seen[env].append(batch.obs[slot].tobytes() + batch.reward[slot].tobytes())
        envs.send(first_legal(batch), env_id=batch.env_id)
    return {env: own[: steps + 1] for env, own in seen.items()}


def first_legal(batch: sp.Batch) -> NDArray[np.int32]:
    """The last available action of every agent: an attack, if one is available."""
    mask = batch.avail_actions
    last: NDArray[np.int32] = (mask.shape[2] - 1 - mask[:, :, ::-1].argmax(axis=2)).astype(np.int32)
    return last


def duel(allies: int = 2, unit: str = "ZEALOT", enemy_x: float = 12, name: str = "duel") -> dict[str, Any]:
    """A custom scenario: some allies of one unit type, and one enemy of the same type beside them."""
    return {
        "name": name,
        "num_allied_units": allies,
        "num_enemy_units": 1,
        "groups": [
            {"faction": "ALLY", "x": 9, "y": 16, "units": {unit: allies}},
            {"faction": "ENEMY", "x": enemy_x, "y": 16, "units": {unit: 1}},
        ],
        "attack_point": [9, 16],
        "terrain_preset": "SIMPLE",
        "num_unit_types": 0,
        "ally_has_shields": unit == "ZEALOT",
        "enemy_has_shields": unit == "ZEALOT",
    }
