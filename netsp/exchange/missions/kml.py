"""Tours as KML 2.2 (OGC 07-147r2) for Google Earth and other globes.

Elements stand in the order of the KML schema. Altitudes are absolute, so that globes draw what is
below the water there. A member `kind` in the data of each placemark lets `netsp import` read the
file back.
"""

from __future__ import annotations

import io
import math
import zipfile
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import escape, quoteattr

from netsp.base.errors import InputError
from netsp.exchange.missions.export_policy import DEFAULT_EXPORT, ExportPolicy
from netsp.model.problem import Circle, Problem
from netsp.plan.tour_plan import HOME

if TYPE_CHECKING:
    from netsp.base.arrays import Floats
    from netsp.exchange.maps.projection import Projection
    from netsp.exchange.missions.waypoints import Waypoint

STYLES = {
    "base": "<IconStyle><scale>1.2</scale><Icon><href>"
    "http://maps.google.com/mapfiles/kml/shapes/sailing.png</href></Icon></IconStyle>",
    "goal": "<IconStyle><scale>0.8</scale><Icon><href>"
    "http://maps.google.com/mapfiles/kml/shapes/placemark_circle.png</href></Icon></IconStyle>",
    "obstacle": "<LineStyle><color>ff404040</color><width>1</width></LineStyle>"
    "<PolyStyle><color>a0808080</color></PolyStyle>",
    "path": "<LineStyle><color>ff0080ff</color><width>3</width></LineStyle>",
    "tether": "<LineStyle><color>ff00c0c0</color><width>2</width></LineStyle>",
}
"""Style of each kind of placemark; colours are alpha, blue, green, red."""


def kml_of(
    problem: Problem,
    points: Sequence[Waypoint],
    projection: Projection,
    policy: ExportPolicy = DEFAULT_EXPORT,
) -> str:
    """Return a tour as a KML document.

    It has folders for the base, goals, obstacles, the path and, switched off, the taut tether at
    every visit.

    Parameters
    ----------
    points : sequence of Waypoint
        Waypoints, the start first.
    """
    page = _Page(projection)
    base = page.placemark(
        "base",
        page.point(problem.base),
        name="base",
        data={
            "tether_length": problem.tether_length,
            "clearance": problem.clearance,
            "heading": projection.heading or None,
        },
    )
    obstacles = [
        page.placemark("obstacle", page.polygon(_outline(o, policy.circle_corners)), name=o.name)
        for o in problem.obstacles
    ]
    path = page.placemark("path", page.line([p.position for p in points]), name="tour")
    folders = [
        page.folder("base", [base]),
        page.folder("goals", _goal_placemarks(page, problem, points)),
        page.folder("obstacles", obstacles),
        page.folder("path", [path]),
        _tether_folder(page, problem, points),
    ]
    styles = "".join(f'<Style id="{kind}">{style}</Style>\n' for kind, style in STYLES.items())
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<kml xmlns="http://www.opengis.net/kml/2.2">\n'
        f"<Document><name>{_text(problem.name or 'tour')}</name>\n{styles}{''.join(folders)}"
        "</Document>\n</kml>\n"
    )


def _goal_placemarks(page: _Page, problem: Problem, points: Sequence[Waypoint]) -> list[str]:
    visits = {p.goal: (n, p) for n, p in enumerate((q for q in points if _is_visit(q)), 1)}
    placemarks = []
    for k, goal in enumerate(problem.goals):
        description = f"depth {-goal.position[2]:g} {problem.units}"
        data: dict[str, Any] = {}
        if k in visits:
            number, visited = visits[k]
            description = (
                f"stop {number}, {description}, taut tether {visited.tether:.2f} {problem.units}"
            )
            data = {"visit": number, "taut_tether": round(visited.tether, 4)}
        shape = page.point(goal.position)
        placemarks.append(
            page.placemark("goal", shape, name=goal.name, description=description, data=data)
        )
    return placemarks


def _tether_folder(page: _Page, problem: Problem, points: Sequence[Waypoint]) -> str:
    """Return a folder with the tether at each visit; an empty text without visits."""
    drawn = list(_tethers(problem, points))
    if not drawn:
        return ""
    tethers = [
        page.placemark(
            "tether",
            page.line(line.tolist()),
            is_hidden=True,
            name=f"tether at stop {number}: {problem.goal_name(goal)}",
        )
        for number, goal, line in drawn
        if line is not None
    ]
    missing = [problem.goal_name(goal) for _, goal, line in drawn if line is None]
    description = f"no taut tether was found at {', '.join(missing)}" if missing else ""
    return page.folder("tethers", tethers, is_hidden=True, description=description)


def kmz_of(page: str) -> bytes:
    """Return an archive (KMZ) with a KML page as ``doc.kml``; equal pages give equal archives."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        entry = zipfile.ZipInfo("doc.kml")  # with a fixed date, 1980
        entry.compress_type = zipfile.ZIP_DEFLATED
        archive.writestr(entry, page.encode())
    return buffer.getvalue()


def _is_visit(point: Waypoint) -> bool:
    return point.goal is not None and point.goal != HOME


def _text(text: object) -> str:
    return escape(str(text))


def _outline(obstacle: Any, n_corners: int) -> list[tuple[float, float]]:
    if not isinstance(obstacle, Circle):
        return [(float(x), float(y)) for x, y in obstacle.polygon]
    (x, y), r = obstacle.center, obstacle.radius
    turns = (2.0 * math.pi * k / n_corners for k in range(n_corners))
    return [(x + r * math.cos(a), y + r * math.sin(a)) for a in turns]


def _tethers(
    problem: Problem, points: Sequence[Waypoint]
) -> Iterable[tuple[int, int, Floats | None]]:
    """Yield number, goal and taut tether of each visit; nothing if the words belong to a scene."""
    from netsp.roadmap.paths import TautPaths

    visits = [p for p in points if _is_visit(p)]
    n_solids = len(problem.obstacles)
    if any(abs(letter) > n_solids for p in visits for letter in p.word):
        return  # a mission in space: its words are those of the scene
    paths = TautPaths(problem)
    for number, visited in enumerate(visits, 1):
        assert visited.goal is not None
        try:
            line: Floats | None = paths.tether(visited.goal, visited.word)
        except InputError:
            line = None
        yield number, visited.goal, line


class _Page:
    """Elements of a KML document."""

    def __init__(self, projection: Projection) -> None:
        self.projection = projection

    def _coordinates(self, places: Sequence[Sequence[float]]) -> str:
        latlon = self.projection.to_earth([p[:2] for p in places])
        heights = [p[2] if len(p) > 2 else 0.0 for p in places]
        return " ".join(
            f"{lon:.9f},{lat:.9f},{z:.3f}"
            for (lat, lon), z in zip(latlon.tolist(), heights, strict=True)
        )

    def point(self, place: Sequence[float]) -> str:
        return (
            "<Point><altitudeMode>absolute</altitudeMode>"
            f"<coordinates>{self._coordinates([place])}</coordinates></Point>"
        )

    def line(self, places: Sequence[Sequence[float]]) -> str:
        return (
            "<LineString><altitudeMode>absolute</altitudeMode>"
            f"<coordinates>{self._coordinates(places)}</coordinates></LineString>"
        )

    def polygon(self, outline: Sequence[Sequence[float]]) -> str:
        ring = [*outline, outline[0]]
        return (
            "<Polygon><altitudeMode>absolute</altitudeMode><outerBoundaryIs><LinearRing>"
            f"<coordinates>{self._coordinates(ring)}</coordinates>"
            "</LinearRing></outerBoundaryIs></Polygon>"
        )

    def placemark(
        self,
        style: str,
        shape: str,
        *,
        name: str | None = None,
        description: str = "",
        data: dict[str, Any] | None = None,
        is_hidden: bool = False,
    ) -> str:
        kind = "path" if style == "tether" else style
        values = {"kind": kind, **{k: v for k, v in (data or {}).items() if v is not None}}
        fields = "".join(
            f"<Data name={quoteattr(k)}><value>{_text(v)}</value></Data>" for k, v in values.items()
        )
        return (
            "<Placemark>"
            + ("" if name is None else f"<name>{_text(name)}</name>")
            + ("<visibility>0</visibility>" if is_hidden else "")
            + (f"<description>{_text(description)}</description>" if description else "")
            + f"<styleUrl>#{style}</styleUrl><ExtendedData>{fields}</ExtendedData>{shape}"
            "</Placemark>\n"
        )

    def folder(
        self,
        name: str,
        placemarks: Sequence[str],
        *,
        is_hidden: bool = False,
        description: str = "",
    ) -> str:
        extras = "<visibility>0</visibility>" if is_hidden else ""
        extras += f"<description>{_text(description)}</description>" if description else ""
        return f"<Folder><name>{name}</name>{extras}\n{''.join(placemarks)}</Folder>\n"
