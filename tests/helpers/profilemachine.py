"""Profiles whose law is known, on temperatures made up or of the virtual machine."""

from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from thermocomp.core.machine import Channel
from thermocomp.papers.chen1996.setup import recordings
from thermocomp.recordings.cycles import Cycle
from thermocomp.recordings.profiles import Profiles
from thermocomp.recordings.readers.profiles import from_recording
from thermocomp.recordings.recording import Recording

FloatArray = NDArray[np.float64]

#: Eq. 6 of Chen 1996 (C-22), um for y in mm
EQ6 = np.polynomial.Polynomial(1e3 * np.array([2.424e-4, 3.096e-4, -3.571e-6, 1.474e-8, -2.662e-11, 1.738e-14]))
#: Eq. 8 with T7-T9 (C-24, E-C4), um/m per degC (E-C6)
LAW = {"T3": 0.465, "T4": 2.705, "(T6-T8)": 3.675, "(T7-T9)": -5.589}
CYCLE = 24


def states(n_cycles: int = 3, seed: int = 0) -> Recording:
    """Return thermal states a quarter of an hour apart: cycles of warming and cooling, two temperatures."""
    rng = np.random.default_rng(seed)
    n = n_cycles * CYCLE
    time = np.asarray(900.0 * np.arange(n), dtype=np.float64)
    t = np.arange(n) % CYCLE
    size = 1.0 + 0.3 * (np.arange(n) // CYCLE)
    warm = size * np.where(t < 12, 1 - np.exp(-t / 4), np.exp(-(t - 12) / 4))
    warm -= warm[0]
    table = pd.DataFrame({"t1_C": 20 + 8 * warm, "t2_C": 21 + 5 * warm**2 + np.cumsum(0.2 * rng.normal(size=n))})
    channels = tuple(Channel(str(c), "temperature", "degC") for c in table.columns)
    cycles = tuple(Cycle(f"day {k + 1}", k * CYCLE, (k + 1) * CYCLE) for k in range(n_cycles))
    return Recording("made", time, table, channels, cycles)


def along_y(positions: FloatArray) -> FloatArray:
    """Return points along Y at X = Z = 0."""
    return np.stack([0 * positions, positions, 0 * positions], axis=1)


def profiles(
    noise: float = 0.05, seed: int = 0, *, second: float = 0.0, offset: float = 0.0, n_cycles: int = 3
) -> Profiles:
    """Return profiles of EYY: Eq. 6 + offset t1 + (3 t1 + 2 t2) q + second t1 q^2, temperatures from the start."""
    made = states(n_cycles, seed)
    position = np.linspace(0.0, 550.0, 12)
    q = 1e-3 * position
    t1, t2 = (made.table - made.table.iloc[0]).to_numpy().T
    values = EQ6(position) + offset * t1[:, None] + np.outer(3 * t1 + 2 * t2, q) + np.outer(second * t1, q**2)
    values += noise * np.random.default_rng(1000 + seed).normal(size=values.shape)
    return Profiles("EYY", "um", "Y", along_y(position), values, made)


@cache
def day(seed: int) -> Profiles:
    """Return the 51 profiles of the virtual machine on one day, in Chen's names of the temperatures (C-23)."""
    (recording,) = recordings("chen1996-slope", seed)
    return from_recording(recording, "EYY")


def planted(seed: int, noise: float, draw: int) -> Profiles:
    """Return the same day with profiles by Eq. 6 and 8, and a laser's noise [um]."""
    found = day(seed)
    change = found.states.table - found.states.table.iloc[0]
    slope = sum((c * _term(change, name) for name, c in LAW.items()), np.zeros(len(found)))
    values = EQ6(found.position) + 1e-3 * np.outer(slope, found.position)
    return replace(found, values=values + noise * np.random.default_rng(draw).normal(size=values.shape))


def _term(change: pd.DataFrame, name: str) -> FloatArray:
    plus, _, minus = name.strip("()").partition("-")
    values = change[plus].to_numpy(dtype=np.float64)
    return np.asarray(values - change[minus].to_numpy(dtype=np.float64)) if minus else values
