"""Boosted trees, as tried by the publishers of fl_thermal, in scikit-learn's implementation."""

from sklearn.ensemble import HistGradientBoostingRegressor

SUMMARY = "scikit-learn's boosted trees on the present temperatures, with default settings"


def estimator() -> HistGradientBoostingRegressor:
    return HistGradientBoostingRegressor(random_state=0)
