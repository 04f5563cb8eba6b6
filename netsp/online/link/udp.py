"""UDP socket that speaks MAVLink."""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
from typing import Any

from netsp.base.errors import InputError
from netsp.online.link.address import Address
from netsp.online.link.dialect import GROUND_STATION, ONBOARD_COMPUTER, dialect, parser

MAX_DATAGRAM_BYTES = 65_536
"""Format limit of UDP: length of a datagram, bytes."""


def messages_in(data: bytes) -> list[Any]:
    """Return the whole messages in a datagram, in order; malformed ones are left out.

    Each datagram gets its own parser, so that an incomplete message does not spoil the next
    one.
    """
    try:
        found = parser().parse_buffer(data) or []
    except (dialect().MAVError, struct.error, ValueError):
        # pymavlink notices some malformed messages only when it unpacks them
        return []
    return [m for m in found if m.get_type() != "BAD_DATA"]


class UdpLink:
    """UDP link to one vehicle.

    Parameters
    ----------
    address : Address
        Address of the link.
    system, component : int
        Our system id and component id.

    Raises
    ------
    InputError
        The address cannot be used.
    """

    def __init__(
        self, address: Address, system: int = GROUND_STATION, component: int = ONBOARD_COMPUTER
    ) -> None:
        self.ids = system, component
        self._pack = parser(system, component)
        self._lock = threading.Lock()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.peer: tuple[str, int] | None = None
        try:
            if address.listens:
                self._socket.bind((address.host, address.port))
            else:
                self.peer = (socket.gethostbyname(address.host), address.port)
        except OSError as error:
            self._socket.close()
            raise InputError(
                f"--link: {address.host}:{address.port}: {error.strerror or error}"
            ) from None

    def receive(self, timeout_s: float) -> list[tuple[Any, tuple[str, int]]]:
        """Return the messages of the next datagram, each with its sender's host and port."""
        self._socket.settimeout(max(timeout_s, 1e-4))
        try:
            data, peer = self._socket.recvfrom(MAX_DATAGRAM_BYTES)
        except (TimeoutError, BlockingIOError, ConnectionError):
            return []
        except OSError:  # closed while it waited
            return []
        return [(m, peer) for m in messages_in(data)]

    def set_peer(self, peer: tuple[str, int]) -> None:
        """Send to a host and port from now on."""
        self.peer = peer

    def send(self, message: Any) -> bool:
        """Send a message, from any thread; return False if it was not sent, or no vehicle was heard
        yet."""
        with self._lock:
            if self.peer is None:
                return False
            data = message.pack(self._pack)
            self._pack.seq = (self._pack.seq + 1) % 256
            with contextlib.suppress(OSError):  # as if the message were lost
                self._socket.sendto(data, self.peer)
                return True
            return False

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
