"""Layouts of pictures, films and pages: sizes, and how much is named or drawn."""

from __future__ import annotations

from dataclasses import dataclass

from netsp.base.number_ranges import check_not_negative, check_positive


@dataclass(frozen=True)
class FilmLayout:
    """Layout of films. All numbers are positive.

    Attributes
    ----------
    panel_width, max_panel_height
        Width of a panel, and maximum height of a panel in space, inches.
    dpi
        Resolution, pixels per inch.
    legend_height
        Height of one line of the legend below the panels, inches.
    legend_columns
        Number of marks in one line of the legend, for each panel.
    title_letters
        Maximum number of letters in a line of a panel's title.
    hold_s
        Time for which the last picture is shown, s.
    gif_colours
        Number of colours of a GIF: the few colours of pictures, and shades for the edges of lines.
    """

    panel_width: float = 6.4
    max_panel_height: float = 5.6
    dpi: int = 100
    legend_height: float = 0.25
    legend_columns: int = 5
    title_letters: int = 62
    hold_s: float = 1.5
    gif_colours: int = 64

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class PageLayout:
    """Layout of pages with a slider. All numbers are positive.

    Attributes
    ----------
    frames
        Number of moments on the slider of a page in space.
    plane_frames
        Number of positions of the slider of a page in the plane.
    duration_ms
        Duration of the film when it plays, ms.
    title_letters
        Maximum number of letters in a line of the title.
    path_points
        Approximate maximum number of points that draw the path so far.
    min_deviation
        Smallest deviation of a line that is drawn, as a share of the size of the picture.
    digits
        Number of decimals of coordinates.
    """

    frames: int = 120
    plane_frames: int = 240
    duration_ms: int = 12_000
    title_letters: int = 150
    path_points: int = 400
    min_deviation: float = 1e-3
    digits: int = 3

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class LabelLayout:
    """Layout of labels beside markers. All numbers are positive.

    Attributes
    ----------
    font_size
        Font size, points.
    letter_width
        Mean width of a letter as a share of the font size; slightly more than that of digits.
    line_height
        Height of a line as a share of the font size.
    gap
        Distance from the middle of a marker to the near end of a label beside it, points.
    rise
        Distance from the middle of a marker up or down to the middle of a label, points.
    sides
        Directions from a marker to its label, the preferred first.
    """

    font_size: float = 6.0
    letter_width: float = 0.62
    line_height: float = 1.25
    gap: float = 8.0
    rise: float = 7.8
    sides: tuple[tuple[int, int], ...] = (
        *((1, -1), (1, 0), (1, 1), (0, -1)),
        *((0, 1), (-1, -1), (-1, 0), (-1, 1)),
    )

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class MapLayout:
    """Layout of maps and curves of the plane. All numbers are 0 or more.

    Attributes
    ----------
    max_named
        Maximum number of goals, and of obstacles, with names; more names would overlap.
    min_circle
        Minimum radius of a circle whose name is written in it, as a share of the map.
    hidden_rim
        Distance from an obstacle's outline within which outlines of omitted features are not drawn,
        as a share of the width of the picture.
    full_strength_edges
        Number of edges of a roadmap above which they are drawn fainter.
    row_height
        Height of the row of one path, with a map and a curve side by side, inches.
    title_letters
        Number of letters of the title that fit the width of the picture.
    max_steps
        Maximum number of steps of a curve with labels.
    max_places
        Maximum number of candidate places with names.
    contours
        Number of contours.
    """

    max_named: int = 40
    min_circle: float = 0.012
    hidden_rim: float = 0.002
    full_strength_edges: float = 1000.0
    row_height: float = 4.6
    title_letters: int = 150
    max_steps: int = 12
    max_places: int = 24
    contours: int = 12

    def __post_init__(self) -> None:
        check_not_negative(self)


@dataclass(frozen=True)
class SpaceLayout:
    """Layout of pictures of scenes. All numbers are 0 or more.

    Attributes
    ----------
    tall_ratio
        Minimum ratio of height to width of a scene whose side views are drawn side by side.
    tick_spacing
        Minimum distance of two ticks with numbers, inches.
    max_numbered
        Maximum number of waypoints whose numbers are drawn.
    heading_length
        Length of the lines that show the heading of the camera, metres.
    max_patches
        Approximate maximum number of patches of a surface that are drawn.
    """

    tall_ratio: float = 1.5
    tick_spacing: float = 0.45
    max_numbered: int = 30
    heading_length: float = 0.5
    max_patches: int = 6000

    def __post_init__(self) -> None:
        check_not_negative(self)
