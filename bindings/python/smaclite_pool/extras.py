"""What some learners are written with, and none needs: views of single agents, rows of units, rollouts,
and a base class of wrappers, with the class of their `spec`.
"""

from ._agent_view import AgentView, AgentViews, PerAgent, SeenUnit, evaluate_function
from ._entities import Entities, EntityRows
from ._rollout import Rollout
from ._spec import LaneSpec
from ._wrapper import Wrapper

__all__ = [
    "AgentView",
    "AgentViews",
    "Entities",
    "EntityRows",
    "LaneSpec",
    "PerAgent",
    "Rollout",
    "SeenUnit",
    "Wrapper",
    "evaluate_function",
]
