"""Results of a model file on recordings, as a single offline page.

Each section of the page is made by a function listed in `SECTIONS`.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

from thermocomp.core.messages import Message, join
from thermocomp.core.validity import Validity
from thermocomp.judging import coverage
from thermocomp.judging.assessing import Judged
from thermocomp.judging.diagnostics import Collinearity
from thermocomp.judging.results import Assessment, Comparison
from thermocomp.judging.splits import Judging
from thermocomp.recordings.recording import Recording
from thermocomp.report import faults, probings
from thermocomp.report.declared import measured
from thermocomp.report.html import draw_measured, draw_runs, page
from thermocomp.report.language import write_number
from thermocomp.report.layout import laid_out
from thermocomp.report.sections import Section
from thermocomp.report.summary import summarise


def render(judged: Judged, recordings: Sequence[Recording]) -> str:
    """Return the page about judged models as self-contained HTML."""
    nothing = Collinearity((), math.nan, ())
    seen = Comparison(Judging("all cycles", ()), judged.assessments, nothing, starts=judged.starts)
    overall = judged.overall()
    content = summarise(seen, recordings)
    sections = [section for make in SECTIONS if (section := make(judged, recordings)) is not None]
    return page(
        "assessed.html",
        **content
        | {
            "headers": [*content["headers"], *_fitted_with(judged)],
            "verdict": join([join([_verdict(a, judged.stated) for a in overall], "; "), "."]),
            "good": all(a.accepted for a in overall),
            "predictions": draw_runs(seen, recordings),
            "cautions": [*_fitted_badly(judged), *content["cautions"], *(c for s in sections for c in s.cautions)],
            "sections": sections,
            "measured": draw_measured(recordings),
        },
    )


def _verdict(a: Assessment, stated: Mapping[str, float]) -> str:
    if a.failure:
        return Message("{target}: {what}", target=a.target, what=a.reason)
    known = Message(" ({rms:.2f} um stated in the model file)", rms=stated.get(a.target, math.nan))
    return Message(
        "{target}: {word}, {rms} um RMS{known} instead of {none} um",
        target=a.target,
        word=Message(a.word),
        rms=write_number(measured(a, "rms")),
        known=known if a.target in stated else "",
        none=write_number(measured(a, "rms", none=True)),
    )


def _fitted_badly(judged: Judged) -> Iterator[str]:
    """Yield shortcomings found when the models were fitted."""
    for m in judged.models:
        if m.honest_error is None:
            yield Message(
                "{target}: never judged on unseen cycles when it was fitted; the model does not run.", target=m.target
            )
        elif not m.accepted:
            yield Message(
                "{target}: {word} when it was fitted: {why}.",
                target=m.target,
                word=Message(m.honest_error.word),
                why=m.honest_error.why,
            )


def _fitted_with(judged: Judged) -> list[str]:
    """Return the header data of the recordings to which the models were fitted, as lines of text."""
    told = dict.fromkeys(text for m in judged.models if m.provenance for text in m.provenance.headers)
    return [Message("Models fitted to: {text}", text=text) for text in told]


def _covered(judged: Judged, _: Sequence[Recording]) -> Section | None:
    fitted = {Message("when fitted"): judged.models[0].validity, Message("these recordings"): judged.validity}
    known: dict[str, Validity] = {name: v for name, v in fitted.items() if v is not None}
    if not known:
        return None
    table = coverage.table(known)
    return Section(table.title, [laid_out(replace(table, title=""))])


#: sections of the page in order; each function returns None if its section is empty
SECTIONS: tuple[Callable[[Judged, Sequence[Recording]], Section | None], ...] = (
    faults.section,
    probings.section,
    _covered,
)
