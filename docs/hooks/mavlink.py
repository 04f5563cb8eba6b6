"""Table of the MAVLink messages that netsp reads, asks for and sends, for the page about them.

The names come from the code, by a search through `netsp/online`; what each is for is written here.
A message without a description, or a description without a message, raises an error.
"""

from __future__ import annotations

import re
from pathlib import Path

ONLINE = Path(__file__).parents[2] / "netsp" / "online"

READERS = (
    "mavlink_messages.py", "position_aiding.py", "session.py", "target_echo.py", "live.py",
    "telemetry_log.py",
)  # fmt: skip
"""Modules that read messages by their names."""

READ = {
    "HEARTBEAT": "kind of the vehicle and of its autopilot, armed or not, mode; also of other "
    "ground stations, which end the wait after a flight",
    "LOCAL_POSITION_NED": "position and velocity in metres, where the site has no `origin`, or "
    "with `--frame local`",
    "GLOBAL_POSITION_INT": "position and velocity in degrees, where the site has an `origin`",
    "ATTITUDE": "heading",
    "EKF_STATUS_REPORT": "whether the vehicle vouches for its position; innovations: whether its "
    "filter rejects the fixes",
    "GPS_RAW_INT": "whether the GPS has a fix, and repeats itself",
    "SYS_STATUS": "whether GPS, DVL, optical flow or visual odometry are healthy",
    "WINCH_STATUS": "`guard`: length of tether that the winch has let out; it excludes longer "
    "classes",
    "GPS_GLOBAL_ORIGIN": "`fly`: where the vehicle's estimate began, to read echoes of targets",
    "POSITION_TARGET_LOCAL_NED": "`fly`: the target that the vehicle has accepted",
    "POSITION_TARGET_GLOBAL_INT": "`fly`: the target that the vehicle has accepted",
    "PARAM_VALUE": "`fly`: what the vehicle does without a ground station",
    "STATUSTEXT": "`fly`: what the vehicle says; printed",
    "COMMAND_ACK": "`guard --ask-rates`: whether the vehicle refuses other message rates",
}
"""Meanings of the messages that are read."""

SENT = {
    "HEARTBEAT": "two a second by `fly`, as a ground station; once a second by `guard` with a link "
    "of `udpout`, as an onboard computer",
    "SET_POSITION_TARGET_LOCAL_NED": "`fly`: the next vertex of the path, position only, where the "
    "problem has no `origin`",
    "SET_POSITION_TARGET_GLOBAL_INT": "`fly`: the same in degrees, where it has one",
    "COMMAND_LONG": "the commands of the next table",
    "PARAM_REQUEST_READ": "`fly`: asks for FS_GCS_ENABLE and FS_GCS_TIMEOUT",
    "STATUSTEXT": "alarms of `guard --publish`; why a flight of `fly` ended",
    "NAMED_VALUE_FLOAT": "`guard --publish`, once a second: `tether` and `slack` (m), `home_s`, "
    "`loop_s`, `short_s` (s; −1 if nothing is ahead) and `classes`",
}
"""Meanings of the messages that are sent."""

COMMANDS = {
    "MAV_CMD_SET_MESSAGE_INTERVAL": "`fly` and `guard --ask-rates`: asks for ten positions a "
    "second, and for fewer of the other messages",
    "MAV_CMD_REQUEST_MESSAGE": "`fly`: asks for GPS_GLOBAL_ORIGIN",
    "MAV_CMD_DO_SET_MODE": "`fly`: GUIDED at the start; ALT_HOLD without a position; POSHOLD or "
    "SURFACE at the end, if asked to",
}
"""Meanings of the commands that are sent."""


def code(names: tuple[str, ...] | None = None) -> str:
    """Return the code of some modules of `netsp/online`, or of all."""
    files = sorted(ONLINE.rglob("*.py"))
    return "\n".join(f.read_text(encoding="utf-8") for f in files if not names or f.name in names)


def messages_read() -> set[str]:
    """Return the messages whose names the reading modules compare with."""
    quoted = set(re.findall(r'"([A-Z][A-Z0-9]*(?:_[A-Z0-9]+)*)"', code(READERS)))
    from pymavlink.dialects.v20 import ardupilotmega as dialect

    known = {message.msgname for message in dialect.mavlink_map.values()}
    return quoted & known


def messages_sent() -> set[str]:
    """Return the messages that the code makes."""
    return {name.upper() for name in re.findall(r"MAVLink_(\w+)_message\b", code())}


def commands_sent() -> set[str]:
    """Return the commands that the code names."""
    return set(re.findall(r"\bm?\.?(MAV_CMD_\w+)", code()))


def table() -> list[str]:
    """Return Markdown: the messages read, the messages sent, and the commands.

    Raises
    ------
    ValueError
        A message is not described, or not in the code.
    """
    out = []
    for title, found, known in (
        ("Messages that netsp reads", messages_read(), READ),
        ("Messages that netsp sends", messages_sent(), SENT),
        ("Commands that netsp sends", commands_sent(), COMMANDS),
    ):
        if found != known.keys():
            raise ValueError(f"{title}: in the code or described, not both: {found ^ known.keys()}")
        out += [f"## {title}", "", "| name | used for |", "|---|---|"]
        out += [f"| {name} | {meaning} |" for name, meaning in known.items()] + [""]
    return out


if __name__ == "__main__":
    print("\n".join(table()))
