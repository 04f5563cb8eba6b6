"""Error of the cables of `cable_rig.py` against closed forms.

    python benchmarks/cable_forms.py [--keep]

Lengths round a post and around box edges; where a cable without friction slips off the end of a
bar; and how much friction holds a cable sideways, on an edge and on a round bar: its end moves
along a circle about the contact, so that no cable passes over it, until the contact slides.
MuJoCo comes with `pip install 'netsp[bench]'`.
"""

from __future__ import annotations

import argparse
import math
from typing import Any

import numpy as np
from cable_rig import Cable, CableParams, cable_length
from table import head, heading, row

from netsp.world import Scene

LONGEST = 12.0
"""Cable on the drum, metres."""


def settled(scene: Scene, path: list[Any], friction: float) -> float:
    """Return the length of a cable that has followed a path, at rest, metres."""
    params = CableParams()
    cable = Cable(scene, path[0], LONGEST, friction, params)
    for place in path:
        cable.go(place)
    cable.stay(2.0 * params.settle_s)
    return cable_length(scene.field(), cable.nodes(), params.max_depth)


def round_post(friction: float) -> tuple[float, float]:
    """Return the length of a cable round a post, in closed form and measured, metres."""
    radius, far, turn = 0.5, 2.0, 1.5 * math.pi
    scene = Scene(solids=[{"capsule": {"a": [0, 0, -5], "b": [0, 0, 5], "radius": radius}}])
    path = [(far * math.cos(a), far * math.sin(a), 0.0) for a in math.pi - np.linspace(0, turn, 40)]
    arc = turn - 2.0 * math.acos(radius / far)
    exact = 2.0 * math.sqrt(far**2 - radius**2) + radius * arc
    return exact, settled(scene, path, friction)


def round_box(friction: float) -> tuple[float, float]:
    """Return the length around two edges of a box, in closed form and measured, metres."""
    scene = Scene(solids=[{"box": {"center": [0, 0, 0], "size": [1, 2, 6]}}])
    path = [(-1, -0.5, 0), (-1, 1.8, 0), (1, 1.8, 0), (1, -0.5, 0)]
    return 1.0 + 2.0 * math.hypot(0.5, 1.5), settled(scene, path, friction)


def over_edge(friction: float) -> tuple[float, float]:
    """Return the length over one edge of a box at a shallow angle, metres."""
    scene = Scene(solids=[{"box": {"center": [0, 0, -5], "size": [40, 2, 10]}}])
    path = [(0, -1.0, 0.3), (0, 1.5, 0.6), (0, 3.0, -1.0)]
    return 2.0 + math.hypot(2.0, 1.0) + (math.hypot(2.0, 0.3) - 2.0), settled(scene, path, friction)


def slip_off_bar(_: float) -> tuple[float, float]:
    """Return where a robot makes a cable without friction slip off a bar's end, x in metres."""
    scene = Scene(solids=[{"capsule": {"a": [-3, 0, 0], "b": [0, 0, 0], "radius": 0.2}}])
    params, field, anchor = CableParams(), scene.field(), (-0.3, -1.5, -1.0)
    cable = Cable(scene, anchor, LONGEST, 0.0, params)
    for place in (anchor, (-1.5, -1.5, 1.5), (-1.5, 1.5, 1.5), (-0.3, 1.5, -1)):
        cable.go(place)
    for x in np.arange(-0.3, 1.5, 0.02):
        cable.go((x, 1.5, -1.0))
        cable.stay(params.pause_s)
        straight = float(np.linalg.norm(np.array((x, 1.5, -1.0)) - anchor))
        if cable_length(field, cable.nodes(), params.max_depth) < 1.05 * straight:
            return 0.3, float(x)
    return 0.3, math.inf


def held(kind: str, friction: float) -> tuple[float, float]:
    """Return the friction and the largest sideways share of the force on a contact at rest."""
    if kind == "edge":
        scene = Scene(solids=[{"box": {"center": [0, 0, -5], "size": [40, 2, 10]}}])
        path: list[Any] = [(0, -3, 0.6), (0, 1.6, 0.8), (0, 1.6, -1.2)]
        contact, end = np.array((0, 1.0, 0)), np.array((0, 0.6, -1.2))
    else:
        scene = Scene(solids=[{"capsule": {"a": [-10, 0, 0], "b": [10, 0, 0], "radius": 0.5}}])
        path = [(0, -0.5, -2), (0, -1.0, 1), (0, 1.0, 1), (0, 0.5, -2)]
        contact, end = np.array((0, 0.5, 0)), np.array((0, 0, -2.0))
    params, field = CableParams(), scene.field()
    cable = Cable(scene, path[0], LONGEST, friction, params)
    for place in path:
        cable.go(place)
    shares, ahead = [], np.array((np.linalg.norm(end), 0.0, 0.0))
    for angle in np.linspace(0.0, 1.0, 30):
        cable.go(contact + math.cos(angle) * end + math.sin(angle) * ahead)
        cable.stay(0.5 * params.settle_s)
        nodes = cable.nodes()
        near = np.flatnonzero(field.distance(nodes) < 1.5 * params.spacing)
        first, last = near[0], near[-1]
        before = nodes[first] - nodes[0]
        after = nodes[-1] - nodes[last]
        pull = after / np.linalg.norm(after) - before / np.linalg.norm(before)
        # on a round bar the press is spread over the arc: the share is that of the turning angle
        u, w = before / np.linalg.norm(before), after / np.linalg.norm(after)
        if kind == "edge":
            shares.append(abs(pull[0]) / math.hypot(pull[1], pull[2]))
        else:
            sideways = abs(math.asin(w[0]) - math.asin(u[0]))
            cosine = (u[1:] @ w[1:]) / np.linalg.norm(u[1:]) / np.linalg.norm(w[1:])
            shares.append(sideways / math.acos(np.clip(cosine, -1.0, 1.0)))
    return friction, max(shares)


def crept(friction: float, sign: float) -> tuple[float, float]:
    """Return how far a contact on an edge creeps while a metre passes, expected and measured.

    Expected is the law of creep: by the sideways share of the force over the friction, per metre.
    """
    scene = Scene(solids=[{"box": {"center": [0, 0, -5], "size": [40, 2, 10]}}])
    params, anchor = CableParams(), np.array((0, -3, 0.6))
    cable, contact, end = Cable(scene, anchor, LONGEST, friction, params), [0, 1, 0], [0, 0.6, -1.2]
    for place in (anchor, (0, 1.6, 0.8), (0, 1.6, -1.2)):
        cable.go(place)
    length = 2.5 if sign < 0 else 1.5
    turned = 0.7 * friction
    unit = math.cos(turned) * np.array(end) / np.linalg.norm(end) + math.sin(turned) * np.eye(3)[0]
    cable.go(np.array(contact) + length * unit)
    cable.stay(params.settle_s)

    def place_of_contact() -> float:
        nodes = cable.nodes()
        k = int(np.flatnonzero(nodes[:, 2] < 0.0)[0])
        share = nodes[k - 1, 2] / (nodes[k - 1, 2] - nodes[k, 2])
        return float(nodes[k - 1, 0] + share * (nodes[k, 0] - nodes[k - 1, 0]))

    first = x = place_of_contact()
    robot = np.array(contact) + length * unit
    for _ in range(1000):
        robot = robot + 0.001 * sign * unit
        edge = np.array((x, 1.0, 0.0))
        u, w = edge - anchor, robot - edge
        pull = w / np.linalg.norm(w) - u / np.linalg.norm(u)
        sine = min(0.99, abs(pull[0]) / math.hypot(pull[1], pull[2]) / friction)
        x += 0.001 * math.copysign(sine / math.sqrt(1.0 - sine**2), pull[0])
    cable.go(robot)
    return x - first, place_of_contact() - first


def main() -> None:
    """Print the table."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    heading("Simulated cables against closed forms")
    head("case", "friction", "closed form", "cable", "difference", name="cable-forms")
    cases = [
        ("round a post, three quarters, m", round_post, (0.0, 0.1, 0.3)),
        ("around two right angles of a box, m", round_box, (0.0, 0.1, 0.3)),
        ("over one edge at a shallow angle, m", over_edge, (0.0, 0.1, 0.3)),
        ("slips off the end of a bar at x, m", slip_off_bar, (0.0,)),
        ("largest sideways share on an edge", lambda f: held("edge", f), (0.1, 0.2, 0.3)),
        ("largest sideways share on a round bar", lambda f: held("bar", f), (0.1, 0.2, 0.3)),
        ("creeps while a metre is paid out, m", lambda f: crept(f, 1.0), (0.1, 0.2, 0.3)),
        ("creeps while a metre is reeled in, m", lambda f: crept(f, -1.0), (0.1, 0.2, 0.3)),
    ]
    for name, measure, frictions in cases:
        for friction in frictions:
            exact, found = measure(friction)
            row(name, f"{friction:g}", f"{exact:.3f}", f"{found:.3f}", f"{found - exact:+.3f}")


if __name__ == "__main__":
    main()
