"""The server behind the page: this machine only, for whoever has the token.

The page says what it wants over one WebSocket, in order; every answer goes to all pages that are
open, so that two tabs show the same.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from netsp.base.deprecated import deprecated_names
from netsp.base.errors import InputError

if TYPE_CHECKING:
    from netsp.app.page_session import Session
    from netsp.app.routes import Routes


def application(session: Session, token: str, port: int) -> Routes:
    """Return the ASGI application that serves a session (`Routes`).

    Raises
    ------
    InputError
        Starlette is not installed.
    """
    try:
        import starlette  # noqa: F401
    except ImportError:
        raise InputError("the map needs Starlette: pip install 'netsp[app]'") from None
    from netsp.app.routes import Routes

    return Routes(session, token, port)


__getattr__ = deprecated_names(globals(), Session="netsp.app.page_session:Session")
