"""The tables of docs/results.md. A cell is the median over the seeds, in some columns with the range."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from statistics import median

from . import data
from .data import Row

PAPER = {
    "2s_vs_1sc": ("QMIX", 16.22),
    "3s5z": ("VDN", 20.0),
    "MMM2": ("MAPPO", 24.63),
    "corridor": ("MAA2C", 20.25),
    "3s_vs_5z": ("IQL", 18.1),
    "bane_vs_bane": ("IA2C", 19.14),
}
"""Algorithm and mean test return that the paper describes per scenario (its section 5.2)."""

PYMARL2 = {
    "8m": 100, "2s3z": 100, "1c3s5z": 100, "3s5z": 100, "8m_vs_9m": 100, "3s_vs_5z": 100, "bane_vs_bane": 100,
    "2c_vs_64zg": 100, "corridor": 100, "MMM2": 100, "27m_vs_30m": 100, "5m_vs_6m": 90, "3s5z_vs_3s6z": 85,
    "6h_vs_8z": 93,
}  # fmt: skip
"""Wins in StarCraft in percent, of the fine-tuned QMIX of PyMARL2 after 10M steps, by its README."""

Cells = list[str]


def tables(reports: dict[str, list[Row]], searches: list[Row], scripts: str) -> dict[str, str]:
    """All tables by name, in Markdown. `reports` has the runs of each group of `results.train`; `scripts` is
    the page with the returns of the scripted policies."""
    runs = reports["flat"]
    return {
        "commands": commands(reports["default"]),
        "maps": maps(reports["default"]),
        "flat": maps(runs),
        "generated": generated(reports["generated"], reports["open-loop"]),
        "critics": critics(runs, reports["other-critic"]),
        "paper": paper(runs),
        "rules": rules(runs, reports["paper-rules"]),
        "starcraft": starcraft(reports["starcraft"]),
        "search": search(runs, searches, scripts),
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


def commands(runs: list[Row]) -> str:
    """How the page was made: with as many seeds as it has."""
    lines = {
        f"just results-train --seeds {len({row['seed'] for row in runs})}": (
            "trains and reports all teams; continues after Ctrl-C"
        ),
        "just generate": "writes the tables of this page from the CSV files in docs/results",
    }
    width = max(map(len, lines))
    code = "".join(f"{command:{width}}  # {purpose}\n" for command, purpose in lines.items())
    return f"\n```sh\n{code}```\n\n"


def maps(runs: list[Row]) -> str:
    """Final episodes of the best weights, and the time until a team first won for certain, per scenario."""
    header = [
        "scenario", "wins, greedy (%)", "wins, sampled (%)", "return, greedy", "CPU-seconds",
        "won after steps", "after CPU-seconds", "seeds that won",
    ]  # fmt: skip

    def cells(task: str, rows: list[Row]) -> Cells:
        won = [row for row in rows if row["greedy_win_steps"]]
        most = 2 * len(won) > len(rows)  # the median of the others is above the budget
        return [
            task,
            spread(rows, "greedy_win_rate", percent),
            spread(rows, "sampled_win_rate", percent),
            middle(rows, "greedy_mean_return", two_digits),
            middle(rows, "cpu_seconds", whole),
            middle(endless(rows), "greedy_win_steps", whole) if most else "",
            middle(endless(rows), "greedy_win_cpu_seconds", whole) if most else "",
            f"{len(won)} of {len(rows)}",
        ]

    return markdown(header, (cells(*found) for found in by_task(runs)))


def generated(runs: list[Row], open_loop: list[Row]) -> str:
    """Final episodes in generated battles, and those of teams that do not look."""
    header = [
        "scenario", "wins, greedy (%)", "wins, sampled (%)", "open loop, greedy (%)", "return, sampled",
        "CPU-seconds", "seeds",
    ]  # fmt: skip
    blind = dict(by_task(open_loop))

    def cells(task: str, rows: list[Row]) -> Cells:
        return [
            task,
            spread(rows, "greedy_win_rate", percent),
            spread(rows, "sampled_win_rate", percent),
            spread(blind.get(task, []), "greedy_win_rate", percent),
            middle(rows, "sampled_mean_return", two_digits),
            middle(rows, "cpu_seconds", whole),
            str(len(rows)),
        ]

    return markdown(header, (cells(*found) for found in by_task(runs)))


def critics(runs: list[Row], other_critic: list[Row]) -> str:
    """Medians with both critics, per scenario: wins with greedy and with sampled actions, and the time."""
    header = ["scenario"]
    header += [
        f"{critic}: {what}"
        for critic in ("state", "observation")
        for what in ("greedy (%)", "sampled (%)", "CPU-seconds")
    ]
    columns = {"greedy_win_rate": percent, "sampled_win_rate": percent, "cpu_seconds": whole}
    others = dict(by_task(other_critic))
    lines = []
    for task, rows in by_task(runs):
        other = others.get(task, [])
        both = [rows, other] if data.sees_state(task) else [other, rows]
        lines.append([task] + [middle(of, name, form) for of in both for name, form in columns.items()])
    return markdown(header, lines)


def by_task(runs: list[Row]) -> Iterable[tuple[str, list[Row]]]:
    for task in sorted({row["task"] for row in runs}, key=natural):
        yield task, [row for row in runs if row["task"] == task]


def natural(name: str) -> list[str | int]:
    """To sort by: numbers in a name by their value, and without regard to case."""
    parts = re.split(r"(\d+)", name.lower())  # text and numbers in turn
    return [int(part) if i % 2 else part for i, part in enumerate(parts)]


def paper(runs: list[Row]) -> str:
    header = ["scenario", "paper", "return, greedy", "return, sampled", "wins, greedy (%)"]

    def cells(task: str, rows: list[Row]) -> Cells:
        algorithm, theirs = PAPER[task]
        return [
            task,
            f"{algorithm} {theirs:.2f}",
            spread(rows, "greedy_mean_return", two_digits),
            spread(rows, "sampled_mean_return", two_digits),
            spread(rows, "greedy_win_rate", percent),
        ]

    return markdown(header, (cells(task, rows) for task, rows in by_task(runs) if task in PAPER))


def starcraft(runs: list[Row]) -> str:
    """Final episodes under rules `starcraft`, beside StarCraft's."""
    header = [
        "scenario", "wins, greedy (%)", "wins, sampled (%)", "PyMARL2's QMIX in StarCraft (%)",
        "return, greedy", "CPU-seconds", "won after steps", "seeds that won",
    ]  # fmt: skip

    def cells(task: str, rows: list[Row]) -> Cells:
        won = [row for row in rows if row["greedy_win_steps"]]
        return [
            task,
            spread(rows, "greedy_win_rate", percent),
            spread(rows, "sampled_win_rate", percent),
            str(PYMARL2.get(task, "")),
            middle(rows, "greedy_mean_return", two_digits),
            middle(rows, "cpu_seconds", whole),
            middle(endless(rows), "greedy_win_steps", whole) if 2 * len(won) > len(rows) else "",
            f"{len(won)} of {len(rows)}",
        ]

    named = [{**row, "task": row["task"].removesuffix("-starcraft-1")} for row in runs]
    return markdown(header, (cells(*found) for found in by_task(named)))


def endless(rows: list[Row]) -> list[Row]:
    """Runs that did not win count as those that would need longest."""
    return [{name: value or "inf" for name, value in row.items()} for row in rows]


def rules(runs: list[Row], of_paper: list[Row]) -> str:
    header = [
        "scenario",
        "rules",
        "wins, greedy (%)",
        "wins, sampled (%)",
        "return, greedy",
        "return, sampled",
    ]
    lines = []
    for scenario, found in by_task([{**row, "task": row["task"].removesuffix("-paper")} for row in of_paper]):
        others = [row for row in runs if row["task"] == scenario]
        for name, rows in (("smaclite", others), ("paper", found)):
            columns = {"win_rate": percent, "mean_return": two_digits}
            spreads = [
                spread(rows, f"{kind}_{column}", form)
                for column, form in columns.items()
                for kind in ("greedy", "sampled")
            ]
            lines.append([scenario, name, *spreads])
    return markdown(header, lines)


def search(rows: list[Row], searches: list[Row], scripts: str) -> str:
    """The best return that was found by search, by a learner and by a script, per scenario."""
    header = ["scenario", "search", "won", "steps", "policy", "best script", "best team, greedy"]
    lines = []
    for row in sorted(searches, key=lambda row: natural(row["scenario"])):
        name = row["scenario"]
        script = max(
            float(cell.split("/")[0])
            for line in scripts.splitlines()
            if line.startswith(f"| {name} |")
            for cell in line.strip("| ").split("|")[1:]
        )
        returns = [float(r["greedy_mean_return"]) for r in rows if r["task"] == name]
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
