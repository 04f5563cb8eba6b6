"""Policy of commands: when progress is shown, and how much of it."""

from __future__ import annotations

from dataclasses import dataclass

from netsp.base.number_ranges import check_positive


@dataclass(frozen=True)
class CommandPolicy:
    """Policy of commands. All numbers are positive.

    Attributes
    ----------
    silence_s
        Time of silence before the step at work is named, s.
    line_interval_s
        Time between two lines about one step if the output is not a terminal, s.
    redraw_interval_s
        Time between two drawings of one line of a terminal, s.
    row_interval_s
        Time between two rows of a table that show only a better bound, s.
    trial_interval_s
        Time between two lines about trials if the output is not a terminal, s.
    max_complaints
        Maximum number of lines about one input; further complaints are counted.
    max_named_legs, max_named_waypoints
        Maximum number of legs and of waypoints that a summary names; further ones are counted.
    mission_time_limit_s
        Default time limit for missions, s.
    max_worlds
        Maximum number of random worlds that are drawn for one seed.
    max_films, max_film_s, max_fps
        Maximum number of runs in one film, its maximum duration, s, and frames per second.
    garbage_threshold
        Number of new objects between two garbage collections; the garbage among 100,000 takes
        about 20 MB at most.
    abandoned_grace_s
        Time for abandoned work to end by itself, and to end the processes that it started, s.
    """

    silence_s: float = 3.0
    line_interval_s: float = 5.0
    redraw_interval_s: float = 0.1
    row_interval_s: float = 0.2
    trial_interval_s: float = 10.0
    max_complaints: int = 20
    max_named_legs: int = 3
    max_named_waypoints: int = 16
    mission_time_limit_s: float = 60.0
    max_worlds: int = 50
    max_films: int = 3
    max_film_s: int = 600
    max_fps: int = 60
    garbage_threshold: int = 100_000
    abandoned_grace_s: float = 0.5

    def __post_init__(self) -> None:
        check_positive(self)
