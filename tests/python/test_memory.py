"""Batches are read in place: no copy is made between worker and array, and held memory stays valid."""

from __future__ import annotations

import gc
import os
import tracemalloc
import weakref
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import smaclite_pool as sp

from conftest import Serve, linux, run_script, shm_prefix


class Mapping(NamedTuple):
    start: int
    end: int
    permissions: str
    offset: int
    file: tuple[str, int]  # device and inode
    path: str


def mappings(pid: int) -> list[Mapping]:
    found = []
    for line in Path(f"/proc/{pid}/maps").read_text().splitlines():
        addresses, permissions, offset, device, inode, *path = line.split(maxsplit=5)
        start, end = (int(address, 16) for address in addresses.split("-"))
        file = (device, int(inode))
        found.append(Mapping(start, end, permissions, int(offset, 16), file, path[0] if path else ""))
    return found


def mapping_of(array: Any) -> Mapping:
    address = array.ctypes.data
    [mapping] = [m for m in mappings(os.getpid()) if m.start <= address and address + array.nbytes <= m.end]
    return mapping


@linux
@pytest.mark.parametrize("attached", [False, True])
def test_zero_copy(attached: bool, serve: Serve, runtime_dir: Path) -> None:
    """An observation is in the iceoryx2 data segment that the supervisor's workers write to, mapped
    read-only. A later write to that file shows in the array, so there is no copy in between."""
    if attached:
        serve("2s3z:8", "--name", "train")
    with sp.connect("train", timeout=10) if attached else sp.make("2s3z", num_envs=8) as envs:
        batch = envs.reset(seed=1)
        mapping = mapping_of(batch.obs)
        assert mapping.path.startswith(f"/dev/shm/{shm_prefix(runtime_dir)}"), mapping
        assert mapping.path.endswith(".data"), mapping
        assert mapping.permissions == "r--s"
        writers = [m for m in mappings(envs.spec.pid) if m.file == mapping.file and "w" in m.permissions]
        assert len(writers) == 1, "the supervisor maps the same file for writing"
        for field in batch.keys():
            assert mapping_of(getattr(batch, field)).file == mapping.file, field

        with open(mapping.path, "r+b") as segment:
            segment.seek(batch.obs.ctypes.data - mapping.start + mapping.offset)
            segment.write(np.float32(123.25).tobytes())
        assert batch.obs[0, 0, 0] == 123.25


def test_arrays_are_read_only_and_stay_so() -> None:
    with sp.make("2s3z", num_envs=2) as envs:
        batch = envs.reset()
        for name in batch.keys():
            view = getattr(batch, name)
            assert isinstance(view.base, sp.Frame)
            with pytest.raises(ValueError, match="read-only"):
                view[...] = 0
            with pytest.raises(ValueError, match="WRITEABLE"):
                view.flags.writeable = True
            with pytest.raises(ValueError, match="WRITEABLE"):
                view[:1].flags.writeable = True
        own = batch.copy()
        assert all(array.flags.owndata and array.flags.writeable for array in own.values())


def test_a_held_batch_does_not_change_while_others_arrive() -> None:
    with sp.make("2s3z", num_envs=4, max_held_batches=3) as envs:
        first = envs.reset(seed=1)
        own = first.copy()
        for _ in range(50):
            envs.step(envs.sample_actions())
        assert all(np.array_equal(getattr(first, name), array) for name, array in own.items())


def test_a_slice_outlives_batch_environments_and_pool() -> None:
    for _ in range(10):
        envs = sp.make("2s3z", num_envs=4)
        batch = envs.reset(seed=1)
        part, expected = batch.obs[1:3, ::2], batch.obs[1:3, ::2].copy()
        envs.step(envs.sample_actions())
        envs.close()
        del envs, batch
        gc.collect()
        with sp.make("2s3z", num_envs=4) as other:
            other.reset(seed=2)
        assert np.array_equal(part, expected)


def test_a_batch_is_freed_when_its_last_reference_goes() -> None:
    """A reference cycle between a batch and its arrays would keep frames until the garbage collector runs."""
    gc.disable()
    try:
        with sp.make("2s3z", num_envs=2, max_held_batches=2) as envs:
            batch = envs.reset()
            views = [getattr(batch, name) for name in batch.keys()]
            gone = weakref.ref(batch)
            del batch, views
            assert gone() is None
            for _ in range(20):
                assert envs.step(envs.sample_actions()).obs.size
    finally:
        gc.enable()


def test_holding_too_many_batches_is_an_error_until_one_is_released() -> None:
    with sp.make("2s3z", num_envs=2, max_held_batches=2) as envs:
        held: list[Any] = [envs.reset(seed=1).obs]  # arrays hold their frame
        held.append(envs.step(envs.sample_actions()))
        first = held[0].copy()
        with pytest.raises(sp.errors.TooManyBatchesHeld, match="all 2 batches"):
            envs.step(envs.sample_actions())
        assert np.array_equal(held[0], first), "a held batch is never overwritten"
        # It was forgotten, although that made no room, and nothing seemed to have been received.
        assert envs.sample_actions().shape == (2, 5)
        held.clear()
        assert envs.recv(timeout=60).episode_length.tolist() == [2, 2], "the batch was still being computed"


def test_a_process_that_closes_nothing_leaves_no_files() -> None:
    """The interpreter does not free objects that outlive it. The fixture `runtime_dir` detects left files."""
    done = run_script(
        """
import smaclite_pool as sp
envs = sp.make("2s3z", num_envs=2)
batch = envs.reset()
cycle = [envs, batch.obs]
cycle.append(cycle)
class Holder:
    kept = cycle
import sys; sys.kept = (cycle, batch)
"""
    )
    assert done.returncode == 0, done.stderr


def test_a_step_allocates_its_batch_only() -> None:
    """Python's and NumPy's allocations, traced. The Rust tests count those of the client."""
    with sp.make("27m_vs_30m", num_envs=16) as envs:
        envs.reset(seed=1)
        actions = envs.sample_actions()

        def peak(steps: int) -> int:
            """The most bytes that were held at once beyond those held before."""
            before, _ = tracemalloc.get_traced_memory()
            tracemalloc.reset_peak()
            for _ in range(steps):
                envs.step(envs.sample_actions(out=actions))
            _, highest = tracemalloc.get_traced_memory()
            return highest - before

        tracemalloc.start()
        try:
            peak(10)
            assert 0 < peak(1) < 768  # two batches: the new one, and that of the step before
            assert peak(50) < 768, "nothing is kept"
        finally:
            tracemalloc.stop()
