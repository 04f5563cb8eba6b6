"""Rates of a vehicle's messages: how often it sends its position, and requests for more."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from netsp.base.errors import InputError
from netsp.online.link.dialect import dialect
from netsp.online.link.geo_frame import Frame


@dataclass(frozen=True)
class RatePolicy:
    """Policy of the rates that a guard needs.

    Attributes
    ----------
    position_hz
        Positions per second to ask for; the guard updates ten times a second. Positive.
    status_hz
        Messages per second to ask for about the filter, the heading and the sensors. Positive.
    min_position_hz
        Positions per second below which the guard reports the rate. Positive.
    span_s
        Time over which positions are counted, s. Positive.
    ask_s
        Time between two requests while the rate is too low, s. Positive.
    max_gap_s
        Longest time between two messages within one count, s; after a longer one, the vehicle may
        have restarted, so counting and asking begin anew. Positive.
    """

    position_hz: float = 10.0
    status_hz: float = 5.0
    min_position_hz: float = 8.0
    span_s: float = 5.0
    ask_s: float = 5.0
    max_gap_s: float = 30.0

    def __post_init__(self) -> None:
        for name in (
            "position_hz", "status_hz", "min_position_hz", "span_s", "ask_s", "max_gap_s"
        ):  # fmt: skip
            if not getattr(self, name) > 0.0:
                raise InputError(f"{name}: expected more than 0, got {getattr(self, name)!r}")


class MessageRates:
    """Monitor of how often a vehicle sends its position; it requests more if allowed.

    Parameters
    ----------
    frame : Frame
        Frame of the site, which decides which message tells positions.
    asks : bool
        True to send requests (MAV_CMD_SET_MESSAGE_INTERVAL); False only to report the rate.
    policy : RatePolicy, optional
        Policy of the rates that are needed.
    sender : int
        System id of the requests; answers to other systems are not ours.

    Attributes
    ----------
    hz : float or None
        Positions per second over the last span; None during the first span.
    """

    def __init__(
        self, frame: Frame, asks: bool = False, policy: RatePolicy | None = None, *,
        sender: int = 0,
    ) -> None:  # fmt: skip
        self.frame, self.asks, self.policy = frame, asks, policy or RatePolicy()
        self.sender = sender
        self.hz: float | None = None
        self._begin: float | None = None
        self._heard = 0.0
        self._count = 0
        self._asked: float | None = None
        self._is_asked_before = False
        self._is_told = False
        self._n_refused = 0
        self._is_refused = False

    def take(self, time: float, is_position: bool = True) -> Iterator[str]:
        """Count a message of the vehicle, and yield a line about the rate of positions, once.

        Parameters
        ----------
        time : float
            Time by the vehicle's clock, s; by ours until the vehicle tells its time.
        is_position : bool
            True for a message with a position.

        Yields
        ------
        str
            One line of text.
        """
        begin, heard, self._heard = self._begin, self._heard, time
        if begin is None or time < begin or time - heard > self.policy.max_gap_s:
            # in the first span, this is the change from our clock to the vehicle's
            self._asked = None if self.hz is not None or self._asked is None else time
            self._begin, self._count, self.hz = time, 0, None
            return
        self._count += is_position
        if time - begin < self.policy.span_s:
            return
        self.hz = self._count / (time - begin)
        self._begin, self._count = time, 0
        if self.hz >= self.policy.min_position_hz or self._is_told:
            return
        wanted = self.policy.position_hz
        rate = f"{self.hz:.1f} times a second"
        if not self.asks:
            self._is_told = True
            yield (
                f"positions come {rate}, and so do reports; --ask-rates asks the vehicle for "
                f"{wanted:g}" if self._has_positions
                else f"no positions come; --ask-rates asks the vehicle for {wanted:g} a second"
            )  # fmt: skip
        elif self._is_asked_before and (self._asked is None or begin >= self._asked):
            self._is_told = True
            yield (
                f"positions still come {rate}, though the vehicle was asked for {wanted:g}"
                if self._has_positions
                else f"no positions come, though the vehicle was asked for {wanted:g} a second"
            )

    @property
    def _has_positions(self) -> bool:
        return self.hz is not None and self.hz > 0.0

    def take_ack(self, command: int, result: int, target: int = 0) -> Iterator[str]:
        """Take the vehicle's answer to a request, and yield a line about a refusal, once.

        An answer names the command, but not the message that was asked for. So requests end when
        the vehicle does not know the command, or has refused as often as there are messages.

        Parameters
        ----------
        command : int
            Number of the command.
        result : int
            MAV_RESULT.
        target : int
            System id that the answer is for; 0 if it says none.

        Yields
        ------
        str
            One line of text.
        """
        m = dialect()
        is_ours = target in (0, self.sender) and command == m.MAV_CMD_SET_MESSAGE_INTERVAL
        refusals = (m.MAV_RESULT_DENIED, m.MAV_RESULT_UNSUPPORTED, m.MAV_RESULT_FAILED)
        if not (is_ours and self._is_asked_before and result in refusals):
            return
        self._n_refused += 1
        is_unknown = result == m.MAV_RESULT_UNSUPPORTED
        self._is_refused |= is_unknown or self._n_refused >= len(self._wanted())
        if self._n_refused == 1:
            name = m.enums["MAV_RESULT"][result].name
            what = "other rates" if is_unknown else "another rate of some"
            yield f"the vehicle refuses {what} of its messages ({name})"

    def requests(self, system: int, now: float) -> list[Any]:
        """Return the requests to send to the vehicle now, if any.

        Parameters
        ----------
        system : int
            System id of the vehicle.
        now : float
            Time by the clock of `take`, s.

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
            if is_enough or now - self._asked < p.ask_s:
                return []
        self._asked, self._is_asked_before = now, True
        m = dialect()
        return [
            m.MAVLink_command_long_message(
                system, 1, m.MAV_CMD_SET_MESSAGE_INTERVAL, 0, message, round(1e6 / hz), 0, 0, 0, 0,
                0,
            )
            for message, hz in self._wanted().items()
        ]  # fmt: skip

    def _wanted(self) -> dict[int, float]:
        """Return the rate to ask for of each message, by its number."""
        m = dialect()
        position = (
            m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT if self.frame.is_global
            else m.MAVLINK_MSG_ID_LOCAL_POSITION_NED
        )  # fmt: skip
        status = (
            m.MAVLINK_MSG_ID_ATTITUDE, m.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
            m.MAVLINK_MSG_ID_GPS_RAW_INT, m.MAVLINK_MSG_ID_SYS_STATUS,
        )  # fmt: skip
        return {position: self.policy.position_hz} | dict.fromkeys(status, self.policy.status_hz)
