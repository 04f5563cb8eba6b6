"""In which classes a tether was on a flight: at each stop, and at home."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from netsp.base.errors import InputError
from netsp.hsignature import Word
from netsp.plan.space.planning_context import Water
from netsp.world.mission.planned_tour import PlannedTour
from netsp.world.mission.run_log import Run
from netsp.world.scene.field import DistanceField
from netsp.world.scene.scene import Scene


@dataclass(frozen=True)
class FlownWords:
    """Words of a flight, by the scene of its mission.

    Parameters
    ----------
    stops : tuple of (int, Word or None)
        Waypoint that was visited, and the word of the tether there; None where there is none, as
        when the robot went where the map has a solid.
    home : Word or None
        Of the tether at the end, closed along the way from the start to the anchor; empty where it
        was left free.
    exact : bool
        Whether words that differ are of different classes.
    planned : tuple of (Word or None)
        Of the mission's tour, if it has one, in the same scene.
    """

    stops: tuple[tuple[int, Word | None], ...]
    home: Word | None
    exact: bool
    planned: tuple[Word | None, ...] = ()

    @property
    def complete(self) -> bool:
        """Whether every word could be told."""
        return self.home is not None and all(word is not None for _, word in self.stops)

    @property
    def as_planned(self) -> int:
        """How many stops were made in the class that the tour has there."""
        return sum(self._is_as_planned(k, word) for k, word in self.stops)

    def _is_as_planned(self, k: int, word: Word | None) -> bool:
        return k < len(self.planned) and word is not None and self.planned[k] == word

    def told(self) -> dict[str, Any]:
        """For the summary of a run.

        Returns
        -------
        dict
            The words by name.
        """
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
                for k, word in self.stops
            ],
            "home": None if self.home is None else list(self.home),
            "as_planned": self.as_planned if self.planned else None,
        }


def words_of_flight(
    run: Run, *, scene: Scene | None = None, field: DistanceField | None = None
) -> FlownWords:
    """The words of a flight.

    The tether and the robot's path are of one class, so that the path tells the word.

    Parameters
    ----------
    run : Run
        The flight; its anchor stays where it is. Words are by the map that it began with; where
        that has solids on the way, by the scene as it was at the end.
    scene : Scene, optional
        Of the mission, when it is at hand.
    field : DistanceField, optional
        The field of that scene, when it is at hand.

    Returns
    -------
    FlownWords
        The words.

    Raises
    ------
    InputError
        A moving anchor; as of `netsp.plan.space.space_signature.SpaceSignature.of`.
    """
    mission = run.mission
    if mission.track:
        raise InputError("track: of a moving anchor no words are told; expected a mission without")
    scene = scene or mission.load_scene()
    told = _by(run, Water.of(mission, scene, field or scene.field()))
    if run.scene is None or told.complete:
        return told
    # where the map was wrong, the way may lead through what it shows
    by_the_end = _by(run, Water.of(mission, run.scene, run.scene.field()))
    return by_the_end if by_the_end.complete else told


def _by(run: Run, water: Water) -> FlownWords:
    """The words of a flight in some scene."""
    mission, words = run.mission, water.words
    laid, begin = water.laid.nodes, water.present.nodes
    places = np.vstack([begin, np.array([[r.x, r.y, r.z] for r in run.log])])
    next_one = np.array([r.waypoint for r in run.log])
    stops = []
    for stop in run.summary["stops"]:
        k = int(stop["waypoint"])
        end = len(begin) + int(np.argmax(next_one > k))
        # on to the waypoint itself: words of paths compare only where these end at the same place
        word, broken = words.word_until(np.vstack([places[: end + 1], mission.places[k]]))
        stops.append((k, None if broken is not None else word))
    word, broken = words.word_until(np.vstack([places, laid[::-1]]))
    planned = () if mission.tour is None else _of_tour(mission.tour, water)
    return FlownWords(tuple(stops), None if broken is not None else word, words.exact, planned)


def _of_tour(tour: PlannedTour, water: Water) -> tuple[Word | None, ...]:
    """Words at the stops of a tour, whose own letters may be those of another map."""
    walked, out = water.present.nodes, list[Word | None]()
    for stop, place in zip(tour.stops, water.mission.places, strict=False):
        walked = np.vstack([walked, np.array(stop.path)])
        word, broken = water.words.word_until(np.vstack([walked, place]))
        out.append(None if broken is not None else word)
    return tuple(out)
