"""Page about what a command has written: a tour or a run, in the plane or in space."""

from __future__ import annotations

from pathlib import Path

from netsp.base.errors import InputError
from netsp.base.files import write_text
from netsp.view.report import mission_page, tour_page
from netsp.view.report.opened import Opened, OpenedMission, reading_run


def write_result_page(source: str | Path, what: Opened | OpenedMission, output: str | Path) -> None:
    """Write the page about a solution, a planned mission or a run.

    `source` is its name in messages.

    Raises
    ------
    InputError
        A file of a run is damaged; a mission without a tour that was not flown either.
    """
    if isinstance(what, OpenedMission) and what.run is None and what.mission.tour is None:
        raise InputError(
            f"{source}: tour: the mission has none; expected one that `netsp solve` has planned, "
            "or the folder of a run"
        )
    with reading_run(source):
        text = mission_page.page(what) if isinstance(what, OpenedMission) else tour_page.page(what)
    write_text(output, text)
