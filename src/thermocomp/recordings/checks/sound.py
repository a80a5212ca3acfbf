"""Effect of the findings of `check` on judging: faulty rows are excluded, other trouble is kept as a note."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from thermocomp.core.messages import Message
from thermocomp.recordings.checks.quality import check, lasting_trouble, troubled_rows
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples


def drop_unsound(samples: Samples, recordings: Sequence[Recording]) -> Samples:
    """Return samples without the faulty values."""
    values, deviations = samples.values.copy(), samples.deviations.copy()
    trouble: list[tuple[str, str]] = []
    for k, recording in enumerate(recordings):
        rows = np.flatnonzero(samples.test == k)
        first = 0
        for part in (*(samples.starts[k].earlier if samples.starts else ()), recording):
            mine, first = rows[first : first + len(part)], first + len(part)
            own = (*samples.inputs, *samples.targets) if part is recording else samples.inputs
            named = {part.channel(c.name).name: c.name for c in own}
            findings = check(part)
            for name, hit in troubled_rows(part, findings).items():
                for table, channels in ((values, samples.inputs), (deviations, samples.targets)):
                    for j, c in enumerate(channels):
                        if named.get(name) == c.name:
                            table[mine[hit], j] = np.nan
            called = samples.test_names[k] if part is recording else part.name
            trouble += [
                (
                    named.get(f.channel, ""),
                    Message(
                        "{recording}: data-quality problem in {what} ({kind})",
                        recording=called,
                        what=f.channel or Message("the recording"),
                        kind=Message(f.kind),
                    ),
                )
                for f in lasting_trouble(findings)
                if not f.channel or f.channel in named
            ]
    return replace(samples, values=values, deviations=deviations, trouble=tuple(dict.fromkeys(trouble)))
