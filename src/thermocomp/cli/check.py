"""`thermocomp check`: what recordings hold, and what is wrong with them."""

from pathlib import Path

from thermocomp.cli.options import OptionalOutput
from thermocomp.cli.reading import read_recordings
from thermocomp.cli.terminal import console
from thermocomp.files.draft import refuse_existing


def check(
    recordings: list[Path],
    /,
    *,
    mapping: Path | None = None,
    output: OptionalOutput = None,
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """Summarise recordings and report data-quality problems; of more than three files, a line each.

    Parameters
    ----------
    recordings : list of Path
        CSV, XLSX or Parquet files; each is one test.
    mapping : Path
        TOML file that says what the columns are.
    output : Path
        Page to write (.html): every channel drawn, with what was found marked at its rows.
    overwrite : bool
        Write over an existing page.
    json : bool
        Print results for a machine instead of a table.

    Returns
    -------
    int
        0 nothing wrong, 1 trouble found, 2 unusable input.
    """
    if output is not None:
        refuse_existing([output], overwrite, recordings, ".html")
    tests = read_recordings(recordings, mapping, tell=False)
    from thermocomp.cli import checked
    from thermocomp.recordings.checks.quality import check as findings_of

    findings = [findings_of(test) for test in tests]
    if output is not None:
        from thermocomp.report import checks

        checks.write(tests, findings, output, overwrite=overwrite)
    checked.show_check(tests, findings, output, console, as_json=json)
    return 1 if any(f.severity == "trouble" for found in findings for f in found) else 0
