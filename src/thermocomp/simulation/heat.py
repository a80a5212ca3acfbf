"""Where the heat of the virtual machining centre comes from; plausible engineering values, not a certain machine's."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermocomp.simulation.machine import Drive

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class BearingFriction:
    """Heat of a spindle bearing, after Palmgren: a viscous and a load-dependent torque.

    ``P = viscous r^(5/3) exp(-thinning (T - 40 degC)) + load r (1 + preload_gain max(0, T_shaft - T_housing))``
    with r = speed / top speed. The oil thins as it warms; the shaft, warmer than the housing, tightens the preload.

    Parameters
    ----------
    viscous, load : float
        At top speed, 40 degC and without a temperature difference [W].
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
        """Heat [W] at a share of top speed, a bearing temperature [degC], and shaft minus housing [K]."""
        viscous = self.viscous * math.pow(ratio, 5.0 / 3.0) * math.exp(-self.thinning * (temperature - 40.0))
        return viscous + self.load * ratio * (1.0 + self.preload_gain * max(0.0, tightening))


@dataclass(frozen=True)
class HeatSources:
    """All heat put into the machine.

    Parameters
    ----------
    top_speed : float
        Of the spindle [1/min].
    front, rear : BearingFriction
    motor_on, motor_top : float
        Loss of the running spindle motor: magnetising; iron and windage at top speed, with its square [W].
    drive_nut, drive_bearing : float
        Friction of a feed drive's nut, and of its bearing and motor, at 1000 mm/min [W].
    hold : float
        Motor of the vertical axis Y, which holds the headstock [W].
    cabinet, cabinet_share : float
        From the electric cabinet on the column's rear right: always [W], and per watt of spindle loss.
    hydraulics : float
        From the hydraulic unit at the bed's rear [W].
    pump : float
        From the coolant pump [W].
    chiller : float
        Taken from the coolant while the chiller runs [W].
    setpoint, half_band : float
        The chiller holds the coolant this far from the bed's temperature, and switches this far on either side [K].
    """

    top_speed: float = 3500.0
    front: BearingFriction = BearingFriction(viscous=330.0, load=60.0)
    rear: BearingFriction = BearingFriction(viscous=130.0, load=25.0)
    motor_on: float = 50.0
    motor_top: float = 340.0
    drive_nut: float = 9.0
    drive_bearing: float = 16.0
    hold: float = 12.0
    cabinet: float = 12.0
    cabinet_share: float = 0.04
    hydraulics: float = 25.0
    pump: float = 160.0
    chiller: float = 1500.0
    setpoint: float = -0.5
    half_band: float = 0.8

    def rotation(self, speed: float) -> float:
        """Share of the rotating parts' extra convection in force at a speed [1/min]: turbulent, with n^0.7."""
        return float((abs(speed) / self.top_speed) ** 0.7)

    def power(self, temperatures: FloatArray, index: Mapping[str, int], drive: Drive, chilling: float) -> FloatArray:
        """Return the heat put into each node.

        Parameters
        ----------
        temperatures : ndarray of shape (n_nodes,)
            [degC]
        index : mapping of str to int
            Of each node, by name.
        drive : Drive
        chilling : float
            Share of the time that the chiller runs.

        Returns
        -------
        ndarray of shape (n_nodes,)
            [W]
        """
        power = np.zeros(len(temperatures))
        if not drive.powered:
            return power
        ratio = abs(drive.speed) / self.top_speed
        loss = 0.0
        if ratio > 0:
            tightening = float(temperatures[index["shaft"]] - temperatures[index["housing"]])
            for name, bearing in (("front_bearing", self.front), ("rear_bearing", self.rear)):
                power[index[name]] = bearing.heat(ratio, float(temperatures[index[name]]), tightening)
            power[index["motor"]] = self.motor_on + self.motor_top * ratio**2
            loss = float(power.sum())
        for axis, feed in zip("xyz", drive.feed, strict=True):
            power[index[f"{axis}_nut"]] = self.drive_nut * abs(feed) / 1000.0
            power[index[f"{axis}_bearing"]] = self.drive_bearing * abs(feed) / 1000.0
        power[index["y_bearing"]] += self.hold
        power[index["column_rear_right"]] = self.cabinet + self.cabinet_share * loss
        power[index["bed_rear"]] = self.hydraulics
        if drive.cooled:
            power[index["coolant"]] = self.pump - self.chiller * chilling
        return power

    def until_switch(self, chilling: bool, before: float, after: float) -> float:
        """Return the share of a step before the thermostat switches; 1 if it does not.

        Parameters
        ----------
        chilling : bool
            The chiller runs at the start of the step.
        before, after : float
            Coolant minus bed at the start of the step, and at its end if nothing switches [K].
        """
        limit = self.setpoint + (-self.half_band if chilling else self.half_band)
        if (after > limit) == chilling:
            return 1.0
        return min(max((limit - before) / (after - before), 0.0), 1.0) if after != before else 0.0
