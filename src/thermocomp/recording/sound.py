"""What `check` finds reaches the judgement: rows in trouble are left out, other trouble is kept in mind."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from thermocomp.recording.quality import check, lasting_trouble, troubled_rows
from thermocomp.recording.recording import Recording
from thermocomp.recording.samples import Samples


def sound(samples: Samples, recordings: Sequence[Recording]) -> Samples:
    """Return samples without what is in trouble.

    Parameters
    ----------
    samples : Samples
    recordings : sequence of Recording
        What they were stacked of, in their order.

    Returns
    -------
    Samples
        Values in trouble are missing (nan); trouble of a whole channel or recording stands in ``trouble``.
    """
    values, deviations = samples.values.copy(), samples.deviations.copy()
    trouble: list[tuple[str, str]] = []
    for k, recording in enumerate(recordings):
        findings = check(recording)
        mine = np.flatnonzero((samples.test == k) & (samples.cycle >= 0))
        for name, rows in troubled_rows(recording, findings).items():
            hit = mine[rows[samples.row[mine]]]
            for table, channels in ((values, samples.inputs), (deviations, samples.targets)):
                for j, c in enumerate(channels):
                    if recording.channel(c.name).name == name:
                        table[hit, j] = np.nan
        own = {recording.channel(c.name).name: c.name for c in (*samples.inputs, *samples.targets)}
        trouble += [
            (own.get(f.channel, ""), f"{samples.test_names[k]}: {f.channel or 'the recording'} has trouble ({f.kind})")
            for f in lasting_trouble(findings)
            if not f.channel or f.channel in own
        ]
    return replace(samples, values=values, deviations=deviations, trouble=tuple(trouble))
