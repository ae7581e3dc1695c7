"""PyTorch over shared memory: in place, guarded against writes, and pinned (with a recording test double)."""

from __future__ import annotations

import copy
import pickle
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp

torch = pytest.importorskip("torch")

from smaclite_pool.integrations.torch import ReadOnly, pinned, tensor, tensors


@pytest.fixture
def envs() -> Iterator[sp.Envs]:
    with sp.make("2s3z", 8, autoreset_mode="SameStep") as made:
        yield made


def test_every_field_is_read_in_place_and_without_a_warning(envs: sp.Envs) -> None:
    batch = envs.reset(seed=1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        seen = batch.torch()
    assert list(seen) == batch.keys()
    for name, there in seen.items():
        here = getattr(batch, name)
        assert there.data_ptr() == there.plain.data_ptr() == here.ctypes.data, name
        assert tuple(there.shape) == here.shape and there.numpy().dtype == here.dtype, name
        assert np.array_equal(there.numpy(), here), name
    assert seen["avail_actions"].dtype == torch.bool
    assert list(tensors(batch, ["obs"])) == ["obs"]


@pytest.mark.parametrize("change", [lambda obs: obs[:, :, ::-1], lambda obs: obs.astype(">f4")])
def test_what_torch_cannot_read_in_place_is_copied(envs: sp.Envs, change: Callable[[Any], Any]) -> None:
    """A wrapper that mirrors observations ended in "Storage size calculation overflowed"."""
    batch = envs.reset(seed=1)
    changed = change(batch.obs)
    there = batch.replace(obs=changed).torch()["obs"]
    assert np.array_equal(there.numpy(), changed)


def test_versions_without_read_only_dlpack(envs: sp.Envs, monkeypatch: pytest.MonkeyPatch) -> None:
    batch = envs.reset(seed=1)

    def refuse(array: Any) -> Any:
        raise BufferError("Cannot export readonly array")

    monkeypatch.setattr("torch.utils.dlpack.from_dlpack", refuse)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert tensor(batch.obs).data_ptr() == batch.obs.ctypes.data


WRITES: dict[str, Callable[[Any], Any]] = {
    "in place": lambda t: t.add_(1),
    "operator": lambda t: t.__iadd__(1),
    "item": lambda t: t.__setitem__(0, 1),
    "mask": lambda t: t.__setitem__(t > 0, 1),
    "copy": lambda t: t.copy_(torch.zeros(8, 5, 80)),
    "out": lambda t: torch.add(t, 1, out=t),
    "view": lambda t: t.view(-1)[3:].zero_(),
    "transposed": lambda t: t.transpose(0, 1).reshape(5, 8, 80)[0].mul_(2),
    "unbound": lambda t: t.unbind()[0].fill_(2),
    "detached": lambda t: t.detach().zero_(),
    "data": lambda t: t.data.zero_(),
    "plain cast": lambda t: t.as_subclass(torch.Tensor).zero_(),
    "same device": lambda t: t.to("cpu").float().contiguous().zero_(),
    "foreach": lambda t: torch._foreach_add_([t], 1),
    "function": lambda t: torch.nn.functional.relu(t, inplace=True),
    "initialiser": lambda t: torch.nn.init.zeros_(t),
    "resized": lambda t: t.resize_(1),
    "by a function": lambda t: t.apply_(lambda _: 0.0),
    "not in the schema": lambda t: torch.nn.functional.batch_norm(
        torch.randn(3, 80), t[0, 0], t[0, 1], training=True
    ),
}


@pytest.mark.parametrize("write", WRITES.values(), ids=WRITES)
@pytest.mark.parametrize("mode", [torch.enable_grad, torch.no_grad, torch.inference_mode])
def test_a_write_is_refused(envs: sp.Envs, write: Callable[[Any], Any], mode: Callable[[], Any]) -> None:
    batch = envs.reset(seed=1)
    before = batch.obs.copy()
    with mode(), pytest.raises(sp.errors.InvalidRequest, match="read-only"):
        write(tensor(batch.obs))
    assert np.array_equal(batch.obs, before)


@pytest.mark.skipif(not torch.distributed.is_available(), reason="torch has no torch.distributed")
def test_a_collective_that_writes_is_refused(envs: sp.Envs, tmp_path: Path) -> None:
    """Schemas of torch.distributed do not say what is written: the process ended, or others never ended."""
    from torch import distributed

    batch = envs.reset(seed=1)
    seen, before = tensor(batch.obs), batch.obs.copy()
    store = f"file://{tmp_path / 'store'}"
    distributed.init_process_group("gloo", init_method=store, rank=0, world_size=1)
    try:
        receive: dict[str, Callable[[], Any]] = {
            "all_reduce": lambda: distributed.all_reduce(seen),
            "reduce": lambda: distributed.reduce(seen, 0),
            "broadcast": lambda: distributed.broadcast(seen, 0),
            "all_gather": lambda: distributed.all_gather_into_tensor(seen, seen.clone()),
            "scatter": lambda: distributed.scatter(seen, [seen.clone()], 0),
            "recv": lambda: distributed.recv(seen, 0),
        }
        for name, write in receive.items():
            with pytest.raises(sp.errors.InvalidRequest, match="read-only"):
                write()
                pytest.fail(name)
        # torch looks for no tensor classes in lists of lists: its own thread is refused, and says no more.
        with pytest.raises(SystemError):
            distributed.all_gather([seen], seen.clone())
        gathered = [torch.zeros_like(seen.plain)]
        distributed.all_gather(gathered, seen)
        assert torch.equal(gathered[0], seen.plain)
    finally:
        distributed.destroy_process_group()
    assert np.array_equal(batch.obs, before)


def test_the_internals_of_torch_that_the_guard_needs() -> None:
    """Without one of them a write would end the process; a new version of torch must fail here instead."""
    assert ReadOnly.__torch_function__ is torch._C._disabled_torch_function_impl
    plain = torch.zeros(3)
    same: Any = torch.Tensor._make_subclass(ReadOnly, plain)
    assert type(same) is ReadOnly and same.data_ptr() == plain.data_ptr()
    add = torch.ops.aten.add_.Tensor._schema
    assert add.is_mutable
    writes = [
        argument.name for argument in add.arguments if argument.alias_info and argument.alias_info.is_write
    ]
    assert writes == ["self"]
    view, copy_of = torch.ops.aten.view.default._schema, torch.ops.aten.clone.default._schema
    assert not view.is_mutable and view.returns[0].alias_info is not None
    assert copy_of.returns[0].alias_info is None


def test_what_is_computed_is_ordinary(envs: sp.Envs) -> None:
    batch = envs.reset(seed=1)
    seen = tensors(batch)
    policy = torch.nn.Linear(80, 11)
    logits = policy(seen["obs"]).masked_fill(~seen["avail_actions"], -torch.inf)
    logits.logsumexp(-1).sum().backward()
    for ordinary in (
        logits,
        seen["obs"].clone(),
        torch.stack([seen["state"], seen["state"]]),
        seen["obs"].double(),
    ):
        assert type(ordinary) is torch.Tensor
        ordinary.detach().zero_()
    buffer = torch.zeros(3, 8, 5, 80)
    buffer[1] = seen["obs"]
    assert torch.equal(buffer[1], seen["obs"].plain)


def test_a_number_has_a_format(envs: sp.Envs) -> None:
    """`f"{reward:.2f}"` was a TypeError, as torch formats numbers of its own class alone."""
    seen = tensor(envs.reset(seed=1).obs)
    assert f"{seen[0, 0, 0]:.2f}" == f"{seen.plain[0, 0, 0]:.2f}"


def test_copies_are_ordinary(envs: sp.Envs) -> None:
    batch = envs.reset(seed=1)
    seen = tensor(batch.obs)
    for mine in (copy.deepcopy(seen), pickle.loads(pickle.dumps(seen)), torch.from_numpy(seen.numpy())):
        assert type(mine) is torch.Tensor and torch.equal(mine, seen.plain)
        mine.zero_()
    assert batch.obs.any() and isinstance(seen, ReadOnly)
    assert "ReadOnly" in repr(seen) and seen.tolist() == batch.obs.tolist()
    with pytest.raises(sp.errors.InvalidRequest, match="DLPack"):
        np.from_dlpack(seen)


@pytest.mark.skipif(torch.cuda.is_available(), reason="has CUDA")
def test_pinning_without_cuda_is_refused(envs: sp.Envs) -> None:
    batch = envs.reset(seed=1)
    with pytest.raises(sp.errors.InvalidRequest, match="CUDA"), pinned(batch):
        pass


def test_pinning_registers_the_whole_lane_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """A test double of CUDA records its calls: every batch of the lane lies in the registered memory."""
    calls: list[tuple[str, tuple[int, ...]]] = []

    class Runtime:
        def __getattr__(self, name: str) -> Callable[..., int]:
            return lambda *args: calls.append((name, args)) or 0  # type: ignore[func-returns-value]

    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "cudart", Runtime)
    monkeypatch.setattr(torch.cuda, "synchronize", lambda: None)
    monkeypatch.setattr(torch.cuda, "check_error", lambda code: None)
    with sp.make("2s3z", 8, max_held_batches=4) as envs:
        batch = envs.reset()
        with pinned(batch):
            [(register, (start, size, flags))] = calls
            assert register == "cudaHostRegister" and flags == 8, "the mapping is read-only"
            for _ in range(12):
                batch = envs.step(envs.sample_actions())
                for name in batch.keys():
                    field = getattr(batch, name)
                    assert start <= field.ctypes.data and field.ctypes.data + field.nbytes <= start + size
    assert calls[1:] == [("cudaHostUnregister", (start,))]


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA")
def test_pinned_memory_reaches_the_gpu() -> None:
    with sp.make("2s3z", 8) as envs:
        batch = envs.reset(seed=1)
        with pinned(batch):
            assert tensor(batch.obs).plain.is_pinned()
            there = tensor(batch.obs).to("cuda", non_blocking=True)
            assert np.array_equal(there.cpu().numpy(), batch.obs)
