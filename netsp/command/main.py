"""The command line. Data goes to stdout or `-o`, progress and messages to stderr.

Exit codes: 0 done, 1 internal error, 2 bad input, 3 proven infeasible, 4 limit reached without a
solution, 5 verification failed, 130 interrupted with nothing to show. Heavy modules are imported by
the commands that need them, so that `--help` is instant.
"""

from __future__ import annotations

import argparse
import contextlib
import errno
import io
import os
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, NoReturn

from netsp.command.types import (
    check_writable,
    length,
    natural,
    option,
    positive,
    seconds,
    shard,
)
from netsp.commands import add_online
from netsp.errors import (
    EXIT_BAD_INPUT,
    EXIT_INTERRUPTED,
    EXIT_NOT_ALL,
    EXIT_NOT_VERIFIED,
    InputError,
    NetspError,
)

if TYPE_CHECKING:
    from netsp.problem import Problem
    from netsp.solution import Solution
    from netsp.travel.result import Progress


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    # both are None when they were closed before we began
    sys.stdout, sys.stderr = sys.stdout or _Closed(), sys.stderr or io.StringIO()
    try:
        args = _parser().parse_args(_joined(sys.argv[1:] if argv is None else argv))
        code = int(args.run(args))
        sys.stdout.flush()
        return code
    except NetspError as error:
        print(f"netsp: {error}", file=sys.stderr)
        return error.exit_code
    except MemoryError:
        print(
            "netsp: out of memory; lower tether_length, --max-classes or the size of what is asked",
            file=sys.stderr,
        )
        return EXIT_NOT_ALL
    except KeyboardInterrupt:
        print("netsp: interrupted before there was anything to write", file=sys.stderr)
        return EXIT_INTERRUPTED
    except BrokenPipeError:
        _forget_stdout()  # the reader has gone (| head)
        return 0
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EBADF, errno.EIO, errno.EFBIG, errno.EDQUOT):
            raise
        _forget_stdout()
        print(f"netsp: output cannot be written: {error.strerror}", file=sys.stderr)
        return EXIT_BAD_INPUT


def _forget_stdout() -> None:
    """Keep Python from complaining while it closes a stdout that takes nothing any more."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


class _Closed(io.TextIOBase):
    """A standard output that was closed before we began."""

    def write(self, text: str) -> int:
        raise OSError(errno.EBADF, "standard output is closed")


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one line, as everything here does."""

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message} ({self.prog} --help)")


VECTORS = ("--origin", "--base", "--current")
"""Flags whose values may begin with a minus and are no numbers to argparse."""


def _joined(argv: Sequence[str]) -> list[str]:
    """`--origin -33,151` as `--origin=-33,151`."""
    out: list[str] = []
    for word in argv:
        if out and out[-1] in VECTORS and word[:1] == "-" and word[1:2].isdigit():
            out[-1] += f"={word}"
        else:
            out.append(word)
    return out


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="netsp",
        description="Shortest non-entangling tours for tethered underwater robots, with proof.",
        epilog="Exit codes: 0 done, 1 internal error, 2 bad input, 3 proven infeasible, "
        "4 limit reached without a solution, 5 verification failed.",
    )
    parser.add_argument("--version", action=_Version)
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)

    p = commands.add_parser("solve", help="find the shortest non-entangling tour of a problem")
    p.add_argument("problem", metavar="PROBLEM", help="problem file (JSON)")
    p.add_argument(
        "--solver",
        default="auto",
        metavar="NAME",
        help="auto (default), mip, dp, reduced-mip, lns, anneal, anneal-2016, greedy, "
        "greedy-2016 or greedy-tsp",
    )
    p.add_argument(
        "--option",
        action="append",
        default=[],
        type=option,
        metavar="NAME=VALUE",
        help="an option of the solver, as docs/solvers.md lists them; may be repeated",
    )
    p.add_argument("--roadmap", default="taut", metavar="NAME", help="taut (default) or prm")
    p.add_argument(
        "--classes", metavar="RULE",
        help="taut: all homotopy classes (default), or non-looping as in the 2017 paper",
    )  # fmt: skip
    p.add_argument("--samples", type=positive, metavar="N", help="prm: milestones; default 1000")
    p.add_argument("--shortcut", action="store_true", help="prm: pull every leg taut in its class")
    p.add_argument(
        "--max-classes",
        type=positive,
        metavar="N",
        help="taut: most classes of all goals together",
    )
    p.add_argument(
        "--mip-backend", metavar="NAME", help="highs (default) or cbc, for the solvers built on mip"
    )
    p.add_argument("--time-limit", type=seconds, metavar="S", help="seconds; default none")
    p.add_argument(
        "--iteration-limit", type=positive, metavar="N", help="of the solver; default none"
    )
    p.add_argument("--seed", type=natural, default=0, metavar="N", help="random seed; default 0")
    p.add_argument("--warm-start", metavar="SOLUTION", help="start from this solution's tour")
    p.add_argument("-o", "--output", metavar="FILE", help="write the solution here (else stdout)")
    p.add_argument("--plot", metavar="FILE", help="draw the solution (png, svg or pdf)")
    p.add_argument(
        "--plot-trace",
        metavar="FILE",
        help="draw length, bound and entanglement against iterations (png, svg or pdf)",
    )
    p.add_argument("--quiet", action="store_true", help="no progress, no summary")
    p.set_defaults(run=_solve)

    p = commands.add_parser("verify", help="judge a solution independently of what found it")
    p.add_argument("problem", metavar="PROBLEM")
    p.add_argument("solution", metavar="SOLUTION")
    p.add_argument(
        "--measures",
        action="store_true",
        help="print measures of entanglement; instead of a solution, any path will do "
        "(CSV x,y[,z] or a JSON list of points)",
    )
    p.add_argument("--quiet", action="store_true", help="exit code only")
    p.set_defaults(run=_verify)

    p = commands.add_parser("plot", help="draw a problem or a scene, with a solution or a tether")
    p.add_argument("problem", metavar="PROBLEM", help="problem or scene file (JSON)")
    p.add_argument(
        "solution", metavar="SOLUTION", nargs="?",
        help="solution; with a scene: a path from the anchor on (CSV x,y,z or JSON), along which "
        "the tether is laid",
    )  # fmt: skip
    p.add_argument(
        "-o", "--output", required=True, metavar="FILE",
        help="png, svg or pdf; a scene also html, to be turned in a browser",
    )  # fmt: skip
    p.add_argument(
        "--tether-model", default="geodesic", metavar="NAME",
        help="scene: geodesic (default) or react",
    )  # fmt: skip
    p.add_argument(
        "--delta", type=length, metavar="L",
        help="scene: resolution of the tether; default by the scene",
    )  # fmt: skip
    p.add_argument("--roadmap", metavar="NAME", help="draw this roadmap: taut or prm")
    p.add_argument("--samples", type=positive, metavar="N", help="prm: milestones; default 1000")
    p.add_argument("--seed", type=natural, default=0, metavar="N", help="prm: random seed")
    p.add_argument(
        "--classes", metavar="GOAL", help="draw all taut tethers to this goal (number or name)"
    )
    p.set_defaults(run=_plot, shortcut=False)

    p = commands.add_parser("world", help="draw a random problem, the same on every machine")
    p.add_argument(
        "--family",
        default="icra2017",
        metavar="NAME",
        help="icra2017 (default), rss2016, clustered, array or harbour",
    )
    p.add_argument("--seed", type=natural, default=0, metavar="N", help="of all draws; default 0")
    p.add_argument("--goals", type=positive, metavar="N", help="default 20; rss2016: 5 to 10")
    p.add_argument("--obstacles", type=natural, metavar="N", help="default 20; rss2016: 5 to 10")
    p.add_argument("--tether", type=length, default=300.0, metavar="L", help="default 300")
    p.add_argument("--side", type=length, default=500.0, metavar="L", help="default 500")
    p.add_argument(
        "--radii", type=length, nargs=2, default=(10.0, 30.0), metavar="R",
        help="least and most; default 10 30",
    )  # fmt: skip
    p.add_argument("-o", "--output", metavar="FILE", help="write the problem here (else stdout)")
    p.add_argument("--plot", metavar="FILE", help="draw it (png, svg or pdf)")
    p.set_defaults(run=_world)

    p = commands.add_parser("compare", help="solvers side by side over random worlds, resumable")
    p.add_argument(
        "study", metavar="STUDY", nargs="?", help="study file (TOML); or the flags below"
    )
    p.add_argument("-o", "--output", required=True, metavar="FILE", help="results (JSON lines)")
    p.add_argument("--goals", type=positive, nargs="+", metavar="N")
    p.add_argument("--tethers", type=length, nargs="+", metavar="L")
    p.add_argument("--solvers", nargs="+", metavar="NAME")
    p.add_argument("--roadmaps", nargs="+", metavar="NAME", help="default taut")
    p.add_argument("--worlds", type=positive, metavar="N", help="per cell; default 10")
    p.add_argument("--family", metavar="NAME", help="of the worlds; default icra2017")
    p.add_argument(
        "--seeds", type=natural, nargs="+", metavar="N", help="of the solvers; default 0"
    )
    p.add_argument("--time-limit", type=seconds, metavar="S", help="of a trial; default 120")
    p.add_argument("--memory-limit", type=length, metavar="GIB", help="of a trial; default none")
    p.add_argument("--jobs", type=positive, default=1, metavar="N", help="processes; default 1")
    p.add_argument(
        "--shard", type=shard, default=(1, 1), metavar="I/N", help="only the I-th of N parts"
    )
    p.add_argument(
        "--scheduler", metavar="ADDRESS", help="run on a Dask cluster, tcp://host:port, not here"
    )
    p.add_argument("--quiet", action="store_true", help="no progress")
    p.set_defaults(run=_compare)

    p = commands.add_parser("combine", help="join the results of shards of one study")
    p.add_argument("results", metavar="RESULTS", nargs="+")
    p.add_argument("-o", "--output", required=True, metavar="FILE")
    p.set_defaults(run=_combine)

    p = commands.add_parser("report", help="one page about a comparison, a solution or a run")
    p.add_argument(
        "results", metavar="RESULTS",
        help="rows of `netsp compare`, a solution file, or the folder of `netsp execute`",
    )  # fmt: skip
    p.add_argument("--problem", metavar="FILE", help="the problem of a solution file")
    p.add_argument("-o", "--output", required=True, metavar="FILE", help="the page (HTML)")
    p.add_argument(
        "--figures", choices=("svg", "png", "pdf"), help="save the figures beside the page, too"
    )
    p.set_defaults(run=_report)

    add_online(commands)

    p = commands.add_parser("warm-up", help="compile everything now, not at the first use")
    p.add_argument("--quiet", action="store_true", help="no progress")
    p.set_defaults(run=_warm_up)

    p = commands.add_parser("schema", help="print the JSON Schema of a file format")
    p.add_argument("format", choices=("problem", "solution", "scene", "mission", "surprises"))
    p.set_defaults(run=_schema)
    return parser


class _Version(argparse.Action):
    def __init__(self, option_strings: Sequence[str], dest: str) -> None:
        super().__init__(option_strings, dest, nargs=0, help="print the version and exit")

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from netsp import __version__

        print(f"netsp {__version__}")
        parser.exit()


def _solve(args: argparse.Namespace) -> int:
    from netsp.command.progress import ProgressTable, summary
    from netsp.files import write_text
    from netsp.problem import Problem
    from netsp.solution import Solution

    problem = Problem.load(args.problem)
    warm = Solution.load(args.warm_start) if args.warm_start else None
    check_writable(args.output, args.plot, args.plot_trace, inputs=(args.problem, args.warm_start))
    if args.plot or args.plot_trace:
        from netsp.pictures import problem as plotting

        for picture in filter(None, (args.plot, args.plot_trace)):
            plotting.check_format(picture)
    from netsp.solvers.solve import solve

    rows: list[Progress] = []

    table = None if args.quiet else ProgressTable(sys.stderr)

    def listen(row: Progress) -> None:
        if table:
            table(row)
        if args.plot_trace:
            rows.append(row)

    from netsp.compiled.warm_up import told

    with table or contextlib.nullcontext(), told(sys.stderr) if table else contextlib.nullcontext():
        if table:
            table.begin(problem)
        solution = solve(
            problem,
            args.solver,
            roadmap=args.roadmap,
            roadmap_options=_roadmap_options(args),
            time_limit=args.time_limit,
            iteration_limit=args.iteration_limit,
            seed=args.seed,
            params=_params(args),
            warm_start=warm,
            on_progress=listen,
        )
    if args.output:
        write_text(args.output, solution.to_json())
    else:
        sys.stdout.write(solution.to_json())
        sys.stdout.flush()
    if args.plot:
        plotting.save(problem, solution, args.plot)
    if args.plot_trace:
        plotting.save_trace(rows, f"{problem.name}: {args.solver}", problem.units, args.plot_trace)
    if table:
        table.end()
        text = summary(problem, solution, args.output, args.plot, args.plot_trace)
        print(text, file=sys.stderr)
    return _EXIT.get(solution.status.value, 0)


_EXIT = {
    "infeasible": 3,
    "no_solution_found": EXIT_NOT_ALL,
    "invalid": EXIT_NOT_VERIFIED,
}


def _params(args: argparse.Namespace) -> dict[str, str]:
    params = dict(args.option)
    if len(params) < len(args.option):
        raise InputError("--option: the same option is given twice")
    if args.mip_backend:
        if "backend" in params:
            raise InputError("--mip-backend: the backend is given by --option too")
        params["backend"] = args.mip_backend
    return params


def _roadmap_options(args: argparse.Namespace) -> dict[str, object]:
    options = {
        "samples": args.samples,
        "shortcut": args.shortcut or None,
        "max_classes": getattr(args, "max_classes", None),
        "classes": args.classes if args.run is _solve else None,
    }
    return {name: value for name, value in options.items() if value is not None}


def _verify(args: argparse.Namespace) -> int:
    if args.measures:
        from netsp.command.measures import describe_path
        from netsp.files import read_path
        from netsp.problem import Problem

        path = read_path(args.solution)
        if path is not None:
            text = describe_path(Problem.load(args.problem), path)
            if not args.quiet:
                print(text)
            return 0
    problem, solution = _load_pair(args.problem, args.solution)
    from netsp.judge import verify

    verdict = verify(problem, solution)
    if not args.quiet:
        print(verdict)
        print("verified" if verdict else "NOT VERIFIED")
    if args.measures and solution.path and not args.quiet:
        if solution.problem.sha256 != problem.sha256:
            return EXIT_NOT_VERIFIED
        from netsp.command.measures import describe_tethers

        print(f"\n{describe_path(problem, solution.path)}\n\n{describe_tethers(problem, solution)}")
    return 0 if verdict else EXIT_NOT_VERIFIED


def _plot(args: argparse.Namespace) -> int:
    check_writable(args.output, inputs=(args.problem, args.solution))
    if _is_scene(args.problem):
        from netsp.command.simulate import plot_scene

        return plot_scene(args)
    from netsp.pictures import problem as plotting
    from netsp.problem import Problem

    plotting.check_format(args.output)
    if args.classes is not None:
        if args.solution or args.roadmap:
            raise InputError(
                "--classes: draws a problem alone; leave out the solution and --roadmap"
            )
        problem = Problem.load(args.problem)
        plotting.save_classes(problem, _goal_number(problem, args.classes), args.output)
    elif args.roadmap:
        if args.solution:
            raise InputError("--roadmap: draws a problem alone; leave out the solution")
        options = _roadmap_options(args)
        if args.roadmap == "prm":
            options["seed"] = args.seed
        plotting.save_roadmap(Problem.load(args.problem), args.roadmap, options, args.output)
    elif args.solution:
        problem, solution = _load_pair(args.problem, args.solution)
        if solution.problem.sha256 != problem.sha256:
            raise InputError(
                f"{args.solution}: is the solution of another problem (sha256 differs)"
            )
        plotting.save(problem, solution, args.output)
    else:
        plotting.save(Problem.load(args.problem), None, args.output)
    return 0


def _is_scene(path: str) -> bool:
    """A file that describes a scene rather than a problem: by its fields."""
    from netsp.files import read_text
    from netsp.models import parse_json_object

    data = parse_json_object(read_text(path), path)
    return "goals" not in data and bool({"solids", "mesh", "cloud", "problem"} & data.keys())


def _goal_number(problem: Problem, text: str) -> int:
    names = [g.name for g in problem.goals]
    if text in names:
        return names.index(text)
    if text.isdigit() and int(text) < len(names):
        return int(text)
    raise InputError(
        f"--classes: no goal {text!r}; expected a number from 0 to {len(names) - 1}"
        + (f" or a name such as {next(n for n in names if n)!r}" if any(names) else "")
    )


def _load_pair(problem: str, solution: str) -> tuple[Problem, Solution]:
    from netsp.problem import Problem
    from netsp.solution import Solution

    return Problem.load(problem), Solution.load(solution)


def _world(args: argparse.Namespace) -> int:
    from netsp.files import write_text
    from netsp.worlds import reachable_world

    check_writable(args.output, args.plot)
    if args.plot:
        from netsp.pictures import problem as plotting

        plotting.check_format(args.plot)
    problem, in_vain = reachable_world(
        args.seed,
        family=args.family,
        goals=args.goals,
        obstacles=args.obstacles,
        tether_length=args.tether,
        side=args.side,
        radii=tuple(args.radii),
    )
    if in_vain:
        print(f"netsp: {in_vain} worlds of this seed did not fit and were redrawn", file=sys.stderr)
    if args.output:
        write_text(args.output, problem.to_json())
    else:
        sys.stdout.write(problem.to_json())
    if args.plot:
        plotting.save(problem, None, args.plot)
    return 0


def _compare(args: argparse.Namespace) -> int:
    from netsp.command import compare as command

    return command.run(args)


def _combine(args: argparse.Namespace) -> int:
    from netsp.command import compare as command

    return command.run_combine(args)


def _report(args: argparse.Namespace) -> int:
    if not args.results.endswith((".jsonl", ".jsonl.gz")):
        from netsp.report.tour import report_tour

        check_writable(args.output, inputs=(args.results, args.problem))
        report_tour(args.results, args.problem, args.output)
        return 0
    from netsp.report.page import write_report

    check_writable(args.output, inputs=(args.results,))
    write_report(args.results, args.output, args.figures)
    return 0


def _warm_up(args: argparse.Namespace) -> int:
    from netsp.compiled.warm_up import forget, steps, told

    forget()
    with contextlib.nullcontext() if args.quiet else told(sys.stderr):
        for name, step in steps():
            if not args.quiet:
                print(f"warm-up: {name}", file=sys.stderr, flush=True)
            step()
    return 0


def _schema(args: argparse.Namespace) -> int:
    import json

    if args.format == "problem":
        from netsp.problem import Problem as Model
    elif args.format == "mission":
        from netsp.online.mission import Mission as Model  # type: ignore[assignment]
    elif args.format == "surprises":
        from netsp.execute.events import Surprises as Model  # type: ignore[assignment]
    elif args.format == "scene":
        from netsp.online.scene.scene import Scene as Model  # type: ignore[assignment]
    else:
        from netsp.solution import Solution as Model  # type: ignore[assignment]
    print(json.dumps(Model.model_json_schema(), indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
