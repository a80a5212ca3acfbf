"""Chen, Yuan, Ni 1996, section 5: new observations, noise, and a cut-off sensor."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Literal

import numpy as np

from thermocomp.core.model import ErrorModel
from thermocomp.models.numerics.leastsquares import effective_sample_size
from thermocomp.papers import common
from thermocomp.papers.chen1996.drift import LearnedDrift
from thermocomp.papers.chen1996.setup import COMPETITIVE, DRIFTS, TENFOLD, WELL, drift_samples, recordings
from thermocomp.papers.chen1996.show import figure
from thermocomp.papers.common import Errors, trained
from thermocomp.papers.pictures import curves
from thermocomp.papers.study import Claims, Figure, FloatArray, Ours, StudyTable
from thermocomp.recordings.samples import Samples

#: level of the noise [degC] and number of draws (C-33, E-C9)
NOISE, DRAWS = 0.4, 20
#: printed: depth difference before and after compensation [um] (C-35)
DEPTH = (196.0, 8.0)
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
    learned : LearnedDrift
    dynamic : mapping of str to ErrorModel
        Our `dynamic` models, trained on the same 810 rows, including the spindle speed.
    """

    tests: Sequence[Samples]
    learned: LearnedDrift
    dynamic: Mapping[str, ErrorModel]

    @property
    def models(self) -> dict[str, Mapping[str, ErrorModel]]:
        """Models by method; for the nets the typical one."""
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
        """Return the error figures of a method in a test."""
        return Errors.of(self.residuals[test][target][method])

    def nets(self, target: str, samples: Samples) -> FloatArray:
        """Return the RMS residual of each net, shape (n_starts,) [um]."""
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
        """Result of `noise` for uniform noise."""
        return noise(self, "uniform")


def rms(model: ErrorModel, samples: Samples) -> float:
    """Return the RMS residual of a model [um]."""
    return Errors.of(common.residual(model, samples)).rms


def observe(learned: LearnedDrift, seed: int) -> Unseen:
    """Run the two tests and train our own method.

    Parameters
    ----------
    learned : LearnedDrift
    seed : int
        Random seed other than that of the five tests, so that the weather is unseen.

    Returns
    -------
    Unseen
    """
    ours = {t: trained("dynamic", learned.samples, k) for k, t in enumerate(DRIFTS)}
    return Unseen([drift_samples([test]) for test in recordings("chen1996-new", seed)], learned, ours)


# -- claims ------------------------------------------------------------------------------------------------------------


claims = Claims[Unseen]()


def _bad(left: float, none: float) -> bool:
    return left > (1 - WELL) * none


def _new_observations(found: Unseen, test: int) -> Ours:
    samples, none = found.tests[test], found.errors(test, "z", NONE).rms
    nets, wide = found.nets("z", samples), rms(found.learned.wide["z"], samples)
    mra, net, ours = found.left("z", samples).values()
    equal = net <= COMPETITIVE * mra and mra <= COMPETITIVE * net
    reasons = [f"the {m} leaves {e / none:.0%} of the drift" for m, e in ((MRA, mra), (NET, net)) if _bad(e, none)]
    if not equal:
        reasons.append(
            f"the net's error is {net:.2f} um, that of the MRA {mra:.2f} um; on all nine temperatures, which the net "
            f"has, an MRA leaves {wide:.2f} um"
        )
    if ours < BETTER * min(mra, net, wide):
        reasons.append(
            f"a model that also knows the speed and remembers leaves {ours:.2f} um, so what they lack is the past"
        )
    return Ours(
        f"RMS {none:.1f} um; MRA {mra:.2f}, net {net:.2f} ({nets.min():.2f}-{nets.max():.2f}) um",
        equal and not _bad(mra, none) and not _bad(net, none),
        "; ".join(reasons),
    )


for _test, _name in enumerate(TESTS):
    claims.add(
        "C-32 C-36",
        f"New observations of z, {_name}: MRA and net predict well (at least {WELL:.0%} of the RMS vanishes) and "
        f"almost equally well (within a factor of {COMPETITIVE:g})",
        f"Fig. {14 + _test}",
    )(partial(_new_observations, test=_test))


@claims.add("C-32", "RMS over both new tests, without compensation -> MRA / net / a model with a memory (ours)")
def _memory(found: Unseen) -> str:
    parts = []
    for t in DRIFTS:
        none, *left = (common.rms(np.concatenate([r[t][m] for r in found.residuals])) for m in (NONE, *found.models))
        parts.append(f"{t} {none:.1f} -> {' / '.join(f'{e:.2f}' for e in left)}")
    return f"{'; '.join(parts)} um"


def _shaken(found: Unseen, left: Mapping[str, float]) -> str:
    listed = ", ".join(f"{name} {value:.2f}" for name, value in left.items())
    return f"RMS {found.errors(0, 'z', NONE).rms:.1f} um; {listed} um"


@claims.add(
    "C-33 C-36 E-C9",
    f"z, 1250 1/min, uniform noise of {NOISE} degC on all temperatures: both predict well (at least {WELL:.0%} of the "
    "RMS vanishes)",
    "Fig. 16",
)
def _uniform(found: Unseen) -> Ours:
    none, noisy, clean = found.errors(0, "z", NONE).rms, found.noisy, found.left("z", found.tests[0])
    reasons = [
        f"the {m} leaves {noisy[m] / none:.0%} of the drift with noise, {clean[m] / none:.0%} without"
        for m in (MRA, NET)
        if _bad(noisy[m], none)
    ]
    steepest = float(np.abs(found.learned.regressions["z"].coef_).max())
    through = f"noise goes through coefficients of up to {steepest:.1f} um/degC in the MRA"
    return Ours(f"{_shaken(found, noisy)} (mean of {DRAWS} draws)", not reasons, "; ".join([*reasons, through]))


@claims.add("C-33 E-C9", f"z, 1250 1/min, normal noise of {NOISE} degC on all temperatures (ours)")
def _normal(found: Unseen) -> str:
    return _shaken(found, noise(found, "normal"))


def _fault(found: Unseen, target: str) -> Ours:
    regression = found.learned.models[target]
    intact, cut = (rms(regression, s) for s in (found.tests[0], found.cut))
    nets, nets_cut = (found.nets(target, s) for s in (found.tests[0], found.cut))
    worse, worse_net = cut - intact, float(np.median(nets_cut - nets))
    reason = f"the RMS of the MRA rises by {worse:.2f} um and that of the net by {worse_net:.2f}"
    if "T2" not in regression.sensors:
        reason = f"the stepwise selection left T2 out of the regression of {target}, so its loss cannot hurt"
    return Ours(
        f"RMS {found.errors(0, target, NONE).rms:.1f} um; MRA {intact:.2f} -> {cut:.2f}, "
        f"net {np.median(nets):.2f} -> {np.median(nets_cut):.2f} ({nets_cut.min():.2f}-{nets_cut.max():.2f}), "
        f"dynamic -> {rms(found.dynamic[target], found.cut):.2f} um",
        worse_net < worse,
        reason,
    )


for _target in DRIFTS:
    claims.add(
        "C-34 C-36",
        f"{_target}, 1250 1/min, spindle temperature T2 cut off: the net degrades less than the MRA"
        + ("" if _target == "x" else " (ours: the paper shows x)"),
        "Fig. 17" if _target == "x" else "",
    )(partial(_fault, target=_target))


def _tenfold(found: Unseen, largest: Mapping[str, float]) -> Ours:
    closest = min((MRA, NET), key=lambda m: largest[m])
    none, best = largest[NONE], largest[closest]
    times = none / best if best else float("inf")
    fitted = {
        m: max(Errors.of(common.residual(models[t], found.learned.samples)).max_abs for t in DRIFTS)
        for m, models in found.models.items()
        if m != DYNAMIC
    }
    return Ours(
        f"{none:.1f} um; MRA {largest[MRA]:.1f}, net {largest[NET]:.1f} um: the better of them {times:.1f} times; "
        f"dynamic (ours) {largest[DYNAMIC]:.1f} um",
        times >= TENFOLD,
        f"even in the rows they were fitted to, the regressions are wrong by up to {fitted[MRA]:.1f} um and the net by "
        f"{fitted[NET]:.1f}; the largest error of the {closest} in the new tests stands "
        f"{60 * _since_change(found, closest):.0f} min after the spindle changed its speed",
    )


@claims.add(
    "C-35",
    "The accuracy of the machine improves by a factor of ten. Here, as far as built: the largest error of the "
    "tool point (length of x, y, z) in both new tests, at one position; the whole volume needs its kinematics",
    "10 times",
)
def _tool_point(found: Unseen) -> Ours:
    return _tenfold(found, largest_error(found))


@claims.add(
    "C-35",
    "The difference in depth from the growth of the spindle shrinks by a factor of ten or more. Here: largest "
    "peak-to-peak of z in a new test",
    f"{DEPTH[0]:g} -> {DEPTH[1]:g} um, {DEPTH[0] / DEPTH[1]:.1f} times",
)
def _depth(found: Unseen) -> Ours:
    return _tenfold(found, largest_depth(found))


def noise(found: Unseen, law: Literal["uniform", "normal"]) -> dict[str, float]:
    """Return the RMS residual of each method for z at 1250 1/min with noise, mean over the draws [um].

    Parameters
    ----------
    found : Unseen
    law : {'uniform', 'normal'}

    Returns
    -------
    dict of str to float
        RMS by method; the median for the nets.
    """
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
    """Return the numbers asserted by the documentation: RMS, medians for the nets, and largest errors."""
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
    """Return the residuals of x, y and z in each new test, and the number of independent rows."""
    residuals = {
        (f"{t}, {name}", method): e
        for name, tests in zip(TESTS, found.residuals, strict=True)
        for t in DRIFTS
        for method, e in tests[t].items()
    }
    errors = common.errors_table("New tests: error without and with compensation", residuals)
    rows = [[*row, f"{effective_sample_size(e):.0f}"] for row, e in zip(errors.rows, residuals.values(), strict=True)]
    return [StudyTable(errors.caption, (*errors.header, "independent rows"), rows)]


def figures(found: Unseen) -> list[Figure]:
    """Return Figs. 14 to 17."""
    constant, random = found.tests
    noisy = common.with_noise(constant, NOISE, "uniform", 0)
    return [
        _figure(found, 14, "z", constant, "drift in z at 1250 1/min, a speed that was not learned."),
        _figure(found, 15, "z", random, "drift in z at random speeds."),
        _figure(found, 16, "z", noisy, f"as Fig. 14, with uniform noise of {NOISE} degC on all temperatures."),
        _figure(found, 17, "x", found.cut, "drift in x at 1250 1/min with the spindle temperature T2 cut off."),
    ]


def _figure(found: Unseen, number: int, target: str, samples: Samples, text: str) -> Figure:
    drift = {"measured": common.take_measured(samples, target)}
    drift |= {m: common.predict_deviation(models[target], samples) for m, models in found.models.items()}
    lines = curves(samples.time / 3600.0, drift, dashed=[DYNAMIC], points=["measured"])
    return figure(number, text, ("time [h]", f"{target} [um]"), lines)
