"""Minari: a dataset in the format of Minari, as single battles of Gymnasium have it (extra `minari`).

    smaclite-pool dataset export 3m.smdata --to minari --out minari --uid smaclite/3m/good-v0

Minari looks for datasets in the folder that the variable MINARI_DATASETS_PATH names:

    import os

    os.environ["MINARI_DATASETS_PATH"] = "minari"
    import minari

    dataset = minari.load_dataset("smaclite/3m/good-v0")
    episode = dataset[0]
    print(episode.observations["obs"].shape)    # (T + 1, n_agents, obs_size)

Minari knows one agent, so the agents are an axis. Observations and actions are those of `BattleEnv` in
`smaclite_pool.integrations.gymnasium`: a dict of `obs` float32 [n_agents, obs_size], `state` float32
[state_size] and `action_mask` int8 [n_agents, n_actions]; int32 [n_agents]. An episode of T steps has T + 1
observations, and T of `actions`, `rewards`, `terminations` and `truncations`. `infos` has `battle_won`, with
T + 1 entries like the observations, and the metadata of an episode its seed. `recover_environment()` makes
the environment, if the battles are those of a standard scenario.
"""

from __future__ import annotations

import copy
import importlib
import os
import re
import shutil
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from .._extra import extra
from .._layout import Bounds, layout_bounds
from .._native import DATASET_ARRAYS, Dataset, make, scenario
from ..errors import InvalidRequest
from ._export import Arrays, complete, description, expanded, run

__all__ = ["export"]

CODE = "https://github.com/smaclite-pool/smaclite-pool"


def episode(episodes: Arrays, arrays: Arrays, i: int) -> dict[str, Any]:
    """The data of episode `i`, as Minari's `EpisodeBuffer` has it."""
    start = episodes["start"][i]
    steps = slice(start, start + episodes["length"][i])

    def observations(name: str, dtype: Any) -> Any:
        return np.concatenate([arrays[name][steps], arrays[f"final_{name}"][i : i + 1]]).astype(dtype)

    return {
        "id": i,
        "seed": episodes["seed"][i],
        "observations": {
            "obs": observations("obs", np.float32),
            "state": observations("state", np.float32),
            "action_mask": observations("avail_actions", np.int8),
        },
        "actions": arrays["actions"][steps],
        "rewards": arrays["reward"][steps],
        "terminations": arrays["terminated"][steps],
        "truncations": arrays["truncated"][steps],
        "infos": {"battle_won": np.concatenate([[False], arrays["battle_won"][steps]])},
    }


def export(file: str | PathLike[str], out: str | PathLike[str], uid: str) -> Path:
    """Write the dataset in `file` for Minari, and return its folder.

    Args:
        file: a file of `smaclite-pool dataset record`.
        out: the folder of all datasets of Minari, as MINARI_DATASETS_PATH names it.
        uid: the id of this one, such as `smaclite/3m/good-v0`; there must be no dataset with it.

    The folder appears when it is complete. Meanwhile, `out` has the expanded arrays too, in a temporary
    folder. Raises InvalidRequest for another id, PoolError and OSError as `Dataset`.
    """
    with extra("minari"):  # here, so that the command prints no traceback without it
        # Minari needs them for its files, and imports them late.
        import h5py  # noqa: F401
        import PIL.Image  # noqa: F401
        from minari import create_dataset_from_buffers
        from minari.data_collector import EpisodeBuffer
        from minari.dataset.minari_dataset import parse_dataset_id

    root = Path(out).resolve()
    try:
        if not re.fullmatch(r"([\w-]+/)*[\w-]+-v\d+", uid):
            raise ValueError
        parse_dataset_id(uid)
    except ValueError as error:
        why = f": {error}" if error.args else ""
        raise InvalidRequest(f"the id must be like smaclite/3m/good-v0, got `{uid}`{why}") from None
    if (root / uid).exists():
        raise InvalidRequest(f"`{root / uid}` exists; choose another id, such as a higher version")
    dataset = Dataset(file)
    root.mkdir(parents=True, exist_ok=True)
    with expanded(dataset, root) as (arrays, partial), datasets_in(partial):
        episodes = dataset.episodes
        buffers = (EpisodeBuffer(**episode(episodes, arrays, i)) for i in range(len(episodes["start"])))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # advice about authors and environments
            written = create_dataset_from_buffers(
                uid,
                buffers,
                **environment(dataset),
                algorithm_name=", ".join(policy["name"] for policy in dataset.card["policies"]),
                code_permalink=CODE,
                requirements=["smaclite-pool[gymnasium]"],
            )
        written.storage.update_metadata({"smaclite_pool": description(dataset)})
        for file in partial.rglob("namespace_metadata.json"):
            there = root / file.relative_to(partial)
            if not there.exists():
                there.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(file, there)
        complete(partial / uid, root / uid)
    return root / uid


def environment(dataset: Dataset) -> dict[str, Any]:
    """The environment of the battles for Minari: its spaces and, if Gymnasium can make it, how."""
    import gymnasium

    from ._spaces import action_space, observation_space

    sizes: dict[str, Any] = {**dataset.card["sizes"]}
    fields = {
        name: (np.dtype(dtype), [sizes[axis] for axis in axes.split(", ")[1:]])
        for name, dtype, axes, _ in DATASET_ARRAYS
    }
    bounds: dict[str, Bounds] = {}
    if dataset.scenario is not None:
        # By its settings: the bounds depend on the rules, too, and a name alone has those of `smaclite`.
        with make(dataset.scenario, num_envs=1, **dataset.settings) as envs:
            info = scenario(envs)
        bounds["obs"] = layout_bounds(info["obs_layout"], sizes["obs_size"])
        bounds["state"] = layout_bounds(info["state_layout"], sizes["state_size"])
    found: dict[str, Any] = {
        "observation_space": observation_space(fields, bounds),
        "action_space": action_space(sizes["n_agents"], sizes["n_actions"]),
    }
    if dataset.scenario is not None:
        importlib.import_module("smaclite_pool.integrations.gymnasium")  # registers the ids
        spec = copy.deepcopy(gymnasium.spec(f"smaclite_pool/{dataset.scenario}-v0"))
        spec.kwargs.update(dataset.settings)
        found["env"] = spec
    return found


@contextmanager
def datasets_in(folder: Path) -> Iterator[None]:
    """Let Minari write into `folder`."""
    name = "MINARI_DATASETS_PATH"
    before = os.environ.get(name)
    os.environ[name] = str(folder)
    try:
        yield
    finally:
        if before is None:
            del os.environ[name]
        else:
            os.environ[name] = before


def main() -> None:
    run("minari", export)


if __name__ == "__main__":
    main()
