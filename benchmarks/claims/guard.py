"""Claims about the guard beside a vehicle, and tours flown."""

from __future__ import annotations

import sys
from collections.abc import Iterator

from table import ROOT

from claims.claim import Claim

sys.path.insert(0, str(ROOT))


def recordings() -> tuple[str, bool]:
    """Words at the goals of the recorded flights, and no loop told of."""
    import guard_tracks as bench
    import numpy as np

    from netsp.hsignature import concatenate, crossings
    from netsp.model.solution import Solution
    from netsp.online.guard.telemetry import Fix
    from netsp.online.guard.tether_guard import Guard, GuardOptions

    right = goals = loops = 0
    for name in (*bench.SHIPPED, "r1", "r4"):
        problem, true = bench.recorded(name)
        tour = Solution.load(bench.RECORDED / f"tour-{name}.json")
        watching = Guard(problem, GuardOptions(noise=0.02, drift=0.01))
        nearest: dict[int, tuple[float, bool]] = {}
        for k, place in enumerate(true):
            report = watching.update(Fix(k * bench.DT, tuple(place), estimate=True))
            loops += any(a.kind == "loop" for a in report.raised)
            for visit in tour.tour:
                goal = np.array(problem.goals[visit.goal].position)
                far = float(np.linalg.norm(place - goal))
                if far < nearest.get(visit.goal, (9.0, False))[0]:
                    step = np.array([report.position, goal])
                    word = concatenate(
                        report.classes[0].word, crossings(step, problem.representative_points)
                    )
                    nearest[visit.goal] = far, word == visit.signature
        goals += len(tour.tour)
        right += sum(good for _, good in nearest.values())
    return f"{right} of {goals} words, {loops} loops told of", right == goals and loops == 0


def believed() -> tuple[str, bool]:
    """The true class in noise at the end of the wharf's recording, in a case where it was once lost
    for good, and of the pool's, where buoys stand as near to one another as the position is
    uncertain."""
    from belief import LITTLE, shares_of_truth

    found = [shares_of_truth("recorded", seed, n) for seed, n in ((0, 1), (1, 1))]
    lost = sum(float(shares[-1]) < LITTLE for shares in found)
    means = ", ".join(f"{shares.mean():.2f}" for shares in found)
    return f"{lost} of {len(found)}; share {means} in the mean", lost == 0


def flown() -> tuple[str, bool]:
    """The pool's tour on the fake autopilot."""
    from netsp import solve
    from netsp.model.problem import Problem
    from netsp.online.execute.execution_log import ExecutionOptions
    from netsp.online.fly.flight_rehearsal import rehearse
    from netsp.online.fly.tour_flight import fly
    from netsp.online.link.address import Address
    from netsp.online.link.geo_frame import Frame
    from netsp.online.link.session import Session
    from netsp.online.link.udp import UdpLink
    from tests.autopilot import Autopilot

    problem = Problem.load(ROOT / "problems" / "pool.json")
    tour, pace = solve(problem), 8.0
    rehearse()
    with Autopilot(
        pace=pace, noise=0.02, drift=0.03, smooth=1.0, params={"FS_GCS_TIMEOUT": 12}
    ) as autopilot:
        link = UdpLink(Address(True, "127.0.0.1", autopilot.port))
        session = Session(link, Frame(problem), 1, pace)
        try:
            autopilot.until(lambda: session.latest.position is not None)
            session.command(400, 1)
            autopilot.until(lambda: session.latest.armed is True)
            s = fly(problem, tour, session, ExecutionOptions(speed=0.5, reach=0.3)).summary
        finally:
            session.close()
    good = s["status"] == "done" and s["visited"] == len(problem.goals) and s["tether_free"]
    words = f"{s['arrivals_as_planned']} of {len(problem.goals) + 1} words"
    return f"{s['visited']} goals, {words}", good and s["arrivals_as_planned"] == s["visited"] + 1


def in_space() -> tuple[str, bool]:
    """A planned mission, flown, with a guard beside."""
    from guard_space import beside_flight
    from sites import shipped

    from netsp.plan.space.mission_solver import solve_mission
    from netsp.world.simulator.mission_run import simulate

    mission, scene = shipped("basin")
    found = solve_mission(mission, scene=scene)
    log = (found.run or simulate(found.mission, scene=scene)).log
    counts, longest, _, free = beside_flight(found.mission, scene, log, 0.0, 0.0)
    flown = max(r.tether for r in log)
    good = counts[0] == sum(counts) and free and abs(longest - flown) <= 0.05
    return f"{counts[0]} of {sum(counts)} stops, {longest:.2f} of {flown:.2f} m", good


def loops() -> tuple[str, bool]:
    """Loops put into two drives, in noise: those of which nothing is said, false warnings, and what
    is told of too late."""
    from guard import LEAD, LONGER, one

    found = [one(("pilot", 5, 4, True)), one(("bluerov2", 1, 4, True))]
    count, silent = sum(o.loops for o in found), sum(o.silent for o in found)
    wrong = sum(o.wrong for o in found)
    words = [word for o in found for _, word, seen in o.allowed if seen >= LONGER]
    late = sum(word < LEAD for word in words)
    told = f"{silent} of {count} silent, {wrong} false, {late} of {len(words)} late"
    return told, bool(words) and not silent + wrong + late


def claims() -> Iterator[Claim]:
    """All of this file."""
    yield Claim("guard: words at the goals of five recorded flights", "34 of 34", recordings)
    yield Claim("guard: true class below 5 % at the end, in noise", "0 of 2", believed)
    yield Claim("guard: loops told of late or not, in noise", "none, none false", loops)
    yield Claim("guard: stops of the flown basin mission as planned", "97 of 97", in_space)
    # at eight times the pace of a vehicle a machine that is busy is a lost link
    yield Claim("fly: the pool on a fake autopilot", "all, as planned, free", flown, timed=True)
