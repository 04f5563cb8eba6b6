"""Writer of small S-57 cells (IHO S-57 in ISO/IEC 8211), for tests of the chart reader."""

import struct
from itertools import pairwise
from pathlib import Path

CLASSES = {
    "BCNLAT": 7, "DEPARE": 42, "DEPCNT": 43, "DRGARE": 46, "HULKES": 65, "LNDARE": 71, "OBSTRN": 86,
    "PILPNT": 90, "SLCONS": 122, "SOUNDG": 129, "UNSARE": 154, "UWTROC": 153, "WRECKS": 159,
    "M_COVR": 302, "M_SDAT": 309, "M_UNIT": 311,
}  # fmt: skip
"""Codes of object classes."""

ATTRIBUTES = {
    "CATCOV": 18, "DRVAL1": 87, "DRVAL2": 88, "DUNITS": 89, "HORLEN": 99, "HORWID": 100,
    "OBJNAM": 116, "VALDCO": 174, "VALSOU": 179, "VERDAT": 185,
}  # fmt: skip
"""Codes of attributes."""

FIELDS = {
    "0001": "0500;&   ISO/IEC 8211 Record Identifier||(b12)",
    "DSID": "1600;&   Data set identification field|RCNM!RCID!EXPP!INTU!DSNM!EDTN!UPDN!UADT!ISDT!"
            "STED!PRSP!PSDN!PRED!PROF!AGEN!COMT|(b11,b14,2b11,3A,2A(8),R(4),b11,2A,b11,b12,A)",
    "DSSI": "1600;&   Data set structure information field|DSTR!AALL!NALL!NOMR!NOCR!NOGR!NOLR!NOIN!"
            "NOCN!NOED!NOFA|(3b11,8b14)",
    "DSPM": "1600;&   Data set parameter field|RCNM!RCID!HDAT!VDAT!SDAT!CSCL!DUNI!HUNI!PUNI!COUN!"
            "COMF!SOMF!COMT|(b11,b14,3b11,b14,4b11,2b14,A)",
    "VRID": "1600;&   Vector record identifier field|RCNM!RCID!RVER!RUIN|(b11,b14,b12,b11)",
    "VRPT": "2600;&   Vector record pointer field|*NAME!ORNT!USAG!TOPI!MASK|(B(40),4b11)",
    "SG2D": "2500;&   2-D coordinate field|*YCOO!XCOO|(2b24)",
    "SG3D": "2500;&   3-D coordinate (sounding array) field|*YCOO!XCOO!VE3D|(3b24)",
    "FRID": "1600;&   Feature record identifier field|RCNM!RCID!PRIM!GRUP!OBJL!RVER!RUIN|"
            "(b11,b14,2b11,2b12,b11)",
    "FOID": "1600;&   Feature object identifier field|AGEN!FIDN!FIDS|(b12,b14,b12)",
    "ATTF": "2600;&-A Feature record attribute field|*ATTL!ATVL|(b12,A)",
    "FSPT": "2600;&   Feature record to spatial record pointer field|*NAME!ORNT!USAG!MASK|"
            "(B(40),3b11)",
}  # fmt: skip
"""Descriptions of the fields: controls and name, subfields, formats."""

PARENTS = ("0001DSID", "DSIDDSSI", "0001DSPM", "0001VRID", "VRIDVRPT", "VRIDSG2D", "VRIDSG3D",
           "0001FRID", "FRIDFOID", "FRIDATTF", "FRIDFSPT")  # fmt: skip
NODE, JOINT, EDGE = 110, 120, 130
END = b"\x1e"
UNIT_END = b"\x1f"


def write_cell(
    file, features, *, depth_unit=1, height_unit=1, sounding_factor=10, datum=12, update=0,
    edition="2", deleted=(), reissue=0,
):  # fmt: skip
    """Write a cell, or an update of one, of `(class, shape, attributes)` in degrees.

    A shape is a Shapely point, line string, polygon, or multipoint with depths (of class SOUNDG).
    Features and their spatial records are numbered from 1000 times `update`. A cell may hold the
    updates up to `reissue` already.
    """
    names = (Path(file).name, edition, str(update or reissue))
    body = [_record({
        "DSID": struct.pack("<BIBB", 10, 1, 2 if update else 1, 5)
        + b"".join(t.encode() + UNIT_END for t in names)
        + b"2026010120260101" + b"03.1" + struct.pack("<B", 1)
        + UNIT_END + b"2.0" + UNIT_END + struct.pack("<BH", 1, 550) + UNIT_END,
        "DSSI": struct.pack("<3B8I", 2, 1, 1, *(0,) * 8),
    })]  # fmt: skip
    if not update:
        body.append(_record({
            "DSPM": struct.pack("<BI3BI4B2I", 20, 1, 2, 16, datum, 12000, depth_unit, height_unit,
                                1, 1, 10_000_000, sounding_factor) + UNIT_END,
        }))  # fmt: skip
    vectors, objects, number = [], [], 1000 * update

    def vector(kind, **fields):
        nonlocal number
        number += 1
        vectors.append({"VRID": struct.pack("<BIHB", kind, number, 1, 1), **fields})
        return struct.pack("<BI", kind, number)

    def pairs(coords):
        return b"".join(struct.pack("<2i", round(y * 1e7), round(x * 1e7)) for x, y in coords)

    def edge(coords):
        ends = [vector(JOINT, SG2D=pairs([c])) for c in (coords[0], coords[-1])]
        hinges = b"".join(e + bytes((255, 255, k, 255)) for k, e in enumerate(ends, 1))
        inner = {"SG2D": pairs(coords[1:-1])} if len(coords) > 2 else {}
        return vector(EDGE, VRPT=hinges, **inner)

    for k, (layer, shape, attributes) in enumerate(features, 1000 * update + 1):
        if shape.geom_type == "MultiPoint":
            depths = b"".join(
                struct.pack("<3i", round(p.y * 1e7), round(p.x * 1e7), round(p.z * sounding_factor))
                for p in shape.geoms
            )
            primitive, places = 1, [vector(NODE, SG3D=depths) + bytes((255, 255, 255))]
        elif shape.geom_type == "Point":
            primitive, places = 1, [vector(NODE, SG2D=pairs(shape.coords)) + bytes((255, 255, 255))]
        elif shape.geom_type == "LineString":
            primitive, places = 2, [edge(list(shape.coords)) + bytes((1, 255, 255))]
        else:
            primitive, places = 3, []
            for usage, ring in [(1, shape.exterior), *((2, hole) for hole in shape.interiors)]:
                corners = list(ring.coords)
                half = len(corners) // 2
                for part in (corners[: half + 1], corners[half:]):
                    places.append(edge(part) + bytes((1, usage, 255)))
        objects.append({
            "FRID": struct.pack("<BIBBHHB", 100, k, primitive, 1, CLASSES[layer], 1, 1),
            "FOID": struct.pack("<HIH", 550, k, 1),
            "ATTF": b"".join(
                struct.pack("<H", ATTRIBUTES[name]) + str(value).encode() + UNIT_END
                for name, value in attributes.items()
            ),
            "FSPT": b"".join(places),
        })  # fmt: skip
    objects += [
        {"FRID": struct.pack("<BIBBHHB", 100, k, 255, 2, CLASSES[layer], 2, 2),
         "FOID": struct.pack("<HIH", 550, k, 1)}
        for layer, k in deleted
    ]  # fmt: skip
    body += [_record({t: v for t, v in fields.items() if v}) for fields in (*vectors, *objects)]
    Path(file).write_bytes(_description() + b"".join(body))
    return file


def _record(fields):
    return _framed(" D     ", "   ", {"0001": struct.pack("<H", 1), **fields})


def _description():
    texts = {"0000": "0000;&   |" + "".join(PARENTS), **FIELDS}
    fields = {tag: text.replace("|", UNIT_END.decode()).encode() for tag, text in texts.items()}
    return _framed("3LE1 09", " ! ", fields)


def _framed(kind, extended, fields):
    """Return a record of ISO/IEC 8211: leader, directory and fields."""
    contents = [(tag, data + END) for tag, data in fields.items()]
    starts = [0]
    for _, data in contents:
        starts.append(starts[-1] + len(data))
    directory = END.join([
        "".join(
            f"{tag}{stop - start:05d}{start:06d}"
            for (tag, _), (start, stop) in zip(contents, pairwise(starts), strict=True)
        ).encode(),
        b"",
    ])  # fmt: skip
    base = 24 + len(directory)
    leader = f"{base + starts[-1]:05d}{kind}{base:05d}{extended}5604"
    return leader.encode() + directory + b"".join(data for _, data in contents)
