"""The map within a notebook."""

from __future__ import annotations

import html
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from types import TracebackType
from typing import Self

from netsp.base.errors import InputError
from netsp.base.field_types import checked_argument
from netsp.base.files import write_text
from netsp.model.problem import Problem


class Frame:
    """`netsp app` in a frame: the last expression of a notebook's cell shows it.

    Parameters
    ----------
    problem : Problem or str or Path
        A problem, which is edited in a file of its own, or a problem file.
    height : int
        Height of the frame, pixels.

    Attributes
    ----------
    address : str
        Address of the page.
    file : Path
        Problem file; `problem` reads it.

    Raises
    ------
    InputError
        There is no such file, or the page cannot be served.

    Examples
    --------
    >>> from netsp.app.view_box import Frame            # doctest: +SKIP
    >>> map = Frame("problems/wharf.json")           # doctest: +SKIP
    >>> map                                          # doctest: +SKIP
    >>> map.problem()                                # doctest: +SKIP
    """

    def __init__(self, problem: Problem | str | Path, height: int = 640) -> None:
        self.height = int(checked_argument("height", height, 100, 10_000))
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        if isinstance(problem, Problem):
            self._folder = tempfile.TemporaryDirectory(prefix="netsp-")
            self.file = Path(self._folder.name) / "problem.json"
            write_text(self.file, problem.to_json())
        else:
            self.file = Path(problem)
        self._server = subprocess.Popen(
            [sys.executable, "-m", "netsp", "app", str(self.file), "--no-browser"],
            stderr=subprocess.PIPE,
            text=True,
        )
        lines = []
        assert self._server.stderr is not None
        for line in self._server.stderr:
            lines.append(line)
            if match := re.search(r"http://\S+", line):
                self.address = match.group()
                return
        self._server.wait()
        self._server.stderr.close()
        raise InputError(
            "".join(lines).strip().removeprefix("netsp: ") or "the map cannot be shown"
        )

    def problem(self) -> Problem:
        """Return the problem as it was saved last (Ctrl+S on the map)."""
        return Problem.load(self.file)

    def close(self) -> None:
        """End the server."""
        self._server.terminate()
        self._server.wait(10)
        if self._server.stderr is not None:
            self._server.stderr.close()
        if self._folder is not None:
            self._folder.cleanup()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def __del__(self) -> None:
        if (server := getattr(self, "_server", None)) is not None and server.poll() is None:
            server.terminate()

    def __repr__(self) -> str:
        return f"<map of {self.file.name} at {self.address}>"

    def _repr_html_(self) -> str:
        return (
            f'<iframe src="{html.escape(self.address, quote=True)}" width="100%" '
            f'height="{self.height}" style="border:1px solid #ccc" title="netsp: plan on a map">'
            "</iframe>"
        )
