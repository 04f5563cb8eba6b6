"""`netsp guard`: watch a tether while somebody else drives."""

from __future__ import annotations

import argparse
import json
import sys
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any, TextIO

from netsp.base.errors import EXIT_NOT_ALL, EXIT_NOT_VERIFIED, InputError
from netsp.command import messages
from netsp.command.types import check_writable, length, natural, system_id

if TYPE_CHECKING:
    from netsp.online.guard.guard_report import Report
    from netsp.online.guard.site import Site
    from netsp.online.guard.telemetry import Fix

EXAMPLE = "netsp guard problems/wharf.json --link udpin:14550 --page"

GUARD_PORT = 8650
"""Default port of the guard's page."""


def arguments(p: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    p.add_argument(
        "site",
        metavar="SITE",
        help="problem file or mission file (JSON); one of a planned mission also tells whether the "
        "tether is as planned",
    )
    source = p.add_argument_group("where it listens; the vehicle is never commanded to move")
    source.add_argument(
        "--link",
        metavar="ADDRESS",
        help="MAVLink over UDP: udpin:PORT (this machine only), udpin:HOST:PORT, udpout:HOST:PORT",
    )
    source.add_argument("--replay", metavar="LOG", help="a recording: .csv, .csv.gz, .tlog or .bin")
    source.add_argument(
        "--frame",
        metavar="NAME",
        help="local (metres north, east, down of the base) or global; default global where the "
        "site has an origin",
    )
    source.add_argument(
        "--system",
        type=system_id,
        metavar="N",
        help="the vehicle's system id; default: the first one heard; in a recording, the only one "
        "with positions",
    )
    vehicle = p.add_argument_group("what is known of the vehicle")
    vehicle.add_argument(
        "--noise",
        type=length,
        default=0.3,
        metavar="M",
        help="standard deviation of one position, m; default 0.3",
    )
    vehicle.add_argument(
        "--drift",
        type=length,
        default=0.5,
        metavar="M",
        help="standard deviation of how far positions are off for minutes, m; default 0.5",
    )
    vehicle.add_argument(
        "--speed", type=length, default=0.5, metavar="V", help="fastest speed, m/s; default 0.5"
    )
    p.add_argument(
        "--state", metavar="FILE", help="keep the class here, and go on from it when started again"
    )
    p.add_argument(
        "--publish",
        action="store_true",
        help="send tether, slack and alarms to the link (NAMED_VALUE_FLOAT, STATUSTEXT)",
    )
    p.add_argument(
        "--ask-rates",
        action="store_true",
        help="ask the vehicle to send its position ten times a second (SET_MESSAGE_INTERVAL)",
    )
    p.add_argument(
        "--page",
        nargs="?",
        type=natural,
        const=GUARD_PORT,
        metavar="PORT",
        help=f"serve a page on this machine; default port {GUARD_PORT}",
    )
    p.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        help="write every report as a line of JSON to this file; - is standard output",
    )
    p.add_argument("--quiet", action="store_true", help="no status line and no alarms in words")


def run(args: argparse.Namespace) -> int:
    """Watch until the recording or the operator ends it, and return the exit code."""
    if (args.link is None) == (args.replay is None):
        raise InputError("--link, --replay: expected one of them")
    if args.replay is not None and (args.publish or args.state or args.ask_rates):
        raise InputError("--publish, --state, --ask-rates: are for links; a recording is over")
    output = None if args.output == "-" else args.output
    check_writable(output, args.state, inputs=(args.site, args.replay))
    from netsp.base.files import is_mission_file
    from netsp.model.problem import Problem
    from netsp.online.guard.tether_guard import Guard, GuardOptions
    from netsp.online.link.geo_frame import Frame
    from netsp.world.mission.mission import Mission

    guarded_site = (
        Mission.load(args.site) if is_mission_file(args.site) else Problem.load(args.site)
    )
    options = GuardOptions(args.noise, args.drift, args.speed)
    frame = Frame(guarded_site, args.frame)
    fixes: list[Fix] = []
    if args.replay is not None:
        from netsp.online.guard.replay import read_fixes

        # all of it before anything is written: what is wrong may stand in its last line
        say = None if args.quiet else messages.note
        fixes = list(read_fixes(args.replay, frame, args.system, on_note=say))
    with ExitStack() as stack:
        guard = Guard(guarded_site, options)
        counts = ReportCounts(guard.site, args.quiet)
        lines: TextIO | None = None
        if args.output == "-":
            lines = sys.stdout
        elif args.output is not None:
            lines = stack.enter_context(open(args.output, "w", encoding="utf-8"))
        page = None
        if args.page is not None:
            from netsp.online.guard.guard_page import Page

            page = stack.enter_context(Page(guard.site, args.page))
            print(f"the page is {page.address}", file=sys.stderr)

        def take(report: Report) -> None:
            counts.take(report)
            row = report.as_row() if lines is not None or page is not None else None
            if lines is not None:
                lines.write(json.dumps(row, allow_nan=False) + "\n")
            if page is not None and row is not None:
                page.send(row)

        try:
            if args.replay is not None:
                from netsp.online.guard.stream import replay_fixes

                say = None if args.quiet else messages.note
                for report in replay_fixes(guard, fixes, say):
                    take(report)
            else:
                from netsp.online.guard.live import watch

                watch(
                    guard,
                    frame,
                    args.link,
                    take,
                    system=args.system,
                    state=args.state,
                    publish=args.publish,
                    corrections=None if page is None else page.corrections,
                    on_note=None if args.quiet else counts.say,
                    ask_rates=args.ask_rates,
                )
        except KeyboardInterrupt:
            counts.say("stopped")
    if args.output is None:
        print(json.dumps(counts.summary(), indent=1, allow_nan=False))
    if counts.last is None:
        messages.warning(f"nothing was claimed about the tether: {counts.reason}")
        return EXIT_NOT_ALL
    return EXIT_NOT_VERIFIED if counts.last.loops else 0


class ReportCounts:
    """Reports so far, and the numbers in them."""

    def __init__(self, site: Site, quiet: bool) -> None:
        self.site, self.quiet = site, quiet
        self.last: Report | None = None
        self._count = self._doubt = 0
        self._longest, self._at = 0.0, 0.0
        self._raised: list[dict[str, Any]] = []
        self._show = not quiet and sys.stderr.isatty()

    def say(self, text: str) -> None:
        """Print a line."""
        if not self.quiet:
            print(f"{self._clear()}{text}", file=sys.stderr, flush=True)

    def _clear(self) -> str:
        return "\r\033[K" if self._show else ""

    def take(self, report: Report) -> None:
        """Add a report."""
        self._count += 1
        for alarm in report.raised:
            self._raised.append(
                {
                    "t": round(report.time, 1),
                    "kind": alarm.kind,
                    "level": alarm.level.name.lower(),
                    "text": alarm.text,
                }
            )
            if not self.quiet and alarm.level > 1:
                print(
                    f"{self._clear()}{report.time:8.1f} s  {alarm.level.name:<7} {alarm.text}",
                    file=sys.stderr,
                    flush=True,
                )
        if report.classes:
            self.last = report
            self._doubt += len(report.classes) > 1
            now = report.classes[0]
            if now.taut > self._longest:
                self._longest, self._at = now.taut, report.time
            if self._show and self._count % 5 == 0:
                units = self.site.units
                print(
                    f"{self._clear()}{report.time:8.1f} s  tether {now.taut:.2f} of "
                    f"{self.site.tether_length:g} {units}, {now.passes}"[:110],
                    end="",
                    file=sys.stderr,
                    flush=True,
                )

    @property
    def reason(self) -> str:
        """Return why nothing was claimed, as in the last alarm."""
        estimates = [a["text"] for a in self._raised if a["kind"] == "estimate"]
        if not estimates:
            return "no position was heard"
        return str(estimates[-1]).partition(",")[0].partition(":")[0]

    def summary(self) -> dict[str, Any]:
        """Return the numbers."""
        last = self.last
        return {
            "site": self.site.name,
            "reports": self._count,
            "in_doubt": self._doubt,
            "longest_tether": round(self._longest, 4),
            "longest_at_s": round(self._at, 2),
            "tether_length": self.site.tether_length,
            "alarms": self._raised,
            "at_the_end": None
            if last is None
            else {
                "t": round(last.time, 2),
                "claims": last.claims,
                "word": list(last.classes[0].word),
                "passes": last.classes[0].passes,
                "taut": round(last.classes[0].taut, 4),
                "loops": [list(x) for x in last.loops],
            },
        }
