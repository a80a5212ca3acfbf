"""Routes of the page for the evidence of its runs: curves of a method, two runs side by side, the trial of a model."""

import io
import zipfile
from pathlib import Path
from typing import Annotated, Any

from fastapi import APIRouter
from fastapi import Path as InPath
from starlette.exceptions import HTTPException
from starlette.responses import Response

from thermocomp.app.comparing import compare_runs, read_json
from thermocomp.app.livetrial import LiveTrial
from thermocomp.app.runfolder import RunFolder, runs_of
from thermocomp.app.store import NAME, Store, find_inside
from thermocomp.core.exceptions import InputError
from thermocomp.live.page.doors import Json

#: number of a run in an address
RunNumber = Annotated[int, InPath(ge=1, le=10**9)]


def view_runs(store: Store) -> APIRouter:
    """Return the routes; those that read large files are answered in threads."""
    router, trial = APIRouter(), LiveTrial()

    @router.get("/api/live")
    async def told() -> Json:
        return Json(trial.tell())

    @router.post("/api/live/{number}")
    async def start(number: RunNumber) -> Json:
        await trial.start(run_of(store.folder, number))
        return Json(trial.tell())

    @router.delete("/api/live")
    async def stop() -> Json:
        await trial.stop()
        return Json(trial.tell())

    @router.get("/api/runs/{number}/curves")
    def curves(number: RunNumber, target: str, model: str) -> Json:
        content = read_json(run_of(store.folder, number).path / "curves.json")
        for one in content.get("curves", ()) if isinstance(content, dict) else ():
            if (one["target"], one["model"]) == (target, model):
                return Json(one["panels"])
        raise HTTPException(404, f"run {number} has no curves of {model} for {target}")

    @router.get("/api/runs/{number}/zip/{name}")
    def package(number: RunNumber, name: str) -> Response:
        folder, content = find_inside(run_of(store.folder, number).path, name), io.BytesIO()
        if not name.startswith("export") or not folder.is_dir():
            raise HTTPException(404, f"run {number} has no package {name}")
        with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as whole:
            for path in sorted(p for p in folder.rglob("*") if p.is_file() and not p.is_symlink()):
                whole.write(path, f"{name}/{path.relative_to(folder).as_posix()}")
        return Response(content.getvalue(), media_type="application/zip")

    @router.get("/api/projects")
    def projects() -> Json:
        return Json({"projects": _beside(store.folder)})

    @router.get("/api/runs/{number}/beside/{other}")
    def beside(number: RunNumber, other: RunNumber, project: str = "") -> Json:
        there = _project(project) if project else store.folder
        try:
            return Json(compare_runs(run_of(there, other), run_of(store.folder, number)))
        except (KeyError, TypeError, AttributeError, ValueError) as e:
            raise InputError("the results of these runs were not written by this version: run them again") from e

    @router.get("/api/others")
    def others(project: str) -> Json:
        return Json({"runs": [_brief(r) for r in runs_of(_project(project))]})

    return router


def _beside(folder: Path) -> list[str]:
    """Return the other projects in the folder that contains this one."""
    try:
        own = folder.resolve()
        return sorted(str(p) for p in own.parent.iterdir() if p != own and (p / NAME).is_file())[:100]
    except OSError:
        return []


def _project(name: str) -> Path:
    try:
        if (found := Path(name)).is_absolute() and (found / NAME).is_file():
            return found
    except (OSError, ValueError):  # a name too long, or with a null character
        pass
    raise InputError(f"{name[:200]!r}: this folder has no {NAME}; give the whole path of a project")


def _brief(run: RunFolder) -> dict[str, Any]:
    state = run.read()
    return {"number": run.number, "state": state["state"], "began": state["began"]}


def run_of(folder: Path, number: int) -> RunFolder:
    """Return a run of a project; 404 if there is none with this number."""
    for run in runs_of(folder):
        if run.number == number:
            return run
    raise HTTPException(404, f"there is no run {number}")
