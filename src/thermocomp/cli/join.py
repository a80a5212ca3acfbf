"""`thermocomp join`: one recording of those of several loggers."""

from pathlib import Path

from thermocomp.api.join import JoinedRecordings
from thermocomp.cli.face import CommandFace, command
from thermocomp.cli.terminal import console, words
from thermocomp.report.answer import CommandAnswer
from thermocomp.report.layout import PrintedLine


def files_of(output: Path, _given: object) -> list[Path]:
    """Return the path of the joined recording."""
    return [output]


@command("thermocomp.api.join:join", writes=files_of, needs_output=True, forms={"offset": list[float] | None})
def join(found: JoinedRecordings, face: CommandFace) -> int:
    """Write the recording, and show how the clocks were brought together.

    Parameters
    ----------
    output : Path
        Output file (.parquet or .csv).

    Returns
    -------
    int
        0 done, 2 unusable input.
    """
    face.write(found.save)
    face.answer(
        lambda: {**found.to_dict(), "file": str(face.output)}, lambda: _answer(found, face), lambda: _show(found)
    )
    return 0


def _answer(found: JoinedRecordings, face: CommandFace) -> CommandAnswer:
    r = found.recording
    missing = int(r.table.isna().any(axis=1).sum())
    return CommandAnswer(
        head="; ".join(map(str, found.alignments)) + ".",
        lines=[
            PrintedLine(
                f"Joined: {len(r)} rows, {r.time[-1] / 3600:.1f} h, {len(r.temperatures)} temperatures, "
                f"{len(r.displacements)} displacements, {len(r.cycles)} thermal cycle(s)."
            )
        ],
        warnings=[f"{missing} rows lack a value"] if missing else [],
        files=face.files,
        following=("thermocomp", "check", str(face.output)),
    )


def _show(found: JoinedRecordings) -> None:
    for a in found.alignments:
        for note in a.notes:
            console.print(f"[dim]note[/] {words(note)}", soft_wrap=True)
