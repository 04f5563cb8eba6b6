"""Taut tethers for the page: to the cursor, along the tour, in all classes of a goal."""

from __future__ import annotations

from typing import Any

import numpy as np

from netsp.app.app_policy import AppPolicy
from netsp.base.arrays import Floats
from netsp.base.geometry import polylines
from netsp.hsignature import concatenate
from netsp.hsignature.rays import crossings
from netsp.model.problem import Problem
from netsp.roadmap.tether_classes import TautTether, Tethers


class Cursor:
    """Tethers of one version of a problem, for the page.

    Parameters
    ----------
    problem : Problem
        The version.
    path : array_like, shape (n, 3)
        Path of its tour; empty while there is none.
    policy : AppPolicy
        Number of classes that are shown.
    """

    def __init__(self, problem: Problem, path: Any = (), policy: AppPolicy = AppPolicy()) -> None:
        self.problem, self._policy = problem, policy
        self.tethers = Tethers(problem)
        self._path: Floats = np.array(path, dtype=float).reshape(-1, 3)
        self._along = polylines.along(self._path) if len(self._path) > 1 else np.zeros(0)

    def follow(self, path: Any) -> None:
        """Replace the tour by another."""
        self._path = np.array(path, dtype=float).reshape(-1, 3)
        self._along = polylines.along(self._path) if len(self._path) > 1 else np.zeros(0)

    @property
    def shares(self) -> Floats:
        """Shares of the tour's length up to each point of its path."""
        return self._along / self._along[-1] if len(self._along) else self._along

    def share_at(self, place: Floats) -> float:
        """Return the share of the tour's length at its point nearest to a place (3,)."""
        k = int(np.argmin(np.linalg.norm(self._path - place, axis=1)))
        return float(self.shares[k])

    def hover(self, x: float, y: float) -> dict[str, Any]:
        """Return the taut tether to a place, in the class it has when coming from the nearest point
        of the tour; without a tour, the shortest tether."""
        word = None
        if len(self._path) > 1:
            a, b = self._path[:-1, :2], self._path[1:, :2]
            step = b - a
            size = np.maximum((step**2).sum(1), 1e-300)
            shares = np.clip(((np.array([x, y]) - a) * step).sum(1) / size, 0.0, 1.0)
            nearest = a + shares[:, None] * step
            k = int(np.argmin(np.hypot(*(nearest - [x, y]).T)))
            path_to_cursor = np.vstack([self._path[: k + 1, :2], nearest[k], [x, y]])
            rays = self.problem.representative_points
            word = concatenate((), crossings(path_to_cursor, rays))
        tether = self.tethers.to(x, y, word)
        if tether is None and word is not None:
            tether = self.tethers.to(x, y)
        return {"x": x, "y": y} | (_shown_tether(tether) if tether else {"length": None})

    def classes(self, goal: int) -> dict[str, Any]:
        """Return the shortest classes of a goal, and the number of all."""
        x, y, z = self.problem.goals[goal].position
        tethers = self.tethers.classes(x, y, z)
        return {
            "classes": [_shown_tether(t) for t in tethers[: self._policy.max_drawn_classes]],
            "count": len(tethers),
        }

    def along(self, share: float) -> dict[str, Any]:
        """Return the tether in the class that the tour has at a share of its length."""
        if len(self._path) < 2:
            return {"length": None}
        position = min(max(share, 0.0), 1.0) * self._along[-1]
        k = min(int(np.searchsorted(self._along, position, side="right")) - 1, len(self._path) - 2)
        segment_length = self._along[k + 1] - self._along[k]
        fraction = (position - self._along[k]) / segment_length if segment_length else 0.0
        place = (1.0 - fraction) * self._path[k] + fraction * self._path[k + 1]
        walked = np.vstack([self._path[: k + 1], place])
        word = concatenate((), crossings(walked[:, :2], self.problem.representative_points))
        tether = self.tethers.to(float(place[0]), float(place[1]), word, float(place[2]))
        figures = {
            "x": float(place[0]),
            "y": float(place[1]),
            "z": float(place[2]),
            "share": share,
            "base_z": float(self.problem.base[2]),
        }
        return figures | (_shown_tether(tether) if tether else {"length": None})


def _shown_tether(tether: TautTether) -> dict[str, Any]:
    return {
        "length": tether.length,
        "word": list(tether.word),
        "path": [[float(x), float(y)] for x, y in tether.path[:, :2]],
    }
