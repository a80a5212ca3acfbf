"""State of a compensator as a file: written atomically, bit-exact, refused if damaged or of other models."""

import hashlib
import json
import math
import time
from dataclasses import asdict, dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pydantic import AwareDatetime

from thermocomp.core.arrays import FloatArray
from thermocomp.core.exceptions import InputError, ModelFileError, ThermocompError
from thermocomp.core.thresholds import THRESHOLDS
from thermocomp.core.zero import ZeroMean
from thermocomp.files import jsonfile
from thermocomp.files.modelfile import entry_of, watch_entry
from thermocomp.files.typed import decode, encode, want
from thermocomp.live.storedzero import StateOfOthers, StoredZero, decode_zero, zero_of
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.feed import FeedState
from thermocomp.runtime.state import CompensatorState
from thermocomp.runtime.watchstate import WORDS, WatchState

KIND = jsonfile.Format("thermocomp-state", 5, "state file", "thermocomp serve")


#: maximum magnitude of an error [um]
_LARGEST = 1e6
#: fields of a watch state that are times
_INSTANTS = ("since", "jumped", "off", "still", "moving", "back", "fast")


@dataclass(frozen=True)
class _Stored:
    written: AwareDatetime
    models: str
    state: dict[str, Any]
    zero: dict[str, Any] | None = None
    boot: str = ""  # of the computer, and the time since then: its clock may be set
    uptime: float = 0.0


class _Readings(NamedTuple):
    """Readings of an unknown zero, in a file of version 1."""

    times: tuple[float, ...]
    values: tuple[FloatArray, ...]
    resting: bool


@dataclass(frozen=True)
class Saved:
    """State of a compensator and the time at which it was written.

    Parameters
    ----------
    written : datetime
        In UTC.
    others : StateOfOthers or None
        Zero stored beside the state.
    """

    written: datetime
    state: CompensatorState
    others: StateOfOthers | None = None


def fingerprint(compensator: Compensator) -> str:
    """Return a hash of the models of a compensator, by which a state file is matched to them."""
    entries = [entry_of(m) for m in compensator.models]
    found: list[object] = [list(compensator.lines), entries, [watch_entry(w) for w in compensator.watches]]
    if compensator.thresholds != THRESHOLDS:
        found.append(asdict(compensator.thresholds))
    text = json.dumps(found, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()


def dumps(
    state: CompensatorState, compensator: Compensator, written: datetime, before: StoredZero | None = None
) -> str:
    """Return the text of a state file for a state of the compensator, with its zero; see `zero_of`."""
    if written.tzinfo is None:
        raise InputError(f"state of a compensator: the time of writing {written} has no time zone")
    entry = {
        "written": written.astimezone(UTC).isoformat(),
        "models": fingerprint(compensator),
        "state": encode(state),
        "zero": encode(zero_of(state, compensator, before)),
    }
    if (boot := find_boot()) is not None:
        entry |= {"boot": boot[0], "uptime": boot[1] - (datetime.now(UTC) - written).total_seconds()}
    return jsonfile.pack(KIND, [entry])


def loads(text: str, compensator: Compensator, source: str = "state") -> Saved:
    """Return the state in the text of a state file, or raise an error if it is damaged or of other models."""
    content = jsonfile.unpack(KIND, _Stored, text, source)
    stored = content.models[0]
    if stored.models != fingerprint(compensator):
        raise ModelFileError(
            f"{source}: this state belongs to other models; start without the file, or with the models to which it "
            "belongs"
        )
    try:
        entry = _of_version_1(stored.state) if content.version == 1 else stored.state
        entry = _of_version_3(entry) if content.version <= 3 else entry
        state = decode(CompensatorState, entry, "state")
        if content.version <= 4:  # the resolutions of the temperatures are learned again
            watches = (w._replace(step=np.full_like(w.same, np.inf)) for w in state.watches)
            state = state._replace(watches=tuple(watches))
        _check(state, compensator)
    except (ValueError, InputError) as e:
        raise ModelFileError(f"{source}: not a valid state of these models: {e}; start without the file") from e
    written = _written(stored)
    return Saved(written, compensator.share(state.models, state), decode_zero(stored.zero, written))


def read_zero(path: str | Path) -> StateOfOthers | None:
    """Return the zero in a state file, whatever its models; None if it cannot be used."""
    try:
        text, source = jsonfile.read(KIND, path)
        stored = jsonfile.unpack(KIND, _Stored, text, source).models[0]
    except ThermocompError:
        return None
    return decode_zero(stored.zero, _written(stored))


def find_boot() -> tuple[str, float] | None:
    """Return the id of the present run of this computer, and the time since its start [s]; None if unknown."""
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text("ascii").strip()
        return boot, time.clock_gettime(time.CLOCK_BOOTTIME)
    except (AttributeError, OSError, ValueError):  # other systems
        return None


def _written(stored: _Stored) -> datetime:
    """Return when a state was written, on the present clock, which may have been set; the time since boot is not."""
    boot = find_boot()
    if boot is None or boot[0] != stored.boot or not 0.0 <= stored.uptime <= boot[1]:
        return stored.written
    found = datetime.now(UTC) - timedelta(seconds=boot[1] - stored.uptime)
    return stored.written if abs((found - stored.written).total_seconds()) < 1.0 else found


def _of_version_1(entry: dict[str, Any]) -> dict[str, Any]:
    """Return a state of version 1 with the mean over the readings of an unknown zero in place of these readings."""
    found = {"averaged" if name == "gathered" else name: value for name, value in entry.items()}
    for name, old in found.items():
        if name == "averaged" and isinstance(old, list):
            found[name] = [_mean(readings, f"state.gathered.{k}") for k, readings in enumerate(old)]
        if name == "watches" and isinstance(old, list):
            found[name] = [_watch_of_version_1(watch, f"state.watches.{k}") for k, watch in enumerate(old)]
    return found


def _of_version_3(entry: dict[str, Any]) -> dict[str, Any]:
    """Return a state without the spread of the offset, which is now its size."""
    learned = entry.get("learned")
    if not isinstance(learned, dict) or not all(isinstance(a, dict) for a in learned.values()):
        return entry
    return entry | {"learned": {t: {n: v for n, v in a.items() if n != "spread"} for t, a in learned.items()}}


def _watch_of_version_1(entry: Any, place: str) -> Any:
    if not isinstance(entry, dict):
        return entry
    return {
        "averaged" if name == "gathered" else name: _mean(value, f"{place}.gathered") if name == "gathered" else value
        for name, value in entry.items()
    }


def _mean(entry: Any, place: str) -> Any:
    readings, averaged = decode(_Readings, entry, place), ZeroMean()
    want(len(readings.times) == len(readings.values), None, place, "a time for each reading")
    for at, values in zip(readings.times, readings.values, strict=True):
        want(math.isfinite(at) and not at <= averaged.last, at, f"{place}.times", "increasing numbers")
        averaged = averaged.add(at, values, readings.resting)
    return encode(averaged)


def write(
    state: CompensatorState,
    compensator: Compensator,
    path: str | Path,
    written: datetime,
    before: StoredZero | None = None,
) -> None:
    """Replace the state file; after a kill either the old or the new state is complete. Only its owner may read it."""
    jsonfile.write(dumps(state, compensator, written, before), path, overwrite=True)
    Path(path).chmod(0o600)


def read(path: str | Path, compensator: Compensator) -> Saved:
    """Return the state in a state file; see `loads`."""
    text, source = jsonfile.read(KIND, path)
    return loads(text, compensator, source)


def is_ours(path: Path) -> bool:
    """Return whether an unreadable file was once a state file and may be set aside."""
    try:
        begin = path.read_bytes()[:4096]
    except OSError:
        return False
    return not begin.strip(b"\0 \r\n") or KIND.name.encode() in begin


# -- possible states of these models -----------------------------------------------------------------------------------


def _check(state: CompensatorState, compensator: Compensator) -> None:
    """Raise `ValueError` unless `state` is a valid state of this compensator."""
    cold, lines = compensator.start(), compensator.lines
    want(
        list(state.corrections) == list(lines),
        list(state.corrections),
        "corrections",
        f"corrections of {', '.join(lines)}",
    )
    for name in ("idle", "learned", "references", "raw", "orders", "probed"):
        want(set(getattr(state, name)) <= set(lines), None, name, f"only targets among {', '.join(lines)}")
    most = compensator.limits.magnitude * (1 + 1e-9)
    for target, correction in state.corrections.items():
        largest = max(abs(correction.at(p)) for p in lines[target].travel)
        want(largest <= most, largest, f"corrections.{target}", f"at most {most:g} um")
    for name, number in (("time", state.time), ("clock", state.clock), ("taken", state.taken), ("away", state.away)):
        want(number is None or math.isfinite(number) or name == "away", number, name, "a finite number")
    want(all(0.0 <= v < math.inf for v in state.idle.values()), None, "idle", "times")
    want(all(-math.inf < t < math.inf for k in state.probed.values() for t in k.values()), None, "probed", "times")
    for name in ("models", "averaged", "watches"):
        found, expected = len(getattr(state, name)), len(getattr(cold, name))
        want(found == expected, found, name, f"{expected} of them")
    for k, (model, own, begun) in enumerate(zip(compensator.models, state.models, state.averaged, strict=True)):
        place, n = f"models.{k}", len(model.inputs)
        _alike(own.reference, (n,), f"{place}.reference", finite=False)
        memory = model.step(model.init(np.zeros(n)), np.zeros(n), 0.0)[0].memory
        if own.memory is not None and memory is not None:
            _alike(own.memory, memory.shape, f"{place}.memory")
            _alike(own.reference, (n,), f"{place}.reference")
        _alike(own.deviation, (), f"{place}.deviation")
        _alike(own.outside, (n,), f"{place}.outside")
        _check_averaged(begun, n, f"averaged.{k}")
    for k, (watch, seen, first) in enumerate(zip(compensator.watches, state.watches, cold.watches, strict=True)):
        _check_watch(seen, first, len(watch.inputs), f"watches.{k}")
    _check_feed(state.feed, [w.predicted.shape for w in cold.watches])
    for target, learned in state.learned.items():
        place, n = f"learned.{target}", learned.mean.size
        _alike(learned.mean, (n,), f"{place}.mean")
        _alike(learned.covariance, (n, n), f"{place}.covariance")
        sound = n >= 1 and np.linalg.eigvalsh(learned.covariance).min() >= -1e-6 * max(
            np.trace(learned.covariance), 1.0
        )
        sizes = 0.0 < learned.size <= _LARGEST
        want(bool(sound) and sizes, None, place, "a mean with its covariance")
        want(
            learned.most > 0.0 and 0.0 < learned.usual <= 100.0,
            None,
            place,
            "positive bounds of the effect of a probing",
        )
        models = compensator.models[lines[target].models]
        known = {1, 1 + len(getattr(models[0], "spread", ()))} if len(models) == 1 else {1}
        want(n in known, n, f"{place}.mean", f"{max(known)} numbers")


def _check_watch(seen: WatchState, first: WatchState, n: int, place: str) -> None:
    """Raise `ValueError` unless `seen` is a valid state of a watch with the initial state `first`."""
    for name, value in seen._asdict().items():
        if isinstance(value, np.ndarray):
            # fields used in predictions are always numbers; instants may be unknown
            sure = name in ("reference", "memory", "traces", "used", "predicted", "usual", "bridge")
            _alike(value, getattr(first, name).shape, f"{place}.{name}", finite=sure and not np.isnan(seen.time))
    for name, value in seen.heat._asdict().items():
        sure = name not in ("since", "doubt", "gone", "back") and not np.isnan(seen.time)
        _alike(value, getattr(first.heat, name).shape, f"{place}.heat.{name}", finite=sure)
    times = [
        *(getattr(seen, name) for name in _INSTANTS),
        seen.heat.since,
        seen.heat.doubt,
        seen.heat.gone,
        seen.heat.back,
    ]
    instants = np.concatenate([np.ravel(t) for t in times])
    known = instants[np.isfinite(instants)]
    want(not known.size or known.max() <= seen.time, None, place, "no instant later than its last update")
    want(bool(np.isfinite(seen.since[seen.fault > 0]).all()), None, f"{place}.since", "the time of each failure")
    faults = np.append(seen.fault, seen.heat.fault)
    want(bool(((faults >= 0) & (faults < len(WORDS))).all()), None, f"{place}.fault", "a known fault")
    _check_averaged(seen.averaged, n, f"{place}.averaged")


def _check_feed(feed: FeedState, shapes: list[tuple[int, ...]]) -> None:
    counts = (feed.repeated, feed.changes, feed.usual, feed.longest, feed.waited, *feed.steps)
    want(all(0.0 <= v < math.inf for v in counts), None, "feed", "counts and times")
    want(all(map(math.isfinite, (*feed.values, feed.counter))), None, "feed.values", "finite numbers")
    want(len(feed.steps) == len(feed.values), len(feed.steps), "feed.steps", "one for each temperature")
    want(not feed.predicted or len(feed.predicted) == len(shapes), None, "feed.predicted", "one for each watch")
    for k, (found, shape) in enumerate(zip(feed.predicted, shapes, strict=False)):
        _alike(found, shape, f"feed.predicted.{k}")


def _check_averaged(averaged: ZeroMean, n: int, place: str) -> None:
    first, before, last, recent = averaged.first, averaged.before, averaged.last, averaged.recent
    if not recent:
        return
    ordered = first <= before < last if len(recent) > 1 else first == last
    want(len(recent) <= 2 and ordered and math.isfinite(last - first), None, place, "times of its last two readings")
    want(0.0 <= averaged.weight <= 2.0 * (last - first) * (1 + 1e-9), averaged.weight, f"{place}.weight", "a time")
    for values in (averaged.mean, *recent):
        _alike(values, (n,), f"{place}.values")


def _alike(found: Any, shape: tuple[int, ...], place: str, *, finite: bool = True) -> None:
    want(found.shape == shape, list(found.shape), place, f"the shape {list(shape)}")
    if finite:
        want(bool(np.isfinite(found).all()), None, place, "finite numbers")
