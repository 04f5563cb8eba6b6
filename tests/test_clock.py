"""One clock for a whole run: compiled loops hear it, and nothing goes on for long after it."""

import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from netsp import Problem, Status, solve, solve_graph, travel_graph, verify
from netsp.base.bounded_work import BOUNDED, end_if_abandoned, is_abandoned_work_running
from netsp.base.clock import Clock, TimingPolicy
from netsp.base.compiled.compile_policy import everything_compiled
from netsp.base.errors import InputError, LimitReachedError, MemoryLimitError
from netsp.base.ram import available_memory, check_available
from netsp.base.time_flags import NEVER
from netsp.mip.cutpool import CutPool
from netsp.mip.cuts import Cut
from netsp.plan.random_worlds import random_world, reachable_world
from netsp.plan.space.mission_policy import MissionPolicy
from netsp.plan.space.mission_solver import solve_mission
from netsp.world.mission.mission import Mission
from netsp.world.scene.scene import Scene
from tests.clock_sites import watched

MAX_CPU_S = 3.0
"""Maximum CPU time of a run of 0.3 s with its grace, s; a busy machine needs more for the same."""


def test_a_flag_is_set_when_the_time_is_up_and_not_before():
    clock, late = Clock(1.0), Clock(600.0)
    flag = clock.flag
    assert (flag[0], late.flag[0], Clock().flag[0], NEVER[0]) == (0, 0, 0, 0)
    for _ in range(400):  # a thread sets it, which may wait for a processor
        if flag[0]:
            break
        time.sleep(0.05)
    assert flag[0] == 1
    assert clock.is_up
    assert late.flag[0] == 0
    with pytest.raises(LimitReachedError, match="while counting"):
        clock.check("counting")


def test_a_clock_within_another_does_not_outlast_it():
    outer = Clock(5.0)
    assert Clock(50.0, within=outer).left <= 5.0
    assert Clock(1.0, within=outer).left <= 1.0
    assert Clock.from_limit(outer).left <= 5.0
    assert Clock.from_limit(None).limit is None


def test_a_call_in_a_thread_gives_its_result_and_its_error():
    assert Clock().interruptible(lambda: 7) == 7
    with pytest.raises(ZeroDivisionError):
        Clock().interruptible(lambda: 1 // 0)


@pytest.mark.parametrize("solver", ["auto", "mip", "lns", "greedy", "anneal"])
def test_a_limit_of_nothing_still_gives_a_tour_that_holds(solver):
    problem = random_world(0, goals=30, tether_length=350.0)
    solution = solve(problem, solver, time_limit=1e-6)
    assert solution.status in (Status.FEASIBLE, Status.OPTIMAL_OF_KEPT)
    assert verify(problem, solution)


def test_a_graph_made_without_a_limit_keeps_to_that_of_its_solver():
    graph = travel_graph(random_world(0, goals=60, tether_length=450.0))
    solve_graph(travel_graph(random_world(0, goals=10, tether_length=450.0)), "mip", time_limit=2.0)
    begin = time.process_time()
    result = solve_graph(graph, "mip", time_limit=0.5)
    assert result.tour is not None
    # ten times the promise: `make accept` measures the second
    assert time.process_time() - begin < 10.0
    assert graph.clock is None


def test_memory_is_asked_for_before_it_is_taken():
    check_available(1e3, "a crumb", "nothing")
    assert available_memory() > 0
    with pytest.raises(MemoryLimitError, match=r"legs would take .* GiB of memory.*lower tether"):
        check_available(1e18, "legs", "lower tether_length")


def test_a_cut_pool_never_gives_one_cut_the_count_of_another():
    """Counters go with their cuts, however cuts are replaced, dropped and added."""
    rng = np.random.default_rng(0)
    pool, counts = CutPool(), {}
    made = 0
    for _ in range(300):
        new = [Cut(np.ones(3, dtype=bool), made + k) for k in range(int(rng.integers(0, 4)))]
        # one in five is there for good
        made += len(new)
        for cut in new:
            pool.add([cut], permanent=cut.cluster % 5 == 0)
        counts |= {c.cluster: 0 for c in new}
        prices = np.where(rng.random(len(pool)) < 0.2, -1.0, 0.0)
        slack = np.where(rng.random(len(pool)) < 0.5, 1.0, 0.0)
        pool.count(prices, slack)
        for cut, price, room in zip(pool.cuts, prices, slack, strict=True):
            counts[cut.cluster] = 0 if price < 0 else counts[cut.cluster] + (2 if room else 1)
        # restricted to other vertices, every cut is a new object
        pool.replace([Cut(c.inside.copy(), c.cluster) for c in pool.cuts])
        assert [counts[c.cluster] for c in pool.cuts] == pool.idle.tolist()
        active = pool.active()
        if active is not None:
            pool.keep(active)
            assert (pool.idle[~pool.permanent] < pool.policy.max_idle_rounds).all()
        assert pool.permanent.tolist() == [c.cluster % 5 == 0 for c in pool.cuts]
        assert pool.permanent.sum() == len(range(0, made, 5))


def test_the_same_iterations_give_the_same_tour_whatever_the_machine_does():
    """The temperature of ruin and recreate falls by rounds, not by how many fit into a moment."""
    problem = random_world(2, goals=25, tether_length=300.0)
    found = set()
    for seconds in (0.02, 1e-9, 10.0):
        params = {"policy.local_search.min_chunk_s": seconds}
        solution = solve(problem, "lns", seed=5, iteration_limit=300, params=params)
        found.add((solution.length, tuple(v.goal for v in solution.tour)))
    assert len(found) == 1


def test_a_problem_far_from_what_matters_keeps_its_tolerances():
    near = Problem(base=(0, 0), goals=[(3, 4)], obstacles=[], tether_length=6)
    rock = {"center": (1e9, 0), "radius": 5}
    far = Problem(base=(0, 0), goals=[(3, 4)], obstacles=[rock], tether_length=6)
    assert far.scale == near.scale
    assert solve(far).length == pytest.approx(10.0, abs=1e-9)


@pytest.mark.parametrize("solver", ["auto", "mip", "dp", "lns", "anneal", "reduced-mip"])
@pytest.mark.parametrize("after", [0.02, 0.5])
def test_a_run_ends_when_it_is_asked_to_with_a_verified_tour(solver, after):
    problem = reachable_world(3, goals=60, obstacles=60, tether_length=300.0)[0]
    begin = time.monotonic()
    asked = []

    def should_stop():
        asked.append(time.monotonic())
        return asked[-1] - begin > after

    threads, before = threading.active_count(), time.process_time()
    found = solve(problem, solver, should_stop=should_stop)
    assert time.process_time() - before < after + 10.0  # all of it would take minutes
    assert found.status in (Status.FEASIBLE, Status.OPTIMAL)
    assert verify(problem, found)
    number = len(asked)
    time.sleep(0.1)
    assert len(asked) == number  # nobody asks any more
    assert threading.active_count() <= threads + 1


def test_what_should_stop_raises_is_raised():
    def broken():
        raise RuntimeError("no such widget")

    problem = reachable_world(3, goals=20, obstacles=20, tether_length=300.0)[0]
    with pytest.raises(RuntimeError, match="no such widget"):
        solve(problem, should_stop=broken)


def test_one_that_never_stops_changes_nothing():
    problem = reachable_world(5, goals=8, obstacles=8, tether_length=300.0)[0]
    plain = solve(problem, "mip")
    asked = solve(problem, "mip", should_stop=lambda: False)
    assert (asked.length, asked.tour, asked.path) == (plain.length, plain.tour, plain.path)


def test_little_work_is_done_whatever_the_time_and_more_of_it_is_not():
    late, few = Clock(1e-9), Clock.policy.untimed_steps
    assert late.finish("adding", few, lambda stop: 7 + stop[0]) == 7
    assert Clock().finish("adding", 1e300, lambda stop: 7 + stop[0]) == 7
    with pytest.raises(LimitReachedError, match="time limit reached while adding"):
        late.finish("adding", few + 1, lambda stop: 7)
    with pytest.raises(InputError, match=r"untimed_steps: expected .* got -1"):
        TimingPolicy(-1)


def _in_order(problem):
    return solve(problem, keep_order=True, time_limit=20.0)


def _by(name):
    return lambda problem: solve(problem, name, time_limit=20.0)


RUNS = {
    "auto": _by("auto"), "mip": _by("mip"), "dp": _by("dp"), "reduced-mip": _by("reduced-mip"),
    "greedy": _by("greedy"), "in order": _in_order,
}  # fmt: skip


@pytest.mark.parametrize("run", RUNS)
def test_wherever_the_clock_is_asked_a_run_whose_time_is_up_there_ends_at_once(run):
    """A clock that fires at every call site once: a loop that does not ask goes on behind one."""
    problem = random_world(3, goals=10, tether_length=300.0)
    RUNS[run](problem)  # compiled code is read before time counts
    with watched() as sites:
        RUNS[run](problem)
    assert sites.asked
    for site, count in sites.asked.items():
        for times in {1, count}:
            with watched(site, times) as fired:
                found = RUNS[run](problem)
            if fired.fired is not None:
                assert fired.overtime < 1.0, (site, times)
            assert verify(problem, found), (site, times)


def _rough_disks(corners):
    """Three islands of many corners, in the way of two goals."""
    rng = np.random.default_rng(0)
    obstacles = []
    for x in (0.0, 100.0, 200.0):
        angle = np.sort(rng.uniform(0.0, 2.0 * np.pi, corners))
        radius = 35.0 * (1.0 + 0.2 * rng.uniform(-1.0, 1.0, corners))
        island = np.column_stack([x + radius * np.cos(angle), 60.0 + radius * np.sin(angle)])
        obstacles.append({"polygon": island.tolist()})
    goals = [(50, 60), (150, 60), (0, 120)]
    return Problem(base=(0, 0), goals=goals, obstacles=obstacles, tether_length=400)


def test_many_corners_end_in_time_and_say_where_it_was_up():
    """Outline, tangents and letters knew no clock: 66,672 corners took 258 s of 60."""
    solve(_rough_disks(100), time_limit=5.0)  # compiled code is read before time counts
    problem = _rough_disks(4000)
    begin = time.process_time()
    with pytest.raises(LimitReachedError, match=r"time limit reached while (outlining|finding)"):
        solve(problem, time_limit=0.3)
    assert time.process_time() - begin < MAX_CPU_S


def _comb(teeth):
    """Return a wall with slanted teeth, all within its box, and goals around it."""
    w = 100.0 / teeth
    ring = [(0.0, 0.0), (100.0, 0.0)]
    for k in reversed(range(1, teeth)):
        x = k * w
        ring += [(x + 0.6 * w, 10.0), (x + 0.1 * w, 10.0), (x + 0.05 * w, 1.0), (x - 0.3 * w, 1.0)]
    ring += [(0.6 * w, 10.0), (0.0, 10.0)]
    goals = [(105, 5), (50, 12), (50, -3)]
    return Problem(base=(-5, 5), goals=goals, obstacles=[{"polygon": ring}], tether_length=160)


def test_a_polygon_of_many_edges_is_not_little_work_because_it_is_one_obstacle():
    """Tangents of a comb with 3,000 corners took 225 s of 5: each is held against every edge."""
    with everything_compiled():
        solve(_comb(25), time_limit=60.0)  # compiled code is read before time counts
    begin = time.process_time()
    with pytest.raises(LimitReachedError, match="time limit reached while finding tangents"):
        solve(_comb(300), time_limit=0.3)
    assert time.process_time() - begin < MAX_CPU_S


def _never_ends():
    while True:
        end_if_abandoned()


def test_work_that_does_not_hear_the_clock_is_abandoned_and_ends_where_it_looks():
    begin = time.process_time()
    with pytest.raises(LimitReachedError, match="time limit reached while counting"):
        Clock(0.02).bounded("counting", _never_ends)
    assert time.process_time() - begin < MAX_CPU_S
    assert not is_abandoned_work_running(wait=20.0)


def test_work_within_abandoned_work_is_abandoned_too():
    inner = Clock(60.0)
    with pytest.raises(LimitReachedError, match="while counting on"):
        Clock(0.02).bounded("counting on", lambda: inner.bounded("counting", _never_ends))
    assert not is_abandoned_work_running(wait=20.0)
    assert not [t for t in threading.enumerate() if t.name == BOUNDED]


LEAVES_WORK = """
import sys, time
from netsp.base.bounded_work import AbandonableCall

def work():
    time.sleep(float(sys.argv[1]))  # as C++ code that returns to Python when it is done
    print("ended")

AbandonableCall(work).abandon(exit_grace_s=float(sys.argv[2]))
"""


@pytest.mark.parametrize(("work_s", "grace_s", "said"), [(0.3, 60.0, "ended\n"), (60.0, 0.1, "")])
def test_python_waits_at_exit_for_abandoned_work_but_no_longer_than_allowed(work_s, grace_s, said):
    """Python ends threads that return from C++ code after its exit, which aborts the process."""
    done = subprocess.run(
        [sys.executable, "-c", LEAVES_WORK, str(work_s), str(grace_s)],
        capture_output=True, text=True, timeout=50.0,
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (0, said, "")


def test_work_that_ends_within_the_grace_is_not_abandoned():
    clock = Clock(1e-9)
    assert clock.bounded("adding", lambda: 7) == 7
    assert not clock.is_overdue
    with pytest.raises(ZeroDivisionError):
        clock.bounded("dividing", lambda: 1 // 0)
    with pytest.raises(InputError, match=r"grace_s: expected .* got -1"):
        TimingPolicy(grace_s=-1.0)


def test_work_of_a_first_result_gets_its_time_whatever_the_limit():
    def counts() -> int:
        begin = time.process_time()
        while time.process_time() - begin < 0.9:
            end_if_abandoned()
        return 7

    clock = Clock(0.02)
    with clock.with_min_cpu(30.0):
        assert clock.bounded("counting", counts) == 7
    with pytest.raises(LimitReachedError, match="while counting on"):
        clock.bounded("counting on", _never_ends)
    assert not is_abandoned_work_running(wait=20.0)


def test_without_a_limit_nothing_is_abandoned_and_no_thread_is_started():
    assert Clock().bounded("looking", threading.current_thread) is threading.current_thread()


def test_a_mission_ends_in_time_and_says_which_work_was_broken_off():
    """Reading scenes and finding words knew no clock: a run of 5 s took 27 s of CPU."""
    rings = [
        {"torus": {"center": [x, y, 0], "axis": [0, 0, 1], "major_radius": 1, "minor_radius": 0.2}}
        for x in (-4, 0, 4)
        for y in (-4, 0, 4)
    ]
    scene = Scene.model_validate({"solids": rings, "bounds": [-8, -8, -4, 8, 8, 4]})
    mission = Mission(
        scene="-", anchor=(7, 7, 0), start=(7, 7, 0), waypoints=((-4, -4, 0),), tether_length=40.0,
        cell=0.08,
    )  # fmt: skip
    begin = time.process_time()
    at_once = MissionPolicy(first_tour_s=0.0)
    with pytest.raises(LimitReachedError, match=r"time limit reached while \w+"):
        solve_mission(mission, scene=scene, time_limit=0.3, policy=at_once)
    assert time.process_time() - begin < MAX_CPU_S
    assert not is_abandoned_work_running(wait=20.0)
