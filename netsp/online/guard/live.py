"""Guard of a real vehicle: it reads messages and reports ten times a second until it is stopped."""

from __future__ import annotations

import itertools
import queue
import time
from collections.abc import Callable, Iterator
from typing import Any

from netsp.base.errors import InputError
from netsp.online.guard.alarms import Level
from netsp.online.guard.guard_rehearsal import rehearse
from netsp.online.guard.guard_report import Report
from netsp.online.guard.message_rates import MessageRates
from netsp.online.guard.state_file import restore, save
from netsp.online.guard.stream import Stream
from netsp.online.guard.telemetry import Fix
from netsp.online.guard.tether_guard import Guard
from netsp.online.link.address import Address
from netsp.online.link.dialect import dialect
from netsp.online.link.geo_frame import Frame
from netsp.online.link.mavlink_messages import AUTOPILOT, NO_GPS_FIX, POSITIONS, Listener
from netsp.online.link.statustext import status_texts
from netsp.online.link.udp import UdpLink
from netsp.online.link.vehicle_kind import other_vehicle_warning

GUARD_SYSTEM = 245
"""Code MAVLink system id of a guard: 255 is the ground station's."""


def watch(
    guard: Guard,
    frame: Frame,
    address: str,
    on_report: Callable[[Report], None],
    *,
    system: int | None = None,
    state: str | None = None,
    publish: bool = False,
    corrections: queue.Queue[tuple[str, str]] | None = None,
    on_note: Callable[[str], None] | None = None,
    should_stop: Callable[[], bool] | None = None,
    ask_rates: bool = False,
) -> None:
    """Watch a vehicle until the guard is stopped.

    Parameters
    ----------
    guard : Guard
        New guard.
    frame : Frame
        Frame of the site.
    address : str
        Address of the link.
    on_report : callable
        Called with every report.
    system : int, optional
        System id of the vehicle; by default that of the first autopilot heard.
    state : str, optional
        State file of the guard.
    publish : bool
        Whether figures and alarms are sent to the link.
    corrections : Queue of (side, obstacle), optional
        Corrections of the class by the operator.
    on_note : callable, optional
        Called with each note, one line.
    should_stop : callable, optional
        Polled; True ends the watch.
    ask_rates : bool
        Whether to ask the vehicle for the rates that the guard needs, and for nothing else.

    Raises
    ------
    InputError
        The link cannot be opened, or the state file is not of this site.
    """
    note = on_note or (lambda _: None)
    where = Address.parse(address)
    _prepare(guard, state, note)
    link = UdpLink(where, GUARD_SYSTEM)
    live = _Watch(guard, frame, link, on_report, note, system, ask_rates)
    live.publishes = publish
    if not where.listens:
        live.only_peer = link.peer
    saved = time.monotonic()
    try:
        note(f"listening on {address}")
        while should_stop is None or not should_stop():
            live.step()
            if corrections is not None:
                _correct(guard, corrections, note)
            if state is not None and time.monotonic() - saved >= guard.policy.pace.save_s:
                saved = time.monotonic()
                save(guard, state)
    finally:
        link.close()
        if state is not None:
            save(guard, state)


def _prepare(guard: Guard, state: str | None, note: Callable[[str], None]) -> None:
    """Rehearse, and restore the state of the guard if there is one."""
    if state is not None:
        restore(guard, state)  # an error in it is raised before anything takes long
    rehearse(in_space=not guard.site.is_planar)
    if state is not None:
        known = restore(guard, state)
        if known is not None:
            note(f"continuing from {state}, {known.age:.0f} s old")


class _Watch:
    """Watch of one vehicle over a link.

    Attributes
    ----------
    only_peer
        Address of the vehicle, if it waits to be spoken to; others are not listened to.
    publishes
        Whether figures and alarms are sent to the link.
    """

    def __init__(
        self,
        guard: Guard,
        frame: Frame,
        link: UdpLink,
        on_report: Callable[[Report], None],
        note: Callable[[str], None],
        system: int | None,
        ask_rates: bool,
    ) -> None:
        self.pace, self.link = guard.policy.pace, link
        self.on_report, self.note, self.publishes = on_report, note, False
        self.only_peer: tuple[str, int] | None = None
        self.listener = Listener(frame, system, guard.policy.link)
        self.stream = Stream(guard, on_note=note)
        self.hints = _Hints()
        rates = guard.policy.rates
        self.rates = MessageRates(frame, ask_rates, rates, sender=GUARD_SYSTEM)
        self._heartbeat_at = float("-inf")
        self._heard_at = self._published_at = self._reported_at = time.monotonic()
        self._others: set[int] = set()
        self._text_numbers = itertools.count()

    def step(self) -> None:
        """Wait shortly for messages, and report on them, or on their absence."""
        messages = self.link.receive(0.05)
        now = time.monotonic()
        if self.only_peer is not None and now - self._heartbeat_at >= self.pace.heartbeat_s:
            self._heartbeat_at = now  # a vehicle that waits to be spoken to answers nobody else
            computer_on_board = dialect().MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)
            self.link.send(computer_on_board)
        for message, peer in messages:
            if self.only_peer is None or peer == self.only_peer:
                self._read(message, peer, now)
        self._report_silence(now)
        listener = self.listener
        if not listener.has_heard and listener.others - self._others:
            self._others |= listener.others
            who = ", ".join(map(str, sorted(self._others)))
            self.note(f"heard from system {who}, but nothing from system {listener.system} yet")

    def _read(self, message: Any, peer: tuple[str, int], now: float) -> None:
        """Update the guard with a message."""
        listener = self.listener
        fix = listener.read(message)
        for line in self.hints.about(message, fix, listener):
            self.note(line)
        if (message.get_srcSystem(), message.get_srcComponent()) != (listener.system, AUTOPILOT):
            return
        clock = now if listener.time is None else listener.time
        for line in _rate_lines(self.rates, message, fix, clock):
            self.note(line)
        self.link.set_peer(peer)
        for request in self.rates.requests(message.get_srcSystem(), clock):
            self.link.send(request)
        if fix is None:
            return
        self._heard_at = now
        report = self.stream.add(fix)
        if report is not None:
            self._report(report, now)
            is_due = now - self._published_at >= self.pace.publish_s
            if self.publishes and (report.raised or is_due):
                self._published_at = now
                _publish(self.link, report, self._text_numbers)

    def _report(self, report: Report, now: float) -> None:
        self._reported_at = now
        self.on_report(report)

    def _report_silence(self, now: float) -> None:
        """Report at intervals that no messages arrive."""
        silent_s = now - self._heard_at
        is_due = min(silent_s, now - self._reported_at) >= self.pace.silence_s
        if is_due and self.listener.time is not None:
            report = self.stream.advance_to(self.listener.time + now - self._heard_at)
            self._report(report, now)
            if self.publishes and report.raised:
                _publish(self.link, report, self._text_numbers)


def _rate_lines(rates: MessageRates, message: Any, fix: Fix | None, clock: float) -> Iterator[str]:
    """Yield lines about the rates of a vehicle's messages, after one of them."""
    if message.get_type() == "COMMAND_ACK":
        target = int(getattr(message, "target_system", 0))  # which MAVLink 1 does not have
        yield from rates.on_ack(int(message.command), int(message.result), target)
    yield from rates.count(clock, fix is not None and fix.position is not None)


class _Hints:
    """Hints at helpful options, and the warning of an unknown vehicle; each is given once."""

    def __init__(self) -> None:
        self._has_position = False
        self._has_warned = False
        self._given: set[str] = set()

    def about(self, message: Any, fix: Fix | None, listener: Listener) -> Iterator[str]:
        """Yield the hint for a position message that is not used, and the warning of an unknown
        vehicle."""
        kind = listener.kind
        if kind is not None and not self._has_warned:
            self._has_warned = True
            if not kind.is_ardusub:
                yield other_vehicle_warning(kind)
        self._has_position = self._has_position or (fix is not None and fix.position is not None)
        if self._has_position or fix is not None or message.get_type() not in POSITIONS:
            return
        line = ""
        if message.get_srcSystem() != listener.system:
            if message.get_srcComponent() == AUTOPILOT and listener.has_heard:
                line = (
                    f"system {message.get_srcSystem()} sends positions, system {listener.system} "
                    f"none yet; follow the other one with --system {message.get_srcSystem()}"
                )
        elif listener.left_out == NO_GPS_FIX:
            line = f"GLOBAL_POSITION_INT: {NO_GPS_FIX}; read metres with --frame local"
        if line and line not in self._given:
            self._given.add(line)
            yield line


def _correct(
    guard: Guard, corrections: queue.Queue[tuple[str, str]], note: Callable[[str], None]
) -> None:
    """Correct the class as the operator says."""
    while True:
        try:
            side, obstacle = corrections.get_nowait()
        except queue.Empty:
            return
        try:
            guard.correct(side, obstacle)
            note(f"corrected: the tether passes {side} of {obstacle}")
        except InputError as error:
            note(f"not corrected: {error}")


def _publish(link: UdpLink, report: Report, text_numbers: Iterator[int]) -> None:
    """Send the figures of a report, and its new alarms, to the link."""
    m = dialect()
    boot = int(report.time * 1000.0) & 0xFFFFFFFF
    figures: dict[bytes, float | None] = {b"loop_s": report.loop_s, b"short_s": report.short_s}
    if report.classes:
        figures |= {
            b"tether": report.classes[0].taut,
            b"slack": report.classes[0].slack,
            b"home_s": report.home_s,
            b"classes": float(len(report.classes)),
        }
    for name, value in figures.items():
        # graphs need a number even if nothing lies ahead
        link.send(m.MAVLink_named_value_float_message(boot, name, -1.0 if value is None else value))
    severities = {
        Level.NOTICE: m.MAV_SEVERITY_NOTICE,
        Level.CAUTION: m.MAV_SEVERITY_WARNING,
        Level.WARNING: m.MAV_SEVERITY_CRITICAL,
        Level.ALARM: m.MAV_SEVERITY_ALERT,
    }
    for alarm in report.raised:
        for part in status_texts(severities[alarm.level], alarm.text, next(text_numbers)):
            link.send(part)
