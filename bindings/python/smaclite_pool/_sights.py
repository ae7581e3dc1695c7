"""What learners see in a vector of environments."""

from __future__ import annotations

SIGHTS = {"obs": "obs", "state": "state", "action_mask": "avail_actions"}
"""Keys of an observation, by the field of a batch that each one is."""
