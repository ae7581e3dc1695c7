"""Battles played side by side by smaclite_pool and by the published environment, and what differs.

`scenarios` holds a scenario with its unit files, `generator` invents random ones. `battles` is the
interface that both sides are played through, `published` the published side of it. `episode` plays one
episode on both and stops at the first difference. `recording` records an episode of the published
environment tick by tick. `examine` tells differences from ties, keeps and shrinks them; `run` does so
with many episodes; `__main__` is the command.

`trained` is the command that plays a trained team on both sides, and `team` is such a team.
`command` has what both commands need.

Only `published` and `recording` import the published package, and nothing here is part of its code.
"""
