"""A model with merged lags predicts what the model predicts, from less memory."""

import numpy as np
import pytest
from drawnfamilies import MAKERS
from drawnmodels import draw_compensator

from thermocomp.core.expression import Constant, Difference, Input, Lag, Named, PacedLag, Product, Sum
from thermocomp.core.layers import Layers
from thermocomp.core.merging import merge_lags

ONE, OTHER = Input(0, "a"), Input(1, "b")


def test_lags_of_one_time_constant_become_one() -> None:
    slow, fast = 900.0, 90.0
    node = Sum(
        (
            Constant(2.0),
            Product((Constant(3.0), Lag(ONE, slow))),
            Difference(Named("part", Product((Constant(0.5), Lag(OTHER, slow)))), Lag(ONE, fast)),
            Product((Constant(-1.5), PacedLag(ONE, 900.0, 90.0, OTHER))),
            PacedLag(OTHER, 900.0, 90.0, OTHER),
            Product((ONE, OTHER)),
        )
    )
    whole, merged = Layers([node], 2), Layers([merge_lags(node)], 2)
    assert (whole.n_memory, merged.n_memory) == (5, 3)
    rng = np.random.default_rng(0)
    changes, steps = rng.uniform(0.0, 1.0, (50, 4, 2)), rng.uniform(0.0, 300.0, 50)
    found = [layers.run(layers.begin(changes[0]), changes, steps)[1] for layers in (whole, merged)]
    assert found[0] == pytest.approx(found[1], rel=1e-12, abs=1e-12)
    assert np.ptp(found[0]) > 1.0


@pytest.mark.parametrize("seed", range(2 * len(MAKERS)))
def test_every_family_predicts_the_same(seed: int) -> None:
    for model in draw_compensator(seed).compensator.models:
        rng = np.random.default_rng(seed)
        heights = np.array([max(abs(i.low), i.high - i.low, 1.0) for i in model.inputs])
        start = np.array([i.reference for i in model.inputs])
        values = start + rng.uniform(-0.2, 0.8, (40, 3, len(heights))) * heights
        steps, merged = rng.uniform(0.0, 400.0, 40), model.merged()
        one, other = (m.run(m.init(start), values, steps.copy()) for m in (model, merged))
        assert other.deviation == pytest.approx(one.deviation, rel=1e-9, abs=1e-9)
        assert (other.outside == one.outside).all()
        assert merged.run(other.state, values, steps).deviation == pytest.approx(
            model.run(one.state, values, steps).deviation, rel=1e-9, abs=1e-9
        )
