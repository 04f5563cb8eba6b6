"""Settings of all tests.

Laws have no deadline, because the speed of a test is the machine's. The garbage collector passes
over what collection leaves behind: more than half a million objects, all of which last until the
end, and a look at them takes half a second.
"""

import functools
import gc

import pytest
from hypothesis import settings

settings.register_profile("netsp", deadline=None)
settings.load_profile("netsp")


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Collect tests without looking for garbage, of which importing modules makes little."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_sessionfinish():
    """Let the collector look at everything again, as extension modules expect it at exit."""
    gc.unfreeze()


@pytest.fixture
def few_cells(monkeypatch):
    """Have commands solve missions with `FEW_CELLS`: the bounds hold as well, and are coarser."""
    from netsp.plan.space import mission_solver
    from tests.worlds import FEW_CELLS

    quick = functools.partial(mission_solver.solve_mission, policy=FEW_CELLS)
    monkeypatch.setattr(mission_solver, "solve_mission", quick)
