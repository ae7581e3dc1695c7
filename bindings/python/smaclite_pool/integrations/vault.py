"""Vault: a dataset in the format of OG-MARL, through flashbax (extra `vault`).

    smaclite-pool dataset export 3m.smdata --to vault --out vaults/smaclite/smac_v1/3m.vlt --uid Good

flashbax, and with it OG-MARL, reads what this wrote:

    from flashbax.vault import Vault

    vault = Vault("3m.vlt", rel_dir="vaults/smaclite/smac_v1", vault_uid="Good")
    experience = vault.read().experience    # {"observations": float32 [1, T, n_agents, obs_size], ...}

The arrays are those of OG-MARL's datasets, with one axis more than here at the front, of length 1. T steps of
all episodes follow each other, A are agents:

| array | type and shape | here |
| --- | --- | --- |
| `observations` | float32 [1, T, A, obs_size] | `obs` |
| `actions` | int32 [1, T, A] | `actions` |
| `rewards` | float32 [1, T, A] | `reward`, for every agent |
| `terminals` | float32 [1, T, A] | `terminated`, for every agent |
| `truncations` | float32 [1, T, A] | `truncated`, for every agent |
| `infos.legals` | float32 [1, T, A, n_actions] | `avail_actions` |
| `infos.state` | float32 [1, T, state_size] | `state` |

An episode ends where `terminals` or `truncations` is 1, never both. The format has no observation after the
last step, so the value of a truncated episode's last state cannot be learnt from it.
"""

from __future__ import annotations

import contextlib
import io
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from .._extra import extra
from .._native import Dataset
from ..errors import InvalidRequest
from ._export import Arrays, complete, description, expanded, run

__all__ = ["experience", "export"]

STEPS_PER_WRITE = 1 << 16
"""Steps that are converted and written at a time."""


def experience(arrays: Arrays, begin: int, end: int) -> dict[str, Any]:
    """The steps from `begin` to `end` of a dataset's arrays, as OG-MARL names and shapes them."""
    actions = arrays["actions"][begin:end]

    def of_agents(name: str) -> Any:
        team = arrays[name][begin:end].astype(np.float32)
        return np.repeat(team[None, :, None], actions.shape[1], axis=2)

    return {
        "observations": arrays["obs"][None, begin:end],
        "actions": actions[None],
        "rewards": of_agents("reward"),
        "terminals": of_agents("terminated"),
        "truncations": of_agents("truncated"),
        "infos": {
            "legals": arrays["avail_actions"][None, begin:end].astype(np.float32),
            "state": arrays["state"][None, begin:end],
        },
    }


def export(file: str | PathLike[str], out: str | PathLike[str], uid: str) -> Path:
    """Write the dataset in `file` into a vault, and return its folder there.

    Args:
        file: a file of `smaclite-pool dataset record`.
        out: the folder of the vault, `NAME.vlt`; it may have datasets already.
        uid: the name of this one, such as `Good`; the vault must not have it.

    The folder appears when it is complete. Meanwhile, `out` has the expanded arrays too, in a temporary
    folder. Raises InvalidRequest for another name, PoolError and OSError as `Dataset`.
    """
    with extra("vault"):  # here, so that the command prints no traceback without it
        from flashbax.buffers.trajectory_buffer import TrajectoryBufferState
        from flashbax.vault import Vault

    folder = Path(out).resolve()
    if folder.suffix != ".vlt":
        raise InvalidRequest(f"the folder of a vault must end in .vlt, got `{out}`")
    if uid != Path(uid).name or uid.startswith("."):
        raise InvalidRequest(f"the uid must be the name of a folder, such as Good, got `{uid}`")
    if (folder / uid).exists():
        raise InvalidRequest(f"`{folder / uid}` exists; choose another uid")
    dataset = Dataset(file)
    folder.mkdir(parents=True, exist_ok=True)
    with expanded(dataset, folder) as (arrays, partial):
        n_steps, vault = len(arrays["actions"]), None
        for begin in range(0, n_steps, STEPS_PER_WRITE):
            end = min(begin + STEPS_PER_WRITE, n_steps)
            steps = experience(arrays, begin, end)
            if vault is None:
                with contextlib.redirect_stdout(io.StringIO()):  # advice to those who fill it while they play
                    metadata = {"smaclite_pool": description(dataset)}
                    vault = Vault("partial", steps, rel_dir=str(partial), vault_uid=uid, metadata=metadata)
            state = TrajectoryBufferState(experience=steps, current_index=end - begin, is_full=False)
            vault.write(state, source_interval=(0, end - begin))
        complete(partial / "partial" / uid, folder / uid)
    return folder / uid


def main() -> None:
    run("vault", export)


if __name__ == "__main__":
    main()
