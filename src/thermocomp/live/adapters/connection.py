"""What connections share: how one is, and since when."""

import time
from dataclasses import dataclass, field
from typing import Literal

from thermocomp.core.ports import Status


@dataclass
class Connection:
    """How a connection is.

    Parameters
    ----------
    now : Status
    """

    now: Status = field(default=Status("closed"))

    def to(self, state: Literal["closed", "connecting", "connected", "failed"], reason: str = "") -> None:
        """Say how it is from now on."""
        if (self.now.state, self.now.reason) != (state, reason):
            self.now = Status(state, reason, time.time())
