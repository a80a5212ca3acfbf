"""Chen, Yuan, Ni 1996, sections 3.2 and 4.2: spindle drifts, fitted by regression and by a neural net."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from joblib import Parallel, delayed

from thermocomp.core.model import ErrorModel
from thermocomp.models.mlp import SigmoidNet
from thermocomp.models.second_order import SecondOrderRegression
from thermocomp.papers import common
from thermocomp.papers.chen1996 import setup
from thermocomp.papers.chen1996.setup import CLOSELY, COMPETITIVE, DRIFTS, TEMPERATURES, drift_samples, recordings
from thermocomp.papers.claims import Claims, Facts
from thermocomp.papers.pictures import end_to_end
from thermocomp.papers.study import Figure, FloatArray, StudyTable
from thermocomp.recordings.samples import Samples

#: printed: numbers of screened terms (C-20), mean absolute errors after training [um] (C-31)
TERMS = {"x": 7, "y": 15, "z": 7}
MAE_NET = {"x": 6.5, "y": 4.2, "z": 6.0}
MAE_MRA = {"x": 8.9, "y": 3.8, "z": 6.9}
#: printed: removals in the log of y (C-16)
REMOVALS = 6
#: printed: fit of x (C-19)
R2_X, SEE_X = 0.988, 10.628
#: Eq. 5 (C-18)
EQ5 = {
    "T2": -0.586,
    "T3": 7.527,
    "(T6-T7)": -36.966,
    "(T8-T9)": 10.809,
    "T3*T3": -0.149,
    "(T6-T7)*(T6-T7)": -18.119,
    "T2*(T6-T7)": 2.499,
}
#: hidden nodes of the chosen net (C-26) and number of trainings; alternatives and number of trainings of each
HIDDEN = 20
STARTS = 5
SWEEP, SWEEP_STARTS = (5, 10, 15, 25, 30), 3


@dataclass(frozen=True, eq=False)
class LearnedNet:
    """A net trained from one set of starting weights.

    Parameters
    ----------
    models : mapping of str to ErrorModel
        Model of each drift.
    mae : mapping of str to float
        Mean absolute error after training [um].
    """

    net: SigmoidNet
    models: Mapping[str, ErrorModel]
    mae: Mapping[str, float]

    @property
    def mean(self) -> float:
        """Mean absolute error after training, averaged over the three drifts [um]."""
        return float(np.mean(list(self.mae.values())))


@dataclass(frozen=True, eq=False)
class LearnedDrift:
    """Models fitted to the 810 training rows, and their errors.

    Parameters
    ----------
    regressions : mapping of str to SecondOrderRegression
        Regression of each drift.
    models : mapping of str to ErrorModel
        The regressions, frozen.
    wide : mapping of str to ErrorModel
        Additional models to show the effect of the subgroups: stepwise regressions on all nine temperatures, as for the
        net.
    nets : sequence of LearnedNet
        9-20-3 nets, each from different starting weights.
    others : mapping of str to sequence of LearnedNet
        Methods that the paper tried and rejected (C-26, C-28, C-30).
    """

    samples: Samples
    regressions: Mapping[str, SecondOrderRegression]
    models: Mapping[str, ErrorModel]
    wide: Mapping[str, ErrorModel]
    nets: Sequence[LearnedNet]
    others: Mapping[str, Sequence[LearnedNet]]

    @cached_property
    def typical(self) -> LearnedNet:
        """The net with the median error after training, which is shown in the figures."""
        return sorted(self.nets, key=lambda t: t.mean)[len(self.nets) // 2]

    @property
    def mean(self) -> float:
        """Mean absolute error of the neural nets after training [um]."""
        return float(np.mean([n.mean for n in self.nets]))

    def mean_of(self, kind: str) -> float:
        """Return the mean absolute error of the nets of one of `others` after training [um]."""
        return float(np.mean([n.mean for n in self.others[kind]]))

    @cached_property
    def mra_residual(self) -> dict[str, FloatArray]:
        """Residuals of the regressions on the 810 rows [um]."""
        return {t: common.residual(m, self.samples) for t, m in self.models.items()}

    def mae_net(self, target: str) -> FloatArray:
        """Return the mean absolute errors of the nets after training, shape (n_starts,) [um]."""
        return np.array([n.mae[target] for n in self.nets])

    @cached_property
    def net(self) -> dict[str, float]:
        """Median mean absolute error of the nets, by drift [um]."""
        return {t: float(np.median(self.mae_net(t))) for t in DRIFTS}

    @cached_property
    def mra(self) -> dict[str, float]:
        """Mean absolute errors of the regressions, by drift [um]."""
        return {t: float(np.abs(e).mean()) for t, e in self.mra_residual.items()}

    @property
    def terms(self) -> dict[str, int]:
        """Number of terms of the regressions."""
        return {t: len(r.terms_) for t, r in self.regressions.items()}

    @property
    def candidates(self) -> dict[str, int]:
        """Number of candidate terms of the regressions."""
        return {t: len(r.candidates_) for t, r in self.regressions.items()}

    @property
    def independent(self) -> dict[str, float]:
        """Effective sample size of the training rows, from the residuals of each regression."""
        return {t: r.n_effective_ for t, r in self.regressions.items()}

    @property
    def ranges(self) -> dict[str, float]:
        """Maximum minus minimum of each drift [um]."""
        return {t: float(np.ptp(common.take_measured(self.samples, t))) for t in DRIFTS}


def learn(seed: int, told: Callable[[float], None]) -> LearnedDrift:
    """Run the five tests and fit the models of the paper."""
    samples = drift_samples(recordings("chen1996", seed))
    heat = samples.only(TEMPERATURES)
    regressions = {
        t: SecondOrderRegression(differences=setup.DIFFERENCES, subset=group) for t, group in setup.SUBGROUPS.items()
    }
    models = {t: common.fit_and_freeze(r, heat, [t])[t] for t, r in regressions.items()}
    wide = {t: common.fit_and_freeze(SecondOrderRegression(), heat, [t])[t] for t in DRIFTS}
    kinds: dict[str, tuple[SigmoidNet, int]] = {"": (SigmoidNet(hidden=HIDDEN), STARTS)}
    kinds |= {f"9-{h}-3": (SigmoidNet(hidden=h), SWEEP_STARTS) for h in SWEEP}
    kinds["common scaling"] = SigmoidNet(hidden=HIDDEN, scaling="common"), SWEEP_STARTS
    kinds["batch update"] = SigmoidNet(hidden=HIDDEN, update="batch"), SWEEP_STARTS
    jobs = [(kind, start) for kind, (_, n) in kinds.items() for start in range(n)]
    trained: Iterator[LearnedNet] = Parallel(n_jobs=-1, prefer="threads", return_as="generator")(
        delayed(_train)(SigmoidNet(**{**kinds[kind][0].get_params(), "seed": start}), heat) for kind, start in jobs
    )
    by_kind: dict[str, list[LearnedNet]] = {}
    for done, ((kind, _), net) in enumerate(zip(jobs, trained, strict=True), start=1):
        by_kind.setdefault(kind, []).append(net)
        told(done / len(jobs))
    return LearnedDrift(
        samples=samples, regressions=regressions, models=models, wide=wide, nets=by_kind.pop(""), others=by_kind
    )


def _train(net: SigmoidNet, heat: Samples) -> LearnedNet:
    models = common.fit_and_freeze(net, heat, tuple(DRIFTS))
    residual = heat.deviations - net.predict(heat.frame())
    mae = dict(zip(DRIFTS, np.abs(residual).mean(axis=0).tolist(), strict=True))
    return LearnedNet(net, models, mae)


# -- claims ------------------------------------------------------------------------------------------------------------

claims = Claims[LearnedDrift](__name__)


@claims.facts
def _halved(found: LearnedDrift) -> Facts:
    shares, paper = ({t: terms[t] / found.candidates[t] for t in DRIFTS} for terms in (found.terms, TERMS))
    many = [t for t in DRIFTS if shares[t] > 0.5]
    as_few = all(shares[t] <= paper[t] for t in DRIFTS)
    return {"many": many, "holds": not many, "shares": shares, "paper_shares": paper, "as_few": as_few}


@claims.facts
def _removed(found: LearnedDrift) -> Facts:
    removals = {t: sum(s.action == "remove" for s in r.log_) for t, r in found.regressions.items()}
    return {"removals": removals, "holds": any(removals.values())}


@claims.facts
def _closely(found: LearnedDrift) -> Facts:
    r2 = {t: r.r_squared_ for t, r in found.regressions.items()}
    loose = [t for t in DRIFTS if round(r2[t], 3) < CLOSELY]
    return {
        "r2": r2,
        "errors": [r.standard_error_ for r in found.regressions.values()],
        "loose": loose,
        "holds": not loose,
    }


@claims.facts
def _nodes(found: LearnedDrift) -> Facts:
    at_20 = np.array([n.mean for n in found.nets])
    mean, spread = at_20.mean(), at_20.std(ddof=1)
    above = {h: found.mean_of(f"9-{h}-3") for h in SWEEP if h > HIDDEN}
    better = [h for h, error in above.items() if error < mean - spread]
    return {"mean": mean, "spread": spread, "above": above, "better": better, "holds": not better}


@claims.facts
def _scaling(found: LearnedDrift) -> Facts:
    return {"chosen": found.mean, "other": found.mean_of("common scaling")}


@claims.facts
def _update(found: LearnedDrift) -> Facts:
    return {"chosen": found.mean, "other": found.mean_of("batch update")}


@claims.facts
def _close(found: LearnedDrift) -> Facts:
    wide = [np.abs(common.residual(m, found.samples)).mean() for m in found.wide.values()]
    ratios = {t: found.net[t] / found.mra[t] for t in DRIFTS}
    apart = {t: r for t, r in ratios.items() if not 1 / COMPETITIVE <= r <= COMPETITIVE}
    printed = {t: MAE_NET[t] / MAE_MRA[t] for t in DRIFTS}
    factor, paper = (max(max(r, 1 / r) for r in of.values()) for of in (ratios, printed))
    facts: Facts = {"apart": apart, "directions": list(apart), "wide_mae": wide, "holds": not apart}
    return facts | {"factor": factor, "paper_factor": paper}


@claims.facts
def _starts(found: LearnedDrift) -> Facts:
    return {"extremes": [(t, found.mae_net(t).min(), found.mae_net(t).max()) for t in DRIFTS]}


# -- tables and figures -----------------------------------------------------------------------------------------------


def tables(found: LearnedDrift) -> list[StudyTable]:
    """Return Table 2, the fits, Eq. 5 next to our coefficients, the training logs of Fig. 2 and the sweep."""
    printed = {"x": (f" ({R2_X})", f" ({SEE_X:.1f})")}
    fits = []
    for t, regression in found.regressions.items():
        counts = (found.candidates[t], found.terms[t], TERMS[t])
        errors = (found.mra[t], MAE_MRA[t], found.net[t], MAE_NET[t])
        fits.append((t, setup.SUBGROUPS[t], *counts, regression, *printed.get(t, ("", "")), *errors))
    x, y = found.regressions["x"], found.regressions["y"]
    nets = {**found.others, "9-20-3": found.nets}
    return [
        setup.exhibits.table("fits", fits),
        setup.exhibits.table("eq5", beside(dict(zip(x.terms_, x.coef_.tolist(), strict=True)), EQ5)),
        setup.exhibits.table("log_x", [(s, s.action.upper()) for s in x.log_]),
        setup.exhibits.table("log_y", [(s, s.action.upper()) for s in y.log_]),
        setup.exhibits.table("nets", [_mean_errors(kind, trained) for kind, trained in nets.items()]),
    ]


def _mean_errors(kind: str, nets: Sequence[LearnedNet]) -> tuple[str, Sequence[LearnedNet], list[float], float]:
    mae = [float(np.mean([n.mae[t] for n in nets])) for t in DRIFTS]
    return kind, nets, mae, float(np.mean(mae))


def beside(ours: Mapping[str, float], paper: Mapping[str, float]) -> list[tuple[str, str, str]]:
    """Return the rows of a table of coefficients by term, ours next to the paper's; a missing one is empty."""
    texts = [{term: f"{coefficient:.3f}" for term, coefficient in c.items()} for c in (ours, paper)]
    return [(term, texts[0].get(term, ""), texts[1].get(term, "")) for term in {**ours, **paper}]


def figures(found: LearnedDrift) -> list[Figure]:
    """Return the figures that correspond to Figs. 3 to 5 and 10 to 12: measurements and fits."""
    samples, drawn = found.samples, []
    for kind, first, models in (("MRA", 3, found.models), ("net", 10, found.typical.models)):
        for number, (target, model) in enumerate(models.items(), start=first):
            hours, measured = end_to_end(samples, common.take_measured(samples, target))
            _, fitted = end_to_end(samples, common.predict_deviation(model, samples))
            drawn.append(setup.exhibits.figure(f"chen1996-fig{number}", (hours, {"measured": measured, kind: fitted})))
    return drawn
