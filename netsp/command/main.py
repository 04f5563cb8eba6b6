"""The command line. Data goes to stdout or `-o`, progress and messages to stderr.

Exit codes: 0 done, 1 a defect of netsp, 2 bad input, 3 proven infeasible, 4 no solution within the
limit or goals left out, 5 verification failed, 130 interrupted before any result. Heavy modules are
imported by the commands that need them, so that `--help` is instant.
"""

from __future__ import annotations

import argparse
import contextlib
import errno
import gc
import importlib
import io
import os
import sys
from collections.abc import Container, Iterator, Sequence
from typing import Any, NoReturn

from netsp.base.errors import (
    EXIT_BAD_INPUT,
    EXIT_INTERRUPTED,
    EXIT_NOT_ALL,
    InputError,
    NetspError,
    SeveralErrors,
    is_interrupt,
)
from netsp.command import background_warm_up, messages
from netsp.command.command_clock import begin_command
from netsp.command.command_options import add_options, check_files
from netsp.command.command_policy import CommandPolicy
from netsp.command.command_table import COMMANDS
from netsp.command.interrupts import resending_lost_interrupts
from netsp.command.status_line import status_line


def main(argv: Sequence[str] | None = None, policy: CommandPolicy = CommandPolicy()) -> int:
    """Run the command line; returns the exit code."""
    if argv is None:
        # modules and pictures consist of objects that stay: collecting garbage at each 700 new
        # objects, as by default, takes a tenth of the time of a short command
        gc.set_threshold(policy.garbage_threshold)
    code = _main(argv, policy)
    if argv is None:
        _end_abandoned_work(code, policy.abandoned_grace_s)
    return code


def _end_abandoned_work(code: int, grace_s: float) -> None:
    """End the process at once if work that was abandoned still runs in another language: Python
    would end its thread in the middle of it, which aborts the process."""
    bounded_work = sys.modules.get("netsp.base.bounded_work")
    if bounded_work is None or not bounded_work.is_abandoned_work_running(grace_s):
        return
    with contextlib.suppress(OSError, ValueError):
        sys.stdout.flush()
    with contextlib.suppress(OSError, ValueError):
        sys.stderr.flush()
    os._exit(code)


def _main(argv: Sequence[str] | None, policy: CommandPolicy = CommandPolicy()) -> int:
    """Run the command line; return the exit code, whatever work goes on."""
    begin_command()
    wanted: str | None = None
    # both are None if they were closed before the command began
    sys.stdout, sys.stderr = sys.stdout or _Closed(), sys.stderr or io.StringIO()
    try:
        words = _joined(sys.argv[1:] if argv is None else argv)
        wanted = next((w for w in words if not w.startswith("-")), None)
        try:
            args = _parsed(words, wanted)
            args.policy = policy
        except SystemExit:  # after --help or --version
            sys.stdout.flush()
            raise
        preparing = _preparation_messages(wanted, getattr(args, "quiet", False))
        with resending_lost_interrupts(), messages.warnings_in_one_line(), preparing:
            check_files(args)
            code = int(importlib.import_module(args.declared.module).run(args))
        sys.stdout.flush()
        if argv is None and wanted is not None and wanted != "warm-up":
            background_warm_up.begin(wanted)
        return code
    except SeveralErrors as error:
        for complaint in error.complaints[: policy.max_complaints]:
            messages.error(complaint)
        if (n_more := len(error.complaints) - policy.max_complaints) > 0:
            messages.error(f"and {n_more} more")
        return error.exit_code
    except NetspError as error:
        messages.error(str(error))
        return error.exit_code
    except MemoryError:
        messages.error(
            "out of memory; lower tether_length or --max-classes, or give a smaller problem"
        )
        return EXIT_NOT_ALL
    except (KeyboardInterrupt, SystemError) as error:
        if not is_interrupt(error):
            raise
        messages.error(_interrupt_text(wanted))
        return EXIT_INTERRUPTED
    except BrokenPipeError:
        _forget_stdout()  # the reader has gone (| head)
        return 0
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EBADF, errno.EIO, errno.EFBIG, errno.EDQUOT):
            raise
        _forget_stdout()
        messages.error(f"output cannot be written: {error.strerror}")
        return EXIT_BAD_INPUT


def _interrupt_text(command: str | None) -> str:
    """Return the message for a command that was interrupted before it had a result."""
    if command == "warm-up":
        return "interrupted; what was compiled is kept, and `netsp warm-up` compiles the rest"
    text = "interrupted before there was anything to write"
    tiered = sys.modules.get("netsp.base.compiled.tiered")
    if tiered is not None and tiered.TieredDispatcher.has_compiled:
        text += "; part of the time went into compiling, which `netsp warm-up` does in advance"
    return text


@contextlib.contextmanager
def _preparation_messages(command: str | None, is_quiet: bool) -> Iterator[None]:
    """Show messages about compiling while the body runs, unless the command is quiet; `warm-up`
    shows its own progress."""
    if is_quiet or command == "warm-up":
        yield
        return
    from netsp.command.compiling import compile_messages

    with status_line() as line, compile_messages(sys.stderr, line):
        yield


def _forget_stdout() -> None:
    """Lead a broken stdout to nowhere, so that Python can close it without an error."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


class _Closed(io.TextIOBase):
    """Standard output that was closed before the command began."""

    def write(self, text: str) -> int:
        raise OSError(errno.EBADF, "standard output is closed")


class _Parser(argparse.ArgumentParser):
    """Parser that raises InputError, so that errors take one line."""

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message} ({self.prog} --help)")

    def _print_message(self, message: str, file: Any = None) -> None:
        (file or sys.stderr).write(message)  # argparse swallows the errors of a full disk


VECTORS = ("--origin", "--base", "--current")
"""Flags whose values may begin with a minus and are no numbers to argparse."""


def _joined(argv: Sequence[str]) -> list[str]:
    """Return `--origin -33,151` as `--origin=-33,151`."""
    joined: list[str] = []
    for word in argv:
        if joined and joined[-1] in VECTORS and word[:1] == "-" and word[1:2].isdigit():
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    return joined


def _parsed(words: list[str], wanted: str | None) -> argparse.Namespace:
    """Return the arguments. Unknown words get one line that names the word and the command whose
    help lists the options; argparse's own message does neither."""
    names = [name for group in COMMANDS.values() for name in group]
    if wanted is not None and wanted not in names:
        import difflib

        matches = difflib.get_close_matches(wanted, names, 1)
        hint = f"did you mean {matches[0]}? " if matches else ""
        raise InputError(f"unknown command {wanted!r}; {hint}expected one of {', '.join(names)}")
    args, unknown = _parser({wanted}).parse_known_args(words)
    if unknown:
        raise InputError(f"unknown argument {unknown[0]!r} (netsp {wanted} --help)")
    return args


def parser_of_all() -> argparse.ArgumentParser:
    """Return the parser of all commands with all of their arguments."""
    return _parser({name for group in COMMANDS.values() for name in group})


def _parser(wanted: Container[str | None]) -> argparse.ArgumentParser:
    """Return the parser of all commands, with the arguments of the wanted ones."""
    width = max(len(name) for group in COMMANDS.values() for name in group)
    lines = ["commands by purpose:"]
    for purpose, group in COMMANDS.items():
        lines.append(f"\n  {purpose}")
        lines += [f"    {name:<{width}}  {command.text}" for name, command in group.items()]
    parser = _Parser(
        prog="netsp",
        usage="netsp [--version] COMMAND …",
        description="Shortest non-entangling tours for tethered underwater robots, with proof.",
        epilog="\n".join([*lines, "", *EPILOG]),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action=_Version)
    commands = parser.add_subparsers(
        prog="netsp", metavar="COMMAND", required=True, help=argparse.SUPPRESS, parser_class=_Parser
    )
    for group in COMMANDS.values():
        for name, command in group.items():
            command_parser = commands.add_parser(
                name,
                help=command.text,
                description=f"{command.text[0].upper()}{command.text[1:]}.",
                formatter_class=argparse.RawDescriptionHelpFormatter,
            )
            if name in wanted:
                add_options(command_parser, command.options)
                command_parser.epilog = f"example:\n  {command.example}"
                command_parser.set_defaults(declared=command)
    return parser


EPILOG = (
    "netsp COMMAND --help gives the details, with an example. Exit codes: 0 done, 1 a defect of",
    "netsp, 2 bad input, 3 proven infeasible, 4 no solution within the limit or goals left out,",
    "5 verification failed, 130 interrupted before any result.",
)


class _Version(argparse.Action):
    def __init__(self, option_strings: Sequence[str], dest: str) -> None:
        super().__init__(option_strings, dest, nargs=0, help="print the version and exit")

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from netsp import __version__

        print(f"netsp {__version__}")
        parser.exit()


if __name__ == "__main__":
    sys.exit(main())
