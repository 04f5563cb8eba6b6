"""Equipment of a mission's robot: camera, tether and sensors, as in its file."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from netsp.base.arrays import Floats
from netsp.base.field_types import NonNegative, Number, Positive
from netsp.base.validated import Model
from netsp.model.solution import max_turning
from netsp.world.tether.load import Load

SEA_WATER_DENSITY = 1025.0
"""Physical constant: density of sea water, kg/m³."""


class Camera(Model):
    """Camera with a square field of view."""

    range: Annotated[Positive, Field(description="range of sight, m")] = 2.0
    field_of_view: Annotated[
        Annotated[float, Field(gt=0.0, lt=180.0)],
        Field(description="full angle of the square field of view, degrees"),
    ] = 70.0
    tilt: Annotated[
        Annotated[float, Field(ge=0.0, le=90.0)],
        Field(description="maximum angle by which the camera turns up or down, degrees"),
    ] = 90.0
    patch: Annotated[
        Positive, Field(description="side of the surface patches that are counted, m")
    ] = 0.1


class TetherPhysics(Model):
    """Properties by which a tether needs more than its taut length; zero by default.

    `netsp.world.tether.load` states formulas and sources.
    """

    slack: Annotated[
        Annotated[NonNegative, Field(le=1.0)],
        Field(description="slack tether, as a share of the taut length"),
    ] = 0.0
    diameter: Annotated[
        Annotated[NonNegative, Field(le=1.0)],
        Field(description="diameter of the tether, m; with 0 the water does not act on it"),
    ] = 0.0
    drag_coefficient: Annotated[
        NonNegative, Field(description="drag coefficient of a cylinder across the flow")
    ] = 1.2
    tension: Annotated[
        Positive, Field(description="tension with which the tether is held at the anchor, N")
    ] = 10.0
    friction: Annotated[
        Annotated[NonNegative, Field(le=10.0)],
        Field(
            description="coefficient of friction at contacts; above 0, planners and limits count "
            "the tether's length if friction holds it on the ends of solids"
        ),
    ] = 0.0
    max_tension_ratio: Annotated[
        Annotated[Number, Field(gt=1.0, le=1e6)] | None,
        Field(
            description="largest factor by which friction may raise the tension; null for no limit"
        ),
    ] = None
    pulls_vehicle: Annotated[
        bool, Field(description="whether tension and drag act on a vehicle with dynamics")
    ] = False

    def load(self, water: Floats) -> Load:
        """Return the load on the tether in water that moves with a velocity (3,), m/s."""
        drag = 0.5 * SEA_WATER_DENSITY * self.drag_coefficient * self.diameter
        x, y, z = (float(v) for v in water)
        return Load(self.slack, drag, x, y, z, self.tension)

    @property
    def max_turning(self) -> float:
        """Largest sum of turning angles that the limit on friction allows, rad."""
        return max_turning(self.friction, self.max_tension_ratio)


class PositionSensor(Model):
    """Error and delay of the position that the planner gets; zero by default."""

    noise: Annotated[
        Annotated[NonNegative, Field(le=100.0)],
        Field(description="standard deviation along each axis, m"),
    ] = 0.0
    delay: Annotated[
        Annotated[NonNegative, Field(le=60.0)],
        Field(description="age of a position when it arrives, s"),
    ] = 0.0

    def reserve(self, speed: float) -> float:
        """Return the largest distance of the robot from its estimated position, metres.

        It is three standard deviations, plus the distance travelled during the delay at `speed`,
        m/s.
        """
        return 3.0 * self.noise + self.delay * speed


class RangeSensor(Model):
    """Forward-looking range sensor, such as a scanning sonar, that points along the path."""

    range: Annotated[Positive, Field(description="largest distance that the sensor sees, m")] = 5.0
    field_of_view: Annotated[
        Annotated[float, Field(gt=0.0, le=180.0)],
        Field(description="full angle of its cone, degrees"),
    ] = 120.0
    noise: Annotated[
        Annotated[NonNegative, Field(le=1.0)], Field(description="standard deviation of a range, m")
    ] = 0.0
