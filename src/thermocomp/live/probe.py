"""Results of probings on the running machine: a control chart of the model errors with an action limit."""

import math
from typing import NamedTuple

from thermocomp.core.correction import Deviation
from thermocomp.runtime.adaptation import Adaptation, Probing

#: action limit of the chart [standard deviations]
ACTION = 3.0
#: number of probings kept for display
KEPT = 200


class Checked(NamedTuple):
    """A probing compared with the prediction for its instant."""

    time: float  #: machine time, seconds since 1970
    target: str
    predicted: float  #: at the probed position, before the probing is used [um]
    residual: float  #: measured minus predicted [um]
    limit: float  #: action limit: beyond it the cause must be found [um]
    refused: str  #: reason why the probing was not used; empty if it was

    @property
    def beyond(self) -> bool:
        """Whether the residual is beyond the action limit."""
        return not abs(self.residual) <= self.limit


def check(
    time: float, target: str, probing: Probing, predicted: Deviation, learned: Adaptation | None, refused: str
) -> Checked:
    """Return the comparison of a probing with the prediction.

    Parameters
    ----------
    time : float
        Machine time [s].
    """
    size = math.nan if learned is None else learned.size
    limit = ACTION * math.hypot(size, probing.repeatability)
    said = predicted.at(probing.position)
    return Checked(
        time=time, target=target, predicted=said, residual=probing.deviation - said, limit=limit, refused=refused
    )
