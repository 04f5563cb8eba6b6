"""Exceptions of netsp. Each maps to one exit code of the command line (docs/architecture.md)."""

from __future__ import annotations


class NetspError(Exception):
    """Base of all netsp errors that a user can act on; `exit_code` is what the CLI returns."""

    exit_code = 1


class InputError(NetspError):
    """Input that cannot be used. The message is one line: field, value, what was expected."""

    exit_code = 2


class InfeasibleError(NetspError):
    """The problem is proven to have no solution; the message names the goal and the reason."""

    exit_code = 3


class LimitReachedError(NetspError):
    """The time was up before there was any solution; the message says where the work stood."""

    exit_code = 4


class MemoryLimitError(LimitReachedError):
    """The work would take more memory than there is; the message says what to lower."""


class VerificationError(NetspError):
    """A solution failed its independent check."""

    exit_code = 5
