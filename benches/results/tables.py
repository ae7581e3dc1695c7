"""The tables of docs/results.md. A cell is the median over the seeds, in some columns with the range."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from statistics import median

from .data import Row
from .runs import PAPER, RUNS, Runs, default

SECTIONS = {
    "paper": "the scenarios of the paper",
    "default": "the default configuration",
    "others": "other scenarios",
    "rules": "both rule sets",
}

Cells = list[str]


def tables(
    rows: list[Row],
    shares: list[Row],
    round_trip: float,
    searches: list[Row],
    scripts: str,
    played: list[Row],
    rated: list[Row],
) -> dict[str, str]:
    """All tables by name, in Markdown. A round trip of 64 environments that do nothing is in microseconds;
    `scripts` is the page with the returns of the scripted policies; `played` is of teams and opponents,
    `rated` has the ratings of teams and scripts."""
    return {
        "paper": paper(rows),
        "default": budgets(rows, "default"),
        "others": budgets(rows, "others"),
        "rules": rules(rows),
        "shares": time_shares(shares, round_trip),
        "search": search(rows, searches, scripts),
        "opponents": opponents(played),
        "elo": elo(rated),
        "options": options(),
        "machines": machines(rows + shares),
    }


def insert(page: str, name: str, table: str) -> str:
    """Replaces what is between the marks of a table in the page.

    Raises:
        ValueError: the page has no such marks.
    """
    begin, end = f"<!-- table: {name} -->\n", "<!-- end -->"
    found = re.search(f"({re.escape(begin)}).*?({end})", page, re.DOTALL)
    if not found:
        raise ValueError(f"the page has no `{begin.strip()}` with `{end}` after it")
    return page[: found.end(1)] + table + page[found.start(2) :]


def markdown(header: Cells, rows: Iterable[Cells]) -> str:
    """A table whose first column is text and whose others are numbers."""
    lines = [header, ["---"] + ["---:"] * (len(header) - 1), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def of(rows: list[Row], runs: Runs) -> list[Row]:
    """The rows of these runs."""
    names = [runs.name(seed) for seed in range(1, runs.seeds + 1)]
    return [row for row in rows if row["name"] in names]


def present(rows: list[Row], group: str) -> Iterable[tuple[Runs, list[Row]]]:
    """The planned runs of a group that have rows, with these."""
    for runs in RUNS:
        if runs.group == group and of(rows, runs):
            yield runs, of(rows, runs)


def middle(rows: list[Row], column: str, form: Callable[[float], str]) -> str:
    """The median; empty if the learner does not have the value."""
    values = [float(row[column]) for row in rows if row[column]]
    return form(median(values)) if values else ""


def spread(rows: list[Row], column: str, form: Callable[[float], str]) -> str:
    """Median and range; empty if the learner does not have the value."""
    values = [float(row[column]) for row in rows if row[column]]
    if not values:
        return ""
    low, high = form(min(values)), form(max(values))
    return low if low == high else f"{form(median(values))} ({low} to {high})"


def percent(share: float) -> str:
    return f"{100 * share:.1f}"


def two_digits(value: float) -> str:
    return f"{value:.2f}"


def whole(value: float) -> str:
    return f"{value:,.0f}"


def paper(rows: list[Row]) -> str:
    header = [
        "scenario", "paper", "return, sampled", "return, greedy", "wins, sampled (%)", "wins, greedy (%)",
        "steps", "seeds", "CPU-seconds", "seconds",
    ]  # fmt: skip

    def cells(runs: Runs, rows: list[Row]) -> Cells:
        theirs = PAPER[runs.scenario]
        return [
            runs.title,
            f"{theirs.algorithm} {theirs.test_return:.2f}",
            spread(rows, "sampled_mean_return", two_digits),
            spread(rows, "greedy_mean_return", two_digits),
            spread(rows, "sampled_win_rate", percent),
            spread(rows, "greedy_win_rate", percent),
            middle(rows, "steps", whole),
            str(len(rows)),
            middle(rows, "cpu_seconds", whole),
            middle(rows, "seconds", whole),
        ]

    return markdown(header, (cells(*found) for found in present(rows, "paper")))


def budgets(rows: list[Row], group: str) -> str:
    header = [
        "scenario", "steps", "wins, sampled (%)", "wins, greedy (%)", "return, sampled", "CPU-seconds",
        "90 % after steps", "after CPU-seconds", "seeds that reached it",
    ]  # fmt: skip

    def cells(runs: Runs, rows: list[Row]) -> Cells:
        reached = [row for row in rows if row["steps_at_90"]]
        most = 2 * len(reached) > len(rows)  # the median of the others is above the budget
        return [
            runs.title,
            middle(rows, "steps", whole),
            spread(rows, "sampled_win_rate", percent),
            spread(rows, "greedy_win_rate", percent),
            middle(rows, "sampled_mean_return", two_digits),
            middle(rows, "cpu_seconds", whole),
            middle(endless(rows), "steps_at_90", whole) if most else "",
            middle(endless(rows), "cpu_seconds_at_90", whole) if most else "",
            f"{len(reached)} of {len(rows)}",
        ]

    return markdown(header, (cells(*found) for found in present(rows, group)))


def endless(rows: list[Row]) -> list[Row]:
    """Runs that did not reach the win rate count as those that would need longest."""
    return [{name: value or "inf" for name, value in row.items()} for row in rows]


def rules(rows: list[Row]) -> str:
    header = [
        "scenario", "rules", "wins, sampled (%)", "wins, greedy (%)", "return, sampled", "return, greedy",
        "steps", "seeds",
    ]  # fmt: skip
    lines = []
    for runs, of_paper in present(rows, "rules"):
        for name, found in (("smaclite", of(rows, default(runs.scenario))), ("paper", of_paper)):
            if found:
                lines.append([
                    runs.scenario,
                    name,
                    spread(found, "sampled_win_rate", percent),
                    spread(found, "greedy_win_rate", percent),
                    spread(found, "sampled_mean_return", two_digits),
                    spread(found, "greedy_mean_return", two_digits),
                    middle(found, "steps", whole),
                    str(len(found)),
                ])  # fmt: skip
    return markdown(header, lines)


def search(rows: list[Row], searches: list[Row], scripts: str) -> str:
    """The best return that was found by search, by a learner and by a script, per scenario."""
    header = ["scenario", "search", "won", "steps", "policy", "best script", "best team, greedy"]
    lines = []
    for row in sorted(searches, key=lambda row: row["scenario"].lower()):
        name = row["scenario"]
        script = max(
            float(cell.split("/")[0])
            for line in scripts.splitlines()
            if line.startswith(f"| {name} |")
            for cell in line.strip("| ").split("|")[1:]
        )
        teams = [r for r in rows if r["scenario"] == name and r["group"] != "rules"]
        returns = [float(r["greedy_mean_return"]) for r in teams if r["greedy_mean_return"]]
        lines.append(
            [
                name,
                two_digits(float(row["episode_return"])),
                "yes" if row["won"] == "1" else "no",
                row["steps"],
                row["policy"],
                f"{script:.1f}",
                two_digits(max(returns)) if returns else "",
            ]
        )
    return markdown(header, lines)


def opponents(played: list[Row]) -> str:
    """Win rates in percent against every opponent, medians over seeds."""
    names = list(dict.fromkeys(row["opponent"] for row in played))
    teams = dict.fromkeys((row["scenario"], row["trained"]) for row in played)

    def cell(team: tuple[str, str], opponent: str) -> str:
        keys = (*team, opponent)
        found = [row for row in played if (row["scenario"], row["trained"], row["opponent"]) == keys]
        return f"{100 * median(float(row['win_rate']) for row in found):.0f}"

    lines = [[f"{team[0]}, {team[1]}", *(cell(team, name) for name in names)] for team in teams]
    return markdown(["scenario, trained against", *names], lines)


def elo(rated: list[Row]) -> str:
    """The ratings of teams at the end of their training, medians and ranges over seeds, and of scripts."""
    last = str(max((int(row["steps"]) for row in rated if row["steps"]), default=0))
    scenarios = list(dict.fromkeys(row["scenario"] for row in rated))
    teams = [row for row in rated if row["steps"] == last]
    scripts = [row for row in rated if not row["steps"]]

    def lines(rows: list[Row], name: str) -> Iterable[Cells]:
        for trained in dict.fromkeys(row["trained"] for row in rows):
            own = [row for row in rows if row["trained"] == trained]
            cells = [[row for row in own if row["scenario"] == scenario] for scenario in scenarios]
            yield [name.format(trained), *(spread(found, "elo", "{:.0f}".format) for found in cells)]

    return markdown(
        ["player", *scenarios], [*lines(teams, "team, trained against {}"), *lines(scripts, "{}")]
    )


def time_shares(shares: list[Row], round_trip: float) -> str:
    header = [
        "scenario", "environment (%)", "transport (%)", "inference (%)", "learning (%)",
        "steps per CPU-second",
    ]  # fmt: skip

    def cells(row: Row) -> Cells:
        steps, pool = float(row["steps"]), float(row["environment"])
        transport = round_trip / 1e6 * steps / 64
        parts = [pool - transport, transport, float(row["inference"]), float(row["learning"])]
        total = sum(parts)
        return [row["scenario"], *(percent(part / total) for part in parts), whole(steps / total)]

    return markdown(header, map(cells, shares))


def options() -> str:
    """The runs whose configuration is not the default."""
    configured = [runs for runs in RUNS if runs.options]
    lines = [
        [f"{SECTIONS[runs.group]}: {runs.title}", f"`{runs.learner}`", f"`{runs.options}`"]
        for runs in configured
    ]
    header = [["table and scenario", "learner", "options"], ["---"] * 3]
    return "".join(f"| {' | '.join(line)} |\n" for line in header + lines)


def machines(rows: list[Row]) -> str:
    found = sorted({row["machine"] for row in rows})
    return "".join(f"- {machine}\n" for machine in found)
