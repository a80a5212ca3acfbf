"""`thermocomp run`: a project from its recordings to the code for a controller, without questions."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from thermocomp.cli.answers import free, print_answer
from thermocomp.cli.exits import STOPPED
from thermocomp.cli.explain import answer_models
from thermocomp.cli.jsonoutput import print_json
from thermocomp.cli.progress import show_progress
from thermocomp.cli.reading import print_trouble
from thermocomp.cli.terminal import console, words

if TYPE_CHECKING:
    from thermocomp.app.runfolder import RunFolder


def run(project: Path, /, *, again: bool = False, number: int = 0, json: bool = False) -> int:
    """Run a project: check its recordings, compare methods, fit the recommended ones, export and assess them.

    The results are in a new folder, ``runs/NUMBER``. A run that was stopped or killed is continued with the step that
    was interrupted, unless its recordings or settings have changed since.

    Parameters
    ----------
    project : Path
        Project file (project.toml), or its folder.
    again : bool
        Start a new run, even if nothing has changed since the last one.
    number : int
        Number of an earlier run: export and assess its models, although the settings have changed since. 0: the last
        run.
    json : bool
        Print results as JSON instead of tables.

    Returns
    -------
    int
        0 done, 1 no model may run, 2 unusable input, 130 interrupted from the keyboard.
    """
    from thermocomp.app.project import Project
    from thermocomp.app.running import run_project
    from thermocomp.core.exceptions import InputError
    from thermocomp.core.explained import explain_all
    from thermocomp.files import modelfile

    opened = Project(project)
    try:
        with show_progress(hidden=json, warn=print_trouble) as progress:
            folder = run_project(opened, progress, again=again, number=number).folder
    except KeyboardInterrupt:
        console.print(words(f"stopped; to continue: thermocomp run {project}"), soft_wrap=True)
        return STOPPED
    if json:
        print_json({"folder": str(folder.path), "steps": [_told(step) for step in folder.read()["steps"]]})
    models = explain_all(modelfile.read(folder.path / "model.json")).models
    if not json:
        print_answer(answer_models(models, _following(project, folder), [folder.path]), console, hint=False)
    # of an earlier run only these are done again
    if errors := [e for e in folder.errors() if not number or e.startswith(("export: ", "assess: "))]:
        raise InputError("; ".join(errors))
    return 0 if any(e.word.startswith("accepted") for e in models) else 1


def _told(step: Mapping[str, Any]) -> dict[str, Any]:
    told = {"step": step["name"], "seconds": step["seconds"], "files": step["files"], "result": step["text"]}
    return told | ({"error": step["error"]} if step["error"] else {})


def _following(project: Path, folder: "RunFolder") -> tuple[str, ...]:
    """Return the command that follows: export, unless the project does it."""
    exported = any(step["name"] == "export" and not step["error"] for step in folder.read()["steps"])
    model = str(folder.path / "model.json")
    return (
        ("thermocomp", "app", str(project))
        if exported
        else ("thermocomp", "export", model, "--to", "c99", "-o", str(free("c99")))
    )
