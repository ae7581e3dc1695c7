"""TorchRL's face: a lane's environments as one batched `EnvBase` (extra `torchrl`).

    from smaclite_pool.torchrl import PoolEnv

    env = PoolEnv("2s3z", num_envs=32)
    env.set_seed(1)
    episodes = env.rollout(50, break_when_any_done=False)   # TensorDict [32, 50]
    print(episodes["next", "reward"].sum())
    env.close()

Keys are those of TorchRL's multi-agent environments: ("agents", "observation"), ("agents", "action_mask") and
("agents", "action"), the team's "state", "info", "reward", "done", "terminated" and "truncated" at the root. Give the
mask to the policy (`MaskedCategorical`, or `ActionMask` for random actions, which `rand_action` heeds by itself): an
unavailable action raises IllegalAction, and nothing is stepped. A finished environment waits for its reset, which
collectors and `step_and_maybe_reset` do by a `_reset` mask.
"""

from __future__ import annotations

from os import PathLike
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from torchrl.data import Binary, Bounded, Categorical, Composite, Unbounded
from torchrl.envs import EnvBase

from ._native import Batch, Envs, make
from .errors import InvalidRequest
from .torch import tensor

__all__ = ["PoolEnv"]

INFO = {
    "battle_won": torch.bool,
    "dead_allies": torch.int32,
    "dead_enemies": torch.int32,
    "episode_return": torch.float32,
    "episode_length": torch.int32,
}
"""Fields of a batch that go below "info", each [num_envs]."""


class PoolEnv(EnvBase):
    """The environments of a lane, batch size [num_envs]; their data is copied once, from shared memory to `device`.

    Args:
        scenario: a standard scenario or the path of a scenario file, for a pool within this process; or environments
            that were attached to by `smaclite_pool.connect`, synchronous and with autoreset "disabled".
        num_envs: environments of the pool within this process.
        device: where tensors go.
        settings: `seed`, `threads`, `episode_limit` and the like, as `smaclite_pool.make` takes them.
    """

    def __init__(
        self,
        scenario: str | PathLike[str] | Envs = "2s3z",
        num_envs: int = 64,
        *,
        device: torch.device | str = "cpu",
        **settings: Any,
    ) -> None:
        if isinstance(scenario, Envs):
            self._check(scenario, settings)
            envs = scenario
        else:
            envs = make(scenario, num_envs, autoreset="disabled", **settings)
        super().__init__(device=torch.device(device), batch_size=torch.Size([envs.num_envs]))
        self.envs = envs
        self.group_map = {"agents": [f"agent_{agent}" for agent in range(envs.n_agents)]}
        self._next_seed: int | None = None
        self._make_specs()

    @staticmethod
    def _check(envs: Envs, settings: dict[str, Any]) -> None:
        if settings:
            raise InvalidRequest(f"{', '.join(settings)}: a running pool has its settings already")
        if envs.autoreset != "disabled":
            raise InvalidRequest(f"autoreset is {envs.autoreset!r}: TorchRL resets by itself, serve with 'disabled'")
        if envs.batch_size != envs.num_envs:
            raise InvalidRequest(f"batches of {envs.batch_size} of {envs.num_envs} environments: TorchRL steps all")

    def _make_specs(self) -> None:
        count, agents, device = self.batch_size, self.envs.n_agents, self.device
        team = torch.Size([*count, agents])
        shape = torch.Size([*team, self.envs.obs_size])
        observation = Bounded(-1.0, 1.0, shape, device=device, dtype=torch.float32)
        mask = Binary(shape=torch.Size([*team, self.envs.n_actions]), device=device, dtype=torch.bool)
        action = Categorical(self.envs.n_actions, shape=team, device=device, dtype=torch.int64)
        info = {name: self._scalar(dtype, count) for name, dtype in INFO.items()}
        self.observation_spec = Composite(
            agents=Composite(observation=observation, action_mask=mask, shape=team, device=device),
            state=Unbounded(torch.Size([*count, self.envs.state_size]), device=device, dtype=torch.float32),
            info=Composite(info, shape=count, device=device),
            shape=count,
            device=device,
        )
        actions = Composite(action=action, shape=team, device=device)
        self.full_action_spec = Composite(agents=actions, shape=count, device=device)
        column = torch.Size([*count, 1])
        self.full_reward_spec = Composite(reward=self._scalar(torch.float32, column), shape=count, device=device)
        ends = {name: self._scalar(torch.bool, column) for name in ("done", "terminated", "truncated")}
        self.full_done_spec = Composite(ends, shape=count, device=device)

    def _scalar(self, dtype: torch.dtype, shape: torch.Size) -> Any:
        if dtype is torch.bool:
            return Binary(shape=shape, device=self.device, dtype=dtype)
        return Unbounded(shape, device=self.device, dtype=dtype)

    def _reset(self, tensordict: TensorDictBase | None = None, **_: Any) -> TensorDictBase:
        mask = None if tensordict is None else tensordict.get("_reset", None)
        if mask is None or bool(mask.all()):
            seed, self._next_seed = self._next_seed, None
            return self._seen(self.envs.reset(seed))
        return self._seen(self.envs.reset(mask=mask.reshape(-1).cpu().numpy()))

    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        actions = tensordict.get(("agents", "action")).to("cpu", torch.int32).contiguous()
        batch = self.envs.step(actions.numpy())
        seen = self._seen(batch)
        terminated, truncated = (self._own(batch, name).unsqueeze(-1) for name in ("terminated", "truncated"))
        ends = {"done": terminated | truncated, "terminated": terminated, "truncated": truncated}
        return seen.update({"reward": self._own(batch, "reward").unsqueeze(-1), **ends})

    def _seen(self, batch: Batch) -> TensorDictBase:
        mask = self._own(batch, "avail_actions")
        self.full_action_spec["agents", "action"].update_mask(mask)  # for random actions
        agents = {"observation": self._own(batch, "obs"), "action_mask": mask}
        team = torch.Size([*self.batch_size, self.envs.n_agents])
        info = {name: self._own(batch, name) for name in INFO}
        return TensorDict(
            {
                "agents": TensorDict(agents, batch_size=team, device=self.device),
                "state": self._own(batch, "state"),
                "info": TensorDict(info, batch_size=self.batch_size, device=self.device),
            },
            batch_size=self.batch_size,
            device=self.device,
        )

    def _own(self, batch: Batch, name: str) -> torch.Tensor:
        """A field on the environment's device: a rollout keeps more batches than a lane lets a learner hold."""
        return tensor(getattr(batch, name)).plain.to(self.device, copy=True)

    def _set_seed(self, seed: int | None) -> None:
        self._next_seed = seed  # taken by the next reset of all environments

    def close(self, *, raise_if_closed: bool = True) -> None:
        """Gives the lane back; a pool within this process ends."""
        self.envs.close()
        super().close(raise_if_closed=raise_if_closed)
