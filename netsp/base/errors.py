"""Exceptions of netsp. Each has one exit code of the command line (docs/reference/statuses)."""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence

from netsp.base.deprecated import deprecated_names

EXIT_DEFECT = 1
"""Code of a defect of netsp. A vehicle that was under way has been brought home."""

EXIT_BAD_INPUT = 2
"""Code of input that cannot be used."""

EXIT_INFEASIBLE = 3
"""Code of a problem without solution."""

EXIT_NOT_ALL = 4
"""Code of a run without tour, or with goals left out."""

EXIT_NOT_VERIFIED = 5
"""Code of a failed check, or a tether over the limit or not free."""

EXIT_INTERRUPTED = 130
"""Code of a command that Ctrl-C ended."""


def brief(message: str, max_quote: int = 80) -> str:
    """Return a message in one line: long quotes, lists and words are cut, and characters that
    cannot be printed are escaped.

    Parameters
    ----------
    max_quote : int
        Maximum length of a quoted value, characters; lists and words may be twice as long.
    """
    quoted = re.compile(rf"(['\"])((?:(?!\1).){{{max_quote + 1},}}?)\1", re.DOTALL)
    text = quoted.sub(lambda m: f"{m[1]}{m[2][: max_quote - 1]}…{m[1]}", message)
    long_list = re.compile(rf"\[[^\[\]]{{{2 * max_quote},}}\]")
    text = long_list.sub(lambda m: m[0][: max_quote - 2] + "…]", text)
    long_word = re.compile(rf"[^\s/'\"]{{{2 * max_quote},}}")
    text = long_word.sub(lambda m: m[0][: max_quote - 1] + "…", text)
    return "".join(
        c if c.isprintable() else c.encode("unicode_escape", "backslashreplace").decode()
        for c in text
    )


def counted(number: int, noun: str) -> str:
    """Return a number and a noun, with an s unless the number is 1: ``8 goals``."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


class NetspError(Exception):
    """Base of all errors that a user can act on; the command line ends with its `exit_code`."""

    exit_code = EXIT_DEFECT

    def __init__(self, message: object = "") -> None:
        super().__init__(brief(str(message)))


class InputError(NetspError):
    """Input that cannot be used. The message is one line: field, value, what was expected.

    Examples
    --------
    >>> from netsp import Problem
    >>> try:
    ...     Problem(base=(0, 0), goals=[(4, 0)], tether_length=-1)
    ... except InputError as error:
    ...     print(error, error.exit_code)
    Problem: tether_length: expected a number > 0, got -1.0 2
    """

    exit_code = EXIT_BAD_INPUT


class SeveralErrors(InputError):
    """Several complaints about one input, reported together.

    Parameters
    ----------
    complaints : sequence of str
        One line each.
    """

    def __init__(self, complaints: Sequence[str]) -> None:
        more = f" (and {len(complaints) - 1} more)" if len(complaints) > 1 else ""
        super().__init__(f"{complaints[0]}{more}")
        self.complaints = tuple(map(brief, complaints))


class UnansweredError(SeveralErrors):
    """Complaints about an input, some of which the user can answer.

    Parameters
    ----------
    complaints : sequence of str
        One line each, with the options of the command line that answer them.
    plain : sequence of str
        The same lines without these options.
    asks : sequence of str
        Names of the questions, such as ``line_width``.
    """

    def __init__(
        self, complaints: Sequence[str], plain: Sequence[str], asks: Sequence[str] = ()
    ) -> None:
        super().__init__(complaints)
        self.plain = tuple(map(brief, plain))
        self.asks = tuple(dict.fromkeys(asks))


class InfeasibleError(NetspError):
    """Proof that the problem has no solution; the message names the goal and the reason.

    Parameters
    ----------
    message : object
        One line.
    goal : int, optional
        Index of the first goal that cannot be visited.
    needed : float, optional
        Length of the shortest tether that reaches it, in the problem's units; infinite if the
        goal is cut off; None if the length is not the reason.
    enclosing : sequence of int
        Indices of the obstacles that cut off the goal or the base.
    """

    exit_code = EXIT_INFEASIBLE

    def __init__(
        self,
        message: object = "",
        *,
        goal: int | None = None,
        needed: float | None = None,
        enclosing: Sequence[int] = (),
    ) -> None:
        super().__init__(message)
        self.goal, self.needed, self.enclosing = goal, needed, tuple(enclosing)


class LimitReachedError(NetspError):
    """Error of a time limit that passed before there was any solution; the message names the work
    that it cut short."""

    exit_code = EXIT_NOT_ALL


class MemoryLimitError(LimitReachedError):
    """Error of work that would need more memory than is available; the message says what to
    lower."""


class PluginError(NetspError):
    """Failure of a plug-in. The message names the plug-in; its error is the cause of this one."""


class VerificationError(NetspError):
    """Failure of a solution's independent check."""

    exit_code = EXIT_NOT_VERIFIED


class LeftOutWarning(UserWarning):
    """Warning that a result lacks something because a taut path was not found; it says what."""


def warn_left_out(what: str) -> None:
    """Warn that something is left out of a result.

    Parameters
    ----------
    what : str
        One line: what is missing, and what replaces it.
    """
    warnings.warn(what, LeftOutWarning, stacklevel=3)


def is_interrupt(error: BaseException) -> bool:
    """Return whether an error is Ctrl-C, or a consequence of it.

    Python raises SystemError ("returned a result with an exception set") if the signal arrives just
    as a compiled function returns, and again for each of its callers.
    """
    cause: BaseException | None = error
    while isinstance(cause, SystemError):
        cause = cause.__cause__
    return isinstance(cause, KeyboardInterrupt)


__getattr__ = deprecated_names(globals(), interrupted="is_interrupt")
