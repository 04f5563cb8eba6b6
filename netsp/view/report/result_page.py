"""Page about what a command has written: a tour or a run, in the plane or in space."""

from __future__ import annotations

from pathlib import Path

from netsp.base.errors import InputError
from netsp.base.files import write_text
from netsp.view.report import mission_page, tour_page
from netsp.view.report.opened import Opened, OpenedMission


def write_result_page(source: str | Path, what: Opened | OpenedMission, output: str | Path) -> None:
    """Write the page about a solution, a planned mission or a run.

    `source` is its name in messages.

    Raises
    ------
    InputError
        A file of a run is damaged; a mission without a tour that was not flown either.
    """
    try:
        text = mission_page.page(what) if isinstance(what, OpenedMission) else tour_page.page(what)
    except (KeyError, IndexError, ValueError, TypeError, OverflowError) as error:
        raise InputError(
            f"{source}: a file of the run is damaged: {type(error).__name__}: {error}"
        ) from None
    write_text(output, text)
