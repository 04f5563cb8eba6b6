"""The page beside a guard: map, taut tether, way home, slack over time, alarms.

Served from this machine only, to whoever has the token in the address; reports go out as
server-sent events. The only thing that a page can say is on which side of an obstacle the tether
passes.
"""

from __future__ import annotations

import json
import queue
import secrets
import sys
import threading
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from netsp.base.errors import InputError
from netsp.model.problem import Problem
from netsp.online.guard.site import Site
from netsp.online.guard.site_files import site_of
from netsp.world.mission.mission import Mission

STATIC = Path(__file__).parent / "static"

FILES = {
    "": ("page.html", "text/html; charset=utf-8"),
    "page.js": ("page.js", "text/javascript; charset=utf-8"),
    "page.css": ("page.css", "text/css; charset=utf-8"),
}
"""Address below the token → file and its type."""

MOST_BODY = 1000
"""Bytes that a page may send."""

POLICY = (
    "default-src 'self'; img-src 'self' data:; frame-ancestors 'none'; base-uri 'none'; "
    "form-action 'none'"
)

BACKLOG = 50
"""Reports that wait for a slow page; older ones are dropped."""


class Page:
    """Serves the page while it is open, from threads of its own.

    Parameters
    ----------
    site : Problem, Mission or Site
        What it shows.
    port : int
        On this machine; 0 takes any.
    takes_events : bool
        Whether operators may tell of obstacles, goals and tethers, as of a tour that is flown.

    Attributes
    ----------
    corrections : Queue of (side, obstacle)
        What operators say of the class.
    events : Queue of str
        Events that they tell of, as JSON.

    Raises
    ------
    InputError
        The port is taken.
    """

    def __init__(
        self, site: Problem | Mission | Site, port: int, takes_events: bool = False
    ) -> None:
        self.shows, self.takes_events = site_of(site), takes_events
        self.events: queue.Queue[str] = queue.Queue(maxsize=20)
        self.corrections: queue.Queue[tuple[str, str]] = queue.Queue(maxsize=20)
        self.token = secrets.token_urlsafe(16)
        self._pages: set[queue.Queue[str]] = set()
        self._lock = threading.Lock()
        self._last: str | None = None
        page = self

        class Handler(_Handler):
            owner = page

        try:
            self._server = _Server(("127.0.0.1", port), Handler)
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or error
            raise InputError(f"--page: port {port}: {reason}") from None
        self._server.daemon_threads = True
        self.port = int(self._server.server_address[1])
        self.address = f"http://127.0.0.1:{self.port}/{self.token}/"
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:  # fmt: skip
        self._server.shutdown()
        self._server.server_close()

    def tell(self, row: dict[str, Any]) -> None:
        """Send a report to all pages.

        Parameters
        ----------
        row : dict
            As of `Report.as_row`.
        """
        text = json.dumps(row, allow_nan=False)
        with self._lock:
            self._last = text
            pages = list(self._pages)
        for page in pages:
            try:
                page.put_nowait(text)
            except queue.Full:
                try:
                    page.get_nowait()
                    page.put_nowait(text)
                except (queue.Empty, queue.Full):
                    pass

    def subscribed(self) -> queue.Queue[str]:
        """A queue of reports for one more page, the last one first."""
        page: queue.Queue[str] = queue.Queue(maxsize=BACKLOG)
        with self._lock:
            if self._last is not None:
                page.put_nowait(self._last)
            self._pages.add(page)
        return page

    def left(self, page: queue.Queue[str]) -> None:
        """A page is gone."""
        with self._lock:
            self._pages.discard(page)

    def site(self) -> dict[str, Any]:
        """What the map shows of the site."""
        site = self.shows
        return {
            "name": site.name, "units": site.units, "tether_length": site.tether_length,
            "sides": list(site.sides), "events": self.takes_events, **site.shown(),
        }  # fmt: skip


class _Server(ThreadingHTTPServer):
    def handle_error(self, request: Any, client_address: Any) -> None:
        """A page that went away unread is none."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    owner: Page
    protocol_version = "HTTP/1.1"
    timeout = 30

    def log_message(self, format: str, *args: Any) -> None:
        """Nothing is logged."""

    def _asked(self) -> str | None:
        """The address below the token; None for who does not have it, or comes by another name of
        this machine (as pages of others would, after a change of what their name means)."""
        host = (self.headers.get("Host") or "").rsplit(":", 1)[0]
        parts = self.path.split("?", 1)[0].split("/", 2)
        known = len(parts) == 3 and secrets.compare_digest(
            parts[1].encode("utf-8", "replace"), self.owner.token.encode()
        )
        return parts[2] if known and host in ("127.0.0.1", "localhost") else None

    def do_GET(self) -> None:
        """Files, the site, and the stream of reports."""
        asked = self._asked()
        if asked is None:
            self._answer(HTTPStatus.NOT_FOUND, b"not found\n", "text/plain")
        elif asked == "site":
            data = json.dumps(self.owner.site(), allow_nan=False).encode()
            self._answer(HTTPStatus.OK, data, "application/json")
        elif asked == "reports":
            self._stream()
        elif asked in FILES:
            name, kind = FILES[asked]
            self._answer(HTTPStatus.OK, (STATIC / name).read_bytes(), kind)
        else:
            self._answer(HTTPStatus.NOT_FOUND, b"not found\n", "text/plain")

    def do_POST(self) -> None:
        """On which side of an obstacle the tether passes; an event."""
        length, asked = self.headers.get("Content-Length") or "", self._asked()
        taken = ("event",) if self.owner.takes_events else ("correct",)
        number = len(length) <= 5 and length.isascii() and length.isdigit()
        if asked not in taken or not number or int(length) > MOST_BODY:
            self._answer(HTTPStatus.NOT_FOUND, b"not found\n", "text/plain")
            return
        origin = self.headers.get("Origin")
        ours = (f"http://127.0.0.1:{self.owner.port}", f"http://localhost:{self.owner.port}")
        body = self.rfile.read(int(length))
        good = origin in (None, *ours)
        if good:
            good = self._event(body) if asked == "event" else self._correction(body)
        status = HTTPStatus.OK if good else HTTPStatus.BAD_REQUEST
        self._answer(status, b"{}", "application/json")

    def _event(self, body: bytes) -> bool:
        """Whether it was taken; what it says is asked by who flies."""
        try:
            self.owner.events.put_nowait(body.decode())
        except (UnicodeError, queue.Full):
            return False
        return True

    def _correction(self, body: bytes) -> bool:
        """Whether it was taken."""
        try:
            said = json.loads(body)
            side, obstacle = str(said["side"]), said["obstacle"]
        except (ValueError, KeyError, TypeError, RecursionError):
            return False
        if not (
            isinstance(side, str) and side in self.owner.shows.sides and isinstance(obstacle, str)
        ):
            return False
        try:
            self.owner.corrections.put_nowait((side, obstacle))
        except queue.Full:
            return False
        return True

    def _answer(self, status: HTTPStatus, data: bytes, kind: str) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(data)))
        self.send_header("Content-Security-Policy", POLICY)
        self.send_header("Cache-Control", "no-store")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.end_headers()
        self.wfile.write(data)

    def _stream(self) -> None:
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", "text/event-stream")
        self.send_header("Cache-Control", "no-store")
        self.send_header("Connection", "close")
        self.end_headers()
        page = self.owner.subscribed()
        try:
            while True:
                try:
                    text = page.get(timeout=5.0)
                except queue.Empty:
                    self.wfile.write(b": still here\n\n")  # to find out who is gone
                    continue
                self.wfile.write(f"data: {text}\n\n".encode())
        except OSError:
            pass  # the page was closed
        finally:
            self.owner.left(page)
            self.close_connection = True
