"""Datasets: arrays in memory and mapped, what they have, and the formats of other libraries."""

from __future__ import annotations

import importlib
import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp

from conftest import program

SCENARIO = "2s3z"
STEPS = 1500


def record(file: Path, *arguments: str, policy: str = "random", scenario: str = SCENARIO) -> Path:
    program("dataset", "record", policy, "--scenario", scenario, "--out", file, *arguments)
    return file


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Episodes of random actions; the rest of the module reads it."""
    return record(tmp_path_factory.mktemp("dataset") / "2s3z.smdata", "--steps", str(STEPS), "--seed", "3")


@pytest.fixture(scope="module")
def truncated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Units that hold their ground far from the enemies: some episodes reach the limit."""
    folder = tmp_path_factory.mktemp("dataset")
    program("new", "scenario", folder / "short.json")
    scenario = json.loads((folder / "short.json").read_text())
    scenario["episode_limit"] = 30
    (folder / "short.json").write_text(json.dumps(scenario))
    return record(folder / "short.smdata", "--episodes", "40", scenario=str(folder / "short.json"))


def test_arrays_are_those_of_the_table(file: Path) -> None:
    dataset = sp.Dataset(file)
    arrays, card = dataset.expand(), dataset.card
    assert list(arrays) == [name for name, *_ in sp.DATASET_ARRAYS]
    lengths = {"T": card["steps"], "E": card["episodes"], **card["sizes"]}
    for name, dtype, shape, _ in sp.DATASET_ARRAYS:
        assert arrays[name].dtype == dtype and arrays[name].flags.c_contiguous, name
        assert arrays[name].shape == tuple(lengths[axis] for axis in shape.split(", ")), name
    assert card["steps"] >= STEPS and card["scenario"] == dataset.scenario == SCENARIO
    assert len(dataset.hash) == 32 and dataset.program == f"smaclite-pool {sp.__version__}"
    assert repr(dataset).endswith(f"2s3z.smdata: {card['steps']} steps, {card['episodes']} episodes>")


def test_mapped_arrays_are_equal_and_read_only(file: Path, tmp_path: Path) -> None:
    dataset = sp.Dataset(file)
    in_memory = dataset.expand(threads=1)
    mapped = dataset.expand(tmp_path / "arrays", threads=3)
    for name, array in in_memory.items():
        assert isinstance(mapped[name], np.memmap) and mapped[name].dtype == array.dtype
        np.testing.assert_array_equal(mapped[name], array)
    with pytest.raises(ValueError, match="read-only"):
        mapped["obs"][0] = 0
    card = json.loads((tmp_path / "arrays/card.json").read_text())
    assert card == {**dataset.card, "hash": dataset.hash, "program": dataset.program}


def test_an_environment_that_plays_the_actions_gives_the_arrays(truncated: Path) -> None:
    """By `settings`, seed and actions, step for step, with both kinds of end."""
    dataset = sp.Dataset(truncated)
    arrays, episodes = dataset.expand(), dataset.episodes
    assert dataset.scenario is None
    assert dataset.settings == {"rules": "smaclite", "episode_limit": 30, "opponent": {"attack_move": 1.0}}
    ends = set()
    with sp.make(truncated.with_name("short.json"), 1, autoreset_mode="Disabled", **dataset.settings) as envs:
        for i, (seed, start, length) in enumerate(
            zip(episodes["seed"], episodes["start"], episodes["length"], strict=True)
        ):
            batch = envs.reset(seed=int(seed))
            for step in range(start, start + length):
                for name in ("obs", "state", "avail_actions"):
                    np.testing.assert_array_equal(getattr(batch, name)[0], arrays[name][step], strict=True)
                batch = envs.step(arrays["actions"][None, step])
                for name in ("reward", "terminated", "truncated", "battle_won"):
                    assert getattr(batch, name)[0] == arrays[name][step], name
            np.testing.assert_array_equal(batch.obs[0], arrays["final_obs"][i])
            np.testing.assert_array_equal(batch.state[0], arrays["final_state"][i])
            ends.add((bool(batch.terminated[0]), bool(batch.truncated[0])))
    assert ends == {(True, False), (False, True)}
    np.testing.assert_array_equal(arrays["episode_start"], episodes["start"])


def test_errors_say_what_is_accepted(file: Path, tmp_path: Path) -> None:
    dataset = sp.Dataset(file)
    with pytest.raises(sp.errors.InvalidRequest, match="unknown array `rewards`; the arrays are obs, state"):
        dataset.expand(fields=["obs", "rewards"])
    with pytest.raises(sp.errors.InvalidRequest, match="threads must be between 1 and 1024, got 0"):
        dataset.expand(threads=0)
    with pytest.raises(sp.errors.InvalidRequest, match="must be written to a new folder"):
        dataset.expand(tmp_path)
    with pytest.raises(TypeError):
        dataset.expand(fields="obs")
    with pytest.raises(FileNotFoundError, match="nowhere"):
        dataset.expand(tmp_path / "nowhere/arrays")
    with pytest.raises(FileNotFoundError, match="none.smdata"):
        sp.Dataset(tmp_path / "none.smdata")
    (tmp_path / "damaged.smdata").write_bytes(file.read_bytes()[:-20])
    with pytest.raises(
        sp.errors.PoolError, match="damaged.smdata: expected a dataset.*the file ends too early"
    ):
        sp.Dataset(tmp_path / "damaged.smdata")


def export(file: Path, out: Path, to: str, uid: str) -> subprocess.CompletedProcess[str]:
    arguments: list[str | Path] = ["--to", to, "--out", out, "--uid", uid, "--python", sys.executable]
    return program("dataset", "export", file, *arguments, check=False)


@pytest.mark.parametrize("to", ["vault", "minari"])
def test_a_missing_package_is_named(to: str, file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "packages"
    folder.mkdir()
    for package in ("flashbax", "minari"):
        (folder / f"{package}.py").write_text("import of_this_name_is_nothing\n")
    arguments: list[str | Path] = ["--to", to, "--out", tmp_path / "x.vlt", "--uid", "x-v0"]
    arguments += ["--python", sys.executable]
    done = program("dataset", "export", file, *arguments, check=False, PYTHONPATH=str(folder))
    assert done.returncode == 1 and f"pip install 'smaclite-pool[{to}]'" in done.stderr, done.stderr
    assert "Traceback" not in done.stderr and not (tmp_path / "x.vlt").exists()


def test_a_vault_has_the_arrays_and_the_schema_of_og_marl(truncated: Path, tmp_path: Path) -> None:
    vault_module: Any = pytest.importorskip("flashbax.vault")
    done = export(truncated, tmp_path / "short.vlt", "vault", "Poor")
    assert done.returncode == 0, done.stderr
    assert [path.name for path in (tmp_path / "short.vlt").iterdir()] == ["Poor"]
    vault = vault_module.Vault("short.vlt", rel_dir=str(tmp_path), vault_uid="Poor")
    experience = vault.read().experience
    dataset = sp.Dataset(truncated)
    arrays = dataset.expand()
    agents = dataset.card["sizes"]["n_agents"]
    expected = {
        "actions": arrays["actions"],
        "observations": arrays["obs"],
        "legals": arrays["avail_actions"].astype(np.float32),
        "state": arrays["state"],
    }
    for name, source in {"rewards": "reward", "terminals": "terminated", "truncations": "truncated"}.items():
        expected[name] = np.repeat(arrays[source][:, None].astype(np.float32), agents, axis=1)
    found = {**experience, **experience["infos"]}
    assert found.keys() - expected.keys() == {"infos"} and list(experience["infos"]) == ["legals", "state"]
    for name, array in expected.items():
        np.testing.assert_array_equal(np.asarray(found[name]), array[None], strict=True, err_msg=name)
    assert (experience["terminals"] * experience["truncations"] == 0).all()
    metadata = json.loads((tmp_path / "short.vlt/Poor/metadata.json").read_text())
    assert metadata["smaclite_pool"]["hash"] == dataset.hash

    done = export(truncated, tmp_path / "short.vlt", "vault", "Poor")
    assert done.returncode == 1 and "exists; choose another uid" in done.stderr
    done = export(truncated, tmp_path / "short", "vault", "Poor")
    assert done.returncode == 1 and "must end in .vlt" in done.stderr


def test_minari_reads_the_episodes(
    file: Path, truncated: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("h5py")
    minari: Any = pytest.importorskip("minari")
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    for source, uid in [(file, "smaclite/2s3z/poor-v0"), (truncated, "smaclite/short-v0")]:
        done = export(source, tmp_path, "minari", uid)
        assert done.returncode == 0, done.stderr
        dataset, written = sp.Dataset(source), minari.load_dataset(uid)
        arrays, episodes = dataset.expand(), dataset.episodes
        assert (written.total_episodes, written.total_steps) == (len(episodes["seed"]), len(arrays["reward"]))
        for i, episode in enumerate(written.iterate_episodes()):
            steps = slice(episodes["start"][i], episodes["start"][i] + episodes["length"][i])
            for name, field in {"obs": "obs", "state": "state", "action_mask": "avail_actions"}.items():
                whole = np.concatenate([arrays[field][steps], arrays[f"final_{field}"][i : i + 1]])
                assert len(whole) == len(episode) + 1
                np.testing.assert_array_equal(episode.observations[name], whole)
            for name, field in {
                "actions": "actions",
                "rewards": "reward",
                "terminations": "terminated",
                "truncations": "truncated",
            }.items():
                np.testing.assert_array_equal(getattr(episode, name), arrays[field][steps], strict=True)
            assert episode.infos["battle_won"][-1] == arrays["battle_won"][steps][-1]
        seeds = [data["seed"] for data in written.storage.get_episode_metadata(range(3))]
        assert seeds == episodes["seed"][:3].tolist()
        assert written.storage.metadata["smaclite_pool"]["hash"] == dataset.hash
        done = export(source, tmp_path, "minari", uid)
        assert done.returncode == 1 and "exists; choose another id" in done.stderr

    written = minari.load_dataset("smaclite/2s3z/poor-v0")
    env = written.recover_environment()
    assert written.observation_space == env.observation_space
    assert written.action_space == env.action_space
    observation, _ = env.reset(seed=int(sp.Dataset(file).episodes["seed"][0]))
    np.testing.assert_array_equal(observation["obs"], sp.Dataset(file).expand(fields=["obs"])["obs"][0])
    env.close()
    done = export(file, tmp_path, "minari", "no version")
    assert done.returncode == 1 and "must be like smaclite/3m/good-v0" in done.stderr


@pytest.mark.parametrize("to", ["vault", "minari"])
def test_an_export_that_is_ended_leaves_nothing(to: str, tmp_path: Path) -> None:
    """The program ended, and its Python process went on for minutes and wrote the dataset."""
    pytest.importorskip({"vault": "flashbax.vault", "minari": "minari"}[to])
    file, out = record(tmp_path / "big.smdata", "--steps", "200000"), tmp_path / "out.vlt"
    command = [sys.executable, "-m", "smaclite_pool", "dataset", "export", str(file), "--to", to]
    command += ["--out", str(out), "--uid", "x-v0"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    while not any(out.glob(".export-*")):
        assert process.poll() is None
        time.sleep(0.01)
    process.terminate()
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 128 + signal.SIGTERM and "nothing was written" in errors, errors
    assert list(out.iterdir()) == []


def test_a_dataset_that_another_program_wrote_meanwhile_is_kept(tmp_path: Path) -> None:
    """It was removed, because the export that found it then failed."""
    from smaclite_pool.integrations._export import complete

    ours, theirs = tmp_path / "partial", tmp_path / "x-v0"
    for folder in (ours, theirs):
        folder.mkdir()
        (folder / "data").write_text(folder.name)
    with pytest.raises(sp.errors.InvalidRequest, match="x-v0` exists"):
        complete(ours, theirs)
    assert (theirs / "data").read_text() == "x-v0"


def test_the_space_of_a_dataset_for_minari_has_its_observations(tmp_path: Path) -> None:
    """It was that of the map by its name, under other rules: states of drawn teams were outside of it."""
    pytest.importorskip("gymnasium")
    minari: Any = importlib.import_module("smaclite_pool.integrations.minari")
    options = ["--rules", "starcraft", "--steps", "300", "--seed", "3"]
    recorded = record(tmp_path / "drawn.smdata", *options, scenario="terran_5_vs_5")
    dataset = sp.Dataset(recorded)
    arrays, space = dataset.expand(), minari.environment(dataset)["observation_space"]
    for t in range(len(arrays["reward"])):
        seen = {"obs": arrays["obs"][t], "state": arrays["state"][t]}
        seen["action_mask"] = arrays["avail_actions"][t].astype(np.int8)
        assert space.contains(seen), t


@pytest.mark.parametrize(
    ("map_file", "message"),
    [("", "--map-file must name its file"), ("nowhere.json", "nowhere.json")],
    ids=["missing", "wrong"],
)
def test_behaviour_cloning_asks_for_the_map_before_it_learns(
    map_file: str, message: str, truncated: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It cloned for minutes, and then failed for want of --map-file."""
    pytest.importorskip("torch")
    pytest.importorskip("safetensors")
    example: Any = importlib.import_module("smaclite_pool.examples.behaviour_cloning")

    def learn(*_: Any) -> None:
        raise AssertionError("it learns")

    monkeypatch.setattr(example, "learn", learn)
    with pytest.raises(sp.errors.PoolError, match=message):
        example.clone(example.Options(dataset=str(truncated), map_file=map_file))
    with pytest.raises(AssertionError, match="it learns"):
        example.clone(
            example.Options(dataset=str(truncated), map_file=str(truncated.with_name("short.json")))
        )


def test_behaviour_cloning_learns(tmp_path: Path) -> None:
    torch = pytest.importorskip("torch")
    pytest.importorskip("safetensors")
    example: Any = importlib.import_module("smaclite_pool.examples.behaviour_cloning")
    file = record(tmp_path / "3m.smdata", "--steps", "30000", policy="focus_fire", scenario="3m")
    options = example.Options(dataset=str(file), seed=1, evaluate_episodes=64)
    policy, dataset = example.clone(options)
    result = example.evaluate(policy, dataset, options)
    assert len(result) == 64 and result.win_rate > 0.8, result
    again, _ = example.clone(options)
    weights = again.state_dict()
    assert all(torch.equal(tensor, weights[name]) for name, tensor in policy.state_dict().items())
