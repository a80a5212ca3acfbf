"""Heat sources of the virtual machining centre; plausible engineering values, not taken from a real machine."""

import math
from dataclasses import dataclass

import numpy as np

from thermocomp.virtual.axes import AXES, N_HATS, TRAVEL
from thermocomp.virtual.machine import FeedDrive


@dataclass(frozen=True)
class BearingFriction:
    """Heat of a spindle bearing according to Palmgren: a viscous and a load-dependent torque.

    ``P = viscous r^(5/3) exp(-thinning (T - 40 degC)) + load r (1 + preload_gain max(0, T_shaft - T_housing))``
    with r = speed / top speed. Oil viscosity decreases with temperature; a shaft warmer than the housing raises the
    preload.

    Parameters
    ----------
    viscous, load : float
        Values at top speed, 40 degC and zero temperature difference [W].
    thinning : float
        [1/K]
    preload_gain : float
        [1/K]
    """

    viscous: float
    load: float
    thinning: float = 0.012
    preload_gain: float = 0.04

    def heat(self, ratio: float, temperature: float, tightening: float) -> float:
        """Return the heat [W] from the speed ratio, bearing temperature [degC], and shaft minus housing [K]."""
        viscous = self.viscous * math.pow(ratio, 5.0 / 3.0) * math.exp(-self.thinning * (temperature - 40.0))
        return viscous + self.load * ratio * (1.0 + self.preload_gain * max(0.0, tightening))


@dataclass(frozen=True)
class HeatSources:
    """All heat sources of the machine.

    Parameters
    ----------
    top_speed : float
        Maximum spindle speed [1/min].
    motor_on, motor_top : float
        Loss of the running spindle motor: magnetising; iron and windage at top speed, with speed squared [W].
    drive_nut, drive_bearing : float
        Friction of the nut of a feed drive, and of its bearing and motor, at 1000 mm/min [W].
    hold : float
        Heat of the motor of the vertical axis Y, which holds the headstock [W].
    cabinet, cabinet_share : float
        Heat conducted into the rear right of the column by the electric cabinet: constant [W], and per watt of motor
        loss.
    rotor_share : float
        Fraction of the motor loss that arises in the rotor; the rest arises in the stator.
    screw_share : float
        Fraction of the nut friction that goes into the screw.
    top_feed : float
        Feed rate at which the additional convection of a screw is at its maximum [mm/min].
    hydraulics : float
        Heat conducted into the rear of the bed by the hydraulic unit [W].
    pump : float
        Heat of the coolant pump [W].
    chiller : float
        Heat removed from the coolant while the chiller runs [W].
    setpoint, half_band : float
        Set point of the coolant relative to the bed temperature, and half of the switching hysteresis [K].
    """

    top_speed: float = 3500.0
    front: BearingFriction = BearingFriction(viscous=220.0, load=60.0)
    rear: BearingFriction = BearingFriction(viscous=90.0, load=25.0)
    motor_on: float = 50.0
    motor_top: float = 340.0
    drive_nut: float = 9.0
    drive_bearing: float = 16.0
    hold: float = 12.0
    cabinet: float = 12.0
    cabinet_share: float = 0.04
    rotor_share: float = 0.35
    screw_share: float = 0.5
    top_feed: float = 10_000.0
    hydraulics: float = 25.0
    pump: float = 160.0
    chiller: float = 1500.0
    setpoint: float = -0.5
    half_band: float = 0.8

    def rotation(self, speed: float) -> float:
        """Return the share of the rotating parts' additional convection at a speed [1/min]: n^(2/3) (Becker 1963)."""
        return float((abs(speed) / self.top_speed) ** (2.0 / 3.0))

    def moving(self, feed: float) -> float:
        """Return the share of a rotating screw's additional convection at a feed rate [mm/min]: power 2/3."""
        return float(min(abs(feed) / self.top_feed, 1.0) ** (2.0 / 3.0))

    def given(self, drive: FeedDrive) -> dict[str, float]:
        """Return the heat at each named place that does not depend on temperatures [W]."""
        if not drive.powered:
            return {}
        ratio = abs(drive.speed) / self.top_speed
        motor = self.motor_on + self.motor_top * ratio**2 if ratio > 0 else 0.0
        heat = {"rotor": self.rotor_share * motor, "stator": (1.0 - self.rotor_share) * motor}
        heat["cabinet"] = self.cabinet + self.cabinet_share * motor
        heat["hydraulics"] = self.hydraulics
        for axis, feed, stroke in zip(AXES, drive.feed, drive.stroke, strict=True):
            nut = self.drive_nut * abs(feed) / 1000.0
            heat[f"{axis}_nut"] = (1.0 - self.screw_share) * nut
            heat[f"{axis}_bearing"] = self.drive_bearing * abs(feed) / 1000.0
            shares = swept(stroke or (0.0, TRAVEL[axis]), TRAVEL[axis])
            heat |= {f"{axis}_screw_{k}": self.screw_share * nut * share for k, share in enumerate(shares)}
        heat["y_bearing"] += self.hold
        if drive.cooled:
            heat["coolant"] = self.pump
        for place, load in drive.loads.items():
            heat[place] = heat.get(place, 0.0) + load
        return heat

    def until_switch(self, chilling: bool, before: float, after: float) -> float:
        """Return the share of a step before the thermostat switches; 1 if it does not.

        Parameters
        ----------
        before, after : float
            Coolant minus bed at the start of the step, and at its end without switching [K].
        """
        limit = self.setpoint + (-self.half_band if chilling else self.half_band)
        if (before > limit) != chilling:
            return 0.0  # far beyond the limit, for example after a stop of the coolant loop
        if (after > limit) == chilling:
            return 1.0
        return min(max((limit - before) / (after - before), 0.0), 1.0) if after != before else 0.0


def swept(stroke: tuple[float, float], travel: float) -> list[float]:
    """Return the distribution of a uniform movement over a stroke on the hat functions along a travel.

    Parameters
    ----------
    stroke : tuple of float
        Start and end of the stroke [mm]; equal for an oscillation at one point.
    travel : float
        [mm], from 0
    """
    knots = np.linspace(0.0, travel, N_HATS)
    low, high = (min(max(p, 0.0), travel) for p in sorted(stroke))
    # Exact for piecewise linear hats if every knot within the stroke is a node of the trapezoidal rule.
    nodes = np.unique([low, high, *knots[(knots > low) & (knots < high)]])
    hats = np.maximum(0.0, 1.0 - np.abs(nodes[:, None] - knots) / (knots[1] - knots[0]))
    shares = np.trapezoid(hats, nodes, axis=0) / (high - low) if len(nodes) > 1 else hats[0]
    return [float(s) for s in shares]
