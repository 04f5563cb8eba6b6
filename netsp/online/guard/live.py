"""A guard beside a vehicle: messages in, reports out, ten times a second, until it is ended."""

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
from netsp.online.guard.plane import PlaneSite
from netsp.online.guard.space_site import SpaceSite
from netsp.online.guard.state_file import restore, save
from netsp.online.guard.stream import SILENT_S, Stream
from netsp.online.guard.telemetry import Fix
from netsp.online.guard.tether_guard import Guard
from netsp.online.link.address import Address
from netsp.online.link.dialect import dialect
from netsp.online.link.geo_frame import Frame
from netsp.online.link.mavlink_messages import AUTOPILOT, NO_GPS_FIX, POSITIONS, Listener
from netsp.online.link.statustext import status_texts
from netsp.online.link.udp import UdpLink
from netsp.online.link.vehicle_kind import other_vehicle

SAVE_S = 1.0
"""Seconds between two times that the class is written down."""

BEAT_S = 1.0
"""Seconds between two heartbeats to a vehicle that waits to be spoken to."""

PUBLISH_S = 1.0
"""Seconds between two times that figures are sent."""

SYSTEM = 245
"""Our system id where we only listen: 255 is the ground station's."""


def watch(
    guard: Guard, frame: Frame, address: str, take: Callable[[Report], None], *,
    system: int | None = None, state: str | None = None, publish: bool = False,
    corrections: queue.Queue[tuple[str, str]] | None = None,
    say: Callable[[str], None] | None = None, until: Callable[[], bool] | None = None,
    ask_rates: bool = False,
) -> None:  # fmt: skip
    """Watch a vehicle.

    Parameters
    ----------
    guard : Guard
        A new one.
    frame : Frame
        Of the site.
    address : str
        Of the link.
    take : callable
        Called with every report.
    system : int, optional
        System id of the vehicle.
    state : str, optional
        File that the class is kept in.
    publish : bool
        Whether figures and alarms are sent to the link.
    corrections : Queue of (side, obstacle), optional
        What the operator says.
    say : callable, optional
        Called with a line of text now and then.
    until : callable, optional
        Asked whether to end.
    ask_rates : bool
        True to ask the vehicle for the rates that the guard needs; it is asked for nothing else.

    Raises
    ------
    InputError
        The link cannot be had, or the state file is not of this site.
    """
    tell = say or (lambda _: None)
    where = Address.parse(address)
    if state is not None:
        restore(guard, state)  # what is wrong with it is told before anything takes long
    if not isinstance(guard.site, SpaceSite):
        rehearse(in_space=False)
    if not isinstance(guard.site, PlaneSite):
        rehearse(in_space=True)
    if state is not None:
        known = restore(guard, state)
        if known is not None:
            tell(f"going on from {state}, {known.age:.0f} s old")
    link = UdpLink(where, SYSTEM)
    only = None if where.listens else link.peer
    beat = dialect().MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)  # a computer on board
    beaten = float("-inf")
    listener, stream = Listener(frame, system), Stream(guard, on_note=tell)
    heard = saved = sent = told = time.monotonic()
    others: set[int] = set()
    hints, rates = _Hints(), MessageRates(frame, ask_rates, sender=SYSTEM)
    numbers = itertools.count()
    try:
        tell(f"listening on {address}")
        while until is None or not until():
            messages = link.hear(0.05)
            now = time.monotonic()
            if only is not None and now - beaten >= BEAT_S:
                beaten = now  # who waits to be spoken to answers nobody else
                link.send(beat)
            for message, peer in messages:
                if only is not None and peer != only:
                    continue
                fix = listener.understand(message)
                for line in hints.about(message, fix, listener):
                    tell(line)
                if (message.get_srcSystem(), message.get_srcComponent()) != (
                    listener.system, AUTOPILOT
                ):  # fmt: skip
                    continue
                clock = now if listener.time is None else listener.time
                for line in _rate_lines(rates, message, fix, clock):
                    tell(line)
                link.answer(peer)
                for request in rates.requests(message.get_srcSystem(), clock):
                    link.send(request)
                if fix is None:
                    continue
                heard = now
                report = stream.take(fix)
                if report is not None:
                    told = now
                    take(report)
                    if publish and (report.raised or now - sent >= PUBLISH_S):
                        sent = now
                        _publish(link, report, numbers)
            if now - heard >= SILENT_S and now - told >= SILENT_S and listener.time is not None:
                told = now
                report = stream.wait(listener.time + now - heard)
                take(report)
                if publish and report.raised:
                    _publish(link, report, numbers)
            if not listener.heard and listener.others - others:
                others |= listener.others
                who = ", ".join(map(str, sorted(others)))
                tell(f"heard from system {who}, but nothing from system {listener.system} yet")
            if corrections is not None:
                _correct(guard, corrections, tell)
            if state is not None and now - saved >= SAVE_S:
                saved = now
                save(guard, state)
    finally:
        link.close()
        if state is not None:
            save(guard, state)


def _rate_lines(rates: MessageRates, message: Any, fix: Fix | None, clock: float) -> Iterator[str]:
    """Yield lines about the rates of a vehicle's messages, after one of them."""
    if message.get_type() == "COMMAND_ACK":
        target = int(getattr(message, "target_system", 0))  # which MAVLink 1 does not have
        yield from rates.take_ack(int(message.command), int(message.result), target)
    yield from rates.take(clock, fix is not None and fix.position is not None)


class _Hints:
    """Hints at helpful options while no position is understood, and a warning about unknown kinds
    of vehicles; each is given once."""

    def __init__(self) -> None:
        self._has_position = False
        self._is_kind_told = False
        self._told: set[str] = set()

    def about(self, message: Any, fix: Fix | None, listener: Listener) -> Iterator[str]:
        """Yield the hint for a position message that is not understood, and the warning of a
        vehicle that is no submarine of ArduPilot's."""
        kind = listener.kind
        if kind is not None and not self._is_kind_told:
            self._is_kind_told = True
            if not kind.is_ardusub:
                yield other_vehicle(kind)
        self._has_position = self._has_position or (fix is not None and fix.position is not None)
        if self._has_position or fix is not None or message.get_type() not in POSITIONS:
            return
        line = ""
        if message.get_srcSystem() != listener.system:
            if message.get_srcComponent() == AUTOPILOT and listener.heard:
                line = (
                    f"system {message.get_srcSystem()} sends positions, system {listener.system} "
                    f"none yet; follow the other one with --system {message.get_srcSystem()}"
                )
        elif listener.left_out == NO_GPS_FIX:
            line = f"GLOBAL_POSITION_INT: {NO_GPS_FIX}; read metres with --frame local"
        if line and line not in self._told:
            self._told.add(line)
            yield line


def _correct(
    guard: Guard, corrections: queue.Queue[tuple[str, str]], tell: Callable[[str], None]
) -> None:
    while True:
        try:
            side, obstacle = corrections.get_nowait()
        except queue.Empty:
            return
        try:
            guard.correct(side, obstacle)
            tell(f"corrected: the tether passes {side} of {obstacle}")
        except InputError as error:
            tell(f"not corrected: {error}")


def _publish(link: UdpLink, report: Report, numbers: Iterator[int]) -> None:
    m = dialect()
    boot = int(report.time * 1000.0) & 0xFFFFFFFF
    figures: dict[bytes, float | None] = {b"loop_s": report.loop_s, b"short_s": report.short_s}
    if report.classes:
        figures |= {
            b"tether": report.classes[0].taut, b"slack": report.classes[0].slack,
            b"home_s": report.home_s, b"classes": float(len(report.classes)),
        }  # fmt: skip
    for name, value in figures.items():
        # no seconds are left where nothing lies ahead: a number all the same, for graphs
        link.send(m.MAVLink_named_value_float_message(boot, name, -1.0 if value is None else value))
    for alarm in report.raised:
        severity = {
            Level.NOTICE: m.MAV_SEVERITY_NOTICE, Level.CAUTION: m.MAV_SEVERITY_WARNING,
            Level.WARNING: m.MAV_SEVERITY_CRITICAL, Level.ALARM: m.MAV_SEVERITY_ALERT,
        }[alarm.level]  # fmt: skip
        for part in status_texts(severity, alarm.text, next(numbers)):
            link.send(part)
