"""The tools of docs/results.md and docs/benchmarks.md: tables, and charts where matplotlib is installed."""

from __future__ import annotations

import argparse
import json
import re
import shutil
import subprocess
import sysconfig
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import smaclite_pool as sp

from results import benchmarks, data, page, tables, train, values, zoo
from results.data import Row

PAGE = data.REPOSITORY / "docs" / "results.md"


def run(task: str, seed: int, win_rate: float, won_after: str = "") -> Row:
    """A row of the file that `smaclite-pool report` writes."""
    values = {"win_rate": str(win_rate), "mean_return": str(20 * win_rate)}
    evaluated = {f"{kind}_{name}": values[name] for kind in ("greedy", "sampled") for name in values}
    times = {"greedy_win_steps": won_after, "greedy_win_cpu_seconds": "12.2" if won_after else ""}
    return {
        "algorithm": "default",
        "task": task,
        "seed": str(seed),
        "cpu_seconds": "30.5",
        **evaluated,
        **times,
    }


def test_a_cell_is_median_and_range() -> None:
    shares = [0.5, 0.9, 0.8, 1.0, 0.7]
    rows = [run("8m", i + 1, share, "400000" if share > 0.7 else "") for i, share in enumerate(shares)]
    cells = [cell.strip() for cell in tables.maps(rows).splitlines()[-1].strip("|").split("|")]
    assert cells[:2] == ["8m", "80.0 (50.0 to 100.0)"]
    assert cells[-4:] == ["30", "400,000", "12", "3 of 5"]
    # Fewer than half won: the median is not known.
    few = tables.maps([{**entry, "greedy_win_steps": ""} for entry in rows[:3]] + rows[3:])
    assert few.splitlines()[-1].endswith("|  |  | 1 of 5 |")


def test_scenarios_are_sorted_by_the_values_of_their_numbers() -> None:
    names = ["27m_vs_30m", "3s5z", "MMM", "corridor", "3m", "zerg_10_vs_11", "zerg_5_vs_5"]
    assert sorted(names, key=tables.natural) == [
        "3m",
        "3s5z",
        "27m_vs_30m",
        "corridor",
        "MMM",
        "zerg_5_vs_5",
        "zerg_10_vs_11",
    ]


def test_rule_sets_are_compared_by_scenario() -> None:
    table = tables.rules([run("MMM", 1, 1.0), run("8m", 1, 0.3)], [run("MMM-paper", 1, 0.5)])
    assert table.splitlines()[2:] == [
        "| MMM | smaclite | 100.0 | 100.0 | 20.00 | 20.00 |",
        "| MMM | paper | 50.0 | 50.0 | 10.00 | 10.00 |",
    ]


def test_critics_are_compared_by_scenario() -> None:
    """That of 25m sees the state by default, that of 3m an observation."""
    runs = [run("25m", 1, 1.0), run("3m", 1, 1.0)]
    other_critic = [run("25m", 1, 0.2), run("25m", 2, 0.5), run("25m", 3, 0.9), run("3m", 1, 0.8)]
    assert tables.critics(runs, other_critic).splitlines()[2:] == [
        "| 3m | 80.0 | 80.0 | 30 | 100.0 | 100.0 | 30 |",
        "| 25m | 100.0 | 100.0 | 30 | 50.0 | 50.0 | 30 |",
    ]


def test_teams_that_do_not_look_stand_beside_those_that_do() -> None:
    runs = [run("zerg_10_vs_10", 1, 0.1), run("zerg_5_vs_5", 1, 0.5), run("zerg_5_vs_5", 2, 0.4)]
    assert tables.generated(runs, [run("zerg_5_vs_5", 1, 0.02)]).splitlines()[2:] == [
        "| zerg_5_vs_5 | 45.0 (40.0 to 50.0) | 45.0 (40.0 to 50.0) | 2.0 | 9.00 | 30 | 2 |",
        "| zerg_10_vs_10 | 10.0 | 10.0 |  | 2.00 | 30 | 1 |",
    ]


def test_agents_of_the_open_loop_observe_the_time_alone(tmp_path: Path) -> None:
    import smaclite_pool as sp

    for name, others in train.GROUPS["open-loop"].items():
        layout = sp.scenario(train.open_loop(tmp_path, name))["obs_layout"]
        assert [block["name"] for block in layout] == ["time"] and others == train.former(name)


def test_a_table_is_replaced_and_the_text_around_it_stays() -> None:
    text = "a\n<!-- table: one -->\nold\n<!-- end -->\nb\n<!-- table: two -->\n<!-- end -->\n"
    replaced = tables.insert(text, "one", "new\n")
    assert replaced == text.replace("old", "new")
    assert tables.insert(replaced, "one", "new\n") == replaced
    with pytest.raises(ValueError, match="<!-- table: three -->"):
        tables.insert(text, "three", "")


def test_the_page_has_a_place_for_every_table() -> None:
    nothing: dict[str, list[Row]] = {group: [] for group in data.GROUPS}
    for name, table in tables.tables(nothing, [], "").items():
        tables.insert(PAGE.read_text(), name, table)


def test_every_group_is_trained_and_kept() -> None:
    assert tuple(train.GROUPS) == tuple(train.KEPT) == data.GROUPS


def test_the_tables_of_the_page_are_those_of_the_files() -> None:
    text = PAGE.read_text()
    assert page.with_tables(text, data.FOLDER) == text, "run `just generate`"


def test_quoted_numbers_are_those_of_the_files() -> None:
    for path in values.PAGES:
        text = path.read_text()
        assert values.filled(text, path) == text, "run `just generate`"


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
        ("b-*; different two", "3"),
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


def test_equal_data_gives_an_equal_page(tmp_path: Path) -> None:
    shutil.copy(data.FOLDER / "search.csv", tmp_path)
    for group in data.GROUPS:
        shutil.copytree(data.FOLDER / group, tmp_path / group)
    text = tmp_path / "page.md"
    text.write_text(PAGE.read_text())
    assert page.main(["--data", str(tmp_path), "--page", str(text)]) == 0
    assert text.read_text() == PAGE.read_text()


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


@pytest.fixture
def program(monkeypatch: pytest.MonkeyPatch) -> Path:
    """The program of the installed package, in place of the one that was built beside it."""
    path = Path(sysconfig.get_path("scripts")) / "smaclite-pool"
    if shutil.which(path) is None:
        pytest.skip("the package was unpacked without its program")
    monkeypatch.setattr(data, "PROGRAM", path)
    return path


def trained(program: Path, run: Path, seed: int, *options: str) -> None:
    """A run of one update."""
    argv = [str(program), "train", "3m", "--seed", str(seed), "--steps", "64", *options, "--out", str(run)]
    subprocess.run(argv, check=True, capture_output=True)


def won(program: Path, run: Path, *options: str) -> None:
    """A run of one update that is said to have won everything."""
    trained(program, run, 3, "--network", "flat", *options)
    summary = {"win_rate": 1.0, "mean_return": 20.0, "mean_length": 20.0}
    final = {"steps": 0, "run_steps": 64, "cpu_seconds": 1.0, "greedy": summary, "sampled": summary}
    (run / "final.json").write_text(json.dumps({**final, "greedy_episodes": [1, 1]}))
    (run / "evaluations").mkdir()
    shutil.copy(run / "weights.safetensors", run / "evaluations/000000000000.safetensors")


def test_a_team_of_other_options_does_not_get_into_the_zoo(program: Path, tmp_path: Path) -> None:
    """A team of the rules `paper` competed with those of `smaclite`, as scenarios have the same names."""
    others = {
        "paper": ["--rules", "paper"],
        "last": ["--last-actions", "0"],
        "mixture": ["--opponent", "kite"],
        "self": ["--opponent", "self"],
    }
    won(program, tmp_path / "runs/default/3m/seed-3")
    for name, options in others.items():
        won(program, tmp_path / "runs/others" / name, *options)
    out = tmp_path / "zoo"
    with pytest.raises(SystemExit) as raised:
        zoo.main([str(tmp_path / "runs"), "--out", str(out)])
    lines = str(raised.value).splitlines()
    assert "default configuration" in lines[0] and not out.exists()
    expected = {
        "last": "config.last_actions is 0, not 4",
        "mixture": 'opponents is {"kite": 1.0}, not null',
        "paper": 'rules is "paper", not "smaclite"',
        "self": "config.enemies is ",
    }
    for line, (name, difference) in zip(lines[1:], expected.items(), strict=True):
        assert line.startswith(f"{tmp_path}/runs/others/{name}: ") and difference in line, line
    assert zoo.main([str(tmp_path / "runs/default"), "--out", str(out)]) == 0
    assert json.loads((out / "3m/card.json").read_text())["seed"] == 3
    with pytest.raises(SystemExit, match="no complete run"):
        zoo.main([str(tmp_path / "nowhere"), "--out", str(out)])


def test_a_run_on_several_maps_gets_into_the_zoo(
    program: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With the weights of its actor alone, and what it wins on each map."""
    monkeypatch.setattr(zoo, "EPISODES", 4)
    monkeypatch.setattr(zoo, "smac_maps", lambda: ["3m", "MMM"])
    argv = [str(program), "train", "--maps", "8m,MMM", "--steps", "64", "--num-envs", "4"]
    subprocess.run([*argv, "--out", str(tmp_path / "run")], check=True, capture_output=True)
    assert zoo.main([str(tmp_path / "run"), "--out", str(tmp_path)]) == 0
    card = json.loads((tmp_path / "all-maps/card.json").read_text())
    assert set(card["maps"]) == {"3m", "MMM"} and card["maps"]["3m"]["greedy"]["mean_length"] > 5
    obs = np.random.default_rng(1).normal(size=(1, 3, 30 + 4 * 9)).astype(np.float32)
    teams = [sp.load_team(tmp_path / name, map="3m") for name in ("run", "all-maps")]
    assert (teams[0].logits(obs) == teams[1].logits(obs)).all()


def test_teams_that_are_there_are_completed_up_to_the_number_of_seeds(
    program: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`--resume` alone left it at the seeds that were there, however many were asked for."""
    ran: list[list[str]] = []
    monkeypatch.setattr(train, "run", lambda *arguments: ran.append([*arguments]))
    options = argparse.Namespace(seeds=3, steps="2M")
    folder = tmp_path / "3m"
    rules = ["--rules", "paper"]

    train.train(folder, "3m", options, rules)
    new = "train 3m --seeds 3 --steps 2M --seed 1 --evaluate-every 100000 --rules paper --out"
    assert ran.pop() == [*new.split(), str(folder)]

    for seed in (1, 2):
        trained(program, folder / f"seed-{seed}", seed, *rules)
        file = folder / f"seed-{seed}" / "run.json"
        text = json.loads(file.read_text())
        text["config"]["evaluate_every"] = 100_000  # without the time for evaluations
        file.write_text(json.dumps(text))
    train.train(folder, "3m", options, rules)
    assert ran.pop() == ["train", "--resume", str(folder), "--seeds", "3", "--steps", "2M"]

    for others, seeds, message in [
        ([], 3, 'seed-1: rules is "paper", not "smaclite"; remove it'),
        ([*rules, "--lr-end", "1"], 3, "seed-1: config.lr_end is 0.05, not 1.0"),
        (rules, 1, "seed-2: its seed is 2, not between 1 and 1"),
    ]:
        with pytest.raises(SystemExit, match=message):
            train.train(folder, "3m", argparse.Namespace(seeds=seeds, steps="2M"), others)
    trained(program, folder / "seed-3", 3, *rules)
    with pytest.raises(SystemExit, match="seed-3: config.evaluate_every is null, not 100000"):
        train.train(folder, "3m", options, rules)
    assert not ran


def test_the_page_says_how_many_seeds_it_has() -> None:
    """It named the command that trains ten of them, and had three."""
    seeds = {row["seed"] for row in data.read(data.FOLDER / "default" / "runs.csv")}
    text = PAGE.read_text()
    assert (
        f"\njust results-train --seeds {len(seeds)} " in text and f"-->{len(seeds)}<!-- end --> seeds" in text
    )
    assert "--seeds 2 " in tables.commands([run("8m", seed, 1.0) for seed in (1, 2, 2)])
