"""Python functions that export models as program code for controllers."""

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
    """Exported code for a controller.

    Parameters
    ----------
    files : mapping of str to bytes
        Contents by file name, the page of instructions last; empty if nothing may be written.
    refused : mapping of str to str
        Targets that are refused, with the reason.
    elsewhere : mapping of str to str
        Targets that the controller does not correct, with the reason.
    """

    files: Mapping[str, bytes]
    refused: Mapping[str, str]
    elsewhere: Mapping[str, str] = field(default_factory=dict)

    @property
    def verdict(self) -> str:
        """Verdict on the model: first line of the page of instructions."""
        return self._head[0]

    @property
    def notes(self) -> list[str]:
        """Losses of the export that its user has to know of: further lines of the page."""
        return [line for line in self._head if line.startswith("Single precision")]

    @property
    def _head(self) -> list[str]:
        page = self.files[list(self.files)[-1]].decode() if self.files else ""
        return page.split("\n\n", 1)[0].split("  \n")

    def to_dict(self) -> dict[str, Any]:
        """Return all results as a dict, as printed by ``--json``."""
        return {"files": list(self.files), "refused": {**self.refused, **self.elsewhere}}

    def save(self, folder: str | Path, *, overwrite: bool = False) -> Path:
        """Write all files into a folder, or none on an error; return its path."""
        output = Path(folder)
        if output.exists() and not output.is_dir():
            raise InputError(f"{output}: this is not a directory; name a directory")
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
    vectors_from: "str | Path | Recording | None" = None,
    accept_unproven: str | None = None,
    date: str | None = None,
    progress: Callable[..., None] = silent,
    **settings: Any,
) -> ExportedCode:
    """Export the models of a file as code for another controller, with test vectors and instructions.

    The code works like ``thermocomp serve``: it averages the zero (reference temperatures), rejects implausible
    readings, replaces a failed sensor, holds and fades the correction in time, and applies the limits. An ONNX graph is
    the model alone, with a program that runs it inside such a compensator. A refused model is not exported; the
    correction of an unproven one stays zero.

    klipper, heidenhain, fanuc, haas and okuma support simpler models only: the best one of these is fitted to
    recordings, judged on unseen cycles next to the full model, and written with the loss of accuracy.

    Parameters
    ----------
    model : str or Path
        Model file from ``thermocomp fit`` or ``thermocomp position``.
    to : {'c99', 'st', 'siemens', 'beckhoff', 'linuxcnc', 'onnx', 'klipper', 'heidenhain', 'fanuc', \
'haas', 'okuma'}
        Output format. c99: a header and a source file in C99, for a DSP, a PLC or a computer; st: a function block in
        structured text, IEC 61131-3; siemens, beckhoff: the same, with the parameters of the temperature compensation
        of these controllers; linuxcnc: the C99 code as a HAL component, and a HAL file that corrects X, Y and Z; onnx:
        each model as a graph, for a computer with an ONNX runtime; klipper: settings of z_thermal_adjust; heidenhain: a
        formula; fanuc, haas, okuma: a macro.
    recordings : Recording, path, DataFrame, or sequence of them, optional
        CSV, XLSX or Parquet files to which the simpler model of such a controller is fitted; each one is a separate
        test.
    name : str
        Name of the files and functions, after the prefix ``tc_``.
    dialect : {'codesys', 'twincat', 'scl', 'iec'}, optional
        Dialect of structured text. Default: codesys.
    limits : Limits
        Limits of the correction.
    starts : Start or sequence of Start, optional
        As for `compare`.
    mapping : str, Path or Mapping, optional
        TOML mapping file: role and unit of each column of the recordings.
    vectors_from : Recording, str or Path, optional
        Recording of which test vectors are made, too, for c99 and st: up to 1,500 of its readings at its times, and
        the compensator's response.
    accept_unproven : str, optional
        Person who approves the use of an unproven model, and the reason: "NAME, REASON".
    date : str, optional
        Date written into the file headers, such as 2026-01-31. Default: today.
    progress : callable
        Called with a line of text per reduced model.
    **settings
        Settings of the reduction, see `thermocomp.export.reduction.options.ReductionOptions`: ``axes=["ch5_um=Z"]``.

    Returns
    -------
    ExportedCode

    Raises
    ------
    InputError
        A file or setting is invalid, or the controller does not support a requested setting.

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
    if Path(model).suffix.lower() == ".toml":
        raise InputError(
            f"{model}: a machine file cannot be exported; name the model file in it ('thermocomp position' writes one "
            "for all axes)"
        )
    models = [m.taken(accept_unproven) for m in read_models(Path(model))]
    refused = {m.target: why for m in models if (why := _refusal(m))}
    elsewhere = {}
    if target.shape is None:
        elsewhere = {m.target: f"it predicts {m.unit}, but a correction is in um" for m in models if m.unit != "um"}
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
        found = _export_whole(order, left, dialect, _recording(to, target, vectors_from, mapping))
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
    """Return the recordings to reduce a model on; without any, no training code is imported."""
    if recordings is None:
        return []
    from thermocomp.api.inputs import recordings_of, trouble_of

    tests = recordings_of(recordings, mapping)
    if target.shape is None:
        raise InputError(
            f"{to} exports the whole model and accepts no recordings, found {tests[0].source or tests[0].name}"
        )
    listener.warn(trouble_of(tests))
    return tests


def _recording(
    to: str, target: Target, given: "str | Path | Recording | None", mapping: "str | Path | Columns | None"
) -> "Recording | None":
    """Return the recording of which test vectors are made."""
    if given is None:
        return None
    if not target.vectors:
        raise InputError(f"--vectors-from: {to} does not support it; --to c99 and --to st do")
    from thermocomp.api.inputs import recordings_of

    return recordings_of(given, mapping)[0]


def _facts(model: Path, date: str | None, left_out: Mapping[str, str]) -> Facts:
    return Facts(
        source=model.name,
        sha256=sha256(model.read_bytes()).hexdigest(),
        version=__version__,
        date=date or datetime.now(UTC).astimezone().date().isoformat(),
        left_out=left_out,
    )


def _export_whole(
    order: ExportOrder, models: Models, dialect: Dialect | None, recording: "Recording | None"
) -> Outcome:
    """Create the files for a target that supports the full model."""
    target, options, elsewhere = order.target, order.options, dict[str, str]()
    writer = _writer(target, models, dialect, options.named())
    writer = partial(writer, recording=recording) if recording is not None else writer
    if target.corrected:
        models, axes, elsewhere = along_axes(models, options, order.to, target.corrected)
        writer = partial(target.write, axes=axes)
    with needs("onnx"):  # needed by one of the targets
        files = writer(Compensator.of(models, order.limits, watching=True), order.name, order.facts)
    return Outcome(files, {}, elsewhere)


def _check(to: str, target: Target, name: str, date: str | None, limits: Limits) -> None:
    """Reject settings that yield no file, or a file that no controller supports."""
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
    if not 1 <= found.program <= 9999:
        raise InputError(f"--program {found.program}: expected a program number from 1 to 9999")
    if not target.program and found.program != ReductionOptions.program:
        raise InputError(f"--program: {to} does not support this option")
    if target.shape is not None:
        return
    plain = ReductionOptions(axes=found.axes if target.axes else None)
    for option in fields(plain):
        if getattr(found, option.name) != getattr(plain, option.name):
            raise InputError(f"--{option.name.replace('_', '-')}: {to} does not support this option")


def _writer(
    target: Target, models: Models, dialect: Dialect | None, named: Mapping[str, str]
) -> Callable[..., dict[str, bytes]]:
    """Return the writer of a target, with its arguments other than the compensator."""
    if target.axes and not target.corrected:
        along = {m.target: m.axis for m in models if isinstance(m, PositionModel)}
        for name, axis in named.items():
            if along.get(name, axis) != axis:
                raise InputError(f"--axes {name}={axis}: {name} was measured along {along[name]}")
        return partial(target.write, axes={**along, **named})
    return partial(target.write, dialect=dialect) if dialect else target.write


def _constant(models: Models, to: str) -> list[ErrorModel]:
    """Return models with the same output at every position."""
    if along := [m.target for m in models if isinstance(m, PositionModel)]:
        raise InputError(f"{to} supports position-independent corrections only, but {along[0]} depends on position")
    return [m for m in models if isinstance(m, ErrorModel)]


def _refusal(model: ErrorModel | PositionModel) -> str:
    """Return the reason why a model must never run; empty if it may run, or may run once it is approved."""
    parts = model.models if isinstance(model, PositionModel) else (model,)
    verdicts = [m.honest_error for m in parts if m.honest_error is not None]
    return next((v.reason for v in verdicts if v.word == "refused"), "")
