"""One module decides what columns, axes and units mean, and every reader of tables asks it."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from netsp.base.axes import height_axis, map_unit
from netsp.base.columns import column
from netsp.base.errors import InputError
from netsp.base.table_file import read_table
from netsp.base.units import UNITS, metres_per_unit

XYZ = ("x", "y", "z")


@pytest.mark.parametrize(
    ("name", "quantity", "factor"),
    [
        ("x", "x", 1.0), ("Easting", "easting", 1.0), ("X_m", "x", 1.0), ("y [ft]", "y", 0.3048),
        ("Depth (m)", "z", -1.0), ("depth_ft", "z", -0.3048), ("DEPTH", "z", -1.0),
        ("elevation", "z", 1.0), ("z[mm]", "z", 0.001), ("Water Depth, m", "z", -1.0),
        ("Latitude", "latitude", 1.0), ("lon (deg)", "longitude", 1.0), ("lat_rad", "latitude",
        180.0 / np.pi), ("time_ms", "time", 1e-3), ("TimeUS", "time", 1e-6),
        ("diameter", "radius", 0.5), ("vx (m/s)", "velocity_x", 1.0), ("Label", "name", 1.0),
        ("Time (UTC)", "time", 1.0), ("z (down)", "z", -1.0), ("z_up", "z", 1.0),
        ("Depth [MSL]", "z", -1.0),
    ],
)  # fmt: skip
def test_the_name_of_a_column_states_quantity_direction_and_unit(name, quantity, factor):
    meaning = column(name)
    assert meaning is not None
    assert (meaning.quantity, meaning.factor) == (quantity, pytest.approx(factor))


@pytest.mark.parametrize("name", ["x_ref", "colour", "", "zone", "depth_error"])
def test_a_name_that_only_begins_like_a_known_one_means_nothing(name):
    assert column(name) is None


def test_an_unknown_unit_in_brackets_is_refused():
    with pytest.raises(InputError, match="furlong"):
        column("depth (furlong)")
    assert column("heading (mils)") is None


def test_units_have_names_in_full():
    for name, metres in (("feet", 0.3048), ("US survey foot", 1200 / 3937), ("Metres", 1.0)):
        assert metres_per_unit(name) == metres
    assert metres_per_unit("parsec") is None
    assert UNITS["fathom"] == pytest.approx(6 * 0.3048)


def render(head, rows, separator, decimal, encoding):
    lines = [separator.join(head)] if head else []
    lines += [
        separator.join(
            c if isinstance(c, str) else f"{c:.3f}".replace(".", decimal) for c in row
        )
        for row in rows
    ]  # fmt: skip
    return ("\r\n".join(lines) + "\r\n").encode(encoding)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
@pytest.mark.parametrize(
    ("separator", "decimal"),
    [(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ","), (" ", "."), ("  ", ",")],
)
def test_order_separator_decimal_sign_and_encoding_do_not_change_the_points(
    tmp_path, separator, decimal, encoding
):
    points = {"X": [4.0, 5.25, -6.0], "pos_y": [1.0, 2.5, 3.0], "depth": [10.0, 0.5, 2.0]}
    points["id"] = [12.0, 24.0, 36.0]
    for head in itertools.islice(itertools.permutations(points), 0, 24, 5):
        rows = list(zip(*(points[name] for name in head), strict=True))
        file = tmp_path / "t.csv"
        file.write_bytes(render(head, rows, separator, decimal, encoding))
        table = read_table(file)
        assert table.numbers(XYZ) == pytest.approx(
            np.column_stack([points["X"], points["pos_y"], -np.array(points["depth"])])
        )


@pytest.mark.parametrize("separator", [",", ";", " "])
def test_a_table_without_names_is_read_by_position_where_that_is_clear(tmp_path, separator):
    file = tmp_path / "t.xyz"
    file.write_bytes(render((), [(1.0, 2.0, -3.5), (4.0, 5.0, -6.5)], separator, ".", "utf-8"))
    assert read_table(file, positional=XYZ).numbers(XYZ).tolist() == [
        [1.0, 2.0, -3.5], [4.0, 5.0, -6.5],
    ]  # fmt: skip
    with pytest.raises(InputError, match="names of the columns"):
        read_table(file)


def test_a_comment_may_name_the_columns(tmp_path):
    file = tmp_path / "t.txt"
    file.write_text("# survey 7\n//Z X Y\n1 2 3\n", encoding="utf-8")
    assert read_table(file, positional=XYZ).numbers(XYZ).tolist() == [[2.0, 3.0, 1.0]]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x,y,z\n6,0000,0,0000,-10,0000\n", "decimal commas"),
        ("6,0000,0,0500,-10,0000\n5,9877,0,1564,-9,5000\n", "decimal commas"),
        ("x;y;z\n6,5;1.5;2\n", "expected one of them"),
        ("x,y,z,depth\n1,2,3,4\n", "both hold z"),
        ("x_coord,pos_x,y\n1,2,3\n", "both hold x"),
        ("1 4.5 2 3\n2 4.5 5 6\n3 4.5 3 3\n", "number the rows"),
        ("x y z\n1.234,5 2 3\n", "expected a number"),
        ("x,y,depth\n1,2,-3\n4,5,-6\n", "negative numbers only"),
        ("", "nothing"),
    ],
)
def test_what_is_ambiguous_is_refused_in_one_line(tmp_path, text, message):
    file = tmp_path / "t.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=message) as error:
        read_table(file, positional=XYZ).numbers(XYZ)
    assert "\n" not in str(error.value)


def test_columns_that_are_not_used_are_named(tmp_path):
    file = tmp_path / "t.csv"
    file.write_text("x,colour,y,name,depth\n1,red,2,A,3\n", encoding="utf-8")
    table = read_table(file)
    assert table.left_out(("x", "y", "z")) == ("name", "colour")
    assert table.text(0, "name") == "A"


def test_vertical_axes_have_a_direction_and_a_unit():
    pytest.importorskip("pyproj")
    depth, feet = height_axis("EPSG:25832+5715"), height_axis("EPSG:2263+6360")
    assert (depth.sign, depth.metres, depth.is_stated) == (-1.0, 1.0, True)
    assert (feet.sign, feet.metres) == (1.0, pytest.approx(1200 / 3937))
    assert height_axis("EPSG:4326").metres == 1.0
    assert not height_axis("EPSG:2263").is_stated
    assert map_unit("EPSG:2263") == pytest.approx(1200 / 3937)
    assert map_unit("EPSG:4326") is None
