"""A flight that ends before the tour does."""

from __future__ import annotations

from netsp.base.errors import EXIT_NOT_ALL, NetspError


class RefusedError(NetspError):
    """The flight did not begin: nothing was sent that moves the vehicle."""

    exit_code = EXIT_NOT_ALL
