"""Projects of a small machine, as a folder."""

from pathlib import Path

from smallmachine import small_machine

from thermocomp.recordings.readers import recordings as files

#: quick: one method that is not tried with noise
QUICK = """name = "Small machine"  # a comment of the user

[[recordings]]
file = "files/drift.csv"

[compare]
targets = ["z_um"]
models = ["ols"]
robustness = false
jobs = 1
"""


def small_project(folder: Path, settings: str = QUICK) -> Path:
    """Return the folder of a project with one recording of four thermal cycles."""
    (folder / "files").mkdir(parents=True)
    files.write(small_machine(), folder / "files" / "drift.csv", overwrite=False)
    (folder / "project.toml").write_text(settings, encoding="utf-8")
    return folder
