"""Studies: files that say which worlds, roadmaps, solvers and seeds to combine."""

from __future__ import annotations

import hashlib
import json
import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, ValidationError, model_validator

from netsp.base.errors import InputError
from netsp.base.field_types import Integer, Name, Number, Positive
from netsp.base.files import read_text
from netsp.base.validated import Model, explain
from netsp.plan.random_worlds import FAMILIES
from netsp.plan.solve_problem import check_solver
from netsp.plan.solver_table import ROADMAPS, SOLVERS
from netsp.study.compare.trial_policy import TrialPolicy

Whole = Annotated[Integer, Field(ge=1, le=100_000)]
Natural = Annotated[Integer, Field(ge=0, le=2**62)]


class Worlds(Model):
    """Random worlds of a family (`netsp.plan.random_worlds`), with seeds from `first` on."""

    family: Annotated[str, Field(description="family of random worlds")] = "icra2017"
    count: Annotated[
        Whole, Field(description="number of worlds for each number of goals and tether length")
    ] = 10
    first: Annotated[Natural, Field(description="seed of the first world")] = 0
    obstacles: Annotated[
        Natural | tuple[Natural, Natural] | None,
        Field(
            description="per world: how many, or least and most of a number that is drawn "
            "uniformly; null for the family's own"
        ),
    ] = None
    side: Annotated[Positive, Field(description="side of the square, in units of length")] = 500.0
    radii: Annotated[
        tuple[Positive, Positive],
        Field(description="smallest and largest radius of obstacles, in units of length"),
    ] = (10.0, 30.0)

    @model_validator(mode="after")
    def _known(self) -> Self:
        if self.family not in FAMILIES:
            raise ValueError(f"family: unknown {self.family!r}; expected one of {_list(FAMILIES)}")
        if isinstance(self.obstacles, tuple) and self.obstacles[0] > self.obstacles[1]:
            raise ValueError(
                "obstacles: expected minimum <= maximum, got {} and {}".format(*self.obstacles)
            )
        if self.radii[0] > self.radii[1]:
            raise ValueError(
                f"radii: expected minimum <= maximum, got {self.radii[0]:g} and {self.radii[1]:g}"
            )
        return self


class StudyRoadmap(Model):
    """Roadmap of a study, with options; `label` identifies it in the results."""

    name: Annotated[
        str, Field(description="name of a roadmap: taut, prm or one of another package")
    ] = "taut"
    label: Annotated[Name, Field(description="name in tables; the name if empty")] = ""
    options: Annotated[dict[str, Any], Field(description="options of the roadmap, by name")] = (
        Field(default_factory=dict)
    )

    @model_validator(mode="after")
    def _known(self) -> Self:
        try:
            ROADMAPS.named(self.name)
        except InputError as error:
            raise ValueError(
                f"name: {str(error).replace('roadmap: unknown', 'unknown roadmap')}"
            ) from None
        return self


class StudySolver(Model):
    """Solver of a study, with options and limits; `label` identifies it in the results."""

    name: Annotated[str, Field(description="name of a solver of netsp or of another package")]
    label: Annotated[Name, Field(description="name in tables; the name if empty")] = ""
    time_limit: Annotated[
        Positive | None, Field(description="time limit, seconds; null for that of the study")
    ] = None
    iteration_limit: Annotated[
        Annotated[Integer, Field(ge=1, lt=2**62)] | None,
        Field(description="maximum number of iterations; null for no limit"),
    ] = None
    options: Annotated[dict[str, Any], Field(description="options of the solver, by name")] = Field(
        default_factory=dict
    )

    @model_validator(mode="after")
    def _known(self) -> Self:
        try:
            SOLVERS.named(self.name)
        except InputError as error:
            raise ValueError(
                f"name: {str(error).replace('solver: unknown', 'unknown solver')}"
            ) from None
        try:
            check_solver(self.name, self.options)
        except InputError as error:
            raise ValueError(str(error)) from None
        return self


class Study(Model):
    """Study of all combinations: goals x tether lengths x worlds x roadmaps x solvers x seeds.

    Attributes
    ----------
    time_limit
        Default time limit of a solver, s.
    memory_limit
        Memory of a trial, GiB, in addition to what a worker needs to start.
    """

    schema_version: Annotated[Literal[1], Field(description="version of the file format")] = 1
    name: Annotated[Annotated[Name, Field(min_length=1)], Field(description="name of the study")]
    goals: Annotated[
        Annotated[tuple[Whole, ...], Field(min_length=1)], Field(description="numbers of goals")
    ]
    tether_lengths: Annotated[
        Annotated[tuple[Positive, ...], Field(min_length=1)],
        Field(description="tether lengths, in units of length"),
    ]
    worlds: Annotated[Worlds, Field(description="random worlds of the study")] = Worlds()
    roadmaps: Annotated[
        Annotated[tuple[StudyRoadmap, ...], Field(min_length=1)],
        Field(description="roadmaps; each is tried"),
    ] = (StudyRoadmap(),)
    solvers: Annotated[
        Annotated[tuple[StudySolver, ...], Field(min_length=1)],
        Field(description="solvers; each is tried"),
    ]
    seeds: Annotated[
        Annotated[tuple[Natural, ...], Field(min_length=1)],
        Field(description="seeds of the solvers"),
    ] = (0,)
    time_limit: Annotated[
        Positive | None, Field(description="time limit of a trial, seconds; null for none")
    ] = 120.0
    memory_limit: Annotated[
        Annotated[Number, Field(gt=0, le=1e6)] | None,
        Field(description="memory of a trial, GiB; null for no limit"),
    ] = None

    @model_validator(mode="after")
    def _check_names_differ(self) -> Self:
        for what, specs in (("roadmaps", self.roadmaps), ("solvers", self.solvers)):
            labels = [s.label or s.name for s in specs]
            twice = [name for name in labels if labels.count(name) > 1]
            if twice:
                raise ValueError(f"{what}: {twice[0]!r} appears twice; give each a label")
        for what in ("goals", "tether_lengths", "seeds"):
            values = getattr(self, what)
            again = [v for v in values if values.count(v) > 1]
            if again:
                raise ValueError(f"{what}: {again[0]:g} appears twice; expected each once")
        count = self.worlds.count * len(self.goals) * len(self.tether_lengths)
        count *= len(self.roadmaps) * len(self.solvers) * len(self.seeds)
        if count > (limit := TrialPolicy.max_trials):
            raise ValueError(f"{count} trials; expected at most {limit}")
        return self

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Return the study in a TOML file; raise InputError with key and line if it is invalid."""
        text = read_text(path)
        try:
            data = tomllib.loads(text)
        except (ValueError, RecursionError) as error:  # endless numbers, deep nesting, too
            raise InputError(f"{path}: not TOML that netsp reads: {error}"[:300]) from None
        return cls.checked(data, str(path), text)

    @classmethod
    def checked(cls, data: dict[str, Any], source: str, text: str = "") -> Self:
        """Return a study from plain data; with `text`, the TOML text, errors name lines."""
        try:
            return cls.model_validate(data)
        except ValidationError as error:
            where = error.errors()[0]["loc"]
            raise InputError(f"{source}: {_line(text, where)}{explain(error)}") from None

    @property
    def sha256(self) -> str:
        """Hash of all fields that the trials depend on; the name is not one of them."""
        return _digest(self.model_dump(mode="json", exclude={"name"}))

    def trials(self) -> Iterator[Trial]:
        """Yield all trials, world by world."""
        for world in range(self.worlds.first, self.worlds.first + self.worlds.count):
            for goals in self.goals:
                for tether in self.tether_lengths:
                    for roadmap in self.roadmaps:
                        for solver in self.solvers:
                            for seed in self.seeds:
                                yield self._trial(world, goals, tether, roadmap, solver, seed)

    def _trial(
        self,
        world: int,
        goals: int,
        tether: float,
        roadmap: StudyRoadmap,
        solver: StudySolver,
        seed: int,
    ) -> Trial:
        recipe = self.worlds.model_dump(mode="json", exclude={"count", "first"})
        return Trial(
            world={"seed": world, **recipe, "goals": goals, "tether_length": tether},
            roadmap={**roadmap.model_dump(mode="json"), "label": roadmap.label or roadmap.name},
            solver={
                **solver.model_dump(mode="json"),
                "label": solver.label or solver.name,
                "time_limit": solver.time_limit or self.time_limit,
            },
            seed=seed,
            memory_limit=self.memory_limit,
        )


@dataclass(frozen=True)
class Trial:
    """Trial of one solver on one world, as plain data for a worker on any machine.

    Attributes
    ----------
    world
        Arguments of `netsp.plan.random_worlds.reachable_world`.
    roadmap
        Name, label, options.
    solver
        Name, label, options, limits.
    seed
        Seed of the solver, and of a sampled roadmap.
    """

    world: dict[str, Any]
    roadmap: dict[str, Any]
    solver: dict[str, Any]
    seed: int
    memory_limit: float | None = None

    @property
    def id(self) -> str:
        """Hash of all fields, which identifies the trial on every machine."""
        return _digest(
            {"world": self.world, "roadmap": self.roadmap, "solver": self.solver, "seed": self.seed}
        )[:16]


def shard(trials: list[Trial], part: int, parts: int) -> list[Trial]:
    """Return one of several parts of the trials, counted from 1: every `parts`-th trial."""
    return trials[part - 1 :: parts]


def _digest(data: Any) -> str:
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()


def _line(text: str, where: tuple[int | str, ...]) -> str:
    """Return ``line N: `` for a key, or an empty string if the text does not show it."""
    lines = text.splitlines()
    at, found = 0, None
    for k, part in enumerate(where):
        if isinstance(part, int):
            heads = [n for n, s in enumerate(lines) if s.strip() == f"[[{where[k - 1]}]]"]
            if part < len(heads):
                at = found = heads[part]
            continue
        pattern = re.compile(rf"\s*(\[+\s*)?\"?{re.escape(part)}\"?\s*(=|\])")
        hit = next((n for n in range(at, len(lines)) if pattern.match(lines[n])), None)
        if hit is not None:
            at = found = hit
    return "" if found is None else f"line {found + 1}: "


def _list(names: Any) -> str:
    return ", ".join(names)
