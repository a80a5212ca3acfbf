"""Chen, Yuan, Ni 1996, section 3.3: recovery of the slope law from 51 profiles. Eq. 6 and 8 are the known law.

The slopes of the virtual machine follow no known law of the temperatures. Therefore only its temperatures are used, and
its profiles are replaced by those of a machine that obeys Eq. 6 and 8; noise is added to all readings. The recovered
law can thus be compared with the known one (C-23).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from thermocomp.core.machine import Channel
from thermocomp.core.polynomial import Polynomial
from thermocomp.models.mlp import SigmoidNet
from thermocomp.models.second_order import SecondOrderRegression
from thermocomp.papers.chen1996 import setup
from thermocomp.papers.chen1996.setup import (
    EQ6,
    EQ8,
    SLOPE_VARIABLES,
    TEMPERATURES,
    exhibits,
    recordings,
    with_differences,
)
from thermocomp.papers.claims import Claims, Facts
from thermocomp.papers.common import rms
from thermocomp.papers.study import FloatArray, StudyTable
from thermocomp.recordings.cycles import make_single_cycle as whole_test
from thermocomp.recordings.profiles import Profiles
from thermocomp.recordings.recording import Recording
from thermocomp.volumetric.models.position import PositionFit, PositionOptions, fit_position

#: noise of one laser run at a position [um], and of one temperature reading [degC]
LASER, SENSOR = 0.3, 0.05
#: minimum share of draws with the complete law for it to count as recovered
MOST = 0.95
#: number of days with different weather, and of noise draws over all of them: for `OURS`, and for each other design
DAYS, DRAWS, FEWER = 5, 200, 50
#: number of hidden nodes of the 5-8-1 net (C-27)
HIDDEN = 8
#: measuring positions of the laser [mm]
POSITIONS = np.arange(0.0, 551.0, 50.0)


@dataclass(frozen=True)
class Design:
    """Measurement of 51 profiles, and the reference of each quantity.

    Parameters
    ----------
    experiment : str
        Experiment that supplies the temperatures.
    runs : int
        Number of laser runs, whose mean is a profile; the temperatures are means over the same runs.
    centred : bool
        Whether temperatures and slopes are relative to the mean of all states of their test; otherwise to the first
        state, as in Chen's work.
    laser, sensor : float
        See `LASER` and `SENSOR`.
    hierarchy : bool
        Whether squares and products require their factors as terms; not so for Chen (C-21).
    """

    name: str
    experiment: str = "chen1996-law"
    runs: int = 5
    centred: bool = True
    laser: float = LASER
    sensor: float = SENSOR
    hierarchy: bool = False

    @property
    def method(self) -> SecondOrderRegression:
        """Chen's second-order regression with the variables of the slope."""
        return SecondOrderRegression(differences=setup.DIFFERENCES, subset=SLOPE_VARIABLES, hierarchy=self.hierarchy)

    def reference(self, n_states: int) -> list[int]:
        """Return the indices of the thermal states of a test whose mean is the reference."""
        return list(range(n_states)) if self.centred else [0]


#: the design that recovers the law
OURS = Design("three tests, five runs, relative to the mean state")
#: the measurement of the paper, improvements of it, and degradations
DESIGNS = (
    Design("one warm-up, one run, relative to the cold state", "chen1996-slope", 1, centred=False),
    Design("three tests, five runs, relative to the cold state", centred=False),
    Design("relative to the cold state, products only of terms already in the model", centred=False, hierarchy=True),
    OURS,
    Design("relative to the mean state, four times the laser noise", laser=4 * LASER),
    Design("relative to the mean state, four times the sensor noise", sensor=4 * SENSOR),
)


class Measured(NamedTuple):
    """Measured data of one test.

    Parameters
    ----------
    temperatures : ndarray of shape (n_profiles, 9)
        T1 to T9 [degC].
    errors : ndarray of shape (n_profiles, 12)
        Errors of Y at `POSITIONS` [um].
    """

    temperatures: FloatArray
    errors: FloatArray

    def counted(self, design: Design) -> tuple[FloatArray, FloatArray]:
        """Return changes of temperature and slopes k1 [um/m], relative to the reference of the design."""
        change, thermal = (v - v[design.reference(len(v))].mean(axis=0) for v in self)
        return change, 1e3 * (thermal @ POSITIONS) / (POSITIONS @ POSITIONS)

    def profiles(self, name: str) -> Profiles:
        """Return the data as profiles of EYY, one hour apart, with the temperature differences for the slope."""
        n = len(self.errors)
        channels = tuple(Channel(t, "temperature", "degC") for t in TEMPERATURES)
        table = pd.DataFrame(self.temperatures, columns=list(TEMPERATURES))
        states = with_differences(
            Recording(
                name=name, time=np.arange(0.0, 3600.0 * n, 3600.0), table=table, channels=channels, cycles=whole_test(n)
            )
        )
        points = np.stack([0 * POSITIONS, POSITIONS, 0 * POSITIONS], axis=1)
        return Profiles(target="EYY", unit="um", axis="Y", points=points, values=self.errors, states=states)


@dataclass(frozen=True, eq=False)
class Recovery:
    """Recovery of a known law over many draws of the noise.

    Parameters
    ----------
    law : mapping of str to float
        True coefficients by term name.
    found : sequence of mapping of str to float
        Coefficients that were found, one mapping per draw, in the same units.
    """

    law: Mapping[str, float]
    found: Sequence[Mapping[str, float]]

    @property
    def whole(self) -> float:
        """Share of the noise draws in which exactly the terms of the law are selected."""
        return float(np.mean([f.keys() == self.law.keys() for f in self.found]))

    @property
    def missing(self) -> float:
        """Share of the noise draws in which a term of the law is not selected."""
        return float(np.mean([bool(self.law.keys() - f.keys()) for f in self.found]))

    @property
    def wrong(self) -> float:
        """Share of the noise draws in which a term is selected that is not in the law."""
        return float(np.mean([bool(f.keys() - self.law.keys()) for f in self.found]))

    @property
    def coefficients(self) -> FloatArray:
        """Coefficients in the draws with exactly the terms of the law, (n_whole, n_terms); else one row of nan."""
        rows = [[f[t] for t in self.law] for f in self.found if f.keys() == self.law.keys()]
        return np.array(rows or [[np.nan] * len(self.law)])


def temperatures(experiment: str, seed: int) -> list[FloatArray]:
    """Return T1 to T9 of each test, without noise, (n_rows, 9) [degC]."""
    return [test.values([test.channel(t) for t in TEMPERATURES]) for test in recordings(experiment, seed, 0.0)]


def plant(day: Sequence[FloatArray], design: Design, rng: np.random.Generator) -> list[Measured]:
    """Return simulated measurements of profiles that obey Eq. 6 and 8.

    Parameters
    ----------
    day : sequence of ndarray of shape (n_runs, 9)
        From `temperatures`, one row per laser run; the first is the cold machine.
    """
    made = []
    for true in day:
        errors = EQ6(POSITIONS) + 1e-3 * np.outer(evaluate(EQ8, true - true[0]), POSITIONS)
        errors = errors + design.laser * rng.standard_normal(errors.shape)
        read = true + design.sensor * rng.standard_normal(true.shape)
        n = len(true) // design.runs
        means = (v[: n * design.runs].reshape(n, design.runs, -1).mean(axis=1) for v in (read, errors))
        made.append(Measured(*means))
    return made


def evaluate(law: Mapping[str, float], change: FloatArray) -> FloatArray:
    """Return the value of a law such as Eq. 5 [um] or Eq. 8 [um/m].

    Parameters
    ----------
    law : mapping of str to float
        Coefficients by term name: products of temperatures and differences, such as ``T2*(T6-T7)``.
    change : ndarray of shape (n, 9)
        Changes of T1 to T9 [degC].
    """
    column = dict(zip(TEMPERATURES, change.T, strict=True))
    total = np.zeros(len(change))
    for term, factor in law.items():
        product = np.full(len(change), factor)
        for variable in term.split("*"):
            plus, _, minus = variable.strip("()").partition("-")
            product *= column[plus] - (column[minus] if minus else 0.0)
        total += product
    return total


def recover(design: Design, days: Sequence[Sequence[FloatArray]], n_draws: int, seed: int) -> Recovery:
    """Return how often the known law is recovered over many draws of the noise."""
    rng = np.random.default_rng(seed)
    found = []
    for draw in range(n_draws):
        measured = plant(days[draw % len(days)], design, rng)
        change, k1 = (np.concatenate(v) for v in zip(*(m.counted(design) for m in measured), strict=True))
        regression: SecondOrderRegression = design.method.fit(pd.DataFrame(change, columns=list(TEMPERATURES)), k1)
        found.append(dict(zip(regression.terms_, regression.coef_.tolist(), strict=True)))
    return Recovery(EQ8, found)


@dataclass(frozen=True, eq=False)
class Law:
    """Results of recovering the known (synthetic) law.

    Parameters
    ----------
    fit : PositionFit
        Fit of the first draw of `OURS`.
    net : SigmoidNet
        5-8-1 net, trained on the same profiles, relative to the cold state.
    net_r2 : float
        R2 about zero, in-sample (E-C10).
    idle : float
        Largest change of the net's slope over the range of T1, which is not in the law [um/m].
    elsewhere : mapping of str to float
        For a test in which all temperatures rise together: RMS of the slope ("law"), and of the residuals of regression
        ("MRA") and net ("net") [um/m].
    """

    recoveries: Mapping[Design, Recovery]
    fit: PositionFit
    net: SigmoidNet
    net_r2: float
    idle: float
    elsewhere: Mapping[str, float]


def seek(seed: int) -> Law:
    """Simulate measurements that obey the law and recover it, for all designs."""
    days = {e: [temperatures(e, seed + k) for k in range(DAYS)] for e in {d.experiment for d in DESIGNS}}
    recoveries = {d: recover(d, days[d.experiment], DRAWS if d is OURS else FEWER, seed) for d in DESIGNS}
    # the first draw again, whatever its outcome
    first = plant(days[OURS.experiment][0], OURS, np.random.default_rng(seed))
    profiles = [m.profiles(f"test {k}") for k, m in enumerate(first, start=1)]
    options = PositionOptions(order=EQ6.degree(), inputs=SLOPE_VARIABLES, method=SigmoidNet(hidden=HIDDEN))
    learned = fit_position(profiles, options)
    options = replace(options, inputs=TEMPERATURES, method=OURS.method, reference=OURS.reference(len(profiles[0])))
    fit = fit_position(profiles, options)

    net: Any = learned.trained[0].estimator
    k1, change = learned.samples.deviations[:, 0], learned.samples.frame()
    ends = [net.predict(change.assign(T1=end)) for end in (change["T1"].min(), change["T1"].max())]
    (true,) = days["chen1996-slope"][0]
    other = Measured(true - true[0], np.zeros((len(true), len(POSITIONS)))).profiles("other").states.table
    planted = evaluate(EQ8, other[list(TEMPERATURES)].to_numpy())
    missed = {
        "law": planted,
        "MRA": planted - fit.trained[0].estimator.predict(other[list(TEMPERATURES)]),
        "net": planted - net.predict(other[list(SLOPE_VARIABLES)]),
    }
    return Law(
        recoveries=recoveries,
        fit=fit,
        net=net,
        net_r2=r2_about_zero(k1, net.predict(change)),
        idle=float(np.abs(ends[1] - ends[0]).max()),
        elsewhere={name: rms(left) for name, left in missed.items()},
    )


def r2_about_zero(measured: FloatArray, predicted: FloatArray) -> float:
    """Return R2 about zero, as for a regression without a constant (E-C10)."""
    return float(1 - np.sum((measured - predicted) ** 2) / np.sum(measured**2))


# -- claims ------------------------------------------------------------------------------------------------------------


claims = Claims[Law](__name__)


@claims.facts
def _whole(found: Law) -> Facts:
    return {"ours": found.recoveries[OURS], "papers": found.recoveries[DESIGNS[0]], "how": OURS.name}


@claims.facts
def _otherwise(found: Law) -> Facts:
    return {"others": [(d.name, r.whole) for d, r in found.recoveries.items() if d != OURS]}


@claims.facts
def _within(found: Law) -> Facts:
    errors = np.array([found.fit.coefficient_errors[0].get(t, np.nan) for t in EQ8])
    off = np.abs(found.recoveries[OURS].coefficients - np.array(list(EQ8.values()))) / errors
    return {"two": np.mean(off < 2), "three": np.mean(off < 3)}


def numbers(found: Law) -> dict[str, float]:
    """Return the key numbers, which the gallery page checks."""
    ours, paper, cold = (found.recoveries[d] for d in (OURS, DESIGNS[0], DESIGNS[1]))
    return exhibits.numbers("law", found, ours=ours, paper=paper, cold=cold)


def tables(found: Law) -> list[StudyTable]:
    """Return the frequency of recovery of the law, and its coefficients."""
    got, errors = found.fit.model.slopes[0], found.fit.coefficient_errors[0]
    first = got.coefficients_by_name() if isinstance(got, Polynomial) else {}
    drawn = found.recoveries[OURS].coefficients
    coefficients = [
        (t, true, *(f"{v[t]:.3f}" if t in v else "" for v in (first, errors)), mean, spread)
        for (t, true), mean, spread in zip(EQ8.items(), drawn.mean(axis=0), drawn.std(axis=0), strict=True)
    ]
    return [exhibits.table("rates", found.recoveries.items()), exhibits.table("law", coefficients)]
