"""What is trained for docs/results.md."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Runs:
    """Runs that differ in the seed only: 1, 2 and so on."""

    group: str
    """`paper`, `default`, `others` or `rules`; each has a table and a chart."""
    scenario: str
    steps: int
    seeds: int
    options: str = ""
    """Further options of the learner."""
    variant: str = ""
    """Names the options, if the group has several configurations of the scenario."""
    learner: str = "smaclite-pool train"
    """One of `learners.LEARNERS`."""

    @property
    def title(self) -> str:
        return f"{self.scenario}, {self.variant}" if self.variant else self.scenario

    def name(self, seed: int) -> str:
        parts = [self.group, self.scenario, self.variant, str(seed)]
        return "-".join(part for part in parts if part)


MILLION = 1_000_000

# What wins the hard maps; docs/tutorials/training.md says why.
SHOOT_AND_STEP_BACK = (
    "--algorithm ippo --activation tanh --lambda 0.98 --advantage-floor 0.5 --entropy 0.15 --entropy-end 0"
)
KITE = "--last-actions 4 --advantage-floor 0.3 --entropy 0.05 --entropy-end 0"
SHORT_CREDIT = "--lambda 0.6 --actor-lr 0.0005 --horizon 32 --entropy 0.01 --entropy-end 0"

RUNS = [
    # The scenarios and budgets of the paper, with what helps in each.
    Runs("paper", "2s_vs_1sc", 2 * MILLION, 3, SHOOT_AND_STEP_BACK, "IPPO"),
    Runs("paper", "2s_vs_1sc", 1_500_000, 1, "--algorithm qmix", "QMIX", "value_decomposition.py"),
    Runs("paper", "3s5z", 4 * MILLION, 3),
    Runs("paper", "MMM2", 4 * MILLION, 3),
    Runs("paper", "corridor", 4 * MILLION, 3),
    Runs("paper", "corridor", 4 * MILLION, 3, "--lr-end 0.05", "annealed"),
    Runs("paper", "3s_vs_5z", 4 * MILLION, 3, KITE),
    Runs("paper", "bane_vs_bane", 500_000, 3, SHORT_CREDIT),
    # The default configuration in small budgets.
    Runs("default", "2s3z", 500_000, 5),
    Runs("default", "3s5z", 1_200_000, 5),
    Runs("default", "MMM", 600_000, 5),
    Runs("default", "10m_vs_11m", 1_000_000, 5),
    Runs("default", "MMM2", 1_000_000, 5),
    Runs("default", "corridor", 1_200_000, 5),
    Runs("default", "3s5z_vs_3s6z", 1_200_000, 5),
    Runs("default", "27m_vs_30m", 500_000, 5),
    # The same on other scenarios.
    Runs("others", "3m", 300_000, 3),
    Runs("others", "8m", 300_000, 3),
    # The rules of the paper's text; the runs of `default` have the other rules.
    Runs("rules", "MMM", 600_000, 3, "--rules paper"),
    Runs("rules", "MMM2", 1_000_000, 3, "--rules paper"),
]


def default(scenario: str) -> Runs:
    """The runs of the default configuration."""
    return next(runs for runs in RUNS if (runs.group, runs.scenario) == ("default", scenario))


@dataclass(frozen=True)
class Paper:
    """What the paper says about a scenario (its section 5.2)."""

    algorithm: str
    test_return: float


PAPER = {
    "2s_vs_1sc": Paper("QMIX", 16.22),
    "3s5z": Paper("VDN", 20.0),
    "MMM2": Paper("MAPPO", 24.63),
    "corridor": Paper("MAA2C", 20.25),
    "3s_vs_5z": Paper("IQL", 18.1),
    "bane_vs_bane": Paper("IA2C", 19.14),
}
