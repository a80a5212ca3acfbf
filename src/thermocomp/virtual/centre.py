"""A virtual horizontal machining centre: reduced finite elements, friction, a chiller, joints."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.exceptions import InputError
from thermocomp.virtual.heat import HeatSources
from thermocomp.virtual.joints import Joints, slide_with_friction
from thermocomp.virtual.machine import Air, FeedDrive, Truth, check, stretches
from thermocomp.virtual.statespace import REFERENCE_TEMPERATURE, Operators, ReducedModel

FloatArray = NDArray[np.float64]
#: changes the state after a step of a drive, given the values watched before the step and the air
Correction = Callable[[FloatArray, list[float], FloatArray], object]

#: places evaluated for friction and thermostat after every step
_WATCHED = ("front_bearing", "rear_bearing", "shaft", "front_seat", "coolant", "bed_front")
#: heat inputs that depend on the watched values
_FRICTION = ("front_bearing", "rear_bearing", "coolant")


@dataclass(frozen=True, eq=False)
class CentreState:
    """Thermal state of the machining centre.

    Parameters
    ----------
    field : ndarray of shape (n_states,)
        State of the reduced model.
    chilling : bool
        Whether the chiller runs.
    slid : float
        Displacement of the column's foot on the bed [um].
    """

    field: FloatArray
    chilling: bool
    slid: float


@dataclass(frozen=True, eq=False)
class MachiningCentre:
    """The virtual machine tool (X-01); implements `thermocomp.virtual.machine.VirtualMachine`.

    Structure ``w X' b Z Y (C1) t``: the table moves along X on the bed's front, the column along Z on its rear, the
    headstock along Y on the column's front, the spindle points towards -Z. Right is +X, front is -Z. Time constants
    from half a minute (bearings) to days (foundation); heat that is nonlinear in speed and temperature; hysteresis due
    to the chiller's thermostat and to friction under the column.

    Parameters
    ----------
    model : ReducedModel
        Finite-element model of spindle, column, bed and screws; the other parts are lumped masses.
    longest_step : float
        Longest interval between updates of friction and thermostat [s].
    """

    model: ReducedModel = field(default_factory=lambda: ReducedModel.load("centre"))
    heat: HeatSources = field(default_factory=HeatSources)
    joints: Joints = field(default_factory=Joints)
    longest_step: float = 20.0

    @property
    def places(self) -> tuple[str, ...]:
        """Names of the places with known temperatures."""
        return self.model.places

    @property
    def observables(self) -> tuple[str, ...]:
        """Names of the displacements and angles."""
        return self.model.observables

    def init(self, air: Air) -> CentreState:
        """Return the equilibrium state of a machine that has been switched off in this air for a long time."""
        rest = FeedDrive(powered=False)
        state = self.model.steady(np.zeros(len(self.model.inputs)), air.values, self._theta(rest))
        wish = self._observable("slide") @ (state - REFERENCE_TEMPERATURE * self.model.one)
        return CentreState(state, chilling=False, slid=float(wish))

    def run(
        self, state: CentreState, drives: Sequence[FeedDrive], air: FloatArray, dt: float
    ) -> tuple[CentreState, Truth]:
        """Advance by one step of `dt` for each item of `drives`, in equal parts no longer than `longest_step`.

        Parameters
        ----------
        air : ndarray of shape (n_steps, 3)
            `Air.values` of each step.
        dt : float
            [s]
        """
        check(drives, air, dt)
        parts = math.ceil(dt / self.longest_step)
        fields = np.empty((len(drives) * parts, len(self.model.one)))
        ratio = np.empty(len(drives))
        current, chilling = state.field, state.chilling
        for first, last in stretches(drives):
            drive = drives[first]
            ratio[first:last] = abs(drive.speed) / self.heat.top_speed
            rows = slice(first * parts, last * parts)
            stretch = np.repeat(air[first:last], parts, axis=0)
            chilling = self._advance(current, chilling, drive, stretch, dt / parts, fields[rows])
            current = fields[rows.stop - 1].copy()
        truth, slid = self._truth(fields, np.repeat(ratio, parts), state.slid)
        ends = slice(parts - 1, None, parts)
        return CentreState(current, chilling, slid), Truth(truth.temperatures[ends], truth.observables[ends])

    def _advance(
        self, now: FloatArray, chilling: bool, drive: FeedDrive, air: FloatArray, dt: float, fields: FloatArray
    ) -> bool:
        """Write the states after each step of one drive command to `fields`; return whether the chiller runs."""
        self._check(drive)
        heat = self.heat
        operators = self.model.operators(self._theta(drive), dt, self._watched)
        correct = self._correction(operators, drive)
        flow = drive.cooled and drive.powered
        forcing = air @ operators.air.T + operators.heat @ self._given(drive)
        variable = operators.heat[:, [self.model.inputs.index(n) for n in _FRICTION]]
        seen = (self.model.rows(self._watched) @ now).tolist()
        n = len(now)
        power = np.zeros(len(_FRICTION))
        turning = drive.speed != 0 and drive.powered
        for k in range(len(fields)):
            if turning:
                power[0], power[1] = self._friction(drive, seen)
            power[2] = -heat.chiller if flow and chilling else 0.0
            after = operators.state @ now
            after += forcing[k]
            after += variable @ power
            if correct:
                correct(after, seen, air[k])
            if flow:
                end = after[n:].tolist()
                share = heat.until_switch(chilling, seen[4] - seen[5], end[4] - end[5])
                if share < 1.0:
                    # The chiller runs for part of the step: without this correction the result would depend on the
                    # switching times and the step length.
                    change = heat.chiller * (1.0 - share)
                    after += variable[:, 2] * (change if chilling else -change)
                    chilling = not chilling
            seen = after[n:].tolist()
            fields[k] = now = after[:n]
        return chilling and flow

    def _truth(self, fields: FloatArray, ratio: FloatArray, slid: float) -> tuple[Truth, float]:
        temperatures = fields @ self.model.temperature.T
        observables = (fields - REFERENCE_TEMPERATURE * self.model.one) @ self.model.observable.T
        place = dict(zip(self.places, temperatures.T, strict=True))
        index = {name: k for k, name in enumerate(self.observables)}
        wish = observables[:, index["slide"]]
        slide = slide_with_friction(slid, wish, self.joints.stiction)
        shaft = self._shaft(place, ratio)
        # The part of the free displacement that the foot does not slide displaces the column.
        observables[:, index["z"]] += self.joints.share * (slide - wish) - shaft
        observables[:, index["y"]] += self.joints.lift * ratio**2
        observables[:, [index["nose"], index["tip"]]] += shaft[:, None]
        observables[:, index["slide"]] = slide
        return Truth(temperatures, observables), float(slide[-1])

    @property
    def _watched(self) -> tuple[str, ...]:
        """Places whose temperatures are evaluated after every step; those of `_WATCHED` first."""
        return _WATCHED

    def _friction(self, drive: FeedDrive, seen: list[float]) -> tuple[float, float]:
        """Return the heat of the front and of the spring-loaded rear bearing at the watched temperatures [W]."""
        front, rear, shaft, seat = seen[:4]
        ratio = abs(drive.speed) / self.heat.top_speed
        return self.heat.front.heat(ratio, front, shaft - seat), self.heat.rear.heat(ratio, rear, 0.0)

    def _correction(self, _operators: Operators, _drive: FeedDrive) -> Correction | None:
        """Return a change of the state after each step, in addition to the reduced model; None: there is none."""
        return None

    def _shaft(self, place: Mapping[str, FloatArray], ratio: FloatArray) -> FloatArray:
        """Return the shift of the shaft towards the workpiece [um]."""
        return self.joints.shaft(place["shaft"] - place["front_seat"], ratio)

    def _theta(self, drive: FeedDrive) -> tuple[float, ...]:
        """Return the parameters of the conductances, rounded to 1/64, as they are not known more accurately."""
        shares = {"rotation": self.heat.rotation(drive.speed), "flow": float(drive.cooled and drive.powered)}
        shares |= {f"feed_{a}": self.heat.moving(f) for a, f in zip("xyz", drive.feed, strict=True)}
        return tuple(round(64.0 * shares[name]) / 64.0 for name in self.model.theta)

    def _given(self, drive: FeedDrive) -> FloatArray:
        given = self.heat.given(drive)
        return np.array([given.get(name, 0.0) for name in self.model.inputs])

    def _check(self, drive: FeedDrive) -> None:
        if not abs(drive.speed) <= self.heat.top_speed:
            raise InputError(
                f"spindle speed {drive.speed} 1/min exceeds the top speed of the machine, {self.heat.top_speed:g} 1/min"
            )
        for place in drive.loads:
            if place not in self.model.inputs:
                near = get_close_matches(place, self.model.inputs, n=3, cutoff=0.4) or self.model.inputs
                raise InputError(f"no heat can be applied at {place!r}; the nearest are {', '.join(near)}")

    def _observable(self, name: str) -> FloatArray:
        row: FloatArray = self.model.observable[self.observables.index(name)]
        return row
