"""Numbers of a compensator as constants of its program: see `thermocomp.runtime.program.variables`."""

import re
from hashlib import sha256
from typing import Any, NamedTuple

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.exceptions import InputError
from thermocomp.core.inputs import Input
from thermocomp.core.model import ErrorModel
from thermocomp.core.starting import find_start_span
from thermocomp.core.thresholds import THRESHOLDS, Thresholds
from thermocomp.core.watch import Watch
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.powerup import find_cold_after
from thermocomp.runtime.program.constants import Constants
from thermocomp.runtime.program.labels import Labels, label_all
from thermocomp.runtime.program.models import Formulas
from thermocomp.runtime.program.tree import Function
from thermocomp.runtime.program.variables import Kept

#: bound above any number, also in single precision
ANY = (-1e30, 1e30)
#: limits
OF_LIMITS = ("magnitude", "rate", "dead_band", "reading_age", "hold", "fade")
#: thresholds that the program uses
OF_THRESHOLDS = tuple(row.name for row in THRESHOLDS.rows if row.name in Constants.variables())


class Tables(NamedTuple):
    """Constants and formulas from which the program of a compensator is generated."""

    channels: tuple[Input, ...]  #: in the order of the block's input values
    ranges: tuple[Input, ...]  #: inputs of the models, without duplicates
    sensors: tuple[str, ...]  #: monitored temperatures, then supervised speeds
    targets: tuple[str, ...]
    models: tuple[ErrorModel, ...]
    sizes: dict[str, int]  #: array dimensions of the variables by name, and flags of optional features
    values: dict[
        str, Any
    ]  #: numbers, or nested lists of them, by the names of `thermocomp.runtime.program.constants.Constants`
    formulas: dict[str, Function]  #: functions generated from the models' formulas
    labels: Labels  #: of the rows and columns of the values, by the name of their size


def gather(compensator: Compensator) -> Tables:
    """Return the constants and formulas of a compensator.

    Parameters
    ----------
    compensator : Compensator
        Created by `Compensator.of`.

    Raises
    ------
    InputError
        Its models have different watches, or average their zero in different ways.
    """
    models, watches = compensator.models, compensator.watches
    zeroings = {m.zeroing for m in models} | {w.zeroing for w in watches}
    if len(zeroings) > 1 or len(watches) > 1:
        raise InputError(
            "the models have different watches (sensor monitoring) or different averaging times of the zero "
            "(reference reading): export each model file separately"
        )
    zeroing = zeroings.pop()
    watch = watches[0] if watches else None
    ranges = tuple(dict.fromkeys(i for m in models for i in m.inputs))
    channels = _channels([*ranges, *(watch.inputs if watch else ())], zeroing.speed)
    place = {c.name: k for k, c in enumerate(channels)}
    sets = list(dict.fromkeys(m.inputs for m in models))
    sensors = watch.failing if watch else ()
    limits, lines, thresholds = compensator.limits, compensator.lines, compensator.thresholds
    values: dict[str, Any] = {
        **{name: getattr(limits, name) for name in OF_LIMITS},
        **{name: getattr(zeroing, name) for name in ("at_rest", "otherwise")},
        "speed_channel": place.get(zeroing.speed, 0),
        "unsigned": [c.name in compensator.unsigned for c in channels],
        **_ranges(ranges, models, place, thresholds),
        "set_begin": np.cumsum([0, *(len(s) for s in sets)]).tolist(),
        "set_range": [ranges.index(i) for s in sets for i in s],
        "model_rezeroed": [any(i.rezero for i in m.inputs) for m in models],
        **_lines(compensator),
        **_feed(compensator, place),
        **_judged(models, sensors),
        **_watch(watch, place),
    }
    formulas = Formulas(ranges, values["channel"], models)
    own_sizes, own_values = formulas.finish()
    values |= own_values
    sizes = {
        "CHANNELS": len(channels),
        "RANGES": len(ranges),
        "MODELS": len(models),
        "TARGETS": len(lines),
        "ENDS_OF_LINES": len(lines) + 1,
        "ENDS": 2,
        "COLUMN": max(len(ranges), len(sensors), 2),  # to sort one, gcc would warn of the index 1
        "has_speed": int(bool(zeroing.speed)),
        **_sizes(values),
        **_watch_sizes(watch),
        **own_sizes,
    }
    return Tables(
        channels=channels,
        ranges=ranges,
        sensors=sensors,
        targets=tuple(lines),
        models=models,
        sizes=sizes,
        values=values | {"fingerprint": _fingerprint(values, formulas.functions)},
        formulas=formulas.functions,
        labels=label_all(compensator, channels, ranges, values, formulas),
    )


def _fingerprint(values: dict[str, Any], formulas: dict[str, Function]) -> int:
    """Return a hash, from 1 to 2**31 - 1, of the models and of what is kept of them; limits may change."""
    numbers = {name: value for name, value in values.items() if name not in OF_LIMITS}
    text = re.sub(r"np\.\w+\(([^()]*)\)", r"\1", repr((numbers, formulas, list(Kept.variables()))))
    return 1 + int(sha256(text.encode()).hexdigest()[:8], 16) % (2**31 - 1)


def _channels(known: list[Input], speed: str) -> tuple[Input, ...]:
    """Return the channels of a reading without duplicates: inputs of models and watch, and the spindle speed."""
    if speed:
        known.append(Input(speed, "spindle_speed", unit="1/min", reference=0.0, rezero=False, low=0.0, high=0.0))
    by_name = {i.name: i for i in reversed(known)}
    return tuple(by_name[name] for name in dict.fromkeys(i.name for i in known))


def _sizes(values: dict[str, Any]) -> dict[str, int]:
    """Return the sizes and flags that follow from the lists among the constants."""
    return {
        "SETS": len(values["set_begin"]) - 1,
        "ENDS_OF_SETS": len(values["set_begin"]),
        "MEMBERS": len(values["set_range"]),
        "FED": len(values["feed_channel"]),
        "has_feed": int(bool(values["feed_channel"])),
        "has_unsigned": int(any(values["unsigned"])),
        "JUDGED": len(values["judged_model"]),
        "has_zero": int(any(values["model_rezeroed"])),
        "has_absolute": int(not all(values["model_rezeroed"])),
    }


def _ranges(
    ranges: tuple[Input, ...], models: tuple[ErrorModel, ...], place: dict[str, int], thresholds: Thresholds
) -> dict[str, Any]:
    plausible = thresholds.plausible
    limits = [plausible.get(r.quantity, ANY) for r in ranges]
    heat = [r.quantity == "temperature" for r in ranges]
    span = [max(r.high - r.low, thresholds.least_margin) for r in ranges]
    wide = [thresholds.margin * max(r.high - r.low, abs(r.low), abs(r.high), 1.0) for r in ranges]
    bounds: dict[Input, list[tuple[float, float]]] = {r: [] for r in ranges}
    for m in models:
        low, high, _ = m.bounds
        for i, a, b in zip(m.inputs, low, high, strict=True):
            bounds[i].append((a, b))
    at_once = {i for m in models if not any(i.rezero for i in m.inputs) for i in m.inputs}
    return {
        **{name: getattr(thresholds, name) for name in OF_THRESHOLDS},
        "channel": [place[r.name] for r in ranges],
        "temperature": heat,
        "rezero": [r.rezero for r in ranges],
        "reference": [r.reference for r in ranges],
        "low": [r.low for r in ranges],
        "high": [r.high for r in ranges],
        "room": [s if h else w for h, s, w in zip(heat, span, wide, strict=True)],
        "applies": [1 if h else 0 if r.quantity in plausible else 2 for h, r in zip(heat, ranges, strict=True)],
        "least": [low for low, _ in limits],
        "most": [high for _, high in limits],
        "span": [find_start_span(r, thresholds) for r in ranges],
        "bound_low": [max(low for low, _ in bounds[r]) for r in ranges],
        "bound_high": [min(high for _, high in bounds[r]) for r in ranges],
        "waits": [r not in at_once for r in ranges],
    }


def _lines(compensator: Compensator) -> dict[str, Any]:
    lines = list(compensator.lines.values())
    shares = [line.deviation(unit) for line in lines for unit in np.eye(line.models.stop - line.models.start).tolist()]
    # the correction of a single model is the same at every position
    travels = [(0.0, 0.0) if line.travel[0] == line.travel[1] else line.travel for line in lines]
    return {
        "line_begin": [line.models.start for line in lines] + [len(compensator.models)],
        "to_offset": [s.offset for s in shares],
        "to_slope": [s.slope for s in shares],
        "position": [shares[line.models.start].reference_position for line in lines],
        "travel_low": [low for low, _ in travels],
        "travel_high": [high for _, high in travels],
        "shadow": [t in compensator.shadow for t in compensator.lines],
        "cold_after": find_cold_after(compensator),
    }


def _feed(compensator: Compensator, place: dict[str, int]) -> dict[str, Any]:
    """Return the temperatures whose repetition is monitored, and the place of each watched one among them."""
    feed = compensator.feed
    return {
        "feed_channel": [place[name] for name in feed.names],
        "feed_place": feed.places[0] if feed.places else [0 for w in compensator.watches for _ in w.sensors],
        "may_count": feed.counts,
    }


def _judged(models: tuple[ErrorModel, ...], sensors: tuple[str, ...]) -> dict[str, Any]:
    """Return the sensors without which the models may run: single sensors, and the combinations judged."""
    judged: list[tuple[int, list[bool]]] = []
    for k, m in enumerate(models):
        own = [i.name for i in m.inputs if i.name in sensors]
        for key in m.honest_error.lost if m.honest_error else ():
            several = [name for name in own if name in key.split(", ")]
            if len(several) > 1 and ", ".join(several) == key and m.may_lose(several):
                judged.append((k, [s in several for s in sensors]))
    effect = [
        [_effect(m, name) if m.may_lose([name]) and m.most_lost([name]) > 1 else ANY[1] for name in sensors]
        for m in models
    ]
    return {
        "effect": effect,
        "most_effect": [m.honest_error.most_effect if m.honest_error else -1.0 for m in models],
        "most_lost": [len(m.watch.names) // 4 if m.watch else 1 for m in models],
        "leans_on": [[s in m.sensors for s in sensors] for m in models],
        "may_lose": [[m.may_lose([s]) for s in sensors] for m in models],
        "judged_model": [k for k, _ in judged],
        "judged_without": [which for _, which in judged],
    }


def _effect(model: ErrorModel, name: str) -> float:
    found = model.honest_error
    return found.effect(name) if found and name in found.lost else ANY[1]


def _watch_sizes(watch: Watch | None) -> dict[str, int]:
    if watch is None:
        return {"watched": 0, "supervised": 0, "SENSORS": 0, "FAILING": 0}
    n, bank = len(watch.sensors), watch.bank
    return {
        "watched": 1,
        "supervised": int(bool(watch.checks)),
        "SENSORS": n,
        "WATCHED": len(watch.inputs),
        "SPEEDS": len(watch.speeds),
        "TAUS": bank.taus,
        "STATES": len(bank.gain),
        "LAGGED": bank.taus * n,
        "MEMORY": len(bank.rates),
        "PAIRS": len(watch.pairs[0]),
        "SHAPES": 2,
        "CHECKS": len(watch.checks),
        "RESIDUALS": n + len(watch.checks),
        "FAILING": len(watch.failing),
        "watch_waits": int(any(i.rezero for i in watch.inputs)),
    }


def constants_of_watch(watch: Watch, reference: FloatArray | None = None) -> tuple[dict[str, int], dict[str, Any]]:
    """Return the sizes and numbers of a watch alone, whose inputs are the channels.

    Parameters
    ----------
    reference : ndarray of shape (n_inputs,), optional
        Zero of the inputs; nan where the first readings determine it, as by default for inputs with ``rezero``.
    """
    if reference is None:
        reference = np.array([np.nan if i.rezero else i.reference for i in watch.inputs])
    waits, zeroing = np.isnan(reference), watch.zeroing
    sizes = _watch_sizes(watch) | {"CHANNELS": len(watch.inputs), "COLUMN": len(watch.sensors)}
    values = _watch(watch, {name: k for k, name in enumerate(i.name for i in watch.inputs)}) | {
        "at_rest": zeroing.at_rest,
        "otherwise": zeroing.otherwise,
        "watch_rezero": waits,
        "watch_reference": np.nan_to_num(reference),
    }
    return sizes | {"watch_waits": int(waits.any())}, values


def _watch(watch: Watch | None, place: dict[str, int]) -> dict[str, Any]:
    if watch is None:
        return {}
    heat, bank = [watch.inputs[s.input] for s in watch.sensors], watch.bank
    lags = bank.taus * len(heat)
    low, high, width = (a.tolist() for a in watch.ranges)
    direct, weight = watch.read_out
    heats = watch.heat_constants
    unseen = np.append(watch.limits("unseen"), heats.unseen)
    failing = watch.supervised.tolist()
    return {
        "sensor_channel": [place[i.name] for i in heat],
        "sensor_input": [s.input for s in watch.sensors],
        "watch_channel": [place[i.name] for i in watch.inputs],
        "watch_rezero": [i.rezero for i in watch.inputs],
        "watch_reference": [i.reference for i in watch.inputs],
        "start_zero": [i.reference if i.rezero else i.reference + i.low for i in heat],
        "start_span": [max(w, watch.thresholds.start_offset) for w in width],
        "sensor_low": low,
        "sensor_high": high,
        "sensor_span": [max(w, watch.thresholds.least_margin) for w in width],
        "speed_input": watch.speeds.tolist(),
        "top_speed": watch.top_speed,
        **{name: getattr(watch.thresholds, name) for name in OF_THRESHOLDS},
        "pace": watch.pace,
        "tau": list(watch.time_constants),
        "state_input": bank.speeds.tolist(),
        "power": bank.powers.tolist(),
        "resting_rate": bank.rates[lags:].tolist(),
        "gain": bank.gain.tolist(),
        "direct": direct.tolist(),
        "weight": weight.tolist(),
        **{f"{name}_limit": watch.limits(name).tolist() for name in ("jump", "moved", "frozen", "still", "step")},
        "off_limit": [*watch.limits("off").tolist(), *heats.off.tolist()],
        "unseen": unseen.tolist(),
        "shape": (watch.signatures / unseen[:, None]).tolist(),
        "pair_first": watch.pairs[0].tolist(),
        "pair_second": watch.pairs[1].tolist(),
        "deciding": watch.deciding.tolist(),
        "speed_fault": [failing.index(k) if k in failing else 0 for k in watch.speeds.tolist()],
        "state_speed": watch.state_speeds.tolist(),
        "check_speed": heats.speeds.tolist(),
        "heat_power": heats.powers.tolist(),
        "heat_root": (1.0 / heats.powers).tolist(),
        "heat_lag": heats.lags.tolist(),
        "heat_direct": watch.heat_read_out[0].tolist(),
        "heat_weight": watch.heat_read_out[1].tolist(),
        "heat_reach": watch.heat_reach.tolist(),
    }
