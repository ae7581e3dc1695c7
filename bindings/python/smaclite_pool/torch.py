"""PyTorch over a batch's shared memory: nothing is copied, and nothing can be spoilt by accident (extra `torch`).

    import smaclite_pool as sp
    import torch
    from smaclite_pool.torch import tensors

    with sp.make("2s3z", num_envs=8) as envs:
        seen = tensors(envs.reset(seed=1))      # {"obs": float32 [8, 5, 80], "avail_actions": bool [8, 5, 11], ...}
        policy = torch.nn.Linear(envs.obs_size, envs.n_actions)
        logits = policy(seen["obs"]).masked_fill(~seen["avail_actions"], -torch.inf)
        actions = torch.distributions.Categorical(logits=logits).sample()
        seen = tensors(envs.step(actions.numpy()))

The tensors lie in memory that is mapped read-only, which torch does not know: a write through an ordinary tensor would
end the process by SIGSEGV. So they are `ReadOnly`: a write raises, what is computed from them is an ordinary tensor,
and a view of one is one. `.plain` gives the ordinary tensor over the same memory, for `torch.compile` or to save the
guard's few microseconds a call; it is on you not to write to it, nor through `data_ptr()` or `untyped_storage()`.

A tensor keeps its frame, as an array does: a lane lets a learner hold `max_held_batches` batches at once, so `clone()` what
must stay longer. `tensor.to("cuda")` copies; `pinned` makes that copy asynchronous.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.utils import dlpack

from ._native import Batch
from .errors import InvalidRequest

__all__ = ["ReadOnly", "pinned", "tensor", "tensors"]

REGISTER_READ_ONLY = 8
"""cudaHostRegisterReadOnly: the host's mapping cannot be written."""


class ReadOnly(Tensor):
    """A tensor that is read in place: operations that would write to it raise InvalidRequest.

    Computing with it gives ordinary tensors; `clone()` and `numpy()` give copies that can be written.
    """

    plain: Tensor
    """The ordinary tensor over the same memory. A write to it ends the process."""

    __torch_function__ = torch._C._disabled_torch_function_impl  # type: ignore[assignment]

    @staticmethod
    def over(plain: Tensor) -> ReadOnly:
        """Guards the memory of a tensor."""
        guarded: ReadOnly = Tensor._make_subclass(ReadOnly, plain)
        guarded.plain = plain
        return guarded

    @classmethod
    def __torch_dispatch__(  # type: ignore[override]  # torch's own is a placeholder
        cls, func: Any, types: Any, args: Any = (), kwargs: Any = None
    ) -> Any:
        """Every operation comes by here; its schema says which arguments it writes and whether it returns views."""
        kwargs, schema = kwargs or {}, func._schema
        if schema.is_mutable:
            given = {argument.name: value for argument, value in zip(schema.arguments, args, strict=False)} | kwargs
            for argument in schema.arguments:
                if argument.alias_info is not None and argument.alias_info.is_write:
                    _refuse_to_write(func, given.get(argument.name))
        result = func(*_plain(args), **{name: _plain(value) for name, value in kwargs.items()})
        is_view = not schema.is_mutable and any(returned.alias_info is not None for returned in schema.returns)
        return _guarded(result) if is_view else result

    def numpy(self, *, force: bool = False) -> NDArray[Any]:
        """A copy as an array; for one in place take the batch's own."""
        return self.plain.clone().numpy(force=force)

    def tolist(self) -> Any:
        """The elements as Python's."""
        return self.plain.tolist()

    def __repr__(self, *, tensor_contents: Any = None) -> str:  # type: ignore[override]
        return f"ReadOnly({self.plain!r})"

    def __deepcopy__(self, memo: dict[int, Any]) -> Tensor:
        return self.plain.clone()

    def __reduce_ex__(self, protocol: Any) -> Any:
        return self.plain.clone().__reduce_ex__(protocol)

    def __dlpack__(self, **options: Any) -> Any:
        raise InvalidRequest("DLPack cannot hand a read-only tensor on: take it from the batch's array or from a clone")


def tensor(array: NDArray[Any]) -> ReadOnly:
    """A field of a batch as a tensor over the same memory, e.g. `tensor(batch.obs)`."""
    try:
        plain = dlpack.from_dlpack(array)
    except BufferError:  # NumPy or torch from before DLPack knew read-only memory; torch warns, once a process
        plain = torch.from_numpy(array)
    return ReadOnly.over(plain)


def tensors(batch: Batch, names: Iterable[str] | None = None) -> dict[str, ReadOnly]:
    """The fields of a batch (`names`, or all) as tensors over the same memory, by name."""
    return {name: tensor(getattr(batch, name)) for name in (batch.keys() if names is None else names)}


@contextmanager
def pinned(batch: Batch) -> Iterator[None]:
    """Page-lock the lane's shared memory, so that CUDA copies from it without a stop in between.

        envs = sp.connect("train")
        batch = envs.reset()
        with pinned(batch):
            while training:
                obs = tensor(batch.obs).to("cuda", non_blocking=True)       # returns at once
                actions = policy(obs).to("cpu")                             # waits for policy and copy
                batch = envs.step(actions.numpy())

    All frames of a lane lie in one mapping, so one call, with any batch, serves for every later batch of these
    environments. Leave the block before the environments are closed. Hold a batch until its copy is done: the frame
    is filled anew once it is let go. Raises InvalidRequest without CUDA, RuntimeError if CUDA refuses (a device must
    be able to register read-only memory: cudaDevAttrHostRegisterReadOnlySupported).
    """
    if not torch.cuda.is_available():
        raise InvalidRequest("pinning is for copies to a GPU, and torch finds no CUDA here; leave it out")
    address = batch.env_id.ctypes.data
    start, end, writable = _mapping(address)
    runtime = torch.cuda.cudart()
    torch.cuda.check_error(int(runtime.cudaHostRegister(start, end - start, 0 if writable else REGISTER_READ_ONLY)))
    try:
        yield
    finally:
        torch.cuda.synchronize()
        torch.cuda.check_error(int(runtime.cudaHostUnregister(start)))


def _mapping(address: int) -> tuple[int, int, bool]:
    """Start, end and writability of the mapping that holds an address, as the kernel has it."""
    for line in Path("/proc/self/maps").read_text().splitlines():
        bounds, permissions, *_ = line.split()
        start, end = (int(bound, 16) for bound in bounds.split("-"))
        if start <= address < end:
            return start, end, "w" in permissions
    raise InvalidRequest(f"no memory is mapped at {address:#x}")


def _plain(value: Any) -> Any:
    if isinstance(value, ReadOnly):
        return value.plain
    return type(value)(map(_plain, value)) if isinstance(value, list | tuple) else value


def _guarded(value: Any) -> Any:
    if isinstance(value, list | tuple):
        return type(value)(map(_guarded, value))
    return ReadOnly.over(value) if isinstance(value, Tensor) else value


def _refuse_to_write(func: Any, target: Any) -> None:
    for each in target if isinstance(target, list | tuple) else [target]:
        if isinstance(each, ReadOnly):
            raise InvalidRequest(f"{func}: the tensor is read-only shared memory of a batch; write to its clone()")
