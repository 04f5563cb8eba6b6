"""Answers of the server: the page, its files, imports, and messages over a WebSocket."""

from __future__ import annotations

import asyncio
import contextlib
import json
import secrets
from collections.abc import AsyncIterator, Mapping
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from starlette.applications import Starlette
from starlette.requests import ClientDisconnect, Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState

from netsp.app.downloads import download
from netsp.app.page_session import Session
from netsp.app.served_files import ImportAnswers, imported
from netsp.base.errors import InputError, NetspError, UnansweredError
from netsp.base.validated import parse_json_object

STATIC = Path(__file__).parent / "static"

CONTENT_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; connect-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'self' http://127.0.0.1:* http://localhost:*"
)
"""Scripts come from files only; plotly styles what it draws in place. Frames: notebooks are served
from this machine, too; without the token they see nothing."""

HEADERS = (
    (b"content-security-policy", CONTENT_POLICY.encode()),
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
    (b"cache-control", b"no-store"),
)
"""Headers of every answer."""


class Routes:
    """Answers of a session to its own page; other hosts and origins are refused.

    Parameters
    ----------
    session : Session
        Session that is served.
    token : str
        Secret that every request must state.
    port : int
        Port that the server listens on.
    """

    def __init__(self, session: Session, token: str, port: int) -> None:
        self.session, self._token = session, token
        self._hosts = {f"127.0.0.1:{port}", f"localhost:{port}"}
        self._app = Starlette(
            routes=[
                Route("/", self.page),
                Route("/download/{name}", self.download),
                Route("/import", self.take_in, methods=["POST"]),
                Route("/plotly.js", self.plotly),
                WebSocketRoute("/live", self.live),
                Mount("/static", StaticFiles(directory=STATIC)),
            ],
            lifespan=self._lifespan,
        )

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Answer a request if host and origin are known; stamp `HEADERS` on every answer."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        headers = {k.decode("latin-1"): v.decode("latin-1") for k, v in scope["headers"]}
        if not self._is_known(headers):
            await PlainTextResponse("netsp: not this host", 403)(scope, receive, send)
            return

        async def stamped(message: Any) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message["headers"], *HEADERS]
            await send(message)

        await self._app(scope, receive, stamped)

    @contextlib.asynccontextmanager
    async def _lifespan(self, app: Any) -> AsyncIterator[None]:
        del app
        self.session.begin()
        try:
            yield
        finally:
            self.session.close()

    def _is_known(self, headers: Mapping[str, str]) -> bool:
        """Return whether a request is for this server, and comes from its own page or no page."""
        origin = headers.get("origin")
        return headers.get("host") in self._hosts and (
            origin is None
            or (urlsplit(origin).netloc in self._hosts and origin.startswith("http://"))
        )

    def _is_allowed(self, given: str | None) -> bool:
        return given is not None and secrets.compare_digest(given.encode(), self._token.encode())

    def _refusal(self, request: Request) -> Response | None:
        """Return the answer to a request without the token; None for one with it."""
        if self._is_allowed(request.query_params.get("token")):
            return None
        return PlainTextResponse("netsp: the address lacks its token", status_code=403)

    def page(self, request: Request) -> Response:
        """Return the page."""
        return self._refusal(request) or FileResponse(STATIC / "index.html")

    def download(self, request: Request) -> Response:
        """Return a file of what is shown."""
        return self._refusal(request) or download(self.session, request.path_params["name"])

    async def take_in(self, request: Request) -> Response:
        """Make a file that was dropped on the page the next version."""
        if refusal := self._refusal(request):
            return refusal
        size = request.headers.get("content-length", "")
        max_bytes = self.session.policy.max_file_bytes
        if not size.isdigit() or int(size) > max_bytes:
            return PlainTextResponse(f"netsp: expected at most {max_bytes} bytes", status_code=413)
        try:
            content = await request.body()
        except ClientDisconnect:  # nobody is left to read this answer
            return PlainTextResponse("netsp: the page went away", status_code=400)
        try:
            notes = await self._import(request, content)
        except UnansweredError as error:  # the page asks for what is missing
            if error.asks:
                questions = {"said": list(error.plain), "asks": list(error.asks)}
                return JSONResponse(questions, status_code=422)
            return PlainTextResponse(f"netsp: {'; '.join(error.plain)}", status_code=422)
        except NetspError as error:
            return PlainTextResponse(f"netsp: {error}", status_code=422)
        version = {"x-version": str(self.session.document.version)}
        return PlainTextResponse("\n".join(notes), headers=version)

    async def _import(self, request: Request, content: bytes) -> list[str]:
        """Replace the document by an imported file; return the notes and warnings of the import."""
        session = self.session
        if session.shown is not None:
            raise InputError("this page is read-only")
        tether = session.document.data.get("tether_length")
        data, notes = await asyncio.to_thread(
            imported,
            request.query_params.get("name", ""),
            content,
            tether if isinstance(tether, int | float) else None,
            ImportAnswers.parse(request.query_params),
            session.policy,
        )
        notes += session.take_in(data, notes)
        return notes

    def plotly(self, request: Request) -> Response:
        """Return the script that draws in space."""
        del request
        from netsp.app.space_preview import script

        try:
            return FileResponse(script(), media_type="text/javascript")
        except InputError as error:
            return PlainTextResponse(f"netsp: {error}", status_code=404)

    async def live(self, socket: WebSocket) -> None:
        """Exchange messages with a page until it is closed."""
        token = socket.query_params.get("token")
        if not (self._is_known(socket.headers) and self._is_allowed(token)):
            await socket.close(code=4403)
            return
        await socket.accept()
        queue: asyncio.Queue[str] = asyncio.Queue()
        for message in self.session.everything():
            queue.put_nowait(json.dumps(message))
        self.session.pages.add(queue)
        sending = asyncio.create_task(_send_all(socket, queue))
        try:
            await self._answer_all(socket, queue)
        except WebSocketDisconnect:
            pass
        finally:
            self.session.pages.discard(queue)
            sending.cancel()

    async def _answer_all(self, socket: WebSocket, queue: asyncio.Queue[str]) -> None:
        """Queue the answers to all messages of a page, in order except for slow ones."""
        session = self.session
        later: set[asyncio.Task[None]] = set()

        async def solve_order(message: dict[str, Any]) -> None:
            """Answer a message that may take seconds, while other messages are answered."""
            queue.put_nowait(json.dumps(await asyncio.to_thread(session.answer_to, message)))

        # a page that is gone may be found out by sending to it
        while socket.application_state is WebSocketState.CONNECTED:
            received = await socket.receive()
            if received["type"] == "websocket.disconnect":
                return
            message = await asyncio.to_thread(_parsed, received.get("text"))
            if isinstance(message, dict) and "order" in message:
                later.add(task := asyncio.create_task(solve_order(message)))
                task.add_done_callback(later.discard)
                continue
            answer = session.answer_to(message) if isinstance(message, dict) else {"error": message}
            if answer is not None:
                queue.put_nowait(json.dumps(answer))


async def _send_all(socket: WebSocket, queue: asyncio.Queue[str]) -> None:
    """Send queued messages until the page is gone."""
    with contextlib.suppress(WebSocketDisconnect):
        while True:
            await socket.send_text(await queue.get())


def _parsed(text: str | None) -> dict[str, Any] | str:
    """Return a parsed message, or one line that says what is wrong with it; `text` is None for
    bytes."""
    if text is None:
        return "message: expected text, got bytes"
    try:
        return parse_json_object(text, "message")
    except InputError as error:
        return str(error)
