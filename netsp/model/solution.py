"""Solution of a problem, with its proof status. The JSON format is version 1."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import ConfigDict, Field, model_validator

from netsp.base.data_frames import frame_of
from netsp.base.field_types import LARGEST, Name, NonNegative, Number, PathPoint, Total
from netsp.base.files import FileModel
from netsp.base.reprs import Drawn
from netsp.base.validated import Model
from netsp.model.bound_scope import LowerBound, Scope, above_shortest

if TYPE_CHECKING:
    import pandas


class Status(StrEnum):
    """Outcome of a solver, and what is proven about its tour.

    Attributes
    ----------
    OPTIMAL
        Proven the shortest of all admissible tours of the continuous world, or, if the order was
        given, of all tours in that order. If a travel graph was solved without a world, the
        shortest of its tours.
    OPTIMAL_OF_KEPT
        Shortest tour over the homotopy classes that the roadmap kept. It left out others: there
        were too many, the time was too short, or a rule excluded them.
    OPTIMAL_OF_ROADMAP
        Shortest tour along a sampled roadmap (PRM*) or the roadmap of a plug-in. Shorter tours may
        exist off the roadmap.
    OPTIMAL_OF_STATES
        Shortest tour in space over the known states of the tether and the legs found between them.
        Shorter tours may exist through other states.
    FEASIBLE
        Tour that is not proven the shortest.
    INFEASIBLE
        Proof that there is no tour.
    NO_SOLUTION_FOUND
        No tour: a limit was reached before one was found.
    INVALID
        Tour of a baseline that ignores the tether: it entangles obstacles or overstretches the
        tether.

    Examples
    --------
    >>> Status("optimal_of_kept").is_optimal, Status.FEASIBLE.is_optimal
    (True, False)
    >>> Status.OPTIMAL_OF_KEPT.verdict
    'shortest over the classes kept, which are not all'
    """

    OPTIMAL = "optimal"
    OPTIMAL_OF_KEPT = "optimal_of_kept"
    OPTIMAL_OF_ROADMAP = "optimal_of_roadmap"
    OPTIMAL_OF_STATES = "optimal_of_states"
    FEASIBLE = "feasible"
    INFEASIBLE = "infeasible"
    NO_SOLUTION_FOUND = "no_solution_found"
    INVALID = "invalid"

    @property
    def is_optimal(self) -> bool:
        """True if the tour is proven the shortest of the set of tours that the status names."""
        return self.value.startswith("optimal")

    @property
    def verdict(self) -> str:
        """Phrase that says among which tours an optimal tour is the shortest."""
        return _VERDICTS.get(self, self.value)

    @classmethod
    def optimal_of(cls, scope: Scope) -> Status:
        """Return the status of a tour that is the shortest of a scope.

        It is `OPTIMAL` for all tours, all tours in a given order, and all of a given travel graph.
        """
        return _OPTIMAL_OF.get(scope, cls.OPTIMAL)


_OPTIMAL_OF = {
    Scope.KEPT_CLASSES: Status.OPTIMAL_OF_KEPT,
    Scope.KEPT_IN_ORDER: Status.OPTIMAL_OF_KEPT,
    Scope.PART: Status.OPTIMAL_OF_KEPT,
    Scope.ROADMAP: Status.OPTIMAL_OF_ROADMAP,
    Scope.ROADMAP_IN_ORDER: Status.OPTIMAL_OF_ROADMAP,
    Scope.STATES: Status.OPTIMAL_OF_STATES,
    Scope.STATES_IN_ORDER: Status.OPTIMAL_OF_STATES,
}

_VERDICTS = {
    Status.OPTIMAL: "proven shortest by this solver",
    Status.OPTIMAL_OF_KEPT: "shortest over the classes kept, which are not all",
    Status.OPTIMAL_OF_ROADMAP: "shortest along this roadmap, not of all tours",
    Status.OPTIMAL_OF_STATES: "shortest between the states found, not of all tours",
}


KeptClasses = Literal["all", "non-looping", "shortest"]
"""Homotopy classes that a roadmap kept."""


def max_turning(friction: float, max_tension_ratio: float | None) -> float:
    """Return the largest angle by which a tether may turn around obstacles, radians.

    It follows from the capstan equation.

    Parameters
    ----------
    friction : float
        Coefficient of friction, at least 0.
    max_tension_ratio : float, optional
        Largest factor by which friction may raise the tension; None for no limit, which gives an
        infinite angle.
    """
    if max_tension_ratio is None or friction == 0.0:
        return math.inf
    return math.log(max_tension_ratio) / friction


MAX_FRICTION = 10.0
"""Format limit of solution files and arguments: coefficient of friction of tether on obstacle. It
was chosen well above what occurs, 0.1 to 1, and is in the published schema."""


def tension_ratio(friction: float, turning: float) -> float:
    """Return the factor by which friction raises the tension of a tether, by the capstan equation.

    It is e^(friction · turning), but at most 1e12, at which no tether moves.

    Parameters
    ----------
    friction : float
        Coefficient of friction, at least 0.
    turning : float
        Sum of the angles by which the tether turns about obstacles, radians, at least 0.

    Examples
    --------
    >>> round(tension_ratio(0.3, math.pi), 3)
    2.566
    """
    return math.exp(min(friction * turning, math.log(LARGEST)))


def proof(status: Status, length: float | None, bound: LowerBound | None) -> str:
    """Return in words what is proven about a tour, and for which scope.

    Results are, for example, "proven shortest by this solver", "at most 3.8 % above the shortest
    tour", "no bound". They rest on the solver; `Solution.proof` also names certified bounds.
    """
    if status is Status.INVALID:
        return "no tour for a tether: the solver is blind to it"
    if not status.is_optimal:
        return above_shortest(length, bound)
    narrow = length is not None and bound is not None and not bound.proves(length)
    if narrow and status is not Status.OPTIMAL:
        return f"{status.verdict}; {above_shortest(length, bound)}"
    in_order = bound is not None and bound.scope.keeps_order
    return f"{status.verdict}, in the given order" if in_order else status.verdict


CertifiedLevel = Literal["optimal", "bound", "none"]
"""Level that a proof file shows: the tour is the shortest, a lower bound holds, or nothing."""

NO_PROOF = "no proof was written"
"""Reason why a tour is not certified, for files without `certified_reason`."""

EXACT_ROADMAPS = frozenset({"taut"})
"""Names of the roadmaps whose travel graph, with all classes, contains every admissible tour."""


def solution_scope(roadmap: str, classes: KeptClasses | None, *, kept_order: bool = False) -> Scope:
    """Return the scope of the lower bounds that a solver can prove on a roadmap.

    Parameters
    ----------
    roadmap : str
        Name of the roadmap.
    classes : {"all", "non-looping", "shortest"} or None
        Homotopy classes that the roadmap kept. Bounds cover classes that were left out because
        their tethers are longer ("shortest"), but not classes that a rule excludes ("non-looping").
    kept_order : bool
        Whether the order of the goals was given.
    """
    if roadmap not in EXACT_ROADMAPS:
        scope = Scope.ROADMAP
    elif classes == "non-looping":
        scope = Scope.KEPT_CLASSES
    else:
        scope = Scope.ALL_TOURS
    return scope.in_order if kept_order else scope


class ProblemReference(Model):
    """Reference to the problem that a solution belongs to."""

    name: Annotated[Name, Field(description="name of the problem")]
    sha256: Annotated[
        str, Field(description="hash of all values that the tour depends on: not of names")
    ]


class Visit(Model):
    """Visit of a tour: the goal (from 0), and the word and taut length of the tether there.

    The goal's name and position identify the goal in a problem that was edited since.
    """

    goal: Annotated[
        Annotated[int, Field(ge=0)], Field(description="index in the problem's goals, from 0")
    ]
    signature: Annotated[
        tuple[int, ...], Field(description="h-signature of the tether at the goal")
    ]
    tether_length: Annotated[
        NonNegative,
        Field(description="length of the taut tether at the goal, in the problem's units"),
    ]
    name: Annotated[Name | None, Field(description="name of the goal; null for none")] = None
    position: Annotated[
        PathPoint | None, Field(description="(x, y, z) of the goal, in the problem's units")
    ] = None


class Timings(Model):
    """Wall-clock time of each stage, s."""

    roadmap_s: Annotated[NonNegative, Field(description="seconds to build the roadmap")] = 0.0
    matrix_s: Annotated[NonNegative, Field(description="seconds to measure legs")] = 0.0
    solve_s: Annotated[NonNegative, Field(description="seconds of the solver")] = 0.0
    total_s: Annotated[NonNegative, Field(description="seconds of the whole call")] = 0.0


class Solution(Drawn, FileModel):
    """Tour with its proof status.

    Lengths are in the problem's units. Without a tour, `length` and `gap` are None.

    Attributes
    ----------
    margin : float
        Length added to the problem's clearance; path, tethers, bound and status hold for obstacles
        that are grown by both.
    slack : float
        Slack tether that may be out besides the taut length, as a share of it. Both together are
        within the tether's length.
    friction, max_tension_ratio : float, float or None
        Coefficient of friction of tether on obstacle, and the largest factor by which friction may
        raise the tension at a visit; None for no limit.
    kept_order : bool
        Whether the order of the goals was given; bound, gap and status then hold for tours in that
        order.
    path : tuple of (x, y, z)
        Closed polyline from the base to the base, or from the problem's state to the base.
    start_tether : tuple of (x, y, z)
        Taut tether at the start of a tour from a state.
    lower_bound : float or None
        Proven lower bound on the length of the tours in `lower_bound_of`.
    lower_bound_of : Scope or None
        Scope of `lower_bound`; None without a bound. For older files, which lack it, it is derived
        from roadmap and classes.
    gap : float or None
        (length - lower_bound) / length.
    certified : {"optimal", "bound", "none"}
        Claim of the proof file that was written with this solution: no tour is shorter, none is
        shorter than `certified_bound`, or nothing. Anyone can edit this field: check the proof
        with `netsp verify --proof`.
    certified_reason : str
        Why `certified` is not "optimal"; empty if it is.
    certified_bound : float or None
        Length that no tour falls below, by the proof file.
    classes : {"all", "non-looping", "shortest"} or None
        Homotopy classes that the roadmap kept; "shortest" means those with the shortest tethers of
        each goal.
    legs_left_out : tuple of (int, int)
        Pairs of goals (from 0), one for each leg for which no taut path was found.
    entangled : tuple of int
        Obstacles (from 0) that the path is wrapped around; only an `invalid` tour has any.

    Examples
    --------
    >>> from netsp import Problem, solve
    >>> solution = solve(Problem.load("problems/pool.json"))
    >>> solution.status.value, round(solution.length, 2), [visit.goal for visit in solution.tour]
    ('optimal', 29.58, [1, 3, 4, 2, 0])
    >>> solution.proof
    'proven shortest by this solver'
    """

    picture: ClassVar[str] = "netsp.view.pictures.problem_picture:draw_solution"
    file_kind: ClassVar[str] = "solution"

    model_config = ConfigDict(title="netsp solution")

    schema_version: Annotated[Literal[1], Field(description="version of the file format")] = 1
    problem: Annotated[ProblemReference, Field(description="problem that is solved")]
    solver: Annotated[Name, Field(description="name of the solver")]
    roadmap: Annotated[Name, Field(description="name of the roadmap")]
    classes: Annotated[
        KeptClasses | None, Field(description="homotopy classes that the roadmap kept")
    ] = None
    seed: Annotated[int | None, Field(description="seed of all random numbers")] = None
    margin: Annotated[
        NonNegative,
        Field(
            description="length by which all obstacles were grown, in the problem's units; the "
            "solution holds among the grown obstacles"
        ),
    ] = 0.0
    slack: Annotated[
        Annotated[NonNegative, Field(le=1.0)],
        Field(description="slack tether that may be out, as a share of the taut length"),
    ] = 0.0
    friction: Annotated[
        Annotated[NonNegative, Field(le=MAX_FRICTION)],
        Field(description="coefficient of friction of tether on obstacle"),
    ] = 0.0
    max_tension_ratio: Annotated[
        Annotated[Number, Field(gt=1.0, le=1e6)] | None,
        Field(
            description="largest factor by which friction may raise the tension; null for no limit"
        ),
    ] = None
    kept_order: Annotated[
        bool,
        Field(
            description="whether the order of the goals was given; bound and status are then "
            "those of tours in it"
        ),
    ] = False
    status: Annotated[Status, Field(description="what is proven about the tour")]
    length: Annotated[
        Total | None,
        Field(description="length of the tour, in the problem's units; null without a tour"),
    ]
    lower_bound: Annotated[
        Total | None,
        Field(
            description="none of the tours that lower_bound_of names is shorter, in the problem's "
            "units; null if nothing is known"
        ),
    ]
    lower_bound_of: Annotated[
        Scope | None,
        Field(
            description="tours that lower_bound holds for: all_tours, kept_classes (of those that "
            "the roadmap kept), roadmap (along a sampled one), given_order, or both limits; null "
            "without a bound"
        ),
    ] = None
    gap: Annotated[
        Total | None,
        Field(description="(length - lower_bound) / length; null if either is missing"),
    ]
    certified: Annotated[
        CertifiedLevel,
        Field(
            description="what the proof file written with this solution shows: optimal (no tour is "
            "shorter), bound (none is shorter than certified_bound) or none"
        ),
    ] = "none"
    certified_reason: Annotated[
        str, Field(max_length=1000, description='why `certified` is not "optimal"; empty if it is')
    ] = NO_PROOF
    certified_bound: Annotated[
        Total | None,
        Field(
            description="length that no tour falls below by the proof file, in the problem's "
            "units; null without one"
        ),
    ] = None
    entangled: Annotated[
        tuple[int, ...],
        Field(
            description="obstacles, numbered from 0, that the path is wrapped around; "
            "empty but for an `invalid` tour"
        ),
    ] = ()
    tour: Annotated[tuple[Visit, ...], Field(description="goals in the order of their visits")] = ()
    path: Annotated[
        tuple[PathPoint, ...],
        Field(description="closed polyline from base to base, in the problem's units"),
    ] = ()
    legs_left_out: Annotated[
        tuple[tuple[int, int], ...],
        Field(
            description="pairs of goals, numbered from 0, one for each leg whose taut path was not "
            "found: in its place stands the way back to the base and out again; lower_bound "
            "holds for tours along such legs, too"
        ),
    ] = ()
    start_tether: Annotated[
        tuple[PathPoint, ...],
        Field(
            description="the tether at the start if the robot was already out, in "
            "the problem's units"
        ),
    ] = ()
    timings: Annotated[Timings, Field(description="time of each stage")] = Timings()
    versions: Annotated[
        dict[Name, Name],
        Field(
            description="versions of netsp and of the packages that it used", default_factory=dict
        ),
    ]

    @model_validator(mode="before")
    @classmethod
    def _name_scope(cls, data: Any) -> Any:
        """Add the scope of the bound to data of older files, and qualify the status `optimal`."""
        if not isinstance(data, Mapping) or data.get("lower_bound") is None:
            return data
        if data.get("lower_bound_of") is not None:
            return data
        roadmap, classes = data.get("roadmap"), data.get("classes")
        if not isinstance(roadmap, str):
            return data  # the check of the field reports it
        scope = solution_scope(roadmap, classes, kept_order=data.get("kept_order") is True)
        out = {**data, "lower_bound_of": scope}
        if data.get("status") == Status.OPTIMAL:
            out["status"] = Status.optimal_of(scope)
        return out

    @model_validator(mode="before")
    @classmethod
    def _empty_reason(cls, data: Any) -> Any:
        """Add the empty reason of a certified tour, which files leave out."""
        if isinstance(data, Mapping) and data.get("certified") == "optimal":
            return {"certified_reason": "", **data}
        return data

    def __repr__(self) -> str:
        """Return one line with problem, solver, status, length, bound and number of visits."""
        length = "" if self.length is None else f", length {self.length:.6g}"
        bound = "" if self.bound is None else f", {self.bound.says(self.length)}"
        return (
            f"<Solution of {self.problem.name!r} by {self.solver}: "
            f"{self.status.value}{length}{bound}{self._certified_words}, {len(self.tour)} visits>"
        )

    __str__ = __repr__

    @property
    def _certified_words(self) -> str:
        if self.certified == "optimal":
            return ", certified"
        if self.certified == "bound" and self.certified_bound is not None:
            return f", certified bound {self.certified_bound:.6g}"
        return ""

    def to_frame(self) -> pandas.DataFrame:
        """Return a pandas DataFrame with a row for each visit, in the order of the tour.

        Columns are ``goal`` (from 0), ``name``, ``x``, ``y``, ``z``, ``signature`` and
        ``tether_length``, in the problem's units.

        Raises
        ------
        InputError
            pandas is not installed.
        """
        return frame_of(
            {
                "goal": v.goal,
                "name": v.name,
                **dict(zip("xyz", v.position or (None, None, None), strict=True)),
                "signature": v.signature,
                "tether_length": v.tether_length,
            }
            for v in self.tour
        )

    @property
    def bound(self) -> LowerBound | None:
        """Lower bound with its scope; None if none is known."""
        if self.lower_bound is None or self.lower_bound_of is None:
            return None
        return LowerBound(self.lower_bound, self.lower_bound_of)

    @property
    def max_turning(self) -> float:
        """Largest sum of the angles by which the tether may turn, radians; infinite without a limit
        on the tension."""
        return max_turning(self.friction, self.max_tension_ratio)

    @property
    def proof(self) -> str:
        """Phrase that says what is proven about the tour, and whether by the solver alone or by a
        proof file."""
        text = proof(self.status, self.length, self.bound)
        if self.status is Status.INVALID or self.certified == "none":
            return text
        if self.certified == "optimal":
            return "certified shortest" if self.length is not None else "certified: no tour exists"
        certified = above_shortest(self.length, self.certified_lower_bound)
        return f"certified: {text}" if text == certified else f"{text}; certified: {certified}"

    @property
    def certified_lower_bound(self) -> LowerBound | None:
        """Bound of the proof file on all tours; None without one."""
        if self.certified_bound is None:
            return None
        return LowerBound(self.certified_bound, Scope.ALL_TOURS)

    def with_certificate(
        self, level: CertifiedLevel, bound: float | None = None, reason: str = ""
    ) -> Solution:
        """Return the solution with what a proof shows.

        The lower bound is raised to that of the proof if it was lower, or held for fewer tours than
        it could; gap and status follow.

        Parameters
        ----------
        level : {"optimal", "bound", "none"}
            What the proof shows; its tolerance is `OPTIMALITY_TOLERANCE`.
        bound : float, optional
            Length that no tour falls below, by the proof; infinite if there is no tour.
        reason : str
            Why the level is not "optimal".

        Examples
        --------
        >>> from netsp import Problem, solve
        >>> problem = Problem.load("problems/pool.json")
        >>> greedy = solve(problem, "lns", iteration_limit=1, seed=1)
        >>> greedy.with_certificate("bound", 20.0, "time is up").certified_bound
        20.0
        """
        finite = None if bound is None or math.isinf(bound) else bound
        known: dict[str, Any] = {"certified": level, "certified_bound": finite}
        known["certified_reason"] = "" if level == "optimal" else reason or NO_PROOF
        if level == "none" or finite is None or self.length is None:
            return self.model_copy(update=known)
        scope = solution_scope(self.roadmap, self.classes, kept_order=self.kept_order)
        proven = LowerBound(finite, Scope.ALL_TOURS).for_part(scope, "a proof is of all tours")
        old = self.bound
        is_wider = old is not None and old.scope is not scope and level == "optimal"
        is_higher = old is not None and old.scope is scope and old.length < finite
        if old is None or is_wider or is_higher:
            gap = proven.gap(self.length)
            known |= {"lower_bound": finite, "lower_bound_of": scope, "gap": gap}
            if proven.proves(self.length):
                known["status"] = Status.optimal_of(scope)
        return self.model_copy(update=known)

    def to_json(self) -> str:
        """Return the solution as JSON of format version 1."""
        data = self.model_dump(mode="json")
        path = data.pop("path")
        for name in ("start_tether", "legs_left_out"):
            if not data[name]:
                del data[name]
        if self.classes is None:
            del data["classes"]
        if self.lower_bound_of is None:
            del data["lower_bound_of"]
        if not self.margin:
            del data["margin"]
        if self.certified_bound is None:
            del data["certified_bound"]
        if self.certified == "none" and self.certified_reason == NO_PROOF:
            del data["certified"], data["certified_reason"]
        elif not self.certified_reason:
            del data["certified_reason"]
        for name, plain in (("kept_order", False), ("slack", 0.0), ("friction", 0.0)):
            if data[name] == plain:
                del data[name]
        if self.max_tension_ratio is None:
            del data["max_tension_ratio"]
        for visit in data["tour"]:
            for name in ("name", "position"):
                if visit[name] is None:
                    del visit[name]
        text = json.dumps(data, indent=1, allow_nan=False, ensure_ascii=False)
        rows = ",\n".join("  " + json.dumps(p, allow_nan=False) for p in path)
        return f'{text[:-2]},\n "path": [\n{rows}\n ]\n}}\n'
