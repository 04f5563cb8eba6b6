"""Web page of a guard: map, taut tether, path home, slack over time, alarms.

Served from this machine only, to whoever has the token in the address; reports go out as
server-sent events. A page can send only corrections of the class, or events of a flight.
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
from netsp.online.guard.guard_policy import PagePolicy
from netsp.online.guard.site import Site
from netsp.online.guard.site_files import site_of
from netsp.world.mission.mission import Mission

STATIC = Path(__file__).parent / "static"

FILES = {
    "": ("page.html", "text/html; charset=utf-8"),
    "page.js": ("page.js", "text/javascript; charset=utf-8"),
    "page.css": ("page.css", "text/css; charset=utf-8"),
}
"""File and type of each address below the token."""

CONTENT_SECURITY_POLICY = (
    "default-src 'self'; img-src 'self' data:; frame-ancestors 'none'; base-uri 'none'; "
    "form-action 'none'"
)
"""Header that lets a page load files from this server only."""


class Page:
    """Server of the page, in threads of its own while it is entered as a context.

    Parameters
    ----------
    site : Problem, Mission or Site
        Site that the page shows.
    port : int
        Port on this machine; 0 takes any.
    accepts_events : bool
        Whether operators may report events of a tour that is flown, instead of corrections.
    policy : PagePolicy
        Limits.

    Attributes
    ----------
    corrections : Queue of (side, obstacle)
        Corrections of the class by operators.
    events : Queue of str
        Events reported by operators, as JSON.

    Raises
    ------
    InputError
        The port is in use.
    """

    def __init__(
        self,
        site: Problem | Mission | Site,
        port: int,
        accepts_events: bool = False,
        policy: PagePolicy = PagePolicy(),
    ) -> None:
        self.site, self.accepts_events, self.policy = site_of(site), accepts_events, policy
        self.events: queue.Queue[str] = queue.Queue(policy.max_waiting_inputs)
        self.corrections: queue.Queue[tuple[str, str]] = queue.Queue(policy.max_waiting_inputs)
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
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._server.shutdown()
        self._server.server_close()

    def send(self, row: dict[str, Any]) -> None:
        """Send a report, as of `Report.as_row`, to all pages."""
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

    def subscribe(self) -> queue.Queue[str]:
        """Return a queue of reports for one more page, the last one first."""
        page: queue.Queue[str] = queue.Queue(self.policy.max_waiting_reports)
        with self._lock:
            if self._last is not None:
                page.put_nowait(self._last)
            self._pages.add(page)
        return page

    def unsubscribe(self, page: queue.Queue[str]) -> None:
        """Forget the queue of a page that is closed."""
        with self._lock:
            self._pages.discard(page)

    def site_data(self) -> dict[str, Any]:
        """Return the site as a JSON object for the map."""
        site = self.site
        return {
            "name": site.name,
            "units": site.units,
            "tether_length": site.tether_length,
            "sides": list(site.sides),
            "events": self.accepts_events,
            **site.map_data(),
        }


class _Server(ThreadingHTTPServer):
    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore the error of a page that was closed; report others."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    owner: Page
    protocol_version = "HTTP/1.1"
    timeout = 30

    def log_message(self, format: str, *args: Any) -> None:
        """Log nothing."""

    def _requested(self) -> str | None:
        """Return the address below the token; None without the token.

        None also for another name of this machine, as that of a foreign page whose name resolves to
        this machine (DNS rebinding).
        """
        host = (self.headers.get("Host") or "").rsplit(":", 1)[0]
        parts = self.path.split("?", 1)[0].split("/", 2)
        has_token = len(parts) == 3 and secrets.compare_digest(
            parts[1].encode("utf-8", "replace"), self.owner.token.encode()
        )
        return parts[2] if has_token and host in ("127.0.0.1", "localhost") else None

    def do_GET(self) -> None:
        """Answer with a file, the site, or the stream of reports."""
        requested = self._requested()
        if requested is None:
            self._answer(HTTPStatus.NOT_FOUND, b"not found\n", "text/plain")
        elif requested == "site":
            data = json.dumps(self.owner.site_data(), allow_nan=False).encode()
            self._answer(HTTPStatus.OK, data, "application/json")
        elif requested == "reports":
            self._stream()
        elif requested in FILES:
            name, kind = FILES[requested]
            self._answer(HTTPStatus.OK, (STATIC / name).read_bytes(), kind)
        else:
            self._answer(HTTPStatus.NOT_FOUND, b"not found\n", "text/plain")

    def do_POST(self) -> None:
        """Accept a correction of the class, or an event."""
        length, requested = self.headers.get("Content-Length") or "", self._requested()
        accepted = "event" if self.owner.accepts_events else "correct"
        is_number = len(length) <= 5 and length.isascii() and length.isdigit()
        max_bytes = self.owner.policy.max_body_bytes
        if requested != accepted or not is_number or int(length) > max_bytes:
            self._answer(HTTPStatus.NOT_FOUND, b"not found\n", "text/plain")
            return
        origin = self.headers.get("Origin")
        ours = (f"http://127.0.0.1:{self.owner.port}", f"http://localhost:{self.owner.port}")
        body = self.rfile.read(int(length))
        is_accepted = origin in (None, *ours)
        if is_accepted:
            is_event = requested == "event"
            is_accepted = self._add_event(body) if is_event else self._add_correction(body)
        status = HTTPStatus.OK if is_accepted else HTTPStatus.BAD_REQUEST
        self._answer(status, b"{}", "application/json")

    def _add_event(self, body: bytes) -> bool:
        """Add an event for the flight, which parses it; return False if too many wait."""
        try:
            self.owner.events.put_nowait(body.decode())
        except (UnicodeError, queue.Full):
            return False
        return True

    def _add_correction(self, body: bytes) -> bool:
        """Add a correction; return False if it is not valid or too many wait."""
        try:
            data = json.loads(body)
            side, obstacle = str(data["side"]), data["obstacle"]
        except (ValueError, KeyError, TypeError, RecursionError):
            return False
        if side not in self.owner.site.sides or not isinstance(obstacle, str):
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
        self.send_header("Content-Security-Policy", CONTENT_SECURITY_POLICY)
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
        page = self.owner.subscribe()
        try:
            while True:
                try:
                    text = page.get(timeout=5.0)
                except queue.Empty:
                    self.wfile.write(b": still here\n\n")  # fails if the page is closed
                    continue
                self.wfile.write(f"data: {text}\n\n".encode())
        except OSError:
            pass  # the page was closed
        finally:
            self.owner.unsubscribe(page)
            self.close_connection = True
