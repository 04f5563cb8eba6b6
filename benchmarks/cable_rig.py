"""Cables in a physics engine (MuJoCo): links between point masses, reeled in at the anchor.

A cable is a flexible body of one dimension. Its links are round rods, so edges of solids touch it
anywhere along a link; with balls only, edges would catch between them, as if there were friction.
Limited tendons keep the links from stretching. Solids are thinner by the radius of the links, so
that the middle of the cable runs where the taut tether of the same scene does. Solids that touch
would part by that, and the cable would slip in between, so boxes fill their seams
(`netsp.world.scene.seams`). A cable that is inside a solid all the same ends the simulation.
`cable_forms.py` measures the error of such cables against closed forms. MuJoCo comes with
`pip install 'netsp[bench]'`.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from netsp.world import Scene
from netsp.world.scene.field import DistanceField
from netsp.world.scene.seams import seam_boxes


@dataclass(frozen=True)
class CableParams:
    """Numbers of the simulated cable.

    Attributes
    ----------
    spacing
        Length of a link, metres. At an edge, the cable is longer than a taut curve by up to
        0.3 of it.
    radius
        Radius of a link, metres; below that of the thinnest bar, and below half the thickness of
        the thinnest box. Around a right angle, the cable is shorter by 0.43 of it than around a
        sharp edge.
    tension
        Pull of the winch, N.
    mass
        Mass of a link, kg.
    drag
        Viscous drag of a link along the cable, N s/m. The whole cable drags little of the tension
        at `speed`.
    normal_drag
        Viscous drag of a link across the cable, N s/m. It ends the whirling of a cable that is
        reeled in; without it, a short cable stays longer than a taut one.
    speed
        Speed of the robot, m/s.
    step_s
        Time step, s.
    contact_s
        Time constant of contacts, s. At the default, a link sinks in by less than a millimetre.
    tendon_s
        Time constant of the tendons, s.
    friction_stiffness
        Ratio of the stiffness of contacts against sliding to that against sinking in. At 1, the
        engine lets contacts creep that friction should hold.
    settle_s
        Time at each stop before lengths are measured, s.
    pause_s
        Time at each place on a leg before lengths are measured, s: the cable follows the robot.
    max_depth
        Maximum depth of the middle of a link in a solid of the scene, metres. Where links bend
        around a right angle, it is up to 0.05.
    """

    spacing: float = 0.08
    radius: float = 0.05
    tension: float = 4.0
    mass: float = 0.004
    drag: float = 0.0027
    normal_drag: float = 0.015
    speed: float = 0.8
    step_s: float = 0.004
    contact_s: float = 0.008
    tendon_s: float = 0.01
    friction_stiffness: float = 10.0
    settle_s: float = 1.0
    pause_s: float = 0.4
    max_depth: float = 0.1


def _contact(friction: float, contact_s: float, kinds: str) -> str:
    return (
        f'friction="{friction} 0 0" condim="{3 if friction else 1}" '
        f'solref="{contact_s} 1" solimp="0.98 0.99 0.001" {kinds}'
    )


def geoms(scene: Scene, params: CableParams, friction: float, pieces: int = 48) -> list[str]:
    """Return the solids of a scene as geoms of MuJoCo, thinner by the radius of the links."""
    made, radius = [], params.radius
    rub = _contact(friction, params.contact_s, 'contype="1" conaffinity="2"')

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
    for _, seam in seam_boxes([s.shape for s in scene.solids]):
        halves = np.array(seam[3:6]) - radius
        if halves.min() > 0.0:  # the cable does not fit into narrower seams
            texts = [" ".join(f"{v:.9g}" for v in w) for w in (seam[:3], halves, seam[6:12])]
            made.append(
                f'<geom type="box" pos="{texts[0]}" size="{texts[1]}" xyaxes="{texts[2]}" {rub}/>'
            )
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
        """First node that is off the drum; the last is the robot's."""
        self.model.tendon_range[:, 1] = 1e3
        mujoco.mj_forward(self.model, self.data)

    def _xml(self, scene: Scene, friction: float) -> str:
        p, nodes = self.params, range(self.count)
        x, y, z = self.anchor
        place = f"{x:.9g} {y:.9g} {z:.9g}"
        joints = "".join(f'<joint type="slide" axis="{a}"/>' for a in ("1 0 0", "0 1 0", "0 0 1"))
        inertia = f'<inertial pos="0 0 0" mass="{p.mass}" diaginertia="1e-6 1e-6 1e-6"/>'
        bodies = [
            f'<body name="b{k}" pos="{place}">{joints}{inertia}<site name="s{k}"/></body>'
            for k in nodes[:-1]
        ]
        bodies.append(
            f'<body name="b{nodes[-1]}" mocap="true" pos="{place}"><site name="s{nodes[-1]}"/>'
            "</body>"
        )
        tendons = [
            f'<spatial limited="true" range="0 {p.spacing}" solreflimit="{p.tendon_s} 1">'
            f'<site site="s{k - 1}"/><site site="s{k}"/></spatial>'
            for k in nodes[1:]
        ]
        rub = _contact(friction, p.contact_s, 'contype="2" conaffinity="1" selfcollide="none"')
        flex = (
            f'<flex name="cable" dim="1" radius="{p.radius}" '
            f'body="{" ".join(f"b{k}" for k in nodes)}" vertex="{" ".join(["0 0 0"] * self.count)}"'
            f' element="{" ".join(f"{k} {k + 1}" for k in nodes[:-1])}"><contact {rub}/></flex>'
        )
        return (
            f'<mujoco><option timestep="{p.step_s}" gravity="0 0 0" integrator="implicitfast" '
            f'cone="elliptic" impratio="{p.friction_stiffness}" '
            'solver="Newton" iterations="20" tolerance="1e-8"/>'
            '<compiler eulerseq="xyz" angle="degree"/><size memory="200M"/>'
            f"<worldbody>{''.join(geoms(scene, p, friction))}{''.join(bodies)}</worldbody>"
            f"<deformable>{flex}</deformable><tendon>{''.join(tendons)}</tendon></mujoco>"
        )

    def nodes(self) -> np.ndarray:
        """Return the cable from the anchor to the robot (n, 3)."""
        moving = self.anchor + self.data.qpos.reshape(-1, 3)[self.first :]
        return np.vstack([self.anchor, moving, self.data.mocap_pos[0]])

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
        # a node on the drum does not hold the next one: only the pull of the winch does
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
        self._drag(speed)
        self._mujoco.mj_step(self.model, data)

    def _drag(self, speed: np.ndarray) -> None:
        """Add the drag on the links that are off the drum."""
        p = self.params
        if self.first == self.count - 1:
            return
        nodes = self.nodes()
        along = nodes[2:] - nodes[:-2]
        along /= np.maximum(np.linalg.norm(along, axis=1), 1e-9)[:, None]
        moving = speed[self.first :]
        lengthwise = (moving * along).sum(axis=1)[:, None] * along
        force = self.data.qfrc_applied.reshape(-1, 3)
        force[self.first :] -= p.drag * lengthwise + p.normal_drag * (moving - lengthwise)

    def _hold(self, k: int, is_held: bool) -> None:
        """Join node k to the next one, or not."""
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


def cable_length(field: DistanceField, nodes: np.ndarray, max_depth: float) -> float:
    """Return the length of a cable (n, 3) over the surfaces that its chords cut, metres.

    Raises
    ------
    ArithmeticError
        If a link is deeper in a solid than `max_depth`, metres: the cable has gone through it.
    """
    steps = np.linalg.norm(np.diff(nodes, axis=0), axis=1)
    middles = 0.5 * (nodes[1:] + nodes[:-1])
    depth = np.maximum(-field.distance(middles), 0.0)
    if depth.max(initial=0.0) > max_depth:
        k = int(depth.argmax())
        raise ArithmeticError(
            f"the cable is {depth[k]:.2f} m inside a solid at {middles[k].round(2).tolist()}"
        )
    half = 2.0 * np.arctan(2.0 * depth / np.maximum(steps, 1e-9))
    bent = np.where(half > 1e-6, half / np.sin(np.maximum(half, 1e-9)), 1.0)
    return float((steps * bent).sum())
