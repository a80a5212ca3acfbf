"""`thermocomp explain`: a model file in plain words."""

from collections.abc import Sequence
from pathlib import Path

from thermocomp.cli.answers import free
from thermocomp.cli.face import CommandFace, command
from thermocomp.cli.terminal import console, words
from thermocomp.core.explained import Explanation, Explanations
from thermocomp.report.answer import CommandAnswer, few, spares_of, split_units
from thermocomp.report.layout import Column, Layout, PrintedLine, verdict


@command("thermocomp.api.explain:explain", forms={"model": Path})
def explain(found: Explanations, face: CommandFace) -> int:
    """Show the explanation.

    Returns
    -------
    int
        0 done, 2 unusable input.
    """
    face.answer(
        found.to_dict,
        lambda: answer_models(found.models, face.following("export", to="c99", output=free("c99"))),
        lambda: _print(found),
    )
    return 0


def _print(found: Explanations) -> None:
    for line in str(found).split("\n"):
        console.print(words(line), soft_wrap=True)


def answer_models(
    models: Sequence[Explanation], following: Sequence[str], files: Sequence[object] = ()
) -> CommandAnswer:
    """Return what is in a model file, on what it leans, and what happens if a sensor fails.

    Parameters
    ----------
    models : sequence of Explanation
    following : sequence of str
        Words of the next command if a model may run.
    files : sequence
        Files written.
    """
    accepted = [e.target for e in models if e.word.startswith("accepted")]
    inputs = {s.name: s.quantity for e in models for s in e.sensors}
    heat = sum(quantity == "temperature" for quantity in inputs.values())
    what = [f"{heat} temperatures", *(name for name, quantity in inputs.items() if quantity != "temperature")]
    past = "present and past values" if any(e.remembers for e in models) else "present values only"
    number = f"{len(models)} model{'' if len(models) == 1 else 's'}"
    return CommandAnswer(
        head=f"{number} of {' and '.join(what)} ({past}); {len(accepted)} may run. Leans on: largest contributions; "
        "if lost: worst sensor, RMS.",
        table=_table(models),
        lines=[*_failing(models), *spares_of(models)],
        warnings=[f"{e.target}: {e.word}, {e.reason}" for e in models if e.target not in accepted],
        files=files,
        following=following if accepted else (),
    )


def _leans(e: Explanation) -> str:
    known = sorted((s for s in e.sensors if s.bound is not None), key=lambda s: -(s.bound or 0.0))
    return ", ".join(f"{s.name} {s.bound:.1f}" for s in known[:2]) or f"{len(e.sensors)} inputs together"


def _worst_lost(e: Explanation) -> str:
    name, rms = max(((s.name, s.lost) for s in e.sensors if s.lost is not None), key=lambda x: x[1], default=("", 0.0))
    return name and f"{name} {rms:.2f}"


def _failing(models: Sequence[Explanation]) -> list[PrintedLine]:
    """Return the lines about what happens if a sensor fails."""
    watched = [s for e in models for s in e.sensors if s.watched]
    if not watched:
        return []
    held = dict.fromkeys(s.name for e in models for s in e.sensors if not s.runs_on)
    lasting = next(t.value for t in models[0].thresholds if t.name == "fault_duration")
    number, kept_on = min((e.pairs for e in models if e.pairs[0]), key=lambda p: p[1] / p[0], default=(0, 0))
    every = "whichever two they are" if kept_on == number else f"without at least {kept_on} of {number} pairs"
    kept = f"; without {few(list(held))} the correction is held, then fades" if held else ""
    return [
        PrintedLine(
            f"A missing reading is replaced at once, a wrong one {lasting / 60:g} min after it exceeds its limit, by "
            f"its prediction from the others{kept}."
        ),
        *([PrintedLine(f"Two sensors lost at once: each model runs on, {every}.")] if number else []),
    ]


def _table(models: Sequence[Explanation]) -> Layout:
    unit, name = split_units(e.unit for e in models)
    columns = (
        Column("target", lambda e: name(e.target, e.unit)),
        Column("method", lambda e: e.method or e.family),
        Column("RMS", lambda e: e.rms, ".2f", unit),
        Column("instead of", lambda e: e.none_rms, ".2f", unit),
        Column("leans on", _leans, unit=unit),
        Column("if lost", _worst_lost, unit=unit),
        Column("verdict", lambda e: verdict(e.word)),
    )
    return Layout(columns, models)
