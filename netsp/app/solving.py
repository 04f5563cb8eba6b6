"""Tours of the latest version, from a process of its own: the page never waits for a proof.

The worker begins again whenever a newer version is there, which it notices within a few hundredths
of a second (`solve(should_stop=…)`); one that dies is replaced.
"""

from __future__ import annotations

import multiprocessing
import threading
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Any

from netsp.app.app_policy import AppPolicy
from netsp.base.deprecated import deprecated_method, renamed_parameters

if TYPE_CHECKING:
    from netsp.model.solution import Solution

OnMessage = Callable[[dict[str, Any]], None]


class Worker:
    """Process that solves the latest version of a problem.

    Parameters
    ----------
    on_message : callable
        Called in a thread with each message: version, stage, and a tour or an error.
    time_limit : float
        Seconds for one version.
    policy : AppPolicy
        Time between two tours, and number of places at which the tether is measured.
    """

    @renamed_parameters(told="on_message")
    def __init__(
        self, on_message: OnMessage, time_limit: float = 60.0, policy: AppPolicy = AppPolicy()
    ) -> None:
        self.on_message, self.time_limit, self._policy = on_message, time_limit, policy
        self._lock = threading.Lock()
        self._closed = False
        self._latest: tuple[int, str] | None = None
        self._start()

    told = deprecated_method("told", "on_message")

    def solve(self, version: int, problem: str) -> None:
        """Solve this version from now on.

        Parameters
        ----------
        version : int
            Number of the version.
        problem : str
            Text of its problem file.
        """
        with self._lock:
            self._latest = version, problem
            if not self._process.is_alive():
                self._start()
            self._connection.send((version, problem, self.time_limit))

    def close(self) -> None:
        """End the worker."""
        self._closed = True
        with self._lock:
            self._process.kill()
            self._process.join()

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._connection, worker_end = context.Pipe()
        self._process = context.Process(target=work, args=(worker_end, self._policy), daemon=True)
        self._process.start()
        worker_end.close()
        threading.Thread(
            target=self._listen, args=(self._connection,), daemon=True, name="netsp-app-solving"
        ).start()

    def _listen(self, connection: Connection) -> None:
        while True:
            try:
                message = connection.recv()
            except (EOFError, OSError):
                break
            self.on_message(message)
        # the process died: report the version as failed, and start another process
        with self._lock:
            if not self._closed and connection is self._connection and self._latest is not None:
                version, _ = self._latest
                self.on_message(
                    {
                        "version": version,
                        "stage": "failed",
                        "error": "the solver's process ended unexpectedly; it is started again",
                    }
                )
                self._latest = None
                self._start()


def work(connection: Connection, policy: AppPolicy = AppPolicy()) -> None:
    """Solve the versions that arrive until the other end closes."""
    from netsp.app.version_solver import VersionSolver

    last: Solution | None = None
    try:
        while True:
            job = connection.recv()
            while connection.poll():
                job = connection.recv()
            version, text, limit = job
            last = VersionSolver(connection, version, text, policy).solve(limit, last) or last
    except (EOFError, OSError, KeyboardInterrupt):
        return
