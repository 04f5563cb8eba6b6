"""pymavlink, when it is asked for."""

from __future__ import annotations

from typing import Any

from netsp.base.errors import InputError

GROUND_STATION, ONBOARD_COMPUTER = 255, 191
"""Our system id where we steer, and the component id of a computer beside the vehicle."""


def dialect() -> Any:
    """The generated module of ArduPilot's messages, version 2.

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
    """Packs and parses messages; what is malformed comes out as BAD_DATA.

    Parameters
    ----------
    system : int
        Our system id.
    component : int
        Our component id.

    Returns
    -------
    MAVLink
        Of pymavlink, with no file behind it.
    """
    made = dialect().MAVLink(None, srcSystem=system, srcComponent=component)
    made.robust_parsing = True
    return made
