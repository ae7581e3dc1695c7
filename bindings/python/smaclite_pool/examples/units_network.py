"""Networks over units in PyTorch: `--network units` of ppo.py and value_decomposition.py.

A flat network has weights of its own for each feature of each unit. Here all enemies go through the same
layers, and so do all allies: what is learnt of one holds for all, and their order does not matter (deep sets;
Zaheer et al., 2017). An input has a row x_i for each unit i of each kind k, enemies and allies, and the rest
y, which belongs to no other unit. With layers written as functions by their names, and f the non-linearity,

- o = own(y), the own embedding,
- e_i = f(k.1(f(k.0(x_i) + o))) for each unit that is seen, its embedding,
- p = (f(o), for each kind the sum of the e_i and their maximum), zeros where no unit is seen,
- t = f(trunk.1(f(trunk.0(p)))), the trunk,
- head(t): a number per action that targets no unit, or the value of a critic,
- k.target.score(f(k.target.unit(e_i) + k.target.trunk(t))): the number of the action that targets unit i.

Rows of units that are dead or not seen have zeros only. They do not enter sums and maxima, and as targets
they have e_i = 0. An agent's targets are enemies, or allies if it heals. Agents share all weights.

Computation, distribution of the first weights, names and shapes are those of `smaclite-pool train --network
units` (bindings/learn/src/units_network.rs). Change this file to try what that does not offer, such as
attention: from top to bottom, where inputs have which unit, the layers of a kind, targets, the network.

Axes of arrays: S inputs, n units of a kind, R units that are seen, A agents, W the width of embeddings, H the
width of the trunk.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import smaclite_pool as sp
from smaclite_pool.examples.options import extra
from smaclite_pool.types import LayoutPart, Scenario

with extra("torch"):
    import torch
    from torch import Tensor, nn
    from torch.nn import functional as F

KINDS = ("enemies", "allies")
KIND_OF = {"enemies": "enemies", "allies": "allies", "agents": "allies", "last_action": "allies"}
"""The kind of the units whose rows a part of an observation or of the state has."""

Columns = list[tuple[int, int, int]]
"""Parts of an input: where it starts, how many rows it has, and how wide they are. A row of a unit consists
of its rows of all parts: in the state, the last actions of agents stand behind all units."""

Activation = Callable[[Tensor], Tensor]


def columns_by_kind(layout: list[LayoutPart], size: int) -> dict[str, Columns]:
    """Which of the `size` columns of an input belong to enemies, to allies, and to the rest."""
    columns: dict[str, Columns] = {kind: [] for kind in (*KINDS, "rest")}
    end = 0
    for part in layout:
        *rows, width = part["shape"]
        kind, n = (KIND_OF[part["name"]], rows[0]) if rows else ("rest", 1)
        columns[kind].append((part["start"], n, width))
        end = part["start"] + n * width
    columns["rest"].append((end, 1, size - end))  # what environments append, such as last actions, or nothing
    return columns


def rows_of(x: Tensor, columns: Columns) -> Tensor:
    """The rows [S, n, width] in these columns of inputs [S, size]."""
    parts = [x[:, start : start + n * width].unflatten(1, (n, width)) for start, n, width in columns]
    return torch.cat(parts, -1)


def row_width(columns: Columns) -> int:
    return sum(width for _, _, width in columns)


def linear(n_in: int, n_out: int, gain: float, bias: bool = True) -> nn.Linear:
    """A layer whose first weights are orthogonal. The gain is sqrt(2) before a non-linearity, as ReLU drops
    half of the square of what it gets. Where two layers are added, 1 gives each of them half of that."""
    layer = nn.Linear(n_in, n_out, bias)
    nn.init.orthogonal_(layer.weight, gain)
    if bias:
        nn.init.zeros_(layer.bias)
    return layer


class Bias(nn.Module):
    """What a layer is without inputs."""

    def __init__(self, n_out: int) -> None:
        super().__init__()
        self.bias = nn.Parameter(torch.zeros(n_out))

    def forward(self, x: Tensor) -> Tensor:
        return self.bias.expand(len(x), -1)


class Seen(NamedTuple):
    """The R units of a kind that are seen. Those that are dead or far away are left out, and cost nothing."""

    mask: Tensor
    """[S, n]: which they are."""
    inputs: Tensor
    """[R]: the input of each."""
    embeddings: Tensor
    """[R, W]."""


class Units(nn.ModuleDict):
    """The layers of a kind of units, with those of a target if there is a gain for its last one."""

    target: nn.ModuleDict

    def __init__(
        self, columns: Columns, widths: list[int], gain: float | None, activation: Activation
    ) -> None:
        width, trunk_width = widths
        super().__init__({"0": linear(row_width(columns), width, 1.0), "1": linear(width, width, 2**0.5)})
        self.columns, self.activation = columns, activation
        if gain is not None:
            unit, trunk = linear(width, width, 1.0, bias=False), linear(trunk_width, width, 1.0)
            self.target = nn.ModuleDict({"unit": unit, "trunk": trunk, "score": linear(width, 1, gain)})

    def see(self, x: Tensor, own: Tensor) -> Seen:
        """From inputs [S, size] and own embeddings [S, W]."""
        rows, f = rows_of(x, self.columns), self.activation
        # The first part decides: the last action of a dead agent is not zeros.
        mask = (rows[..., : self.columns[0][2]] != 0).any(-1)
        inputs = mask.nonzero()[:, 0]
        first = f(self["0"](rows[mask]) + own.index_select(0, inputs))
        return Seen(mask, inputs, f(self["1"](first)))

    def scores(self, seen: Seen, trunk: Tensor) -> Tensor:
        """The number of the action that targets each unit, and then one that is not seen, [S, n + 1]."""
        layers, f = self.target, self.activation
        of_trunk = layers["trunk"](trunk)
        of_units = layers["unit"](seen.embeddings) + of_trunk.index_select(0, seen.inputs)
        scores = layers["score"](f(of_trunk)).expand(-1, seen.mask.shape[1] + 1)
        return scores.masked_scatter(F.pad(seen.mask, (0, 1)), layers["score"](f(of_units)))


def sums_and_maxima(seen: Seen) -> list[Tensor]:
    """Of the embeddings that belong to an input, [S, W] each, zeros where no unit is seen."""
    embeddings, inputs = seen.embeddings, seen.inputs
    zeros = embeddings.new_zeros(len(seen.mask), embeddings.shape[1])
    index = inputs.unsqueeze(-1).expand_as(embeddings)
    maxima = zeros.scatter_reduce(0, index, embeddings, "amax", include_self=False)
    return [zeros.index_add(0, inputs, embeddings), maxima]


def has_units(scenario: Scenario) -> bool:
    """Whether observations have rows of units; without `obs_starcraft` of `smacv2` they have none."""
    return any(part["name"] == "enemies" for part in scenario["obs_layout"])


class Targets(nn.Module):
    """Which units the actions of agents target."""

    enemies: Tensor
    """[A, targets]: the row of the target; that behind the last one stands for a unit that is not seen."""
    allies: Tensor
    """The same, if the agent heals."""
    healers: Tensor
    """[A]: who heals, where observations have no types."""

    def __init__(self, scenario: Scenario) -> None:
        super().__init__()
        parts = {part["name"]: part for part in scenario["obs_layout"]}
        if not has_units(scenario):
            accepted = "`flat` where observations have no units (`obs_starcraft` of `smacv2` is false)"
            raise sp.errors.InvalidRequest(f"network must be {accepted}, got `units`")
        actions, n_agents = scenario["actions"], len(scenario["allies"])
        self.first = sum(not name.startswith("target_") for name in actions)
        target, agent = torch.arange(len(actions) - self.first), torch.arange(n_agents).unsqueeze(-1)
        enemies = target.expand(n_agents, -1).clamp(max=len(scenario["enemies"]))
        # An agent's observation has rows of all allies but itself.
        allies = torch.where(target == agent, n_agents, target - (target > agent).long())

        own, start = parts["own"]["features"], parts["own"]["start"]
        types = [
            f"type_{unit_type['type_id']}" for unit_type in scenario["unit_types"] if unit_type["healer"]
        ]
        self.heals = [start + i for i, name in enumerate(own) if name in types]
        """The columns of an observation that say that the agent heals."""
        is_known = not (scenario["teams_are_drawn"] or any(name.startswith("type_") for name in own))
        healers = torch.tensor([is_known and unit["healer"] for unit in scenario["allies"]])
        self.has_healers = n_agents > 1 and bool(self.heals or healers.any())
        self.register_buffer("enemies", enemies, persistent=False)
        self.register_buffer("allies", allies.clamp(max=n_agents - 1), persistent=False)
        self.register_buffer("healers", healers, persistent=False)

    def heal(self, x: Tensor, agents: Tensor) -> Tensor:
        """[S]: whether the agents of observations [S, size] heal."""
        return (x[:, self.heals] != 0).any(-1) | self.healers[agents]


class UnitsNetwork(nn.Module):
    """An actor; without targets, a critic.

    Args:
        columns: where inputs have which unit.
        widths: of embeddings and of the trunk.
        gain: of the last layers.
        activation: the non-linearity.
        targets: what actions target.
    """

    enemies: Units
    allies: Units

    def __init__(
        self,
        columns: dict[str, Columns],
        widths: list[int],
        gain: float,
        activation: Activation,
        targets: Targets | None = None,
    ) -> None:
        super().__init__()
        if len(widths) != 2:
            raise sp.errors.InvalidRequest(f"hidden must be 2 widths for networks over units, got {widths}")
        width, trunk_width = widths
        self.rest, self.activation, self.targets = columns["rest"], activation, targets
        n_rest = row_width(self.rest)  # none in the state, whose features all belong to units
        self.own = linear(n_rest, width, 1.0) if n_rest > 0 else Bias(width)
        self.kinds = [kind for kind in KINDS if any(n > 0 for _, n, _ in columns[kind])]
        for kind in self.kinds:
            is_target = targets is not None and (kind == "enemies" or targets.has_healers)
            setattr(self, kind, Units(columns[kind], widths, gain if is_target else None, activation))
        pooled = width * (1 + 2 * len(self.kinds))
        self.trunk = nn.ModuleList(linear(n_in, trunk_width, 2**0.5) for n_in in (pooled, trunk_width))
        self.head = linear(trunk_width, 1 if targets is None else targets.first, gain)

    def forward(self, x: Tensor, agents: Tensor) -> Tensor:
        """Of inputs [..., size]; `agents` has the agent of each, and a critic does not use it."""
        inputs = x.flatten(0, -2)
        if self.targets is not None:
            agents = agents.expand(x.shape[:-1]).flatten()
        return self.outputs(inputs, agents, *self.read(inputs)).unflatten(0, x.shape[:-1])

    def read(self, x: Tensor) -> tuple[Tensor, dict[str, Seen]]:
        """From inputs [S, size] to the trunk [S, H] and the units that are seen, by kind."""
        own = self.own(rows_of(x, self.rest).squeeze(1))
        seen = {kind: getattr(self, kind).see(x, own) for kind in self.kinds}
        pooled = [part for of_kind in seen.values() for part in sums_and_maxima(of_kind)]
        trunk = torch.cat([self.activation(own), *pooled], -1)
        for layer in self.trunk:
            trunk = self.activation(layer(trunk))
        return trunk, seen

    def outputs(self, x: Tensor, agents: Tensor, trunk: Tensor, seen: dict[str, Seen]) -> Tensor:
        """From what was read to a number per action, or a value, [S, outputs]."""
        targets, outputs = self.targets, [self.head(trunk)]
        if targets is not None:
            scores = self.enemies.scores(seen["enemies"], trunk).gather(1, targets.enemies[agents])
            if targets.has_healers:
                of_allies = self.allies.scores(seen["allies"], trunk).gather(1, targets.allies[agents])
                scores = torch.where(targets.heal(x, agents).unsqueeze(-1), of_allies, scores)
            outputs.append(scores)
        return torch.cat(outputs, -1)


def actor(envs: sp.Envs, widths: list[int], gain: float, activation: Activation) -> UnitsNetwork:
    """From an agent's observation to a number per action."""
    scenario = sp.scenario(envs)
    columns = columns_by_kind(scenario["obs_layout"], envs.spec.obs_size)
    return UnitsNetwork(columns, widths, gain, activation, Targets(scenario))


def critic(envs: sp.Envs, widths: list[int], sees_state: bool, activation: Activation) -> UnitsNetwork:
    """From the state, or an agent's observation, to a value."""
    scenario = sp.scenario(envs)
    layout, size = scenario["obs_layout"], envs.spec.obs_size
    if sees_state:
        layout, size = scenario["state_layout"], envs.spec.state_size
    return UnitsNetwork(columns_by_kind(layout, size), widths, 1.0, activation)
