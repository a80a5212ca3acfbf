"""State of a service as plain numbers and text, for the page and for JSON."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

from thermocomp.core.ports import Probe
from thermocomp.live.links import Link, Outlet
from thermocomp.live.loop import Service
from thermocomp.live.settling import minutes_until
from thermocomp.runtime.lines import DeviationLine
from thermocomp.runtime.state import NO_ZERO, UNKNOWN
from thermocomp.runtime.watchstate import UNSURE

#: states of a target, the one that needs attention most first
ORDER = (
    *("unknown", "first start", "no zero", "not confirmed", "fading", "holding", "suspended", "no sink"),
    *("restarting", "shadow", "sent, not confirmed", "active"),
)


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
    watched = {name for watch in service.compensator.watches for name in watch.failing}
    feed = service.compensator.feed
    repeated = feed.names if feed.explain(service.state.feed) else ()
    unchanged = service.state.feed.repeated >= 1.0 and feed.unchanged(service.state.feed)

    def word(name: str, age: float) -> str:
        if unchanged and name in feed.names:
            return "unchanged"
        if age > service.compensator.limits.reading_age or name in repeated:
            return "stale"
        return "good" if name in watched else "not watched"

    targets = [_target(service, name, line, settled) for name, line in service.compensator.lines.items()]
    alarms = list(find_alarms(service))
    return {
        "time": now,
        "state": _overall(targets, alarms),
        "alarms": alarms,
        "speed": service.clock.speed,
        "settled_um": settled,
        "targets": targets,
        "sensors": [
            {"name": name, "value": value, "age_s": tick - at, "state": failed.get(name) or word(name, tick - at)}
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


def find_alarms(service: Service) -> Iterator[str]:
    """Yield what needs attention: lost links, corrections that differ, sensors, time stamps, files not written."""
    said = service.said
    for name in service.compensator.lines:
        status, there = service.find_status(name)
        if status.word in (*UNKNOWN, NO_ZERO):
            yield f"{name}: {status.word}: {status.reason}"
        if there.word == "not confirmed" and name not in service.compensator.shadow:
            yield f"{name}: not confirmed: {there.reason}"
    for one in service.links():
        if one.refusing:
            yield f"{one.name}: {one.refusing}"
        if (link := one.status()).state == "failed" or (link.state == "closed" and link.reason and not one.ended):
            yield f"{one.name}: {link.reason}"
    yield from service.unread()
    if service.untimely:
        yield f"readings are not used: {service.untimely}"
    if said is not None and said.rejected:
        silent = said.rejected.startswith("no reading")
        yield said.rejected if silent else f"the last reading was rejected: {said.rejected}"
    for name, fault in (said.failed if said else {}).items():
        if fault != UNSURE:  # heat of a moving axis is no failure
            yield f"{name} {fault}"
    if service.keeper.not_saved and service.keeper.configured:
        yield f"the state is not saved: {service.keeper.not_saved}"
    if service.recorder is not None and (trouble := service.recorder.journal.status().reason):
        yield f"journal: {trouble}"


def _overall(targets: Sequence[dict[str, Any]], alarms: Sequence[str]) -> dict[str, str]:
    """Return one state of the whole service, with its reason: that of the target that is worst off, or an alarm."""
    running = [t for t in targets if t["runs"]] or list(targets)
    if not running:
        return {"word": "restarting", "reason": "there is no target"}
    unsent = [t for t in running if t["state"] == "no sink"]
    running = [t for t in running if t not in unsent] or running
    worst = min(running, key=lambda t: ORDER.index(t["state"]) if t["state"] in ORDER else 0)
    if worst["state"] in ("active", "sent, not confirmed") and alarms:
        return {"word": f"{worst['state']}, with an alarm", "reason": alarms[0]}
    told = worst if worst["reason"] else unsent[0] if unsent else None
    return {"word": worst["state"], "reason": f"{told['name']}: {told['reason']}" if told else ""}


def curves(service: Service) -> dict[str, list[float | None]]:
    """Return the curves over time: a list of numbers per curve, ``time`` among them."""
    rows = list(service.curves)
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: [row.get(name) for row in rows] for name in names}


def _target(service: Service, name: str, line: DeviationLine, settled: float) -> dict[str, Any]:
    said, correction = service.said, service.state.corrections[name]
    deviation = said.deviations.get(name) if said else None
    status, there = service.find_status(name)
    reference = service.state.references.get(name)
    rows = [r for r in service.curves if f"{name} predicted" in r]
    left = minutes_until([r["time"] for r in rows], [r[f"{name} predicted"] for r in rows], settled)
    learned = service.state.learned.get(name)
    return {
        "name": name,
        "state": status.word,
        "reason": status.reason,
        "at_controller": {
            "state": there.word,
            "reason": there.reason,
            "correction_um": there.correction.offset if there.correction else None,
            "age_s": there.age,
        },
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
    return {
        "kind": kind,
        "name": one.kind,
        "state": status.state,
        "reason": status.reason,
        "replaced": getattr(one.end, "replaced", 0),
    }
