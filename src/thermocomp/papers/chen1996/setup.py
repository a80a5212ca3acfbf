"""Chen, Yuan, Ni 1996: sensors, subgroups and printed numbers, and the recordings in the paper's names."""

from collections.abc import Sequence

from thermocomp.core.machine import Channel
from thermocomp.datasets.virtual import record
from thermocomp.papers.common import derived, renamed
from thermocomp.recording.recording import Recording
from thermocomp.recording.samples import Samples, stack

#: Table 1 (C-11): symbol -> channel of the virtual machine
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

#: C-12: differences that are variables of their own
DIFFERENCES = (("T6", "T7"), ("T8", "T9"), ("T6", "T8"), ("T7", "T9"))
#: Table 2 (C-13)
SUBGROUPS = {
    "x": ("T1", "T2", "T3", "T6-T7", "T8-T9"),
    "y": ("T1", "T2", "T3", "T4", "T5", "T6-T8", "T7-T9"),
    "z": ("T1", "T2", "T3", "T6-T8", "T7-T9"),
}
#: of the slope of Y (C-23; no row of Table 2 is this set, E-C7)
SLOPE_VARIABLES = ("T1", "T3", "T4", "T6-T8", "T7-T9")

#: R2 from which a model counts as fitting closely: the smaller of the two the paper prints (.988, .973; C-19, E-C2)
CLOSELY = 0.973
#: ratio of two errors up to which methods count as equally good: the paper calls 8.9 and 6.5 um very close (C-31)
COMPETITIVE = 1.5
#: part of the RMS that must vanish where the paper sees a good prediction; its headline asks for nine tenths (C-35)
WELL = 0.8
#: the headline: accuracy improved by a factor of ten (C-35)
TENFOLD = 10.0


def recordings(experiment: str, seed: int) -> list[Recording]:
    """Run one of Chen's experiments; T1 to T9, x, y, z where they were recorded, speed, then all other channels.

    Parameters
    ----------
    experiment : str
    seed : int

    Returns
    -------
    list of Recording
    """
    found = []
    for recording in record(experiment, seed=seed):
        given = {c.name for c in recording.channels}
        known = {new: old for new, old in {**SENSORS, **DRIFTS, **SPEED}.items() if old in given}
        rest = {c.name: c.name for c in recording.channels if c.name not in known.values()}
        named = renamed(recording, {old: new for new, old in known.items()} | rest)
        mean = dict.fromkeys(COLUMN, 1 / len(COLUMN))
        found.append(derived(named, Channel("T5", "temperature", "degC", "column, average"), mean))
    return found


def drift_samples(tests: Sequence[Recording]) -> Samples:
    """Stack tests: nine temperatures and the spindle speed, targets x, y and z."""
    return stack(tests, tuple(DRIFTS), (*TEMPERATURES, *SPEED))
