"""Random programs of machines are revised rightly in every state of the controller, or refused, and few are."""

import pytest
from sweeping import WAYS, Counts, sweep

pytestmark = pytest.mark.usefixtures("interpreter")


def right(counts: Counts) -> None:
    print(counts)
    for way in WAYS:
        assert not counts.of(way, "wrong")
        assert not counts.of(way, "report")


@pytest.mark.long
def test_programs_are_right_in_every_state() -> None:
    counts = Counts(list(sweep(range(1, 17))))
    right(counts)
    assert counts.valid >= 15
    assert len(counts.of("coordinates", "revised")) >= 12


@pytest.mark.hours
def test_two_thousand_programs_are_right_in_every_state() -> None:
    counts = Counts(list(sweep(range(1, 2001), processes=2)))
    right(counts)
    assert counts.valid >= 1900
    assert counts.refused("coordinates") <= 0.10
