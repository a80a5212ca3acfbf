"""`thermocomp export`: a model file as code for another controller, with its proof."""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from datetime import UTC, datetime
from functools import partial
from hashlib import sha256
from pathlib import Path

from thermocomp import __version__
from thermocomp.cli.beginning import Beginning
from thermocomp.cli.extras import needs
from thermocomp.cli.jsonoutput import print_json
from thermocomp.cli.options import CompensatorOptions, Output
from thermocomp.cli.terminal import console, words
from thermocomp.core.bounds import GAP, LEAST, RANGE
from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError
from thermocomp.core.model import ErrorModel
from thermocomp.core.position import PositionModel
from thermocomp.export.commands import reducing
from thermocomp.export.facts import Facts
from thermocomp.export.st.ststatements import Dialect
from thermocomp.export.target import Target, find_target
from thermocomp.files.draft import drafts
from thermocomp.files.machines import read_models
from thermocomp.runtime.compensator import Compensator


def export(
    model: Path,
    recordings: list[Path] | None = None,
    /,
    *,
    to: str,
    output: Output,
    name: str = "thermal",
    dialect: Dialect | None = None,
    hold: float = 1800.0,
    fade: float = 3600.0,
    reading_age: float = 60.0,
    compensator: CompensatorOptions = CompensatorOptions(),  # noqa: B008 - frozen
    reduction: reducing.ReductionOptions = reducing.ReductionOptions(),  # noqa: B008 - frozen
    beginning: Beginning = Beginning(),  # noqa: B008 - frozen
    accept_unproven: str | None = None,
    date: str | None = None,
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """Write the models of a file as code for another controller, with test vectors and how to use it.

    The code does what ``thermocomp serve`` does: it averages the zero, turns away what is not plausible, replaces a
    sensor that failed, holds and fades in time, and keeps the limits; as ONNX it takes the zero from its caller and
    replaces no sensor. A refused model is left out; of an unproven one the correction stays zero.

    klipper, heidenhain and fanuc hold less than a model: the best one of what they hold is fitted to recordings, judged
    on unseen cycles beside the full one, and written with what is lost.

    Parameters
    ----------
    model : Path
        Model file from ``thermocomp fit``, or of ``thermocomp position``.
    recordings : list of Path
        For klipper, heidenhain and fanuc: CSV, XLSX or Parquet files to reduce the model on; each is one test.
    to : {'c99', 'st', 'siemens', 'beckhoff', 'linuxcnc', 'onnx', 'klipper', 'heidenhain', 'fanuc'}
        What to write: c99 is one header and one source of C99, for a DSP, a PLC or a computer; st a function block in
        structured text, IEC 61131-3; siemens and beckhoff the same and what their temperature compensation takes;
        linuxcnc the C99 as a component of HAL, and HAL that moves X, Y and Z; onnx one step as a graph, for a computer
        with a runtime of ONNX; klipper its z_thermal_adjust; heidenhain a formula; fanuc a macro.
    output : Path
        Folder to write into.
    name : str
        Of the files and functions, behind tc_.
    dialect : {'codesys', 'twincat', 'scl'}
        Of structured text; codesys if not given.
    hold : float
        Hold time of a correction without valid readings [s].
    fade : float
        Time constant with which it goes to zero after that [s].
    reading_age : float
        Older readings are not used [s].
    compensator : CompensatorOptions
        Its limits.
    reduction : ReductionOptions
        How a model is reduced.
    beginning : Beginning
        How the recordings begin.
    accept_unproven : str
        Person who approves the use of an unproven model, and the reason: "NAME, REASON".
    date : str
        For the first lines, such as 2026-01-31; today if not given.
    overwrite : bool
        Write over existing files.
    json : bool
        Print what was written for a machine.

    Returns
    -------
    int
        0 done, 1 a model was refused and left out, 2 unusable input.
    """
    limits = replace(compensator.value(), hold=hold, fade=fade, reading_age=reading_age)
    target = find_target(to)
    _check(to, target, name, date, limits)
    if dialect is not None and dialect not in target.dialects:
        raise InputError(f"--dialect {dialect}: {to} does not take it; --to st does")
    if recordings and target.shape is None:
        raise InputError(f"{to} holds the whole model and takes no recordings, found {recordings[0]}")
    _check_reduction(to, target, reduction)
    models = [m.taken(accept_unproven) for m in read_models(model)]
    reasons = {m.target: why for m in models if (why := _refusal(m))}
    texts = dict[str, bytes]()
    elsewhere = {}
    if target.shape is None:
        elsewhere = {m.target: f"it predicts {m.unit}, and a correction is in um" for m in models if m.unit != "um"}
    left = [m for m in models if m.target not in reasons and m.target not in elsewhere]
    if left:
        facts = Facts(
            source=model.name,
            sha256=sha256(model.read_bytes()).hexdigest(),
            version=__version__,
            date=date or datetime.now(UTC).astimezone().date().isoformat(),
            left_out=reasons | elsewhere,
        )
        if target.shape is not None:
            texts, more, others = reducing.export_reduced(
                to,
                target,
                _constant(left, to),
                recordings or [],
                reduction,
                beginning,
                limits,
                name,
                facts,
                accept_unproven,
                hidden=json,
            )
            reasons |= more
            elsewhere |= others
        else:
            writer = _writer(target, left, dialect, reduction.named())
            if target.corrected:
                left, axes, others = reducing.along_axes(left, reduction, to, target.corrected)
                elsewhere |= others
                writer = partial(target.write, axes=axes)
            with needs("onnx"):  # one of them does
                texts = writer(Compensator.of(left, limits, watching=True), name, facts)
    if texts:
        _write(output, texts, overwrite)
    if json:
        print_json({"files": [str(output / file) for file in texts], "refused": reasons | elsewhere})
        return 1 if reasons else 0
    for left_out, why in reasons.items():
        console.print(f"[red]refused[/] {words(f'{left_out} is left out: {why}')}", soft_wrap=True)
    for left_out, why in elsewhere.items():
        console.print(words(f"{left_out} is left out: {why}"), soft_wrap=True)
    if texts:
        console.print(words(texts[list(texts)[-1]].decode().split("  \n", 1)[0]), soft_wrap=True)
        console.print(words(f"Written: {', '.join(str(output / file) for file in texts)}"), soft_wrap=True)
        console.print(words(f"Verify it as described in {output / list(texts)[-1]}."), soft_wrap=True)
    return 1 if reasons else 0


def _check(to: str, target: Target, name: str, date: str | None, limits: Limits) -> None:
    """Refuse what would make no file, or one that no controller takes."""
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
        raise InputError(f"--name {name!r}: want letters, digits and _, a letter first, such as mill_3")
    most = {"magnitude": target.magnitude, "rate": RANGE, "hold": GAP, "fade": GAP, "reading_age": GAP}
    for option, end in most.items():
        value, named = getattr(limits, option), f"--{option.replace('_', '-')}"
        if not math.isfinite(value):
            raise InputError(f"{named} {value}: {to} wants a finite number")
        if not LEAST <= value <= end:
            raise InputError(f"{named} {value:g}: {to} takes {LEAST:g} to {end:g}: give a number between them")
    if date is not None:
        try:
            datetime.strptime(date, "%Y-%m-%d").astimezone()
        except ValueError as e:
            raise InputError(f"--date {date}: want a date such as 2026-01-31") from e


def _check_reduction(to: str, target: Target, found: reducing.ReductionOptions) -> None:
    """Reject options that a target ignores."""
    if target.shape is not None:
        return
    plain = reducing.ReductionOptions(axes=found.axes if target.axes else None)
    for option in fields(plain):
        if getattr(found, option.name) != getattr(plain, option.name):
            raise InputError(f"--{option.name.replace('_', '-')}: {to} does not support this option")


def _writer(
    target: Target, models: Sequence[ErrorModel | PositionModel], dialect: Dialect | None, named: Mapping[str, str]
) -> Callable[..., dict[str, bytes]]:
    """Return the writer of a target, with what it takes beside the compensator."""
    if target.axes and not target.corrected:
        along = {m.target: m.axis for m in models if isinstance(m, PositionModel)}
        for name, axis in named.items():
            if along.get(name, axis) != axis:
                raise InputError(f"--axes {name}={axis}: {name} was measured along {along[name]}")
        return partial(target.write, axes={**along, **named})
    return partial(target.write, dialect=dialect) if dialect else target.write


def _constant(models: Sequence[ErrorModel | PositionModel], to: str) -> list[ErrorModel]:
    """Return models that say the same at every position."""
    if along := [m.target for m in models if isinstance(m, PositionModel)]:
        raise InputError(f"{to} supports position-independent corrections only, unlike {along[0]} does")
    return [m for m in models if isinstance(m, ErrorModel)]


def _refusal(model: ErrorModel | PositionModel) -> str:
    """Return why a model must not run at all; nothing if it may, or may once it is taken."""
    parts = model.models if isinstance(model, PositionModel) else (model,)
    verdicts = [m.honest_error for m in parts if m.honest_error is not None]
    return next((v.reason for v in verdicts if v.word == "refused"), "")


def _write(output: Path, texts: Mapping[str, bytes], overwrite: bool) -> None:
    if output.exists() and not output.is_dir():
        raise InputError(f"{output}: is not a directory")
    output.mkdir(parents=True, exist_ok=True)
    with drafts([output / file for file in texts], overwrite=overwrite) as written:
        for file, text in texts.items():
            written[output / file].write_bytes(text)
        written.publish()
