"""A model of the small machine with a watch, as if judged with sensors lost; and recordings in which they fail."""

from dataclasses import replace
from functools import cache

import numpy as np
from driftmodels import ACCEPTED
from smallmachine import small_machine

from thermocomp.core.model import ErrorModel
from thermocomp.models.training import train
from thermocomp.models.watching import find_watch
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.stacking import stack

#: with t3_C it does harm; it was never judged with t2_C and t3_C lost together
LOST = {"t1_C": 1.5, "t2_C": 2.5, "t3_C": 9.0, "t1_C, t2_C": 3.0, "t1_C, t3_C": 9.5}


@cache
def watched_model(target: str = "z_um") -> ErrorModel:
    """Return a model of the small machine that may run without t1_C and t2_C, and not without t3_C."""
    samples = stack([small_machine()], [target])
    every = np.ones(len(samples), np.bool_)
    found = train("averaged", samples, 0, every).model
    judged = replace(ACCEPTED, lost=LOST, rms=1.25, none_rms=5.0)
    return replace(found, watch=find_watch(samples, every), honest_error=judged)


def failing(**cuts: tuple[float, float | None]) -> Recording:
    """Return a day of the small machine that begins at rest; from an hour on sensors are off by so much, or missing."""
    day = small_machine((0.0, 2500.0, 1800.0, 3000.0), seed=5)
    table = day.table.copy()
    for name, (hour, step) in cuts.items():
        later = day.time >= hour * 3600
        table.loc[later, name] = np.nan if step is None else table.loc[later, name] + step
    return replace(day, name="failing", table=table)
