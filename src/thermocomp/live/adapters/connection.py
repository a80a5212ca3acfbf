"""Common part of connections: the status and the time of its last change."""

import time
from dataclasses import dataclass, field
from typing import Literal

from thermocomp.core.ports import LinkStatus


@dataclass
class Connection:
    """Status of a source or sink, and the time of its last change."""

    now: LinkStatus = field(default=LinkStatus("closed"))

    def to(self, state: Literal["closed", "connecting", "connected", "failed"], reason: str = "") -> None:
        """Set the status; the time is recorded if the status differs from the previous one."""
        if (self.now.state, self.now.reason) != (state, reason):
            self.now = LinkStatus(state, reason, time.time())
