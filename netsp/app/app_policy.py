"""Policy of the planning page: limits of what it takes, and how much it shows."""

from __future__ import annotations

from dataclasses import dataclass

from netsp.base.number_ranges import check_not_negative


@dataclass(frozen=True)
class AppPolicy:
    """Policy of the planning page and its server. All numbers are 0 or more.

    Attributes
    ----------
    max_drawn_classes
        Number of classes of a goal whose tethers are drawn, shortest first.
    max_drawn_points
        Number of points of a drawn path; a longer one is refused.
    order_limit_s
        Seconds to find the length of the best tour in a given order.
    tether_samples
        Number of places along the tour, besides its visits, at which the tether is measured.
    max_page_name
        Number of letters of the name by which a page signs its drawings.
    max_file_name, max_file_bytes
        Size of the name of a file and of the file, bytes; a larger one is refused.
    max_message_bytes
        Size of one message from a page, bytes; the server ends the connection at a larger one.
    tour_interval_s
        Seconds between two better tours that are sent while the solver works.
    shown_frames
        Approximate number of moments of a run that is looked at.
    max_versions
        Number of versions of a document that can be undone.
    """

    max_drawn_classes: int = 30
    max_drawn_points: int = 5000
    order_limit_s: float = 20.0
    tether_samples: int = 120
    max_page_name: int = 40
    max_file_name: int = 200
    max_file_bytes: int = 64 * 2**20
    max_message_bytes: int = 4 * 2**20
    tour_interval_s: float = 0.15
    shown_frames: int = 240
    max_versions: int = 10_000

    def __post_init__(self) -> None:
        check_not_negative(self)
