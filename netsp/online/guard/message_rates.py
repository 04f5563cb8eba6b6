"""Rates of a vehicle's messages: how often it sends its position, and requests for more."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from netsp.online.guard.guard_policy import RatePolicy
from netsp.online.link.dialect import dialect
from netsp.online.link.geo_frame import Frame


class MessageRates:
    """Monitor of how often a vehicle sends its position; it requests more if allowed.

    Parameters
    ----------
    frame : Frame
        Frame of the site, which decides which message has the position.
    sends_requests : bool
        Whether to send requests (MAV_CMD_SET_MESSAGE_INTERVAL); otherwise the rate is only
        reported.
    policy : RatePolicy
        Rates that are needed.
    sender : int
        System id of the requests; answers to other systems are not ours.

    Attributes
    ----------
    hz : float or None
        Positions per second over the last span; None during the first span.
    """

    def __init__(
        self,
        frame: Frame,
        sends_requests: bool = False,
        policy: RatePolicy = RatePolicy(),
        *,
        sender: int = 0,
    ) -> None:
        self.frame, self.sends_requests, self.policy = frame, sends_requests, policy
        self.sender = sender
        self.hz: float | None = None
        self._begin: float | None = None
        self._last = 0.0
        self._count = 0
        self._requested_at: float | None = None
        self._has_requested = False
        self._is_reported = False
        self._n_refused = 0
        self._is_refused = False

    def count(self, time: float, is_position: bool = True) -> Iterator[str]:
        """Count a message of the vehicle, and yield a line about the rate of positions, once.

        Parameters
        ----------
        time : float
            Time by the vehicle's clock, s; by ours until the vehicle reports its time.
        is_position : bool
            Whether the message has a position.
        """
        begin, last, self._last = self._begin, self._last, time
        if begin is None or time < begin or time - last > self.policy.max_gap_s:
            # in the first span, this is the change from our clock to the vehicle's
            is_in_first_span = self.hz is None and self._requested_at is not None
            self._requested_at = time if is_in_first_span else None
            self._begin, self._count, self.hz = time, 0, None
            return
        self._count += is_position
        if time - begin < self.policy.span_s:
            return
        self.hz = self._count / (time - begin)
        self._begin, self._count = time, 0
        if self.hz >= self.policy.min_position_hz or self._is_reported:
            return
        wanted = self.policy.position_hz
        rate = f"{self.hz:.1f} times a second"
        if not self.sends_requests:
            self._is_reported = True
            yield (
                f"positions come {rate}, and so do reports; --ask-rates asks the vehicle for "
                f"{wanted:g}"
                if self._has_positions
                else f"no positions come; --ask-rates asks the vehicle for {wanted:g} a second"
            )
        elif self._has_requested and (self._requested_at is None or begin >= self._requested_at):
            self._is_reported = True
            yield (
                f"positions still come {rate}, though the vehicle was asked for {wanted:g}"
                if self._has_positions
                else f"no positions come, though the vehicle was asked for {wanted:g} a second"
            )

    @property
    def _has_positions(self) -> bool:
        return self.hz is not None and self.hz > 0.0

    def on_ack(self, command: int, result: int, target: int = 0) -> Iterator[str]:
        """Note the vehicle's answer to a request, and yield a line about a refusal, once.

        An answer names the command, but not the message that was requested. So requests end when
        the vehicle does not know the command, or has refused as often as there are messages.

        Parameters
        ----------
        command : int
            Number of the command.
        result : int
            MAV_RESULT.
        target : int
            System id that the answer is for; 0 if it names none.
        """
        m = dialect()
        is_ours = target in (0, self.sender) and command == m.MAV_CMD_SET_MESSAGE_INTERVAL
        refusals = (m.MAV_RESULT_DENIED, m.MAV_RESULT_UNSUPPORTED, m.MAV_RESULT_FAILED)
        if not (is_ours and self._has_requested and result in refusals):
            return
        self._n_refused += 1
        is_unknown = result == m.MAV_RESULT_UNSUPPORTED
        self._is_refused |= is_unknown or self._n_refused >= len(self._wanted())
        if self._n_refused == 1:
            name = m.enums["MAV_RESULT"][result].name
            what = "other rates" if is_unknown else "another rate of some"
            yield f"the vehicle refuses {what} of its messages ({name})"

    def requests(self, system: int, now: float) -> list[Any]:
        """Return the messages that request rates from a system, at a time of `count`'s clock."""
        p = self.policy
        if not self.sends_requests or self._is_refused:
            return []
        if self._requested_at is not None:
            is_enough = self.hz is None or self.hz >= p.min_position_hz
            if is_enough or now - self._requested_at < p.ask_s:
                return []
        self._requested_at, self._has_requested = now, True
        m = dialect()
        return [
            m.MAVLink_command_long_message(
                system, 1, m.MAV_CMD_SET_MESSAGE_INTERVAL, 0, message, round(1e6 / hz), *[0] * 5
            )
            for message, hz in self._wanted().items()
        ]

    def _wanted(self) -> dict[int, float]:
        """Return the rate to request of each message, by its number, Hz."""
        m = dialect()
        position = (
            m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
            if self.frame.is_global
            else m.MAVLINK_MSG_ID_LOCAL_POSITION_NED
        )
        status = (
            m.MAVLINK_MSG_ID_ATTITUDE,
            m.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
            m.MAVLINK_MSG_ID_GPS_RAW_INT,
            m.MAVLINK_MSG_ID_SYS_STATUS,
        )
        return {position: self.policy.position_hz} | dict.fromkeys(status, self.policy.status_hz)
