"""Declarations of options and files, from which each command's parser, checks and help are made."""

from __future__ import annotations

import argparse
import importlib.metadata
from collections.abc import Callable, Iterator, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any

from netsp.base.errors import InputError
from netsp.command.types import (
    check_writable,
    friction_coefficient,
    length,
    natural,
    option,
    positive,
    seconds,
)


@dataclass(frozen=True)
class Option:
    """Argument of a command, declared as its help shows it.

    Parameters
    ----------
    usage : str
        Flags and value: `PROBLEM`, `[SOLUTION]` or `PATH...`; `--quiet`, `--seed N`,
        `-o, --output FILE`, `--goals N...`, `--page [PORT]` or `--at-end {hold,leave}`.
    text : str
        Help, if any. A default that is a number is appended.
    type : callable, optional
        Reader of a value; it raises argparse.ArgumentTypeError. Without it, values are text.
    default
        Value of an option that is not given; False for flags without a value.
    dest : str, optional
        Attribute for the value. By default, that of argparse.
    required, repeats : bool
        Whether the option must be given, and whether it may be given several times.
    const
        Value of an option that is given without its optional value.
    shows_default : bool
        Whether a default that is a number is appended to the help.
    group : str, optional
        Group of entry points whose names the help lists.
    """

    usage: str
    text: str | None = ""
    type: Callable[[str], Any] | None = None
    default: Any = None
    _: KW_ONLY
    dest: str | None = None
    required: bool = False
    repeats: bool = False
    const: Any = None
    shows_default: bool = True
    group: str | None = None

    @property
    def flags(self) -> list[str]:
        """Flags of the option; empty for a positional argument."""
        return [word.rstrip(",") for word in self.usage.split() if word.startswith("-")]

    @property
    def name(self) -> str:
        """Name of the option in messages."""
        long = (flag for flag in self.flags if flag.startswith("--"))
        return next(long, self.usage.strip("[]."))

    @property
    def attribute(self) -> str:
        """Attribute for the value."""
        return self.dest or self.name.strip("-").replace("-", "_").lower()

    def value(self, args: argparse.Namespace) -> Any:
        """Return the value of the option."""
        return getattr(args, self.attribute)

    def is_given(self, args: argparse.Namespace) -> bool:
        """Return whether the option was given, with a value other than its default."""
        return self.value(args) not in (self.default, False, [])

    def add_to(self, parser: argparse._ActionsContainer) -> None:
        """Add the argument to a parser."""
        settings: dict[str, Any] = {"help": self._help()}
        if self.default is not None:
            settings["default"] = self.default
        flags, has_opposite = self.flags, ", --no-" in self.usage
        if has_opposite:
            settings["action"] = argparse.BooleanOptionalAction
        elif value := self.usage.split()[len(flags) :]:
            settings |= {"type": self.type, **_value(" ".join(value), len(value))}
            if settings["nargs"] == "?":
                settings["const"] = self.const
            if self.repeats:
                settings |= {"action": "append", "default": []}
        else:
            settings |= {"action": "store_true", "default": False}
        if self.required:
            settings["required"] = True
        if not flags:
            parser.add_argument(self.attribute, **settings)
        else:
            parser.add_argument(
                *flags[: 1 if has_opposite else None], dest=self.attribute, **settings
            )

    def _help(self) -> str | None:
        text = self.text
        if text is None:
            return None
        if self.group is not None:
            others = sorted({e.name for e in importlib.metadata.entry_points(group=self.group)})
            text += f"; from other packages: {', '.join(others)}" if others else ""
        is_number = isinstance(self.default, int | float)
        if is_number and self.shows_default and "default" not in text:
            text = "; ".join(filter(None, (text, f"default {self.default:g}")))
        return text


def _value(usage: str, count: int) -> dict[str, Any]:
    """Return the arguments of `add_argument` for a value, by its form in the usage."""
    if usage.startswith("{"):
        return {"choices": usage.strip("{}").split(","), "nargs": None}
    is_optional, is_many = usage.startswith("["), "..." in usage
    nargs: str | int | None = count if count > 1 else None
    if is_optional or is_many:
        nargs = {(True, True): "*", (True, False): "?", (False, True): "+"}[is_optional, is_many]
    name = usage.replace("...", "")
    return {"metavar": name.strip("[]") if is_optional else name.split()[0], "nargs": nargs}


class Input(Option):
    """File or files that a command reads, and never writes to."""


class Output(Option):
    """File that a command writes. It is checked before the work starts."""


class Data(Output):
    """File of data. Without it, data go to standard output, which rules out `--json`."""


class Picture(Output):
    """Picture that a command draws (png, svg or pdf)."""


@dataclass(frozen=True)
class Group:
    """Options under a common title in the help.

    Parameters
    ----------
    title : str
        The title.
    options : sequence of Option
        The options.
    """

    title: str
    options: Sequence[Option]

    def add_to(self, parser: argparse.ArgumentParser) -> None:
        """Add the options to a parser."""
        add_options(parser.add_argument_group(self.title), self.options)


@dataclass(frozen=True)
class OneOf:
    """Options that exclude one another.

    Parameters
    ----------
    options : sequence of Option
        The options.
    required : bool
        Whether one of them must be given.
    """

    options: Sequence[Option]
    required: bool = False

    def add_to(self, parser: argparse.ArgumentParser) -> None:
        """Add the options to a parser."""
        add_options(parser.add_mutually_exclusive_group(required=self.required), self.options)


Options = Sequence[Option | Group | OneOf]


def add_options(parser: Any, options: Options) -> None:
    """Add options to a parser or to a group of one."""
    for each in options:
        each.add_to(parser)


def each_option(options: Options) -> Iterator[Option]:
    """Yield all options, including those within groups."""
    for each in options:
        yield from (each,) if isinstance(each, Option) else each.options


def names_of(options: Options) -> str:
    """Return the names of options, separated by spaces."""
    return " ".join(each.name for each in each_option(options))


def refuse(args: argparse.Namespace, names: str, reason: str) -> None:
    """Raise InputError with a reason if one of some options, separated by spaces, is given."""
    by_name = {each.name: each for each in each_option(args.declared.options)}
    for name in names.split():
        if by_name[name].is_given(args):
            raise InputError(f"{name}: {reason}")


def files_of(args: argparse.Namespace, kind: type[Option]) -> list[str]:
    """Return the files that were given for options of a kind."""
    matching = [each for each in each_option(args.declared.options) if isinstance(each, kind)]
    values = [each.value(args) for each in matching if each.value(args) is not None]
    return [file for value in values for file in (value if isinstance(value, list) else [value])]


def check_stdout(args: argparse.Namespace) -> None:
    """Raise InputError if the summary and the data would both go to standard output."""
    from netsp.base.files import STANDARD

    if args.json and args.output in (None, STANDARD):
        raise InputError("--json: standard output is taken by the data; expected -o FILE")


def check_files(args: argparse.Namespace) -> None:
    """Raise InputError if a file cannot be written, is an input or has an unknown format."""
    if any(isinstance(each, Data) for each in each_option(args.declared.options)):
        check_stdout(args)
    check_writable(*files_of(args, Output), inputs=files_of(args, Input))
    if pictures := files_of(args, Picture):
        from netsp.view.pictures import style

        for name in pictures:
            style.check_format(name)


def given_params(args: argparse.Namespace) -> dict[str, str]:
    """Return the options of a solver that were given.

    Raises
    ------
    InputError
        One is given twice.
    """
    params = dict(args.option)
    if len(params) < len(args.option):
        raise InputError("--option: the same option is given twice")
    if getattr(args, "mip_backend", None):
        if "backend" in params:
            raise InputError("--mip-backend: the backend is given by --option too")
        params["backend"] = args.mip_backend
    return params


PROBLEM = Input("PROBLEM", "problem file (JSON)")
QUIET = Option("--quiet", "print no progress and no summary")
SILENT = Option("--quiet", "print no progress")
JSON = Option("--json", "print the summary as JSON on stdout (data then needs -o FILE)")
PARAMS = Option(
    "--option NAME=VALUE",
    "option of the solver (docs/reference/solvers.md); may be repeated",
    option,
    repeats=True,
)
ITERATION_LIMIT = Option(
    "--iteration-limit N", "iterations of the solver; default no limit", positive
)
CLEARANCE = (
    Option(
        "--position-error M",
        "error of the vehicle's position (m), to check the clearance against",
        length,
        0.0,
    ),
    Option(
        "--current V", "speed of the current (m/s), to check the clearance against", length, 0.0
    ),
)
"""Facts about the vehicle and the water that the clearance of a plan is compared with."""


LINK = Option(
    "--link ADDRESS",
    "MAVLink over UDP: udpin:PORT (this machine only), udpin:HOST:PORT, udpout:HOST:PORT",
)
VEHICLE_FRAMES = "local (metres north, east, down of the base) or global"
RUN_FOLDER = Option("-o, --output RUN", "folder for logs, summary and run.png")
SAMPLES = Option("--samples N", "prm: number of milestones; default 1000", positive)


def time_limit(text: str, default: float | None = None) -> Option:
    """Declare a time limit in seconds."""
    return Option("--time-limit S", text, seconds, default)


def seed(text: str) -> Option:
    """Declare the seed of random numbers."""
    return Option("--seed N", text, natural, 0)


def surprises(text: str) -> Option:
    """Declare the file of surprises."""
    return Input("--surprise FILE", f"surprise file (JSON): {text}")


def friction(text: str) -> Option:
    """Declare the coefficient of friction of the tether."""
    return Option("--friction MU", text, friction_coefficient, 0.0)


def frame(text: str) -> Option:
    """Declare the frame of positions."""
    return Option("--frame NAME", text)


def page(text: str, port: int = 8650) -> Option:
    """Declare the page of the guard, and its default port."""
    return Option("--page [PORT]", f"{text}; default port {port}", natural, const=port)


SEED = seed("random seed")
