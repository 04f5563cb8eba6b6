"""Detours of a path around obstacles and bounds, so that its homotopy class is defined.

A recorded or drawn path may cut a corner of an obstacle, come closer than the clearance or leave
the bounds. Each such part is reported, and replaced by a part of the outline of free space with the
same ends. Two parts of the outline have these ends. The one that passes the other obstacles on the
same side as the path is chosen; if both do, the shorter one.

Free space is that of the judge (`netsp.judge.solid_distances`), in which obstacles are smaller by a
tolerance, so a path that only touches an obstacle does not change.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.base.geometry import polylines
from netsp.base.geometry.polygons import box_around
from netsp.base.number_ranges import check_positive, check_shares
from netsp.hsignature.signature_measures import winding_numbers
from netsp.judge.passage import passes
from netsp.judge.solid_distances import bridges
from netsp.judge.stringpull import StringPuller
from netsp.judge.tour_checks import CONTACT_REACH
from netsp.model.problem import Circle, Polygon

SAME_PLACE_TOLERANCE = 1e-9
"""Tolerance for two places on a path that count as one, in segments."""


@dataclass(frozen=True)
class FreeRoutePolicy:
    """Policy of detours around the obstacles that a path enters.

    Attributes
    ----------
    inset_share
        Distance of the outline from the judge's insets, as a share of the distance of the true
        outline. With a share between 0 and 1, a path along the outline clears the insets, and a
        path along the true outline does not change.
    depth_samples
        Number of places, in addition to corners, at which the depth of a part is measured.
    box_ratio
        Margin of the box around all points and obstacles if there are no bounds, as a multiple of
        the reach of the path; at most 2, because the judge triangulates that far.
    """

    inset_share: float = 0.25
    depth_samples: int = 64
    box_ratio: float = 1.5

    def __post_init__(self) -> None:
        check_positive(self)
        check_shares(self, "inset_share")
        if self.box_ratio > 2.0:
            raise InputError(f"box_ratio: expected at most 2, got {self.box_ratio:g}")


@dataclass(frozen=True)
class Stretch:
    """Part of a path in an obstacle, within its clearance, or out of bounds.

    Parameters
    ----------
    kind : str
        "obstacle", "clearance", "bounds" or "touching" (between obstacles that touch).
    obstacles : tuple of int
        Indices of the obstacles; empty for the bounds.
    start, end : float
        Lengths along the path in plan, in the problem's units.
    depth : float
        Largest depth of the part, in the problem's units.
    place : (float, float)
        Point at which the part begins.
    """

    kind: str
    obstacles: tuple[int, ...]
    start: float
    end: float
    depth: float
    place: tuple[float, float]


@dataclass(frozen=True)
class FreeLoop:
    """Path with detours around all obstacles.

    Parameters
    ----------
    xy : ndarray, shape (n, 2)
        Points of the loop, in the problem's frame.
    along : ndarray, shape (n,)
        Length along the given path at each point.
    shut_in : float
        Length along the given path at which free space ends: no free path leads to the rest.
        Infinite if all of the path can be reached.
    """

    xy: Floats
    along: Floats
    shut_in: float


class FreeSpace:
    """Part of the plane in which a tether can lie.

    Parameters
    ----------
    puller : StringPuller
        String puller of the judge.
    reach : float
        Largest distance of the path from the base, in the problem's units.
    policy : FreeRoutePolicy
        Distances from obstacles, and accuracy of depths.
    """

    def __init__(
        self, puller: StringPuller, reach: float, policy: FreeRoutePolicy = FreeRoutePolicy()
    ) -> None:
        problem, self._policy = puller.problem, policy
        self.problem, self.origin, self.place = problem, puller.origin, puller.place
        shapes = [
            s.shape.buffer(policy.inset_share * s.depth, join_style="mitre") if s.depth else s.shape
            for s in puller.solids
        ]
        self._bridges = bridges(problem, puller.solids, self.origin, self.place)
        shapes += [
            shapely.LineString(bridge.line).buffer(policy.inset_share * self.place)
            for bridge in self._bridges
        ]
        if problem.bounds is not None:
            box = shapely.box(*(np.array(problem.bounds) - np.tile(self.origin, 2)))
        else:
            every = [shapely.MultiPoint(problem.points[:, :2] - self.origin), *shapes]
            box = box_around(every, policy.box_ratio * max(reach, problem.scale))
        self.shape = box.difference(shapely.union_all(shapes)) if shapes else box
        shapely.prepare(self.shape)
        parts = shapely.get_parts(self.shape)
        self._rings = [ring for p in parts for ring in (p.exterior, *p.interiors)]

    def sees(self, a: Floats, b: Floats) -> bool:
        """Return whether the straight line between two places is free."""
        if np.array_equal(a, b):
            return True
        return bool(shapely.covers(self.shape, shapely.LineString([a, b] - self.origin)))

    def free_loop(self, xy: Floats, along: Floats) -> FreeLoop:
        """Return a path with detours around all obstacles.

        Parameters
        ----------
        xy : ndarray, shape (n, 2)
            Points of the path; consecutive points differ.
        along : ndarray, shape (n,)
            Length along the path at each point.

        Returns
        -------
        FreeLoop
            The path with every part outside of free space replaced.
        """
        line = xy - self.origin
        shut_in = np.inf
        points, lengths = [xy[:1]], [along[:1]]
        done = 0.0  # place on the path, in segments
        for start, end in self._outside(line):
            inner = np.arange(int(np.floor(done)) + 1, int(np.ceil(start - SAME_PLACE_TOLERANCE)))
            points.append(xy[inner])
            lengths.append(along[inner])
            s = np.array([_at(along, start), _at(along, end)])
            detour = self._round(_part(line, start, end))
            if detour is None:
                shut_in = min(shut_in, float(s[0]))
                detour = _part(line, start, end)
            share = polylines.along(detour)
            share = share / share[-1] if share[-1] else np.linspace(0.0, 1.0, len(detour))
            if start <= 0.0:
                points[0], lengths[0] = detour[:0], along[:0]
            points.append(detour + self.origin)
            lengths.append(s[0] + share * (s[1] - s[0]))
            done = end
        inner = np.arange(int(np.floor(done + SAME_PLACE_TOLERANCE)) + 1, len(line))
        points.append(xy[inner])
        lengths.append(along[inner])
        out, s_out = np.vstack(points), np.concatenate(lengths)
        keep = np.concatenate([[True], np.any(np.diff(out, axis=0) != 0.0, axis=1)])
        return FreeLoop(out[keep], s_out[keep], shut_in)

    def _outside(self, line: Floats) -> list[tuple[float, float]]:
        """Return the parts outside of free space, each as a range of places in segments."""
        if len(line) < 2:
            return []
        segments = shapely.linestrings(np.stack([line[:-1], line[1:]], axis=1))
        parts = [
            part
            for k in np.flatnonzero(~shapely.covers(self.shape, segments)).tolist()
            for part in _shares(line, k, segments[k].difference(self.shape))
        ]
        return _merged(parts)

    def _round(self, part: Floats) -> Floats | None:
        """Return the part of the outline that replaces a part of the path; None if its ends lie on
        different outlines."""
        ends = [shapely.Point(p) for p in part[[0, -1]]]
        near = [[ring.distance(p) for ring in self._rings] for p in ends]
        which = [int(np.argmin(d)) for d in near]
        if which[0] != which[1]:
            return None
        ring = self._rings[which[0]]
        a, b = (float(ring.project(p)) for p in ends)
        forward = _along_ring(ring, a, b)
        backward = _along_ring(ring, b, a)[::-1]
        pierced = set(self._pierced(part))
        others = [i for i in range(len(self.problem.obstacles)) if i not in pierced]
        rays = self.problem.representative_points[others].reshape(-1, 2) - self.origin

        def rank(detour: Floats) -> tuple[int, int, float, float]:
            """Return a sort key for a part of the outline; ties are broken in the same way for a
            path and its reverse."""
            turns = winding_numbers(np.vstack([part, detour[::-1], part[:1]]), rays)
            middle = shapely.LineString(detour).centroid
            return (
                int(np.count_nonzero(np.round(turns))),
                round(polylines.length(detour) / self.place),
                middle.x,
                middle.y,
            )

        return min((forward, backward), key=rank)

    def _pierced(self, part: Floats) -> list[int]:
        """Return the obstacles that a part of a path runs through."""
        line = shapely.LineString(part + self.origin)
        return [
            i
            for i, o in enumerate(self.problem.obstacles)
            if line.intersection(o.shape()).length > self.place
        ]

    def stretches(self, xy: Floats, along: Floats) -> tuple[Stretch, ...]:
        """Return the parts of a path in obstacles, within their clearance and out of bounds.

        Parameters
        ----------
        xy : ndarray, shape (n, 2)
            The path.
        along : ndarray, shape (n,)
            Length along the path at each point.

        Returns
        -------
        tuple of Stretch
            Parts deeper than the judge's tolerance, in their order along the path.
        """
        if len(xy) < 2:
            return ()
        found: list[Stretch] = []
        segments = shapely.linestrings(np.stack([xy[:-1], xy[1:]], axis=1))
        tree = shapely.STRtree(segments)
        clearance = self.problem.clearance
        for i, o in enumerate(self.problem.obstacles):
            shape = o.shape()
            grown = shape.buffer(clearance) if clearance > self.place else shape
            hits = np.sort(tree.query(grown, predicate="intersects"))
            if not len(hits):
                continue
            inside = _merged(
                [part for k in hits.tolist() for part in _shares(xy, k, segments[k] & shape)]
            )
            depths = [_depth(_part(xy, *part), o, self._policy.depth_samples) for part in inside]
            deep = [
                (part, depth)
                for part, depth in zip(inside, depths, strict=True)
                if depth > self.place
            ]
            found += [_stretch("obstacle", (i,), xy, along, p, d) for p, d in deep]
            if deep or clearance <= self.place:
                continue
            close = _merged(
                [part for k in hits.tolist() for part in _shares(xy, k, segments[k] & grown)]
            )
            for part in close:
                line = _part(xy, *part)
                lack = clearance - float(shapely.LineString(line).distance(shape))
                if lack > max(self.place, 1e-3 * clearance):
                    found.append(_stretch("clearance", (i,), xy, along, part, lack))
        found += self._beyond_bounds(xy, along, segments)
        found += self._between_touching(xy, along)
        return tuple(sorted(found, key=lambda s: (s.start, s.obstacles)))

    def _beyond_bounds(
        self, xy: Floats, along: Floats, segments: Sequence[shapely.Geometry]
    ) -> list[Stretch]:
        if self.problem.bounds is None:
            return []
        bounds = np.array(self.problem.bounds)
        box = shapely.box(*bounds)
        shapely.prepare(box)
        parts = _merged(
            [
                part
                for k in np.flatnonzero(~shapely.covers(box, segments)).tolist()
                for part in _shares(xy, k, segments[k] - box)
            ]
        )
        out = []
        for part in parts:
            line = _part(xy, *part)
            away = float(max((bounds[:2] - line).max(), (line - bounds[2:]).max()))
            if away > self.place:
                out.append(_stretch("bounds", (), xy, along, part, away))
        return out

    def _between_touching(self, xy: Floats, along: Floats) -> list[Stretch]:
        """Return the places where a path runs between obstacles that touch."""
        out = []
        path = xy - self.origin
        line = shapely.LineString(path)
        for bridge in self._bridges:
            gate = shapely.LineString(bridge.line)
            near = line.dwithin(gate, self.place)
            if not near or not passes(bridge, path, CONTACT_REACH * self.place):
                continue
            at = shapely.Point(bridge.contact)
            s = float(np.interp(line.project(at), polylines.along(xy), along))
            x, y = (bridge.contact + self.origin).tolist()
            out.append(Stretch("touching", (bridge.first, bridge.second), s, s, 0.0, (x, y)))
        return out


def _shares(line: Floats, k: int, part: shapely.Geometry) -> list[tuple[float, float]]:
    """Return the pieces of segment k as ranges of places on the path, in segments."""
    step = line[k + 1] - line[k]
    size = float(step @ step)
    out = []
    for piece in shapely.get_parts(part):
        ends = shapely.get_coordinates(piece)
        if len(ends) < 2 or not size:
            continue
        share = np.clip((ends[[0, -1], :2] - line[k]) @ step / size, 0.0, 1.0)
        if abs(share[1] - share[0]) > SAME_PLACE_TOLERANCE:
            out.append((k + float(share.min()), k + float(share.max())))
    return out


def _merged(parts: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return parts with those joined that follow each other without a gap."""
    out: list[tuple[float, float]] = []
    for start, end in sorted(parts):
        if out and start <= out[-1][1] + SAME_PLACE_TOLERANCE:
            out[-1] = (out[-1][0], max(out[-1][1], end))
        else:
            out.append((start, end))
    return out


def _at(values: Floats, place: float) -> float:
    """Return the value at a place of a path, in segments, by interpolation between its points."""
    return float(np.interp(place, np.arange(len(values)), values))


def _part(line: Floats, start: float, end: float) -> Floats:
    """Return the points of the part of a path between two places, in segments."""
    inner = line[int(np.floor(start)) + 1 : int(np.ceil(end))]
    ends = [[_at(line[:, k], place) for k in range(2)] for place in (start, end)]
    return np.vstack([ends[:1], inner, ends[1:]])


def _along_ring(ring: shapely.LinearRing, a: float, b: float) -> Floats:
    """Return the part of a ring from length a along it to length b, in its direction."""
    corners = shapely.get_coordinates(ring)
    s = polylines.along(corners)
    ends = [shapely.get_coordinates(ring.interpolate(v)) for v in (a, b)]
    if a <= b:
        inner = corners[(s > a) & (s < b)]
    else:
        inner = np.vstack([corners[(s > a) & (s < s[-1])], corners[(s >= 0.0) & (s < b)]])
    return np.vstack([ends[0], inner, ends[1]])


def _depth(part: Floats, obstacle: Circle | Polygon, samples: int) -> float:
    """Return the largest depth of a part of a path in an obstacle."""
    every = polylines.points_along(part, max(polylines.length(part) / samples, 1e-300))
    return float(-np.min(obstacle.signed_distance(np.vstack([part, every]))))


def _stretch(
    kind: str,
    obstacles: tuple[int, ...],
    xy: Floats,
    along: Floats,
    part: tuple[float, float],
    depth: float,
) -> Stretch:
    s = [_at(along, place) for place in part]
    place = (_at(xy[:, 0], part[0]), _at(xy[:, 1], part[0]))
    return Stretch(kind, obstacles, s[0], s[1], depth, place)
