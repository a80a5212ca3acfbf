"""Chen, Yuan, Ni 1996, section 5: new observations, noise, and a cut-off sensor."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from thermocomp.core.model import ErrorModel
from thermocomp.models.numerics.leastsquares import effective_sample_size
from thermocomp.papers import common
from thermocomp.papers.chen1996 import setup
from thermocomp.papers.chen1996.drift import LearnedDrift
from thermocomp.papers.chen1996.setup import COMPETITIVE, DRIFTS, WELL, drift_samples, exhibits, recordings
from thermocomp.papers.claims import Claims, Facts
from thermocomp.papers.common import Errors, trained
from thermocomp.papers.study import Figure, FloatArray, StudyTable
from thermocomp.recordings.samples import Samples

#: level of the noise [degC] and number of draws (C-33, E-C9)
NOISE = 0.4
DRAWS = 20
#: tests of new observations (C-32)
TESTS = ("1250 1/min", "random speed")
NONE, MRA, NET, DYNAMIC = "no compensation", "MRA", "net", "dynamic (ours)"
#: if the RMS ratio of `dynamic` to the paper's models is below this, the latter lack memory
BETTER = 0.7


@dataclass(frozen=True, eq=False)
class Unseen:
    """The two tests not used for training, and the predictions of the models.

    Parameters
    ----------
    tests : sequence of Samples
        Tests at 1250 1/min and at random speeds.
    dynamic : mapping of str to ErrorModel
        Our `dynamic` models, trained on the same 810 rows, including the spindle speed.
    """

    tests: Sequence[Samples]
    learned: LearnedDrift
    dynamic: Mapping[str, ErrorModel]

    @property
    def models(self) -> dict[str, Mapping[str, ErrorModel]]:
        """Models by method; for the neural nets, the one with the median error."""
        return {MRA: self.learned.models, NET: self.learned.typical.models, DYNAMIC: self.dynamic}

    @cached_property
    def residuals(self) -> list[dict[str, dict[str, FloatArray]]]:
        """Residuals per test, by drift and method, including no compensation [um]."""
        return [
            {
                t: {NONE: common.take_measured(test, t)}
                | {m: common.residual(models[t], test) for m, models in self.models.items()}
                for t in DRIFTS
            }
            for test in self.tests
        ]

    def errors(self, test: int, target: str, method: str) -> Errors:
        """Return the error metrics of a method in a test."""
        return Errors.of(self.residuals[test][target][method])

    def nets(self, target: str, samples: Samples) -> FloatArray:
        """Return the RMS residual of each neural net, shape (n_starts,) [um]."""
        return np.array([rms(n.models[target], samples) for n in self.learned.nets])

    def left(self, target: str, samples: Samples) -> dict[str, float]:
        """Return the RMS residual of each method; the median for the nets [um]."""
        net = float(np.median(self.nets(target, samples)))
        return {m: net if m == NET else rms(models[target], samples) for m, models in self.models.items()}

    @cached_property
    def cut(self) -> Samples:
        """The test at 1250 1/min with the spindle sensor cut off."""
        return common.cut_off(self.tests[0], "T2")

    @cached_property
    def noisy(self) -> dict[str, float]:
        """RMS residual of each method for z at 1250 1/min with uniform sensor noise [um]."""
        return noise(self, "uniform")


def rms(model: ErrorModel, samples: Samples) -> float:
    """Return the RMS residual of a model in a test [um]."""
    return Errors.of(common.residual(model, samples)).rms


def observe(learned: LearnedDrift, seed: int) -> Unseen:
    """Run the two tests not used for training, and train `dynamic` for comparison."""
    ours = {t: trained("dynamic", learned.samples, k) for k, t in enumerate(DRIFTS)}
    return Unseen([drift_samples([test]) for test in recordings("chen1996-new", seed)], learned, ours)


# -- claims ------------------------------------------------------------------------------------------------------------


claims = Claims[Unseen](__name__, setup)


def _bad(left: float, none: float) -> bool:
    return left > (1 - WELL) * none


@claims.facts
def _new_observations(found: Unseen, test: str) -> Facts:
    number = TESTS.index(test)
    samples, none = found.tests[number], found.errors(number, "z", NONE).rms
    nets, wide = found.nets("z", samples), rms(found.learned.wide["z"], samples)
    mra, net, ours = found.left("z", samples).values()
    reasons = {
        "mra": _bad(mra, none),
        "net": _bad(net, none),
        "apart": net > COMPETITIVE * mra or mra > COMPETITIVE * net,
        "past": ours < BETTER * min(mra, net, wide),
    }
    facts = {"figure": 14 + number, "none": none, "mra": mra, "net": net, "ours": ours, "wide": wide}
    facts |= {"least": nets.min(), "most": nets.max(), "mra_share": mra / none, "net_share": net / none}
    holds = not (reasons["mra"] or reasons["net"] or reasons["apart"])
    return facts | {"reasons": [reason for reason, true in reasons.items() if true], "holds": holds}


@claims.facts
def _memory(found: Unseen) -> Facts:
    drifts = []
    for t in DRIFTS:
        none, *left = (common.rms(np.concatenate([r[t][m] for r in found.residuals])) for m in (NONE, *found.models))
        drifts.append((t, none, left))
    return {"drifts": drifts}


@claims.facts
def _uniform(found: Unseen) -> Facts:
    none, noisy, clean = found.errors(0, "z", NONE).rms, found.noisy, found.left("z", found.tests[0])
    bad = [short for m, short in ((MRA, "mra"), (NET, "net")) if _bad(noisy[m], none)]
    shares = {m.lower(): (noisy[m] / none, clean[m] / none) for m in (MRA, NET)}
    steepest = float(np.abs(found.learned.regressions["z"].coef_).max())
    facts = {"noisy": True, "none": none, "left": noisy, "steepest": steepest}
    return facts | shares | {"reasons": [*bad, "through"], "holds": not bad}


@claims.facts
def _normal(found: Unseen) -> Facts:
    return {"noisy": True, "none": found.errors(0, "z", NONE).rms, "left": noise(found, "normal")}


@claims.facts
def _fault(found: Unseen, target: str) -> Facts:
    regression = found.learned.models[target]
    intact, cut = (rms(regression, s) for s in (found.tests[0], found.cut))
    nets, nets_cut = (found.nets(target, s) for s in (found.tests[0], found.cut))
    facts = {"none": found.errors(0, target, NONE).rms, "intact": intact, "cut": cut, "worse": cut - intact}
    facts |= {"net": np.median(nets), "net_cut": np.median(nets_cut), "worse_net": np.median(nets_cut - nets)}
    facts |= {"least": nets_cut.min(), "most": nets_cut.max(), "dynamic": rms(found.dynamic[target], found.cut)}
    return facts | {"figure": target, "whose": target, "uses_t2": "T2" in regression.sensors}


def _tenfold(found: Unseen, largest: Mapping[str, float]) -> Facts:
    closest = min((MRA, NET), key=lambda m: largest[m])
    none, best = largest[NONE], largest[closest]
    fitted = {
        f"fitted_{m.lower()}": max(Errors.of(common.residual(models[t], found.learned.samples)).max_abs for t in DRIFTS)
        for m, models in found.models.items()
        if m != DYNAMIC
    }
    facts: Facts = {"none": none, "mra": largest[MRA], "net": largest[NET], "dynamic": largest[DYNAMIC]}
    facts |= {"times": none / best if best else float("inf"), "closest": closest}
    facts |= {"minutes": 60 * _since_change(found, closest), "better_of_both": True, "not_tenfold": True}
    return facts | fitted


@claims.facts
def _tool_point(found: Unseen) -> Facts:
    return _tenfold(found, largest_error(found))


@claims.facts
def _depth(found: Unseen) -> Facts:
    return _tenfold(found, largest_depth(found))


def noise(found: Unseen, law: Literal["uniform", "normal"]) -> dict[str, float]:
    """Return the RMS residual of each method for z at 1250 1/min with noise, mean over the draws [um]."""
    noisy = [found.left("z", common.with_noise(found.tests[0], NOISE, law, k)) for k in range(DRAWS)]
    return {m: float(np.mean([left[m] for left in noisy])) for m in found.models}


def largest_error(found: Unseen) -> dict[str, float]:
    """Return the largest length of the vector (x, y, z) in both tests, by method [um]."""
    return {m: max(float(_length(r, m).max()) for r in found.residuals) for m in (NONE, *found.models)}


def largest_depth(found: Unseen) -> dict[str, float]:
    """Return the larger peak-to-peak value of z in the two tests, by method [um]."""
    return {m: max(found.errors(k, "z", m).peak_to_peak for k in range(len(TESTS))) for m in (NONE, *found.models)}


def _since_change(found: Unseen, method: str) -> float:
    """Return the time from the last change of the spindle speed to the largest error of a method [h]."""
    lengths = [_length(r, method) for r in found.residuals]
    k = int(np.argmax([e.max() for e in lengths]))
    test, row = found.tests[k], int(lengths[k].argmax())
    speed = test.values[: row + 1, [c.quantity for c in test.inputs].index("spindle_speed")]
    changed = int(np.flatnonzero(np.diff(speed, prepend=0.0)).max(initial=0))
    # the speed in a row is that of the preceding interval: it changed at the row before
    return float(test.time[row] - test.time[max(changed - 1, 0)]) / 3600.0


def _length(residuals: Mapping[str, Mapping[str, FloatArray]], method: str) -> FloatArray:
    """Return the magnitude of the tool-point error for each row [um]."""
    return np.sqrt(sum((residuals[t][method] ** 2 for t in DRIFTS), start=np.zeros(1)))


def numbers(found: Unseen) -> dict[str, float]:
    """Return the key numbers, which the gallery page checks: RMS, medians for the nets, and largest errors."""
    short = {NONE: "none", MRA: "mra", NET: "net", DYNAMIC: "dynamic"}
    made: dict[str, float] = {}
    for t in DRIFTS:
        for k, test in enumerate(("1250", "random")):
            left = {NONE: found.errors(k, t, NONE).rms} | found.left(t, found.tests[k])
            made |= {f"rms_{t}_{test}_{short[m]}_um": e for m, e in left.items()}
        cut = found.left(t, found.cut)
        made |= {f"rms_{t}_1250_cut_{short[m]}_um": cut[m] for m in (MRA, NET)}
    made |= {f"rms_z_1250_noise_{short[m]}_um": e for m, e in found.noisy.items()}
    made |= {f"largest_error_{short[m]}_um": e for m, e in largest_error(found).items()}
    made |= {f"largest_depth_{short[m]}_um": e for m, e in largest_depth(found).items()}
    return made


# -- tables and figures ------------------------------------------------------------------------------------------------


def tables(found: Unseen) -> list[StudyTable]:
    """Return the residuals of x, y and z in each new test, and the effective sample sizes."""
    residuals = {
        (f"{t}, {name}", method): e
        for name, tests in zip(TESTS, found.residuals, strict=True)
        for t in DRIFTS
        for method, e in tests[t].items()
    }
    errors = common.errors_table("New tests: error without and with compensation", residuals)
    rows = [[*row, f"{effective_sample_size(e):.0f}"] for row, e in zip(errors.rows, residuals.values(), strict=True)]
    return [StudyTable(errors.caption, (*errors.header, "effective rows"), rows)]


def figures(found: Unseen) -> list[Figure]:
    """Return the figures that correspond to Figs. 14 to 17 of the paper."""
    constant, random = found.tests
    noisy = common.with_noise(constant, NOISE, "uniform", 0)
    shown = {14: ("z", constant), 15: ("z", random), 16: ("z", noisy), 17: ("x", found.cut)}
    drawn = []
    for number, (target, samples) in shown.items():
        drift = {"measured": common.take_measured(samples, target)}
        drift |= {m: common.predict_deviation(models[target], samples) for m, models in found.models.items()}
        drawn.append(exhibits.figure(f"chen1996-fig{number}", (samples.time / 3600.0, drift)))
    return drawn
