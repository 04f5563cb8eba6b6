"""Families of cuts: a proof without one ends with the same tour."""

from __future__ import annotations

import pytest

from netsp import InputError, Status, solve_graph, travel_graph
from netsp.mip.mip_policy import CUT_FAMILIES, CutPolicy
from netsp.plan.random_worlds import random_world


@pytest.fixture(scope="module")
def graph():
    """A world whose root has cuts of most families."""
    return travel_graph(random_world(2, goals=30, tether_length=280.0))


@pytest.fixture(scope="module")
def shortest(graph):
    """Length that is proven with all families."""
    return solve_graph(graph, "mip").length


@pytest.mark.parametrize("family", [*CUT_FAMILIES, "all"])
def test_without_a_family_of_cuts_the_same_length_is_proven(graph, shortest, family):
    families = () if family == "all" else tuple(f for f in CUT_FAMILIES if f != family)
    found = solve_graph(graph, "mip", params={"policy.cuts.families": families})
    assert found.status is Status.OPTIMAL
    assert found.length == pytest.approx(shortest, rel=2e-6)


def test_a_family_left_out_is_not_separated(graph, monkeypatch):
    """The separation of combs is called, unless the policy leaves it out."""
    calls = []
    monkeypatch.setattr("netsp.mip.root.comb_cuts", lambda *_: calls.append(1) or [])
    solve_graph(graph, "mip")
    assert calls
    calls.clear()
    solve_graph(graph, "mip", params={"policy.cuts.families": ("goals", "branches")})
    assert not calls


def test_an_unknown_family_is_refused():
    with pytest.raises(InputError, match="families: unknown 'clique'; expected some of goals"):
        CutPolicy(families=("clique",))
    with pytest.raises(InputError, match="families: unknown 'clique'; expected some of goals"):
        CutPolicy(families="clique")


def test_a_lone_name_is_one_family():
    assert CutPolicy(families="combs").families == ("combs",)
