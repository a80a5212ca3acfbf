"""Reports as offline HTML files: numbers are collected in a dict and rendered by a template."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from datetime import datetime
from importlib.resources import files
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape
from jinja2.utils import htmlsafe_json_dumps
from markupsafe import Markup

from thermocomp import __version__
from thermocomp.core.messages import Message
from thermocomp.core.paceddynamic import PacedDynamic
from thermocomp.core.shown import replace_unprintable
from thermocomp.judging.choice import Choice
from thermocomp.judging.results import Assessment, Comparison
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.report import contributions, curves, declared, figures, selections
from thermocomp.report.bands import describe_coverage
from thermocomp.report.drawing import Drawn
from thermocomp.report.language import (
    find_language,
    load_words,
    translate,
    write_cell,
    write_date,
    write_number,
)
from thermocomp.report.layout import in_um, laid_out
from thermocomp.report.summary import summarise

#: name of the project whose pages are written, and the time of its run
_project: ContextVar[tuple[str, ...]] = ContextVar("project", default=())


def render(comparison: Comparison, recordings: Sequence[Recording], samples: Samples | None = None) -> str:
    """Return the report as a self-contained HTML page."""
    overall = comparison.overall()
    drawn = draw_runs(comparison, recordings)
    stressed = [a for a in overall if a.robustness is not None and a.model == drawn.get(a.target, [""])[0]]
    content = summarise(comparison, recordings, samples)
    models = {t["name"]: t["formula"]["model"] for t in content["targets"] if t["formula"]}
    return page(
        "report.html",
        **content,
        answers={
            target: contributions.explain(model, samples)
            for target, model in models.items()
            if samples is not None and isinstance(model, PacedDynamic)
        },
        measured=draw_measured(recordings),
        overview=figures.overview(comparison),
        predictions=drawn,
        robustness=figures.robustness(stressed) if stressed else "",
    )


def draw_measured(recordings: Sequence[Recording]) -> list[tuple[Drawn, list[Any]]]:
    """Return the figure of each recording, and its curves."""
    points = curves.share_points(recordings)
    return [(figures.measured(r, points), curves.measured(r, points)) for r in recordings]


def draw_runs(comparison: Comparison, recordings: Sequence[Recording]) -> dict[str, tuple[str, Drawn, str, list[Any]]]:
    """Return the best model of each target, or the least bad one, marked as refused: name, figure, coverage, curves."""
    times = [r.time for r in recordings]
    overall = comparison.overall()
    drawn = {}
    for target in dict.fromkeys(a.target for a in overall):
        shown = comparison.written(target)
        if shown is None:  # none that can be written: show the least bad one, marked as refused
            candidates = [a for a in overall if a.target == target and not a.failure]
            shown = min(candidates, key=lambda a: a.metric("rms"), default=None)
        if shown is not None:
            blocks = [
                a for a in comparison.assessments if (a.target, a.model) == (target, shown.model) and not a.overall
            ]
            figure = figures.prediction(shown, blocks or [shown], times)
            drawn[target] = (shown.model, figure, _held(shown), curves.run(shown, recordings))
    return drawn


def _held(shown: Assessment) -> str:
    return describe_coverage(shown) if shown.band and not shown.failure else ""


def render_choices(choices: Sequence[Choice], recordings: Sequence[Recording]) -> str:
    """Return a selection of sensors as a self-contained HTML page."""
    return page(
        "selection.html",
        recordings=[r.source or r.name for r in recordings],
        method=choices[0].method,
        choices=choices,
        figures=[selections.draw(c) for c in choices],
    )


@contextmanager
def name_project(name: str, began: str) -> Iterator[None]:
    """State the name of a project and the time of its run in the head of each page; pages without are reproducible."""
    local = datetime.fromisoformat(began).astimezone().isoformat(" ", "minutes")[:16]
    before = _project.set(tuple(filter(None, (name, write_date(local)))))
    try:
        yield
    finally:
        _project.reset(before)


def page(template: str, **content: Any) -> str:
    """Return an HTML page rendered from a template, with the version of thermocomp."""
    language = find_language()
    words = load_words(language, "report/static/")
    made_by = " \N{MIDDLE DOT} ".join([*_project.get(), f"thermocomp {__version__}"])
    return environment().get_template(template).render(made_by=made_by, language=language, words=words, **content)


def _shown(value: Any) -> Any:
    """Return a value as shown on a page: messages translated, no unprintable or direction-changing characters."""
    if isinstance(value, Message):
        value = translate(value)
    return replace_unprintable(value) if isinstance(value, str) and not isinstance(value, Markup) else value


def say(text: str, **values: Any) -> str:
    """Return a text of a page in its language, its line breaks as spaces.

    Parameters
    ----------
    **values : object
        Values of its fields; without any, braces are characters like others.
    """
    text = " ".join(text.split())
    return translate(Message(text, **values))


def _embed(panels: Sequence[dict[str, Any]]) -> Markup:
    """Return panels as JSON content for ``static/curves.js``; nothing without panels."""
    content = htmlsafe_json_dumps(panels, separators=(",", ":"))
    return Markup('<script type="application/json">{}</script>').format(content) if panels else Markup()


def environment() -> Environment:
    """Return the template environment of the pages with its filters."""
    pages = Environment(
        loader=PackageLoader("thermocomp.report"),
        autoescape=select_autoescape(["html"]),
        undefined=StrictUndefined,
        finalize=_shown,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    pages.globals["_"] = say
    pages.filters["um"] = lambda value: write_number(in_um(value))
    pages.filters["number"] = lambda value, digits=0: write_number(f"{value:.{digits}f}")
    pages.filters["local"] = write_cell
    pages.filters["date"] = write_date
    pages.filters["plus_minus"] = lambda *given: write_number(
        declared.plus_minus(*given).replace(" ", "\N{NO-BREAK SPACE}")
    )
    pages.filters["hours"] = lambda value: write_number(f"{value:.1f}")
    pages.filters["laid_out"] = laid_out
    pages.filters["live"] = _embed
    pages.globals["static"] = lambda name: Markup((files(__package__) / "static" / name).read_text(encoding="utf-8"))
    return pages
