"""Homotopy classes of the tether during a flight: at each visit, and at home."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from netsp.base.errors import InputError
from netsp.hsignature import Word
from netsp.plan.space.planning_context import PlanningContext
from netsp.world.mission.planned_tour import PlannedTour
from netsp.world.mission.run_log import Run
from netsp.world.scene.field import DistanceField
from netsp.world.scene.scene import Scene


@dataclass(frozen=True)
class FlownWords:
    """Words of the tether during a flight, by the scene of its mission.

    Attributes
    ----------
    visits
        Number of each waypoint that was visited, and the word of the tether there; None if there is
        none, as when the robot went where the map has a solid.
    home
        Word of the tether at the end, closed along the path from the start to the anchor; empty if
        the tether was left free.
    exact
        Whether words that differ are always of different classes.
    planned
        Words at the visits of the mission's tour, if it has one, in the same scene.
    """

    visits: tuple[tuple[int, Word | None], ...]
    home: Word | None
    exact: bool
    planned: tuple[Word | None, ...] = ()

    @property
    def is_complete(self) -> bool:
        """Return whether the words at all visits and at home are known."""
        return self.home is not None and all(word is not None for _, word in self.visits)

    @property
    def as_planned(self) -> int:
        """Return the number of visits in the class that the tour has there."""
        return sum(self._is_as_planned(k, word) for k, word in self.visits)

    def _is_as_planned(self, k: int, word: Word | None) -> bool:
        """Return whether a waypoint was visited in the class that the tour has there."""
        return k < len(self.planned) and word is not None and self.planned[k] == word

    def to_summary(self) -> dict[str, Any]:
        """Return the words for the summary of a run."""
        return {
            "exact": self.exact,
            "stops": [
                {
                    "waypoint": k,
                    "signature": None if word is None else list(word),
                    **(
                        {"as_planned": self._is_as_planned(k, word)}
                        if k < len(self.planned)
                        else {}
                    ),
                }
                for k, word in self.visits
            ],
            "home": None if self.home is None else list(self.home),
            "as_planned": self.as_planned if self.planned else None,
        }


def words_of_flight(
    run: Run, *, scene: Scene | None = None, field: DistanceField | None = None
) -> FlownWords:
    """Return the words of the tether during a flight.

    The tether and the robot's path are of one class, so the path gives the word.

    Parameters
    ----------
    run : Run
        The flight, with a fixed anchor. Words are by the map that it began with; if that has solids
        on the robot's path, by the scene as it was at the end.
    scene, field : Scene, DistanceField, optional
        Scene of the mission and its field; loaded and computed if needed.

    Raises
    ------
    InputError
        A moving anchor, or as `netsp.plan.space.space_signature.SpaceSignature.in_box`.
    """
    mission = run.mission
    if mission.track:
        raise InputError(
            "track: the words of a tether on a moving anchor are not known; "
            "expected a mission without a track"
        )
    scene = scene or mission.load_scene()
    words = _words_in_scene(
        run, PlanningContext.for_mission(mission, scene, field or scene.field())
    )
    if run.scene is None or words.is_complete:
        return words
    # if the map was wrong, the robot's path may lead through its solids
    at_end = _words_in_scene(
        run, PlanningContext.for_mission(mission, run.scene, run.scene.field())
    )
    return at_end if at_end.is_complete else words


def _words_in_scene(run: Run, context: PlanningContext) -> FlownWords:
    """Return the words of a flight in a scene."""
    mission, words = run.mission, context.words
    start_line, begin = context.start_tether.nodes, context.present_tether.nodes
    places = np.vstack([begin, np.array([[r.x, r.y, r.z] for r in run.log])])
    next_waypoint = np.array([r.waypoint for r in run.log])
    visits = []
    for stop in run.summary["stops"]:
        k = int(stop["waypoint"])
        end = len(begin) + int(np.argmax(next_waypoint > k))
        # append the waypoint itself, because only words of paths with the same ends compare
        word, broken = words.try_word(np.vstack([places[: end + 1], mission.places[k]]))
        visits.append((k, None if broken is not None else word))
    word, broken = words.try_word(np.vstack([places, start_line[::-1]]))
    planned = () if mission.tour is None else _planned_words(mission.tour, context)
    return FlownWords(tuple(visits), None if broken is not None else word, words.exact, planned)


def _planned_words(tour: PlannedTour, context: PlanningContext) -> tuple[Word | None, ...]:
    """Return the words at the visits of a tour in a scene, whose letters may differ from those of
    the tour's map."""
    walked, words = context.present_tether.nodes, list[Word | None]()
    for stop, place in zip(tour.stops, context.mission.places, strict=False):
        walked = np.vstack([walked, np.array(stop.path)])
        word, broken = context.words.try_word(np.vstack([walked, place]))
        words.append(None if broken is not None else word)
    return tuple(words)
