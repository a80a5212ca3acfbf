"""What profiles tell of their model: powers, offset, reference position; and the cold profile alone."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray
from profilemachine import EQ6, along_y, profiles, states

from thermocomp.core.exceptions import FitError
from thermocomp.core.machine import Channel
from thermocomp.recordings.profiles import Profiles
from thermocomp.volumetric.models.position import PositionOptions, fit_position
from thermocomp.volumetric.models.positionoptions import fill_options

FloatArray = NDArray[np.float64]


def found(made: Profiles) -> tuple[int, bool, float | None]:
    options = fill_options(made)
    return options.slopes, options.offset, options.reference_position


def warmed(thermal: FloatArray, noise: float = 0.1) -> Profiles:
    """Return profiles of 12 points: Eq. 6 and a thermal part (72, 12)."""
    values = EQ6(np.linspace(0.0, 550.0, 12)) + thermal
    values = values + noise * np.random.default_rng(5).normal(size=values.shape)
    return Profiles("EYY", "um", "Y", along_y(np.linspace(0.0, 550.0, 12)), values, states())


def warmth() -> FloatArray:
    table = states().table
    return np.asarray((table - table.iloc[0]).to_numpy()[:, 0])


def test_a_straight_law_a_bent_one_and_noise() -> None:
    assert found(profiles(noise=0.1)) == (1, False, 0.0)
    assert found(profiles(noise=0.1, second=20.0))[:2] == (2, False)
    assert found(warmed(np.zeros((72, 12)), noise=0.3))[:2] == (0, False)


@pytest.mark.parametrize("zero", [0.0, 250.0, 550.0])
def test_a_laser_that_was_set_to_zero_somewhere(zero: float) -> None:
    q = 1e-3 * (np.linspace(0.0, 550.0, 12) - zero)
    assert found(warmed(np.outer(3 * warmth(), q))) == (1, False, zero)
    # a bend is no shift
    assert found(warmed(np.outer(3 * warmth(), q) + np.outer(warmth(), 8 * q**2)))[1:] == (False, zero)


def test_profiles_that_shift() -> None:
    made = warmed(np.outer(warmth(), np.ones(12)))
    options = fill_options(made)
    assert (options.slopes, options.offset) == (0, True)
    fit = fit_position(made, replace(options, method="ols"))
    assert fit.model.powers == (0,)
    assert fit.model.slopes == ()
    assert fit.model.offset is not None
    assert fit.model.offset.coefficients_by_name()["t1_C"] == pytest.approx(1.0, abs=0.02)
    q = np.linspace(-0.2, 0.35, 12)
    # nowhere still within the travel: the line crosses zero 1 m further on
    far = fill_options(warmed(np.outer(warmth(), 1.0 + q)))
    assert (far.slopes, far.offset) == (1, True)


def test_what_is_given_stays() -> None:
    made = profiles(noise=0.1, second=20.0)
    given = PositionOptions(slopes=1, offset=True, reference_position=100.0)
    assert fill_options(made, given, ()) == given
    assert fill_options(made, given, ("slopes",)) == replace(given, slopes=2)
    assert fill_options(made, given, ("reference_position",)).slopes == 1
    assert fill_options(made, replace(given, offset=False, slopes=2), ("offset",)).reference_position == 100.0


def test_only_states_that_may_be_learned_from_are_looked_at() -> None:
    straight, bent = profiles(noise=0.1), profiles(noise=0.1, second=20.0)
    learn = np.arange(72) < 48
    later = replace(straight, values=np.where(learn[:, None], straight.values, bent.values))
    assert fill_options(later).slopes == 2
    assert fill_options(later, learn=learn) == fill_options(straight, learn=learn)
    assert fill_options(later, learn=learn).slopes == 1
    with pytest.raises(FitError, match="no thermal state is left for training"):
        fill_options(later, learn=np.zeros(72, dtype=np.bool_))


def test_days_of_one_cold_state_are_looked_at_as_they_are_fitted() -> None:
    """Two mornings apart by a slope, each day without any: only from one cold state is there a thermal part."""
    q = 1e-3 * np.linspace(0.0, 550.0, 12)
    days = [warmed(np.outer(np.full(72, size), q)) for size in (-20.0, 20.0)]
    assert fill_options(days).slopes == 0
    assert fill_options(days, PositionOptions(rezero=False)).slopes == 1


def test_the_cold_profile_alone() -> None:
    made = profiles(noise=0.05)
    fit = fit_position(made, PositionOptions(slopes=0))
    assert not [*fit.model.models, *fit.trained, *fit.coefficient_errors]
    assert fit.model.at(along_y(np.array([200.0])), np.array([])) == pytest.approx(EQ6(200.0), abs=0.1)
    assert fit.thermal_rms == pytest.approx(fit_position(made, PositionOptions(method="ols")).thermal_rms)
    prov = fit.model.provenance
    assert prov is not None
    assert (prov.method, prov.rows, prov.data_sha256) == ("cold profile alone", 72, (made.fingerprint,))
    assert prov.parameters["slopes"] == "0"


def test_tables_of_many_columns_are_no_trouble() -> None:
    """Warnings are errors here, and pandas warns of adding columns to a table that was put together from many."""
    made = profiles()
    more = {f"other_{k}_um": np.zeros(72) for k in range(150)}
    table = pd.DataFrame({**{str(c): made.states.table[c].to_numpy() for c in made.states.table}, **more}, copy=False)
    channels = (*made.states.channels, *(Channel(name, "displacement", "um") for name in more))
    wide = replace(made, states=replace(made.states, table=table, channels=channels))
    slim, fat = (fit_position(p, PositionOptions(method="ols")) for p in (made, wide))
    assert fat.model.slopes[0].coefficients_by_name() == slim.model.slopes[0].coefficients_by_name()
