"""Options of a revision: when the correction is renewed."""

from thermocomp.nc.revision.options import Way


def test_the_times_of_the_correction_are_those_asked_for() -> None:
    """P-06: every ten minutes, as in the paper; otherwise by tolerance alone."""
    assert Way(every="10 min").demand().every == 600.0
    assert Way().demand().every is None
    assert Way(tolerance="2 um").demand().tolerance == 2.0
