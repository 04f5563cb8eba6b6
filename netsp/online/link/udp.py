"""A UDP socket that speaks MAVLink."""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
from typing import Any

from netsp.base.errors import InputError
from netsp.online.link.address import Address
from netsp.online.link.dialect import GROUND_STATION, ONBOARD_COMPUTER, dialect, parser

MOST_BYTES = 65_536
"""Of a datagram."""


def messages_in(data: bytes) -> list[Any]:
    """The whole messages in a datagram; what is malformed is none.

    Each gets a parser of its own, for what one leaves half done must not spoil the next.

    Parameters
    ----------
    data : bytes
        As it came.

    Returns
    -------
    list of MAVLink_message
        In their order.
    """
    try:
        found = parser().parse_buffer(data) or []
    except (dialect().MAVError, struct.error, ValueError):
        # pymavlink lets some malformed messages through to where they are unpacked
        return []
    return [m for m in found if m.get_type() != "BAD_DATA"]


class UdpLink:
    """Sends to, and hears from, one vehicle.

    Parameters
    ----------
    address : Address
        Where.
    system : int
        Our system id.
    component : int
        Our component id.

    Raises
    ------
    InputError
        The address cannot be had.
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

    def hear(self, seconds: float) -> list[tuple[Any, tuple[str, int]]]:
        """The messages of the next datagram.

        Parameters
        ----------
        seconds : float
            To wait for one.

        Returns
        -------
        list of (MAVLink_message, (str, int))
            And where it came from; none where none came.
        """
        self._socket.settimeout(max(seconds, 1e-4))
        try:
            data, peer = self._socket.recvfrom(MOST_BYTES)
        except (TimeoutError, BlockingIOError, ConnectionError):
            return []
        except OSError:  # closed while it waited
            return []
        return [(m, peer) for m in messages_in(data)]

    def answer(self, peer: tuple[str, int]) -> None:
        """Send to that address from now on.

        Parameters
        ----------
        peer : (str, int)
            Host and port.
        """
        self.peer = peer

    def send(self, message: Any) -> bool:
        """Send a message, from any thread.

        Parameters
        ----------
        message : MAVLink_message
            The message.

        Returns
        -------
        bool
            Whether it is on its way; not while nobody was heard.
        """
        with self._lock:
            if self.peer is None:
                return False
            data = message.pack(self._pack)
            self._pack.seq = (self._pack.seq + 1) % 256
            with contextlib.suppress(OSError):  # a network that is down is one where nothing comes
                self._socket.sendto(data, self.peer)
                return True
            return False

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
