"""TorchRL: the environments of a lane as one batched `EnvBase` (extra `torchrl`).

    from smaclite_pool.integrations.torchrl import PoolEnv

    env = PoolEnv("2s3z", num_envs=32)
    env.set_seed(1)
    episodes = env.rollout(50, break_when_any_done=False)   # TensorDict [32, 50]
    print(episodes["next", "reward"].sum())
    env.close()

Keys are those of TorchRL's multi-agent environments: ("agents", "observation"), ("agents", "action_mask") and
("agents", "action"), and for the team "state", "info", "reward", "done", "terminated" and "truncated" at the
root. Pass the mask to the policy (`MaskedCategorical`): an unavailable action raises IllegalAction, and
nothing is stepped. Random actions are available ones: `rollout` without a policy, `rand_action`, and
collectors whose policy is None. A finished environment waits for its reset, which collectors and
`step_and_maybe_reset` request by a `_reset` mask. With `snapshot` among `fields`, `save` and `restore` return
to an earlier state.

With `sides="both"`, the group "enemies" has an observation, an action_mask, an action and a reward of each
enemy: ("enemies", "reward") float32 [num_envs, n_enemies, 1], the same for all of them.
"""

from __future__ import annotations

from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._extra import extra
from .._layout import Bounds, field_bounds
from .._native import Batch, Envs, Renderer, make
from .._render import LaneViewer, check_rendering
from .._requirements import require_synchronous
from .._wrapper import Wrapper
from ..errors import InvalidRequest
from ._common import (
    ENEMY_FIELDS,
    INFO_FIELDS,
    OBSERVATION_KEYS,
    WAITS_FOR_RESET,
    Ends,
    check_keywords,
    refuse_settings,
    require_fields,
)

with extra("torchrl"):
    import torch
    from tensordict import TensorDict, TensorDictBase
    from torchrl.data import Binary, Bounded, Categorical, Composite, Unbounded
    from torchrl.data.utils import ACTION_SPACE_MAP
    from torchrl.envs import EnvBase

    from .torch import tensor

__all__ = ["PoolEnv"]


class AvailableActions(Categorical):
    """A `Categorical` whose copies have the same mask, not a copy of it, on any device.

    TorchRL copies the specification of an environment for transforms, for the random policy of collectors,
    and to move an environment to a device. With a mask of their own, copies would draw from the actions that
    were available when they were made.
    """

    def clone(self) -> AvailableActions:
        """A copy that draws what is available now, as the original."""
        return self._copy(self.device, self.dtype)

    def to(self, dest: torch.device | torch.dtype | str | int | None) -> AvailableActions:
        """The same on another device or with another dtype."""
        if dest is None:
            return self
        if isinstance(dest, torch.dtype):
            return self._copy(self.device, dest)
        return self._copy(torch.device(dest), self.dtype)

    def rand(self, shape: torch.Size | None = None) -> torch.Tensor:
        """Random available actions. The mask stays on the device on which it was made."""
        return super().rand(shape).to(self.device)

    def is_in(self, val: torch.Tensor) -> bool:
        """Whether all actions are available."""
        return bool(super().is_in(val.to(self.mask.device)))

    def _copy(self, device: torch.device, dtype: torch.dtype) -> AvailableActions:
        copy = AvailableActions(self.n, self.shape, device, dtype)
        copy.mask = self.mask
        return copy


# Q-learning asks for the kind of actions by the exact type.
ACTION_SPACE_MAP[AvailableActions] = "categorical"


class PoolEnv(EnvBase):
    """The environments of a lane with batch size [num_envs].

    Data is copied once, from shared memory to `device`. "info" contains battle_won, dead_allies,
    dead_enemies, episode_return and episode_length, each [num_envs]; those of them that the lane has. `reset`
    takes a `seed`, as `set_seed` before it: environment i is seeded with seed + i.

    Args:
        scenario: a standard scenario or the path of a scenario file, for a pool within this process; or
            environments of `smaclite_pool.connect`, which must be synchronous and have autoreset_mode
            "Disabled".
        num_envs: number of environments of a pool within this process; None for 64.
        device: the device of all tensors.
        render_mode: None; "rgb_array": `render()` returns pictures; "human": a window shows every step of all
            environments (needs pygame and a display). With a render mode, this object holds one batch.
        render_speed: of the window: 1 for the speed of the battle, two steps per second; 0.25 for slow
            motion; None for no waiting.
        renderer: how to draw; by default 256 x 256 pixels per environment.
        settings: `seed`, `threads`, `episode_limit` and other arguments of `smaclite_pool.make`, for a pool
            within this process, except `autoreset_mode`.

    Raises InvalidRequest for environments with other settings or without the fields `obs`, `state` and
    `avail_actions` (with both sides, those of the enemies too), and for `settings` with connected
    environments.
    """

    def __init__(
        self,
        scenario: str | PathLike[str] | Envs = "2s3z",
        num_envs: int | None = None,
        *,
        device: torch.device | str = "cpu",
        render_mode: str | None = None,
        render_speed: float | None = 1.0,
        renderer: Renderer | None = None,
        **settings: Any,
    ) -> None:
        check_keywords(type(self), settings, ["autoreset_mode"])
        check_rendering(render_mode, render_speed)
        envs: Any
        if isinstance(scenario, Envs | Wrapper):
            if num_envs not in (None, scenario.spec.num_envs):
                settings["num_envs"] = num_envs
            if settings:
                raise InvalidRequest(f"a running pool has its own settings; remove {', '.join(settings)}")
            envs = scenario
            self._check(envs)
        else:
            refuse_settings("an environment of TorchRL", {"autoreset_mode": WAITS_FOR_RESET}, settings)
            envs = make(scenario, 64 if num_envs is None else num_envs, autoreset_mode="Disabled", **settings)
            try:
                self._check(envs)
            except InvalidRequest:
                envs.close()
                raise
        super().__init__(device=torch.device(device), batch_size=torch.Size([envs.spec.num_envs]))
        self.envs = envs
        self.render_mode = render_mode
        self._viewer = LaneViewer(envs, render_mode, render_speed, renderer)
        self.group_map = {"agents": [f"agent_{agent}" for agent in range(envs.spec.n_agents)]}
        if envs.spec.sides != "allies":
            self.group_map["enemies"] = [f"enemy_{enemy}" for enemy in range(envs.spec.n_enemies)]
        self._next_seed: int | None = None
        self._snapshots: torch.Tensor | None = None
        self._make_specs()

    @staticmethod
    def _check(envs: Envs) -> None:
        require_synchronous(envs, "TorchRL", "Disabled")
        of_enemies = ENEMY_FIELDS if envs.spec.sides != "allies" else ()
        require_fields(envs, "TorchRL", [*OBSERVATION_KEYS.values(), *of_enemies])

    def _make_specs(self) -> None:
        count, device, envs = self.batch_size, self.device, self.envs
        self._info_fields = [name for name in INFO_FIELDS if name in envs.spec.fields]
        info = {name: self._scalar(self._dtype(name), count) for name in self._info_fields}
        bounds = field_bounds(envs)
        sizes = {
            "agents": (envs.spec.n_agents, bounds["obs"], envs.spec.n_actions),
            "enemies": (envs.spec.n_enemies, bounds["enemy_obs"], envs.spec.n_enemy_actions),
        }
        groups = {group: self._group_specs(*sizes[group]) for group in self.group_map}
        self._available = {group: actions["action"].mask for group, (_, actions) in groups.items()}
        self.observation_spec = Composite(
            **{group: observed for group, (observed, _) in groups.items()},
            state=Unbounded(
                torch.Size([*count, self.envs.spec.state_size]), device=device, dtype=torch.float32
            ),
            info=Composite(info, shape=count, device=device),
            shape=count,
            device=device,
        )
        actions = {group: actions for group, (_, actions) in groups.items()}
        self.full_action_spec = Composite(**actions, shape=count, device=device)
        column = torch.Size([*count, 1])
        rewards: dict[str, Any] = {"reward": self._scalar(self._dtype("reward"), column)}
        if "enemies" in groups:
            team = torch.Size([*count, envs.spec.n_enemies])
            of_each = self._scalar(self._dtype("enemy_reward"), torch.Size([*team, 1]))
            rewards["enemies"] = Composite(reward=of_each, shape=team, device=device)
        self.full_reward_spec = Composite(**rewards, shape=count, device=device)
        ends = {name: self._scalar(torch.bool, column) for name in ("done", "terminated", "truncated")}
        self.full_done_spec = Composite(ends, shape=count, device=device)

    def _group_specs(self, n_units: int, bounds: Bounds, n_actions: int) -> tuple[Composite, Composite]:
        """What the units of a group observe, and their actions."""
        team, device = torch.Size([*self.batch_size, n_units]), self.device
        low, high = (torch.from_numpy(bound).to(device) for bound in bounds)
        shape = torch.Size([*team, *low.shape])
        low, high = low.expand(shape).clone(), high.expand(shape).clone()
        # Numbers between infinite bounds cannot be drawn.
        observation = (
            Bounded(low, high, shape, device=device, dtype=torch.float32)
            if low.isfinite().all()
            else Unbounded(shape, device=device, dtype=torch.float32)
        )
        mask = Binary(shape=torch.Size([*team, n_actions]), device=device, dtype=torch.bool)
        action = AvailableActions(n_actions, team, device, torch.int64, mask.one())
        observed = Composite(observation=observation, action_mask=mask, shape=team, device=device)
        return observed, Composite(action=action, shape=team, device=device)

    def _dtype(self, field: str) -> torch.dtype:
        numpy_dtype, _ = self.envs.spec.fields[field]
        return torch.from_numpy(np.empty(0, numpy_dtype)).dtype

    def _scalar(self, dtype: torch.dtype, shape: torch.Size) -> Any:
        if dtype is torch.bool:
            # TorchRL counts the last axis of a `Binary` as part of the value, which could not be unbatched.
            return Categorical(2, shape, device=self.device, dtype=dtype)
        return Unbounded(shape, device=self.device, dtype=dtype)

    def _reset(self, tensordict: TensorDictBase | None = None, *, seed: int | None = None) -> TensorDictBase:
        mask = None if tensordict is None else tensordict.get("_reset", None)
        if mask is None or bool(mask.all()):
            batch = self.envs.reset(self._next_seed if seed is None else seed)
            self._next_seed = None
        else:
            batch = self.envs.reset(seed, mask.reshape(-1).cpu().numpy())
        self._viewer.observe(batch)
        return self._decode(batch)

    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        mask = tensordict.get("_step", None)
        if mask is not None and not bool(mask.all()):
            raise InvalidRequest(
                "PoolEnv steps all its environments, but `_step` leaves some out, as "
                "rollout(break_when_all_done=True) does: use break_when_any_done=False, which resets those "
                "that end, or SerialEnv with environments of one battle each"
            )
        given = {group: tensordict.get((group, "action"), None) for group in self.group_map}
        for group, actions in given.items():
            if actions is None:
                raise InvalidRequest(f'the TensorDict has no ("{group}", "action"), which a policy adds')
        each = [actions.detach().cpu() for actions in given.values()]
        batch = self.envs.step(torch.cat(each, dim=-1).contiguous().numpy())
        self._viewer.observe(batch)
        observed = self._decode(batch)
        observed.update(self._ends(batch.terminated, batch.truncated))
        observed["reward"] = self._field(batch, "reward").unsqueeze(-1)
        if "enemies" in self.group_map:
            team = (*self.batch_size, self.envs.spec.n_enemies, 1)
            observed["enemies", "reward"] = (
                self._field(batch, "enemy_reward")[:, None, None].expand(team).clone()
            )
        return observed

    def save(self) -> torch.Tensor:
        """The battles as they are now, uint8 [num_envs, snapshot_size], for `restore`.

        Raises InvalidRequest before the first reset, or if the lane has no field `snapshot`.
        """
        if "snapshot" not in self.envs.spec.fields:
            raise InvalidRequest("the lane has no snapshots: name the field `snapshot` among `fields`")
        if self._snapshots is None:
            raise InvalidRequest("no battle has begun; call reset first")
        return self._snapshots.clone()

    def restore(
        self, snapshots: torch.Tensor, env_id: ArrayLike | None = None, *, seed: int | None = None
    ) -> TensorDictBase:
        """Continue from snapshots, uint8 [K, snapshot_size], in all environments or those of `env_id`.

        Returns what `reset` returns; "done" is True where a battle has ended, before the snapshot or, in
        another environment, before the call. Without a seed the battles go on as they would have gone on;
        with one, environment i has the execution orders of seed + i. Raises InvalidRequest as `Envs.reset`,
        and if the lane omits dead_allies, dead_enemies, episode_length or snapshot.
        """
        require_fields(self.envs, "restore", Ends.FIELDS)
        batch = self.envs.reset(seed, env_id=env_id, snapshots=torch.as_tensor(snapshots).cpu().numpy())
        self._viewer.observe(batch)
        return self._decode(batch).update(self._ends(*Ends(self.envs)(batch)))

    def _ends(self, terminated: NDArray[np.bool_], truncated: NDArray[np.bool_]) -> dict[str, torch.Tensor]:
        each = {"done": terminated | truncated, "terminated": terminated, "truncated": truncated}
        return {name: torch.from_numpy(end[:, None].copy()).to(self.device) for name, end in each.items()}

    def _decode(self, batch: Batch) -> TensorDictBase:
        if "snapshot" in self.envs.spec.fields:
            self._snapshots = tensor(batch.snapshot).plain.clone()
        groups = {group: self._decode_group(batch, group) for group in self.group_map}
        info = {name: self._field(batch, name) for name in self._info_fields}
        return TensorDict(
            {
                **groups,
                "state": self._field(batch, "state"),
                "info": TensorDict(info, batch_size=self.batch_size, device=self.device),
            },
            batch_size=self.batch_size,
            device=self.device,
        )

    def _decode_group(self, batch: Batch, group: str) -> TensorDict:
        prefix = "enemy_" if group == "enemies" else ""
        mask = self._field(batch, f"{prefix}avail_actions")
        self._available[group].copy_(mask)  # for random actions
        observed = {"observation": self._field(batch, f"{prefix}obs"), "action_mask": mask}
        return TensorDict(observed, batch_size=mask.shape[:2], device=self.device)

    def _field(self, batch: Batch, name: str) -> torch.Tensor:
        """A copy of a field on the device; a rollout keeps more batches than `max_held_batches`."""
        return tensor(getattr(batch, name)).plain.to(self.device, copy=True)

    def render(self) -> NDArray[np.uint8] | None:
        """Pictures, uint8 [num_envs, 256, 256, 3], or all of them in a window with "human".

        Raises InvalidRequest before the first reset, and PoolError if a window is needed and pygame is not
        installed or there is no display.
        """
        pictures = self._viewer.render()
        return None if pictures is None else np.stack(pictures)

    def _set_seed(self, seed: int | None) -> None:
        self._next_seed = seed  # for the next reset of all environments

    def close(self, *, raise_if_closed: bool = True) -> None:
        """Close the environments and the window; this ends a pool within this process."""
        self._viewer.close()
        self.envs.close()
        super().close(raise_if_closed=raise_if_closed)
