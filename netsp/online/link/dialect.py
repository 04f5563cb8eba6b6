"""MAVLink's messages by pymavlink, loaded when they are needed."""

from __future__ import annotations

from typing import Any

from netsp.base.errors import InputError

GROUND_STATION = 255
"""Code MAVLink system id of a ground station; ours in a flight."""

ONBOARD_COMPUTER = 191
"""Code MAV_COMP_ID_ONBOARD_COMPUTER of a computer beside the vehicle."""


def dialect() -> Any:
    """Return the generated module of ArduPilot's messages, version 2.

    Raises
    ------
    InputError
        pymavlink is not installed.
    """
    try:
        from pymavlink.dialects.v20 import ardupilotmega
    except ImportError:
        raise InputError(
            "--link: needs pymavlink; install it with: pip install 'netsp[mavlink]'"
        ) from None
    return ardupilotmega


def parser(system: int = GROUND_STATION, component: int = ONBOARD_COMPUTER) -> Any:
    """Return a packer and parser with our system and component id.

    Malformed messages are parsed as BAD_DATA.
    """
    mavlink = dialect().MAVLink(None, srcSystem=system, srcComponent=component)
    mavlink.robust_parsing = True
    return mavlink
