"""How often a vehicle tells where it is, and how it is asked to tell it more often."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from netsp.errors import InputError
from netsp.link.dialect import dialect
from netsp.link.frame import Frame


@dataclass(frozen=True)
class RatePolicy:
    """Policy of how often a vehicle should tell what the guard needs.

    Attributes
    ----------
    position_hz
        Positions a second that are asked for; the guard takes ten. Positive.
    status_hz
        Messages a second on the filter, the heading and the sensors. Positive.
    min_position_hz
        Positions a second below which it is said that they are few. Positive.
    span_s
        Time over which positions are counted, s, by the vehicle's clock. Positive.
    ask_s
        Time between two requests while positions are few, s. Positive.
    """

    position_hz: float = 10.0
    status_hz: float = 5.0
    min_position_hz: float = 8.0
    span_s: float = 5.0
    ask_s: float = 5.0

    def __post_init__(self) -> None:
        for name in ("position_hz", "status_hz", "min_position_hz", "span_s", "ask_s"):
            if not getattr(self, name) > 0.0:
                raise InputError(f"{name}: expected more than 0, got {getattr(self, name)!r}")


class MessageRates:
    """Counts the positions of a vehicle, says when they are few, and asks for more if it may.

    Parameters
    ----------
    frame : Frame
        Frame of the site: which message tells positions.
    asks : bool
        True to ask the vehicle (MAV_CMD_SET_MESSAGE_INTERVAL); otherwise it is only said.
    policy : RatePolicy, optional
        How often is enough.

    Attributes
    ----------
    hz : float or None
        Positions a second over the last span; None before the first span is over.
    """

    def __init__(self, frame: Frame, asks: bool = False, policy: RatePolicy | None = None) -> None:
        self.frame, self.asks, self.policy = frame, asks, policy or RatePolicy()
        self.hz: float | None = None
        self._begin: float | None = None
        self._count = 0
        self._asked: float | None = None
        self._first_asked: float | None = None
        self._is_told = False
        self._is_refused = False

    def take(self, time: float) -> Iterator[str]:
        """Count a position, and yield what is to be said of their rate, once.

        Parameters
        ----------
        time : float
            Seconds, by the vehicle's clock.

        Yields
        ------
        str
            One line of text.
        """
        if self._begin is None or time < self._begin:  # the clock was set
            self._begin, self._count = time, 0
            return
        self._count += 1
        if time - self._begin < self.policy.span_s:
            return
        self.hz = self._count / (time - self._begin)
        self._begin, self._count = time, 0
        if self.hz >= self.policy.min_position_hz or self._is_told:
            return
        if not self.asks:
            self._is_told = True
            yield (
                f"positions come {self.hz:.1f} times a second, and so do reports; --ask-rates asks "
                f"the vehicle for {self.policy.position_hz:g}"
            )
        elif self._first_asked is not None and time - self._first_asked > self.policy.span_s:
            self._is_told = True
            yield (
                f"positions still come {self.hz:.1f} times a second, though the vehicle was asked "
                f"for {self.policy.position_hz:g}"
            )

    def take_ack(self, command: int, result: int) -> Iterator[str]:
        """Take the vehicle's answer to a request, and yield what is to be said of it, once.

        Parameters
        ----------
        command : int
            Number of the command.
        result : int
            MAV_RESULT.

        Yields
        ------
        str
            One line of text.
        """
        m = dialect()
        is_ours = self._asked is not None and command == m.MAV_CMD_SET_MESSAGE_INTERVAL
        if is_ours and result != m.MAV_RESULT_ACCEPTED and not self._is_refused:
            self._is_refused = True
            entry = m.enums["MAV_RESULT"].get(result)
            name = "MAV_RESULT " + str(result) if entry is None else entry.name
            yield f"the vehicle refuses other rates of its messages ({name})"

    def requests(self, system: int, now: float) -> list[Any]:
        """Return what to send to the vehicle now, if anything.

        Parameters
        ----------
        system : int
            System id of the vehicle.
        now : float
            Seconds, by the vehicle's clock.

        Returns
        -------
        list of MAVLink_message
            One request for each kind of message.
        """
        p = self.policy
        if not self.asks or self._is_refused:
            return []
        if self._asked is not None:
            is_enough = self.hz is None or self.hz >= p.min_position_hz
            if 0.0 <= now - self._asked < p.ask_s or (is_enough and now >= self._asked):
                return []
        self._asked = now
        self._first_asked = now if self._first_asked is None else self._first_asked
        m = dialect()
        position = (
            m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT if self.frame.is_global
            else m.MAVLINK_MSG_ID_LOCAL_POSITION_NED
        )  # fmt: skip
        wanted = {position: p.position_hz} | dict.fromkeys(
            (
                m.MAVLINK_MSG_ID_ATTITUDE, m.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
                m.MAVLINK_MSG_ID_GPS_RAW_INT, m.MAVLINK_MSG_ID_SYS_STATUS,
            ), p.status_hz,
        )  # fmt: skip
        return [
            m.MAVLink_command_long_message(
                system, 1, m.MAV_CMD_SET_MESSAGE_INTERVAL, 0, message, round(1e6 / hz), 0, 0, 0, 0,
                0,
            )
            for message, hz in wanted.items()
        ]  # fmt: skip
