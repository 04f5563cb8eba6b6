"""Meshes, multilines and faces of drawings as entities that GDAL reads (Autodesk's reference)."""

from __future__ import annotations

import numpy as np

from netsp.exchange.maps.dxf_tags import POLYFACE_FACE, Record

FLAG_POLYGON_MESH = 16
"""Code: flag (70) of a POLYLINE that is a mesh of rows and columns."""

FLAG_POLYFACE = 64
"""Code: flag (70) of a POLYLINE that is a mesh of faces."""

WITHOUT_WIDTH = 8 | FLAG_POLYGON_MESH | FLAG_POLYFACE
"""Code: flags (70) of polylines in space and of meshes, which have no width."""

CLOSED_MULTILINE = 2
"""Code: flag (71) of an MLINE whose last vertex is joined to its first."""


def simple_entities(record: Record) -> list[Record]:
    """Return a mesh or a multiline as faces or lines that GDAL reads; other entities unchanged.

    Parameters
    ----------
    record : Record
        An entity without damage (`Record.damage`).

    Raises
    ------
    ShapeDamageError
        Its numbers do not fit together.
    """
    if record.type == "MESH":
        return [_of_mesh(record)]
    if record.type == "MLINE":
        return _of_multiline(record)
    if record.type == "POLYLINE" and int(record.number(70)) & FLAG_POLYGON_MESH:
        return [_of_grid(record)]
    if record.type in ("SOLID", "TRACE", "3DFACE") and not record.get(13):
        third = ((code + 1, record.get(code, "0")) for code in (12, 22, 32))
        return [
            Record(record.type, [*record.tags, *third])
        ]  # GDAL takes the origin for a missing corner
    return [record]


def _of_multiline(record: Record) -> list[Record]:
    """Return the walls of an MLINE: a face between its outermost lines for each segment.

    Each vertex (11, 21, 31) has the direction of its mitre (13, 23, 33) and, for each line, a
    distance along it (the first 41 after each 74).
    """
    places: dict[int, list[float]] = {code: [] for code in (11, 21, 31, 13, 23, 33)}
    sides: list[list[float]] = []
    is_first = False
    for code, value in record.tags:
        if code == 11:
            sides.append([])
        if code in places:
            places[code].append(float(value))
        elif code == 41 and is_first and sides:
            sides[-1].append(float(value))
        is_first = code == 74
    count = int(record.number(72))
    if not count and not sides:
        return []
    if count < 2 or any(len(v) != count for v in places.values()) or not all(sides):
        raise ShapeDamageError(
            f"expected {count} vertices, each with its mitre and distances of lines"
        )
    corner = np.array([places[11], places[21], places[31]]).T
    mitre = np.array([places[13], places[23], places[33]]).T
    low, high = (corner + mitre * np.array([[pick(side)] for side in sides]) for pick in (min, max))
    ends = [*range(1, count), *([0] if int(record.number(71)) & CLOSED_MULTILINE else [])]
    shared = [(c, v) for c, v in record.tags if c in (5, 8, 60, 67)]
    out = []
    for k, after in enumerate(ends):
        is_line = np.allclose(low[[k, after]], high[[k, after]])
        around = [low[k], low[after]] if is_line else [low[k], low[after], high[after], high[k]]
        tags = [
            (code + k, repr(float(v)))
            for k, place in enumerate(around)
            for code, v in zip((10, 20, 30), place, strict=True)
        ]
        out.append(Record("LINE" if is_line else "3DFACE", [*shared, *tags]))
    return out


def shape_damage(record: Record) -> str:
    """Return what is wrong with a mesh or a multiline; empty if nothing is.

    Parameters
    ----------
    record : Record
        An entity without damage (`Record.damage`).
    """
    try:
        simple_entities(record)
    except ShapeDamageError as error:
        return str(error)
    if record.type != "POLYLINE" or not int(record.number(70)) & FLAG_POLYFACE:
        return ""
    flags = [int(f.number(70)) for f in record.followers if f.type == "VERTEX"]
    corners = sum(bool(flag & 64) for flag in flags)
    for follower in record.followers:
        if follower.type == "VERTEX" and int(follower.number(70)) & 192 == POLYFACE_FACE:
            used = [abs(int(follower.number(code))) for code in range(71, 75)]
            if max(used) > corners:
                return f"a face of corner {max(used)}; expected at most {corners}"
    return ""


class ShapeDamageError(Exception):
    """Mesh or multiline whose numbers do not fit together; the text is the reason."""


def _of_mesh(record: Record) -> Record:
    """Return a MESH, with its corners (10, 20, 30) and faces (90, of 93) before subdivision."""
    corners = list(
        zip(
            *([float(v) for c, v in record.tags if c == axis] for axis in (10, 20, 30)),
            strict=False,
        )
    )
    if len(corners) != int(record.number(92)):
        raise ShapeDamageError(f"expected {int(record.number(92))} corners, got {len(corners)}")
    start = next((k for k, (code, _) in enumerate(record.tags) if code == 93), len(record.tags))
    count = int(record.number(93))
    items = [int(float(v)) for c, v in record.tags[start + 1 : start + 1 + count] if c == 90]
    faces: list[list[int]] = []
    position = 0
    while position < len(items):
        faces.append(items[position + 1 : position + 1 + items[position]])
        position += 1 + max(items[position], 0)
    if position != count or len(items) != count:
        raise ShapeDamageError(
            f"expected a list of {count} numbers for its faces, got {len(items)}"
        )
    return _polyface(record, corners, faces)


def _of_grid(record: Record) -> Record:
    """Return a polygon mesh of rows and columns (flag 16)."""
    flags = int(record.number(70))
    rows, columns = int(record.number(71)), int(record.number(72))
    corners = [
        (f.number(10), f.number(20), f.number(30))
        for f in record.followers
        if f.type == "VERTEX" and not int(f.number(70)) & 16  # the frame of a smooth surface
    ]
    if flags & 4:  # smoothed: the density of the surface
        rows, columns = int(record.number(73)) or rows, int(record.number(74)) or columns
    if rows * columns != len(corners):
        raise ShapeDamageError(f"expected {rows} x {columns} corners, got {len(corners)}")
    faces = []
    for i in range(rows if flags & 1 else rows - 1):
        for j in range(columns if flags & 32 else columns - 1):
            a, b = i * columns + j, i * columns + (j + 1) % columns
            c, d = (i + 1) % rows * columns + (j + 1) % columns, (i + 1) % rows * columns + j
            faces.append([a, b, c, d])
    return _polyface(record, corners, faces)


def _polyface(
    record: Record, corners: list[tuple[float, float, float]], faces: list[list[int]]
) -> Record:
    """Return a polyface mesh; faces of many corners become triangles."""
    shared = [(c, v) for c, v in record.tags if c in (5, 8, 60, 67)]
    layer = (8, record.get(8, "0"))
    head = Record(
        "POLYLINE",
        [
            *shared,
            (66, "1"),
            (70, str(FLAG_POLYFACE)),
            (71, str(len(corners))),
            (72, str(len(faces))),
        ],
    )
    for x, y, z in corners:
        head.followers.append(
            Record("VERTEX", [layer, (10, repr(x)), (20, repr(y)), (30, repr(z)), (70, "192")])
        )
    for face in faces:
        if not all(0 <= i < len(corners) for i in face):
            raise ShapeDamageError(
                f"a face of corner {max(face)}; expected 0 to {len(corners) - 1}"
            )
        fans = (
            [face]
            if len(face) <= 4
            else [[face[0], *face[k : k + 2]] for k in range(1, len(face) - 1)]
        )
        for fan in fans:
            numbers = [(71 + k, str(i + 1)) for k, i in enumerate(fan)]
            head.followers.append(
                Record("VERTEX", [layer, (10, "0"), (20, "0"), (30, "0"), (70, "128"), *numbers])
            )
    head.followers.append(Record("SEQEND", [layer]))
    return head
