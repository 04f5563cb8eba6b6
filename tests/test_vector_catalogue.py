"""Features of KML, drawings and GDAL's formats: used + left out = all, and each as it was drawn."""

import io
import math
import sqlite3
import struct
import zipfile

import numpy as np
import pytest

from netsp import InputError
from netsp.app.served_files import ImportAnswers
from netsp.app.served_files import imported as read_upload
from netsp.base.errors import UnansweredError
from netsp.exchange.maps.contract import words_in
from netsp.exchange.maps.options import InspectionOptions, SiteOptions
from netsp.exchange.maps.selection import Selection
from netsp.exchange.maps.site_import import import_site

pyogrio = pytest.importorskip("pyogrio")
shapely = pytest.importorskip("shapely")

OPTIONS = {"tether": 200.0, "line_width": 0.5, "radius": 0.5}


def imported(file, data, **more):
    """Import a file, and check that every feature of it is used or left out."""
    file.write_bytes(data if isinstance(data, bytes) else data.encode())
    found = import_site(file, options=SiteOptions(**{**OPTIONS, **more}))
    for layer in found.problem.site.imported:
        left_out = sum(group.features for group in layer.left_out)
        assert sum(layer.used.values()) + left_out == layer.features
    return found


def counts(found):
    """Features that are used and that are left out."""
    layers = found.problem.site.imported
    used = sum(sum(layer.used.values()) for layer in layers)
    return used, sum(layer.features for layer in layers) - used


def reasons(found):
    return {g.reason: g.features for layer in found.problem.site.imported for g in layer.left_out}


# KML


def kml(*body):
    space = 'xmlns="http://www.opengis.net/kml/2.2" xmlns:gx="http://www.google.com/kml/ext/2.2"'
    return f'<?xml version="1.0"?><kml {space}>{"".join(body)}</kml>'


def folder(name, *body, tag="Folder"):
    return f"<{tag}><name>{name}</name>{''.join(body)}</{tag}>"


def mark(name, geometry, more=""):
    return f"<Placemark><name>{name}</name>{more}{geometry}</Placemark>"


def places(*points):
    text = " ".join(
        ",".join([f"{5.5 + p[0] * 1.69e-5:.9f}", f"{58 + p[1] * 8.98e-6:.9f}", *map(str, p[2:])])
        for p in points
    )
    return f"<coordinates>{text}</coordinates>"


def point(x, y, z=0, mode=""):
    return f"<Point>{mode}{places((x, y, z))}</Point>"


def ring(x, y, closed=True):
    corners = [(x, y), (x + 2, y), (x + 2, y + 2), (x, y + 2), (x, y)]
    return f"<LinearRing>{places(*corners[: 4 + closed])}</LinearRing>"


def area(x, y, closed=True):
    return f"<Polygon><outerBoundaryIs>{ring(x, y, closed)}</outerBoundaryIs></Polygon>"


def mode(name):
    prefix = "gx:" if "SeaFloor" in name else ""
    return f"<{prefix}altitudeMode>{name}</{prefix}altitudeMode>"


START = folder("Base", mark("B", point(0, 0))) + folder("Goals", mark("G", point(-9, 0)))


def test_kml_features_of_all_types_add_up(tmp_path):
    line = f"<LineString>{places((5, 5), (5, 9))}</LineString>"
    track = (
        "<gx:Track><when/><gx:coord>5.5 58 0</gx:coord><gx:coord>5.501 58 0</gx:coord></gx:Track>"
    )
    nested = f"<MultiGeometry>{line}{point(9, 15)}</MultiGeometry>"
    nested = f"<MultiGeometry>{area(9, 9)}{nested}</MultiGeometry>"
    found = imported(
        tmp_path / "m.kml",
        kml(
            folder(
                "site",
                START,
                folder(
                    "Piers",
                    mark("l", line),
                    mark("open", area(20, 0, closed=False)),
                    mark("r", ring(30, 0)),
                    mark("n", nested),
                    mark("p", point(40, 0)),
                ),
                mark("hidden", area(50, 0), "<visibility>0</visibility>"),
                mark("t", track),
                mark("no", ""),
                mark("empty", "<Point><coordinates/></Point>"),
                mark("m", "<Model/>"),
                "<GroundOverlay/><ScreenOverlay/><PhotoOverlay/>",
                "<NetworkLink><Link><href>http://example.org/a.kml</href></Link></NetworkLink>",
                "<NetworkLink><Link><href>gone.kml</href></Link></NetworkLink>",
                tag="Document",
            )
        ),
    )
    assert counts(found) == (2 + 7 + 2, 8)
    assert {o.name for o in found.problem.obstacles} == {
        "l",
        "open",
        "r",
        "n 1",
        "n 2",
        "n 3",
        "p",
        "hidden",
    }
    notes = " ".join(found.notes)
    for words in ("not closed", "visibility 0", "not fetched", "is not there", "a 3D model"):
        assert words in notes


@pytest.mark.parametrize("name", ["Piles", "piles (#2)", "Structures", "Quay"])
@pytest.mark.parametrize("depth", [0, 1, 3])
def test_the_nearest_folder_with_a_word_decides(name, depth, tmp_path):
    inside = mark("P", point(9, 0))
    for k in range(depth):
        inside = folder(f"part {k}", inside)
    text = kml(folder("Goals", START, folder(name, inside), tag="Document"))
    found = imported(tmp_path / "s.kml", text)
    assert [o.name for o in found.problem.obstacles] == ["P"]
    assert [g.name for g in found.problem.goals] == ["G"]
    left = imported(tmp_path / "s.kml", text, maps=[("ignore", name)])
    assert not left.problem.obstacles
    assert counts(left) == (2, 1)


@pytest.mark.parametrize(("layer", "count"), [("Piles", 4), ("North", 4), ("Piles/North", 4)])
def test_goals_about_obstacles_are_chosen_by_any_folder(layer, count, tmp_path):
    piles = folder("Piles", folder("North", mark("P", point(9, 0))), folder("South"))
    text = kml(
        folder("site", START, piles, folder("Walls", mark("W", area(30, 0))), tag="Document")
    )
    look = InspectionOptions(viewpoints=4, standoff=1.0, chosen=Selection.parse([("layer", layer)]))
    found = imported(tmp_path / "s.kml", text, inspection=look)
    assert len(found.problem.goals) == 1 + count


def test_words_of_a_path_of_folders_go_from_the_nearest_outwards():
    assert words_in("goals/piles (#2)/north.kml") == (
        "goals/piles (#2)/north",
        "north",
        "piles",
        "goals",
    )


def test_altitude_modes_are_heeded(tmp_path):
    marks = [
        mark(m, point(k + 1, 5, -k - 1, mode(m)))
        for k, m in enumerate(["clampToGround", "relativeToGround", "absolute"])
    ]
    found = imported(tmp_path / "a.kml", kml(START, folder("Goals", *marks)))
    assert [g.position[2] for g in found.problem.goals] == [0.0, 0.0, -2.0, -3.0]
    for name in ("relativeToSeaFloor", "clampToSeaFloor"):
        pile = folder("Piles", mark("P", area(5, 5).replace("<Polygon>", f"<Polygon>{mode(name)}")))
        deep = folder("Goals", mark("D", point(1, 5, 3, mode(name))))
        with pytest.raises(InputError, match=r"Goals\[1\] \(D\).*counts from the sea floor"):
            imported(tmp_path / "a.kml", kml(START, deep, pile))
        assert len(imported(tmp_path / "a.kml", kml(START, pile)).problem.obstacles) == 1
    with pytest.raises(InputError, match="altitudeMode: expected clampToGround"):
        imported(tmp_path / "a.kml", kml(START, mark("x", point(1, 5, 3, mode("high")))))


def archive(**pages):
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as packed:
        for name, data in pages.items():
            packed.writestr(name, data)
    return out.getvalue()


def test_an_archive_is_read_from_doc_kml_with_the_pages_it_links_to(tmp_path):
    link = "<NetworkLink><name>Piles</name><Link><href>files/p.kml</href></Link></NetworkLink>"
    found = imported(
        tmp_path / "a.kmz",
        archive(
            **{
                "__MACOSX/._doc.kml": b"\0\5\x16\7",
                "files/old.kml": kml(mark("old", area(1, 1))),
                "files/p.kml": kml(mark("P", point(9, 0))),
                "._x.kml": b"\0",
                "doc.kml": kml(START, link),
            }
        ),
    )
    assert [o.name for o in found.problem.obstacles] == ["P"]
    assert reasons(found) == {"a page that doc.kml does not link to": 1}
    (tmp_path / "beside.kml").write_text(kml(mark("Q", area(9, 9)), link.replace("files/p", "b")))
    found = imported(tmp_path / "b.kml", kml(START, link.replace("files/p", "beside")))
    assert [o.name for o in found.problem.obstacles] == ["Q"]
    assert reasons(found) == {"a link to 'b.kml', which is read already": 1}


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b'<!DOCTYPE k [<!ENTITY a "b">]><kml/>', "without a document type"),
        ('<?xml version="1.0" encoding="UTF-16"?><!DOCTYPE k><kml/>'.encode("utf-16"), "document"),
        (b"<html/>", "expected a kml element, got 'html'"),
        (b"<kml", "not XML"),
        (b"PK\3\4...", "a damaged archive"),
        (kml(START, mark("x", "<Point><coordinates>5,a</coordinates></Point>")).encode(), "'5,a'"),
        (kml(START, mark("x", "<Point><coordinates>5,158</coordinates></Point>")).encode(), "90"),
    ],
)
def test_bad_kml_is_refused_in_one_line_with_its_name(data, said, tmp_path):
    with pytest.raises(InputError, match=said) as error:
        imported(tmp_path / "bad.kml", data)
    assert str(tmp_path / "bad.kml") in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("body", "tag"),
    [
        ("<Placemark><Folder>{}</Folder></Placemark>", "Folder"),
        ("<Placemark>{}</Placemark>", "Placemark"),
        (
            "<Placemark><MultiGeometry><gx:Circle>{}</gx:Circle></MultiGeometry></Placemark>",
            "Circle",
        ),
        ("<Other>{}</Other>", "Other"),
    ],
)
def test_places_where_kml_has_none_are_named(body, tag, tmp_path):
    found = imported(tmp_path / "s.kml", kml(START, body.format(mark("x", area(5, 5)))))
    assert not found.problem.obstacles
    assert any(f"an element {tag}" in reason for reason in reasons(found))


@pytest.mark.parametrize("name", ["&lt;Null&gt;", "  ", "", "None", "unnamed"])
def test_names_that_several_share_are_numbered_and_no_names_stay_none(name, tmp_path):
    piles = [mark("P", area(10 * k, 5)) for k in range(1, 4)] + [mark("P 2", area(50, 5))]
    nameless = [mark(name, area(10 * k, 20)) for k in range(2)]
    goals = folder(
        "Goals", mark("G", point(1, -5)), mark("G", point(3, -5)), mark(name, point(5, -5))
    )
    found = imported(tmp_path / "n.kml", kml(START, goals, folder("Piles", *piles, *nameless)))
    assert [o.name for o in found.problem.obstacles] == ["P", "P 3", "P 4", "P 2", None, None]
    assert [g.name for g in found.problem.goals] == ["G", "G 2", "G 3", None]
    assert sum("share are numbered" in note for note in found.notes) == 2


def test_a_negative_depth_is_refused_with_what_to_do(tmp_path):
    deep = "<ExtendedData><Data name='depth'><value>-4</value></Data></ExtendedData>"
    text = kml(START, folder("Goals", mark("D", point(5, 5), deep)))
    with pytest.raises(InputError, match=r"Goals\[1\] \(D\): depth: .*0 or more, got -4 m"):
        imported(tmp_path / "d.kml", text)
    table = tmp_path / "goals.csv"
    table.write_text("x,y,depth\n5,5,3\n7,5,-3\n")
    with pytest.raises(InputError, match=r"goals\.csv: row 2: 'depth' .*0 or more, got -3 m"):
        imported(tmp_path / "d.kml", kml(START), goals=table)


# Drawings


def entity(kind, layer, *codes):
    return [0, kind, 8, layer, *codes]


def dot(layer, x, y, z=0):
    return entity("POINT", layer, 10, x, 20, y, 30, z)


def circle(layer, x, y, radius=1.0):
    return entity("CIRCLE", layer, 10, x, 20, y, 40, radius)


def text(layer, x, y, words):
    return entity("TEXT", layer, 10, x, 20, y, 40, 1.0, 1, words)


def insert(layer, block, x, y, *codes):
    return entity("INSERT", layer, 2, block, 10, x, 20, y, *codes)


def drawing(*entities, header=(), layers=(), blocks=None):
    out = []
    for section, tags in (
        ("HEADER", header),
        ("TABLES", [0, "TABLE", 2, "LAYER", *[t for row in layers for t in row], 0, "ENDTAB"]),
        (
            "BLOCKS",
            [
                t
                for name, body in (blocks or {}).items()
                for t in [
                    0,
                    "BLOCK",
                    2,
                    name,
                    10,
                    0,
                    20,
                    0,
                    *[t for e in body for t in e],
                    0,
                    "ENDBLK",
                ]
            ],
        ),
        ("ENTITIES", [t for e in entities for t in e]),
    ):
        if tags:
            out += [0, "SECTION", 2, section, *tags, 0, "ENDSEC"]
    return "\n".join(map(str, [*out, 0, "EOF", ""]))


PLACES = (dot("BASE", 0, 0), dot("GOALS", -9, 0, -2))
FLAT = (
    entity("ARC", "X", 10, 10, 20, 0, 40, 2, 50, 0, 51, 180),
    entity("ARC", "X", 10, 10, 20, 0, 40, 2, 50, 180, 51, 360),
)


def vertices(layer, *points, flag=32):
    rows = [entity("VERTEX", layer, 10, x, 20, y, 30, z, 70, flag) for x, y, z in points]
    return [*[t for row in rows for t in row], 0, "SEQEND", 8, layer]


def test_entities_of_all_types_add_up(tmp_path):
    square = [(40, 0, 0), (42, 0, 1), (40, 2, 0), (42, 2, 0)]
    mesh = [t for x, y, z in square for t in (10, x, 20, y + 9, 30, z)]
    read = [
        *FLAT,
        circle("X", 20, 0),
        entity("SOLID", "X", 10, 30, 20, 0, 11, 32, 21, 0, 12, 30, 22, 2, 13, 32, 23, 2),
        entity("3DFACE", "X", 10, 30, 20, 5, 11, 32, 21, 5, 12, 32, 22, 7, 13, 30, 23, 7),
        [*entity("POLYLINE", "X", 66, 1, 70, 16, 71, 2, 72, 2), *vertices("X", *square, flag=64)],
        [*entity("POLYLINE", "X", 66, 1, 70, 8), *vertices("X", (40, 5, 0), (42, 5, 1))],
        entity("MESH", "X", 92, 4, *mesh, 93, 5, 90, 4, 90, 0, 90, 1, 90, 3, 90, 2),
        entity("ELLIPSE", "X", 10, 50, 20, 0, 11, 3, 21, 0, 40, 0.5, 41, 0, 42, 2 * math.pi),
        entity("LWPOLYLINE", "X", 90, 2, 70, 1, 10, 50, 20, 5, 42, 1, 10, 52, 20, 5, 42, 1),
        entity("LINE", "X", 10, 60, 20, 0, 11, 62, 21, 0),
        insert("X", "PILE", 70, 0),
    ]
    lost = [
        text("X", 0, 99, "note"),
        entity("MTEXT", "X", 10, 0, 20, 90, 1, "a"),
        entity("DIMENSION", "X"),
        entity("LEADER", "X"),
        entity("XLINE", "X"),
        entity("RAY", "X"),
        entity("3DSOLID", "X"),
        entity("REGION", "X"),
        entity("MLINE", "X"),
        entity("VIEWPORT", "X"),
        entity("ATTDEF", "X"),
        [*circle("X", 9, 9), 67, 1],
        [*circle("X", 9, 9), 60, 1],
        circle("Defpoints", 9, 9),
        circle("OFF", 9, 9),
        circle("ICE", 9, 9),
        insert("X", "NONE", 0, 0),
        entity("NEW", "X"),
        insert("X", "WORDS", 5, 5),
        entity("LINE", "X", 10, 1, 20, 1, 11, 1, 21, 1),
    ]
    layers = ([0, "LAYER", 2, "OFF", 70, 0, 62, -7], [0, "LAYER", 2, "ICE", 70, 1, 62, 7])
    blocks = {"PILE": [circle("0", 0, 0)], "WORDS": [text("0", 0, 0, "x"), entity("3DSOLID", "0")]}
    rng = np.random.default_rng(4)
    mixed = [[*read, *lost][k] for k in rng.permutation(len(read) + len(lost))]
    found = imported(tmp_path / "d.dxf", drawing(*PLACES, *mixed, layers=layers, blocks=blocks))
    assert counts(found) == (2 + len(read), len(lost))
    shapes = shapely.union_all([o.shape() for o in found.problem.obstacles])
    for x, y in (
        (10, 0),
        (20, 0),
        (31, 1),
        (31, 6),
        (41, 1),
        (41, 5),
        (41, 10),
        (52, 0.5),
        (51, 5),
        (61, 0),
        (70, 0),
    ):
        assert shapes.covers(shapely.Point(x, y)), (x, y)
    circles = sorted(o.radius for o in found.problem.obstacles if hasattr(o, "radius") and o.radius)
    assert circles == pytest.approx([1.0, 1.0, 1.0, 2.0], rel=1e-3)


def test_texts_beside_places_are_their_names_and_others_are_left_out(tmp_path):
    found = imported(
        tmp_path / "d.dxf",
        drawing(
            dot("BASE", 0, 0),
            dot("GOALS", 9, 0),
            circle("GOALS", 9, 9, 0.3),
            circle("POSTS", 20, 0),
            text("GOALS", 9.5, 0.5, "north"),
            text("GOALS", 9.5, 9.5, "south"),
            text("POSTS", 20, 1, "P1"),
            text("GOALS", 60, 60, "legend"),
        ),
    )
    assert {g.name: g.position[:2] for g in found.problem.goals} == {
        "north": pytest.approx((9.0, 0.0)),
        "south": pytest.approx((9.0, 9.0)),
    }
    assert [o.name for o in found.problem.obstacles] == ["P1"]
    assert sum(reasons(found).values()) == 3 or counts(found)[1] == 4


@pytest.mark.parametrize(
    ("number", "metres"),
    [
        (1, 0.0254),
        (2, 0.3048),
        (3, 1609.344),
        (4, 1e-3),
        (5, 0.01),
        (6, 1.0),
        (7, 1e3),
        (10, 0.9144),
        (14, 0.1),
        (15, 10.0),
        (16, 100.0),
        (21, 12 / 39.37),
        (22, 1 / 39.37),
        (23, 36 / 39.37),
        (24, 63360 / 39.37),
    ],
)
def test_the_header_states_the_unit_and_the_user_overrules_it(number, metres, tmp_path):
    header = (9, "$INSUNITS", 70, number)
    data = drawing(dot("BASE", 0, 0), dot("GOALS", 3, 0), circle("P", 2, 0, 0.25), header=header)
    found = imported(tmp_path / "u.dxf", data, tether=5 * metres)
    assert found.problem.goals[0].position[0] == pytest.approx(3 * metres)
    assert found.problem.obstacles[0].radius == pytest.approx(0.25 * metres)
    assert any("$INSUNITS" in note for note in found.notes)
    found = imported(tmp_path / "u.dxf", data, units="yd")
    assert found.problem.goals[0].position[0] == pytest.approx(3 * 0.9144)


@pytest.mark.parametrize(
    ("header", "said"),
    [
        ((9, "$INSUNITS", 70, 18), r"has \$INSUNITS 18, which is no unit of a site"),
        ((9, "$INSUNITS", 70, "x"), r"has \$INSUNITS x, which is no unit of a site"),
        ((9, "$INSUNITS", 70, 0, 9, "$MEASUREMENT", 70, 1), "states no unit"),
        ((9, "$MEASUREMENT", 70, 0), "states no unit"),
    ],
)
def test_a_unit_that_no_site_has_is_asked_about(header, said, tmp_path):
    data = drawing(*PLACES, header=header)
    with pytest.raises(UnansweredError, match=f"{said}; give the unit with --units") as refused:
        imported(tmp_path / "u.dxf", data)
    assert refused.value.asks == ("units",)
    assert imported(tmp_path / "u.dxf", data, units="cm").problem.goals
    answers = ImportAnswers.parse({"units": "cm", "tether": "5"})
    assert read_upload("u.dxf", data.encode(), answers=answers)[0]["goals"]


def test_blocks_keep_layers_symbols_stand_where_they_mark_and_arrays_are_whole(tmp_path):
    blocks = {
        "SYMBOL": [circle("0", 0, 0), entity("LINE", "0", 10, -1, 20, 0, 11, 1, 21, 0)],
        "PLAN": [circle("OBSTACLES", 0, 0), dot("GOALS", 3, 3), insert("0", "PILE", 5, 0)],
        "PILE": [circle("0", 0, 0)],
    }
    named = [
        *insert("PILES", "PILE", -20, 0, 66, 1),
        *entity("ATTRIB", "0", 2, "NAME", 1, "A"),
        0,
        "SEQEND",
    ]
    found = imported(
        tmp_path / "b.dxf",
        drawing(
            dot("BASE", 0, 0),
            insert("GOALS", "SYMBOL", 9, 0),
            insert("0", "PLAN", 30, 0, 41, 2, 42, 2),
            insert("PILES", "PILE", 0, 50, 70, 3, 44, 5),
            named,
            blocks=blocks,
        ),
    )
    assert sorted(g.position[:2] for g in found.problem.goals) == [
        pytest.approx((9.0, 0.0)),
        pytest.approx((36.0, 6.0)),
    ]
    piles = sorted(
        (round(o.center[0], 6), round(o.center[1], 6), o.radius) for o in found.problem.obstacles
    )
    assert [p[:2] for p in piles] == [(-20, 0), (0, 50), (5, 50), (10, 50), (30, 0), (40, 0)]
    assert [p[2] for p in piles] == pytest.approx([1, 1, 1, 1, 2, 2])
    assert "A" in [o.name for o in found.problem.obstacles]


def test_a_hatch_in_an_outline_that_is_read_is_left_out(tmp_path):
    def hatch(x):
        corners = [t for a, b in ((0, 0), (2, 0), (2, 2), (0, 2)) for t in (10, x + a, 20, b)]
        return entity(
            "HATCH",
            "P",
            10,
            0,
            20,
            0,
            30,
            0,
            210,
            0,
            220,
            0,
            230,
            1,
            2,
            "SOLID",
            70,
            1,
            71,
            0,
            91,
            1,
            92,
            2,
            72,
            0,
            73,
            1,
            93,
            4,
            *corners,
            97,
            0,
            75,
            0,
            76,
            1,
            98,
            0,
        )

    box = entity(
        "LWPOLYLINE", "P", 90, 4, 70, 1, 10, 5, 20, 0, 10, 7, 20, 0, 10, 7, 20, 2, 10, 5, 20, 2
    )
    found = imported(tmp_path / "h.dxf", drawing(*PLACES, box, hatch(5), hatch(15)))
    assert len(found.problem.obstacles) == 2
    assert reasons(found) == {"fills an outline that is read (HATCH)": 1}


def wall(layer, points, mitres, offsets, *codes):
    """Return an MLINE: at each vertex, its mitre and the distance of each line along that."""
    out = []
    for (x, y), (dx, dy) in zip(points, mitres, strict=True):
        out += [11, x, 21, y, 31, 0, 12, 1, 22, 0, 32, 0, 13, dx, 23, dy, 33, 0]
        for offset in offsets:
            out += [74, 2, 41, offset, 41, 0.0, 75, 0]
    return entity("MLINE", layer, 72, len(points), 73, len(offsets), 10, 0, 20, 0, *codes, *out)


SQUARE = [(5, 0), (15, 0), (15, 10), (5, 10)]
INWARDS = [(1, 1), (-1, 1), (-1, -1), (1, -1)]


@pytest.mark.parametrize(
    ("thing", "area"),
    [
        (wall("W", [(5, 0), (15, 0)], [(0, 1)] * 2, [0, -1, -3]), 30.0),
        (wall("W", SQUARE, INWARDS, [0, 1], 71, 3), 100.0 - 64.0),  # (10, 5) stays free
        (wall("W", SQUARE[:2], [(0, 1)] * 2, [0.5]), 10.5 * 0.5),  # a line, of --line-width
        (insert("W", "B", 20, 0, 41, 2, 42, 2), 20.0),
        (insert("W", "b", 20, 0), 5.0),  # names of blocks in any case
        (entity("SOLID", "W", 10, 5, 20, 0, 11, 9, 21, 0, 12, 5, 22, 4), 8.0),  # three corners
        (entity("LWPOLYLINE", "W", 90, 2, 10, 5, 20, 0, 40, 1, 41, 2, 10, 9, 20, 0, 40, 2), 12.0),
        (insert("W", "WIDE", 0, 0, 41, 2, 42, 2), 2.0 * 10.0),
    ],
)
def test_walls_have_the_area_that_is_drawn(thing, area, tmp_path):
    blocks = {
        "B": [wall("0", [(0, 0), (5, 0)], [(0, 1)] * 2, [0, 1])],
        "WIDE": [entity("LWPOLYLINE", "0", 90, 2, 43, 1, 10, 5, 20, 0, 10, 9, 20, 0)],
    }
    found = imported(
        tmp_path / "w.dxf", drawing(*PLACES, dot("GOALS", 10, 5), thing, blocks=blocks)
    )
    assert counts(found) == (4, 0)
    whole = shapely.union_all([o.shape() for o in found.problem.obstacles])
    assert whole.area == pytest.approx(area, rel=1e-6)


def test_goals_drawn_as_arrays_and_mirrored_symbols_are_where_they_are_drawn(tmp_path):
    blocks = {"S": [circle("0", 0, 0)]}
    row = insert("GOALS", "S", 5, 5, 70, 3, 71, 2, 44, 5, 45, 2, 50, 90)
    mirrored = insert("GOALS", "S", 5, 40, 30, 2, 210, 0, 220, 0, 230, -1)
    found = imported(tmp_path / "a.dxf", drawing(*PLACES, row, mirrored, blocks=blocks))
    places = {tuple(round(v, 9) for v in g.position) for g in found.problem.goals[1:]}
    assert places == {(x, y, 0.0) for x in (5, 3) for y in (5, 10, 15)} | {(-5.0, 40.0, -2.0)}
    with pytest.raises(InputError, match=r"BASE\[0\].*a base cannot be"):
        imported(tmp_path / "a.dxf", drawing(insert("BASE", "S", 5, 5, 70, 3), blocks=blocks))


LINE = (10, 5, 20, 0, 11, 9, 21, 0)


@pytest.mark.parametrize(
    ("thing", "said"),
    [
        (entity("LINE", "X", 5, "1F", 10, "abc", *LINE[2:]), "code 10: expected a number.*'abc'"),
        (entity("LINE", "X", 5, "1F", 10, "1,5", *LINE[2:]), "code 10: expected a number.*'1,5'"),
        (entity("LINE", "X", 5, "1F", 10, "nan", *LINE[2:]), "code 10: expected a number.*'nan'"),
        (entity("LINE", "X", 5, "1F", 10, "1e99", *LINE[2:]), "code 10: expected a number"),
        (entity("LINE", "X", 5, "1F", *LINE[:6]), "code 21: missing"),
        (entity("LWPOLYLINE", "X", 5, "1F", 90, 3, *LINE[:4]), "expected 3 corners.*got 1 x"),
        (entity("SPLINE", "X", 5, "1F", 71, 3, *LINE[:4]), "got 1 x, 1 y and 0 knots"),
        (entity("SPLINE", "X", 5, "1F", 71, 3, *LINE[4:]), "no control points"),
        (insert("X", "BAD", 0, 0, 5, "1F"), r"'BAD': LINE \(handle 2A\): group code 20: expected"),
        (insert("X", "SELF", 0, 0, 5, "1F"), "'SELF' holds itself"),
        (insert("X", "GOOD", 0, 0, 5, "1F", 41, 0), "its scale is 0"),
        (entity("MESH", "X", 5, "1F", 92, 1, *LINE[:4], 30, 0, 93, 4, 90, 3), "list of 4 numbers"),
        (entity("MESH", "X", 5, "1F", 92, 2, *LINE[:4], 30, 0), "expected 2 corners, got 1"),
        (entity("MLINE", "X", 5, "1F", 72, 2), "expected 2 vertices"),
        (entity("HATCH", "X", 5, "1F", 91, 1, 92, 2, 72, 0, 73, 1, 93, 4, *LINE[:4]), "a damaged"),
    ],
)
def test_damaged_entities_are_named_with_their_handles(thing, said, tmp_path):
    blocks = {
        "GOOD": [circle("0", 0, 0)], "SELF": [insert("0", "SELF", 1, 1)],
        "BAD": [entity("LINE", "0", 5, "2A", 10, 5, 20, "O", 11, 9, 21, 0)],
    }  # fmt: skip
    data = drawing(*PLACES, circle("X", 30, 0), thing, circle("X", 40, 0), blocks=blocks)
    with pytest.raises(InputError, match=said):
        imported(tmp_path / "d.dxf", data)
    with pytest.raises(InputError, match=r"X\[1\] \(handle 1F\): a damaged .*repair or delete it"):
        imported(tmp_path / "d.dxf", data)


def test_a_drawing_that_is_cut_short_is_refused(tmp_path):
    whole = drawing(*PLACES, circle("X", 30, 0))
    with pytest.raises(InputError, match="cut short: its section ENTITIES has no end"):
        imported(tmp_path / "d.dxf", whole[: whole.rindex("0\nENDSEC")])


@pytest.mark.parametrize("kind", ["3DSOLID", "REGION", "BODY", "PLANESURFACE"])
def test_solids_are_named_with_what_to_do(kind, tmp_path):
    found = imported(tmp_path / "d.dxf", drawing(*PLACES, entity(kind, "X")))
    assert counts(found) == (2, 1)
    assert any(f"({kind}): draw its outline" in reason for reason in reasons(found))


def test_other_drawings_that_are_referred_to_are_named(tmp_path):
    data = drawing(*PLACES, insert("X", "O", 3, 3), blocks={"O": []})
    data = data.replace("BLOCK\n2\nO\n", "BLOCK\n2\nO\n70\n4\n1\nother.dwg\n")
    found = imported(tmp_path / "d.dxf", data)
    assert any("another drawing (other.dwg)" in reason for reason in reasons(found))


def binary(*entities):
    out = b"AutoCAD Binary DXF\r\n\x1a\0"
    tags = [0, "SECTION", 2, "ENTITIES", *[t for e in entities for t in e], 0, "ENDSEC", 0, "EOF"]
    for code, value in zip(tags[::2], tags[1::2], strict=True):
        out += struct.pack("<h", code)
        if isinstance(value, str):
            out += value.encode() + b"\0"
        else:
            out += struct.pack("<d" if 10 <= code < 60 else "<h", value)
    return out


def test_binary_drawings_are_those_of_text(tmp_path):
    things = (*PLACES, circle("P", 5, 5))
    a = imported(tmp_path / "a.dxf", drawing(*things)).problem
    b = imported(tmp_path / "b.dxf", binary(*things)).problem
    assert (a.goals, a.obstacles) == (b.goals, b.obstacles)
    for data, said in (
        (binary(*things)[:90], "cut short"),
        (b"AC1027\0\0", "a DWG drawing"),
        (b"hello\nworld\n", "expected a group code"),
        (b"0\nEOF\n", "expected a section ENTITIES"),
    ):
        with pytest.raises(InputError, match=said):
            imported(tmp_path / "c.dxf", data)


# Geometries of GDAL


def wkb(code, body):
    return struct.pack("<BI", 1, code) + body


def row(*points):
    return struct.pack("<I", len(points)) + b"".join(struct.pack(f"<{len(p)}d", *p) for p in points)


def several(code, *parts):
    return wkb(code, struct.pack("<I", len(parts)) + b"".join(parts))


def corners(x, *more):
    return [(5e5 + x + a, 64e5 + b, *more) for a, b in ((0, 0), (2, 0), (2, 2), (0, 2), (0, 0))]


def polygon(code, *points):
    return wkb(code, struct.pack("<I", 1) + row(*points))


def arc(*points):
    return wkb(8, row(*[(5e5 + x, 64e5 + y) for x, y in points]))


BOTTOM, TOP = corners(60, 0.0), corners(60, 1.0)
SHAPES = {
    "polygon": (polygon(3, *corners(10)), 4.0),
    "unclosed": (polygon(3, *corners(20)[:4]), 4.0),
    "measured": (polygon(2003, *corners(30, 7.0)), 4.0),
    "measured in space": (polygon(3003, *corners(40, 7.0, 8.0)), 4.0),
    "extended": (polygon(0x80000003, *corners(50, 7.0)), 4.0),
    "box of faces": (
        several(
            1015,
            polygon(1003, *BOTTOM),
            polygon(1003, *TOP),
            *[
                polygon(1003, BOTTOM[k], BOTTOM[k + 1], TOP[k + 1], TOP[k], BOTTOM[k])
                for k in range(4)
            ],
        ),
        4.0,
    ),
    "triangles": (
        several(
            1016,
            polygon(1017, *[corners(70, 0.0)[k] for k in (0, 1, 2, 0)]),
            polygon(1017, *[corners(70, 0.0)[k] for k in (0, 2, 3, 0)]),
        ),
        4.0,
    ),
    "triangle": (polygon(1017, *[corners(80, 1.0)[k] for k in (0, 1, 2, 0)]), 2.0),
    "circle": (several(10, arc((90, 0), (92, 0), (90, 0))), math.pi),
    "half": (
        several(
            10,
            several(
                9,
                arc((100, 0), (102, 2), (104, 0)),
                wkb(2, row((500104.0, 64e5), (500100.0, 64e5))),
            ),
        ),
        2 * math.pi,
    ),
    "surfaces": (
        several(12, polygon(3, *corners(110)), several(10, arc((115, 0), (117, 0), (115, 0)))),
        4.0 + math.pi,
    ),
    "collection": (
        several(7, polygon(3, *corners(120)), several(7, polygon(3, *corners(125)[:4]))),
        8.0,
    ),
    "upright wall": (
        several(1015, polygon(1003, BOTTOM[0], BOTTOM[1], TOP[1], TOP[0], BOTTOM[0])),
        1.25,
    ),
    "curves": (several(11, wkb(2, row((500130.0, 64e5), (500134.0, 64e5)))), 2.25),
    "two corners": (polygon(3, *[corners(140)[k] for k in (0, 1, 0)]), 1.25),
}
"""Well-known binary, and the area that its obstacles cover."""

EMPTY = {
    "empty": wkb(3, struct.pack("<I", 0)),
    "nowhere": None,
    "one point": polygon(3, *corners(9)[:1] * 4),
}


@pytest.mark.parametrize("declared", ["GEOMETRY", "TIN"])
def test_geometries_of_all_types_of_a_geopackage_add_up(declared, tmp_path):
    file = tmp_path / "g.gpkg"
    things = {name: data for name, (data, _) in SHAPES.items()} | EMPTY
    for layer, names, x in (("base", ["b"], 0), ("goals", ["g"], -9), ("piles", list(things), 0)):
        spot = shapely.to_wkb(shapely.Point(5e5 + x, 64e5))
        pyogrio.raw.write(
            file,
            np.array([spot] * len(names), object),
            [np.array(names, object)],
            ["name"],
            driver="GPKG",
            crs="EPSG:32633",
            geometry_type="Unknown",
            layer=layer,
            append=layer != "base",
            layer_options={"SPATIAL_INDEX": "NO"},
        )
    base = sqlite3.connect(file)
    head = struct.pack("<2sBBi", b"GP", 0, 1, 32633)
    base.executemany(
        "update piles set geom = ? where name = ?",
        [(None if d is None else head + d, name) for name, d in things.items()],
    )
    base.execute(
        "update gpkg_geometry_columns set geometry_type_name = ? where table_name = 'piles'",
        (declared,),
    )
    base.execute("create table memo (id integer primary key, text text)")
    base.execute("insert into memo values (1, 'a'), (2, 'b')")
    base.execute(
        "insert into gpkg_contents (table_name, data_type, identifier) "
        "values ('memo', 'attributes', 'memo')"
    )
    base.commit()
    base.close()
    found = import_site(file, options=SiteOptions(tether=300.0, line_width=0.5))
    assert counts(found) == (2 + len(SHAPES), len(EMPTY) + 2)
    for name, (_, size) in SHAPES.items():
        own = [o.shape() for o in found.problem.obstacles if o.name.rstrip(" 12") == name]
        # metres of the system are longer than those of the earth
        assert sum(s.area for s in own) == pytest.approx(size, rel=0.01), name
    notes = " ".join(found.notes)
    assert "a ring is not closed" in notes
    assert "taken as their outline from above" in notes


OSM_WAYS = {
    "pier": ([(5, 5), (5, 15)], {"man_made": "pier", "width": "2"}, 24.0),
    "island": ([(20, 0), (24, 0), (24, 4), (20, 4), (20, 0)], {"natural": "coastline"}, 16.0),
    "lagoon": ([(30, 0), (30, 4), (34, 4), (34, 0), (30, 0)], {"natural": "coastline"}, 8.0),
    "pontoon": ([(40, 0), (44, 0)], {"floating": "yes", "mooring": "yes"}, 2.25),
}


def test_lines_of_openstreetmap_are_obstacles_and_a_coast_about_water_is_a_wall(tmp_path):
    nodes, ways, number = [], [], 0
    for name, (points, tags, _) in OSM_WAYS.items():
        first = number + 1
        closed = points[0] == points[-1]
        for x, y in points[:-1] if closed else points:
            number += 1
            nodes.append(
                f'<node id="{number}" lon="{5.5 + x * 1.6907e-5}" lat="{58 + y * 8.978e-6}"/>'
            )
        refs = [*range(first, number + 1), *([first] if closed else [])]
        texts = "".join(f'<tag k="{k}" v="{v}"/>' for k, v in {**tags, "name": name}.items())
        members = "".join(f'<nd ref="{r}"/>' for r in refs)
        ways.append(f'<way id="{first}">{members}{texts}</way>')
    for kind, x in (("base", 0), ("goal", 32)):
        nodes.append(
            f'<node id="{900 + x}" lon="{5.5 + x * 1.69e-5}" lat="{58 + x * 5.6e-7}">'
            f'<tag k="kind" '
            f'v="{kind}"/></node>'
        )
    found = imported(
        tmp_path / "m.osm", f"<osm version='0.6'>{''.join(nodes)}{''.join(ways)}</osm>"
    )
    assert counts(found) == (6, 0)
    for name, (*_, size) in OSM_WAYS.items():
        own = [o.shape() for o in found.problem.obstacles if o.name.rstrip(" 12") == name]
        whole = shapely.union_all(own)
        assert whole.area == pytest.approx(size, rel=0.15), name
    (goal,) = found.problem.goals
    assert not any(o.shape().covers(shapely.Point(goal.position)) for o in found.problem.obstacles)


def test_blocks_of_one_name_are_numbered(tmp_path):
    posts = [
        [
            *insert("PILES", "POST", x, 9, 66, 1),
            *entity("ATTRIB", "0", 2, "NAME", 1, "P"),
            0,
            "SEQEND",
        ]
        for x in (5, 15, 25)
    ]
    blocks = {"POST": [circle("0", 0, 0)]}
    found = imported(tmp_path / "b.dxf", drawing(*PLACES, *posts, blocks=blocks))
    assert sorted(o.name for o in found.problem.obstacles) == ["P", "P 2", "P 3"]


def test_a_plan_without_a_place_on_the_earth_is_a_plane(tmp_path):
    (tmp_path / "p.mid").write_text('"base"\n"goal"\n"obstacle"\n')
    found = imported(
        tmp_path / "p.mif",
        'VERSION 300\nDELIMITER ","\nCOORDSYS NONEARTH UNITS "m" BOUNDS (-99,-99) (99,99)\n'
        "COLUMNS 1\n kind char(10)\nDATA\nPOINT 0 0\nPOINT 9 0\nRECT 3 0 4 1\n",
    )
    assert found.problem.origin is None
    assert found.problem.goals[0].position == (9.0, 0.0, 0.0)
    assert found.problem.obstacles[0].shape().area == pytest.approx(1.0)


def test_texts_of_a_map_are_no_goals(tmp_path):
    (tmp_path / "t.mid").write_text('"base"\n"goal"\n""\n"obstacle"\n')
    found = imported(
        tmp_path / "t.mif",
        'VERSION 300\nDELIMITER ","\nCOORDSYS NONEARTH UNITS "m" BOUNDS (-99,-99) (99,99)\n'
        "COLUMNS 1\n kind char(10)\nDATA\nPOINT 0 0\nPOINT 9 0\n"
        'TEXT\n "depth 4"\n 5 5 8 7\n Font ("Arial",0,0,0)\nRECT 3 0 4 1\n',
    )
    assert counts(found) == (3, 1)
    assert reasons(found) == {"writing on the map (a text)": 1}


SEQUENCE = [
    '{"type": "Feature", "properties": {"kind": "base"}, '
    '"geometry": {"type": "Point", "coordinates": [5.5, 58]}}',
    '{"type": "Point", "coordinates": [5.5001, 58, -3]}',
    '{"type": "LineString", "coordinates": [[5.5002, 58], [5.5002, 58.0001]]}',
]


@pytest.mark.parametrize(("before", "after"), [("", "\n"), ("\x1e", "\n"), ("\x1e\n", "")])
def test_sequences_of_geojson_are_read_whole_or_refused(before, after, tmp_path):
    text = "".join(f"{before}{part}{after}" for part in SEQUENCE)
    found = imported(tmp_path / "s.geojsonl", text)
    assert counts(found) == (3, 0)
    assert found.problem.goals[0].position[2] == -3.0
    with pytest.raises(InputError, match=r"s\.geojsonl: (line|text) 3: not JSON"):
        imported(tmp_path / "s.geojsonl", text[:-20])


@pytest.mark.parametrize("crs", ["EPSG:4807", "EPSG:4258"])
def test_heights_in_a_system_of_angles_are_metres(crs, tmp_path):
    file = tmp_path / "a.gpkg"
    spots = [shapely.to_wkb(shapely.Point(2.0 + x, 50.0, -z)) for x, z in ((0, 0), (1e-4, 10))]
    pyogrio.raw.write(
        file, np.array(spots, object), [np.array(["base", "goal"], object)], ["kind"],
        driver="GPKG", crs=crs, geometry_type="Point Z", layer="a",
    )  # fmt: skip
    (goal,) = import_site(file, options=SiteOptions(tether=50.0)).problem.goals
    assert goal.position[2] == -10.0
