"""`thermocomp map`: a mapping for a file, from a few questions about its columns and the cleaning needed."""

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from thermocomp.cli.jsonoutput import print_json
from thermocomp.cli.options import OptionalOutput
from thermocomp.cli.terminal import console, make_console, words
from thermocomp.core.exceptions import InputError, Remedy
from thermocomp.core.outputs import refuse_existing

if TYPE_CHECKING:
    from thermocomp.recordings.readers.mending import Mended, Question

_stderr = make_console(stderr=True)


def map(
    recording: Path,
    /,
    *,
    mapping: Path | None = None,
    output: OptionalOutput = None,
    yes: bool = False,
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """Write a mapping file for reading and cleaning a logger's file, asking for what cannot be determined.

    Parameters
    ----------
    recording : Path
        Recording to map (CSV, XLSX, ODS or Parquet file).
    mapping : Path
        TOML mapping file to start from, such as that of another test of the same logger; its comments are kept.
    output : Path
        Output mapping file (.toml). Default: the mapping is printed.
    yes : bool
        Ask no questions: use the best guess, and repair what `check` reports as trouble. Settings that change the
        duration of a recording, such as the unit of time or the order of day and month, are never guessed: a file that
        needs them is refused.
    overwrite : bool
        Overwrite an existing file.
    json : bool
        Print results as JSON instead of the mapping; no questions are asked.

    Returns
    -------
    int
        0 nothing is left to repair, 1 `check` still finds trouble, 2 unusable input.
    """
    if output is not None:
        refuse_existing(
            [output], overwrite, [p for p in (recording, mapping) if p is not None and p != output], ".toml"
        )
    from thermocomp.recordings.checks.quality import check
    from thermocomp.recordings.readers.mending import mend, read_draft, take_best, to_toml

    mended = mend(recording, read_draft(mapping), take_best if yes or json else _ask)
    left = [f for f in check(mended.recording) if f.severity == "trouble"]
    if output is not None:
        mended.save(output, overwrite=overwrite)
    if json:
        print_json(_content(mended, output, [f"{f.channel} {f.text}".strip() for f in left]))
        return 1 if left else 0
    for question, answer in mended.decided:
        if answer is not None and question.others:
            _stderr.print(
                f"[yellow]taken[/] {words(to_toml(answer).replace(chr(10), ' '))}: {words(question.text)}",
                soft_wrap=True,
            )
    for note in mended.recording.notes:
        _stderr.print(f"[dim]note[/] {words(note)}", soft_wrap=True)
    for f in left:
        _stderr.print(f"[bold red]left[/] {words(f'{f.channel} {f.text}'.strip())}", soft_wrap=True)
    if output is None:
        print(mended.text, end="")
    else:
        console.print(
            f"Mapping file: {words(str(output))}; give it with --mapping {words(str(output))}", soft_wrap=True
        )
    return 1 if left else 0


def _content(mended: "Mended", output: Path | None, left: Sequence[str]) -> dict[str, Any]:
    from thermocomp.recordings.readers.mending import to_toml

    return {
        "file": None if output is None else str(output),
        "mapping": mended.text,
        "decided": [
            {"question": q.text, "severity": q.severity, "answer": None if answer is None else to_toml(answer)}
            for q, answer in mended.decided
        ],
        "notes": list(mended.recording.notes),
        "left": list(left),
    }


def _ask(question: "Question") -> Remedy | None:
    """Ask a question on the terminal; return the answer, or None to keep the current value."""
    from thermocomp.recordings.readers.mapping import check_content
    from thermocomp.recordings.readers.mending import to_toml

    _stderr.print(f"\n[bold]?[/] {words(question.text)}", soft_wrap=True)
    for k, option in enumerate(question.options, start=1):
        _stderr.print(f"  [bold]{k}[/] {words(to_toml(option).replace(chr(10), '; '))}", soft_wrap=True)
    _stderr.print("  [bold]0[/] leave it as it is")
    own = next((name for name in question.options[0].get("columns", ())), "")
    more = ', or custom keys, such as: role = "displacement", unit = "mm", scale = 0.0025' if own else ""
    best = "0" if question.severity in ("warning", "info") else "1" if question.may_guess else ""
    while True:
        _stderr.print(f"  number{more}{f' [{best}]' if best else ''}: ", end="", markup=False, soft_wrap=True)
        try:
            said = input().strip()
        except EOFError as e:
            way = "use --yes to accept the best guess" if question.may_guess else "write the answer into a mapping file"
            raise InputError(f"standard input ended before an answer was given; {way}") from e
        said = {"": best, "y": "1", "yes": "1", "n": "0", "no": "0"}.get(said.lower(), said)
        if said.isdigit() and int(said) <= len(question.options):
            return question.options[int(said) - 1] if int(said) else None
        try:
            keys = tomllib.loads(f"keys = {{ {said} }}")["keys"] if own and "=" in said else {}
            place = {k: v for k, v in question.options[0].get("columns", {}).get(own, {}).items() if k == "column"}
            if keys:
                check_content({"columns": {own: {**place, **keys}}}, "your answer")
                return {"columns": {own: {**place, **keys}}}
        except (tomllib.TOMLDecodeError, InputError) as e:
            _stderr.print(f"  {words(e)}", soft_wrap=True)
        _stderr.print(f"  expected a number from 0 to {len(question.options)}{' or keys' if own else ''}")
