"""What connections share: how one is, and since when."""

import time
from dataclasses import dataclass, field
from typing import Literal

from thermocomp.core.ports import LinkStatus


@dataclass
class Connection:
    """How a connection is.

    Parameters
    ----------
    now : LinkStatus
    """

    now: LinkStatus = field(default=LinkStatus("closed"))

    def to(self, state: Literal["closed", "connecting", "connected", "failed"], reason: str = "") -> None:
        """Say how it is from now on."""
        if (self.now.state, self.now.reason) != (state, reason):
            self.now = LinkStatus(state, reason, time.time())
