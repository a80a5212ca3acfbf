"""Judging of model files on recordings."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError
from thermocomp.core.machine import Channel
from thermocomp.core.model import ErrorModel
from thermocomp.core.starting import find_offsets
from thermocomp.core.validity import Validity
from thermocomp.judging import coverage
from thermocomp.judging.compare import split_by_cycle
from thermocomp.judging.do_no_harm import Verdict
from thermocomp.judging.guards import Guard, let_fail
from thermocomp.judging.judge import judge
from thermocomp.judging.leaks import find_learned_rows
from thermocomp.judging.pieces import explain
from thermocomp.judging.probing import ProbingGain, Probings, find_gain
from thermocomp.judging.replay import are_absolute, replay_compensated, stack_for
from thermocomp.judging.results import Assessment, Rules
from thermocomp.judging.splits import Judging, Split, join_short_cycles, name_cycles
from thermocomp.judging.watched import believe, can_look, stack_watched
from thermocomp.recordings.checks.sound import drop_unsound
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.starts import Start, find_starts

#: probings whose benefit is reported
EVERY = Probings(7200.0)


@dataclass(frozen=True)
class Judged:
    """Model files judged on recordings.

    Parameters
    ----------
    assessments : tuple of Assessment
        Per model and cycle, and per model over all cycles.
    seen : tuple of str
        Names of recordings that were used, unchanged, to fit a model; it is judged on the other ones, if there are any.
    validity : Validity or None
        Conditions covered by the thermal cycles of these recordings.
    starts : tuple of (str, Start)
        Names of the recordings, and their initial states.
    offsets : dict of str to dict of str to float
        By recording, then by temperature: those that start off the others; see
        `thermocomp.core.starting.find_offsets` [degC].
    probing : dict of str to ProbingGain
        By target: error that a probing every two hours would leave; none if probings were given, or without a model
        that was judged on unseen cycles.
    """

    models: tuple[ErrorModel, ...]
    assessments: tuple[Assessment, ...]
    seen: tuple[str, ...]
    validity: Validity | None = None
    starts: tuple[tuple[str, Start], ...] = ()
    offsets: dict[str, dict[str, float]] = field(default_factory=dict)
    probing: dict[str, ProbingGain] = field(default_factory=dict)

    @property
    def stated(self) -> dict[str, float]:
        """RMS on unseen cycles that the model file states, by target [unit of the target]."""
        return {m.target: m.honest_error.rms for m in self.models if m.honest_error is not None}

    def overall(self) -> tuple[Assessment, ...]:
        """Return the assessments of the models over all cycles, one per model."""
        return tuple(a for a in self.assessments if a.overall)


def assess(
    models: Sequence[ErrorModel],
    recordings: Sequence[Recording],
    *,
    rules: Rules = Rules(),
    limits: Limits = Limits(),
    starts: Start | Sequence[Start] | None = None,
    probings: Probings | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> Judged:
    """Judge frozen models on recordings: per cycle, with noise, with lost sensors, outside the trained range.

    Rows on which a model was trained are left out and counted, whichever file contains them; if there are no other
    rows, the model is refused: see `thermocomp.recordings.fingerprints`.

    Parameters
    ----------
    starts : Start or sequence of Start, optional
        Initial state of each recording, or of all of them. Default: determined from the recordings.
    """
    if not models:
        raise InputError("no model given: name a model file, or give at least one model")
    if probings and (unknown := [m.target for m in models if m.honest_error is None]):
        raise InputError(
            f"model of {', '.join(unknown)} was never judged on unseen cycles, so it is not known how much weight a "
            "probing (a measurement at the machine) should have; fit the model with 'thermocomp fit', which also "
            "judges it"
        )
    found: list[Assessment] = []
    covered = None
    hashes = {h for m in models for h in _hashes(m)}
    seen = tuple(r.name for r in recordings if r.fingerprint in hashes)
    if starts is None:
        starts = find_starts(
            recordings,
            _known_targets(models, recordings),
            zeroing=models[0].zeroing,
            absolute=are_absolute(models),
        )
    told: tuple[tuple[str, Start], ...] = ()
    offsets: dict[str, dict[str, float]] = {}
    gains: dict[str, ProbingGain] = {}
    guards: list[Guard] = []
    errors: list[Exception] = []
    for model in models:
        progress(f"{model.target} {model.family}")
        try:
            samples = drop_unsound(stack_for(model, recordings, starts), recordings)
            watched = None if model.watch is None else stack_watched(model.watch, model.target, recordings, starts)
            samples = _called_as_in(model, samples)
            known, every = find_learned_rows(model, samples), np.ones(len(samples), np.bool_)
            samples, widening = believe(model, samples, every, watched)
            _add_offsets(offsets, model, samples)
            guard = _guard(model, samples, watched, guards)
            looked = model.watch is not None and can_look(model.watch, watched or samples)
            names = model.watch.failing if model.watch is not None and looked else ()
            overall, judged = _assess(model, samples, known, rules, limits, probings, widening, guard, names)
            gains |= _gain(model, samples, overall, limits, widening)
            covered = covered or coverage.find_validity(samples, judged, recordings)
            cut = [replace(a, learned=0) for a in split_by_cycle(overall)]
        except Exception as e:  # noqa: BLE001 - whatever fails for one model, the other models keep their results
            errors.append(e)
            found.append(_refused(model, explain(e)))
            continue
        told = tuple(zip(samples.test_names, samples.starts, strict=True))
        found += [*cut, overall] if len(cut) > 1 else [overall]
    if len(errors) == len(models):
        raise errors[0]
    return Judged(
        models=tuple(models),
        assessments=tuple(found),
        seen=seen,
        validity=covered,
        starts=told,
        offsets={name: off for name, off in offsets.items() if off},
        probing=gains,
    )


def _add_offsets(offsets: dict[str, dict[str, float]], model: ErrorModel, samples: Samples) -> None:
    """Add the temperatures of a model that start off the others, by recording."""
    for name, zero in zip(samples.test_names, samples.reference().tolist(), strict=True):
        offsets.setdefault(name, {}).update(find_offsets(model.inputs, zero, model.thresholds))


def _gain(
    model: ErrorModel, samples: Samples, found: Assessment, limits: Limits, widening: FloatArray
) -> dict[str, ProbingGain]:
    """Return the error that a probing every two hours would leave, by target.

    Empty if the test is too short, or the model may not be probed, or was judged with probings.
    """
    if found.probed is not None or model.honest_error is None or model.unit != "um" or found.failure:
        return {}
    rows = np.zeros(len(samples), dtype=np.bool_)
    places = {place: k for k, place in enumerate(zip(samples.test.tolist(), samples.row.tolist(), strict=True))}
    mine = [places[place] for place in zip(found.test.tolist(), found.row.tolist(), strict=True)]
    rows[mine] = True
    ran = replay_compensated(model, samples, rows, limits, EVERY, widening)
    if ran.probed is None or not ran.probed.at.any():
        return {}
    left = found.measured - ran.compensated
    return {model.target: find_gain(EVERY, found.measured - found.predicted, left, found.cycle)}


def _known_targets(models: Sequence[ErrorModel], recordings: Sequence[Recording]) -> list[Channel]:
    """Return the targets available in the first recording; there must be at least one."""
    found = []
    for recording in recordings[:1]:
        for model in models:
            with suppress(InputError):
                found.append(recording.channel(model.target))
        if not found:
            recording.channel(models[0].target)
    return found


def _refused(model: ErrorModel, why: str) -> Assessment:
    """Return the assessment of a model that cannot be judged because there are no unseen rows: refused."""
    nothing, nowhere = np.empty(0), np.empty(0, np.intp)
    return Assessment(
        model=_name(model),
        target=model.target,
        block="all cycles",
        measured=nothing,
        predicted=nothing,
        row=nowhere,
        test=nowhere,
        cycle=nowhere,
        verdict=Verdict((), refusal=why),
        failure=why,
        overall=True,
    )


def _name(model: ErrorModel) -> str:
    return model.provenance.method if model.provenance else model.family


def _called_as_in(model: ErrorModel, samples: Samples) -> Samples:
    """Return samples with the channel names used in the model: the names in a file may differ."""
    (target,) = samples.targets
    inputs = zip(samples.inputs, model.inputs, strict=True)
    return replace(
        samples,
        targets=(replace(target, name=model.target),),
        inputs=tuple(replace(channel, name=own.name) for channel, own in inputs),
    )


def _hashes(model: ErrorModel) -> tuple[str, ...]:
    return model.provenance.data_sha256 if model.provenance else ()


def _assess(
    model: ErrorModel,
    samples: Samples,
    known: BoolArray,
    rules: Rules,
    limits: Limits,
    probings: Probings | None,
    widening: FloatArray,
    guard: Guard | None,
    looked_after: Sequence[str],
) -> tuple[Assessment, Judging]:
    """Judge a model on unseen rows (not `known`); on all rows if there are no others, with a caveat."""
    judged = np.isfinite(samples.deviations[:, 0])
    n, of = int((known & judged).sum()), int(judged.sum())
    caveat = ""
    if 0 < n == of:
        seen = [name for k, name in enumerate(samples.test_names) if samples.hashes[k] in _hashes(model)]
        why = (
            f"fitted to {', '.join(seen)}"
            if len(seen) == len(samples.test_names)
            else f"{n:,} of {of:,} rows were used for training"
        )
        caveat, known = f"not a test on unseen data: {why}; judge the model on another recording", np.zeros_like(known)
    split = Split("all cycles", np.zeros(len(samples), np.bool_), ~known, stretch=_goes_on(model, samples, known))
    found = judge(
        _name(model), model, samples, split,
        rules=rules, limits=limits, guard=guard, probings=probings, widening=widening, watched=looked_after,
    )  # fmt: skip
    judging = units(samples, ~known)
    return replace(found, overall=True, caveat=caveat, learned=n), judging


def _guard(model: ErrorModel, samples: Samples, watched: Samples | None, known: list[Guard]) -> Guard | None:
    """Return the readings that a model's watch passes on while sensors fail; shared by models of one file."""
    watch = model.watch
    if watch is None or watched is None or not can_look(watch, watched):
        return None
    have = [c.name for c in watched.inputs]
    if any(i.name not in have for i in watch.inputs):
        return None
    guard = next((g for g in known if g.watch is watch or g.watch == watch), None)
    if guard is None:
        every = np.ones(len(watched), np.bool_)
        guard = let_fail(watch, believe(model, watched, every)[0], every)
        known.append(guard)
    own = [c.name for c in samples.inputs]
    return guard.among([own.index(name) if name in own else -1 for name in have])


def _goes_on(model: ErrorModel, samples: Samples, known: BoolArray) -> bool:
    """Return whether the judged rows continue the training data, and so start at the level of the training data."""
    judged = np.unique(samples.test[~known & np.isfinite(samples.deviations[:, 0])])
    earlier = {r.fingerprint for k in judged for r in (samples.starts[k].earlier if samples.starts else ())}
    return bool(np.isin(samples.test[known], judged).any() or not earlier.isdisjoint(_hashes(model)))


def units(samples: Samples, rows: BoolArray | None = None) -> Judging:
    """Return the thermal cycles of recordings, or of some of their rows, for judging; see `join_short_cycles`."""
    none = np.zeros(len(samples), dtype=np.bool_)
    cycle = samples.cycle if rows is None else np.where(rows, samples.cycle, -1)
    blocks = join_short_cycles(cycle, samples.test)
    return Judging("all cycles", tuple(Split(name_cycles(samples, b), none, np.isin(cycle, b)) for b in blocks))
