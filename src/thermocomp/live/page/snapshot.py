"""State of a service as plain numbers and text, for the page and for JSON."""

import math
from typing import Any

from thermocomp.core.ports import Probe
from thermocomp.live.links import Link, Outlet
from thermocomp.live.loop import Service
from thermocomp.live.settling import minutes_until
from thermocomp.runtime.lines import DeviationLine


def snapshot(service: Service, settled: float) -> dict[str, Any]:
    """Return the present state of a service.

    Parameters
    ----------
    settled : float
        A drift below this in ten minutes counts as settled [um].

    Returns
    -------
    dict
        The present state; unknown numbers are None.
    """
    said, now, tick = service.said, service.clock.now(), service.clock.tick()
    failed = said.failed if said else {}
    return {
        "time": now,
        "speed": service.clock.speed,
        "settled_um": settled,
        "targets": [_target(service, name, line, settled) for name, line in service.compensator.lines.items()],
        "sensors": [
            {"name": name, "value": value, "age_s": tick - at, "state": failed.get(name, "good")}
            for name, (value, at) in sorted(service.latest.items())
        ],
        "missing": sorted(failed.keys() - service.latest.keys()),
        "left_out": service.latest.left_out,
        "links": [_link(one) for one in service.links()],
        "counts": dict(service.counts),
        "rejected": said.rejected if said else "no reading yet",
        "residuals": [checked._asdict() for checked in service.probings.checked],
        "events": [{"time": e.time, "kind": e.kind, "text": e.text} for e in reversed(service.events)],
    }


def curves(service: Service) -> dict[str, list[float | None]]:
    """Return the curves over time: a list of numbers per curve, ``time`` among them."""
    rows = list(service.curves)
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: [row.get(name) for row in rows] for name in names}


def _target(service: Service, name: str, line: DeviationLine, settled: float) -> dict[str, Any]:
    said, correction = service.said, service.state.corrections[name]
    deviation = said.deviations.get(name) if said else None
    status = said.states.get(name) if said else service.state.orders.get(name)
    reference = service.state.references.get(name)
    rows = [r for r in service.curves if f"{name} predicted" in r]
    left = minutes_until([r["time"] for r in rows], [r[f"{name} predicted"] for r in rows], settled)
    learned = service.state.learned.get(name)
    return {
        "name": name,
        "state": status.word if status else "restarting",
        "reason": status.reason if status else "waits for its first reading",
        "deviation_um": deviation.offset if deviation else None,
        "half_width_um": said.half_widths.get(name) if said else None,
        "correction_um": correction.offset,
        "slope_um_per_m": correction.slope,
        "reference_position_mm": correction.reference_position,
        "axis_travel_mm": list(line.travel),
        "minutes_until_settled": left if math.isfinite(left) else None,
        "settling": _words(left),
        "reference": {"time": reference.time, "why": reference.why} if reference else None,
        "probed": learned is not None and math.isfinite(learned.time),
        "runs": name not in service.compensator.shadow,
    }


def _words(minutes: float) -> str:
    if math.isnan(minutes):
        return "not known yet"
    if math.isinf(minutes):
        return "still growing"
    return "settled" if minutes == 0.0 else f"{max(1.0, minutes):.0f} min"


def _link(one: Link) -> dict[str, Any]:
    kind = "sink" if isinstance(one, Outlet) else "probe" if isinstance(one.end, Probe) else "source"
    status = one.status()
    return {"kind": kind, "name": type(one.end).__name__, "state": status.state, "reason": status.reason}
