"""Random sensor error given to models as they are (H-18)."""

from dataclasses import replace
from typing import Literal

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

from thermocomp.core.exceptions import FitError, InputError
from thermocomp.core.polynomial import Polynomial
from thermocomp.core.terms import Variable
from thermocomp.judging.replay import replay
from thermocomp.judging.sensitivity import sensitivity
from thermocomp.models.grouping import CorrelationGrouping
from thermocomp.models.numerics.leastsquares import lstsq
from thermocomp.models.training import train
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack
from thermocomp.virtual.datasets import record

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


def everything(samples: Samples) -> BoolArray:
    return np.ones(len(samples), dtype=np.bool_)


def ols_of(samples: Samples) -> Polynomial:
    model = train("ols", samples, 0, everything(samples)).model
    assert isinstance(model, Polynomial)
    return model


def test_r_squared_is_that_of_disturbed_readings(recording: Recording) -> None:
    # absolute temperatures, so that nothing but the reading itself has the error
    samples = stack([recording], ["z_um"], ["t1_C", "t2_C", "t3_C"], rezero=False)
    model = ols_of(samples)
    wide = replace(model, inputs=tuple(replace(i, low=-1e6, high=1e6) for i in model.inputs))
    rows = samples.time > 20_000
    found = sensitivity({"ols": wide}, samples, rows, size=0.3, draws=200)["ols"]
    y = samples.deviations[rows, 0]
    clean = samples.values[rows] @ np.array(model.coefficients) + model.intercept
    total = np.sum((y - y.mean()) ** 2)
    assert found.r_squared == pytest.approx(1 - np.sum((y - clean) ** 2) / total, rel=1e-9)
    # expected loss: n sum(b^2) var / total, and its spread over the draws; uniform within +-s has the variance s^2/3
    loss = rows.sum() * np.sum(np.square(model.coefficients)) * 0.3**2 / 3 / total
    assert found.draws.shape == (200,)
    assert found.r_squared - found.mean == pytest.approx(loss, rel=0.05)
    assert found.std == pytest.approx(np.std(found.draws, ddof=1))
    normal = sensitivity({"ols": wide}, samples, rows, size=0.3, law="normal", draws=200)["ols"]
    assert found.r_squared - normal.mean == pytest.approx(3 * loss, rel=0.05)


def test_all_models_have_the_same_error(samples: Samples) -> None:
    rows = everything(samples)
    model = ols_of(samples)
    turned = replace(
        model,
        joint=None,  # it is of the inputs in their order
        inputs=model.inputs[::-1],
        variables=tuple(replace(v, weights=((2 - k, 1.0),)) for k, v in enumerate(model.variables)),
    )
    held = replace(model, support=replace(model.support, policy="hold"))
    found = sensitivity({"a": model, "turned": turned, "held": held}, samples, rows, size=0.01, draws=20)
    np.testing.assert_allclose(found["turned"].draws, found["a"].draws, rtol=1e-9)
    assert np.ptp(found["a"].draws) > 0
    less = replace(model, joint=None)
    one = replace(less, inputs=model.inputs[:1], variables=model.variables[:1], terms=((0,),), coefficients=(1.0,))
    padded = replace(model, coefficients=(1.0, 0.0, 0.0))
    found = {**found, **sensitivity({"one": one, "padded": padded}, samples, rows, size=0.01, draws=20)}
    np.testing.assert_allclose(found["one"].draws, found["padded"].draws, rtol=1e-9)
    alone = sensitivity({"turned": turned}, samples, rows, size=0.01, draws=20)["turned"]
    assert np.array_equal(alone.draws, found["turned"].draws)
    # also for one whose every reading counts, not only those that are judged
    few = np.arange(len(samples)) % 7 == 3
    some = sensitivity({"a": model, "held": held}, samples, few, size=0.01, draws=20)
    assert np.array_equal(some["held"].draws, some["a"].draws)
    other = sensitivity({"a": model}, samples, rows, size=0.01, draws=20, seed=1)["a"]
    assert not np.array_equal(other.draws, found["a"].draws)


@pytest.mark.parametrize("name", ["ols", "dynamic"])
def test_no_error_is_the_replay(recording: Recording, name: str) -> None:
    table = recording.table.copy()
    table.loc[100:110, "t2_C"] = np.nan  # not to be read: the last deviation is held
    table.loc[300, "z_um"] = np.nan  # not to be judged
    samples = stack([recording, replace(recording, name="again", table=table)], ["z_um"])
    rows = samples.test == 1
    model = train(name, samples, 0, everything(samples)).model
    found = sensitivity({name: model}, samples, rows, size=0.0, draws=3)[name]
    judged = rows & np.isfinite(samples.deviations[:, 0])
    y = samples.deviations[judged, 0]
    expected = 1 - np.sum((y - replay(model, samples, judged)[0]) ** 2) / np.sum((y - y.mean()) ** 2)
    np.testing.assert_allclose([found.r_squared, *found.draws], expected, rtol=1e-12)
    assert found.std == pytest.approx(0, abs=1e-15)


def judged_by_engineers(samples: Samples) -> Polynomial:
    """H-13: T6, T7, T13 and their squares, as differences from T14."""
    places = [5, 6, 12]
    differences = samples.change()[:, places] - samples.change()[:, [13]]
    fit = lstsq(np.column_stack([differences, differences**2]), samples.deviations[:, 0])
    names = [c.name for c in samples.inputs]
    return Polynomial(
        target="z_um",
        unit="um",
        inputs=samples.model_inputs([*places, 13], everything(samples)),
        variables=tuple(Variable(f"{names[i]}-{names[13]}", ((k, 1.0), (3, -1.0))) for k, i in enumerate(places)),
        terms=((0,), (1,), (2,), (0, 0), (1, 1), (2, 2)),
        coefficients=tuple(fit.coefficients.tolist()),
        intercept=fit.intercept,
    )


@pytest.mark.parametrize("seed", range(3))
def test_a_linear_model_is_more_robust_than_a_quadratic_one(seed: int) -> None:
    # H-18, on the virtual machine; the temperatures as they are, as in the paper
    (test,) = record("hwang", seed=seed)
    samples = stack([test], ["z_um"], [c.name for c in test.temperatures], rezero=False)
    T, rows = pd.DataFrame(samples.change(), columns=[c.name for c in samples.inputs]), everything(samples)
    chosen = CorrelationGrouping(reference="t_bed_rear_C").fit(T, samples.deviations[:, 0])
    linear = chosen.freeze(target="z_um", inputs=samples.model_inputs(range(14), rows))
    quadratic = judged_by_engineers(samples)
    errors: list[tuple[float, Literal["uniform", "normal"]]] = [(0.05, "normal"), (0.1, "normal"), (0.4, "uniform")]
    for size, law in errors:
        found = sensitivity({"linear": linear, "quadratic": quadratic}, samples, rows, size=size, law=law)
        assert found["linear"].draws.shape == (100,)
        assert found["linear"].std < found["quadratic"].std
        assert found["linear"].r_squared == pytest.approx(chosen.r_squared_)


def test_bad_input(samples: Samples) -> None:
    rows, model = everything(samples), ols_of(samples)
    with pytest.raises(InputError, match="found models of x_um, z_um"):
        sensitivity({"a": model, "b": replace(model, target="x_um")}, samples, rows)
    with pytest.raises(InputError, match="found models of none"):
        sensitivity({}, samples, rows)
    with pytest.raises(InputError, match="y_um was not recorded; there are z_um, x_um"):
        sensitivity({"a": replace(model, target="y_um")}, samples, rows)
    for settings in ({"size": -0.1}, {"size": np.nan}, {"draws": 1}, {"law": "cauchy"}):
        with pytest.raises(InputError, match="expected uniform or normal, a size >= 0 and >= 2 draws"):
            sensitivity({"a": model}, samples, rows, **settings)
    with pytest.raises(FitError, match="z_um does not change in the 0 rows"):
        sensitivity({"a": model}, samples, ~rows)
    with pytest.raises(FitError, match="z_um does not change in the 1 rows"):
        sensitivity({"a": model}, samples, np.arange(len(samples)) == 5)
