"""The command line of the examples: every field of a dataclass but the first is an option."""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, field, fields
from pathlib import Path
from typing import Any

import smaclite_pool as sp
from smaclite_pool._extra import extra as extra  # for the examples

Range = tuple[float, float]

COUNT: Range = (1, 1_000_000)
STEPS: Range = (1, 2**48)
SEED: Range = (0, 2**64 // 1_000_000 - 2)
"""Of runs that seed their environments with a million times the seed."""
ANY_SEED: Range = (0, 2**64 - 1)
SHARE: Range = (0, 1)
SMALL: Range = (1e-12, 1)
"""Step sizes, which are above 0."""

DEFAULT = " (default: %(default)s)"


def option(
    default: Any,
    text: str,
    choices: list[str] | None = None,
    *,
    within: Range | None = None,
    numbers: bool = False,
) -> Any:
    """A field of the dataclass. What is given must be one of `choices`, a number `within` a range, or
    `numbers` with commas, the widths of layers; the default can be anything. Without one (None), which needs
    `text` to say what happens then, it is a whole number."""
    by_default = "" if default is None else DEFAULT
    help_text = {"help": text + by_default, "choices": choices}
    return field(default=default, metadata={"argument": help_text, "within": within, "numbers": numbers})


def parser_of(options: Any, description: str | None, first: str) -> argparse.ArgumentParser:
    """A parser of the options; `first` says what the argument without a name is."""
    keep_lines = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=description, formatter_class=keep_lines)
    of_first, *others = fields(options)
    required: Any = {} if of_first.default == "" else {"nargs": "?", "default": of_first.default}
    by_default = DEFAULT if required else ""
    parser.add_argument(of_first.name, help=first + by_default, **required)
    for each in others:
        kind = int if each.default is None else type(each.default)
        argument = each.metadata["argument"]
        if kind is bool:
            parser.add_argument(_flag(each.name), action="store_true", help=argument["help"])
        else:
            parser.add_argument(_flag(each.name), dest=each.name, type=kind, default=each.default, **argument)
    return parser


def parsed(parser: argparse.ArgumentParser, options: Any) -> dict[str, Any]:
    """What the command line says, in range; or a message, and the end of the program."""
    given = vars(parser.parse_args())
    for each in fields(options)[1:]:
        value, within = given[each.name], each.metadata["within"]
        if value == each.default:
            continue
        if within and not within[0] <= value <= within[1]:  # also NaN
            low, high = (f"{bound:,}" if isinstance(bound, int) else f"{bound:g}" for bound in within)
            parser.error(f"{_flag(each.name)} must be between {low} and {high}, got {value}")
        if each.metadata["numbers"]:
            is_list = re.fullmatch("[0-9]+(,[0-9]+)*", value)
            if not is_list or any(not 2 <= int(width) <= 4096 for width in value.split(",")):
                flag = _flag(each.name)
                parser.error(f"{flag} must be numbers from 2 to 4096, with commas, as 64,64, got {value!r}")
        if each.name == "device":
            _check_device(parser, value)
    return given


@contextmanager
def one_line_errors(program: str) -> Iterator[None]:
    """Ends the program with one line for what cannot be done, and without one after Ctrl-C."""
    try:
        yield
    except FileExistsError as error:
        raise SystemExit(f"{program}: {error.filename} exists; choose another --out or --seed") from None
    except (sp.errors.PoolError, OSError) as error:
        raise SystemExit(f"{program}: {error}") from None
    except KeyboardInterrupt:
        raise SystemExit(130) from None


def _check_device(parser: argparse.ArgumentParser, device: str) -> None:
    import torch

    try:
        torch.empty(1, device=device).item()
    except (RuntimeError, AssertionError, NotImplementedError) as error:
        reason = str(error).splitlines()[0]
        parser.error(f"--device must be a device that PyTorch can use, as cpu, got {device!r}: {reason}")


def write_options(folder: Path, options: Any, **more: Any) -> None:
    """Makes the folder of a run, with the options, and with the name and the hash of the scenario, by which
    `report` knows what was played: two files can have the same name, and one another name than its file."""
    scenario = sp.scenario(options.scenario)
    played = {"scenario": scenario["name"], "file": str(options.scenario), "battles": scenario["hash"]}
    folder.mkdir(parents=True)
    (folder / "options.json").write_text(json.dumps(asdict(options) | more | played, indent=2))


def _flag(name: str) -> str:
    return "--" + name.strip("_").replace("_", "-")
