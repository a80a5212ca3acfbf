"""Defaults that are the papers' own, typed from the papers: whoever takes a method as it is takes the paper's."""

import inspect
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from thermocomp.judging.sensitivity import sensitivity
from thermocomp.models.ace import ACE, half_window
from thermocomp.models.arx import ARX
from thermocomp.models.arx_net import NetARX
from thermocomp.models.grouping import CorrelationGrouping
from thermocomp.models.kernels import backprop as kernel
from thermocomp.models.mlp import SigmoidNet
from thermocomp.models.numerics import backprop
from thermocomp.models.numerics.backprop import scaling_in, train_net
from thermocomp.models.numerics.stepwise import AlphaThresholds, FThresholds
from thermocomp.models.partial_f import PartialF
from thermocomp.models.second_order import SecondOrderRegression
from thermocomp.models.selection.equivalents import equivalents
from thermocomp.models.selection.maximal_correlation import maximal_correlations
from thermocomp.models.sir import SlicedInverse

#: class or function, parameter, printed value, requirement and place
DEFAULTS: tuple[tuple[Callable[..., Any], str, object, str], ...] = (
    # Chen, Yuan, Ni 1996
    (AlphaThresholds, "enter", 0.001, "C-15, Fig. 2"),
    (AlphaThresholds, "remove", 0.015, "C-15, Fig. 2"),
    (SecondOrderRegression, "alpha_enter", 0.001, "C-15, Fig. 2"),
    (SecondOrderRegression, "alpha_remove", 0.015, "C-15, Fig. 2"),
    (SecondOrderRegression, "fit_intercept", False, "C-09, Eq. 4 has no constant"),
    (SecondOrderRegression, "second_order", True, "C-09, Eq. 4"),
    (SecondOrderRegression, "hierarchy", False, "C-21, Eq. 5 has squares without their factors"),
    (SigmoidNet, "hidden", 20, "C-26, section 4.2"),
    (SigmoidNet, "learning_rate", 0.5, "C-29, section 4.2"),
    (SigmoidNet, "update", "pattern", "C-30, section 4.2"),
    (SigmoidNet, "scaling", "channel", "C-28, section 4.2"),
    (SigmoidNet, "momentum", 0.0, "C-29: no momentum is mentioned"),
    (train_net, "update", "pattern", "C-30, section 4.2"),
    (train_net, "momentum", 0.0, "C-29: no momentum is mentioned"),
    # Wessel et al. 2004
    (ACE, "half_window", 10, "W-04, Appendix A"),
    (ACE, "window_share", None, "W-04, Appendix A: a fixed half window"),
    (ACE, "neighbours", 2, "W-05, section III"),
    (ACE, "tolerance", 0.0, "W-03, Appendix A: until the error fails to decrease"),
    (ACE, "converged", False, "W-03, Appendix A"),
    (maximal_correlations, "half_window", 10, "W-04, Appendix A"),
    (equivalents, "level", 0.05, "W-11; E-W6: not printed, the usual one"),
    (equivalents, "holm", False, "W-11; E-W6"),
    # Hwang, Lee, Yang
    (CorrelationGrouping, "absolute", False, "H-03, section 2.1: the smallest coefficient, signed (E-H2)"),
    (CorrelationGrouping, "fit_intercept", True, "H-04, Eq. 2 and 6"),
    (sensitivity, "draws", 100, "H-18, section 3.2.4"),
    # Precompensation
    (ARX, "criterion", "fpe", "P-02"),
    (ARX, "interval", 600.0, "P-06: every 10 min"),
    (NetARX, "interval", 600.0, "P-06: every 10 min"),
    (NetARX, "k", 1, "P-02"),
    (NetARX, "m", 0, "P-02"),
    # Open Mech. Eng. J. 11, 2017
    (FThresholds, "enter", 100.0, "T-03, section 3.2"),
    (FThresholds, "delete", 50.0, "T-03, section 3.2"),
    (PartialF, "f_enter", 100.0, "T-03, section 3.2"),
    (PartialF, "f_delete", 50.0, "T-03, section 3.2"),
    (PartialF, "fit_intercept", True, "T-04, Eq. 2 has a constant"),
    (SlicedInverse, "directions", 5, "T-10, introduction: Zhang, from 29 to 5"),
)


@pytest.mark.parametrize(
    ("owner", "parameter", "printed"), [d[:3] for d in DEFAULTS], ids=lambda v: getattr(v, "__name__", str(v))
)
def test_a_default_is_the_paper_s(owner: Callable[..., Any], parameter: str, printed: object) -> None:
    assert inspect.signature(owner).parameters[parameter].default == printed


def test_initial_weights_fill_the_range_of_the_paper(monkeypatch: pytest.MonkeyPatch) -> None:
    """C-29: random numbers between -0.3 and 0.3; 263 of a 9-20-3 net, 40 times, before any training."""
    monkeypatch.setattr(kernel, "train", lambda *_: np.zeros(1))
    rng = np.random.default_rng(0)
    inputs, targets = rng.uniform(0.1, 0.9, (2, 9)), rng.uniform(0.1, 0.9, (2, 3))
    drawn = []
    for seed in range(40):
        net = train_net(inputs, targets, 20, rng=np.random.default_rng(seed), rates=np.ones(1)).net
        layers = (net.hidden_weights, net.hidden_thresholds, net.output_weights, net.output_thresholds)
        drawn.append(np.concatenate([np.ravel(layer) for layer in layers]))
    weights = np.array(drawn)
    assert weights.shape == (40, 263)
    # the largest of 10520 such numbers is below 0.2995 in one set of six thousand
    assert 0.2995 < weights.max() <= 0.3
    assert -0.3 <= weights.min() < -0.2995
    assert backprop.INITIAL == 0.3


def test_scaling_is_that_of_the_paper() -> None:
    """C-28: between 0.1 and 0.9."""
    into = scaling_in(np.array([20.0]), np.array([45.0]))
    assert into(np.array([[20.0], [45.0], [32.5]])).ravel() == pytest.approx([0.1, 0.9, 0.5])


def test_the_boxcar_of_199_rows() -> None:
    """W-04, W-06: with the paper's series the window is the paper's 21 points."""
    assert half_window(199, ACE().half_window, ACE().window_share) == 10
