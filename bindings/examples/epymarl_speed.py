"""Environment steps per second of EPyMARL's runners, without training.

    python bindings/examples/epymarl_speed.py EPYMARL/src --map MMM2 --envs 10 --runs 7

For each runner: medians over runs of batches of episodes, with QMIX's controller, untrained, acting by chance; steps
per second of the clock, and per second of processor time of all its processes together. The runners take turns, but
other work on the machine hits them unequally: measure on an idle one.

`parallel (smaclite)` is EPyMARL's own runner over the drop-in for the published package, `parallel (smac)` its own over
the SMAC face, `pool` is our `PoolRunner`. With `--published cpp`, where the published package is installed, EPyMARL's
own runner over that one is measured instead (`numpy`: without its RVO2 in C++, as EPyMARL's configuration has it).
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
from smaclite_pool import drop_in, smac
from smaclite_pool.epymarl import PoolRunner

torch: Any = importlib.import_module("torch")  # this way, so that types can be checked where EPyMARL's needs are not
yaml: Any = importlib.import_module("yaml")


def arguments(src: Path, scenario: str, envs: int, env: str, env_args: dict[str, Any]) -> Any:
    """EPyMARL's settings for QMIX."""
    settings = yaml.safe_load((src / "config" / "default.yaml").read_text())
    settings |= yaml.safe_load((src / "config" / "algs" / "qmix.yaml").read_text())
    settings |= {"env": env, "batch_size_run": envs, "use_cuda": False, "device": "cpu", "test_nepisode": envs}
    settings["env_args"] = {"map_name": scenario, "seed": 1, **env_args}
    return SimpleNamespace(**settings)


def set_up(runner: Any, args: Any) -> None:
    """What EPyMARL's `run.py` does before it trains."""
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


def processor_seconds() -> float:
    """Of this process and its living children."""
    ticks = 0
    for process in ["self", *(str(child.pid) for child in multiprocessing.active_children())]:
        figures = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
        ticks += int(figures[11]) + int(figures[12])  # user and system
    return ticks / os.sysconf("SC_CLK_TCK")


def main() -> None:
    """Measure, and print a line a runner."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("src", type=Path, help="EPyMARL's folder src")
    parser.add_argument("--map", default="MMM2")
    parser.add_argument("--envs", type=int, default=10)
    parser.add_argument("--runs", type=int, default=7)
    parser.add_argument("--published", choices=["cpp", "numpy"], help="measure the published smaclite alone")
    options = parser.parse_args()
    torch.set_num_threads(1)  # as EPyMARL's main.py does
    sys.path.insert(0, str(options.src))
    if not options.published:
        drop_in.install()
        smac.install()
    parallel = importlib.import_module("runners.parallel_runner").ParallelRunner
    limit = {"time_limit": sp.scenario(options.map)["episode_limit"]}
    logger = SimpleNamespace(log_stat=lambda *_: None)
    runners: dict[str, Any] = {}
    published = ("parallel (published)", parallel, "smaclite", {**limit, "use_cpp_rvo2": options.published == "cpp"})
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
            before, begin, worked = runner.t_env, time.perf_counter(), processor_seconds()
            while time.perf_counter() < begin + 1:  # the kernel counts processor time in hundredths of a second
                runner.run()
            steps, taken = runner.t_env - before, time.perf_counter() - begin
            if run > 0:  # the first run warms up
                speeds[name].append((steps / taken, steps / (processor_seconds() - worked)))
    for name, runner in runners.items():
        clock, processor = (sorted(kind) for kind in zip(*speeds[name], strict=True))
        print(
            f"{name:20} {statistics.median(clock):7.0f} steps/s ({clock[0]:.0f} to {clock[-1]:.0f}), "
            f"{statistics.median(processor):7.0f} per processor second ({processor[0]:.0f} to {processor[-1]:.0f})"
        )
        runner.close_env()


if __name__ == "__main__":
    main()
