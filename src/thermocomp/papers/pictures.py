"""Common curves of the studies: curves over the same axis, tests in sequence."""

from collections.abc import Mapping, Sequence

import numpy as np

from thermocomp.papers.study import FloatArray, PlotCurve, Style
from thermocomp.recordings.samples import Samples


def curves(
    x: FloatArray,
    values: Mapping[str, FloatArray],
    style: Style = "line",
    *,
    dashed: Sequence[str] = (),
    points: Sequence[str] = (),
) -> list[PlotCurve]:
    """Return curves over the same x.

    Parameters
    ----------
    x : ndarray of shape (n,)
    values : mapping of str to ndarray of shape (n,)
        Values by label.
    style : {'line', 'dashed', 'points'}
        Style of all other curves.
    """
    styles: dict[str, Style] = dict.fromkeys(dashed, "dashed")
    styles.update(dict.fromkeys(points, "points"))
    return [PlotCurve(label, x, y, styles.get(label, style)) for label, y in values.items()]


def end_to_end(samples: Samples, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Place tests one after another on a time axis, with a break in the line between them.

    Parameters
    ----------
    values : ndarray of shape (n_rows,)

    Returns
    -------
    hours, values : ndarray of shape (n_rows + n_tests - 1,)
        With nan between two tests.
    """
    x: list[FloatArray] = []
    y: list[FloatArray] = []
    begin = 0.0
    for test in dict.fromkeys(samples.test.tolist()):
        mine = samples.test == test
        if x:
            x.append(np.array([begin]))
            y.append(np.array([np.nan]))
        x.append(begin + samples.time[mine] / 3600.0)
        y.append(values[mine])
        begin = float(x[-1][-1])
    return np.concatenate(x), np.concatenate(y)
