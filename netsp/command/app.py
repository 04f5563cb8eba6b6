"""`netsp app`: plan on a map, in the browser."""

from __future__ import annotations

import argparse
import json
import secrets
import socket
import sys
import threading
import webbrowser
from typing import TYPE_CHECKING

from netsp.base.errors import InputError
from netsp.command import messages

if TYPE_CHECKING:
    from netsp.app.state import Document


def _document(name: str | None) -> tuple[Document, list[str]]:
    """Return the document to open (a problem, or an import of a map) and notes on the import."""
    from pathlib import Path

    from netsp.app.served_files import import_warnings, is_map, without_options
    from netsp.app.state import Document
    from netsp.command.import_site import show_table
    from netsp.exchange.maps.site_import import import_site

    path = Path(name or "")
    is_problem = path.suffix.lower() == ".json" and not (
        path.is_file() and is_map(path.read_bytes())
    )
    if name is None or is_problem:
        return Document(name), []
    target = path.with_suffix(".json")
    if target == path:
        raise InputError(
            f"{name}: is a map, and saving its problem would overwrite it; give the map another "
            "extension, such as .geojson or .plan"
        )
    imported = import_site(name)
    record = imported.problem.site
    assert record is not None
    show_table(name, imported)
    for text in import_warnings(imported.problem):
        messages.warning(text)
    notes = [f"{path.name}: {without_options(n)}" for n in imported.notes if n not in record.notes]
    return Document(target, json.loads(imported.problem.to_json())), notes


def run(args: argparse.Namespace) -> int:
    """Serve until Ctrl-C, and return the exit code."""
    try:
        import uvicorn
    except ImportError:
        raise InputError("the map needs uvicorn: pip install 'netsp[app]'") from None
    from netsp.app.page_session import Session
    from netsp.app.server import application
    from netsp.app.state import Document

    shown, notes = None, list[str]()
    if args.show:
        from netsp.app.shown import read_shown

        if args.problem is None:
            raise InputError("--show: expected a solution file, or the folder of a run")
        shown = read_shown(args.problem, args.problem_file)
        document = Document(None, shown.data)
    elif args.problem_file is not None:
        raise InputError("--problem: needs --show")
    else:
        document, notes = _document(args.problem)
    if not document.saved:
        messages.note(f"{args.problem}: the map shows your last edits, which were not saved")
    if not 0 <= args.port <= 65535:
        raise InputError(f"--port: expected 0 to 65535, got {args.port}")
    try:
        listening = socket.create_server(("127.0.0.1", args.port))
    except OSError as error:
        raise InputError(f"--port: {args.port} cannot be used: {error.strerror}") from None
    with listening:
        port = listening.getsockname()[1]
        token = secrets.token_urlsafe(24)
        address = f"http://127.0.0.1:{port}/?token={token}"
        session = Session(document, float(args.time_limit), shown, notes)
        print(f"the map is at {address}\nCtrl-C ends it", file=sys.stderr, flush=True)
        if not args.no_browser:
            threading.Timer(0.5, webbrowser.open, [address]).start()
        config = uvicorn.Config(
            application(session, token, port),
            log_level="warning",
            ws_max_size=session.policy.max_message_bytes,
            access_log=False,
            server_header=False,
        )
        try:
            uvicorn.Server(config).run(sockets=[listening])
        finally:
            session.close()
    return 0
