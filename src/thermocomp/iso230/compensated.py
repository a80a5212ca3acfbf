"""Residuals of models in a thermal test of ISO 230-3."""

from collections.abc import Sequence

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError
from thermocomp.core.model import ErrorModel
from thermocomp.judging.leaks import find_learned_rows
from thermocomp.judging.replay import are_absolute, replay_compensated, stack_for
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.starts import Start, find_starts


def replay_models(
    recording: Recording, models: Sequence[ErrorModel], start: Start | None, limits: Limits
) -> tuple[dict[str, FloatArray], list[str]]:
    """Replay models over a thermal test, with gate and limits, as a compensator would run them.

    Parameters
    ----------
    start : Start or None
        Initial state of the recording. Default: determined from the recording.

    Returns
    -------
    residuals : dict of str to ndarray of shape (n_rows,)
        Residual of each model in its channel, by channel [its unit].
    """
    found: dict[str, FloatArray] = {}
    notes = []
    names = {c.name for c in recording.channels}
    by_target = {recording.aliases.get(m.target, m.target): m for m in models}
    mine = {target: m for target, m in by_target.items() if target in names}
    if mine:
        channels = [recording.channel(target) for target in mine]
        used = list(mine.values())
        if start is None:
            (start,) = find_starts([recording], channels, zeroing=used[0].zeroing, absolute=are_absolute(used))
        notes.append(
            f"{start.told(recording.name)}; models run behind the gate (plausibility check of readings), with "
            f"limits: {limits.in_words()}"
        )
    for target, model in by_target.items():
        if target not in names:
            notes.append(f"the model of {model.target} is not used: the recording has no channel of this name")
            continue
        samples = stack_for(model, [recording], start)
        own = samples.cycle >= 0
        ran = replay_compensated(model, samples, own, limits)
        found[target] = samples.deviations[own, 0] - ran.compensated
        alone = samples.deviations[own, 0] - ran.deviation
        left = [float(np.sqrt(np.nanmean(v**2))) for v in (found[target], alone)]
        if f"{left[0]:.2f}" != f"{left[1]:.2f}":
            notes.append(
                f"{target}: residual of the model without gate and limits {left[1]:.2f} {model.unit} RMS, with "
                f"them {left[0]:.2f}"
            )
        known = find_learned_rows(model, samples)[own]
        if known.all():
            notes.append(
                f"the model of {target} was fitted to this recording: its residual is not a test on unseen data"
            )
        elif known.any():
            rows = f"{known.sum():,} of {len(known):,} rows were used for training"
            notes.append(f"the model of {target}: {rows}: its residual there is not a test on unseen data")
        honest = model.honest_error
        if honest is not None and not model.accepted:
            notes.append(f"the model of {target} was {honest.word} when it was fitted: {honest.why}")
        if ran.rejected.any():
            notes.append(f"the gate rejected {int(ran.rejected.sum())} readings of {target}; the first: {ran.why}")
        if ran.outside.mean() > 0.1:
            share = f"{100 * ran.outside.mean():.0f} % of the rows"
            notes.append(f"the model of {target}: {share} are outside its trained range")
    if models and not found:
        raise InputError(
            f"{recording.name}: the models predict {', '.join(m.target for m in models)}, but the recording has no "
            "such channel"
        )
    return found, notes
