"""Addresses of links: udpin:14550, udpin:127.0.0.1:14550, udpout:192.168.2.1:14550."""

from __future__ import annotations

from dataclasses import dataclass

from netsp.base.errors import InputError

EXPECTED_ADDRESS = "expected udpin:PORT, udpin:HOST:PORT or udpout:HOST:PORT"


@dataclass(frozen=True)
class Address:
    """Address of a link.

    Attributes
    ----------
    listens
        Whether we wait for the vehicle to speak first (udpin), or speak first (udpout).
    host
        Host name or number; for udpin the one to bind to.
    port
        UDP port.
    """

    listens: bool
    host: str
    port: int

    @classmethod
    def parse(cls, text: str) -> Address:
        """Parse an address as given on the command line; without a host, it is this machine.

        Raises
        ------
        InputError
            The text is no such address.
        """
        kind, _, rest = text.partition(":")
        host, _, port = rest.rpartition(":")
        if kind not in ("udpin", "udpout") or (kind == "udpout" and not host):
            raise InputError(f"--link: {EXPECTED_ADDRESS}, got {text!r}")
        if not (port.isascii() and port.isdigit() and 0 < int(port) < 65536):
            raise InputError(f"--link: expected a port from 1 to 65535, got {text!r}")
        return cls(kind == "udpin", host or "127.0.0.1", int(port))
