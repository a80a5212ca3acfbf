"""A run of a project: the verbs of the command line in their order, with their results in a folder of its own."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import tomlkit

from thermocomp import __version__
from thermocomp.api.check import check
from thermocomp.api.inputs import read
from thermocomp.api.join import join
from thermocomp.api.plan import plan
from thermocomp.api.results import Compared, FittedModels
from thermocomp.api.select import select
from thermocomp.api.verbs import assess, compare
from thermocomp.app.evidence import curves_of, live_configuration, points_of, words_of
from thermocomp.app.project import COMMON, Project, ProjectRecording, given
from thermocomp.app.runfolder import RunFolder, RunStep, new_run, runs_of
from thermocomp.app.store import NAME
from thermocomp.cli.answers import free
from thermocomp.cli.jsonoutput import as_text
from thermocomp.core.exceptions import InputError, ThermocompError
from thermocomp.export.target import find_target
from thermocomp.export.verbs import export
from thermocomp.files.draft import write_text
from thermocomp.recordings.recording import Recording
from thermocomp.report.html import name_project
from thermocomp.report.language import translate, use_language

#: minimum time between two writes of the progress [s]
OFTEN = 0.5


class RunProgress:
    """Progress of a verb, in the state of a run.

    Parameters
    ----------
    tell : callable
        Also called with each line of text.
    """

    def __init__(self, folder: RunFolder, tell: Callable[..., object]) -> None:
        self._folder, self._tell, self._next = folder, tell, 0.0

    def begin(self, total: int) -> None:
        """Set the total number of tasks."""
        self._folder.state.total = total
        if begin := getattr(self._tell, "begin", None):
            begin(total)

    def warn(self, lines: list[str]) -> None:
        """Report data-quality problems."""
        if warn := getattr(self._tell, "warn", None):
            warn(lines)

    def __call__(self, text: str, /, steps: int = 1) -> None:
        """Report a task and the number of steps completed."""
        state = self._folder.state
        state.task, state.done = text, state.done + steps
        self._tell(text, steps)
        if time.monotonic() >= self._next:
            self._folder.save()
            self._next = time.monotonic() + OFTEN


def run_project(project: Project, tell: Callable[..., object], *, again: bool = False, number: int = 0) -> "ProjectRun":
    """Run a project: continue its last run if nothing has changed since, else in a new folder.

    Parameters
    ----------
    project : Project
    tell : callable
        Receives the progress; see `RunProgress`.
    again : bool
        Start a new run in any case.
    number : int
        Number of a run whose models are exported and assessed; 0: the last one.

    Returns
    -------
    ProjectRun
        Finished; one that was finished before is returned as it is.

    Raises
    ------
    InputError
        The models cannot be learned; the reason is also in the folder of the run. That a later step cannot be done is
        only in the folder, see `RunFolder.errors`.
    """
    if number:
        return _go_on(project, tell, number)
    fingerprint = project.fingerprint()
    last = next(reversed(runs_of(project.folder)), None)
    found = {} if last is None else last.read()
    learned = any(step["name"] == "fit" for step in found.get("steps", ()))
    if last is None or again or found["fingerprint"] != fingerprint or (found["state"] == "failed" and not learned):
        folder = new_run(project.folder)
        folder.state.fingerprint, folder.state.version = fingerprint, __version__
    else:
        folder = last
        folder.take_up()
    return _work(project, folder, tell, project.file.read_text(encoding="utf-8"))


def _go_on(project: Project, tell: Callable[..., object], number: int) -> "ProjectRun":
    """Do the steps after the fit of a run of other settings."""
    folder = next((r for r in runs_of(project.folder) if r.number == number), None)
    if folder is None:
        raise InputError(f"{project.folder}: there is no run {number}")
    learned = project.as_learned(folder.path / NAME)
    folder.take_up()
    if not any(step.name == "fit" for step in folder.state.steps):
        raise InputError(f"{folder.path}: this run has no models: choose one that has, or run the project")
    if folder.state.fingerprint != learned.fingerprint():
        raise InputError(
            f"{folder.path}: since this run a recording, a mapping or the version of thermocomp has changed: run again"
        )
    return _work(learned, folder, tell, tomlkit.dumps(learned.content), only_models=True)


def _work(
    project: Project, folder: RunFolder, tell: Callable[..., object], settings: str, *, only_models: bool = False
) -> "ProjectRun":
    write_text(settings, folder.path / NAME, overwrite=True)
    run = ProjectRun(project, folder, tell, only_models=only_models)
    run.work()
    return run


class ProjectRun:
    """A run of a project.

    Parameters
    ----------
    project : Project
    folder : RunFolder
    tell : callable
        Receives the progress; see `RunProgress`.
    only_models : bool
        Export and assess the models only.
    """

    def __init__(
        self, project: Project, folder: RunFolder, tell: Callable[..., object], *, only_models: bool = False
    ) -> None:
        self.only_models = only_models
        self.project, self.folder, self.tell = project, folder, tell
        self.settings = project.settings
        self.compared: Compared | None = None
        self.fitted: FittedModels | None = None

    def work(self) -> None:
        """Execute the steps that are not finished.

        Raises
        ------
        InputError
            The models cannot be learned.
        KeyboardInterrupt
            The run was stopped.
        """
        with (
            self.folder.working(),
            use_language(self.settings.language),
            name_project(self.settings.name, self.folder.state.began),
        ):
            if not self._has("fit"):
                self._learn()
            again = ("export", "assess") if self.only_models else ("export", "assess", "select", "plan")
            self.folder.state.steps = [s for s in self.folder.state.steps if not (s.error and s.name in again)]
            if self.settings.export is not None:
                self._follow("export", self._export, self.project.key_of(("export", "limits"), ()))
            if self.settings.assess:
                self._follow("assess", self._assess, self.project.key_of(("limits",), self.settings.assess))
            if not self.only_models and self.settings.select is not None:
                self._follow("select", self._select, self.project.key_of(("select",), ()), only=True)
            if not self.only_models and self.settings.plan is not None:
                self._follow("plan", self._plan, self.project.key_of(("plan",), ()), only=True)

    def _learn(self) -> None:
        tests = self._recordings()
        self._step("check", lambda: self._check(tests))
        self._forget("compare")  # it was interrupted before the models were fitted, which needs its result
        self._step("compare", lambda: self._compare(tests))
        self._step("fit", self._fit)

    def _recordings(self) -> list[Recording]:
        tests = self._read(self.settings.recordings)
        if self.settings.join is None:
            return tests
        joined = self.folder.path / "joined.parquet"
        offset = self.settings.join.offset or None
        if not self._has("join"):
            found = join(tests, offset=offset)
            self._step("join", lambda: self._write(found, (found.save, joined.name)))
        return [read(joined)]

    def _read(self, named: Sequence[ProjectRecording]) -> list[Recording]:
        if not named:
            raise InputError(f"{self.project.file}: it names no recording: add a table [[recordings]] with a file")
        path = self.project.path
        return [read(path(r.file), path(r.mapping) if r.mapping else None) for r in named]

    def _check(self, tests: list[Recording]) -> tuple[list[str], str]:
        found = check(tests)
        return self._write(found, (found.report, "check.html"))

    def _compare(self, tests: list[Recording]) -> tuple[list[str], str]:
        options = given(self.settings.compare)
        self.compared = found = compare(tests, limits=self.settings.limits, progress=self._progress(), **options)
        files = self._write(
            found,
            (found.report, "comparison.html"),
            (partial(write_text, curves_of(found)), "curves.json"),
            (partial(write_text, words_of(found)), "words.json"),
        )
        if found.comparison.left:
            raise KeyboardInterrupt
        return files

    def _fit(self) -> tuple[list[str], str]:
        assert self.compared is not None
        if self.project.fingerprint() != self.folder.state.fingerprint:
            raise InputError(f"{self.project.file}: a recording or mapping was changed during the run; start it again")
        fit = self.settings.fit
        self.fitted = found = self.compared.fit(dict(fit.model), accept_unproven=fit.accept_unproven or None)
        interval = max(r.sampling_interval for r in self.compared.recordings)
        live = live_configuration(found.fitted.models, self.settings.limits, interval)
        return self._write(found, (found.save, "model.json"), (partial(write_text, live), "live.toml"))

    def _select(self) -> tuple[list[str], str]:
        options = self._common() | given(self.settings.select)
        found = select(self._recordings(), progress=self._progress(), **options)
        points = partial(write_text, points_of(found))
        return self._write(found, (found.report, self._free("sensors.html")), (points, "sensors.json"))

    def _plan(self) -> tuple[list[str], str]:
        options = self.settings.plan
        assert options is not None
        own = self._common() | given(options, ("dialect", "probe_every"))
        found = plan(self._recordings(), progress=self._progress(), **own)
        folder = self.folder.path / self._free("plan")
        folder.mkdir()
        program = folder / ("next-test.ngc" if options.dialect == "linuxcnc" else "next-test.nc")
        written = found.write(program, dialect=options.dialect, every=options.probe_every)
        files, text = self._write(found)
        names = [path.name for path in (program, written, program.with_suffix(".png"))]
        return [*(f"{folder.name}/{name}" for name in names), *files], text

    def _common(self) -> dict[str, Any]:
        """Return the keywords that other commands take from the table ``[compare]``."""
        return {name: getattr(self.settings.compare, name) for name in COMMON}

    def _free(self, name: str) -> str:
        """Return a name that no file of the run has yet."""
        return free(str(self.folder.path / name)).name

    def _export(self) -> tuple[list[str], str]:
        options = self.settings.export
        assert options is not None
        reduced = [*map(self._chosen, self._recordings())] if find_target(options.to).shape else None
        found = export(self._model, options.to, reduced, limits=self.settings.limits, **given(options, ("to",)))
        folder = free(str(self.folder.path / "-".join(["export", options.to, *filter(None, [options.dialect])])))
        found.save(folder)
        told = [f"{target} is left out: {why}" for target, why in {**found.refused, **found.elsewhere}.items()]
        return [f"{folder.name}/{name}" for name in found.files], ". ".join([*filter(None, [found.verdict]), *told])

    def _chosen(self, recording: Recording) -> Recording:
        """Return a recording with those temperatures only that the settings choose as inputs."""
        inputs = self.settings.compare.inputs
        if not inputs:
            return recording
        named = {inputs} if isinstance(inputs, str) else {*inputs}
        kept = [c for c in recording.channels if c.quantity != "temperature" or c.name in named]
        return replace(recording, channels=tuple(kept), table=recording.table[[c.name for c in kept]])

    def _assess(self) -> tuple[list[str], str]:
        tests = self._read(self.settings.assess)
        found = assess(self._model, tests, limits=self.settings.limits, progress=self._progress())
        return self._write(found, (found.report, self._free("assessment.html")))

    @property
    def _model(self) -> Path:
        return self.folder.path / "model.json"

    def _progress(self) -> RunProgress:
        return RunProgress(self.folder, self.tell)

    def _write(self, found: Any, *written: tuple[Callable[..., object], str]) -> tuple[list[str], str]:
        """Write the files of a result, and its JSON; return their names and the result as text."""
        for writer, name in written:
            writer(self.folder.path / name, overwrite=True)
        name = f"{self.folder.state.step}.json"
        write_text(as_text(found.to_dict()), self.folder.path / name, overwrite=True)
        return [*(n for _, n in written), name], translate(str(found))

    def _has(self, name: str, key: str = "") -> bool:
        return any((s.name, s.key) == (name, key) for s in self.folder.state.steps)

    def _follow(self, name: str, work: Callable[[], tuple[list[str], str]], key: str, *, only: bool = False) -> None:
        """Execute a step after the fit; one that cannot be done leaves the models and the other steps as they are.

        Parameters
        ----------
        only : bool
            The run lists only its last result.
        """
        if only and not self._has(name, key):
            self._forget(name)
        try:
            self._step(name, work, key)
        except ThermocompError as e:
            state = self.folder.state
            seconds = round(time.time() - state.step_began, 1)
            state.steps.append(RunStep(name=name, seconds=seconds, files=[], text="", key=key, error=str(e)))
            state.step = state.task = ""
            self.folder.save()

    def _forget(self, name: str) -> None:
        self.folder.state.steps = [s for s in self.folder.state.steps if s.name != name]

    def _step(self, name: str, work: Callable[[], tuple[list[str], str]], key: str = "") -> None:
        """Execute a step unless an earlier process has finished it with the same settings."""
        if self._has(name, key):
            return
        state, began = self.folder.state, time.time()
        state.step, state.step_began, state.task, state.done, state.total = name, began, "", 0, 0
        self.folder.save()
        files, text = work()
        seconds = round(time.time() - began, 1)
        state.steps.append(RunStep(name=name, seconds=seconds, files=files, text=text, key=key))
        state.step = state.task = ""
        self.folder.save()
