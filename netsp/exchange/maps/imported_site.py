"""Problem of a map, with what was left out of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from netsp.exchange.maps.feature import Feature
from netsp.exchange.maps.sea_floor import SeaFloor
from netsp.model.problem import Problem

if TYPE_CHECKING:
    import shapely


@dataclass(frozen=True)
class ImportedSite:
    """Problem of a map, with what was left out of it.

    Attributes
    ----------
    problem
        The problem; its `site` records the use of every feature.
    left_out
        Shapes of the features left out, in the problem's plane, for the picture.
    notes
        Assumptions, changes and omissions, one line each.
    viewpoints
        Names of the goals that are viewpoints of obstacles.
    floor
        Sea floor, if one was asked for.
    goal_features
        Feature of each goal of the problem; None for viewpoints.
    """

    problem: Problem
    left_out: tuple[shapely.Geometry, ...]
    notes: tuple[str, ...]
    viewpoints: frozenset[str] = frozenset()
    floor: SeaFloor | None = None
    goal_features: tuple[Feature | None, ...] = ()

    def keeping(self, problem: Problem, reason: str) -> ImportedSite:
        """Return the import with fewer goals; features without a remaining goal count as left out.

        Parameters
        ----------
        problem : Problem
            The same problem with some of its goals, in their order.
        reason : str
            Reason to leave out the others.
        """
        import shapely

        kept, staying, omitted = 0, set(), {}
        shapes: list[shapely.Geometry] = []
        for goal, feature in zip(self.problem.goals, self.goal_features, strict=True):
            remaining = problem.goals[kept] if kept < len(problem.goals) else None
            if remaining is not None and (remaining.name, remaining.position[:2]) == (
                goal.name,
                goal.position[:2],
            ):
                kept += 1
                staying.add("" if feature is None else feature.where)
                continue
            shapes.append(shapely.Point(goal.position[:2]))
            if feature is not None:
                omitted[feature.where] = feature.layer
        assert problem.site is not None
        layers = tuple(
            layer.without_goals(
                [w for w in omitted if w not in staying and omitted[w] == layer.layer], reason
            )
            for layer in problem.site.imported
        )
        site = problem.site.model_copy(update={"imported": layers})
        problem = problem.model_copy(update={"site": site})
        return replace(self, problem=problem, left_out=(*self.left_out, *shapes))
