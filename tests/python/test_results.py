"""The tools of docs/results.md: what is kept of a run, tables, and curves where matplotlib is installed."""

from __future__ import annotations

import re
from importlib.util import find_spec
from pathlib import Path

import pytest

from results import benchmarks, data, page, tables, train, values
from results.data import Row
from results.runs import PAPER, RUNS, Runs

PAGE = data.REPOSITORY / "docs" / "results.md"


def log(updates: int, win_rate: float = 1.0) -> list[Row]:
    """A learner's log whose win rate rises to this, and whose updates take 1, 2, 3... seconds."""
    return [
        {
            "steps": str(4000 * update),
            "episodes": str(100 * (update - 1)),
            "mean_return": str(20 * update / updates) if update > 1 else "",
            "win_rate": str(win_rate * update / updates) if update > 1 else "",
            "seconds": str(update * (update + 1) / 2),
            "cpu_seconds": f"{update}.0009",
            "wait_share": str(1.0 if update == 1 else 0.0),
        }
        for update in range(1, updates + 1)
    ]


def row(runs: Runs, seed: int, win_rate: float, steps_at_90: str) -> Row:
    key = train.Run(runs, seed, runs.steps).key
    values = {"win_rate": win_rate, "mean_return": 20 * win_rate}
    evaluated = {f"{kind}_{name}": str(values[name]) for kind in ("sampled", "greedy") for name in values}
    cpu = {"cpu_seconds": "30.5", "cpu_seconds_at_90": "12.2" if steps_at_90 else "", "seconds": "20.1"}
    steps = {"steps": str(runs.steps), "steps_at_90": steps_at_90}
    return {**key, **steps, **evaluated, **cpu, "machine": "a machine"}


def test_a_curve_has_few_rows_and_the_last_one() -> None:
    curve = data.thinned(log(1000))
    assert len(curve) == data.CURVE_ROWS
    assert curve[0] == {"steps": "8000", "mean_return": "0.040", "win_rate": "0.002", "cpu_seconds": "2.001"}
    assert curve[-1]["steps"] == "4000000"
    assert [row["steps"] for row in data.thinned(log(4))] == ["8000", "12000", "16000"]
    assert data.thinned(log(1)) == []


def test_a_win_rate_counts_from_200_episodes_on() -> None:
    reached = data.first_reached(log(10))
    assert reached is not None
    assert reached["steps"] == "36000"
    assert data.first_reached(log(10, win_rate=0.89)) is None
    early = [{**entry, "win_rate": "1"} for entry in log(5)]
    assert (data.first_reached(early) or {})["episodes"] == "200"


def test_shares_are_weighted_by_time() -> None:
    assert data.time_share(log(4), "wait_share") == pytest.approx(1 / 10)


def test_runs_have_names_of_their_own() -> None:
    names = [run.name for run in train.planned()]
    assert len(set(names)) == len(names)
    assert {runs.scenario for runs in RUNS if runs.group == "paper"} == set(PAPER)


def test_a_run_is_missing_until_its_row_has_its_steps_and_options(tmp_path: Path) -> None:
    first, second = train.planned()[:2]
    table = train.Table(tmp_path, train.planned())
    table.add(second, row(second.runs, second.seed, 0.5, ""), data.thinned(log(5)))
    table.add(first, row(first.runs, first.seed, 0.5, ""), data.thinned(log(5)))
    read = train.Table(tmp_path, train.planned())
    assert [entry["name"] for entry in read.rows] == [first.name, second.name]
    assert read.has(first)
    assert not read.has(train.planned(steps=7)[0])
    read.add(first, {**read.rows[0], "options": "--gamma 1"}, data.thinned(log(5)))
    assert len(read.rows) == 2
    assert not read.has(first)


def test_a_cell_is_median_and_range() -> None:
    runs = next(runs for runs in RUNS if runs.group == "default" and runs.seeds == 5)
    shares = [0.5, 0.9, 0.8, 1.0, 0.7]
    rows = [row(runs, i + 1, share, "400000" if share > 0.7 else "") for i, share in enumerate(shares)]
    line = tables.budgets(rows, "default").splitlines()[-1]
    cells = [cell.strip() for cell in line.strip("|").split("|")]
    assert cells[0] == runs.scenario
    assert cells[2] == "80.0 (50.0 to 100.0)"
    assert cells[-3:] == ["400,000", "12", "3 of 5"]
    # A learner without probabilities has no sampled episodes.
    greedy = [{**entry, "sampled_win_rate": "", "sampled_mean_return": ""} for entry in rows]
    cells = tables.budgets(greedy, "default").splitlines()[-1].split(" | ")
    assert cells[2:5] == ["", "80.0 (50.0 to 100.0)", ""]
    # Fewer than half reached it: the median is not known.
    line = tables.budgets([{**entry, "steps_at_90": ""} for entry in rows[:3]] + rows[3:], "default")
    assert line.splitlines()[-1].endswith("|  |  | 1 of 5 |")


def test_shares_of_time_add_up() -> None:
    measured = {"scenario": "MMM2", "steps": "64000", "environment": "2", "inference": "1", "learning": "1"}
    cells = tables.time_shares([measured], 11.72).splitlines()[-1].split("|")
    assert [cell.strip() for cell in cells[1:-1]] == ["MMM2", "49.7", "0.3", "25.0", "25.0", "16,000"]


def test_a_table_is_replaced_and_the_text_around_it_stays() -> None:
    text = "a\n<!-- table: one -->\nold\n<!-- end -->\nb\n<!-- table: two -->\n<!-- end -->\n"
    replaced = tables.insert(text, "one", "new\n")
    assert replaced == text.replace("old", "new")
    assert tables.insert(replaced, "one", "new\n") == replaced
    with pytest.raises(ValueError, match="<!-- table: three -->"):
        tables.insert(text, "three", "")


def test_the_page_has_a_place_for_every_table() -> None:
    for name, table in tables.tables([], [], 8.0, [], "", [], []).items():
        tables.insert(PAGE.read_text(), name, table)


def test_the_tables_of_the_page_are_those_of_the_files() -> None:
    text = PAGE.read_text()
    assert page.with_tables(text, data.FOLDER) == text, "run `just results`"


def test_quoted_numbers_are_those_of_the_files() -> None:
    for path in values.PAGES:
        text = path.read_text()
        assert values.filled(text, path) == text, "run `just values`"


MEASURED = "policy,one,two,none\na,1200,1.5,\nb-1,10,4,\nb-2,30,5,\nb-3,20,0.125,1\n"


@pytest.mark.parametrize(
    ("key", "number"),
    [
        ("a; one", "1,200"),
        ("a; two", "1.5"),
        ("a; two; .2f", "1.50"),
        ("a; one; -3", "1,000"),
        ("b-*; one", "20"),
        ("b-3; two; .1%", "12.5 %"),
        ("a; one / two", "800"),
        ("b-*; one / two; .1f", "5.0"),
    ],
)
def test_a_quoted_number_is_replaced(tmp_path: Path, key: str, number: str) -> None:
    (tmp_path / "measured.csv").write_text(MEASURED)
    text = f"About <!-- value: measured.csv; {key} -->{{}}<!-- end --> steps."
    assert values.filled(text.format("7"), Path("page.md"), tmp_path) == text.format(number)


@pytest.mark.parametrize(
    ("mark", "message"),
    [
        ("is <!-- value: no.csv; a; one -->7<!-- end -->", "there is no file docs/no.csv"),
        ("is <!-- value: measured.csv; c; one -->7<!-- end -->", "no row 'c'"),
        ("is <!-- value: measured.csv; a; three -->7<!-- end -->", "no column 'three'"),
        ("is <!-- value: measured.csv; a; none -->7<!-- end -->", "no number in column 'none'"),
        ("is <!-- value: measured.csv; a -->7<!-- end -->", "expected FILE; ROW; COLUMN"),
        ("is <!-- value: measured.csv; a; one -->7 <b>", "no <!-- end -->"),
        ("<!-- value: measured.csv; a; one -->7<!-- end -->", "begins the line"),
        ("  - <!-- value: measured.csv; a; one -->7<!-- end -->", "begins the line"),
    ],
)
def test_a_mark_that_is_wrong_is_found(tmp_path: Path, mark: str, message: str) -> None:
    (tmp_path / "measured.csv").write_text(MEASURED)
    with pytest.raises(ValueError, match=rf"page\.md:2: .*{re.escape(message)}"):
        values.filled(f"one\n{mark}\n", Path("page.md"), tmp_path)


@pytest.mark.skipif(find_spec("matplotlib") is None, reason="matplotlib is not installed")
def test_equal_data_gives_equal_and_small_pictures(tmp_path: Path) -> None:
    rows = []
    for run in train.planned():
        data.write(tmp_path / "curves" / f"{run.name}.csv", data.thinned(log(300, 0.9 + run.seed / 50)))
        rows.append(row(run.runs, run.seed, 0.9, ""))
    data.write(tmp_path / "runs.csv", rows)
    text = tmp_path / "page.md"
    text.write_text(PAGE.read_text())
    drawn = []
    for _ in range(2):
        assert page.main(["--data", str(tmp_path), "--page", str(text)]) == 0
        drawn.append({path.name: path.read_text() for path in tmp_path.glob("*.svg")})
    assert drawn[0] == drawn[1]
    names = {"paper", "paper-wins", "default", "others", "rules"}
    assert set(drawn[0]) == {f"{name}{suffix}.svg" for name in names for suffix in ("", "-dark")}
    for name, svg in drawn[0].items():
        assert len(svg) < 60_000, name
    for theirs in PAPER.values():
        assert f"paper, {theirs.algorithm}" in drawn[0]["paper.svg"]
    assert "| 2s3z | 500,000 | 90.0 |" in text.read_text()


@pytest.mark.skipif(find_spec("matplotlib") is None, reason="matplotlib is not installed")
def test_charts_of_benchmarks_are_those_of_the_files(tmp_path: Path) -> None:
    for file in (benchmarks.PAGE, benchmarks.DETAILS, *benchmarks.FOLDER.glob("*.csv")):
        (tmp_path / file.name).write_text(file.read_text())
    text, details = tmp_path / benchmarks.PAGE.name, tmp_path / benchmarks.DETAILS.name
    argv = ["--data", str(tmp_path), "--page", str(text), "--details", str(details)]
    assert benchmarks.main(argv) == 0
    assert text.read_text() == benchmarks.PAGE.read_text()
    assert details.read_text() == benchmarks.DETAILS.read_text()
    drawn = {path.name for path in tmp_path.glob("*.svg")}
    assert drawn == {path.name for path in benchmarks.FOLDER.glob("*.svg")}
    for benchmark in benchmarks.BENCHMARKS:
        if benchmark.drawn:
            chart = (benchmarks.FOLDER / f"{benchmark.name}.svg").read_text()
            header, rows = benchmarks.shown(benchmark, benchmarks.FOLDER)
            bars = [row for row in rows if not benchmark.bars or row[0] in benchmark.bars]
            numbers = [cell for row in bars for cell in benchmarks.cells(row)[1:]]
            assert all(f">{word}<" in chart for word in numbers + header[1:] if word), benchmark.name
