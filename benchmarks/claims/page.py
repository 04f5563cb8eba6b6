"""Claims about the map in the browser."""

from __future__ import annotations

import shutil
from collections.abc import Iterator

from claims.claim import Claim

ABSENT = "not measured: chromium or Playwright is not installed"


def kept() -> tuple[str, bool]:
    """Versions after random edits and kills of the server, beside the library's."""
    import app

    lost = app.edits(150, 2)
    return f"{lost} of 3 others than the library's", lost == 0


def drawn() -> tuple[str, bool]:
    """Drags of goals of 20, from letting go to a tour of the new version on the map."""
    import numpy as np

    if not (shutil.which("chromium") or shutil.which("chromium-browser")):
        return ABSENT, True
    try:
        import playwright  # noqa: F401
    except ImportError:
        return ABSENT, True
    import app

    _, took, moved = app.dragged(app.cases()[1][1], 40)
    tour, tether = (1e3 * float(np.percentile(v, 95)) for v in (took, moved))
    return f"{tour:.0f} ms, tether at the cursor {tether:.0f} ms", tour <= 500.0 and tether <= 100.0


def small() -> tuple[str, bool]:
    """The page of the flown basin mission, of 97 waypoints."""
    import tempfile
    from pathlib import Path

    from sites import shipped

    from netsp.view.pictures.film import film_of_flight
    from netsp.view.pictures.film_page import save_page
    from netsp.view.pictures.picture_layout import PageLayout
    from netsp.world.simulator.mission_run import simulate

    mission, scene = shipped("basin")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "run.html"
        film = film_of_flight(simulate(mission, scene=scene), scene, PageLayout.frames)
        save_page([film], mission.name, file)
        size = file.stat().st_size / 1e6
    return f"{size:.2f} MB for {len(mission.waypoints)} waypoints", size <= 3.0


def smooth() -> tuple[str, bool]:
    """Frames while a crowded map is dragged about."""
    import numpy as np

    if not (shutil.which("chromium") or shutil.which("chromium-browser")):
        return ABSENT, True
    try:
        import playwright  # noqa: F401
    except ImportError:
        return ABSENT, True
    import app

    times = app.panned()
    middle, slow = np.percentile(times, (50, 95))
    return f"{middle:.1f} ms, p95 {slow:.1f} ms", middle <= 17.0


def claims() -> Iterator[Claim]:
    """All of this file."""
    yield Claim("a page of a flight of 97 waypoints", "3 MB", small)
    yield Claim("the map: 150 edits, the server killed twice", "nothing lost", kept)
    yield Claim(
        "the map: drags of 20 goals, p95", "a tour in 500 ms, a tether in 100", drawn, timed=True
    )
    yield Claim(
        "the map: frames of 100 obstacles, 200 goals", "60 a second (p50)", smooth, timed=True
    )
