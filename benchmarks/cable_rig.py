"""Cables in a physics engine (MuJoCo): balls joined by limited tendons, reeled in at the anchor.

Each ball is a point mass with a round hull that cannot roll, so friction acts on the cable as it is
dragged over a surface. Solids are thinner by the radius of the balls, so that the middle of the
cable runs where the taut tether of the same scene does.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from netsp.world import Scene
from netsp.world.scene.field import DistanceField


@dataclass(frozen=True)
class CableParams:
    """Numbers of the simulated cable.

    Attributes
    ----------
    spacing
        Distance between neighbouring balls when the cable is taut, metres. At most about the
        radius of the thinnest bar, so that no bar passes between two balls.
    ball_radius
        Radius of a ball, metres; below that of the thinnest bar.
    tension
        Pull of the winch, N.
    mass
        Mass of a ball, kg.
    drag
        Viscous drag of a ball, N s/m. All balls together drag little of the tension at `speed`.
    speed
        Speed of the robot, m/s.
    step_s
        Time step, s.
    settle_s
        Time at each stop before lengths are measured, s.
    """

    spacing: float = 0.12
    ball_radius: float = 0.04
    tension: float = 4.0
    mass: float = 0.01
    drag: float = 0.004
    speed: float = 0.8
    step_s: float = 0.004
    settle_s: float = 1.0


def _contact(friction: float, kinds: str) -> str:
    return f'friction="{friction} 0 0" condim="{3 if friction else 1}" {kinds}'


def geoms(scene: Scene, radius: float, friction: float, pieces: int = 48) -> list[str]:
    """Return the solids of a scene as geoms of MuJoCo, thinner by `radius`."""
    made = []
    rub = _contact(friction, 'contype="1" conaffinity="2"')

    def capsule(a: Any, b: Any, r: float) -> str:
        ends = " ".join(f"{v:.9g}" for v in (*a, *b))
        return f'<geom type="capsule" fromto="{ends}" size="{r - radius:.9g}" {rub}/>'

    for solid in scene.solids:
        ((kind, s),) = solid.model_dump(exclude_none=True).items()
        if kind == "capsule":
            made.append(capsule(s["a"], s["b"], s["radius"]))
        elif kind == "box":
            half = " ".join(f"{0.5 * v - radius:.9g}" for v in s["size"])
            turned = " ".join(f"{v:.9g}" for v in s.get("rotation", (0, 0, 0)))
            place = " ".join(f"{v:.9g}" for v in s["center"])
            made.append(f'<geom type="box" pos="{place}" size="{half}" euler="{turned}" {rub}/>')
        elif kind == "torus":
            axis = np.array(s["axis"], dtype=float)
            axis /= np.linalg.norm(axis)
            u = np.cross(axis, [1.0, 0, 0] if abs(axis[0]) < 0.9 else [0, 1.0, 0])
            u /= np.linalg.norm(u)
            v = np.cross(axis, u)
            turn = np.linspace(0.0, 2 * math.pi, pieces + 1)
            # corners a little outside, so that the pieces are on the circle in the mean
            out = s["major_radius"] * (1.0 + (math.pi / pieces) ** 2 / 6.0)
            ring = np.array(s["center"]) + out * (
                np.cos(turn)[:, None] * u + np.sin(turn)[:, None] * v
            )
            made += [capsule(a, b, s["minor_radius"]) for a, b in itertools.pairwise(ring)]
        else:
            raise ValueError(f"solid {kind}: expected a capsule, box or torus")
    return made


class Cable:
    """Cable from a winch at an anchor to a robot that is moved along a path.

    Parameters
    ----------
    scene : Scene
        Capsules, boxes (turned about z) and tori.
    anchor : array_like, shape (3,)
        Place of the winch, metres; the robot begins there, too.
    longest : float
        Length of the cable on the drum, metres.
    friction : float
        Coefficient of friction.
    params : CableParams
        Numbers of the cable.
    """

    def __init__(
        self, scene: Scene, anchor: Any, longest: float, friction: float, params: CableParams
    ) -> None:
        try:
            import mujoco
        except ImportError:
            raise SystemExit(
                "this benchmark needs the physics engine MuJoCo: pip install 'netsp[bench]'"
            ) from None
        self.params, self.anchor = params, np.array(anchor, dtype=float)
        self.count = math.ceil(longest / params.spacing) + 2
        self._mujoco = mujoco
        self.model = mujoco.MjModel.from_xml_string(self._xml(scene, friction))
        self.data = mujoco.MjData(self.model)
        self.first = self.count - 1
        """First ball that is off the drum; the last is the robot's."""
        self.model.tendon_range[:, 1] = 1e3
        mujoco.mj_forward(self.model, self.data)

    def _xml(self, scene: Scene, friction: float) -> str:
        p, (x, y, z) = self.params, self.anchor
        place = f"{x:.9g} {y:.9g} {z:.9g}"
        rub = (
            f'friction="{friction} 0 0" condim="{3 if friction else 1}" contype="2" conaffinity="1"'
        )
        bodies, tendons = [], []
        for k in range(self.count):
            joints = "".join(
                f'<joint type="slide" axis="{a}" damping="{p.drag}"/>'
                for a in ("1 0 0", "0 1 0", "0 0 1")
            )
            if k == self.count - 1:
                bodies.append(f'<body mocap="true" pos="{place}"><site name="s{k}"/></body>')
            else:
                bodies.append(
                    f'<body pos="{place}">{joints}<geom type="sphere" size="{p.ball_radius}" '
                    f'mass="{p.mass}" {rub}/><site name="s{k}"/></body>'
                )
            if k:
                tendons.append(
                    f'<spatial limited="true" range="0 {p.spacing}" '
                    f'solreflimit="{2.5 * p.step_s} 1">'
                    f'<site site="s{k - 1}"/><site site="s{k}"/></spatial>'
                )
        return (
            f'<mujoco><option timestep="{p.step_s}" gravity="0 0 0" integrator="implicitfast" '
            'solver="Newton" iterations="20" tolerance="1e-8"/>'
            '<compiler eulerseq="xyz" angle="degree"/><size memory="200M"/>'
            f"<worldbody>{''.join(geoms(scene, p.ball_radius, friction))}{''.join(bodies)}"
            f"</worldbody><tendon>{''.join(tendons)}</tendon></mujoco>"
        )

    def balls(self) -> np.ndarray:
        """Return the balls that are off the drum (n, 3)."""
        moving = self.anchor + self.data.qpos.reshape(-1, 3)[self.first :]
        return np.vstack([moving, self.data.mocap_pos[0]])

    def nodes(self) -> np.ndarray:
        """Return the cable from the anchor to the robot (n, 3)."""
        return np.vstack([self.anchor, self.balls()])

    def step(self) -> None:
        """Advance by one time step."""
        p, data = self.params, self.data
        place = data.qpos.reshape(-1, 3)
        speed = data.qvel.reshape(-1, 3)
        last = self.count - 1
        out = (
            np.linalg.norm(place[self.first])
            if self.first < last
            else np.linalg.norm(data.mocap_pos[0] - self.anchor)
        )
        # a ball on the drum does not hold the next one: only the pull of the winch does
        if out > 1.1 * p.spacing and self.first > 0:
            self.first -= 1
            self._hold(self.first, True)
        elif self.first < last and out < 0.05 * p.spacing:
            self._hold(self.first, False)
            self.first += 1
        place[: self.first] = 0.0
        speed[: self.first] = 0.0
        data.qfrc_applied[:] = 0.0
        if self.first < last:
            way = -place[self.first]
            far = np.linalg.norm(way)
            force = p.tension * way / max(far, 0.02 * p.spacing)
            data.qfrc_applied.reshape(-1, 3)[self.first] = force
        self._mujoco.mj_step(self.model, data)

    def _hold(self, k: int, is_held: bool) -> None:
        """Join ball k to the next one, or not."""
        self.model.tendon_range[k, 1] = self.params.spacing if is_held else 1e3

    def stay(self, seconds: float) -> None:
        """Let the cable move while the robot stays."""
        for _ in range(round(seconds / self.params.step_s)):
            self.step()

    def go(self, place: Any) -> None:
        """Move the robot straight to a place."""
        p, goal = self.params, np.array(place, dtype=float)
        while True:
            way = goal - self.data.mocap_pos[0]
            far = np.linalg.norm(way)
            self.data.mocap_pos[0] += way * min(1.0, p.speed * p.step_s / max(far, 1e-12))
            self.step()
            if far <= p.speed * p.step_s:
                return


def cable_length(field: DistanceField, nodes: np.ndarray) -> float:
    """Return the length of a cable (n, 3) over the surfaces that its chords cut, metres."""
    steps = np.linalg.norm(np.diff(nodes, axis=0), axis=1)
    depth = np.maximum(-field.distance(0.5 * (nodes[1:] + nodes[:-1])), 0.0)
    half = 2.0 * np.arctan(2.0 * depth / np.maximum(steps, 1e-9))
    bent = np.where(half > 1e-6, half / np.sin(np.maximum(half, 1e-9)), 1.0)
    return float((steps * bent).sum())
