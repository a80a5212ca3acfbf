"""The programs that come with LinuxCNC (package linuxcnc-uspace), and what needs them."""

from pathlib import Path

import pytest

PROGRAMS = Path("/usr/share/linuxcnc/ncfiles")

needs_programs = pytest.mark.usefixtures("interpreter")  # they are in its package
