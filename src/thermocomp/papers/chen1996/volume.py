"""Chen, Yuan, Ni 1996, section 2: components of the whole machine, learned from lasers, levels and probes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from joblib import Parallel, delayed

from thermocomp.core.components import BY_CODE
from thermocomp.core.machine import Axis, Machine, Source
from thermocomp.core.structure import Structure
from thermocomp.papers.common import stacked, trained
from thermocomp.recordings.cycles import find_cycles
from thermocomp.recordings.profiles import Profiles
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.tilts import with_tilts
from thermocomp.virtual import datasets as virtual
from thermocomp.virtual.axes import AXES, STATIONS, TEST_BAR, TEST_POSITION, TRAVEL
from thermocomp.virtual.probes import COMPONENTS, PROBE_DISTANCE
from thermocomp.volumetric.models.position import PositionFit, PositionOptions, fit_position

STRUCTURE = "w X' b Z Y (C1) t"
METHOD = "dynamic"
#: a round of laser measurements takes 20 min: number of rows per round
ROUND = 4
#: rounds before any movement, which define the cold profiles
COLD = (0, 1)


@dataclass(frozen=True, eq=False)
class LearnedVolume:
    """A measured machine and the fits of its components.

    Parameters
    ----------
    machine : Machine
        18 axis components as position models, three squareness errors, five spindle drifts. The drifts include the
        shifts of the axes' references, as the probes measure the sum.
    fits : mapping of str to PositionFit
        Fits by component code.
    flat : PositionFit
        EYX as a function of X only (C-06).
    """

    machine: Machine
    fits: Mapping[str, PositionFit]
    flat: PositionFit


def learn(seed: int) -> LearnedVolume:
    """Measure the machine in experiment ``volumetric`` and learn its components."""
    tests = virtual.record("volumetric", seed=seed)
    inputs = [c.name for c in tests[0].temperatures] + ["spindle_rpm"]
    rounds = [every(test, ROUND) for test in tests]
    found: Sequence[PositionFit] = Parallel(n_jobs=-1, prefer="threads")(
        delayed(_component)(code, rounds, inputs, "XZ" if code == "EYX" else None) for code in (*COMPONENTS, "EYX flat")
    )
    fits = dict(zip(COMPONENTS, found, strict=False))
    sources: dict[str, Source] = {code: fit.model for code, fit in fits.items()}
    for code in ("C0Y", "B0Z", "A0Z"):
        sources[code] = float(np.mean([test.table[f"{code}_urad"].iloc[list(COLD)].mean() for test in rounds]))
    return LearnedVolume(_machine(sources | _spindle(tests, inputs)), fits, found[-1])


def every(test: Recording, step: int) -> Recording:
    """Return every `step`-th row of a recording."""
    time, table = test.time[::step], test.table.iloc[::step].reset_index(drop=True)
    return replace(test, time=time, table=table, cycles=find_cycles(time, table["spindle_rpm"].to_numpy()))


def _component(code: str, rounds: Sequence[Recording], inputs: Sequence[str], coordinates: str | None) -> PositionFit:
    """Fit a component of an axis with the number of powers that its own profiles require."""
    code, _, flat = code.partition(" ")
    options = PositionOptions(
        method=METHOD,
        inputs=inputs,
        coordinates=coordinates,
        reference=COLD,
        rezero=False,  # the cold state differs from morning to morning
        reference_position=float(TEST_POSITION[code[2].lower()]),
    )
    profiles = [_profiles(code, test, flat=bool(flat)) for test in rounds]
    fit = fit_position(profiles, options)
    return fit if fit.enough == options.slopes else fit_position(profiles, replace(options, slopes=fit.enough))


def _profiles(code: str, test: Recording, *, flat: bool) -> Profiles:
    """Return the profiles of a component; for EYX also with Z at both ends of its travel."""
    axis, unit = code[2], BY_CODE[code].unit
    stations = STATIONS[axis.lower()]
    lines: list[tuple[str, dict[str, float]]] = (
        [("", {})] if code != "EYX" or flat else [("_z0", {"z": 0.0}), ("", {}), ("_z600", {"z": 600.0})]
    )
    points, values = [], []
    for suffix, aside in lines:
        reading = test.table[[f"{code}{suffix}_{p}_{unit}" for p in stations]].to_numpy(dtype=np.float64)
        if aside:  # X with Z elsewhere: its roll has a lever
            roll = test.table[[f"EAX_{p}_urad" for p in stations]].to_numpy(dtype=np.float64)
            reading = reading + 1e-3 * (aside["z"] - TEST_POSITION["z"]) * roll
        values.append(reading)
        points += [[{**TEST_POSITION, **aside, axis.lower(): p}[a] for a in AXES] for p in stations]
    return Profiles(
        target=code,
        unit=unit,
        axis=axis,
        points=np.array(points, dtype=np.float64),
        values=np.hstack(values),
        states=test,
    )


def _spindle(tests: Sequence[Recording], inputs: Sequence[str]) -> dict[str, Source]:
    """Learn the drifts at the test position from the probe nest: sum of spindle, axes and their references."""
    tilts = (f"A0C=y1_um:y2_um:{PROBE_DISTANCE:g}m", f"B0C=x1_um:x2_um:{PROBE_DISTANCE:g}m")
    tests, _ = with_tilts(tests, tilts)
    channels = {"X0C": "x1_um", "Y0C": "y1_um", "Z0C": "z_um", "A0C": "A0C", "B0C": "B0C"}
    samples = stacked(tests, list(channels.values()), inputs)
    return {code: trained(METHOD, samples, k) for k, code in enumerate(channels)}


def _machine(components: Mapping[str, Source]) -> Machine:
    test = (float(TEST_POSITION["x"]), float(TEST_POSITION["y"]), float(TEST_POSITION["z"]))
    axes = tuple(
        Axis(
            name=a.upper(),
            travel=(0.0, TRAVEL[a]),
            reference_position=TEST_POSITION[a],
            measured_at=test,
            measured_tool=TEST_BAR,
        )
        for a in AXES
    )
    return Machine("virtual", Structure.parse(STRUCTURE), axes, components, spindle_tool=TEST_BAR, tool=TEST_BAR)
