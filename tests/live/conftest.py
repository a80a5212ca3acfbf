"""Fixtures of the tests of the service."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from broker import Mosquitto


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Mosquitto]:
    """Return a running mosquitto."""
    found = Mosquitto(tmp_path)
    found.start()
    yield found
    found.kill()
