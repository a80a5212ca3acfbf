"""Models as code for another controller, in Python."""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from datetime import UTC, datetime
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

from thermocomp import __version__
from thermocomp.api.keywords import Listener, settings_of, silent
from thermocomp.cli.extras import needs
from thermocomp.core.bounds import GAP, LEAST, RANGE
from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError
from thermocomp.core.model import ErrorModel
from thermocomp.core.position import PositionModel
from thermocomp.export.facts import Facts
from thermocomp.export.reducing import ExportOrder, Outcome, along_axes, export_reduced
from thermocomp.export.reduction.options import ReductionOptions
from thermocomp.export.st.ststatements import Dialect
from thermocomp.export.target import Target, find_target
from thermocomp.files.draft import drafts
from thermocomp.files.machines import read_models
from thermocomp.runtime.compensator import Compensator

if TYPE_CHECKING:
    from thermocomp.api.inputs import Given, Starts
    from thermocomp.recordings.readers.mapping import Mapping as Columns
    from thermocomp.recordings.recording import Recording

Models = Sequence[ErrorModel | PositionModel]


@dataclass(frozen=True, eq=False)
class ExportedCode:
    """Code for a controller.

    Parameters
    ----------
    files : mapping of str to bytes
        By their names, the page how to use them the last; none if nothing may be written.
    refused : mapping of str to str
        Targets that may not be written, and why.
    elsewhere : mapping of str to str
        Targets that the controller does not correct, and why.
    """

    files: Mapping[str, bytes]
    refused: Mapping[str, str]
    elsewhere: Mapping[str, str] = field(default_factory=dict)

    @property
    def verdict(self) -> str:
        """May it run: the first line of the page how to use it."""
        return self.files[list(self.files)[-1]].decode().split("  \n", 1)[0] if self.files else ""

    def to_dict(self) -> dict[str, Any]:
        """Return all of it for a program: what ``--json`` prints."""
        return {"files": list(self.files), "refused": {**self.refused, **self.elsewhere}}

    def save(self, folder: str | Path, *, overwrite: bool = False) -> Path:
        """Write the files into a folder, all of them or none; return its path."""
        output = Path(folder)
        if output.exists() and not output.is_dir():
            raise InputError(f"{output}: is not a directory")
        if self.files:
            output.mkdir(parents=True, exist_ok=True)
            with drafts([output / file for file in self.files], overwrite=overwrite) as written:
                for file, text in self.files.items():
                    written[output / file].write_bytes(text)
                written.publish()
        return output


def export(
    model: str | Path,
    to: str,
    recordings: "Given | None" = None,
    *,
    name: str = "thermal",
    dialect: Dialect | None = None,
    limits: Limits = Limits(),
    starts: "Starts" = None,
    mapping: "str | Path | Columns | None" = None,
    accept_unproven: str | None = None,
    date: str | None = None,
    progress: Callable[..., None] = silent,
    **settings: Any,
) -> ExportedCode:
    """Write the models of a file as code for another controller, with test vectors and how to use it.

    The code does what ``thermocomp serve`` does: it averages the zero, turns away what is not plausible, replaces a
    sensor that failed, holds and fades in time, and keeps the limits; as ONNX it takes the zero from its caller and
    replaces no sensor. A refused model is left out; of an unproven one the correction stays zero.

    klipper, heidenhain and fanuc hold less than a model: the best one of what they hold is fitted to recordings, judged
    on unseen cycles beside the full one, and written with what is lost.

    Parameters
    ----------
    model : str or Path
        Model file from ``thermocomp fit``, or of ``thermocomp position``.
    to : {'c99', 'st', 'siemens', 'beckhoff', 'linuxcnc', 'onnx', 'klipper', 'heidenhain', 'fanuc'}
        What to write: c99 is one header and one source of C99, for a DSP, a PLC or a computer; st a function block in
        structured text, IEC 61131-3; siemens and beckhoff the same and what their temperature compensation takes;
        linuxcnc the C99 as a component of HAL, and HAL that moves X, Y and Z; onnx one step as a graph, for a computer
        with a runtime of ONNX; klipper its z_thermal_adjust; heidenhain a formula; fanuc a macro.
    recordings : Recording, path, DataFrame, or sequence of them, optional
        For klipper, heidenhain and fanuc: CSV, XLSX or Parquet files to reduce the model on; each is one test.
    name : str
        Of the files and functions, behind tc_.
    dialect : {'codesys', 'twincat', 'scl'}, optional
        Of structured text; codesys if not given.
    limits : Limits
        Of the correction.
    starts : Start or sequence of Start, optional
        As for `compare`.
    mapping : str, Path or Mapping, optional
        TOML file that says what the columns of the recordings are.
    accept_unproven : str, optional
        Person who approves the use of an unproven model, and the reason: "NAME, REASON".
    date : str, optional
        For the first lines, such as 2026-01-31; today if not given.
    progress : callable
        Called with a line of text per reduced model.
    **settings
        Of the reduction, see `thermocomp.export.reduction.options.ReductionOptions`: ``axes=["ch5_um=Z"]``.

    Returns
    -------
    ExportedCode

    Raises
    ------
    InputError
        A file or setting cannot be used, or the controller does not take what is asked for.

    Examples
    --------
    >>> import thermocomp as tc
    >>> fitted = tc.fit(tc.simulate("wessel-milling"), "s1_um", "ols", leave_one="file")
    >>> found = tc.export(fitted.save("model.json"), "c99")
    >>> found.verdict, len(found.files)
    ('s1_um: accepted on unseen cycles', 4)
    >>> found.save("code").name
    'code'
    """
    target, options = find_target(to), settings_of(ReductionOptions, settings, "export")
    _check(to, target, name, date, limits)
    _check_options(to, target, options, dialect)
    listener = Listener(progress)
    tests = _read(to, target, recordings, mapping, listener)
    models = [m.taken(accept_unproven) for m in read_models(Path(model))]
    refused = {m.target: why for m in models if (why := _refusal(m))}
    elsewhere = {}
    if target.shape is None:
        elsewhere = {m.target: f"it predicts {m.unit}, and a correction is in um" for m in models if m.unit != "um"}
    left = [m for m in models if m.target not in refused and m.target not in elsewhere]
    if not left:
        return ExportedCode({}, refused, elsewhere)
    order = ExportOrder(
        to=to,
        target=target,
        limits=limits,
        name=name,
        facts=_facts(Path(model), date, refused | elsewhere),
        options=options,
    )
    if target.shape is None:
        found = _export_whole(order, left, dialect)
    else:
        found = export_reduced(order, _constant(left, to), tests, starts, accept_unproven, listener)
    return ExportedCode(found.files, refused | found.refused, elsewhere | found.elsewhere)


def _read(
    to: str,
    target: Target,
    recordings: "Given | None",
    mapping: "str | Path | Columns | None",
    listener: Listener,
) -> "list[Recording]":
    """Return the recordings to reduce a model on; without any nothing of the training side is loaded."""
    if recordings is None:
        return []
    from thermocomp.api.inputs import recordings_of, trouble_of

    tests = recordings_of(recordings, mapping)
    if target.shape is None:
        raise InputError(
            f"{to} holds the whole model and takes no recordings, found {tests[0].source or tests[0].name}"
        )
    listener.warn(trouble_of(tests))
    return tests


def _facts(model: Path, date: str | None, left_out: Mapping[str, str]) -> Facts:
    return Facts(
        source=model.name,
        sha256=sha256(model.read_bytes()).hexdigest(),
        version=__version__,
        date=date or datetime.now(UTC).astimezone().date().isoformat(),
        left_out=left_out,
    )


def _export_whole(order: ExportOrder, models: Models, dialect: Dialect | None) -> Outcome:
    """Make the files of an export to a target that holds all of a model."""
    target, options, elsewhere = order.target, order.options, dict[str, str]()
    writer = _writer(target, models, dialect, options.named())
    if target.corrected:
        models, axes, elsewhere = along_axes(models, options, order.to, target.corrected)
        writer = partial(target.write, axes=axes)
    with needs("onnx"):  # one of them does
        files = writer(Compensator.of(models, order.limits, watching=True), order.name, order.facts)
    return Outcome(files, {}, elsewhere)


def _check(to: str, target: Target, name: str, date: str | None, limits: Limits) -> None:
    """Refuse what would make no file, or one that no controller takes."""
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
        raise InputError(f"--name {name!r}: expected letters, digits and _, a letter first, such as mill_3")
    most = {"magnitude": target.magnitude, "rate": RANGE, "hold": GAP, "fade": GAP, "reading_age": GAP}
    for option, end in most.items():
        value, named = getattr(limits, option), f"--{option.replace('_', '-')}"
        if not math.isfinite(value):
            raise InputError(f"{named} {value}: {to} needs a finite number")
        if not LEAST <= value <= end:
            raise InputError(f"{named} {value:g}: {to} accepts {LEAST:g} to {end:g}: give a number in this range")
    if date is not None:
        try:
            datetime.strptime(date, "%Y-%m-%d").astimezone()
        except ValueError as e:
            raise InputError(f"--date {date}: expected a date such as 2026-01-31") from e


def _check_options(to: str, target: Target, found: ReductionOptions, dialect: Dialect | None) -> None:
    """Reject options that a target ignores."""
    if dialect is not None and dialect not in target.dialects:
        raise InputError(f"--dialect {dialect}: {to} does not support it; --to st does")
    if target.shape is not None:
        return
    plain = ReductionOptions(axes=found.axes if target.axes else None)
    for option in fields(plain):
        if getattr(found, option.name) != getattr(plain, option.name):
            raise InputError(f"--{option.name.replace('_', '-')}: {to} does not support this option")


def _writer(
    target: Target, models: Models, dialect: Dialect | None, named: Mapping[str, str]
) -> Callable[..., dict[str, bytes]]:
    """Return the writer of a target, with what it takes beside the compensator."""
    if target.axes and not target.corrected:
        along = {m.target: m.axis for m in models if isinstance(m, PositionModel)}
        for name, axis in named.items():
            if along.get(name, axis) != axis:
                raise InputError(f"--axes {name}={axis}: {name} was measured along {along[name]}")
        return partial(target.write, axes={**along, **named})
    return partial(target.write, dialect=dialect) if dialect else target.write


def _constant(models: Models, to: str) -> list[ErrorModel]:
    """Return models that say the same at every position."""
    if along := [m.target for m in models if isinstance(m, PositionModel)]:
        raise InputError(f"{to} supports position-independent corrections only, but {along[0]} depends on position")
    return [m for m in models if isinstance(m, ErrorModel)]


def _refusal(model: ErrorModel | PositionModel) -> str:
    """Return why a model must not run at all; nothing if it may, or may once it is taken."""
    parts = model.models if isinstance(model, PositionModel) else (model,)
    verdicts = [m.honest_error for m in parts if m.honest_error is not None]
    return next((v.reason for v in verdicts if v.word == "refused"), "")
