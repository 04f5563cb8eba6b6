"""Claims about proofs, bounds, heuristics, roadmaps, the judge and limits."""

from __future__ import annotations

import functools
import statistics
import time
from collections.abc import Callable, Iterator

import numpy as np
from table import ROOT

from claims.claim import ALLOWANCE, Claim, published


def proofs(
    cells: list[tuple[int, float]], worlds: int, limit: float, *, many: bool = False
) -> tuple[str, bool]:
    """Worlds proven optimal and verified, of all."""
    import frontier

    proven = verified = count = 0
    for goals, tether in cells:
        for seed in range(worlds):
            outcome = frontier.proof(frontier.world(seed, goals, tether, many=many), limit)
            count += 1
            proven += outcome.proven
            verified += outcome.verified
    return f"{proven} proven, {verified} verified of {count}", proven == verified == count


def bounds() -> tuple[str, bool]:
    """Runs stopped early, whose bound must not exceed the optimum."""
    from netsp import solve_graph, travel_graph
    from netsp.plan.random_worlds import random_world

    worst, runs = -np.inf, 0
    for seed in range(10):
        graph = travel_graph(random_world(seed, goals=12, tether_length=320.0))
        best = solve_graph(graph, "mip").length or np.nan
        for solver, limit in (("mip", 2), ("mip", 10), ("dp", 2), ("dp", 6), ("auto", 4)):
            bound = solve_graph(graph, solver, iteration_limit=limit).lower_bound or 0.0
            worst = max(worst, bound / best - 1.0)
            runs += 1
    return f"{worst:.1e} at most in {runs} runs", worst <= 1e-9


def restricted_bounds() -> tuple[str, bool]:
    """Check that bounds on all tours in progress rows of runs over few classes do not exceed the
    optimum over all classes, although the optimum over the classes kept does."""
    from netsp import solve, solve_graph, travel_graph
    from netsp.model.bound_scope import LowerBound, Scope
    from netsp.plan.random_worlds import reachable_world

    above = rows = longer = 0
    for seed in range(8):
        problem, _ = reachable_world(family="icra2017", seed=seed, goals=6, tether_length=300.0)
        best = solve(problem, "mip").length or np.nan
        for solver, most in (("mip", 6), ("dp", 6), ("mip", 18)):
            heard: list[LowerBound | None] = []
            found = solve_graph(
                travel_graph(problem, max_classes=most), solver,
                on_progress=lambda row, heard=heard: heard.append(row.bound),
            )  # fmt: skip
            heard.append(found.bound)
            stated = [b.length for b in heard if b is not None and b.scope is Scope.ALL_TOURS]
            rows += len(heard)
            longer += (found.length or 0.0) > best * (1.0 + 1e-6)
            above += sum(b > best * (1.0 + 1e-9) for b in stated)
    return f"{above} of {rows} rows; {longer} of 24 runs end above the optimum", above == 0 < longer


def heuristic(name: str, most: float, **limits: float) -> Callable[[], tuple[str, bool]]:
    """Mean per cent of a heuristic above the proven optimum, 20 goals, tether 350."""

    def measure() -> tuple[str, bool]:
        from solvers import over_optimum

        over = over_optimum(name, range(6), **limits)
        return f"{np.mean(over):.2f} %", float(np.mean(over)) <= most

    return measure


def judged() -> tuple[str, bool]:
    """False tours accepted, and right ones refused, over hostile worlds."""
    import judge

    right, false, refused, accepted = judge.count(100)
    held = not refused and not accepted
    return f"{len(accepted)} of {false} accepted, {len(refused)} of {right} refused", held


def judged_by_kind() -> tuple[str, bool]:
    """Right and false tours in whole-number worlds, touching boxes, rooms and others."""
    import judge

    found = judge.tally(4, 12).values()
    refused = sum(len(t.refused) for t in found)
    accepted = sum(len(t.accepted) for t in found)
    kinds = len({name for t in found for name in t.false})
    right, false = sum(t.worlds for t in found), sum(t.false.total() for t in found)
    text = f"{accepted} of {false} of {kinds} kinds accepted, {refused} of {right} refused"
    return text, not refused and not accepted and kinds >= 40


def repeatable() -> tuple[str, bool]:
    """Pairs of runs in new processes, with other hash seeds and numbers of threads, to the byte."""
    import repeat

    same, pairs = repeat.pairs(20)
    return f"{same} of {pairs}", same == pairs


def overrun() -> tuple[str, bool]:
    """Seconds beyond a limit of one to three, over solvers, on large problems."""
    import limits

    worst, where, silent, unbounded = limits.worst(1.0)
    shown = f"{worst:.2f} s ({where}); {silent} without a tour, {unbounded} of auto without a bound"
    return shown, worst <= 1.0 and not unbounded


def wharf() -> tuple[str, bool]:
    """The README's problem: proven, of the stated length, with the stated longest tether."""
    from netsp import Problem, Status, solve, verify

    problem = Problem.load(ROOT / "problems" / "wharf.json")
    solution = solve(problem)
    longest = max(v.tether_length for v in solution.tour)
    held = solution.status is Status.OPTIMAL and bool(verify(problem, solution))
    held &= abs((solution.length or 0.0) - 51.964548) < 1e-5 and abs(longest - 19.1393) < 1e-4
    return f"{solution.length:.6f}, longest tether {longest:.4f}, {solution.status.value}", held


def deterministic() -> tuple[str, bool]:
    """Heuristics that have no limit of time, over the same ten worlds, against the published table:
    mean per cent over the optimum."""
    from solvers import over_optimum

    cases = {
        "reduced-mip": ("reduced-mip", {}),
        "reduced-mip, classes=1 polish=0 (the paper's)":
            ("reduced-mip", {"params": {"classes": 1, "polish": 0}}),
        "greedy": ("greedy", {}),
        "greedy, retrace=tether": ("greedy", {"params": {"retrace": "tether"}}),
        "greedy-2016": ("greedy-2016", {}),
    }  # fmt: skip
    table = {r["solver"]: float(r["mean %"]) for r in published("heuristics")}
    off = {
        name: float(np.mean(over_optimum(solver, range(10), **how))) - table[name]
        for name, (solver, how) in cases.items()
    }
    name = max(off, key=lambda k: abs(off[k]))
    return f"{off[name]:+.2f} points ({name})", abs(off[name]) <= 0.1


def convergence() -> tuple[str, bool]:
    """The optimum over PRM* against the exact one, by samples, as published."""
    import roadmaps

    table = {int(r["samples"]): r for r in published("prm-convergence")}
    found, pulled, _ = roadmaps.ratios([1000, 4000], worlds=2, seeds=1)
    held = all(max(found[n]) <= float(table[n]["max"]) * 1.005 for n in found)
    held &= min(map(min, found.values())) >= 1.0 - 1e-9
    held &= max(map(max, pulled.values())) <= 1.01
    shown = ", ".join(f"{n}: {np.median(r):.4f}" for n, r in found.items())
    return f"{shown}; pulled taut {max(map(max, pulled.values())):.4f}", held


def studies_again() -> tuple[str, bool]:
    """Trials of the papers' studies that depend on no clock, run again: the published rows."""
    import studies

    same, differs = studies.again(worlds=1, most_goals=10)
    return f"{same} of {same + len(differs)}" + (f": {differs[0]}" if differs else ""), not differs


def systematic_paths() -> tuple[str, bool]:
    """Compare the systematic paths of the wharf again, as published."""
    import studies

    rows = {r["path"]: r for r in studies.compared_paths().rows()}
    held = all(
        f"{rows[r['path']]['length']:.2f}" == r["ours m"]
        and f"{rows[r['path']]['order_length']:.2f}" == r["order at best m"]
        and (rows[r["path"]]["free"] == (r["home"] == "free"))
        for r in published("icra2017-table2")
    )
    shown = ", ".join(f"{r['longer_by_percent']:.1f} %" for r in rows.values())
    return shown, held


def reduced_as_published() -> tuple[str, bool]:
    """Mean % over the optimum of the paper's reduced program, of the kept rows of its Fig. 5."""
    import numpy as np

    import studies

    rows, _ = studies.load("icra2017-fig5")
    means = [
        float(np.mean(studies.over(rows, "reduced-mip (paper)", goals=20, tether_length=t)))
        for t in (200, 250, 300)
    ]
    return ", ".join(f"{m:.1f}" for m in means) + " %", max(means) <= 5.2


def published_program() -> tuple[str, bool]:
    """`mip-2017` beside `mip` on a world of ten goals at tether 200."""
    from netsp import solve_graph
    from netsp.plan.random_worlds import reachable_world
    from netsp.plan.solve_problem import travel_graph

    world, _ = reachable_world(0, goals=10, tether_length=200.0, obstacles=(1, 20))
    graph = travel_graph(world)
    theirs, ours = (solve_graph(graph, name, time_limit=60.0) for name in ("mip-2017", "mip"))
    if theirs.length is None or ours.length is None:
        return "no tour", False
    ratio = theirs.length / ours.length
    return f"{ratio:.9f} of it", abs(ratio - 1.0) <= 1e-6 and theirs.status.is_optimal


def proven_within(goals: int, tether: float, limit: float) -> tuple[str, bool]:
    """Measure whether the first world of a cell is proven within a limit, s of the reference
    machine."""
    import frontier
    from machine_speed import slowness

    limit *= slowness()
    outcome = frontier.proof(frontier.world(0, goals, tether, many=False), limit)
    return f"{outcome.gap:.2f} % after {outcome.seconds:.0f} s", outcome.verified and outcome.proven


def merged() -> tuple[str, bool]:
    """Measure the tour of the fourth world of 200 goals at tether 300 after a minute of the
    reference machine; a search alone ends in 4793.18 m at best."""
    import frontier
    from machine_speed import slowness

    from netsp import solve, verify

    problem = frontier.world(3, 200, 300.0, many=False)
    found = solve(problem, time_limit=60.0 * slowness())
    length = found.length or np.inf
    return f"{length:.2f} m", bool(verify(problem, found)) and length < 4792.0


def raw_model() -> tuple[str, bool]:
    """How many times faster a proof is than CBC on the raw model; both are given ten seconds, and
    where CBC has no proof it counts with its ten seconds."""
    import frontier
    import peers

    from netsp import travel_graph

    other = travel_graph(frontier.world(1, 20, 300.0, many=False))
    peers.ours("auto")(other, 10.0)  # compiled code is read before it counts
    graph = travel_graph(frontier.world(0, 20, 300.0, many=False))
    graph.costs  # noqa: B018
    spent = []
    for run in (peers.ours("auto"), peers.raw("cbc")):
        begin = time.perf_counter()
        run(graph, 10.0)
        spent.append(time.perf_counter() - begin)
    ratio = spent[1] / spent[0]
    return f"{ratio:.0f} times", ratio >= 5.0


def seconds_of(goals: int, tether: float, worlds: int, published_s: float) -> Claim:
    """CPU seconds from problem to proof: the median of some worlds."""

    def measure() -> tuple[str, bool]:
        import frontier

        spent = []
        for seed in range(worlds):
            begin = time.process_time()
            frontier.proof(frontier.world(seed, goals, tether, many=False), 120.0)
            spent.append(time.process_time() - begin)
        middle = statistics.median(spent)
        return f"{middle:.2f} s CPU", middle <= ALLOWANCE * published_s

    name = f"proof of {goals} goals, tether {tether:g}"
    return Claim(name, f"{published_s:g} s CPU (x {ALLOWANCE:g})", measure, timed=True)


def proposals() -> tuple[str, bool]:
    """Proposals of annealing a second of CPU, over the published rate."""
    from solvers import world

    from netsp import solve_graph

    rate = float(published("proposals")[0]["median"].replace(",", ""))
    _, graph, _ = world(0, 20, 350.0)
    solve_graph(graph, "anneal", iteration_limit=100)
    begin = time.process_time()
    solve_graph(graph, "anneal", iteration_limit=5_000_000)
    ratio = 5e6 / (time.process_time() - begin) / rate
    return f"{ratio:.2f} of the published", ratio >= 1.0 / ALLOWANCE


def records() -> tuple[str, bool]:
    """Proven tours of the library found and proven again, and judged."""
    from netsp import Status, solve
    from netsp.study.library import Library

    library = Library(ROOT / "problems" / "library")
    names = ("jacket-8-0", "maze-15-2", "harbour-50-1", "clustered-20-3", "jetty-8-1",
             "random-50-300-0")  # fmt: skip
    again = 0
    for name in names:
        found = solve(library.problem(name), time_limit=60.0, seed=1)
        same = abs((found.length or 0.0) / library.records[name].length - 1.0) < 1e-6
        verdict = library.compared(found).verification
        again += bool(same and verdict and found.status is Status.OPTIMAL)
    return f"{again} of {len(names)}", again == len(names)


def published_proofs() -> tuple[str, bool]:
    """Every fourth published proof of the library: those that hold and show what their records
    state."""
    from netsp.base.errors import VerificationError
    from netsp.study.library import Library

    library = Library(ROOT / "problems" / "library")
    count = held = 0
    for name in [name for name in library if library.records[name].proof is not None][::4]:
        try:
            checked = library.check_published(name)
        except VerificationError:
            count += 1
            continue
        count, held = count + (checked is not None), held + (checked is not None)
    return f"{held} of {count}", 0 < count == held


def certified() -> tuple[str, bool]:
    """Level of the certificate of the shipped problem with most classes."""
    from netsp import Problem, solve
    from netsp.plan.proof.certify import certify

    problem = Problem.load(ROOT / "problems" / "lillgrund-part.json")
    level = certify(problem, solve(problem)).level
    return level, level == "optimal"


def many_classes() -> tuple[str, bool]:
    """Measure the gap in per cent of a wind farm of 25 turbines after 20 s of the reference
    machine."""
    from machine_speed import slowness

    from netsp import Problem, solve, verify

    problem = Problem.load(ROOT / "problems" / "library" / "windfarm-25-0.json")
    found = solve(problem, time_limit=20.0 * slowness())
    gap = 100.0 * (found.gap if found.gap is not None else 1.0)
    return f"{gap:.2f} %", bool(verify(problem, found)) and gap <= 5.0


def any_gtsp() -> tuple[str, bool]:
    """Random GTSPs without a base, as small as can be tried out, and the shipped instance."""
    import gtsp

    same, count = gtsp.against_brute_force(20)
    return f"{same} of {count}", same == count


def larger_gtsp() -> tuple[str, bool]:
    """Generalised TSPs of 40 clusters of points on a square, from costs to proof."""
    import gtsp

    from netsp import Status, TravelGraph, solve_graph

    graphs = [TravelGraph.from_costs(*gtsp.instance(40, s), base=None) for s in range(3)]
    proven = sum(solve_graph(g, time_limit=60.0).status is Status.OPTIMAL for g in graphs)
    return f"{proven} of {len(graphs)}", proven == len(graphs)


def pulled() -> tuple[str, bool]:
    """Legs pulled along their words: share that failed, off a search, and microseconds each."""
    import legs

    failed = worst = longest = 0.0
    for _, problem in legs.problems():
        roadmap = legs.TautRoadmap(problem)
        pairs, chosen = legs.some_legs(roadmap, 2000)
        _, off = legs.off(roadmap.paths, chosen[:100])
        measure = functools.partial(roadmap.legs._pull_pairs, pairs[:, 0], pairs[:, 1])
        share, each = (measure() < 0.0).mean(), legs.microseconds(measure, len(pairs))
        failed, worst, longest = max(failed, share), max(worst, off), max(longest, each)
    held = failed <= 0.01 and worst <= 1e-9 and longest <= 20.0
    return f"{100 * failed:.1f} % failed, {worst:.0e} off, {longest:.1f} µs at most", held


def legs_at_once() -> tuple[str, bool]:
    """All legs of 20 goals at tether 500, and how far some are off those pulled by themselves."""
    import legs
    import numpy as np

    slowest = worst = 0.0
    for seed in range(5):
        slowest = max(slowest, legs.all_legs(seed, 20, 500.0)[1])
        roadmap = legs.TautRoadmap(legs.random_world(seed, goals=20, tether_length=500.0))
        pairs, _ = legs.some_legs(roadmap, 2000, seed)
        whole = roadmap.legs.lengths(np.arange(len(roadmap.cluster)))[pairs[:, 0], pairs[:, 1]]
        alone = roadmap.legs.pairs(pairs[:, 0], pairs[:, 1])
        worst = max(worst, float(np.abs(whole / alone - 1.0).max()))
    return f"{slowest:.2f} s at most, {worst:.0e} off", slowest <= 1.0 and worst <= 1e-9


def covers() -> tuple[str, bool]:
    """What covers of 450 cells leave of the gap, of 100 goals at tether 500."""
    import frontier

    from netsp import travel_graph
    from netsp.gtsp.limits import Limits
    from netsp.mip.goal_relaxation import CoverCosts, bound_over_goals
    from netsp.mip.mip_policy import CoverPolicy, MipPolicy
    from netsp.mip.mip_solver import MipRun

    graph = travel_graph(frontier.world(4, 100, 500.0, many=False))
    run = MipRun(graph, Limits(rng=np.random.default_rng(0)), search_rounds=1000)
    run.find_first_tour()
    run.search_near_incumbent()
    costs = graph.costs_rounded(np.arange(len(graph)))
    policy = MipPolicy(covers=CoverPolicy(max_cells=450))
    found = bound_over_goals(
        graph, lambda *_: None, Limits(), run.tour, CoverCosts(lambda: costs), policy=policy
    )
    gap = 100.0 * (1.0 - found.bound / run.length)
    return f"{gap:.1f} %", gap <= 4.3


def memory() -> tuple[str, bool]:
    """Legs kept of all, and memory taken until they are known, with 20,361 classes."""
    import memory as module
    from resumed import outcomes

    job = (module.LIBRARY, 300.0)  # it takes some ten seconds, whatever the limit
    (found,) = outcomes([job], module.of_library, module.Outcome, workers=1, file=None)
    held = found.verified and found.kept <= 0.5 and found.peak <= 0.8
    return f"{found.kept:.2f} % of the legs, {found.peak:.2f} GiB", held


def claims() -> Iterator[Claim]:
    """All of these."""
    cells = [(n, t) for n in (5, 10, 15, 20) for t in (200, 250, 300, 350)]
    long = [(20, 500), (40, 300), (60, 300)]
    yield seconds_of(15, 200.0, 5, 0.2)
    yield seconds_of(20, 350.0, 5, 1.0)
    yield seconds_of(60, 350.0, 1, 12.0)
    yield seconds_of(100, 300.0, 1, 15.0)
    yield Claim("proposals of anneal", "as published (/ 3)", proposals, timed=True)
    yield Claim(
        "beyond a time limit of 1 s, every solver", "1 s; auto has a bound", overrun, timed=True
    )
    yield Claim("legs pulled along their words", "1 %, 1e-9, 20 µs", pulled, timed=True)
    yield Claim("all legs of 20 goals at tether 500", "1 s, 1e-9", legs_at_once, timed=True)
    yield Claim("covers: gap over 450 cells, 100 goals at tether 500", "4.3 %", covers)
    yield Claim("memory: maze-30-0, 20,361 classes", "0.5 % of the legs, 0.8 GiB", memory)
    yield Claim("the README's wharf", "51.964548, tether 19.1393, proven", wharf)
    yield Claim(
        "Table I: proven and verified", "48 of 48 worlds", functools.partial(proofs, cells, 3, 60.0)
    )
    yield Claim(
        "frontier: 20/500, 40/300, 60/300", "9 of 9 worlds",
        functools.partial(proofs, long, 3, 120.0),
    )  # fmt: skip
    yield Claim(
        "50 circles: 60/300", "1 of 1 world",
        functools.partial(proofs, [(60, 300)], 1, 300.0, many=True),
    )  # fmt: skip
    yield Claim(
        "largest: 60/500, first world, 90 s", "proven",
        functools.partial(proven_within, 60, 500.0, 90.0), timed=True, beside=True,
    )  # fmt: skip
    yield Claim(
        "wind farm of 25 turbines after 20 s", "gap 5 %", many_classes, timed=True, beside=True
    )
    yield Claim("library: proven tours found and proven again", "6 of 6", records)
    yield Claim("library: published proofs that hold, of a quarter", "all", published_proofs)
    yield Claim("lillgrund-part: certificate", "optimal", certified)
    yield Claim("GTSPs without a base against brute force", "all", any_gtsp)
    yield Claim("GTSPs of 40 clusters in 60 s", "3 of 3 proven", larger_gtsp)
    yield Claim("20/300 over CBC on the raw model", "5 times faster", raw_model)
    yield Claim("bounds above the optimum", "none", bounds)
    yield Claim("bounds over few classes above the optimum over all", "none", restricted_bounds)
    yield Claim(
        "largest: 200/300, first world, 150 s", "proven",
        functools.partial(proven_within, 200, 300.0, 150.0), timed=True, beside=True,
    )  # fmt: skip
    yield Claim("merged: 200/300, fourth world, 60 s", "4792 m", merged, timed=True, beside=True)
    yield Claim("lns over the optimum, 1 s", "0.01 %", heuristic("lns", 0.01, time_limit=1.0))
    yield Claim(
        "anneal over the optimum, 20 M proposals", "3 %",
        heuristic("anneal", 3.0, iteration_limit=20_000_000),
    )  # fmt: skip
    yield Claim("heuristics without a clock", "as published", deterministic)
    yield Claim("PRM* over the exact optimum", "as published", convergence)
    yield Claim(
        "reduced program of 2017, 20 goals: mean over the optimum", "5.2 %", reduced_as_published
    )
    yield Claim("mip-2017, 10 goals, tether 200", "the optimum of mip, proven", published_program)
    yield Claim("the papers' studies, trials without a clock", "as published", studies_again)
    yield Claim("systematic paths of the wharf over the tour", "as published", systematic_paths)
    yield Claim("false tours accepted, right ones refused", "none", judged)
    yield Claim(
        "false tours of 40 kinds accepted, right ones refused, in degenerate worlds", "none",
        judged_by_kind,
    )  # fmt: skip
    yield Claim("same seed, same bytes", "all pairs", repeatable)
