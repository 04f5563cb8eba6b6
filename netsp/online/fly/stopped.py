"""Error of a flight that does not begin."""

from __future__ import annotations

from netsp.base.errors import EXIT_NOT_ALL, NetspError


class RefusedError(NetspError):
    """Refusal of a flight: nothing was sent that moves the vehicle."""

    exit_code = EXIT_NOT_ALL
