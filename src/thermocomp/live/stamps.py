"""Time stamps that cannot be right: which error of unit or clock they look like."""

#: powers of ten by which a stamp in another unit differs from seconds
_UNITS = {1e3: "milliseconds", 1e6: "microseconds", 1e9: "nanoseconds", 1 / 60.0: "minutes"}
_YEAR, _QUARTER = 365.25 * 86400.0, 900.0
#: difference from a whole number of quarters of an hour that still counts as one: a clock may be wrong as well [s]
_NEAR = 60.0


def explain_stamp(stamp: float, now: float, most: float) -> str:
    """Return why the time stamp of a reading is not used, with what it looks like; empty if it is within `most`.

    Parameters
    ----------
    stamp, now : float
        Time of the reading, and present time [s since 1970].
    most : float
        Largest permitted difference [s].
    """
    ahead = stamp - now
    if abs(ahead) <= most:
        return ""
    for factor, unit in _UNITS.items():
        if abs(stamp / factor - now) <= _YEAR:
            return f"time {stamp:.15g} looks like {unit}: expected seconds since 1970"
    if abs(stamp) < _YEAR:
        return f"time {stamp:.15g} looks like a time since the start of the device: expected seconds since 1970"
    apart = f"{abs(ahead):,.0f} s {'ahead of' if ahead > 0 else 'behind'} the clock of this computer"
    quarters = round(ahead / _QUARTER)
    if quarters and abs(quarters) <= 4 * 14 and abs(ahead - quarters * _QUARTER) <= min(_NEAR, most):
        return f"time stamps are {apart}, {abs(quarters) / 4:g} h: the source sends local time, or its clock is wrong"
    return f"time stamps are {apart}, where {most:g} s are allowed: set the clock of the source"
