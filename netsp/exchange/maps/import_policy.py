"""Policy of imports: limits of files, rules that recognise outlines, and lengths of messages."""

from __future__ import annotations

import math
from dataclasses import dataclass

from netsp.base.errors import InputError
from netsp.base.number_ranges import check_positive


@dataclass(frozen=True)
class ReadPolicy:
    """Limits of what is read from a file. All numbers are positive.

    Attributes
    ----------
    max_features
        Maximum number of features of a map; larger maps give no problem that can be solved.
    max_pages
        Maximum number of pages of a KML map, which pages reach through links.
    max_element_depth
        Maximum depth of elements within elements of KML; more would exceed Python's stack.
    max_geometry_depth
        Maximum depth of geometries within geometries and of blocks within blocks; damaged files
        nest without end.
    max_collection_depth
        Same for collections of GeoJSON; RFC 7946 (3.1.8) advises against any nesting.
    max_image_cells
        Maximum number of cells of an occupancy image: 10 km by 10 km at a metre.
    max_image_pieces
        Maximum number of connected pieces of occupied cells; an image with more is noise.
    max_floor_cells
        Maximum number of cells along a side of a sea floor, which has two triangles for each cell.
    identity_bytes
        Number of bytes at the begin of a chart that are searched for its identity; enough for the
        description and the first record.
    max_height
        Maximum height or depth in GPX, metres; no place on the earth exceeds the default.
    max_number
        Maximum absolute value of numbers in mission files; larger ones are damage.
    max_time_s
        Maximum time since 1970, s (the year 5138). Larger numbers in a column without a unit are
        milliseconds or a finer unit.
    max_arc_step
        Maximum angle between two points of an arc, radians. The default is GDAL's, so that all
        formats give the same corners.
    """

    max_features: int = 100_000
    max_pages: int = 1000
    max_element_depth: int = 100
    max_geometry_depth: int = 32
    max_collection_depth: int = 8
    max_image_cells: int = 100_000_000
    max_image_pieces: int = 20_000
    max_floor_cells: int = 2000
    identity_bytes: int = 8192
    max_height: float = 12_000.0
    max_number: float = 1e9
    max_time_s: float = 1e11
    max_arc_step: float = math.radians(4.0)

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class OutlinePolicy:
    """Policy of outlines: what counts as a circle, and how lines and cells become areas.

    All numbers are positive.

    Attributes
    ----------
    min_circle_corners
        Minimum number of corners of a ring that is taken for a circle.
    max_radius_spread
        Maximum difference of the distances of a circle's corners from its centre, as a share of
        the radius; coordinates in degrees have few decimal places.
    max_step_spread
        Maximum difference of the sides of a circle's ring, as a share of their mean.
    circle_corners
        Number of corners of the polygon, on the circle, that replaces a round inclusion fence.
    crop_corners
        Number of corners of the polygon around the circle of reach that obstacles are cut to.
    mitre_limit
        Maximum distance of a corner of a widened line from the line, in half widths.
    reversal_cosine
        Cosine of the angle between two consecutive segments from which a line counts as turning
        back: 0.5 stands for 60 degrees. The segments are widened apart, because a mitred buffer
        would end flat there.
    growth
        Distance by which occupied cells are grown before they are simplified, as a share of the
        tolerance; the remainder of the tolerance is room for the simplification.
    simplifications
        Tolerances of the simplification, as shares of the tolerance, the coarsest first. The first
        whose result holds all occupied cells and stays within the tolerance is used.
    """

    min_circle_corners: int = 16
    max_radius_spread: float = 2e-3
    max_step_spread: float = 0.1
    circle_corners: int = 64
    crop_corners: int = 64
    mitre_limit: float = 2.0
    reversal_cosine: float = 0.5
    growth: float = 0.55
    simplifications: tuple[float, ...] = (0.45, 0.3, 0.15, 0.0)

    def __post_init__(self) -> None:
        check_positive(self)
        if not all(0.0 <= share <= 1.0 for share in self.simplifications):
            raise InputError(
                f"simplifications: expected shares from 0 to 1, got {self.simplifications!r}"
            )


@dataclass(frozen=True)
class ImportPolicy:
    """Policy of an import. All numbers are positive.

    Attributes
    ----------
    read
        Limits of what is read from a file.
    outlines
        Rules for circles and outlines.
    carrier_distance
        Maximum distance of a chart's equipment (lights, signs) from the feature that carries it,
        degrees. The default is about a metre, the resolution of a chart.
    max_label_distance
        Maximum distance of a text of a drawing from the point, circle or block that it names, in
        heights of the text.
    max_label_length
        Maximum number of characters of a text that is taken as a name.
    max_pass_s
        Maximum hold of a waypoint that is passed, s, in missions that hold longer elsewhere. netsp
        and ArduSub hold bends for a second, because a vehicle flies through waypoints without hold.
    home_radius
        Maximum distance of a waypoint from home that counts as at home, m; files state centimetres.
    max_degrees_span
        Maximum extent of coordinates that are taken for degrees by mistake, as a share of the
        tether's length.
    max_base_shift
        Maximum distance of the given base from the file's base without a note, m: centimetres are
        written with seven decimal places of a degree.
    max_height_gap
        Maximum difference between a depth and the height of the same point without a note, m; files
        round heights to a centimetre.
    min_noted_share
        Minimum share of the tether's reach without chart or depth that a note reports; smaller
        shares may come from the rounding of areas.
    floor_cells
        Number of cells along the longer side of a sea floor for which no size of cells is given.
    max_listed_properties
        Maximum number of properties that a message lists.
    max_listed_goals
        Maximum number of goals out of reach with a message each; more share one message.
    max_reason_length
        Maximum number of characters of the property `why` of a feature that is left out.
    max_file_name_length
        Maximum number of characters of the file's name that a problem keeps.
    """

    read: ReadPolicy = ReadPolicy()
    outlines: OutlinePolicy = OutlinePolicy()
    carrier_distance: float = 1e-5
    max_label_distance: float = 4.0
    max_label_length: int = 60
    max_pass_s: float = 1.0
    home_radius: float = 0.1
    max_degrees_span: float = 0.01
    max_base_shift: float = 0.01
    max_height_gap: float = 0.005
    min_noted_share: float = 5e-4
    floor_cells: int = 256
    max_listed_properties: int = 20
    max_listed_goals: int = 5
    max_reason_length: int = 300
    max_file_name_length: int = 200

    def __post_init__(self) -> None:
        check_positive(self)


DEFAULT_READ = ReadPolicy()
"""Policy of readers to which none is given."""

DEFAULT_OUTLINES = OutlinePolicy()
"""Policy of outlines where none is given."""

DEFAULT_IMPORT = ImportPolicy()
"""Policy of imports to which none is given."""
