"""Position-dependent errors: cold profile, thermal slopes, and models of both (Chen 1996, sections 2.2, 3.3)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from thermocomp import __version__
from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.exceptions import FitError, InputError, RecordingError
from thermocomp.core.machine import Channel
from thermocomp.core.model import ErrorModel
from thermocomp.core.polynomial import Polynomial
from thermocomp.core.position import PositionModel, slope_unit
from thermocomp.core.provenance import Provenance
from thermocomp.core.terms import TermTable
from thermocomp.core.zero import FIRST_READING
from thermocomp.models.training import Trained, train
from thermocomp.recordings.profiles import QUANTITY, Profiles, Slopes
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack
from thermocomp.recordings.starts import COLD
from thermocomp.volumetric.models.geometric import ProfileFit, fit_profile
from thermocomp.volumetric.models.positionoptions import (
    POWERS,
    PositionOptions,
    blank_unlearned,
    choose_power,
    is_worthwhile,
    reference_position,
    remainder,
    set_cold_profiles,
)

__all__ = ["PositionFit", "PositionOptions", "fit_position", "slope_samples"]


@dataclass(frozen=True, eq=False)
class PositionFit:
    """A position model and the results of its fit.

    Parameters
    ----------
    model : PositionModel
        Frozen model.
    profile : ProfileFit
        Cold profile: its order and the errors at left-out points.
    slopes : tuple of Slopes
        Measured factors of the thermal parts, one per test; k1 if none is modelled.
    samples : Samples
        Inputs, with the factors as targets ``k0``, ``k1`` ...; one row per state.
    trained : tuple of Trained
        Trained model of each factor.
    coefficient_errors : tuple of mapping of str to float
        Standard error of each coefficient of the factors' models, if these are polynomials of temperatures. Rows are
        regarded as independent except for the noise of the cold profile, which is common to all; terms are regarded as
        given, although they were selected (E-C12).
    remainders : mapping of int to float
        Residual of the thermal part after powers up to m, RMS per degree of freedom [unit], by m (C-05).
    offset_remainder : float
        Residual after the powers of the model with an offset k_0 [unit].
    thermal_rms : float
        RMS of the thermal part over all states except the reference [unit].
    """

    model: PositionModel
    profile: ProfileFit
    slopes: tuple[Slopes, ...]
    samples: Samples
    trained: tuple[Trained, ...]
    coefficient_errors: tuple[Mapping[str, float], ...]
    remainders: Mapping[int, float]
    offset_remainder: float
    thermal_rms: float

    @property
    def enough(self) -> int:
        """Smallest m above which powers add little: below a tenth of the rest or a twentieth of the thermal part."""
        return choose_power(self.remainders, self.thermal_rms) or 1

    @property
    def shifts(self) -> bool:
        """True if adding an offset is worthwhile: the profiles tilt about another position, or shift."""
        rest = self.remainders.get(len(self.model.slopes), np.nan)
        return self.model.offset is None and is_worthwhile(rest, self.offset_remainder, self.thermal_rms)


def fit_position(
    profiles: Profiles | Sequence[Profiles],
    options: PositionOptions = PositionOptions(),  # noqa: B008 - frozen
    *,
    learn: BoolArray | None = None,
) -> PositionFit:
    """Fit d = f_g(x, y, z) + k_0(t) + k_1(t) q + k_2(t) q^2 ... (C-04, C-05, C-07).

    f_g is fitted to the cold profiles; the factors are fitted to each profile minus the cold one of its test. They are
    then targets like any other: the method learns them from the temperatures.

    Parameters
    ----------
    learn : ndarray of bool of shape (n_states,), optional
        Training states, over all tests. Default: all. The reference states of a test are used if any of its states is
        used.
    """
    tests = set_cold_profiles((profiles,) if isinstance(profiles, Profiles) else tuple(profiles), options, learn)
    samples, slopes = slope_samples(tests, options, learn)
    seen = np.ones(len(samples), dtype=np.bool_) if learn is None else learn
    used = blank_unlearned(tests, options, learn)
    position = np.concatenate([test.position for test in used])
    _refuse_unreached(position, np.concatenate([test.cold(options.reference) for test in used]), tests[0])
    # each cold state separately: repetitions show the noise
    rows = [test.values[test.reference_rows(options.reference)] for test in used]
    geometric = fit_profile(
        np.concatenate([np.tile(test.points, (len(r), 1)) for test, r in zip(used, rows, strict=True)]),
        np.concatenate([r.ravel() for r in rows]),
        tests[0].axis,
        kind=options.profile,
        order=options.order,
        coordinates=options.coordinates,
    )
    unit, powers = tests[0].unit, options.powers
    trained = [train(options.method, samples, j, seen, support=options.support) for j in range(len(powers))]
    models = [replace(t.model, unit=slope_unit(unit, k)) for t, k in zip(trained, powers, strict=True)]
    made = models[0].provenance if models else _profile_alone(samples, seen)
    return PositionFit(
        model=PositionModel(
            target=tests[0].target,
            unit=unit,
            axis=tests[0].axis,
            travel=(float(position.min()), float(position.max())),
            reference_position=reference_position(tests, options),
            profile=geometric.profile,
            offset=models[0] if options.offset else None,
            slopes=tuple(models[1:] if options.offset else models),
            provenance=_provenance(made, geometric, options),
        ),
        profile=geometric,
        slopes=slopes,
        samples=samples,
        trained=tuple(replace(t, model=m) for t, m in zip(trained, models, strict=True)),
        coefficient_errors=tuple(_coefficient_errors(m, samples, j, seen, slopes) for j, m in enumerate(models)),
        remainders={m: remainder(used, options, m) for m in POWERS},
        offset_remainder=remainder(used, replace(options, offset=True), options.slopes),
        thermal_rms=remainder(used, replace(options, offset=False), 0),
    )


def slope_samples(
    tests: Sequence[Profiles], options: PositionOptions, learn: BoolArray | None = None
) -> tuple[Samples, tuple[Slopes, ...]]:
    """Return the training data of the factors: one row per state, with the measured factors as targets.

    Parameters
    ----------
    learn : ndarray of bool of shape (n_states,), optional
        Training states; see `fit_position`.
    """
    first = tests[0]
    for test in tests[1:]:
        if (test.target, test.unit, test.axis) != (first.target, first.unit, first.axis):
            raise InputError(f"profiles of {first.target} and of {test.target}: fit one component at a time")
    tests = set_cold_profiles(tests, options, learn)
    zero_at, highest = reference_position(tests, options), options.slopes or (0 if options.offset else 1)
    slopes = tuple(
        test.slopes(highest, offset=options.offset, reference=options.reference, reference_position=zero_at)
        for test in tests
    )
    names = [f"{first.target}_k{k}" for k in slopes[0].powers]
    recordings = [_with_factors(test, s, names, options) for test, s in zip(tests, slopes, strict=True)]
    samples = stack(recordings, names, options.inputs, rezero=options.rezero, zeroing=FIRST_READING, starts=COLD)
    zero = np.stack(
        [
            _cold_inputs(samples, np.flatnonzero(samples.test == k)[test.reference_rows(options.reference)])
            for k, test in enumerate(tests)
        ]
    )
    if not options.rezero:
        mine = [learn is None or learn[samples.test == k].any() for k in range(len(tests))]
        zero = np.tile(zero[mine].mean(axis=0), (len(tests), 1))
    return replace(samples, zero=zero, hashes=tuple(test.fingerprint for test in tests)), slopes


def _refuse_unreached(position: FloatArray, cold: FloatArray, test: Profiles) -> None:
    """Raise an error for a cold profile shorter than the others: it would be taken as constant beyond its ends."""
    there = position[np.isfinite(cold)]
    for end in (position.min(), position.max()):
        if end not in there:
            raise FitError(
                f"{test.target}: the cold profile has no value at {end:g} mm, where other profiles have one: specify "
                "more reference states, or omit that position"
            )


def _with_factors(test: Profiles, slopes: Slopes, names: Sequence[str], options: PositionOptions) -> Recording:
    """Return a recording of thermal states, inputs and factors only; a factor counts as an error at 1 m."""
    states = test.states
    if options.inputs is not None:
        inputs = [states.channel(name) for name in options.inputs]
    else:
        inputs = [*states.temperatures, *states.of_quantity("spindle_speed")]
    inputs = list(dict.fromkeys(inputs))
    channels = (*inputs, *(Channel(name, QUANTITY[test.unit], test.unit) for name in names))
    values = np.column_stack([states.values(inputs), slopes.factors])
    return replace(states, table=pd.DataFrame(values, columns=[c.name for c in channels]), channels=channels)


def _cold_inputs(samples: Samples, rows: NDArray[np.intp]) -> FloatArray:
    """Return the values of the inputs in the cold state, to which they are relative."""
    values = samples.values[rows]
    there = np.isfinite(values)
    counted = np.array([c.quantity == "temperature" for c in samples.inputs])
    missing = np.flatnonzero(counted & ~there.any(axis=0))
    if missing.size:
        raise RecordingError(
            f"{samples.test_names[int(samples.test[rows[0]])]}: {samples.inputs[missing[0]].name} has no value in the "
            "reference state: choose another state, or omit the channel"
        )
    return np.asarray(np.where(there, values, 0.0).sum(axis=0) / np.maximum(there.sum(axis=0), 1))


def _coefficient_errors(
    model: ErrorModel, samples: Samples, target: int, seen: BoolArray, slopes: Sequence[Slopes]
) -> dict[str, float]:
    """Return standard errors of coefficients fitted by least squares; empty for other models."""
    if not isinstance(model, Polynomial):
        return {}
    y = samples.deviations[:, target]
    rows = seen & samples.valid & np.isfinite(y)
    columns = [[c.name for c in samples.inputs].index(i.name) for i in model.inputs]
    X = TermTable(len(columns), model.variables, model.terms).evaluate(samples.change()[rows][:, columns])
    residual = y[rows] - X @ np.array(model.coefficients) - model.intercept
    if model.intercept:
        X = np.column_stack([X, np.ones(len(X))])
    n_rows, n_terms = X.shape
    slant = np.abs(X.T @ residual) / (np.linalg.norm(X, axis=0) * max(float(np.linalg.norm(residual)), 1e-300))
    if n_rows <= n_terms or not n_terms or slant.max() > 1e-6:
        return {}
    inverse = np.linalg.pinv(X)
    variance = float(residual @ residual) / (n_rows - n_terms) * (inverse**2).sum(axis=1)
    for k, s in enumerate(slopes):
        # the noise of the cold profile shifts all factors of its test equally
        common = s.shared * float(np.nanmean(s.errors[:, target] ** 2))
        variance = variance + common * inverse[:, samples.test[rows] == k].sum(axis=1) ** 2
    return dict(zip(model.coefficients_by_name(), np.sqrt(variance).tolist(), strict=False))


def _profile_alone(samples: Samples, seen: BoolArray) -> Provenance:
    """Return the provenance of a position model that consists of a cold profile only."""
    tests: Sequence[int] = np.unique(samples.test[seen]).tolist()
    return Provenance(
        method="cold profile alone",
        parameters={},
        data_sha256=tuple(samples.hashes[t] for t in tests),
        cycles=tuple(samples.cycle_names[c] for c in np.unique(samples.cycle[seen])),
        rows=int(seen.sum()),
        version=__version__,
    )


def _provenance(made: Provenance | None, geometric: ProfileFit, options: PositionOptions) -> Provenance | None:
    if made is None:
        return None
    more = {
        "profile": options.profile,
        "order": repr(geometric.order),
        "slopes": repr(options.slopes),
        "offset": repr(options.offset),
        "reference": repr(options.reference),
    }
    return replace(made, parameters={**made.parameters, **more})
