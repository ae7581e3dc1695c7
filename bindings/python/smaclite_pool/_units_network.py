"""The actor of `smaclite-pool train --network units` in NumPy: the same weights for every enemy, and for
every ally. The learner's `units_network.rs` derives what is computed here."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float32]


class UnitsNetwork:
    """From observations to a number per action.

    Args:
        tensors: the weights, by name.
        layout: which columns of an observation belong to which unit, as `read_team` says it.
        targets: which actions target which unit, and which agents heal, from the same.
        hidden: the non-linearity.
    """

    def __init__(
        self,
        tensors: dict[str, Array],
        layout: dict[str, Any],
        targets: dict[str, Any],
        hidden: Callable[[Array], Array],
    ) -> None:
        self._tensors, self._hidden = tensors, hidden
        self._kinds = {kind: layout[kind] for kind in ("enemies", "allies") if layout[kind]["count"]}
        self._rest = np.concatenate([np.arange(part["start"], part["end"]) for part in layout["rest"]])
        self._targets = targets

    def __call__(self, obs: Array) -> Array:
        own = self._layer("own", obs[..., self._rest])
        pooled, embeddings = [self._hidden(own)], {}
        for kind, rows in self._kinds.items():
            x = obs[..., _columns(rows)]
            seen = (x[..., : rows["parts"][0][1]] != 0).any(-1, keepdims=True)
            first = self._hidden(self._layer(f"{kind}.0", x) + own[..., None, :])
            embedding = self._hidden(self._layer(f"{kind}.1", first))
            # Zeros for units that are not seen, and one row of zeros more, for targets that have none.
            none = np.zeros_like(embedding[..., :1, :])
            embeddings[kind] = np.concatenate([np.where(seen, embedding, np.float32(0)), none], axis=-2)
            largest = np.where(seen, embedding, np.float32(-np.inf)).max(-2)
            pooled += [embeddings[kind].sum(-2), np.where(seen.any(-2), largest, np.float32(0))]
        trunk = self._hidden(self._layer("trunk.0", np.concatenate(pooled, -1)))
        trunk = self._hidden(self._layer("trunk.1", trunk))
        return np.concatenate([self._layer("head", trunk), self._scores(obs, trunk, embeddings)], -1)

    def _scores(self, obs: Array, trunk: Array, embeddings: dict[str, Array]) -> Array:
        """The numbers of the actions that target a unit."""
        agents, numbers = np.arange(obs.shape[-2])[:, None], np.arange(self._targets["count"])[None, :]
        scores = np.zeros((*obs.shape[:-1], self._targets["count"]), np.float32)
        heals = (obs[..., self._targets["heals"]] != 0).any(-1)
        heals |= np.isin(agents[:, 0], self._targets["healers"])
        rows = {
            "enemies": np.broadcast_to(numbers, (len(agents), numbers.size)),
            # An agent has rows of all allies but itself.
            "allies": np.where(numbers == agents, len(agents), numbers - (numbers > agents)),
        }
        for kind, embedding in embeddings.items():
            if f"{kind}.target.unit.weight" in self._tensors:
                row = np.minimum(rows[kind], embedding.shape[-2] - 1)  # the last one has zeros
                unit = np.take_along_axis(embedding, row[None, :, :, None], -2)
                hidden = unit @ self._tensors[f"{kind}.target.unit.weight"].T
                hidden = self._hidden(hidden + self._layer(f"{kind}.target.trunk", trunk)[..., None, :])
                of_kind = self._layer(f"{kind}.target.score", hidden)[..., 0]
                scores = np.where((heals == (kind == "allies"))[..., None], of_kind, scores)
        return scores

    def _layer(self, name: str, x: Array) -> Array:
        return x @ self._tensors[f"{name}.weight"].T + self._tensors[f"{name}.bias"]


def _columns(rows: dict[str, Any]) -> NDArray[np.intp]:
    """The columns of every row of a kind, [count, width]."""
    units = np.arange(rows["count"])[:, None]
    parts = [start + units * width + np.arange(width) for start, width in rows["parts"]]
    return np.concatenate(parts, axis=1)
