# Written by hand, because generated stubs lack the element types of arrays. `mypy.stubtest` checks that
# names, parameters and defaults match the module. Full docstrings are in the module.

from collections.abc import Mapping, Sequence
from enum import Enum
from os import PathLike
from types import TracebackType
from typing import Any, Final, Literal, NoReturn, TypedDict, TypeVar, final, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import Unpack

from ._spec import LaneSpec
from ._wrapper import Wrapper
from .types import DatasetCard, PoolStatus, RewardOptions, Scenario

__all__ = [
    "DATASET_ARRAYS",
    "EAST",
    "FIRST_TARGET",
    "NORTH",
    "NO_OP",
    "OPPONENTS",
    "REWARD_DEFAULTS",
    "SNAPSHOT_COLUMNS",
    "SOUTH",
    "STOP",
    "WEST",
    "ZOO",
    "Batch",
    "CapabilityBattle",
    "Dataset",
    "Envs",
    "Frame",
    "Recorder",
    "Renderer",
    "ScriptedPolicy",
    "Spectator",
    "TeamNetwork",
    "__version__",
    "check_settings",
    "connect",
    "make",
    "pack_snapshot",
    "pools",
    "read_team",
    "run_program",
    "scenario",
    "scenarios",
    "snapshot_columns",
    "status",
]

__version__: str

# Numbers of the actions of an agent.
NO_OP: Final[int]
STOP: Final[int]
NORTH: Final[int]
SOUTH: Final[int]
EAST: Final[int]
WEST: Final[int]
FIRST_TARGET: Final[int]

# Name, dtype, shape and meaning.
SNAPSHOT_COLUMNS: list[tuple[str, str, str, str]]
DATASET_ARRAYS: list[tuple[str, str, str, str]]
OPPONENTS: tuple[str, ...]
ZOO: tuple[str, ...]

# The rewards of a scenario that has no others.
REWARD_DEFAULTS: Final[RewardOptions]

_Wait = Literal["adaptive", "spin", "block"]
_Autoreset = Literal["NextStep", "SameStep", "Disabled"]
_Policy = Literal["random", "nearest", "focus_fire", "kite", "hold", "line", "flank", "escort", "spread"]
_Rules = Literal["smaclite", "paper", "starcraft", "starcraft-1"]
_Sides = Literal["allies", "both", "mirrored"]
_Default = TypeVar("_Default")

_Item = TypeVar("_Item")
_List = list[_Item] | tuple[_Item, ...] | NDArray[Any]

class _Battle(TypedDict, total=False):
    """Keys of scenario files."""

    num_allied_units: int | None
    num_enemy_units: int | None
    groups: list[dict[str, Any]] | None
    teams: dict[str, Any] | None
    start_positions: dict[str, Any] | None
    attack_point: _List[float] | None
    march_to: Literal["AGENTS"] | _List[_List[float]] | None
    terrain_preset: str | None
    terrain: _List[str] | _List[_List[str]] | None
    width: int | None
    height: int | None
    terrain_height: _List[_List[int]] | None
    num_unit_types: int | None
    unit_type_ids: dict[str, int] | None
    ally_has_shields: bool | None
    enemy_has_shields: bool | None
    smacv2: dict[str, Any] | None
    rewards: dict[str, Any] | None

@final
class Frame:
    """The shared memory of one batch: the base object of its arrays."""

    @property
    def sequence(self) -> int: ...

@final
class Batch:
    """The results of M environments, one per slot; every field is a read-only array over shared memory."""

    @property
    def env_id(self) -> NDArray[np.int32]:
        """int32 [M]: id of the slot's environment."""
    @property
    def obs(self) -> NDArray[np.float32]:
        """float32 [M, n_agents, obs_size]: observation of each agent; zeros for dead agents."""
    @property
    def state(self) -> NDArray[np.float32]:
        """float32 [M, state_size]: global state, for training only."""
    @property
    def avail_actions(self) -> NDArray[np.bool_]:
        """bool [M, n_agents, n_actions]: which actions are available in the next step."""
    @property
    def alive(self) -> NDArray[np.bool_]:
        """bool [M, n_agents]: which agents are alive."""
    @property
    def reward(self) -> NDArray[np.float32]:
        """float32 [M]: team reward of the step just made."""
    @property
    def terminated(self) -> NDArray[np.bool_]:
        """bool [M]: the step ended the battle: one side is dead; with SMACv2's interface, all but healers."""
    @property
    def truncated(self) -> NDArray[np.bool_]:
        """bool [M]: the step reached the episode limit with both sides alive."""
    @property
    def battle_won(self) -> NDArray[np.bool_]:
        """bool [M]: the step ended the battle and the agents won: all enemies are dead."""
    @property
    def dead_allies(self) -> NDArray[np.int32]:
        """int32 [M]: agents that died so far in the episode."""
    @property
    def dead_enemies(self) -> NDArray[np.int32]:
        """int32 [M]: enemies that died so far in the episode."""
    @property
    def episode_return(self) -> NDArray[np.float32]:
        """float32 [M]: sum of rewards so far; on an episode's last step its total."""
    @property
    def episode_length(self) -> NDArray[np.int32]:
        """int32 [M]: steps so far; on an episode's last step its total."""
    @property
    def final_obs(self) -> NDArray[np.float32]:
        """float32 [M, n_agents, obs_size]: same-step autoreset: last obs of an episode that ended."""
    @property
    def final_state(self) -> NDArray[np.float32]:
        """float32 [M, state_size]: same-step autoreset: last state, as final_obs."""
    @property
    def final_avail_actions(self) -> NDArray[np.bool_]:
        """bool [M, n_agents, n_actions]: same-step autoreset: last avail_actions, as final_obs."""
    @property
    def sequence(self) -> int:
        """Number of this batch among all that the lane has sent, from 1."""
    @property
    def was_reset(self) -> NDArray[np.bool_]:
        """bool [M]: no step was made: the environment was reset, restored or only observed again."""
    @property
    def snapshot(self) -> NDArray[np.uint8]:
        """uint8 [M, snapshot_size]: the battle as bytes, for `Envs.reset`; lanes must name this field."""
    @property
    def opponent(self) -> NDArray[np.int32]:
        """int32 [M]: what plays the enemies, an index in `OPPONENTS`; lanes must name this field."""
    @property
    def level(self) -> NDArray[np.float32]:
        """float32 [M, n_units, 5]: how the episode of `obs` began; lanes must name this field."""
    @property
    def reward_agents(self) -> NDArray[np.float32]:
        """float32 [M, n_agents]: share of each agent in `reward`; lanes must name this field."""
    @property
    def enemy_obs(self) -> NDArray[np.float32]:
        """float32 [M, n_enemies, enemy_obs_size]: both sides: observation of each enemy."""
    @property
    def enemy_state(self) -> NDArray[np.float32]:
        """float32 [M, enemy_state_size]: both sides: global state from the enemies' side."""
    @property
    def enemy_avail_actions(self) -> NDArray[np.bool_]:
        """bool [M, n_enemies, n_enemy_actions]: both sides: available actions of enemies."""
    @property
    def enemy_alive(self) -> NDArray[np.bool_]:
        """bool [M, n_enemies]: both sides: which enemies are alive and played by actions."""
    @property
    def enemy_reward(self) -> NDArray[np.float32]:
        """float32 [M]: both sides: the enemies' reward of the step just made."""
    @property
    def enemy_reward_agents(self) -> NDArray[np.float32]:
        """float32 [M, n_enemies]: share of each enemy in `enemy_reward`; lanes must name this field."""
    @property
    def final_enemy_obs(self) -> NDArray[np.float32]:
        """float32 [M, n_enemies, enemy_obs_size]: last enemy_obs, as final_obs."""
    @property
    def final_enemy_state(self) -> NDArray[np.float32]:
        """float32 [M, enemy_state_size]: last enemy_state, as final_obs."""
    @property
    def final_enemy_avail_actions(self) -> NDArray[np.bool_]:
        """bool [M, n_enemies, n_enemy_actions]: last enemy_avail_actions, as final_obs."""
    def keys(self) -> list[str]: ...
    def values(self) -> list[NDArray[Any]]: ...
    def items(self) -> list[tuple[str, NDArray[Any]]]: ...
    @overload
    def get(self, name: str, default: None = None, /) -> NDArray[Any] | None: ...
    @overload
    def get(self, name: str, default: _Default, /) -> NDArray[Any] | _Default: ...
    def replace(self, **fields: ArrayLike) -> Batch:
        """Return a batch with other arrays in some fields."""
    def copy(self) -> dict[str, NDArray[Any]]: ...
    def torch(self) -> dict[str, Any]:
        """Return a dict from field names to torch tensors over the same memory. Writing to one raises."""
    def __getitem__(self, name: str, /) -> NDArray[Any]:
        """A field by its name."""
    def __contains__(self, name: object, /) -> bool: ...
    def __iter__(self) -> NoReturn: ...
    def __len__(self) -> int: ...

@final
class Envs:
    """The environments of a lane, as returned by `make` and `connect`."""

    def __len__(self) -> int: ...
    def reset(
        self,
        seed: int | Sequence[int | None] | NDArray[np.integer[Any]] | None = None,
        env_id: ArrayLike | None = None,
        timeout: float | None = None,
        *,
        levels: ArrayLike | None = None,
        snapshots: NDArray[np.uint8] | None = None,
    ) -> Batch: ...
    def step(
        self, actions: ArrayLike, env_id: ArrayLike | None = None, timeout: float | None = None
    ) -> Batch: ...
    def send(self, actions: ArrayLike, env_id: ArrayLike | None = None) -> None: ...
    def recv(self, timeout: float | None = None) -> Batch: ...
    def async_reset(
        self,
        seed: int | Sequence[int | None] | NDArray[np.integer[Any]] | None = None,
        env_id: ArrayLike | None = None,
        *,
        levels: ArrayLike | None = None,
        snapshots: NDArray[np.uint8] | None = None,
    ) -> None: ...
    def sample_actions(
        self, env_id: ArrayLike | None = None, out: NDArray[np.int32] | None = None
    ) -> NDArray[np.int32]: ...
    def seed_sampler(self, seed: int) -> None: ...
    def fork(
        self,
        env_id_from: ArrayLike,
        env_id_to: ArrayLike,
        *,
        seed: int | Sequence[int | None] | NDArray[np.integer[Any]] | None = None,
        timeout: float | None = None,
    ) -> Batch:
        """Copy the states of environments to others, and return the batch with their observations."""
    def async_fork(
        self,
        env_id_from: ArrayLike,
        env_id_to: ArrayLike,
        *,
        seed: int | Sequence[int | None] | NDArray[np.integer[Any]] | None = None,
    ) -> None: ...
    def render(
        self,
        batch: Batch | None = None,
        env_id: ArrayLike | None = None,
        renderer: Renderer | None = None,
        columns: int | None = None,
        captions: Sequence[str] | None = None,
    ) -> NDArray[np.uint8]:
        """A picture of one environment, or a sheet of many: uint8 [height, width, 3]."""
    def close(self) -> None: ...
    def __reduce__(self) -> NoReturn: ...
    def __enter__(self) -> Envs: ...
    def __exit__(
        self,
        exception_type: type[BaseException] | None = ...,
        exception: BaseException | None = ...,
        traceback: TracebackType | None = ...,
        /,
    ) -> None: ...
    @property
    def spec(self) -> LaneSpec: ...

@final
class Recorder:
    """Records environments of a running pool: the newest episodes of each."""

    def __new__(
        cls, pool: str, lane: str | None = None, env_id: int | list[int] = 0, *, episodes: int = 100
    ) -> Recorder: ...
    @property
    def n_complete(self) -> int:
        """Number of complete episodes that were received since the recorder began."""
    @property
    def n_lost(self) -> int:
        """Number of episodes that were lost, because they were not read in time."""
    def save(self, path: str | PathLike[str]) -> None:
        """Write the kept episodes as a replay."""
    def close(self) -> None: ...
    def __enter__(self) -> Recorder: ...
    def __exit__(
        self,
        *_exception: type[BaseException] | BaseException | TracebackType | None,
    ) -> None: ...

@final
class Spectator:
    """Reads the batches of a lane without being its learner."""

    def __new__(cls, pool: str, lane: str | None = None) -> Spectator: ...
    def latest(self) -> Batch | None:
        """The newest batch; None before the first. Never waits."""
    @property
    def spec(self) -> LaneSpec: ...
    def close(self) -> None: ...
    def __enter__(self) -> Spectator: ...
    def __exit__(
        self,
        *_exception: type[BaseException] | BaseException | TracebackType | None,
    ) -> None: ...

@final
class CapabilityBattle:
    """One battle of a scenario with the options `smacv2`, in this process."""

    def __new__(
        cls, scenario: dict[str, Any] | str, seed: int = 0, smacv2: Mapping[str, Any] | None = None
    ) -> CapabilityBattle: ...
    @property
    def n_agents(self) -> int: ...
    @property
    def n_enemies(self) -> int: ...
    @property
    def n_actions(self) -> int: ...
    @property
    def obs_size(self) -> int: ...
    @property
    def state_size(self) -> int: ...
    @property
    def cap_size(self) -> int: ...
    @property
    def episode_limit(self) -> int | None: ...
    @property
    def type_names(self) -> list[str]: ...
    @property
    def is_lost(self) -> bool: ...
    def reset(self, seed: int | None = None) -> None: ...
    def step(self, actions: Sequence[int]) -> tuple[float, bool, dict[str, Any]]: ...
    def perceive(self) -> None: ...
    def obs(self) -> NDArray[np.float32]: ...
    def state(self) -> NDArray[np.float32]: ...
    def avail(self) -> NDArray[np.uint8]: ...
    def capabilities(self) -> NDArray[np.float32]: ...
    def visibility(self) -> NDArray[np.uint8]: ...
    def time(self) -> float: ...
    def max_reward(self) -> float: ...
    def units(self) -> dict[str, NDArray[Any]]: ...
    def picture(self, width: int, height: int) -> NDArray[np.uint8]: ...

@final
class Renderer:
    """Draws the battles of one scenario."""

    def __new__(
        cls,
        scenario: str | PathLike[str] | Envs | Wrapper,
        width: int = 512,
        height: int = 512,
        *,
        theme: Literal["dark", "light"] = "dark",
        show_sight: bool = False,
        show_range: bool = False,
        show_ids: bool = False,
    ) -> Renderer: ...
    def render(self, state: ArrayLike) -> NDArray[np.uint8]:
        """A picture of a state, float32 [state_size]: uint8 [height, width, 3]."""
    def sheet(
        self,
        states: ArrayLike,
        env_id: ArrayLike | None = None,
        columns: int | None = None,
        captions: Sequence[str] | None = None,
    ) -> NDArray[np.uint8]:
        """A sheet of states, float32 [M, state_size], with captions: uint8 [height, width, 3]."""
    @property
    def state_size(self) -> int: ...

@final
class ScriptedPolicy:
    """A scripted policy, which chooses the actions of all environments of a batch."""

    def __new__(
        cls,
        name: _Policy,
        envs: Envs | Wrapper,
        *,
        seed: int | None = None,
        side: Literal["allies", "enemies"] = "allies",
    ) -> ScriptedPolicy: ...
    def __call__(self, batch: Batch, out: NDArray[np.int32] | None = None) -> NDArray[np.int32]:
        """Actions of all slots of a batch: int32 [M, n_agents], or of the enemies [M, n_enemies]."""
    @property
    def name(self) -> str: ...
    @property
    def side(self) -> Literal["allies", "enemies"]: ...

@final
class Dataset:
    """A dataset for offline learning: the recipe that `smaclite-pool dataset record` wrote."""

    def __new__(cls, path: str | PathLike[str]) -> Dataset: ...
    def expand(
        self,
        out: str | PathLike[str] | None = None,
        fields: Sequence[str] | None = None,
        *,
        threads: int | None = None,
    ) -> dict[str, NDArray[Any]]:
        """Play all episodes again and return their arrays, by name."""
    @property
    def card(self) -> DatasetCard: ...
    @property
    def episodes(self) -> dict[str, NDArray[Any]]: ...
    @property
    def hash(self) -> str: ...
    @property
    def program(self) -> str: ...
    @property
    def scenario(self) -> str | None: ...
    @property
    def settings(self) -> dict[str, Any]: ...

@overload
def make(
    scenario: str | PathLike[str],
    num_envs: int = 64,
    *,
    batch_size: int | None = None,
    seed: int | None = None,
    threads: int | None = None,
    autoreset_mode: _Autoreset | Enum = "NextStep",
    episode_limit: int | Literal["default"] | None = "default",
    rules: _Rules = "smaclite",
    opponent: str | PathLike[str] | Mapping[str, float] | None = None,
    sides: _Sides = "allies",
    fields: list[str] | None = None,
    obs_last_actions: int = 0,
    obs_agent_id: bool = False,
    max_held_batches: int = 4,
    spectators: int = 1,
    wait: _Wait = "adaptive",
    name: str | None = None,
    lanes: None = None,
    **battle: Unpack[_Battle],
) -> Envs: ...
@overload
def make(
    scenario: str | PathLike[str],
    num_envs: int = 64,
    *,
    batch_size: int | None = None,
    seed: int | None = None,
    threads: int | None = None,
    autoreset_mode: _Autoreset | Enum = "NextStep",
    episode_limit: int | Literal["default"] | None = "default",
    rules: _Rules = "smaclite",
    opponent: str | PathLike[str] | Mapping[str, float] | None = None,
    sides: _Sides = "allies",
    fields: list[str] | None = None,
    obs_last_actions: int = 0,
    obs_agent_id: bool = False,
    max_held_batches: int = 4,
    spectators: int = 1,
    wait: _Wait = "adaptive",
    name: str | None = None,
    lanes: int,
    **battle: Unpack[_Battle],
) -> list[Envs]: ...
def connect(
    pool: str,
    lane: str | None = None,
    *,
    timeout: float | None = 0.0,
    wait: _Wait = "adaptive",
) -> Envs: ...
def scenario(scenario: str | PathLike[str] | Envs | Wrapper) -> Scenario: ...
def scenarios(*, generated: bool | None = None) -> list[str]: ...
def status(pool: str, *, timeout: float | None = 10.0) -> PoolStatus: ...
def pools() -> list[str]: ...
def snapshot_columns(snapshot: NDArray[np.uint8]) -> dict[str, NDArray[Any]]:
    """The columns of a snapshot, uint8 [snapshot_size], as copies."""

def pack_snapshot(
    columns: dict[str, NDArray[Any]], scenario: str | PathLike[str] | Envs | Wrapper
) -> NDArray[np.uint8]:
    """A snapshot of columns that may have been edited, checked: uint8 [snapshot_size]."""

def check_settings(function: str, settings: dict[str, Any], own: list[str], refused: list[str]) -> None: ...
def run_program(args: list[str]) -> int: ...

@final
class TeamNetwork:
    """The policy of a trained team."""

    def __new__(cls, run: bytes, params: NDArray[np.float32]) -> TeamNetwork: ...
    def logits(self, obs: NDArray[np.float32]) -> NDArray[np.float32]: ...

def read_team(
    folder: str | PathLike[str],
    weights: str | None = None,
    map: str | None = None,
    enemies: bool = False,
) -> dict[str, Any]: ...
