"""Claims about maps, tether lengths and bases."""

from __future__ import annotations

import itertools
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from table import ROOT

from claims.claim import ABSENT, ALLOWANCE, DATA, Claim


def examples() -> tuple[str, bool]:
    """Both example sites: proven, verified, and back from the map that an export writes."""
    from netsp import Status, solve, verify
    from netsp.exchange.maps import read_site
    from netsp.exchange.missions import export

    harbour = read_site(ROOT / "examples" / "harbour.kml")
    tank = read_site(
        ROOT / "examples" / "tank.dxf", tether=25.0, clearance=0.2, units="mm",
        maps=[("obstacle", "COLUMNS")],
    )  # fmt: skip
    found = [solve(p) for p in (harbour, tank)]
    good = all(
        f.status is Status.OPTIMAL and bool(verify(p, f))
        for p, f in zip((harbour, tank), found, strict=True)
    )
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "again.geojson"
        export(harbour, found[0], file, "geojson")
        again = solve(read_site(file))
    off = abs((again.length or np.inf) / (found[0].length or 1.0) - 1.0)
    lengths = ", ".join(f"{f.length:.3f} m" for f in found)
    return f"{lengths}; back from its export {off:.0e} off", good and off < 1e-5


def curve() -> tuple[str, bool]:
    """Steps of tether curves beside solves at each and just below."""
    from sizing import world

    from netsp import InfeasibleError, Problem, solve
    from netsp.plan.sizing import tether_curve

    agree = count = 0
    for problem in (Problem.load(ROOT / "problems" / "wharf.json"), world(8, 4, 330.0)):
        found = tether_curve(problem)
        below: float | None = None
        for step in found.steps:
            at = problem.model_copy(update={"tether_length": step.tether * (1.0 + 1e-6)})
            under = problem.model_copy(update={"tether_length": step.tether * (1.0 - 1e-6)})
            try:
                length = solve(under).length
            except InfeasibleError:
                length = None
            count += 2
            agree += bool(np.isclose(solve(at).length or 0.0, step.length, rtol=1e-6))
            agree += length is below or bool(np.isclose(length or 0.0, below or -1.0, rtol=1e-6))
            below = step.length
    return f"{agree} of {count} solves agree", agree == count


def base(most: float) -> Callable[[], tuple[str, bool]]:
    """100 candidates of the wharf and of a world of 20 goals: CPU seconds, and the proof."""

    def measure() -> tuple[str, bool]:
        from sizing import PROBLEMS, world

        from netsp import Problem
        from netsp.plan.sizing import best_base
        from netsp.plan.sizing.candidates import over_grid

        shown, good = [], True
        for problem in (Problem.load(PROBLEMS / "wharf.json"), world(20, 1, 300.0)):
            begin = time.process_time()
            found = best_base(problem, over_grid("10,10", problem))
            took = time.process_time() - begin
            shown.append(f"{took:.0f} s" + ("" if found.proven else ", not proven"))
            good = good and found.proven and took <= ALLOWANCE * most
        return "; ".join(shown), good

    return measure


def margined() -> tuple[str, bool]:
    """Worlds whose obstacles are off by a tour's margin, of which none may not fit."""
    from perturbed import violations
    from sizing import world

    from netsp import Problem, solve
    from netsp.plan.sizing import margins

    bad = count = 0
    for problem, margin in (
        (Problem.load(ROOT / "problems" / "wharf.json"), 0.3), (world(10, 1, 330.0), 0.0),
    ):  # fmt: skip
        solution = solve(problem, margin=margin)
        found = margins(problem, solution).obstacles
        assert found >= margin * (1.0 - 1e-9)
        bad += violations(problem, solution, found, 200, seed=1)
        count += 200
    return f"{bad} of {count} worlds", bad == 0


def farm() -> tuple[str, bool]:
    """67 turbines with 9 km of tether, 40 s: a verified tour, and a bound that says what it is."""
    from sizing import farm as site

    from netsp import Status, solve, verify

    if not (DATA / "dudgeon.geojson").is_file():
        return ABSENT, True
    problem, left_out = site(DATA, "dudgeon", None, 9000.0)
    begin = time.perf_counter()
    found = solve(problem, time_limit=40.0)
    took = time.perf_counter() - begin
    honest = found.status in (Status.FEASIBLE, Status.OPTIMAL_OF_KEPT, Status.OPTIMAL)
    good = honest and bool(verify(problem, found)) and left_out == 0 and len(found.tour) == 67
    return f"{found.length:.0f} m, {found.status.value}, {took:.0f} s", good and took <= 60.0


def arranged() -> tuple[str, bool]:
    """Orders given in part, of docs/reference/solvers.md; the same lengths, proven."""
    from arranged import arranged as world

    from netsp import Status, solve, verify

    lengths, good = [], True
    for goals, seed, ties, length in ((12, 1, 6, 1244.0), (16, 2, 8, 2092.0), (20, 4, 40, 2962.5)):
        problem = world(goals, seed, ties)[1]
        found = solve(problem, time_limit=60)
        lengths.append(f"{found.length:.1f}")
        good &= found.status is Status.OPTIMAL and bool(verify(problem, found))
        good &= abs((found.length or 0.0) - length) < 0.06
    return f"{', '.join(lengths)}, {'proven' if good else 'NOT all proven, or other lengths'}", good


def formats() -> tuple[str, bool]:
    """An occupancy image and maps of other formats: the example basin, proven."""
    from netsp import Status, solve, verify
    from netsp.exchange.maps.csv_table import from_table
    from netsp.exchange.maps.occupancy import read_occupancy

    places, names = from_table(ROOT / "examples" / "basin-goals.csv")
    goals = [{"position": p, "name": n} for p, n in zip(places.tolist(), names, strict=True)]
    problem = read_occupancy(
        ROOT / "examples" / "basin.yaml", (6.0, 8.0), goals, 60.0, clearance=0.3
    )
    found = solve(problem)
    good = found.status is Status.OPTIMAL and bool(verify(problem, found))
    return f"{found.length:.2f} m among {len(problem.obstacles)} polygons", good


def spellings() -> tuple[str, bool]:
    """One cloud in every order of columns, with each separator, decimal sign and encoding."""
    from netsp.world.scene.readers import read_cloud_file

    points = np.random.default_rng(60).uniform(-9.0, 9.0, (40, 3)).round(3) - (0.0, 0.0, 10.0)
    columns = {
        "id": np.arange(40.0), "Easting": points[:, 0], "Northing": points[:, 1],
        "depth (ft)": -points[:, 2] / 0.3048,
    }  # fmt: skip
    tried = wrong = 0
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "cloud.csv"
        for head in itertools.permutations(columns):
            rows = np.column_stack([columns[name] for name in head])
            for separator, decimal in ((",", "."), (";", ","), ("\t", "."), ("\t", ",")):
                lines = [separator.join(head)]
                lines += [
                    separator.join(f"{v:.6f}".replace(".", decimal) for v in row) for row in rows
                ]
                for encoding in ("utf-8", "utf-8-sig", "utf-16"):
                    file.write_bytes("\r\n".join(lines).encode(encoding))
                    tried += 1
                    wrong += not np.allclose(read_cloud_file(file).points, points, atol=1e-5)
    return f"{wrong} of {tried} wrong", wrong == 0


def chart() -> tuple[str, bool]:
    """Import of the chart of docs/guide/bring-your-site-in.md, and a proven tour of its piers."""
    from netsp import Status, solve, verify
    from netsp.exchange.maps.options import InspectionOptions, SiteOptions
    from netsp.exchange.maps.projection import Projection
    from netsp.exchange.maps.selection import Selection
    from netsp.exchange.maps.site_import import import_site
    from netsp.roadmap.reachable_goals import keep_reachable_goals

    file = DATA / "charts" / "US5MIACB.000"
    if not file.is_file():
        return ABSENT, True
    options = SiteOptions(
        tether=150.0, radius=1.0, line_width=1.0, floor=True,
        inspection=InspectionOptions(1, 3.0, chosen=Selection.parse([("layer", "SLCONS")])),
    )  # fmt: skip
    begin = time.process_time()
    found = import_site(file, Projection(25.77854, -80.18550), options=options)
    problem, _ = keep_reachable_goals(found.problem, found.viewpoints)
    read = time.process_time() - begin
    assert problem.site is not None
    layers = problem.site.imported
    features = sum(layer.features for layer in layers)
    used = sum(sum(layer.used.values()) for layer in layers)
    left_out = sum(group.features for layer in layers for group in layer.left_out)
    begin = time.process_time()
    tour = solve(problem, time_limit=30.0)
    took = time.process_time() - begin
    good = used + left_out == features and read <= 60.0 and len(tour.tour) == len(problem.goals)
    good &= tour.status is Status.OPTIMAL and bool(verify(problem, tour))
    return (
        f"{used} of {features} features used, {left_out} left out; {len(problem.goals)} goals, "
        f"{len(problem.obstacles)} obstacles, {read:.1f} s; tour {tour.length:.1f} m in "
        f"{took:.1f} s",
        good,
    )  # fmt: skip


def claims() -> Iterator[Claim]:
    """All of this file."""
    yield Claim(
        "a cloud in every order, separator, decimal sign, encoding", "none wrong", spellings
    )
    yield Claim("example sites, and back from their export", "proven; 1e-5", examples)
    yield Claim("an occupancy image planned on", "proven, verified", formats)
    yield Claim("orders given in part, 12 to 20 goals", "lengths of the docs, proven", arranged)
    yield Claim("curves of tether lengths beside solves", "all agree", curve)
    yield Claim(
        "where to stand, 100 places", "60 s each, proven", base(60.0), timed=True, beside=True
    )
    yield Claim("worlds that are off by a tour's margin and do not fit", "none", margined)
    yield Claim("a wind farm of 67 goals, 9 km of tether", "a verified tour in 60 s", farm)
    yield Claim("a chart imported and its piers toured", "all accounted for, proven; 60 s", chart)
