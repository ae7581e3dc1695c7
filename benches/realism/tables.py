"""Prints rows as tables that fit a terminal."""

from __future__ import annotations

import math
from collections.abc import Callable

from .rows import Row

Column = tuple[str, Callable[[Row], str]]


def number(key: str, form: str) -> Callable[[Row], str]:
    return lambda row: formatted(row.get(key), form)


def formatted(value: object, form: str) -> str:
    if not isinstance(value, int | float) or math.isnan(value):
        return "-"
    return format(value, form)


def pair(keys: tuple[str, str], form: str) -> Callable[[Row], str]:
    """Real and ours."""
    return lambda row: "/".join(formatted(row.get(key), form) for key in keys)


def within(key: str, form: str) -> Callable[[Row], str]:
    """A number and its interval."""

    def text(row: Row) -> str:
        low, high = (formatted(row.get(f"{key}_{end}"), form) for end in ("low", "high"))
        return f"{formatted(row.get(key), form)} ({low} to {high})"

    return text


def quartiles(key: str, form: str) -> Callable[[Row], str]:
    def text(row: Row) -> str:
        low, median, high = (formatted(row.get(f"{key}_{quantile}"), form) for quantile in (25, 50, 75))
        return f"{median} ({low} to {high})"

    return text


HALVES = (" tune", " report")

SCRIPTS = ("nearest", "attack_closest", "attack_weakest", "focus_fire", "hybrid_attack_heal")

COLUMNS: dict[str, list[Column]] = {
    "battles": [
        ("battles", number("battles", "d")),
        ("winner right", within("winner", ".2f")),
        ("won", pair(("won_real", "won"), ".2f")),
        ("enemies", number("enemies", ".2f")),
        ("agents", number("agents", ".2f")),
        ("death: median", number("death_median", ".0f")),
        ("mean", within("death", ".0f")),
        ("fate right", within("fate", ".2f")),
        ("end", number("end_median", ".0f")),
        ("first death", pair(("first_death_real", "first_death"), ".0f")),
        ("killer right", number("killer", ".2f")),
        ("killers of agents", pair(("killers_of_agents_real", "killers_of_agents"), ".1f")),
        ("of enemies", pair(("killers_of_enemies_real", "killers_of_enemies"), ".1f")),
    ],
    "stands": [
        ("seen", pair(("number_real", "number_ours"), "d")),
        ("distance, real", quartiles("distance_real", ".2f")),
        ("ours", quartiles("distance_ours", ".2f")),
        ("loop, real", quartiles("loop_real", ".0f")),
        ("ours", quartiles("loop_ours", ".0f")),
    ],
    "walk": [
        ("pairs", number("pairs", "d")),
        ("walked", pair(("real", "ours"), ".3f")),
        ("error", number("error", ".3f")),
        ("all that walk: pairs", number("mean_pairs", "d")),
        ("walked, mean", pair(("mean_real", "mean_ours"), ".3f")),
        ("error, mean", number("mean_error", ".3f")),
        ("median", number("median_error", ".3f")),
    ],
    "drift": [
        ("pairs", number("mean_pairs", "d")),
        ("moved, mean", pair(("mean_real", "mean_ours"), ".3f")),
        ("error, mean", number("mean_error", ".3f")),
        ("median", number("median_error", ".3f")),
    ],
    "random": [
        ("return", number("return", ".2f")),
        ("length", number("length", ".1f")),
        ("won", number("won", ".2f")),
        ("SMAC, random", number("random_episodes", "d")),
        ("return", number("random_return", ".2f")),
        ("length", number("random_length", ".1f")),
        ("won", number("random_won", ".2f")),
        ("near", number("within_random", "d")),
        ("almost random", number("almost_episodes", "d")),
        ("return", number("almost_return", ".2f")),
        ("length", number("almost_length", ".1f")),
        ("won", number("almost_won", ".2f")),
        ("near", number("within_almost", "d")),
    ],
    "scripts": [
        column
        for script in SCRIPTS
        for column in (
            (script, pair((f"{script}_real", script), ".2f")),
            ("off", number(f"{script}_difference", ".2f")),
        )
    ],
}


def text(name: str, rules: str, rows: list[Row]) -> str:
    """A table with a title, without the rows of halves but for means. Pairs are real and ours."""
    columns = COLUMNS[name]
    lines = [[f"{rules}: {name}", *(title for title, _ in columns)]]
    rows = [row for row in rows if " mean" in str(row["row"]) or not str(row["row"]).endswith(HALVES)]
    lines += [
        [str(row["row"]).removeprefix(f"{rules} "), *(cell(row) for _, cell in columns)] for row in rows
    ]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    made = []
    for first, *rest in lines:
        cells = (each.rjust(width) for each, width in zip(rest, widths[1:], strict=True))
        made.append("  ".join([first.ljust(widths[0]), *cells]).rstrip())
    return "\n".join(made) + "\n"
