"""The types of `smaclite_pool.types` have the keys and types of the dicts that the package returns."""

from __future__ import annotations

import types
import typing
from typing import Any

import pytest
import smaclite_pool as sp
from smaclite_pool.types import PoolStatus, Scenario


def check(value: object, expected: Any, where: str) -> None:
    """Fails if a value is not of a type, or a dict has other keys than its TypedDict, at any depth."""
    origin, arguments = typing.get_origin(expected), typing.get_args(expected)
    if typing.is_typeddict(expected):
        assert isinstance(value, dict), f"{where}: {value!r}"
        hints = typing.get_type_hints(expected)
        assert set(value) == set(hints), f"{where}: {expected.__name__} has other keys"
        for key, hint in hints.items():
            check(value[key], hint, f"{where}.{key}")
    elif origin is list:
        assert isinstance(value, list), f"{where}: {value!r}"
        for i, element in enumerate(value):
            check(element, arguments[0], f"{where}[{i}]")
    elif origin is dict:
        assert isinstance(value, dict), f"{where}: {value!r}"
        for key, element in value.items():
            check(key, arguments[0], f"{where}, a key")
            check(element, arguments[1], f"{where}[{key!r}]")
    elif expected is Any:
        pass
    elif origin is typing.Literal:
        assert value in arguments, f"{where}: {value!r} is none of {arguments}"
    elif origin in (types.UnionType, typing.Union):
        assert any(is_of(value, argument) for argument in arguments), f"{where}: {value!r}"
    else:
        assert type(value) is expected, f"{where}: {value!r} is no {expected}"


def is_of(value: object, expected: Any) -> bool:
    try:
        check(value, expected, "")
    except AssertionError:
        return False
    return True


@pytest.mark.parametrize("name", sp.scenarios())
def test_a_scenario_has_its_type(name: str) -> None:
    check(sp.scenario(name), Scenario, name)


@pytest.mark.parametrize(("limit", "sides"), [(7, "allies"), (None, "both")])
@pytest.mark.parametrize("autoreset", ["NextStep", "SameStep", "Disabled"])
def test_a_status_has_its_type(autoreset: Any, limit: int | None, sides: Any) -> None:
    options: dict[str, Any] = {"episode_limit": limit, "sides": sides, "rules": "paper"}
    with sp.make("2s3z", 2, name="train", autoreset_mode=autoreset, **options) as envs:
        envs.reset()
        status = sp.status("train")
        check(status, PoolStatus, "status")


def test_a_dict_with_other_keys_or_types_is_found() -> None:
    scenario: Any = sp.scenario("3m")
    for wrong in ({**scenario, "extra": 1}, {**scenario, "width": 1.0}, {**scenario, "allies": [{}]}):
        with pytest.raises(AssertionError):
            check(wrong, Scenario, "3m")
