"""Boosted trees: what the publishers of fl_thermal tried, in scikit-learn's form."""

from sklearn.ensemble import HistGradientBoostingRegressor

SUMMARY = "scikit-learn's boosted trees on the temperatures of the moment, its own settings"


def estimator() -> HistGradientBoostingRegressor:
    return HistGradientBoostingRegressor(random_state=0)
