"""`thermocomp check`: summary and data-quality problems of recordings."""

from functools import partial

from thermocomp.api.check import CheckedRecordings
from thermocomp.cli.answers import free
from thermocomp.cli.checked import answer_check, show_check
from thermocomp.cli.face import CommandFace, command
from thermocomp.cli.terminal import console
from thermocomp.recordings.joining import find_joins


@command("thermocomp.api.check:check", writes=".html", tell_changes=False)
def check(found: CheckedRecordings, face: CommandFace) -> int:
    """Write and show the results.

    Parameters
    ----------
    output : Path
        Output page (.html or .pdf): a plot of every channel, with the findings marked at their rows.

    Returns
    -------
    int
        0 no problems, 1 trouble found, 2 unusable input.
    """
    page = None if face.output is None else str(face.output)
    face.write(found.report)
    face.answer(
        lambda: {**found.to_dict(), "page": page},
        lambda: answer_check(found, face.files, _following(found, face)),
        partial(show_check, found, console),
    )
    return 1 if found.trouble else 0


def _following(found: CheckedRecordings, face: CommandFace) -> tuple[str, ...]:
    """Return the command that follows: map for a file that needs repair, join for two loggers, else compare."""
    for path, findings in zip(face.given["recordings"], found.findings, strict=True):
        if any(f.severity == "trouble" and f.remedy is not None for f in findings):
            return face.following("map", recording=path, output=free(f"{path.stem}.toml"))
    for words in find_joins(found.recordings):
        return (*words[:-1], str(free(words[-1])))
    whole = all(r.displacements and (r.temperatures or r.speed is not None) for r in found.recordings)
    return face.following("compare", output=free("report.html")) if whole else ()
