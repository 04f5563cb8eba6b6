"""A vehicle that reports what a script says, flown without a link."""

from dataclasses import replace

import numpy as np

from netsp import Problem
from netsp.online.fly.vehicle import LinkedVehicle
from netsp.online.guard.telemetry import Fix
from netsp.online.link.geo_frame import Frame
from netsp.online.link.vehicle_kind import VehicleKind

SITE = Problem(base=(0, 0), goals=[(6, 2, -1)], tether_length=40)


class Scripted:
    """A session whose vehicle goes where a function of time says, ten positions a second."""

    system, others, fault, pace = 1, (), None, 1.0
    silent_s = position_age_s = stalled_s = 0.0
    kind = VehicleKind(12, 3)

    def __init__(self, motion, echo=None, velocity=None):
        self.motion, self.frame, self.link = motion, Frame(SITE), self
        velocity = velocity or (lambda t: None)
        self.velocity = velocity
        self.latest = Fix(0.0, motion(0.0), armed=True, mode="GUIDED", estimate=True,
                       velocity=velocity(0.0))  # fmt: skip
        self.sent, self.asked, self.fresh = [], [], []
        self.answers = echo

    @property
    def echo(self):
        """The last target, or what else the test says, a tenth of a second ago."""
        return self.answers and (self.answers(self.targets[-1]), 0.1)

    @property
    def targets(self):
        return [self.frame.from_local(m.x, m.y, m.z) for _, m in self.sent]

    def watch(self, check):
        self.check = check

    def aiding_fault(self, *_):
        pass

    def request_positions(self):
        self.asked.append("positions")

    def distrust(self, why):
        self.distrusted = why

    def command(self, *numbers):
        self.asked.append(numbers)
        return True

    def send(self, message):
        self.sent.append((self.latest.time, message))
        return True

    def sleep(self, seconds):
        time = self.latest.time + seconds
        self.latest = replace(
            self.latest, time=time, position=self.motion(time), velocity=self.velocity(time)
        )
        self.fresh.append(np.array(self.latest.position))

    def new_places(self):
        found, self.fresh = self.fresh, []
        return found


def driven(motion, path, seconds, echo=None, velocity=None):
    """Drive a vehicle along a path that it does not decide itself."""
    vehicle = LinkedVehicle(Scripted(motion, echo, velocity), 0.3)
    vehicle.go(np.array(path, dtype=float), seconds, 0.0, np.zeros(3), True)
    return vehicle
