"""Exceptions of netsp. Each maps to one exit code of the command line (docs/architecture.md)."""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence

EXIT_DEFECT, EXIT_BAD_INPUT, EXIT_INFEASIBLE = 1, 2, 3
"""A defect of ours (whatever moved is safely home); input that cannot be used; no solution."""

EXIT_NOT_ALL, EXIT_NOT_VERIFIED, EXIT_INTERRUPTED = 4, 5, 130
"""No tour, or goals left out; a failed check, or a tether over the limit or not free; Ctrl-C."""

LONGEST_QUOTE = 80
"""Characters of a quoted value that a message shows."""

_QUOTED = re.compile(rf"(['\"])((?:(?!\1).){{{LONGEST_QUOTE + 1},}}?)\1", re.S)
_LIST = re.compile(rf"\[[^\[\]]{{{2 * LONGEST_QUOTE},}}\]")
_WORD = re.compile(rf"[^\s/'\"]{{{2 * LONGEST_QUOTE},}}")


def brief(message: str) -> str:
    """A message in one line; quoted values, endless lists and words are cut short, what cannot be
    printed is escaped.

    Parameters
    ----------
    message : str
        The message.

    Returns
    -------
    str
        One line.
    """

    def cut(found: re.Match[str]) -> str:
        return f"{found[1]}{found[2][: LONGEST_QUOTE - 1]}…{found[1]}"

    text = _LIST.sub(lambda found: found[0][: LONGEST_QUOTE - 2] + "…]", _QUOTED.sub(cut, message))
    text = _WORD.sub(lambda w: w[0][: LONGEST_QUOTE - 1] + "…", text)
    return "".join(
        c if c.isprintable() else c.encode("unicode_escape", "backslashreplace").decode()
        for c in text
    )


def counted(number: int, noun: str) -> str:
    """A number with its noun, which gets an s unless there is one of it.

    Parameters
    ----------
    number : int
        How many.
    noun : str
        In the singular.

    Returns
    -------
    str
        As ``1 goal`` or ``8 goals``.
    """
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


class NetspError(Exception):
    """Base of all netsp errors that a user can act on; `exit_code` is what the CLI returns."""

    exit_code = EXIT_DEFECT

    def __init__(self, message: object = "") -> None:
        super().__init__(brief(str(message)))


class InputError(NetspError):
    """Input that cannot be used. The message is one line: field, value, what was expected."""

    exit_code = EXIT_BAD_INPUT


class SeveralErrors(InputError):
    """Several complaints about one input, all told at once.

    Parameters
    ----------
    complaints : sequence of str
        One line each.

    Attributes
    ----------
    complaints : tuple of str
        One line each.
    """

    def __init__(self, complaints: Sequence[str]) -> None:
        more = f" (and {len(complaints) - 1} more)" if len(complaints) > 1 else ""
        super().__init__(f"{complaints[0]}{more}")
        self.complaints = tuple(map(brief, complaints))


class UnansweredError(SeveralErrors):
    """Complaints about an input of which some can be answered by whoever gives it.

    Parameters
    ----------
    complaints : sequence of str
        One line each, with the options of the command line that answer them.
    plain : sequence of str
        The same without these options.
    asks : sequence of str
        What is to be answered, as ``line_width``.

    Attributes
    ----------
    plain : tuple of str
        One line each.
    asks : tuple of str
        Each once.
    """

    def __init__(
        self, complaints: Sequence[str], plain: Sequence[str], asks: Sequence[str] = ()
    ) -> None:
        super().__init__(complaints)
        self.plain = tuple(map(brief, plain))
        self.asks = tuple(dict.fromkeys(asks))


class InfeasibleError(NetspError):
    """The problem is proven to have no solution; the message names the goal and the reason.

    Parameters
    ----------
    message : object
        One line.
    goal : int, optional
        Index of the first goal that cannot be visited.
    needed : float, optional
        Length of the shortest tether that reaches it, in the problem's units; inf where it is cut
        off; None where the length is not what is wrong.
    enclosing : sequence of int
        Obstacles that cut it off, or the base.
    """

    exit_code = EXIT_INFEASIBLE

    def __init__(
        self, message: object = "", *, goal: int | None = None, needed: float | None = None,
        enclosing: Sequence[int] = (),
    ) -> None:  # fmt: skip
        super().__init__(message)
        self.goal, self.needed, self.enclosing = goal, needed, tuple(enclosing)


class LimitReachedError(NetspError):
    """The time was up before there was any solution; the message says where the work stood."""

    exit_code = EXIT_NOT_ALL


class MemoryLimitError(LimitReachedError):
    """The work would take more memory than there is; the message says what to lower."""


class PluginError(NetspError):
    """Another package's code failed. The message says which; the error itself is the cause."""


class VerificationError(NetspError):
    """A solution failed its independent check."""

    exit_code = EXIT_NOT_VERIFIED


class LeftOutWarning(UserWarning):
    """Warning that a result lacks something because a taut path was not found; it says what."""


def warn_left_out(what: str) -> None:
    """Warn that something is left out of a result.

    Parameters
    ----------
    what : str
        One line: what is missing, and what stands in its place.
    """
    warnings.warn(what, LeftOutWarning, stacklevel=3)


def interrupted(error: BaseException) -> bool:
    """Whether an error is Ctrl-C.

    Python says SystemError ("returned a result with an exception set") where the signal comes just
    as a compiled function returns, and once more for each function that this one was called by.

    Parameters
    ----------
    error : BaseException
        What was raised.

    Returns
    -------
    bool
        Whether it is, or comes of, a KeyboardInterrupt.
    """
    cause: BaseException | None = error
    while isinstance(cause, SystemError):
        cause = cause.__cause__
    return isinstance(cause, KeyboardInterrupt)
