"""Results of probings on the running machine: a control chart of the model errors, with an action limit."""

import math
from typing import NamedTuple

from thermocomp.core.correction import Deviation
from thermocomp.runtime.adaptation import Adaptation, Probing

#: standard deviations at which the chart asks for action
ACTION = 3.0
#: probings that are kept to be shown
KEPT = 200


class Checked(NamedTuple):
    """A probing compared with the prediction for its instant."""

    time: float  #: of the machine, seconds since 1970
    target: str
    predicted: float  #: where it was probed, without it [um]
    residual: float  #: measured minus predicted [um]
    limit: float  #: beyond it the cause has to be looked for [um]
    refused: str  #: why it was not used; empty if it was

    @property
    def beyond(self) -> bool:
        """Whether it is beyond the action limit."""
        return not abs(self.residual) <= self.limit


def check(
    time: float, target: str, probing: Probing, predicted: Deviation, learned: Adaptation | None, refused: str
) -> Checked:
    """Return the comparison of a probing with the prediction.

    Parameters
    ----------
    time : float
        Time of the machine [s].
    target : str
    probing : Probing
    predicted : Deviation
        For its instant, without it.
    learned : Adaptation or None
        After it: knows the size of the error that was to be expected.
    refused : str
    """
    size = math.nan if learned is None else learned.size
    limit = ACTION * math.hypot(size, probing.repeatability)
    said = predicted.at(probing.position)
    return Checked(
        time=time, target=target, predicted=said, residual=probing.deviation - said, limit=limit, refused=refused
    )
