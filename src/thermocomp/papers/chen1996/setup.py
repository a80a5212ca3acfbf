"""Chen, Yuan, Ni 1996: sensors, subgroups and printed numbers; recordings with the names of the paper."""

from collections.abc import Sequence

import numpy as np

from thermocomp.core.machine import Channel
from thermocomp.papers.common import add_derived_channel, rename_channels, stacked
from thermocomp.papers.exhibits import Exhibits
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.virtual.datasets import record

#: Table 1 (C-11): symbol -> channel of the virtual machine; the indices 4 and 9 are misread in the scan (E-C8)
SENSORS = {
    "T1": "t_air_C",
    "T2": "t_housing_C",
    "T3": "t_y_nut_C",
    "T4": "t_y_bearing_C",
    "T6": "t_column_front_right_C",
    "T7": "t_column_front_left_C",
    "T8": "t_column_rear_right_C",
    "T9": "t_column_rear_left_C",
}
#: T5 is the average column temperature
COLUMN = ("T6", "T7", "T8", "T9")
TEMPERATURES = tuple(f"T{k}" for k in range(1, 10))
DRIFTS = {"x": "x1_um", "y": "y1_um", "z": "z_um"}
SPEED = {"speed": "spindle_rpm"}

#: C-12: differences used as separate variables
DIFFERENCES = (("T6", "T7"), ("T8", "T9"), ("T6", "T8"), ("T7", "T9"))
#: Table 2 (C-13)
SUBGROUPS = {
    "x": ("T1", "T2", "T3", "T6-T7", "T8-T9"),
    "y": ("T1", "T2", "T3", "T4", "T5", "T6-T8", "T7-T9"),
    "z": ("T1", "T2", "T3", "T6-T8", "T7-T9"),
}
#: variables for the slope of Y (C-23; not a row of Table 2, E-C7)
SLOPE_VARIABLES = ("T1", "T3", "T4", "T6-T8", "T7-T9")
#: Eq. 6 (C-22): the cold profile of Y, um for y in mm (E-C5)
EQ6 = np.polynomial.Polynomial(1e3 * np.array([2.424e-4, 3.096e-4, -3.571e-6, 1.474e-8, -2.662e-11, 1.738e-14]))
#: Eq. 8 (C-24; T7-T9 according to E-C4): slope of Y, um/m per degC (E-C6)
EQ8 = {"T3": 0.465, "T4": 2.705, "(T6-T8)": 3.675, "(T7-T9)": -5.589}

#: minimum R2 for a close fit: the smaller of the two values printed in the paper (.988, .973; C-19, E-C2)
CLOSELY = 0.973
#: maximum ratio of the errors of equally good methods: the paper calls 8.9 and 6.5 um very close (C-31)
COMPETITIVE = 1.5
#: minimum reduction of the RMS for a good prediction; the headline requires nine tenths (C-35)
WELL = 0.8
#: headline: accuracy improved by a factor of ten; printed: lateral errors 92.4 -> 7.2 um, depths 196 -> 8 um (C-35)
TENFOLD, LATERAL, DEPTH = 10.0, 92.4 / 7.2, 196.0 / 8.0


exhibits = Exhibits(__name__)


def recordings(experiment: str, seed: int, sensor_noise: float | None = None) -> list[Recording]:
    """Run one of Chen's experiments; channels: T1 to T9, x, y, z if recorded, speed, then all others.

    Parameters
    ----------
    sensor_noise : float, optional
        Noise of the temperatures [degC]. Default: as defined for each sensor.
    """
    found = []
    for recording in record(experiment, seed=seed, sensor_noise=sensor_noise):
        given = {c.name for c in recording.channels}
        known = {new: old for new, old in {**SENSORS, **DRIFTS, **SPEED}.items() if old in given}
        rest = {c.name: c.name for c in recording.channels if c.name not in known.values()}
        found.append(with_column(rename_channels(recording, {old: new for new, old in known.items()} | rest)))
    return found


def with_column(recording: Recording) -> Recording:
    """Return the recording with T5, the average column temperature, as an additional channel (C-11)."""
    mean = dict.fromkeys(COLUMN, 1 / len(COLUMN))
    return add_derived_channel(recording, Channel("T5", "temperature", "degC", "column, average"), mean)


def with_differences(recording: Recording) -> Recording:
    """Return the recording with additional channels: the temperature differences for the slope (C-23)."""
    for plus, minus in DIFFERENCES:
        if f"{plus}-{minus}" in SLOPE_VARIABLES:
            channel = Channel(f"{plus}-{minus}", "temperature", "degC")
            recording = add_derived_channel(recording, channel, {plus: 1.0, minus: -1.0})
    return recording


def drift_samples(tests: Sequence[Recording]) -> Samples:
    """Stack tests: nine temperatures and the spindle speed, targets x, y and z."""
    return stacked(tests, tuple(DRIFTS), (*TEMPERATURES, *SPEED))
