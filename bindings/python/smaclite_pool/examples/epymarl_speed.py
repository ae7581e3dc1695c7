"""Environment steps per second of EPyMARL's runners, without training.

    python -m smaclite_pool.examples.epymarl_speed EPYMARL/src --map MMM2 --envs 10 --runs 7

For each runner, this prints medians over runs of batches of episodes, in which QMIX's untrained controller
chooses the actions: steps per second of wall time, and per second of CPU time of all processes together. The
runners take turns, but other load on the machine affects them unequally: measure on an idle machine.

`parallel (smaclite)` is EPyMARL's own runner on the drop-in replacement for the published package,
`parallel (smac)` the same runner on SMAC's interface, and `pool` is `PoolRunner`. `--published cpp` measures
EPyMARL's own runner on the published package instead, if it is installed (`numpy`: without its RVO2 in C++,
the default of EPyMARL's configuration).
"""

from __future__ import annotations

import argparse
import importlib
import multiprocessing
import os
import statistics
import sys
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import smaclite_pool as sp
from smaclite_pool import compat
from smaclite_pool.examples.options import extra
from smaclite_pool.marl.epymarl import PoolRunner

# Imported by name, so that types can be checked without them.
with extra("torch"):
    torch: Any = importlib.import_module("torch")
yaml: Any = importlib.import_module("yaml")


def arguments(src: Path, scenario: str, envs: int, env: str, env_args: dict[str, Any]) -> Any:
    """EPyMARL's settings for QMIX."""
    settings = yaml.safe_load((src / "config" / "default.yaml").read_text())
    settings |= yaml.safe_load((src / "config" / "algs" / "qmix.yaml").read_text())
    settings |= {"use_cuda": False, "device": "cpu"}
    settings |= {"env": env, "batch_size_run": envs, "test_nepisode": envs}
    settings["env_args"] = {"map_name": scenario, "seed": 1, **env_args}
    return SimpleNamespace(**settings)


def set_up(runner: Any, args: Any) -> None:
    """The set-up of EPyMARL's `run.py`."""
    info = runner.get_env_info()
    args.n_agents, args.n_actions, args.state_shape = info["n_agents"], info["n_actions"], info["state_shape"]
    groups = {"agents": args.n_agents}
    scheme = {
        "state": {"vshape": info["state_shape"]},
        "obs": {"vshape": info["obs_shape"], "group": "agents"},
        "actions": {"vshape": (1,), "group": "agents", "dtype": torch.long},
        "avail_actions": {"vshape": (info["n_actions"],), "group": "agents", "dtype": torch.int},
        "terminated": {"vshape": (1,), "dtype": torch.uint8},
        "reward": {"vshape": (1,)},
    }
    one_hot = importlib.import_module("components.transforms").OneHot(out_dim=args.n_actions)
    preprocess = {"actions": ("actions_onehot", [one_hot])}
    replay_buffer = importlib.import_module("components.episode_buffer").ReplayBuffer
    buffer = replay_buffer(scheme, groups, 1, info["episode_limit"] + 1, preprocess=preprocess, device="cpu")
    controller = importlib.import_module("controllers").REGISTRY[args.mac](buffer.scheme, groups, args)
    runner.setup(scheme=scheme, groups=groups, preprocess=preprocess, mac=controller)


def cpu_seconds() -> float:
    """CPU time of this process and its living children in seconds."""
    if sys.platform != "linux":
        raise SystemExit("error: processor time is read from Linux's /proc")
    ticks = 0
    for process in ["self", *(str(child.pid) for child in multiprocessing.active_children())]:
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
        ticks += int(fields[11]) + int(fields[12])  # user and system
    return ticks / os.sysconf("SC_CLK_TCK")


def main() -> None:
    """Measure, and print a line per runner."""
    keep_lines = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=keep_lines)
    parser.add_argument("src", type=Path, help="EPyMARL's folder src")
    parser.add_argument("--map", default="MMM2")
    parser.add_argument("--envs", type=int, default=10)
    parser.add_argument("--runs", type=int, default=7)
    parser.add_argument("--published", choices=["cpp", "numpy"], help="measure the published smaclite alone")
    options = parser.parse_args()
    torch.set_num_threads(1)  # as EPyMARL's main.py does
    sys.path.insert(0, str(options.src))
    if not options.published:
        compat.install_smaclite()
        compat.install_smac()
    parallel = importlib.import_module("runners.parallel_runner").ParallelRunner
    limit = {"time_limit": sp.scenario(options.map)["episode_limit"]}
    logger = SimpleNamespace(log_stat=lambda *_: None)
    runners: dict[str, Any] = {}
    published_args = {**limit, "use_cpp_rvo2": options.published == "cpp"}
    published = ("parallel (published)", parallel, "smaclite", published_args)
    ours = [
        ("parallel (smaclite)", parallel, "smaclite", limit),
        ("parallel (smac)", parallel, "sc2", {}),
        ("pool", PoolRunner, "smaclite", limit),
    ]
    for name, runner, env, env_args in [published] if options.published else ours:
        args = arguments(options.src, options.map, options.envs, env, env_args)
        runners[name] = runner(args, logger)
        set_up(runners[name], args)
    speeds: dict[str, list[tuple[float, float]]] = {name: [] for name in runners}
    for run in range(options.runs + 1):
        for name, runner in runners.items():
            before, begin, cpu_before = runner.t_env, time.perf_counter(), cpu_seconds()
            # The kernel counts CPU time in hundredths of a second.
            while time.perf_counter() < begin + 1:
                runner.run()
            steps, elapsed = runner.t_env - before, time.perf_counter() - begin
            if run > 0:  # the first run warms up
                speeds[name].append((steps / elapsed, steps / (cpu_seconds() - cpu_before)))
    for name, runner in runners.items():
        wall, cpu = (sorted(kind) for kind in zip(*speeds[name], strict=True))
        print(
            f"{name:20} {statistics.median(wall):7.0f} steps/s ({wall[0]:.0f} to {wall[-1]:.0f}), "
            f"{statistics.median(cpu):7.0f} per CPU second ({cpu[0]:.0f} to {cpu[-1]:.0f})"
        )
        runner.close_env()


if __name__ == "__main__":
    main()
