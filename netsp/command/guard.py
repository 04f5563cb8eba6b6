"""`netsp guard`: watch a tether while somebody else drives."""

from __future__ import annotations

import argparse
import json
import sys
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any, TextIO

from netsp.base.deprecated import deprecated_method
from netsp.base.errors import EXIT_NOT_ALL, EXIT_NOT_VERIFIED, InputError
from netsp.command import messages

if TYPE_CHECKING:
    from netsp.online.guard.guard_report import Report
    from netsp.online.guard.site import Site
    from netsp.online.guard.telemetry import Fix


def run(args: argparse.Namespace) -> int:
    """Watch until the recording or the operator ends it, and return the exit code."""
    if (args.link is None) == (args.replay is None):
        raise InputError("--link, --replay: expected one of them")
    if args.replay is not None and (args.publish or args.state or args.ask_rates):
        raise InputError("--publish, --state, --ask-rates: need a link; --replay has none")
    from netsp.base.files import is_mission_file
    from netsp.model.problem import Problem
    from netsp.online.guard.tether_guard import Guard, GuardOptions
    from netsp.online.link.geo_frame import Frame
    from netsp.world.mission.mission import Mission

    model = Mission if is_mission_file(args.site) else Problem
    guarded_site = model.load(args.site)
    options = GuardOptions(args.noise, args.drift, args.speed)
    frame = Frame(guarded_site, args.frame)
    fixes: list[Fix] = []
    if args.replay is not None:
        from netsp.online.guard.replay import read_fixes

        # read the whole recording before writing anything: its last line may be invalid
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

        def on_report(report: Report) -> None:
            counts.add(report)
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
                    on_report(report)
            else:
                from netsp.online.guard.live import watch

                watch(
                    guard,
                    frame,
                    args.link,
                    on_report,
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
    """Counts and extremes of the reports so far."""

    def __init__(self, site: Site, quiet: bool) -> None:
        self.site, self.quiet = site, quiet
        self.last: Report | None = None
        self._count = self._n_in_doubt = 0
        self._longest, self._longest_at_s = 0.0, 0.0
        self._alarms: list[dict[str, Any]] = []
        self._is_shown = not quiet and sys.stderr.isatty()

    def say(self, text: str) -> None:
        """Print a line."""
        if not self.quiet:
            print(f"{self._clear()}{text}", file=sys.stderr, flush=True)

    def _clear(self) -> str:
        return "\r\033[K" if self._is_shown else ""

    take = deprecated_method("take", "add")

    def add(self, report: Report) -> None:
        """Add a report."""
        self._count += 1
        for alarm in report.raised:
            self._alarms.append(
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
            self._n_in_doubt += len(report.classes) > 1
            now = report.classes[0]
            if now.taut > self._longest:
                self._longest, self._longest_at_s = now.taut, report.time
            if self._is_shown and self._count % 5 == 0:
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
        """Reason why nothing was claimed, from the last alarm about the position estimate."""
        estimates = [a["text"] for a in self._alarms if a["kind"] == "estimate"]
        if not estimates:
            return "no position was heard"
        return str(estimates[-1]).partition(",")[0].partition(":")[0]

    def summary(self) -> dict[str, Any]:
        """Return the counts and extremes for programs."""
        last = self.last
        return {
            "site": self.site.name,
            "reports": self._count,
            "in_doubt": self._n_in_doubt,
            "longest_tether": round(self._longest, 4),
            "longest_at_s": round(self._longest_at_s, 2),
            "tether_length": self.site.tether_length,
            "alarms": self._alarms,
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
