"""`thermocomp export`: a model file as code for another controller, with its proof."""

from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from hashlib import sha256
from pathlib import Path
from typing import Literal

from thermocomp import __version__
from thermocomp.cli.extras import needs
from thermocomp.cli.jsonoutput import print_json
from thermocomp.cli.options import CompensatorOptions, Output
from thermocomp.cli.terminal import console, words
from thermocomp.core.draft import drafts
from thermocomp.core.exceptions import InputError
from thermocomp.exporters import cpackage, onnxpackage
from thermocomp.exporters.facts import Facts
from thermocomp.files import modelfile
from thermocomp.runtime.compensator import Compensator

Target = Literal["c99", "onnx"]

#: all files of an export by their names, the page how to use it the last
WRITERS: dict[Target, Callable[[Compensator, str, Facts], dict[str, bytes]]] = {
    "c99": cpackage.write_package,
    "onnx": onnxpackage.write_package,
}


def export(
    model: Path,
    /,
    *,
    to: Target,
    output: Output,
    name: str = "thermal",
    hold: float = 1800.0,
    fade: float = 3600.0,
    reading_age: float = 60.0,
    compensator: CompensatorOptions = CompensatorOptions(),  # noqa: B008 - frozen
    accept_unproven: str | None = None,
    date: str | None = None,
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """Write the models of a file as code for another controller, with test vectors and how to use it.

    The code does what ``thermocomp serve`` does: it averages the zero, turns away what is not plausible, replaces a
    sensor that failed, holds and fades in time, and keeps the limits; as ONNX it takes the zero from its caller and
    replaces no sensor. A refused model is left out; of an unproven one the correction stays zero.

    Parameters
    ----------
    model : Path
        Model file from ``thermocomp fit``.
    to : {'c99', 'onnx'}
        What to write: c99 is one header and one source of C99, for a DSP, a PLC or a computer; onnx is one step as a
        graph, for a computer with a runtime of ONNX.
    output : Path
        Folder to write into.
    name : str
        Of the files and functions, behind tc_.
    hold : float
        So long a correction stays without a usable reading [s].
    fade : float
        Time constant with which it goes to zero after that [s].
    reading_age : float
        Older readings are not used [s].
    compensator : CompensatorOptions
        Its limits.
    accept_unproven : str
        Who takes an unproven model all the same, and why: "NAME, REASON".
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
    models = [m.taken(accept_unproven) for m in modelfile.read(model)]
    refused = [m for m in models if m.honest_error is not None and m.honest_error.word == "refused"]
    left = [m for m in models if m not in refused]
    texts: dict[str, bytes] = {}
    if left:
        limits = replace(compensator.limits(), hold=hold, fade=fade, reading_age=reading_age)
        facts = Facts(
            model.name,
            sha256(model.read_bytes()).hexdigest(),
            __version__,
            date or datetime.now(UTC).astimezone().date().isoformat(),
        )
        with needs("onnx"):  # one of them does
            texts = WRITERS[to](Compensator.of(left, limits, watching=True), name, facts)
        if output.exists() and not output.is_dir():
            raise InputError(f"{output}: is no folder")
        output.mkdir(parents=True, exist_ok=True)
        with drafts([output / file for file in texts], overwrite=overwrite) as written:
            for file, text in texts.items():
                written[output / file].write_bytes(text)
            written.publish()
    reasons = {m.target: m.honest_error.reason for m in refused if m.honest_error is not None}
    if json:
        print_json({"files": [str(output / file) for file in texts], "refused": reasons})
    else:
        for target, why in reasons.items():
            console.print(f"[red]refused[/] {words(f'{target} is left out: {why}')}", soft_wrap=True)
        if texts:
            console.print(words(texts[list(texts)[-1]].decode().split("  \n", 1)[0]), soft_wrap=True)
            console.print(words(f"Written: {', '.join(str(output / file) for file in texts)}"), soft_wrap=True)
            console.print(words(f"Prove it as {output / list(texts)[-1]} says."), soft_wrap=True)
    return 1 if refused else 0
