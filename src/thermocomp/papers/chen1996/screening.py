"""Chen, Yuan, Ni 1996, sections 3.1 and 3.2: first screening of all temperatures of the machine by correlation.

Table 2 and Eq. 5 name variables of Table 1. So the other parts use the temperatures of Table 1, whichever are left
here; a regression on those left is compared with the paper's on the new tests.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from thermocomp.models.second_order import SecondOrderRegression
from thermocomp.models.selection.collinearity import Screening, screen
from thermocomp.papers import common
from thermocomp.papers.chen1996.drift import LearnedDrift
from thermocomp.papers.chen1996.setup import COLUMN, DRIFTS, SENSORS, TEMPERATURES, exhibits, recordings
from thermocomp.papers.claims import Claims, Facts
from thermocomp.papers.study import StudyTable

#: printed: number of temperatures left by the first screening (C-11)
LEFT = 9
NONE = "no compensation"


@dataclass(frozen=True, eq=False)
class Screened:
    """First screening of the temperatures of the 810 rows, and models on those left.

    Parameters
    ----------
    names : sequence of str
        All temperatures of the machine; those of Table 1 by their symbols.
    average : sequence of float
        Correlation of T5, a mean of four others and no candidate, with x, y and z.
    errors : mapping of str to mapping of str to float
        RMS over both new tests by drift, then by the temperatures of the regression [um].
    """

    names: Sequence[str]
    found: Screening
    average: Sequence[float]
    errors: Mapping[str, Mapping[str, float]]

    @property
    def kept(self) -> list[str]:
        """Temperatures left, in the order in which they were kept."""
        return [self.names[j] for j in self.found.kept]

    @property
    def returned(self) -> list[str]:
        """Those of the places of Table 1 that are left."""
        return [t for t in SENSORS if t in self.kept]

    def likeness(self, one: str, other: str) -> float:
        """Return the correlation of two temperatures."""
        return float(self.found.likeness[self.names.index(one), self.names.index(other)])


def learn(seed: int, new: int, learned: LearnedDrift) -> Screened:
    """Screen the temperatures of the five tests (`seed`), and run the new tests (`new`)."""
    tests = recordings("chen1996", seed)
    names = [c.name for c in tests[0].temperatures if c.name != "T5"]
    samples = common.stacked(tests, tuple(DRIFTS), names)
    found = screen(samples.change(), samples.deviations, LEFT)
    kept = [names[j] for j in found.kept]
    few = samples.only(kept)
    ours = {t: common.fit_and_freeze(SecondOrderRegression(), few, [t])[t] for t in DRIFTS}
    others = {"Table 2": learned.models, "Table 1": learned.wide, "screening": ours}
    inputs = tuple(dict.fromkeys((*TEMPERATURES, *kept)))
    observed = common.stacked(recordings("chen1996-new", new), tuple(DRIFTS), inputs)
    errors = {
        t: {NONE: common.rms(common.take_measured(observed, t))}
        | {name: common.rms(common.residual(models[t], observed)) for name, models in others.items()}
        for t in DRIFTS
    }
    change = learned.samples.change()[:, TEMPERATURES.index("T5")]
    average = [float(np.corrcoef(change, y)[0, 1]) for y in learned.samples.deviations.T]
    return Screened(names, found, average, errors)


# -- claims ------------------------------------------------------------------------------------------------------------


claims = Claims[Screened](__name__)


@claims.facts
def _table_1(found: Screened) -> Facts:
    strongest = [found.names[j] for j in found.found.strongest[:LEFT]]
    missed = [t for t in SENSORS if t not in found.returned]
    near = {t: found.names[k] for t in missed if (k := found.found.nearest(found.names.index(t))) is not None}
    return {
        "alone": len({*SENSORS} & {*strongest}),
        "chance": LEFT * len(SENSORS) / len(found.names),
        "missed": [(t, other, found.likeness(t, other)) for t, other in near.items()],
        "column": min(found.likeness(a, b) for a, b in combinations(COLUMN, 2)),
        "holds": not missed,
    }


@claims.facts
def _strong(found: Screened) -> Facts:
    largest = {t: float(np.abs(found.found.relevance[found.names.index(t)]).max()) for t in SENSORS}
    largest["T5"] = max(map(abs, found.average))
    weakest = min(largest, key=lambda t: largest[t])
    return {"weakest": weakest, "least": largest[weakest], "most": max(largest.values())}


@claims.facts
def _used(found: Screened) -> Facts:
    return {"drifts": [(t, list(errors.values())) for t, errors in found.errors.items()]}


def numbers(found: Screened) -> dict[str, float]:
    """Return the key numbers, which the gallery page checks."""
    return exhibits.numbers("screening", found)


def tables(found: Screened) -> list[StudyTable]:
    """Return all temperatures in the order of the screening, with their correlations."""
    rank = {found.names[j]: k for k, j in enumerate(found.found.strongest, start=1)}
    rows = []
    for k, j in enumerate(found.found.order, start=1):
        name, near = found.names[j], found.found.nearest(j)
        alike = "" if near is None else f"{found.names[near]} {found.found.likeness[near, j]:.2f}"
        rows.append(
            (
                str(k) if k <= len(found.kept) else "",
                name,
                SENSORS.get(name, ""),
                found.found.relevance[j],
                rank[name],
                alike,
            )
        )
    return [exhibits.table("sensors", [*rows, ("", "T5", "mean of T6 to T9", found.average, "", "")])]
