"""A heated tool at rest in a fixed spindle shaft: the set-up of Wessel 2004, section IV (W-08, W-15)."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.exceptions import InputError
from thermocomp.virtual.joints import slide_with_friction
from thermocomp.virtual.machine import Air, FeedDrive, Truth, check, stretches
from thermocomp.virtual.statespace import REFERENCE_TEMPERATURE, ReducedModel

FloatArray = NDArray[np.float64]
#: heat sources, and their shares of the inputs of the reduced model: heating elements at the bearing fit, hot-air gun
#: at the cutting edges, half of whose air flows along the tool (an engineering value), soldering iron at the tip
SOURCES: Mapping[str, Mapping[str, float]] = {
    "heater": {"heater": 1.0},
    "hot_air": {"tip": 0.5, "on_tool": 0.5},
    "tip": {"tip": 1.0},
}
#: conductance of the foot of the body to the foundation, `tools/finite_elements/data/tool.toml` [W/K]
FOOT = 60.0 * math.pi * 0.1**2
#: `RestingTool.stiction` by mounting of the tool, in proportion to pressure and squared length of the joints of
#: `thermocomp.virtual.nonlinear.MOUNTINGS` [um]
STICTION = {"hydraulic": 0.8, "shrink": 1.3, "collet": 0.4}


@dataclass(frozen=True, eq=False)
class ToolState:
    """Thermal state of a chuck with its tool.

    Parameters
    ----------
    field : ndarray of shape (n_states,)
        State of the reduced model.
    slipped : float
        Slip of the shank in the chuck [um].
    """

    field: FloatArray
    slipped: float


@dataclass(frozen=True, eq=False)
class RestingTool:
    """A chuck with its tool on a fixed shaft; implements `thermocomp.virtual.machine.VirtualMachine`.

    Heaters at the bearing fit warm it from behind, a hot-air gun and a soldering iron from the tip (`SOURCES`). Its
    heat loss is superlinear in temperature (natural convection, radiation), and the shank slips in the chuck only when
    friction is exceeded.

    Parameters
    ----------
    stiction : float
        Free displacement of the shank in the chuck at which slip starts [um]; an engineering value.
    convection : float
        Conductance by free convection contained in the model at `usual_rise` [W/K]: half of the film conductance.
    usual_rise : float
        Mean temperature rise of the surface at which the film values apply [K]; free convection has exponent 1/4
        (laminar).
    longest_step : float
        Longest interval between updates of the heat loss [s].
    foundation : float
        Temperature of the foundation relative to the room [K].
    """

    model: ReducedModel = field(default_factory=lambda: ReducedModel.load("tool_joints"))
    stiction: float = 0.8
    convection: float = 0.35
    usual_rise: float = 20.0
    longest_step: float = 20.0
    foundation: float = 0.0

    @property
    def places(self) -> tuple[str, ...]:
        """Names of the places with known temperatures."""
        return self.model.places

    @property
    def observables(self) -> tuple[str, ...]:
        """Names of the displacements."""
        return self.model.observables

    def mounted(self, mounting: str, foundation: float = 0.0) -> Self:
        """Return the tool in one of the chucks of `STICTION`, on a foundation of its own temperature [K]."""
        return replace(self, stiction=STICTION[mounting], foundation=foundation)

    def init(self, air: Air) -> ToolState:
        """Return the state of a tool in equilibrium with room and foundation."""
        state = self.model.steady(self._given(FeedDrive()), air.values, ())
        return ToolState(state, self._wish(self._linear(state[None])).item())

    def run(self, state: ToolState, drives: Sequence[FeedDrive], air: FloatArray, dt: float) -> tuple[ToolState, Truth]:
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
        self._advance(state.field, drives, air, dt / parts, fields)
        observables, slipped = self._move(fields, state.slipped)
        ends = slice(parts - 1, None, parts)
        truth = Truth((fields @ self.model.temperature.T)[ends], observables[ends])
        return ToolState(fields[-1].copy(), slipped), truth

    def _advance(
        self, now: FloatArray, drives: Sequence[FeedDrive], air: FloatArray, dt: float, fields: FloatArray
    ) -> None:
        """Write the states after each part of each step to `fields`."""
        parts = len(fields) // len(drives)
        operators = self.model.operators((), dt, ("surface",))
        surface = self.model.inputs.index("surface")
        watched = float((self.model.rows(("surface",)) @ now).item())
        for first, last in stretches(drives):
            given = self._given(drives[first])
            for k in range(first * parts, last * parts):
                rise = watched - air[k // parts, 0]
                given[surface] = -self.convection * rise * ((abs(rise) / self.usual_rise) ** 0.25 - 1.0)
                after = operators.state @ now + operators.heat @ given + operators.air @ air[k // parts]
                fields[k] = now = after[:-1]
                watched = float(after[-1])

    def _move(self, fields: FloatArray, slipped: float) -> tuple[FloatArray, float]:
        """Return the displacements caused by the temperatures [um], and the slip of the shank at the end."""
        observables = self._linear(fields)
        wish = self._wish(observables)
        slides = slide_with_friction(slipped, wish, self.stiction)
        observables[:, self.observables.index("s1")] += slides - wish
        return observables, float(slides[-1])

    def _linear(self, fields: FloatArray) -> FloatArray:
        result: FloatArray = (fields - REFERENCE_TEMPERATURE * self.model.one) @ self.model.observable.T
        return result

    def _wish(self, observables: FloatArray) -> FloatArray:
        """Return the free growth of the clamped shank [um], from the chuck front to the tip, without friction."""
        s1, s2 = (self.observables.index(n) for n in ("s1", "s2"))
        result: FloatArray = observables[:, s1] - observables[:, s2]
        return result

    def _given(self, drive: FeedDrive) -> FloatArray:
        if drive.speed or any(drive.feed):
            raise InputError("the resting tool cannot turn or move: its protocol supports loads only")
        given = np.zeros(len(self.model.inputs))
        given[self.model.inputs.index("on_foot")] = FOOT * self.foundation
        for source, load in drive.loads.items():
            if source not in SOURCES:
                raise InputError(f"no heat can be applied at {source!r}, only at {', '.join(SOURCES)}")
            for place, share in SOURCES[source].items():
                given[self.model.inputs.index(place)] += share * load if drive.powered else 0.0
        return given
