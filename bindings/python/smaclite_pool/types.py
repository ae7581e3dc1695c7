"""Types of the dicts that `scenario` and `status` return, for type checkers and for reading.

```python
import smaclite_pool as sp
from smaclite_pool.types import Scenario

scenario: Scenario = sp.scenario("2s3z")
print(sum(unit["hp"] for unit in scenario["allies"]))
```
"""

from __future__ import annotations

from typing import Any, Literal, TypedDict

__all__ = [
    "Capacity",
    "DatasetCard",
    "DatasetPolicy",
    "DatasetSizes",
    "Distribution",
    "EnemySizes",
    "LaneDescription",
    "LaneStats",
    "LaneStatus",
    "LayoutPart",
    "PoolStatus",
    "RewardOptions",
    "Scenario",
    "UnitStats",
    "UnitType",
]


class UnitType(TypedDict):
    """A type of the units of a scenario."""

    unit_type: str
    """Its name."""
    type_id: int
    """Index in the one-hot of the unit type."""
    sight_range: float
    """By which agents of this type see distances divided, in squares."""
    targeting_range: float
    """Within which agents of this type can choose targets, in squares."""
    radius: float
    """In squares."""
    hp: float
    """Maximum of its health."""
    shield: float
    """Maximum of its shield, 0 for none."""
    energy: float
    """Maximum of its energy, 0 for none."""
    cooldown: float
    """Seconds between two attacks."""
    max_cooldown: float
    """The greatest number of seconds until it can attack, by which `energy/cooldown` of the state is
    divided."""
    healer: bool
    """Whether it heals and does not attack."""
    plane: Literal["GROUND", "AIR", "COLOSSUS"]
    targets: list[Literal["GROUND", "AIR", "COLOSSUS"]]
    """Planes whose units it can attack or heal."""
    targeter: Literal["STANDARD", "KAMIKAZE", "LASER_BEAM", "HEAL"]


class UnitStats(UnitType):
    """One unit of a scenario."""

    position: list[float]
    """[x, y] at the start, in squares."""


class LayoutPart(TypedDict):
    """A part of an observation or of the state."""

    name: str
    start: int
    """Index of its first feature."""
    shape: list[int]
    """[features], or [units, features]."""
    features: list[str]
    """Names of the features."""
    low: list[float]
    """Least values of the features."""
    high: list[float]
    """Greatest values of the features."""


class Scenario(TypedDict):
    """What `smaclite_pool.scenario` returns."""

    name: str
    hash: str
    """16 hexadecimal digits, equal for scenarios and unit types that are equal in all that files say."""
    width: int
    """In squares."""
    height: int
    """In squares."""
    walkable: list[list[bool]]
    """`height` rows of `width` booleans, the southern row first."""
    attack_point: list[float]
    """[x, y], where enemies without a target walk."""
    num_unit_types: int
    """Length of the one-hot of the unit type, 0 for none."""
    ally_has_shields: bool
    """Whether observations and state contain the shields of allies."""
    enemy_has_shields: bool
    """Whether observations and state contain the shields of enemies."""
    episode_limit: int | None
    """Steps, None for no limit."""
    teams_are_drawn: bool
    """Whether each episode draws the types of the units; then `allies` and `enemies` are one sample."""
    smacv2: dict[str, Any] | None
    """All options of SMACv2's interface, with their defaults; None without the key `smacv2`."""
    unit_types: list[UnitType]
    """In the order of the numbers that a level has for types."""
    actions: list[str]
    """Names of an agent's actions, by their numbers: no_op, stop, north, ..., target_0, ..."""
    allies: list[UnitStats]
    """By id."""
    enemies: list[UnitStats]
    """By id."""
    obs_layout: list[LayoutPart]
    state_layout: list[LayoutPart]


class Capacity(TypedDict):
    """How many frames and requests the memory of a lane has room for."""

    max_held_batches: int
    frames_waiting: int
    frames_filling: int
    spectators: int
    requests_waiting: int


class EnemySizes(TypedDict):
    """The sizes that differ for the enemies."""

    n_actions: int
    obs_size: int
    state_size: int


class RewardOptions(TypedDict):
    """What both sides of a battle are rewarded for, with SMAC's names: `Envs.spec.rewards`."""

    reward_sparse: bool
    """Rewards are 1, -1 or 0, at the end."""
    reward_only_positive: bool
    """Rewards leave out own losses."""
    reward_death_value: float
    """Points for a kill."""
    reward_win: float
    """Points for winning."""
    reward_defeat: float
    """Points for losing."""
    reward_negative_scale: float
    """What own losses are multiplied by."""
    reward_scale: bool
    """Rewards are scaled."""
    reward_scale_rate: float
    """The return that the greatest return is scaled to."""


class LaneDescription(TypedDict):
    """What never changes about a lane, as `status` and `smaclite-pool status --json` say it."""

    pool: str
    pid: int
    """Process id of the supervisor."""
    instance: str
    """First part of the names of the lane's iceoryx2 services."""
    lane: str
    scenario: str
    n_agents: int
    n_enemies: int
    n_actions: int
    obs_size: int
    """Floats in the observation of one agent, with what the lane appends."""
    state_size: int
    """Floats in the state."""
    perception_size: int
    """Entries of a snapshot's column `perception`; 0 without the options `smacv2`."""
    n_phases: int
    """Units whose attacks have phases in a snapshot: all with rules `starcraft`, else 0."""
    num_envs: int
    batch_size: int
    seed: int
    autoreset_mode: Literal["NextStep", "SameStep", "Disabled"]
    fields: list[str]
    obs_last_actions: int
    obs_agent_id: bool
    team_last_actions: int
    """Own last actions that a unit of `opponent_team` observes; 0 without one."""
    episode_limit: int | None
    """Steps, None for no limit."""
    rules: Literal["smaclite", "paper", "starcraft-1"]
    opponents: dict[str, float]
    """Who plays the enemies, with weights; "learner" is the team, if one plays them."""
    opponent_team: str | None
    """The trained team that plays the enemies, as it was named."""
    sides: Literal["allies", "both", "mirrored"]
    """Which sides actions play."""
    rewards: RewardOptions
    """What both sides are rewarded for."""
    enemies: EnemySizes | None
    """What differs for the enemies, if actions play both sides, else None."""
    layout_hash: int
    """Equal if two programs agree on every offset of a batch."""
    capacity: Capacity
    threads: int
    """Workers of the pool, which all lanes share."""


class LaneStats(TypedDict):
    """Counts since the pool started."""

    steps: int
    """Steps of single environments, without resets."""
    episodes: int
    wins: int
    returns: float
    """Sum of the returns of the episodes that ended."""
    lengths: int
    """Sum of their lengths, in steps."""
    frames: int
    """Published batches."""
    rejected: int
    """Refused requests."""
    accepted: int
    """Accepted requests."""
    waited_ns: int
    """Nanoseconds that accepted requests waited for a worker."""


class LaneStatus(TypedDict):
    """The present state of a lane."""

    description: LaneDescription
    learner_pid: int | None
    """Process id of the attached learner."""
    spectators: int
    """How many are attached."""
    stats: LaneStats
    steps_per_s: float
    """Average over the last second."""
    queue_wait_us: float
    """Average over the last second."""
    failure: str | None
    """Error text of a failed lane."""


class PoolStatus(TypedDict):
    """What `smaclite_pool.status` returns."""

    pool: str
    pid: int
    """Process id of the supervisor."""
    threads: int
    """Number of workers."""
    uptime_s: float
    shared_memory: int
    """Bytes reserved for batches."""
    lanes: list[LaneStatus]


class DatasetSizes(TypedDict):
    """Sizes of the arrays of a dataset."""

    n_agents: int
    n_enemies: int
    n_actions: int
    obs_size: int
    state_size: int


class Distribution(TypedDict):
    """How numbers are distributed. Quantiles are values that occur."""

    mean: float
    deviation: float
    min: float
    quantile_25: float
    median: float
    quantile_75: float
    max: float


class DatasetPolicy(TypedDict):
    """What one policy of a dataset played."""

    name: str
    """The scripted policy, or the file in the folder of the run."""
    episodes: int
    steps: int
    win_rate: float
    mean_return: float


class DatasetCard(TypedDict):
    """What `Dataset.card` is."""

    scenario: str
    rules: Literal["smaclite", "paper", "starcraft-1"]
    opponents: str
    """The opponent, or several with their weights."""
    sizes: DatasetSizes
    episodes: int
    steps: int
    win_rate: float
    """Share of the episodes."""
    truncated_rate: float
    """Share of the episodes that the episode limit ended."""
    returns: Distribution
    """Sums of the episodes' rewards."""
    lengths: Distribution
    """Steps of the episodes."""
    unique_pairs: int
    """Different pairs of state and joint action."""
    coverage: float
    """Their share of all steps (SACo)."""
    policies: list[DatasetPolicy]
