"""Tests of interpreted and compiled kernels, which return the same results to the last bit."""

import contextlib
import copy
import errno
import functools
import gc
import math
import os
import signal
import subprocess
import sys
import threading
import time
import warnings
from concurrent.futures import ThreadPoolExecutor
from dataclasses import astuple
from pathlib import Path
from types import FunctionType, SimpleNamespace

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba.core.caching import FunctionCache

from netsp.base.compiled import (
    compile_lock,
    disk_cache,
    dynamic_array,
    interpretation,
    overtime,
    tiered,
)
from netsp.base.compiled import kernel as kernel_module
from netsp.base.compiled import rng as chance
from netsp.base.compiled.arguments import call_within, can_be_interpreted
from netsp.base.compiled.compile_lock import is_locked, locked
from netsp.base.compiled.compile_policy import (
    CompilePolicy,
    compiled_by,
    compiles,
    current_policy,
    everything_compiled,
    long_work,
)
from netsp.base.compiled.interpretation import interpreted, names_used
from netsp.base.compiled.kernel import Kernel
from netsp.base.compiled.overtime import Overtime, within
from netsp.base.errors import InputError
from netsp.gtsp.dp import label_kernels, walks
from netsp.mip import parity_cuts
from netsp.model.problem import Problem
from netsp.plan.random_worlds import FAMILIES, random_world
from netsp.plan.solve_problem import solve, travel_graph
from netsp.roadmap import branches, outline, tangents, taut_legs
from tests.fresh_modules import fresh_module

PROBLEMS = sorted((Path(__file__).parent.parent / "problems").glob("*.json"))

pytestmark = pytest.mark.skipif(not compiles(), reason="NUMBA_DISABLE_JIT is set")


@contextlib.contextmanager
def everything_interpreted():
    """Run all kernels interpreted, including those that are compiled already."""
    with pytest.MonkeyPatch.context() as patch, np.errstate(all="ignore"):
        patch.setattr(
            tiered.TieredDispatcher, "__call__", lambda self, *args: interpreted(self)(*args),
            raising=False,
        )  # fmt: skip
        yield


def _arrays(value):
    if isinstance(value, np.ndarray):
        return [value]
    if isinstance(value, tuple):
        return [a for part in value for a in _arrays(part)]
    return [np.array(value)]


def _built(problem):
    free = outline.build_outline(problem)
    graph = tangents.build_tangents(free, problem.tether_length)
    return [a.tobytes() for a in _arrays(astuple(free)) + _arrays(astuple(graph))]


def _both(problem):
    with everything_interpreted():
        by_interpreter = _built(problem)
    with everything_compiled():
        return by_interpreter, _built(problem)


@pytest.mark.parametrize("path", PROBLEMS, ids=lambda p: p.stem)
def test_shipped_problems_have_the_same_tangents_interpreted_and_compiled(path):
    problem = Problem.load(path)
    if len(problem.obstacles) > 12:
        pytest.skip("takes the interpreter long")
    by_interpreter, by_compiler = _both(problem)
    assert by_interpreter == by_compiler


@given(st.integers(0, 10_000), st.sampled_from(sorted(FAMILIES)), st.integers(1, 6))
@settings(max_examples=30, deadline=None)
def test_random_worlds_have_the_same_tangents_interpreted_and_compiled(seed, family, goals):
    problem = random_world(seed, family=family, goals=goals, obstacles=5, tether_length=300.0)
    by_interpreter, by_compiler = _both(problem)
    assert by_interpreter == by_compiler


@pytest.mark.parametrize("solver", ["auto", "mip", "dp", "lns"])
def test_solvers_find_the_same_tour_interpreted_and_compiled(solver):
    problem = random_world(7, goals=9, tether_length=250.0)
    iterations = 20 if solver == "lns" else None
    with everything_interpreted():
        by_interpreter = solve(problem, solver, iteration_limit=iterations)
    with everything_compiled():
        by_compiler = solve(problem, solver, iteration_limit=iterations)
    assert by_interpreter.path == by_compiler.path
    assert by_interpreter.lower_bound == by_compiler.lower_bound


MODULE = """
from netsp.base.compiled.kernel import kernel

@kernel
def total(x, stop):
    for i in range(len(x)):
        if stop[0]:
            break
        x[i] = x[i] + (x[i - 1] if i else 0.0)
    return x[-1]

@kernel
def ratio(a, b):
    return a // b
"""


CALLERS = """
from netsp.base.compiled.kernel import kernel

@kernel
def scaled(x, by, negative):
    return -by * x if negative else by * x

@kernel
def caller(x):
    return scaled(x, 1, False) + scaled(x, 0, True) + scaled(x, x - x, x > 0)
"""


def _module(folder, text):
    """Return a module of kernels that were never compiled."""
    return fresh_module(folder, "fresh", text)


@pytest.fixture
def kernels(tmp_path):
    return _module(tmp_path, MODULE)


LENGTHS = """
import math
from netsp.base.compiled.kernel import kernel

@kernel
def length(x, y):
    return math.hypot(x, y)

@kernel
def longer(x, y):
    return length(x, y) ** 3
"""


NO_STOP = np.zeros(1, dtype=np.int64)


def test_kernels_round_the_same_where_compiling_is_turned_off(tmp_path, monkeypatch):
    x, y = 5.1, 8.8  # Python and the C library round their hypotenuse differently on Linux
    with everything_compiled():
        compiled = _module(tmp_path, LENGTHS).longer(x, y)
    monkeypatch.setattr(numba.config, "DISABLE_JIT", 1)
    uncompiled = _module(tmp_path, LENGTHS).longer
    assert uncompiled(x, y) == compiled
    assert uncompiled(y=y, x=x) == compiled
    assert type(uncompiled(x, y)) is float


def test_a_kernel_is_compiled_once_it_has_run_interpreted_for_its_compile_time(kernels):
    with compiled_by(CompilePolicy(compile_s=0.02, compile_s_per_byte=0.0)):
        calls = 0
        while not kernels.total.overloads:
            assert kernels.total.interpreted_s < 0.1
            assert kernels.total(np.ones(1000), NO_STOP) == 1000.0
            calls += 1
    assert calls > 1
    assert kernels.total(np.ones(1000), NO_STOP) == 1000.0


def test_a_call_that_takes_too_long_starts_again_compiled_with_its_original_arguments(kernels):
    x, pair = np.ones(1_000_000), np.ones(3)
    with compiled_by(CompilePolicy(compile_s=0.05, compile_s_per_byte=0.0)):
        assert kernels.total(pair, NO_STOP) == 3.0
        assert not kernels.total.overloads
        assert kernels.total(x, NO_STOP) == 1e6
    assert kernels.total.overloads
    assert np.array_equal(x, np.arange(1.0, 1e6 + 1.0))


def test_a_stop_during_an_interpreted_call_is_kept(kernels):
    stop, x = np.zeros(1, dtype=np.int64), np.ones(30_000_000)
    with compiled_by(CompilePolicy(compile_s=0.3, compile_s_per_byte=0.0, max_copied_bytes=10**9)):
        threading.Timer(0.1, lambda: stop.__setitem__(0, 1)).start()
        kernels.total(x, stop)
    assert stop[0] == 1
    assert x[-1] == 1.0


def test_short_calls_do_not_search_for_compiled_code_each_time(kernels, monkeypatch):
    searches, is_on_disk = [], disk_cache.is_on_disk
    monkeypatch.setattr(disk_cache, "is_on_disk", lambda *a: searches.append(a) or is_on_disk(*a))
    with compiled_by(CompilePolicy(load_s=0.1)):
        for _ in range(50):
            kernels.ratio(7, 2)
    assert kernels.ratio.interpreted_s < 0.1
    assert len(searches) == 1


def test_calls_in_a_thread_pool_never_start_again(kernels):
    x = np.ones(200_000)
    with (
        compiled_by(CompilePolicy(compile_s=0.01, compile_s_per_byte=0.0)),
        ThreadPoolExecutor(1) as pool,
    ):
        assert pool.submit(kernels.total, x, NO_STOP).result() == 200_000.0
        assert not kernels.total.overloads
        assert pool.submit(kernels.total, np.ones(3), NO_STOP).result() == 3.0
    assert kernels.total.overloads


def test_large_arguments_are_never_copied(kernels):
    with compiled_by(CompilePolicy(max_copied_bytes=100)):
        kernels.total(np.ones(10), NO_STOP)
        assert not kernels.total.overloads
        kernels.total(np.ones(100), NO_STOP)
    assert kernels.total.overloads


def test_nothing_runs_interpreted_while_everything_is_compiled(kernels):
    with everything_compiled():
        kernels.ratio(7, 2)
    assert kernels.ratio.overloads
    assert not kernels.ratio.interpreted_s


def test_an_exception_of_an_interpreted_kernel_reaches_its_caller(kernels):
    with pytest.raises(ZeroDivisionError):
        kernels.ratio(1, 0)
    assert not kernels.ratio.overloads


def _interpretable(function):
    """Return a function in the form of a kernel that is never compiled."""
    return SimpleNamespace(py_func=function)


def _pair(x):
    return x[0] / x[1], (x[0] > 0.0, x.sum())


@pytest.mark.parametrize("in_pool", [False, True])
def test_interpreted_calls_return_numbers_of_python_and_do_not_warn(in_pool):
    x = np.array([1.0, 0.0])
    with warnings.catch_warnings(), ThreadPoolExecutor(1) as pool:
        warnings.simplefilter("error")
        call = pool.submit if in_pool else lambda f, *args: SimpleNamespace(result=lambda: f(*args))
        ratio, (is_positive, total) = call(call_within, 10.0, _interpretable(_pair), (x,)).result()
    assert (ratio, is_positive, total) == (math.inf, True, 1.0)
    assert [type(v) for v in (ratio, is_positive, total)] == [float, bool, float]


def test_arrays_that_a_kernel_cannot_write_to_are_not_restored():
    def endless(x, out):
        while True:
            out[0] += x[0]

    x, out = np.ones(3), np.zeros(1)
    x.flags.writeable = False
    with pytest.raises(Overtime):
        call_within(0.02, _interpretable(endless), (x, out))
    assert out[0] == 0.0


@pytest.mark.parametrize(
    ("dtype", "is_alike"),
    [("f8", True), ("i8", True), ("i4", True), ("?", True), ("f4", False), ("f2", False)],
)
def test_arrays_of_narrow_floats_are_left_to_the_compiler(dtype, is_alike):
    for args in ((np.ones(2, dtype),), (1, (0.5, np.ones(2, dtype)))):
        assert can_be_interpreted(args, 10**9) == is_alike
    assert can_be_interpreted((np.ones(0, dtype),), 10**9)  # there is nothing to compute with


def test_a_call_returns_within_its_budget_or_raises_overtime():
    def count(n):
        k = 0
        while k < n:
            k += 1
        return k

    assert within(10.0, count, (10,)) == 10
    with pytest.raises(Overtime):
        within(0.02, count, (math.inf,))
    for _ in range(20):  # the call and its budget end at about the same time
        with contextlib.suppress(Overtime):
            assert within(0.003, count, (60_000,)) == 60_000
    assert count(1000) == 1000


def test_calls_still_raise_overtime_after_many_that_ended_at_their_deadline():
    def spin(seconds):
        end = time.thread_time() + seconds
        while time.thread_time() < end:
            pass

    for k in range(150):
        with contextlib.suppress(Overtime):
            within(0.002, spin, (0.0021 + 0.00005 * (k * 37 % 100),))
    with pytest.raises(Overtime):
        within(0.02, spin, (5.0,))


@pytest.mark.parametrize("is_python", [False, True])
def test_a_signal_takes_precedence_over_overtime(is_python):
    def interrupt(number, frame):
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt if is_python else signal.default_int_handler)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.1)  # after the budget is used up
        with pytest.raises(KeyboardInterrupt):
            within(0.0, time.sleep, (5.0,))
    finally:
        signal.signal(signal.SIGALRM, before)


def test_a_call_returns_although_a_finalizer_swallowed_overtime():
    class Slow:
        def __del__(self):
            end = time.monotonic() + 5.0
            while time.monotonic() < end:
                sum(range(1000))

    assert within(0.01, lambda: Slow() and 1, ()) == 1


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork processes")
def test_a_forked_process_watches_its_calls_even_if_its_parent_had_locked_the_watch():
    with overtime._watch._lock:
        child = os.fork()
        if child == 0:
            try:
                within(0.01, _forever, ())
            except Overtime:
                os._exit(7)
            finally:
                os._exit(1)
    for _ in range(400):
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            break
        time.sleep(0.05)
    else:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    assert done
    assert os.waitstatus_to_exitcode(status) == 7


def _forever():
    while True:
        pass


def test_kernels_are_compiled_at_once_where_numba_lacks_private_parts(monkeypatch, tmp_path):
    monkeypatch.setattr(disk_cache, "is_supported", lambda: False)
    module = _module(tmp_path, MODULE)
    assert module.ratio(7, 2) == 3
    assert module.ratio.overloads


def test_kernels_are_interpreted_and_compiled_without_a_writable_folder(monkeypatch, tmp_path):
    def refused(self, function):
        raise RuntimeError("cannot cache function: no locator available")

    monkeypatch.setattr(FunctionCache, "__init__", refused)
    monkeypatch.setattr(tiered.TieredDispatcher, "has_compiled", False)
    assert disk_cache.is_supported.__wrapped__()
    module = _module(tmp_path, MODULE)
    assert module.ratio(7, 2) == 3
    assert not module.ratio.overloads
    with everything_compiled():
        assert module.ratio(7, 2) == 3
    assert module.ratio.overloads
    assert not disk_cache.is_any_on_disk(module.ratio)
    assert not tiered.TieredDispatcher.has_compiled  # so no background process starts


PROFILED = """
import sys
from netsp.base.compiled.overtime import Overtime, within

def spin(seconds):
    import time
    end = time.thread_time() + seconds
    while time.thread_time() < end:
        pass

for k in range(40):
    try:
        within(0.002, spin, (0.002 + 0.0002 * k,))
    except Overtime:
        pass
seen = []
sys.setprofile(lambda frame, event, _: seen.append(event))
spin(0.0)
sys.setprofile(None)
print("call" in seen)
"""


def test_functions_can_be_profiled_after_a_budget_has_ended():
    done = subprocess.run(
        [sys.executable, "-c", PROFILED], capture_output=True, text=True, timeout=60
    )
    assert done.stdout == "True\n"


def test_kernels_are_compiled_although_the_disk_is_full(monkeypatch, kernels):
    def full(self, path):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(disk_cache.KernelFile, "_open_for_write", full)
    monkeypatch.setattr(tiered.TieredDispatcher, "is_disk_full", False)
    monkeypatch.setattr(tiered.TieredDispatcher, "has_compiled", False)
    with everything_compiled():
        assert kernels.ratio(7, 2) == 3
    assert kernels.ratio.overloads
    assert tiered.TieredDispatcher.is_disk_full
    assert not tiered.TieredDispatcher.has_compiled


@pytest.mark.parametrize("pattern", ["*.nbi", "*.nbc"])
def test_truncated_files_are_compiled_again(pattern, tmp_path):
    (tmp_path / "cache").mkdir()
    for broken in (False, True):
        file = disk_cache.KernelFile(str(tmp_path / "cache"), "f", "stamp")
        if broken:
            (path,) = (tmp_path / "cache").glob(pattern)
            path.write_bytes(path.read_bytes()[:20])
            assert file.load("of floats") is None
        file.save("of floats", "compiled" * 100)
        assert file.load("of floats") == "compiled" * 100


@pytest.mark.parametrize("pattern", ["*.nbi", "*.nbc"])
def test_damaged_files_are_compiled_again(pattern, tmp_path):
    file = disk_cache.KernelFile(str(tmp_path), "f", "stamp")
    kept = ("compiled" * 100, {"a": [1, 2.5]})
    file.save("of floats", kept)
    (path,) = tmp_path.glob(pattern)
    whole, rng = path.read_bytes(), np.random.default_rng(0)
    for changed in (1, 4, 64):
        for _ in range(60):
            bytes_ = np.frombuffer(whole, np.uint8).copy()
            bytes_[rng.integers(len(whole), size=changed)] = rng.integers(256, size=changed)
            path.write_bytes(bytes_.tobytes())
            file.contains("of floats")
            assert file.load("of floats") in (None, kept)
    begin = len(whole) // 2
    path.write_bytes(whole[:begin] + bytes(100) + whole[begin + 100 :])
    assert file.load("of floats") is None
    path.unlink()
    file.save("of floats", kept)
    assert file.load("of floats") == kept


def test_numba_calls_compiled_code_at_once_for_narrow_integers(kernels, monkeypatch):
    with everything_compiled():
        assert kernels.ratio(7, 2) == 3
    asked = []
    slow = tiered.TieredDispatcher._compile_for_args
    monkeypatch.setattr(
        tiered.TieredDispatcher, "_compile_for_args",
        lambda self, *args: asked.append(args) or slow(self, *args),
    )  # fmt: skip
    for _ in range(3):
        assert kernels.ratio(np.int32(7), np.int16(2)) == 3
    assert len(asked) == 1
    assert len(kernels.ratio.overloads) == 1


ROUNDED = """
import math
from netsp.base.compiled.kernel import kernel

@kernel
def rounded(x, y):
    return x**2, x**3, (x + y) ** 5, x**7, math.hypot(x, y)
"""


def test_powers_and_hypotenuses_are_rounded_alike_interpreted_and_compiled(tmp_path):
    kernel = _module(tmp_path, ROUNDED).rounded
    drawn = np.random.default_rng(3).uniform(0.1, 10.0, (300, 2)).tolist()
    alike = interpreted(kernel)
    with everything_compiled():
        assert [kernel(x, y) for x, y in drawn] == [alike(x, y) for x, y in drawn]
    # Python rounds both differently
    assert any(kernel(x, y)[3] != x**7 for x, y in drawn)
    assert any(kernel(x, y)[4] != math.hypot(x, y) for x, y in drawn)


def test_this_release_of_numba_is_supported():
    assert disk_cache.is_supported()
    assert tiered.is_supported()


SIGNATURES = """
from netsp.base.compiled.compile_policy import everything_compiled
from netsp.base.compiled.kernel import all_kernels
from netsp.model.problem import Problem
from netsp.plan.solve_problem import solve
from netsp.plan.random_worlds import random_world

with everything_compiled():
    solve(Problem.load("problems/wharf.json"))
    world = random_world(1, goals=9, tether_length=300.0)
    for solver in ("auto", "mip", "dp", "lns"):
        solve(world, solver, iteration_limit=20)
print(sum(len(k.overloads) > 0 for k in all_kernels()))
for kernel in all_kernels():
    if len(kernel.overloads) > 1:
        print(kernel.py_func.__module__, kernel.py_func.__name__, *kernel.overloads)
"""


def test_each_kernel_is_compiled_for_one_signature():
    done = subprocess.run(
        [sys.executable, "-c", SIGNATURES], cwd=PROBLEMS[0].parent.parent, text=True,
        capture_output=True, env={**os.environ, "PYTHONPATH": str(PROBLEMS[0].parent.parent)},
    )  # fmt: skip
    assert not done.returncode, done.stderr
    count, *several = done.stdout.splitlines()
    assert int(count) > 20
    assert several == []


def test_numbers_are_compiled_for_their_widest_type(kernels):
    with everything_compiled():
        assert kernels.ratio(np.int32(7), np.int8(2)) == kernels.ratio(7, 2) == 3
    assert len(kernels.ratio.overloads) == 1


def test_kernels_that_others_call_with_constants_are_compiled_once(tmp_path):
    module = _module(tmp_path, CALLERS)
    own, called = (len(k.py_func.__code__.co_code) for k in (module.caller, module.scaled))
    assert module.caller.bytecode() == own + called
    with everything_compiled():
        assert module.scaled(5, 1, False) == 5
        assert module.caller.bytecode() == own
        assert module.caller(5) == 5
    assert len(module.scaled.overloads) == 1


def _loops(kernel):
    """Return the loops of a kernel as a Python function, without vectorised forms."""
    names = kernel.py_func.__globals__
    called = {n: _loops(names[n]) for n in names_used(kernel.py_func.__code__)
              if hasattr(names.get(n), "py_func")}  # fmt: skip
    return FunctionType(kernel.py_func.__code__, {**names, **called})


@given(
    st.sets(st.tuples(st.integers(0, 5), st.integers(6, 11)), min_size=1),
    st.lists(st.sampled_from([0.0, 0.1, 0.25, 1 / 3, 0.5, 0.7, 1.0]), min_size=72, max_size=72),
    st.lists(st.booleans(), min_size=12, max_size=12),
)
@settings(deadline=None)
def test_loops_and_vectorised_form_choose_the_same_sides_of_parity_cuts(pairs, flow, sides):
    ends = np.array(sorted(pairs))
    across = np.array(flow).reshape(-1, 2)[: len(ends)]
    row = np.searchsorted(np.sort(ends.ravel()), np.arange(13))
    by_loops, at_once = np.array(sides), np.array(sides)
    cost, teeth = _loops(parity_cuts._cheapest)(ends, across, row, by_loops, 4)
    other, same = interpreted(parity_cuts._cheapest)(ends, across, row, at_once, 4)
    assert (cost, teeth.tolist(), by_loops.tolist()) == (other, same.tolist(), at_once.tolist())


@given(st.data())
@settings(deadline=None, max_examples=30)
def test_loops_and_vectorised_form_extend_and_join_labels_alike(data):
    sizes = data.draw(st.lists(st.integers(1, 3), min_size=2, max_size=5))
    cluster = np.repeat(np.arange(len(sizes) + 1), [1, *sizes])
    costs = np.array(data.draw(st.lists(
        st.sampled_from([1.0, 1.5, 2.0, 3.0, math.inf]),
        min_size=len(cluster) ** 2, max_size=len(cluster) ** 2,
    ))).reshape(len(cluster), -1)  # fmt: skip
    walk = walks.Walks(cluster, np.minimum(costs, costs.T))
    prices = np.array([0.0, *data.draw(st.lists(
        st.sampled_from([0.0, 0.5, 1.0]), min_size=len(sizes), max_size=len(sizes)
    ))])  # fmt: skip
    cutoff = data.draw(st.sampled_from([5.0, 8.0, math.inf]))

    def both(kernel, *args):
        copies = copy.deepcopy(args)
        with np.errstate(all="ignore"):
            by_loops, at_once = _loops(kernel)(*copies), interpreted(kernel)(*args)
        # kernels without a result write to their arguments
        for one, other in zip(
            _arrays((() if by_loops is None else by_loops, copies)),
            _arrays((() if at_once is None else at_once, args)),
            strict=True,
        ):
            assert one.dtype == other.dtype
            assert one.tobytes() == other.tobytes()
        return at_once

    with pytest.MonkeyPatch.context() as patch:
        for name in ("completions", "extend", "join", "step_back"):
            patch.setattr(walks, name, functools.partial(both, getattr(label_kernels, name)))
        walk.solve(prices, cutoff, lambda: None)


@pytest.mark.parametrize("depth", [0.0, 7.5])
def test_loops_and_vectorised_form_fill_in_the_same_legs(depth, monkeypatch):
    problem = random_world(3, goals=4, tether_length=450.0)
    goals = [
        goal.model_copy(update={"position": (*goal.position[:2], -depth * k)})
        for k, goal in enumerate(problem.goals)
    ]
    at_once, compared = interpreted(branches.fill_parallel), []

    def both(*args):
        lengths = args[-1]._replace(out=args[-1].out.copy())
        _loops(branches.fill_parallel)(*args[:-1], lengths)
        at_once(*args)
        compared.append(np.array_equal(lengths.out, args[-1].out, equal_nan=True))

    monkeypatch.setitem(interpretation._in_numpy, branches.fill_parallel.py_func, both)
    interpretation._interpreted.cache_clear()
    monkeypatch.setattr(taut_legs, "fill_parallel", both)
    with everything_interpreted():
        travel_graph(problem.model_copy(update={"goals": tuple(goals)})).costs  # noqa: B018
    interpretation._interpreted.cache_clear()
    assert len(compared) > 10
    assert all(compared)


@pytest.mark.parametrize("n", [0, 1, 16, 17, 64, 1000])
def test_compiled_sorting_keeps_the_order_of_equal_numbers(n):
    values = np.random.default_rng(n).integers(0, 9, n).astype(float)
    values[::7] = np.inf
    with everything_compiled():
        order = dynamic_array.order_of(values)
    assert np.array_equal(order, np.argsort(values, kind="stable"))


def test_random_numbers_are_the_same_interpreted_and_compiled():
    state, other = chance.seeded(np.random.default_rng(1)), chance.seeded(np.random.default_rng(1))
    with everything_compiled():
        drawn = [chance.uniform(state) for _ in range(1000)]
    assert drawn == [interpreted(chance.uniform)(other) for _ in range(1000)]
    assert state == other


def test_a_kernel_that_another_process_compiles_runs_interpreted_meanwhile(kernels):
    file = disk_cache.lock_file(kernels.ratio)
    kernels.ratio.interpreted_s = 60.0  # longer than its compile time
    with locked(file) as is_held:
        assert is_held
        assert is_locked(file)
        assert kernels.ratio(7, 2) == 3
        assert not kernels.ratio.overloads
    assert not is_locked(file)
    assert not file.exists()
    with everything_compiled():
        assert kernels.ratio(7, 2) == 3
    assert kernels.ratio.overloads


def test_a_kernel_is_compiled_although_a_stopped_process_holds_its_lock(kernels):
    with locked(disk_cache.lock_file(kernels.ratio)):
        with compiled_by(CompilePolicy(is_eager=True, max_wait_ratio=0.1)):
            assert kernels.ratio(7, 2) == 3
        assert kernels.ratio.overloads


def test_only_one_thread_at_a_time_has_a_lock(tmp_path):
    file = tmp_path / "a.lock"
    inside, counts = [], []

    def hold(_):
        for _ in range(20):
            with locked(file):
                inside.append(1)
                counts.append(len(inside))
                inside.pop()

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(hold, range(4)))
    assert max(counts) == 1
    assert len(counts) == 80


def test_a_lock_file_that_its_last_owner_has_just_removed_is_created_again(tmp_path, monkeypatch):
    file, flock, calls = tmp_path / "a.lock", compile_lock.fcntl.flock, []

    def removed_before(descriptor, how):
        calls.append(how)
        if len(calls) == 1:
            file.unlink()
        flock(descriptor, how)

    monkeypatch.setattr(compile_lock.fcntl, "flock", removed_before)
    with locked(file) as is_held:
        assert is_held
        assert is_locked(file)


def test_kernels_with_a_form_in_numpy_have_a_share_of_their_own(kernels, monkeypatch):
    total = kernels.total.py_func
    monkeypatch.setitem(interpretation._in_numpy, total, lambda x, stop: x.sum())
    with compiled_by(CompilePolicy(interpreted_share=0.0)):
        assert kernels.total(np.ones(3), NO_STOP) == 3.0
    assert not kernels.total.overloads
    assert kernels.total.interpreted_s > 0.0


def test_time_before_numba_is_loaded_counts_for_all_kernels_and_for_the_kernel(monkeypatch):
    monkeypatch.setattr(Kernel, "_total_s", 0.25)
    early = Kernel(_pair)
    with monkeypatch.context() as patch, compiled_by(CompilePolicy(numba_s=60.0, compile_s=60.0)):
        patch.delitem(sys.modules, "numba")
        early(np.array([1.0, 2.0]))
    assert early._early_s > 0.0
    assert Kernel._total_s == 0.25 + early._early_s
    policy = CompilePolicy(
        numba_s=1.0, compile_s=2.0, compile_s_per_byte=0.0, interpreted_share=0.5
    )
    monkeypatch.setattr(kernel_module, "may_be_on_disk", lambda: True)
    assert early._budget_s(policy) == 1.0 - Kernel._total_s
    monkeypatch.setattr(kernel_module, "may_be_on_disk", lambda: False)
    assert early._budget_s(policy) == 1.0 - early._early_s
    assert early.dispatcher.interpreted_s == early._early_s


@pytest.mark.parametrize("is_collecting", [True, False])
def test_garbage_is_collected_after_compiling_as_before(is_collecting):
    before = gc.isenabled()
    try:
        (gc.enable if is_collecting else gc.disable)()
        with tiered._collector_paused():
            assert not gc.isenabled()
        assert gc.isenabled() == is_collecting
    finally:
        (gc.enable if before else gc.disable)()


def test_long_work_is_compiled_sooner():
    before = current_policy()
    with long_work():
        assert current_policy().interpreted_share < before.interpreted_share
        assert current_policy().numpy_share < before.numpy_share
        assert current_policy().counts_shared_code
    assert current_policy() == before


def test_time_also_counts_for_kernels_that_call_the_same_code(tmp_path, monkeypatch):
    kernels = _module(tmp_path, CALLERS)
    monkeypatch.setattr(interpretation, "_time_s", {})
    sizes = [len(k.py_func.__code__.co_code) for k in (kernels.scaled, kernels.caller)]
    interpretation.add_interpreted_time(kernels.caller, 2.0)
    assert interpretation.interpreted_time_s(kernels.caller) == pytest.approx(2.0)
    shared = 2.0 * sizes[0] / sum(sizes)
    assert interpretation.interpreted_time_s(kernels.scaled) == pytest.approx(shared)
    policy = CompilePolicy(compile_s=0.9 * shared, compile_s_per_byte=0.0, counts_shared_code=True)
    with compiled_by(policy):
        assert kernels.scaled(3.0, 2.0, True) == -6.0
    assert kernels.scaled.overloads
    assert not kernels.scaled.interpreted_s


@pytest.mark.parametrize("field", ["load_s", "compile_s", "compile_s_per_byte", "max_copied_bytes"])
def test_a_policy_has_no_negative_numbers(field):
    with pytest.raises(InputError, match=f"{field}: expected a number that is not negative"):
        CompilePolicy(**{field: -1})
