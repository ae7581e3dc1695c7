"""Too little of something (files, address space) is an error of the call that meets it, not an endless wait.

With 1,024 open files, the default of most shells, 17 environments were made, and then a `reset` never
returned: the pool could not open the learner's requests, which only iceoryx2's log said.
"""

from __future__ import annotations

import subprocess
import sys

import pytest

if sys.platform != "linux":
    pytest.skip("limits are set and looked at by what Linux has for them", allow_module_level=True)

from conftest import run_script

#: Sets each limit in turn, and reports the errors and how many pools played. A learner that waits raises
#: `Timeout`, which is not caught. What is imported late is imported before there is a limit.
EMBEDDED = """
import os, resource, smaclite_pool as sp

def play():
    with sp.make("3m", num_envs=4, threads=1) as envs:
        envs.reset(seed=1, timeout=20)
        envs.step(envs.sample_actions(), timeout=20)

play()
before = resource.getrlimit(resource.RLIMIT_NOFILE)
played = []
for limit in range(len(os.listdir("/proc/self/fd")), 48):
    resource.setrlimit(resource.RLIMIT_NOFILE, (limit, before[1]))
    try:
        play()
        played.append(limit)
    except (sp.errors.StartError, sp.errors.ConnectError) as error:
        text = str(error)
    else:
        text = None
    resource.setrlimit(resource.RLIMIT_NOFILE, before)
    print(limit, text or "plays")
    assert text is None or "file descriptors" in text and "`ulimit -n`" in text, (limit, text)
assert played and played[0] > 12 and played == list(range(played[0], 48)), played
"""

#: How many pools fit below a limit, all of which then play.
MANY = """
import resource, smaclite_pool as sp
resource.setrlimit(resource.RLIMIT_NOFILE, (256, 256))
pools = []
try:
    for _ in range(100):
        pools.append(sp.make("3m", num_envs=1, threads=1, wait="block"))
except sp.errors.PoolError as error:
    assert "the limit is 256" in str(error), error
for envs in pools:
    envs.reset(seed=1, timeout=20)
    envs.step(envs.sample_actions(), timeout=20)
print(len(pools))
assert len(pools) >= 8
"""

#: Under a limit of address space: the requests of snapshots are large.
ADDRESS_SPACE = """
import resource, sys, smaclite_pool as sp
fields = ["obs", "snapshot", "avail_actions"]

def play():
    with sp.make("10m_vs_11m", num_envs=256, threads=1, fields=fields) as envs:
        envs.reset(seed=1, timeout=20)
        envs.step(envs.sample_actions(), timeout=20)

sp.make("3m", num_envs=1, threads=1).close()
used = int(open("/proc/self/statm").read().split()[0]) * 4096
limit = used + (int(sys.argv[1]) << 20)
resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
try:
    play()
    print("plays")
except sp.errors.PoolError as error:
    print(type(error).__name__, error)
    assert "ulimit -v" in str(error), error
except MemoryError as error:
    print("MemoryError")
"""


def succeeds(script: str) -> None:
    done = run_script(script)
    print(done.stdout)
    assert done.returncode == 0, done.stderr


def test_an_embedded_pool_opens_few_files() -> None:
    # It was 61, where the documentation said ten.
    script = """
import os, smaclite_pool as sp
count = lambda: len(os.listdir("/proc/self/fd"))
before = count()
with sp.make("3m", num_envs=4, threads=1) as envs:
    batch = envs.reset(seed=1)
    envs.step(envs.sample_actions())
    print(count() - before)
    assert count() - before <= 24
del batch
assert count() <= before, count() - before
"""
    succeeds(script)


def test_any_limit_of_files_is_an_error_or_enough() -> None:
    succeeds(EMBEDDED)


def test_pools_that_were_made_below_a_limit_play() -> None:
    succeeds(MANY)


@pytest.mark.parametrize("megabytes", [4, 24, 40, 48, 56, 64, 72, 128])
def test_any_limit_of_address_space_is_an_error_or_enough(megabytes: int) -> None:
    command = [sys.executable, "-c", ADDRESS_SPACE, str(megabytes)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    print(done.stdout, done.stderr)
    # Where it is too little for a small allocation, the allocator ends the process.
    assert done.returncode == 0 or "memory allocation of" in done.stderr, done.stderr
