"""`SensorSelector`: scikit-learn's contract, what is kept, and that it chooses what the method chooses."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from sklearn import config_context
from sklearn.pipeline import make_pipeline
from sklearn.utils.estimator_checks import parametrize_with_checks
from smallmachine import crowded_machine

from thermocomp.core.exceptions import InputError
from thermocomp.models.grouping import CorrelationGrouping
from thermocomp.models.partial_f import PartialF
from thermocomp.models.ridge import Ridge
from thermocomp.models.sensors import SELECTORS, SensorSelector
from thermocomp.models.subsets import BestSubset
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack

LOOSE = PartialF(f_enter=0.1, f_delete=0.05)  # the checks bring columns that tell nothing


@pytest.fixture(scope="module")
def crowded() -> Samples:
    return stack([crowded_machine()], ["z_um"])


@parametrize_with_checks(  # type: ignore[untyped-decorator]
    [
        SensorSelector(LOOSE),
        SensorSelector("subsets"),
        SensorSelector(CorrelationGrouping(threshold=0.95)),
    ]
)
def test_contract_of_scikit_learn(estimator: Any, check: Callable[[Any], None]) -> None:
    check(estimator)


@pytest.mark.parametrize("method", SELECTORS)
def test_it_chooses_what_the_method_chooses(method: str, crowded: Samples) -> None:
    X, y = crowded.frame(), crowded.deviations[:, 0]
    found = SensorSelector(method, keep=["spindle_rpm"]).fit(X, y)
    temperatures = X.drop(columns="spindle_rpm")
    alone: Any = SELECTORS[method]()
    chosen = alone.fit(temperatures, y).freeze(target="z").sensors
    assert set(found.get_feature_names_out()) == {*chosen, "spindle_rpm"}
    assert found.transform(X).shape == (len(X), len(chosen) + 1)
    assert found.get_support(indices=True).tolist() == np.flatnonzero(found.get_support()).tolist()


def test_settings_of_its_own(crowded: Samples) -> None:
    X, y = crowded.frame().drop(columns="spindle_rpm"), crowded.deviations[:, 0]
    for size in (1, 2, 3):
        assert SensorSelector(BestSubset(size=size)).fit(X, y).get_support().sum() == size
    from_ambient = SensorSelector(CorrelationGrouping(reference="t3_C")).fit(X, y)
    assert "t3_C" in from_ambient.get_feature_names_out()  # what is subtracted is needed too
    assert not SensorSelector(PartialF(f_enter=1e9, f_delete=1.0)).fit(X, y).get_support().any()


def test_the_time_is_kept_and_not_asked_about(crowded: Samples) -> None:
    X, y = crowded.frame(), crowded.deviations[:, 0]
    timed = X.copy()
    timed.insert(0, "time_s", crowded.time)
    plain = SensorSelector("partial-f").fit(X, y)
    found = SensorSelector("partial-f", time="column").fit(timed, y)
    assert found.get_feature_names_out().tolist() == ["time_s", *plain.get_feature_names_out()]
    one = SensorSelector(BestSubset(size=1), time="column").fit(timed, y)
    assert one.get_support()[0]
    assert one.get_support().sum() == 2


def test_cycles_by_routing(crowded: Samples) -> None:
    X, y = crowded.frame().drop(columns="spindle_rpm"), crowded.deviations[:, 0]
    with config_context(enable_metadata_routing=True):
        selector = SensorSelector(BestSubset(criterion="cycles")).set_fit_request(cycle=True)
        pipeline = make_pipeline(selector, Ridge().set_fit_request(cycle=True)).fit(X, y, cycle=crowded.cycle)
    assert pipeline[0].estimator_.chosen_by_ == BestSubset(criterion="cycles").fit(X, y, cycle=crowded.cycle).chosen_by_
    assert "thermal cycles" in pipeline[0].estimator_.chosen_by_


def test_bad_settings(crowded: Samples) -> None:
    X, y = crowded.frame(), crowded.deviations[:, 0]
    for wrong, message in (
        (SensorSelector("best"), "method 'best': expected one of grouping, partial-f"),
        (SensorSelector(keep=["t99"]), "keep 't99': no such column; the columns are t1_C"),
        (SensorSelector(keep=[70]), "keep 70: expected an index from 0 to 6"),
        (SensorSelector(keep=list(X.columns)), "keep contains every column"),
        (SensorSelector(time="routed"), "time='routed': expected 'column' or None"),  # type: ignore[arg-type]
    ):
        with pytest.raises(InputError, match=message):
            wrong.fit(X, y)
