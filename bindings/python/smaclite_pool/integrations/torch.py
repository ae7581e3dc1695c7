"""PyTorch: the fields of a batch as tensors over the same memory (extra `torch`).

    import smaclite_pool as sp
    import torch
    from smaclite_pool.integrations.torch import tensors

    with sp.make("2s3z", num_envs=8) as envs:
        fields = tensors(envs.reset(seed=1))    # {"obs": float32 [8, 5, 80], "state": float32 [8, 120], ...}
        policy = torch.nn.Linear(envs.spec.obs_size, envs.spec.n_actions)
        logits = policy(fields["obs"]).masked_fill(~fields["avail_actions"], -torch.inf)
        actions = torch.distributions.Categorical(logits=logits).sample()
        fields = tensors(envs.step(actions.numpy()))

Nothing is copied. The memory is mapped read-only, which torch does not support: a write through an ordinary
tensor would end the process with SIGSEGV. The tensors are therefore `ReadOnly`: a write raises
InvalidRequest, results of computations are ordinary tensors, and views are `ReadOnly` too. `.plain` is the
ordinary tensor over the same memory, for `torch.compile` or to save the few microseconds per call of the
guard. Do not write to it, nor through `data_ptr()`, `storage()`, `untyped_storage()` or
`torch.utils.dlpack.to_dlpack`.

A tensor keeps its batch alive, as an array does. A lane limits the batches held at once to
`max_held_batches`, so `clone()` what you keep longer. `tensor.to("cuda")` copies; `pinned` makes that copy
asynchronous.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from .._extra import extra
from .._native import Batch
from .._requirements import require_names
from ..errors import InvalidRequest

with extra("torch"):
    import torch
    from torch.utils import dlpack

    from ._torch_read_only import ReadOnly

__all__ = ["ReadOnly", "pinned", "tensor", "tensors"]

REGISTER_READ_ONLY = 8
"""`cudaHostRegisterReadOnly`: the mapping of the host is not writable."""


def tensor(array: NDArray[Any]) -> ReadOnly:
    """A field of a batch as a tensor over the same memory, e.g. `tensor(batch.obs)`.

    An array that torch cannot read in place, such as one with negative strides of `Batch.replace`, is copied.
    """
    if min(array.strides, default=0) < 0 or not array.dtype.isnative:
        array = array.astype(array.dtype.newbyteorder("="), order="C")
    try:
        plain = dlpack.from_dlpack(array)
    except BufferError:  # versions of NumPy or torch without read-only DLPack; torch warns once per process
        plain = torch.from_numpy(array)
    return ReadOnly.over(plain)


def tensors(batch: Batch, names: Iterable[str] | None = None) -> dict[str, ReadOnly]:
    """The fields of a batch by name, as tensors over the same memory; all, unless `names` are given."""
    return {
        name: tensor(getattr(batch, name))
        for name in (batch.keys() if names is None else require_names("names", names))
    }


@contextmanager
def pinned(batch: Batch) -> Iterator[None]:
    """Page-lock the shared memory of the lane, so that copies to CUDA devices are asynchronous.

        envs = sp.connect("train")
        batch = envs.reset()
        with pinned(batch):
            while training:
                obs = tensor(batch.obs).to("cuda", non_blocking=True)       # returns at once
                actions = policy(obs).to("cpu")                             # waits for policy and copy
                batch = envs.step(actions.numpy())

    All frames of a lane lie in one mapping, so one call with any batch covers every later batch of these
    environments. Leave the block before the environments are closed. Hold a batch until its copy has
    finished, as its memory is reused once it is released.

    Raises InvalidRequest without CUDA or Linux, and RuntimeError if CUDA refuses (the device must support
    cudaDevAttrHostRegisterReadOnlySupported).
    """
    if sys.platform != "linux":
        raise InvalidRequest("pinning needs Linux; leave it out")
    if not torch.cuda.is_available():
        raise InvalidRequest("pinning serves copies to a GPU, but torch finds no CUDA device; leave it out")
    address = batch.env_id.ctypes.data
    start, end, writable = _mapping(address)
    runtime, flags = torch.cuda.cudart(), 0 if writable else REGISTER_READ_ONLY
    torch.cuda.check_error(int(runtime.cudaHostRegister(start, end - start, flags)))
    try:
        yield
    finally:
        torch.cuda.synchronize()
        torch.cuda.check_error(int(runtime.cudaHostUnregister(start)))


def _mapping(address: int) -> tuple[int, int, bool]:
    """Start, end and writability of the mapping that contains an address, according to the kernel."""
    for line in Path("/proc/self/maps").read_text().splitlines():
        bounds, permissions, *_ = line.split()
        start, end = (int(bound, 16) for bound in bounds.split("-"))
        if start <= address < end:
            return start, end, "w" in permissions
    raise InvalidRequest(f"no memory is mapped at {address:#x}")
