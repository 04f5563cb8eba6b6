"""`netsp completion`: what a shell needs to complete commands, options and files."""

from __future__ import annotations

import argparse
from typing import Any

EXAMPLE = """netsp completion bash > ~/.local/share/bash-completion/completions/netsp"""

SHELLS = ("bash", "zsh", "tcsh")


def arguments(p: argparse.ArgumentParser) -> None:
    """Of the command line."""
    p.add_argument("shell", choices=SHELLS, help="that is to complete")


def run(args: argparse.Namespace) -> int:
    """Print the script, and return the exit code."""
    import shtab

    from netsp.command.main import parser_of_all

    parser = parser_of_all()
    for choice in _of_commands(parser):
        choice.help = None  # what has no help in the usage is not completed
    for command in (c for choice in _of_commands(parser) for c in choice.choices.values()):
        for action in command._actions:
            takes_one = action.nargs != 0 and action.choices is None and action.type is None
            if takes_one and not hasattr(action, "complete"):
                action.complete = shtab.FILE  # type: ignore[attr-defined]
    print(shtab.complete(parser, args.shell))
    return 0


def _of_commands(parser: argparse.ArgumentParser) -> list[argparse._SubParsersAction[Any]]:
    return [a for a in parser._actions if isinstance(a, argparse._SubParsersAction)]
