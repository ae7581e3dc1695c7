"""`ReadOnly`, a guard around tensors whose memory is mapped read-only.

torch has no read-only tensors: a write to such memory ends the process with SIGSEGV, without a Python
traceback. This is the only module that depends on internals of torch. `tests/python/test_torch.py` pins each
of them: `torch._C._disabled_torch_function_impl`, `Tensor._make_subclass`, and the `_schema` of an operator.
"""

from __future__ import annotations

from typing import Any

import torch
from numpy.typing import NDArray
from torch import Tensor

from ..errors import InvalidRequest

_SENDS = ("::send", "::barrier", "::monitored_barrier_", "::check_for_nan")
"""Operations of torch.distributed that write to no tensor that they are given."""


class ReadOnly(Tensor):
    """A tensor over read-only memory. Operations that would write to it raise InvalidRequest.

    Results of computations are ordinary tensors, and views are `ReadOnly`. `clone()` and `numpy()` return
    copies that can be changed.
    """

    plain: Tensor
    """The ordinary tensor over the same memory. A write to it ends the process."""

    __torch_function__ = torch._C._disabled_torch_function_impl  # type: ignore[assignment]

    @staticmethod
    def over(plain: Tensor) -> ReadOnly:
        """Guard the memory of a tensor."""
        guarded: ReadOnly = Tensor._make_subclass(ReadOnly, plain)
        guarded.plain = plain
        return guarded

    @classmethod
    def __torch_dispatch__(  # type: ignore[override]  # torch's own is a placeholder
        cls, func: Any, types: Any, args: Any = (), kwargs: Any = None
    ) -> Any:
        """Run an operation of torch; its `_schema` says which arguments it writes and what it returns."""
        kwargs, schema = kwargs or {}, func._schema
        receives = "c10d" in schema.name and not schema.name.endswith(_SENDS)
        if schema.is_mutable or receives or "batch_norm" in schema.name:
            given = {argument.name: value for argument, value in zip(schema.arguments, args, strict=False)}
            given |= kwargs
            for argument in schema.arguments:
                is_write = argument.alias_info is not None and argument.alias_info.is_write
                # The schemas of batch normalisation do not say that training changes these, nor those of
                # torch.distributed what they write to; they name `input` what they only read.
                is_write |= argument.name in ("running_mean", "running_var") and bool(given.get("training"))
                is_write |= receives and not argument.name.startswith("input")
                if is_write:
                    _refuse_write(func, given.get(argument.name))
        result = func(*_plain(args), **{name: _plain(value) for name, value in kwargs.items()})
        returns_alias = any(returned.alias_info is not None for returned in schema.returns)
        return _guarded(result) if returns_alias and not schema.is_mutable else result

    def numpy(self, *, force: bool = False) -> NDArray[Any]:
        """A copy as an array; the field of the batch is the array without a copy."""
        return self.plain.clone().numpy(force=force)

    def apply_(self, function: Any) -> Tensor:
        """Refused, as all that writes; it is no operation that `__torch_dispatch__` sees."""
        raise InvalidRequest(_refusal("apply_"))

    def tolist(self) -> Any:
        """The elements as Python numbers, in nested lists."""
        return self.plain.tolist()

    def __format__(self, format_spec: str) -> str:
        return format(self.plain, format_spec)

    def __repr__(self, *, tensor_contents: Any = None) -> str:  # type: ignore[override]
        return f"ReadOnly({self.plain!r})"

    def __deepcopy__(self, memo: dict[int, Any]) -> Tensor:
        return self.plain.clone()

    def __reduce_ex__(self, protocol: Any) -> Any:
        return self.plain.clone().__reduce_ex__(protocol)

    def __dlpack__(self, **options: Any) -> Any:
        raise InvalidRequest("DLPack cannot export a read-only tensor; use the batch's array, or a clone")


def _plain(value: Any) -> Any:
    if isinstance(value, ReadOnly):
        return value.plain
    return type(value)(map(_plain, value)) if isinstance(value, list | tuple) else value


def _guarded(value: Any) -> Any:
    if isinstance(value, list | tuple):
        return type(value)(map(_guarded, value))
    return ReadOnly.over(value) if isinstance(value, Tensor) else value


def _refusal(operation: Any) -> str:
    return f"{operation}: the tensor is read-only memory of a batch; write to its clone()"


def _refuse_write(func: Any, target: Any) -> None:
    for each in target if isinstance(target, list | tuple) else [target]:
        if isinstance(each, ReadOnly):
            raise InvalidRequest(_refusal(func))
