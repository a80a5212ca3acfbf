"""Chen, Yuan, Ni 1996, section 2: components of the whole machine, learned from lasers, levels and probes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

from thermocomp.core.components import BY_CODE
from thermocomp.core.machine import Axis, Channel, Machine, Source
from thermocomp.core.structure import Structure
from thermocomp.models.mlp import SigmoidNet
from thermocomp.models.second_order import SecondOrderRegression
from thermocomp.papers.chen1996 import drift, law, setup
from thermocomp.papers.chen1996.setup import SENSORS, SLOPE_VARIABLES, SUBGROUPS, TEMPERATURES
from thermocomp.papers.chen1996.unseen import MRA, NET
from thermocomp.papers.common import PAPERS_SUPPORT, add_derived_channel, fit_and_freeze, stacked, trained
from thermocomp.recordings.cycles import find_cycles
from thermocomp.recordings.profiles import Profiles
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.tilts import with_tilts
from thermocomp.virtual import datasets as virtual
from thermocomp.virtual.axes import AXES, STATIONS, TEST_BAR, TEST_POSITION, TRAVEL
from thermocomp.virtual.probes import COMPONENTS, PROBE_DISTANCE
from thermocomp.volumetric.models.position import PositionFit, PositionOptions, fit_position, slope_samples

STRUCTURE = "w X' b Z Y (C1) t"
#: the paper's methods, and ours
DYNAMIC, AVERAGED = "dynamic", "averaged"
PAPERS, METHODS = (MRA, NET), (MRA, NET, DYNAMIC, AVERAGED)
#: a round of laser measurements takes 20 min: number of rows per round
ROUND = 4
#: rounds before any movement, which define the cold profiles
COLD = (0, 1)
#: number of training rows of the nets of the drifts (C-14)
PATTERNS = 810
#: drifts and tilts of the spindle: channel, and direction whose subset of Table 2 is used
SPINDLE = {"X0C": ("x1_um", "x"), "Y0C": ("y1_um", "y"), "Z0C": ("z_um", "z"), "A0C": ("A0C", "y"), "B0C": ("B0C", "x")}


@dataclass(frozen=True, eq=False)
class LearnedVolume:
    """A measured machine and the fits of its components.

    Parameters
    ----------
    machines : mapping of str to Machine
        By method: 18 axis components as position models, three squareness errors, five spindle drifts. The drifts
        include the shifts of the axes' references, as the probes measure the sum (C-01).
    fits : mapping of str to PositionFit
        Fits of `DYNAMIC` by component code.
    flat : PositionFit
        EYX as a function of X only (C-06).
    """

    machines: Mapping[str, Machine]
    fits: Mapping[str, PositionFit]
    flat: PositionFit


def learn(seed: int, methods: Sequence[str] = METHODS) -> LearnedVolume:
    """Measure the machine in experiment ``volumetric`` and learn its components by several methods (C-35)."""
    recorded = virtual.record("volumetric", seed=seed)
    inputs = [c.name for c in recorded[0].temperatures] + ["spindle_rpm"]
    tests = [with_sensors(test) for test in recorded]
    rounds = [every(test, ROUND) for test in tests]
    run = Parallel(n_jobs=-1, prefer="threads")
    found: Sequence[PositionFit] = run(
        delayed(_component)(code, rounds, inputs, "XZ" if code == "EYX" else None) for code in (*COMPONENTS, "EYX flat")
    )
    fits = dict(zip(COMPONENTS, found, strict=False))
    jobs = [(method, code) for method in methods if method != DYNAMIC for code in COMPONENTS]
    with threadpool_limits(1):  # else the threads of numpy's libraries get in the way of those here
        others: Sequence[PositionFit] = run(delayed(_by)(*job, rounds, inputs, fits[job[1]]) for job in jobs)
    by_job = dict(zip(jobs, others, strict=True)) | {(DYNAMIC, code): fit for code, fit in fits.items()}
    constants: dict[str, Source] = {
        code: float(np.mean([test.table[f"{code}_urad"].iloc[list(COLD)].mean() for test in rounds]))
        for code in ("C0Y", "B0Z", "A0Z")
    }
    return LearnedVolume(
        machines={
            method: _machine(
                {code: by_job[method, code].model for code in COMPONENTS} | constants | _spindle(method, tests, inputs)
            )
            for method in methods
        },
        fits=fits,
        flat=found[-1],
    )


def with_sensors(recording: Recording) -> Recording:
    """Return the recording with additional channels: temperatures of Table 1, and differences (C-11, C-23)."""
    for symbol, name in SENSORS.items():
        recording = add_derived_channel(recording, Channel(symbol, "temperature", "degC"), {name: 1.0})
    return setup.with_differences(setup.with_column(recording))


def every(test: Recording, step: int) -> Recording:
    """Return every `step`-th row of a recording."""
    time, table = test.time[::step], test.table.iloc[::step].reset_index(drop=True)
    return replace(test, time=time, table=table, cycles=find_cycles(time, table["spindle_rpm"].to_numpy()))


def _component(code: str, rounds: Sequence[Recording], inputs: Sequence[str], coordinates: str | None) -> PositionFit:
    """Fit a component of an axis with the number of powers that its own profiles require."""
    code, _, flat = code.partition(" ")
    options = _options(code, inputs, coordinates)
    profiles = [_profiles(code, test, flat=bool(flat)) for test in rounds]
    fit = fit_position(profiles, options)
    return fit if fit.enough == options.slopes else fit_position(profiles, replace(options, slopes=fit.enough))


def _options(code: str, inputs: Sequence[str], coordinates: str | None) -> PositionOptions:
    return PositionOptions(
        method=DYNAMIC,
        inputs=inputs,
        coordinates=coordinates,
        reference=COLD,
        rezero=False,  # the cold state differs from morning to morning
        reference_position=float(TEST_POSITION[code[2].lower()]),
    )


def _by(method: str, code: str, rounds: Sequence[Recording], inputs: Sequence[str], fit: PositionFit) -> PositionFit:
    """Fit a component by another method, with as many powers as `fit` has."""
    profiles = [_profiles(code, test, flat=False) for test in rounds]
    options = replace(_options(code, inputs, "XZ" if code == "EYX" else None), slopes=len(fit.model.slopes))
    if method not in PAPERS:
        return fit_position(profiles, replace(options, method=method))
    options = replace(options, support=PAPERS_SUPPORT)
    if method == NET:
        names = SLOPE_VARIABLES if code == "EYY" else screened(profiles, options)
        return fit_position(profiles, replace(options, method=SigmoidNet(hidden=law.HIDDEN), inputs=names))
    if code == "EYY":
        chens = SecondOrderRegression(differences=setup.DIFFERENCES, subset=SLOPE_VARIABLES)
        return fit_position(profiles, replace(options, method=chens, inputs=TEMPERATURES))
    return fit_position(profiles, replace(options, method=SecondOrderRegression(), inputs=screened(profiles, options)))


def screened(profiles: Sequence[Profiles], options: PositionOptions) -> tuple[str, ...]:
    """Return as many temperatures as in Table 1, those most strongly correlated with the slope k1 (C-11)."""
    samples, _ = slope_samples(profiles, options)
    change, k1 = samples.change(), samples.deviations[:, 0]
    strength = {
        c.name: abs(float(np.corrcoef(change[:, j], k1)[0, 1]))
        for j, c in enumerate(samples.inputs)
        if c.quantity == "temperature"
    }
    return tuple(sorted(strength, key=lambda name: -strength[name])[: len(TEMPERATURES)])


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


def _spindle(method: str, tests: Sequence[Recording], inputs: Sequence[str]) -> dict[str, Source]:
    """Learn the drifts at the test position from the probe nest: sum of spindle, axes and their references."""
    tilts = (f"A0C=y1_um:y2_um:{PROBE_DISTANCE:g}m", f"B0C=x1_um:x2_um:{PROBE_DISTANCE:g}m")
    tests, _ = with_tilts(tests, tilts)
    channels = [channel for channel, _ in SPINDLE.values()]
    samples = stacked(tests, channels, TEMPERATURES if method in PAPERS else inputs)
    if method == MRA:
        return {code: _regression(samples, *known) for code, known in SPINDLE.items()}
    if method == NET:
        net = SigmoidNet(hidden=drift.HIDDEN, max_patterns=PATTERNS)
        models = fit_and_freeze(net, samples, channels[:3]) | fit_and_freeze(net, samples, channels[3:])
        return {code: models[channel] for code, (channel, _) in SPINDLE.items()}
    return {code: trained(method, samples, k) for k, code in enumerate(SPINDLE)}


def _regression(samples: Samples, channel: str, direction: str) -> Source:
    chens = SecondOrderRegression(differences=setup.DIFFERENCES, subset=SUBGROUPS[direction])
    return fit_and_freeze(chens, samples, [channel])[channel]


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
