"""Messages for users while kernels are compiled.

A kernel is compiled once per installation and kept on disk. Without a message, a command that
compiles would seem to hang.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from netsp.base.errors import LimitReachedError
from netsp.base.number_ranges import check_positive

if TYPE_CHECKING:
    from netsp.command.status_line import StatusLine

PACKAGE_SUBJECTS = {
    "online": "the simulation",
    "world": "the simulation",
    "plan.space": "planning in space",
    "plan.cover": "the choice of viewpoints",
}
"""Name of each package in messages; all other packages are called `the solver`."""


@contextmanager
def compile_messages(
    stream: TextIO, line: StatusLine | None = None, policy: PreparationPolicy | None = None
) -> Iterator[None]:
    """Show, while the body runs, what is being compiled and about how long it takes.

    If compiling took the time of a limit that ends the body, the error says so.

    Parameters
    ----------
    stream : file
        Stream for messages, such as stderr.
    line : StatusLine, optional
        Line of a terminal, in which a bar is drawn. Without it, lines are written to the stream.
    policy : PreparationPolicy, optional
        Policy of the messages.

    Raises
    ------
    LimitReachedError
        The body raised one.
    """
    from netsp.base.compiled.numba_loading import when_numba_is_loaded

    preparation = Preparation(stream, line, policy)
    is_over = False
    with ExitStack() as listening:

        def listen() -> None:
            if not is_over:
                listening.enter_context(_listening(preparation.begin, preparation.end))

        listening.callback(preparation.close)
        when_numba_is_loaded(listen)
        try:
            yield
        except LimitReachedError as error:
            if type(error) is not LimitReachedError or not preparation.has_delayed:
                raise
            raise LimitReachedError(
                f"{error}; compiling took {preparation.spent_s:.0f} s of it, once per "
                "installation: run the command again, or run `netsp warm-up` first"
            ) from error
        finally:
            is_over = True


@contextmanager
def _listening(on_begin: Callable[[Any], None], on_end: Callable[[Any], None]) -> Iterator[None]:
    """Call functions with the dispatcher of each kernel whose compilation begins or ends while the
    body runs; loads Numba."""
    from numba.core import event

    class Listener(event.Listener):  # type: ignore[misc]
        def on_start(self, record: Any) -> None:
            on_begin(record.data["dispatcher"])

        def on_end(self, record: Any) -> None:
            on_end(record.data["dispatcher"])

    listener = Listener()
    event.register("numba:compile", listener)
    try:
        yield
    finally:
        event.unregister("numba:compile", listener)


class CompileTimes:
    """CPU seconds of compiling each kernel, without the kernels that it calls.

    Attributes
    ----------
    seconds : dict
        CPU seconds by module and name, added up over the signatures of a kernel.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._within: list[tuple[float, float]] = []

    @contextmanager
    def measured(self) -> Iterator[None]:
        """Measure while the body runs."""
        with _listening(self._begin, self._end):
            yield

    def _begin(self, kernel: Any) -> None:
        self._within.append((time.thread_time(), 0.0))

    def _end(self, kernel: Any) -> None:
        begin, called_s = self._within.pop()
        whole_s = time.thread_time() - begin
        name = kernel_name(kernel)
        self.seconds[name] = self.seconds.get(name, 0.0) + whole_s - called_s
        if self._within:
            outer, so_far_s = self._within[-1]
            self._within[-1] = outer, so_far_s + whole_s


def kernel_name(kernel: Any) -> str:
    """Return module and name of a kernel."""
    return f"{kernel.py_func.__module__.removeprefix('netsp.')}.{kernel.py_func.__name__}"


@dataclass(frozen=True)
class PreparationPolicy:
    """Policy of the messages while kernels are compiled.

    Parameters
    ----------
    expected_share : float
        Share of the compile time of a package's kernels that a command is expected to need, among
        kernels that are imported and not on disk. It only changes messages: with a larger share,
        they announce a longer wait.
    every_s : float
        Seconds between two lines where there is no terminal; a smaller value writes more lines.
    max_bar_columns : int
        Characters of the bar on a wide terminal; a longer one leaves less room for the text.
    min_bar_columns : int
        Characters of the bar on a narrow terminal; a shorter one hardly shows progress.
    min_delay_s : float
        Seconds of compiling from which on a time limit that is reached is put down to it; a larger
        value leaves it to the problem.
    """

    expected_share: float = 0.25
    every_s: float = 30.0
    max_bar_columns: int = 20
    min_bar_columns: int = 5
    min_delay_s: float = 1.0

    def __post_init__(self) -> None:
        check_positive(self)

    def bar(self, share: float, room: int) -> str:
        """Return a progress bar.

        Parameters
        ----------
        share : float
            Share of the work that is done, 0 to 1.
        room : int
            Characters that are free on the line.
        """
        width = max(min(self.max_bar_columns, room), self.min_bar_columns)
        full = int(share * width)
        return f"[{'#' * full}{' ' * (width - full)}]"


class Preparation:
    """Progress of compiling that is shown to the user.

    Parameters
    ----------
    stream : file
        Stream for messages.
    line : StatusLine, optional
        Line of a terminal in which a bar is drawn.
    policy : PreparationPolicy
        Policy of the messages.
    """

    def __init__(
        self,
        stream: TextIO,
        line: StatusLine | None = None,
        policy: PreparationPolicy | None = None,
    ) -> None:
        self._stream, self._line = stream, line
        self._policy = policy or PreparationPolicy()
        self._depth, self._expected_s, self._done_s, self._spent_s = 0, 0.0, 0.0, 0.0
        self._begun_at = self._printed_at = 0.0
        self._subject: str | None = None
        self._packages: set[str] = set()

    def begin(self, kernel: Any) -> None:
        """Record the start of compiling a kernel; kernels that it calls start and end within it."""
        if not kernel.py_func.__module__.startswith("netsp."):
            return
        if not self._depth:
            if self._subject is None:
                module = kernel.py_func.__module__.removeprefix("netsp.")
                subjects = (v for k, v in PACKAGE_SUBJECTS.items() if module.startswith(k + "."))
                self._subject = next(subjects, "the solver")
            package = kernel.py_func.__module__.rpartition(".")[0]
            if package not in self._packages:
                self._packages.add(package)
                self._expected_s += self._policy.expected_share * _folder_compile_time_s(kernel)
            with_called_s = compile_time_s(kernel, with_called=True)
            self._expected_s = max(self._expected_s, self._done_s + with_called_s)
            self._begun_at = time.monotonic()
        self._depth += 1
        self._show()

    def end(self, kernel: Any) -> None:
        """Record the end of compiling a kernel."""
        if not kernel.py_func.__module__.startswith("netsp.") or not self._depth:
            return
        self._depth -= 1
        self._done_s += compile_time_s(kernel)
        if not self._depth:
            self._spent_s += time.monotonic() - self._begun_at
        self._show()

    @property
    def spent_s(self) -> float:
        """Seconds spent on compiling so far."""
        return self._spent_s + (time.monotonic() - self._begun_at if self._depth else 0.0)

    @property
    def has_delayed(self) -> bool:
        """True if compiling took so long that it explains why a time limit was reached."""
        return self.spent_s >= self._policy.min_delay_s

    def close(self) -> None:
        """Remove the bar."""
        if self._line is not None:
            self._line.clear()

    def _show(self) -> None:
        text = (
            f"preparing {self._subject}, about {max(self._expected_s, 1.0):.0f} s, "
            "once per installation"
        )
        if self._line is not None:
            share = min(self._done_s / self._expected_s, 1.0)
            room = self._line.columns - len(text) - 4
            self._line.show(f"{text} {self._policy.bar(share, room)}")
            return
        now = time.monotonic()
        if not self._printed_at:
            print(text, file=self._stream, flush=True)
        elif now - self._printed_at >= self._policy.every_s and self._depth:
            so_far_s = self.spent_s
            left_s = max(self._expected_s - self._done_s, 1.0)
            print(
                f"preparing {self._subject}, {so_far_s:.0f} s so far, about {left_s:.0f} s left",
                file=self._stream,
                flush=True,
            )
        else:
            return
        self._printed_at = now


def _folder_compile_time_s(kernel: Any) -> float:
    """Return the approximate CPU seconds to compile the imported kernels of a kernel's folder.

    Kernels that are on disk do not count.
    """
    from netsp.base.compiled.compile_policy import current_policy
    from netsp.base.compiled.disk_cache import lock_file
    from netsp.base.compiled.kernel import functions_to_compile
    from netsp.base.compiled.tiered import TieredDispatcher

    if not isinstance(kernel, TieredDispatcher):
        return 0.0
    folder, total_s = Path(kernel.py_func.__code__.co_filename).parent, 0.0
    lock = lock_file(kernel)
    indexes = [] if lock is None else lock.parent.glob("*.nbi")
    on_disk = {index.name.rpartition("-")[0] for index in indexes}
    for function in functions_to_compile():
        file = Path(function.__code__.co_filename)
        if file.parent == folder and f"{file.stem}.{function.__qualname__}" not in on_disk:
            total_s += current_policy().compile_time_s(len(function.__code__.co_code))
    return total_s


def compile_time_s(kernel: Any, with_called: bool = False) -> float:
    """Return the approximate CPU seconds to compile a kernel.

    Parameters
    ----------
    kernel : dispatcher
        The kernel.
    with_called : bool
        Whether to include the kernels that it calls, as far as they are not compiled.
    """
    from netsp.base.compiled.compile_policy import current_policy

    bytecode_size = len(kernel.py_func.__code__.co_code)
    bytecode_with_called = getattr(kernel, "bytecode", None) if with_called else None
    return current_policy().compile_time_s(
        bytecode_with_called() if bytecode_with_called is not None else bytecode_size
    )
