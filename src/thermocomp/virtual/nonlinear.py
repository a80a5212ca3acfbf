"""Virtual machines with nonlinear joints, bearings and surfaces, in addition to the linear ones.

Differences: film coefficients that depend on temperatures and speed (`thermocomp.virtual.convection`), joints that open
and close (`thermocomp.virtual.fits`), preload and friction of the bearings (`thermocomp.virtual.preload`), and
expansion coefficients that increase with temperature. Each value has a source or is marked as an engineering value;
none was tuned to the results of a method.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thermocomp.virtual.centre import Correction, MachiningCentre
from thermocomp.virtual.convection import Face, Faces
from thermocomp.virtual.exchange import Exchange
from thermocomp.virtual.fits import Fit
from thermocomp.virtual.joints import slide_with_friction
from thermocomp.virtual.machine import Air, FeedDrive, Truth, stretches
from thermocomp.virtual.preload import AngularContact
from thermocomp.virtual.statespace import REFERENCE_TEMPERATURE, Operators, ReducedModel
from thermocomp.virtual.toolsystem import RestingTool, ToolState

FloatArray = NDArray[np.float64]

#: Relative increase of the expansion coefficient of steel per kelvin at 20 degC: EN 1993-1-2, 3.4.1.1, dL/L = 1.2e-5 T
#: + 0.4e-8 T^2 - 2.416e-4; also used for grey iron and carbide (an engineering value) [1/K]
EXPANSION_GROWS = 0.8e-8 / 1.216e-5
#: emissivity of paint and of ground steel (Incropera, Table A.11: 0.9 and more; 0.1 to 0.3)
PAINT, BARE = 0.9, 0.25

#: HSK-A63: shank of 48.007 to 48.011 mm at the gauge line (ISO 12164, in Y. Ito, Modular Design for Machine Tools, fig.
#: 9-21) in a socket of 48 mm: interference of 4.5 um in radius; hollow shank and nose as in the finite-element model
TAPER = Fit(radius=21.5, bore=10.0, outside=44.0, length=32.0, squeeze=4.5, linear=4000.0)
#: Hydraulic chuck, 20 mm carbide shank over 50 mm: pressure of 70 MPa (an engineering value: catalogues state some
#: hundred N m, which agrees with 330 N m at a friction of 0.15); behind the sleeve the oil of the linear model
GRIP = Fit(
    radius=10.0,
    bore=0.0,
    outside=25.0,
    length=50.0,
    squeeze=6.5,
    linear=1200.0,
    expansion=(5.5, 11.6),
    modulus=(600e3, 210e3),
    poisson=(0.22, 0.3),
    behind=1200.0,
    conductivity=55.0,
)
#: The grip of each mounting of the tool (W-10), engineering values; the shape of the chuck remains that of the
#: hydraulic one. Shrink: steel on carbide without oil, a thinner wall, 0.025 mm in diameter, which agrees with some
#: 530 N m. Collet ER32: clamped over 40 mm, some 190 N m, and a slotted collet in a cone of 3000 W/(m2 K) behind.
MOUNTINGS: Mapping[str, Fit] = {
    "hydraulic": GRIP,
    "shrink": replace(GRIP, squeeze=12.5, outside=19.0, behind=math.inf),
    "collet": replace(GRIP, squeeze=5.0, length=40.0, behind=3000.0),
}
#: Outer rings of the front bearing in the housing: gap of 6 um in diameter (an engineering value: some um are usual)
SEAT = Fit(radius=55.0, bore=45.0, outside=80.0, length=60.0, squeeze=-3.0, linear=3500.0, expansion=(12.0, 11.7))
#: Three 7014 with 25 degrees contact angle, two spring-loaded 7012: sizes and ratings from catalogues, rounded; the
#: preload of some hundred N is an engineering value
FRONT = AngularContact(pitch=90.0, ball=12.7, balls=20, static=44e3, preload=600.0)
REAR = AngularContact(pitch=77.5, ball=11.1, balls=19, static=33e3, preload=300.0, pair=1, sprung=True)

#: Surfaces of the resting tool: areas and lengths from the finite-element model
TOOL_FACES: Mapping[str, Face] = {
    "on_tool": Face(0.00723, 0.110, 9.0, BARE, curvature=5.5),
    "on_chuck": Face(0.01800, 0.090, 8.0, BARE, curvature=1.8),
    "on_shaft": Face(0.06289, 0.200, 8.0, BARE, curvature=2.9),
    "on_body": Face(0.08294, 0.100, 7.0, PAINT, curvature=0.5),
}
#: Surfaces of the machining centre; areas of the lumps are their conductance divided by 8 W/(m2 K). Lengths of lumps
#: are engineering values.
CENTRE_FACES: Mapping[str, Face] = {
    "spindle_rotating": Face(0.03372, 0.060, 8.0, BARE, lying=True, films_turning=60.0),
    "spindle_front": Face(0.09142, 0.180, 8.0, BARE, wind=12.0, films_turning=12.0),
    "column_outside": Face(4.352, 1.60, 8.0, PAINT),
    "bed_outside": Face(4.960, 0.50, 8.0, PAINT),
    "headstock_front": Face(0.500, 0.60, 8.0, PAINT),
    "headstock_rear": Face(0.875, 0.60, 8.0, PAINT),
    "table": Face(0.750, 0.30, 8.0, BARE),
    **{f"{axis}_bearing": Face(0.1875, 0.25, 8.0, PAINT) for axis in "xyz"},
}
#: surfaces exposed to the air of the work space
IN_WORK_SPACE = ("spindle_rotating", "spindle_front")


@dataclass(frozen=True, eq=False)
class NonlinearTool(RestingTool):
    """The resting tool with film coefficients, joints and expansion that depend on its temperatures.

    Parameters
    ----------
    model : ReducedModel
        Model with joints.
    taper, grip : Fit or None
        Joint of the shank in the shaft, and of the tool in the chuck, where it slips; None: as in the reduced model.
    expansion_grows : float
        Relative increase of the expansion coefficient per kelvin [1/K].
    stiction, convection, usual_rise
        Settings of the linear tool; not used here.
    """

    model: ReducedModel = field(default_factory=lambda: ReducedModel.load("tool_joints"))
    faces: Mapping[str, Face] = field(default_factory=lambda: TOOL_FACES)
    taper: Fit | None = TAPER
    grip: Fit | None = GRIP
    expansion_grows: float = EXPANSION_GROWS

    def mounted(self, mounting: str, foundation: float = 0.0) -> Self:
        """Return the tool with the grip of one of `MOUNTINGS`, on a foundation of its own temperature [K]."""
        return replace(self, grip=MOUNTINGS[mounting], foundation=foundation)

    def init(self, air: Air) -> ToolState:
        """Return the state of a tool that was mounted at 20 degC and has been in this air for a long time."""
        state = super().init(air).field
        return ToolState(state, float(self._slip(state[None], 0.0)[0]))

    def _advance(
        self, now: FloatArray, drives: Sequence[FeedDrive], air: FloatArray, dt: float, fields: FloatArray
    ) -> None:
        parts = len(fields) // len(drives)
        watched = (*self.faces, "taper_a", "taper_b", "grip_a", "grip_b")
        paths = [*((name, None) for name in self.faces), ("taper_a", "taper_b"), ("grip_a", "grip_b")]
        operators = self.model.operators((), dt, watched)
        exchange = Exchange.of(self.model, operators, watched, paths)
        faces, m = Faces(list(self.faces.values())), len(self.faces)
        extra, linear = np.zeros(len(paths)), faces.linear(0.0)
        seen = self.model.rows(watched) @ now
        for first, last in stretches(drives):
            forced = operators.heat @ self._given(drives[first])
            for k in range(first * parts, last * parts):
                around = air[k // parts]
                shaft, shank, chuck, tool = seen[m:].tolist()
                extra[:m] = faces.conductance(seen[:m], around[0]) - linear
                extra[m:] = _more(self.taper, shank, shaft), _more(self.grip, tool, chuck)
                after = operators.state @ now + forced + operators.air @ around
                exchange.settle(after, extra, around)
                fields[k] = now = after[: len(now)]
                seen = after[len(now) :]

    def _move(self, fields: FloatArray, slipped: float) -> tuple[FloatArray, float]:
        observables = self._linear(fields)
        for name, square in _squared(self.model, fields).items():
            observables[:, self.observables.index(name)] += self.expansion_grows / 2.0 * square
        behind = self._slip(fields, slipped)
        observables[:, self.observables.index("s1")] -= behind
        return observables, float(behind[-1])

    def _slip(self, fields: FloatArray, slipped: float) -> FloatArray:
        """Return the shank displacement lost by slip in the chuck, which expands more than the shank [um]."""
        if self.grip is None:
            return np.zeros(len(fields))
        chuck, tool = self.model.rows(("grip_a", "grip_b")) @ fields.T
        return slide_with_friction(
            slipped, self.grip.wish(tool, chuck), self.grip.hold(self.grip.pressure(tool, chuck))
        )


@dataclass(frozen=True, eq=False)
class NonlinearCentre(MachiningCentre):
    """The machining centre with films, joints, bearings and expansion that depend on temperature and speed.

    Parameters
    ----------
    model : ReducedModel
        Model with joints.
    taper, seat : Fit or None
        Joint of the test bar in the shaft, and of the outer rings in the housing; None: as in the reduced model.
    front, rear : AngularContact or None
        None: friction and thermal preload of the linear machine.
    expansion_grows : float
        Relative increase of the expansion coefficient of spindle and test bar per kelvin [1/K].
    """

    model: ReducedModel = field(default_factory=lambda: ReducedModel.load("centre_joints"))
    faces: Mapping[str, Face] = field(default_factory=lambda: CENTRE_FACES)
    taper: Fit | None = TAPER
    seat: Fit | None = SEAT
    front: AngularContact | None = FRONT
    rear: AngularContact | None = REAR
    expansion_grows: float = EXPANSION_GROWS

    @property
    def _watched(self) -> tuple[str, ...]:
        return (*super()._watched, *_SIDES, "enclosure", *self.faces)

    def _friction(self, drive: FeedDrive, seen: list[float]) -> tuple[float, float]:
        front, rear = super()._friction(drive, seen)
        n = len(super()._watched)
        if self.front:
            inner, outer, ring, housing = seen[n : n + 4]
            approach = float(self.front.approach(inner, outer, self._pressed(ring, housing)))
            front = self.front.heat(drive.speed, seen[0], approach)
        if self.rear:
            rear = self.rear.heat(drive.speed, seen[1], self.rear.mounted)
        return front, rear

    def _correction(self, operators: Operators, drive: FeedDrive) -> Correction:
        rooms = ["enclosure" if name in IN_WORK_SPACE else None for name in self.faces]
        paths = [*zip(self.faces, rooms, strict=True), ("seat_a", "seat_b"), ("taper_a", "taper_b")]
        exchange = Exchange.of(self.model, operators, self._watched, paths)
        faces, m, n = Faces(list(self.faces.values())), len(self.faces), len(super()._watched)
        turning = dict(zip(self.model.theta, self._theta(drive), strict=True))["rotation"]
        linear, wind = faces.linear(turning), self.heat.rotation(drive.speed)
        in_work_space = np.array([room is not None for room in rooms])
        extra = np.zeros(len(paths))

        def correct(after: FloatArray, seen: list[float], air: FloatArray) -> FloatArray:
            _, _, ring, housing, shaft, shank, enclosure, *surfaces = seen[n:]
            around = np.where(in_work_space, enclosure, air[0])
            extra[:m] = faces.conductance(surfaces, around, drive.speed, wind) - linear
            extra[m:] = _more(self.seat, ring, housing), _more(self.taper, shank, shaft)
            return exchange.settle(after, extra, air)

        return correct

    def _pressed(self, ring: ArrayLike, housing: ArrayLike) -> FloatArray:
        """Return the contraction of the front outer raceway by the housing once the gap has closed [um]."""
        if self.seat is None:
            return np.zeros(np.shape(ring))
        inner, outer = self.seat.compliances
        return inner / (inner + outer) * np.maximum(0.0, self.seat.squeezed(ring, housing))

    def _shaft(self, place: Mapping[str, FloatArray], ratio: FloatArray) -> FloatArray:
        if self.front is None:
            return super()._shaft(place, ratio)
        pressed = self._pressed(place["seat_a"], place["seat_b"])
        approach = self.front.approach(place["balls_a"], place["balls_b"], pressed)
        return self.front.shift(approach) - self.joints.centrifugal * ratio**2

    def _truth(self, fields: FloatArray, ratio: FloatArray, slid: float) -> tuple[Truth, float]:
        truth, slid = super()._truth(fields, ratio, slid)
        grown = {name: self.expansion_grows / 2.0 * s for name, s in _squared(self.model, fields).items()}
        for name, part, sign in (("nose", "nose", 1.0), ("tip", "tip", 1.0), ("z", "tip", -1.0)):
            truth.observables[:, self.observables.index(name)] += sign * grown[part]
        return truth, slid


#: sides of the joints, in the order of the watched values
_SIDES = ("balls_a", "balls_b", "seat_a", "seat_b", "taper_a", "taper_b")


def _more(fit: Fit | None, inner: float, outer: float) -> float:
    """Return the conductance of a joint in addition to that in the linear model [W/K]."""
    return fit.conductance(inner, outer) - fit.linear * fit.area if fit else 0.0


def _squared(model: ReducedModel, fields: FloatArray) -> dict[str, FloatArray]:
    """Return the response of observables to the squared temperatures [um K], by name."""
    rise = fields - REFERENCE_TEMPERATURE * model.one
    if model.squares is None or model.squared is None:
        return {}
    return {
        name: ((rise @ square) * rise).sum(axis=1) for name, square in zip(model.squared, model.squares, strict=True)
    }
