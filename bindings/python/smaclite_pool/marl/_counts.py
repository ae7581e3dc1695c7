"""What SMAC's environments count, under the names by which programs read it."""

from __future__ import annotations


class EpisodeCounts:
    """Counts of episodes since the environment was made, and of the present one."""

    def __init__(self) -> None:
        self.battles_won = self.battles_game = self.timeouts = self.force_restarts = 0
        self.win_counted = self.defeat_counted = False
        self._episode_steps = self._episode_count = self._total_steps = 0

    def _count_begin(self) -> None:
        self.win_counted = self.defeat_counted = False
        self._episode_steps = 0

    def _count_step(self, *, ended: bool, won: bool, lost: bool, at_limit: bool) -> None:
        self._episode_steps += 1
        self._total_steps += 1
        self._episode_count += ended
        self.battles_game += ended
        self.battles_won += won
        self.timeouts += at_limit
        self.win_counted, self.defeat_counted = won, lost

    def get_stats(self) -> dict[str, float]:
        """Counts of episodes: won, all, and at the limit; `win_rate` is 0 before the first."""
        return {
            "battles_won": self.battles_won,
            "battles_game": self.battles_game,
            "battles_draw": self.timeouts,
            "win_rate": self.battles_won / max(self.battles_game, 1),
            "timeouts": self.timeouts,
            "restarts": self.force_restarts,
        }
