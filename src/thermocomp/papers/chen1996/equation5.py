"""Chen, Yuan, Ni 1996, Fig. 2: recovery of the law of the drift in x from the 810 rows. Eq. 5 is the known law.

The virtual machine hardly moves in x. Therefore Eq. 5 is imposed on the temperatures of its 810 rows, as they are read,
with noise of the printed standard error: once as printed, and once multiplied so that the printed R2 follows.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from thermocomp.models.second_order import SecondOrderRegression
from thermocomp.papers import common
from thermocomp.papers.chen1996.drift import EQ5, R2_X, SEE_X, LearnedDrift
from thermocomp.papers.chen1996.law import MOST, Recovery, evaluate
from thermocomp.papers.chen1996.setup import DIFFERENCES, SUBGROUPS, TEMPERATURES, exhibits
from thermocomp.papers.claims import Claims, Facts
from thermocomp.papers.study import FloatArray, StudyTable
from thermocomp.recordings.samples import Samples

#: number of draws of the noise
DRAWS = 20
#: RMS of a drift in x of 810 rows with seven terms, R2 (about zero) and standard error as printed [um]
IMPLIED = SEE_X * math.sqrt((810 - len(EQ5)) / 810 / (1 - R2_X))


@dataclass(frozen=True)
class Imposed(Recovery):
    """Recovery of Eq. 5, multiplied by a factor.

    Parameters
    ----------
    name : str
        Which multiple of Eq. 5.
    drift : float
        RMS of the drift, without noise [um].
    r2, standard_error : sequence of float
        As printed by the regression, for each draw; the latter in um.
    """

    name: str
    factor: float
    drift: float
    r2: Sequence[float]
    standard_error: Sequence[float]

    @property
    def terms(self) -> float:
        """Mean number of terms of Eq. 5 that are found."""
        return float(np.mean([len(f.keys() & self.law.keys()) for f in self.found]))

    @property
    def all_terms(self) -> float:
        """Share of the draws in which all seven terms are found, whatever else is."""
        return 1 - self.missing

    @property
    def mean_r2(self) -> float:
        """R2 about zero, mean over the draws."""
        return float(np.mean(self.r2))

    @property
    def mean_error(self) -> float:
        """Standard error of estimate, mean over the draws [um]."""
        return float(np.mean(self.standard_error))


@dataclass(frozen=True, eq=False)
class Equation5:
    """Results of recovering Eq. 5.

    Parameters
    ----------
    moves : ndarray of shape (n_rows,)
        Drift in x of the virtual machine [um].
    standard_error : float
        Standard error of the regression of that drift [um].
    """

    printed: Imposed
    multiplied: Imposed
    moves: FloatArray
    standard_error: float


def seek(learned: LearnedDrift, seed: int) -> Equation5:
    """Impose Eq. 5 on the temperatures of the 810 rows and recover it, as printed and multiplied."""
    heat = learned.samples.only(TEMPERATURES)
    once = common.rms(evaluate(EQ5, heat.change()))
    factor = math.sqrt(IMPLIED**2 - SEE_X**2) / once
    return Equation5(
        printed=impose("as printed", 1.0, heat, seed),
        multiplied=impose("multiplied", factor, heat, seed),
        moves=common.take_measured(learned.samples, "x"),
        standard_error=learned.regressions["x"].standard_error_,
    )


def impose(name: str, factor: float, heat: Samples, seed: int) -> Imposed:
    """Return how often a multiple of Eq. 5 is recovered over `DRAWS` draws of the noise."""
    rng, change = np.random.default_rng(seed), heat.frame()
    true = factor * evaluate(EQ5, change.to_numpy())
    fits = [
        SecondOrderRegression(differences=DIFFERENCES, subset=SUBGROUPS["x"]).fit(
            change, true + SEE_X * rng.standard_normal(len(true))
        )
        for _ in range(DRAWS)
    ]
    return Imposed(
        law={term: factor * c for term, c in EQ5.items()},
        found=[dict(zip(r.terms_, r.coef_.tolist(), strict=True)) for r in fits],
        name=name,
        factor=factor,
        drift=common.rms(true),
        r2=[r.r_squared_ for r in fits],
        standard_error=[r.standard_error_ for r in fits],
    )


# -- claims ------------------------------------------------------------------------------------------------------------


claims = Claims[Equation5](__name__)


@claims.facts
def _consistent(found: Equation5) -> Facts:
    return {"holds": round(found.multiplied.mean_r2, 3) == R2_X}


@claims.facts
def _recovered(found: Equation5) -> Facts:
    return {"holds": found.multiplied.whole >= MOST}


@claims.facts
def _moves(found: Equation5) -> Facts:
    width = float(np.ptp(found.moves))
    return {"range": width, "rms": common.rms(found.moves), "smaller": width < SEE_X}


def numbers(found: Equation5) -> dict[str, float]:
    """Return the key numbers, which the gallery page checks."""
    return exhibits.numbers("equation5", found)


def tables(found: Equation5) -> list[StudyTable]:
    """Return the frequency of recovery of Eq. 5."""
    return [exhibits.table("equation5", [found.printed, found.multiplied], draws=DRAWS)]
