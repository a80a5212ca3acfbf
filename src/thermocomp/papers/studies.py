"""The studies of the papers by name; each is imported on demand."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from importlib import import_module

from thermocomp.core.exceptions import FitError
from thermocomp.judging.pieces import elsewhere, work_through
from thermocomp.papers.study import Claim, Progress, Study, tell_nobody
from thermocomp.virtual.protocol import Physics

#: packages next to this module, each with ``redo.run(seed, progress) -> Study``
STUDIES = ("chen1996", "wessel2004", "hwang", "precompensation", "stepwise2017")
#: studies that can also run on the nonlinear machines
PHYSICS = ("wessel2004",)
#: difference between the seeds of repeated runs of a study
APART = 100


def run(name: str, *, seed: int = 0, progress: Progress = tell_nobody, physics: Physics | None = None) -> Study:
    """Reproduce the study of a paper on the virtual machine.

    Parameters
    ----------
    physics : {'linear', 'nonlinear'}, optional
        Physics of the virtual machine, in `PHYSICS`. Default: as defined by the experiments.
    """
    options = {"physics": physics} if physics else {}
    study: Study = import_module(f"thermocomp.papers.{name}.redo").run(seed, progress, **options)
    return study


def repeat(
    name: str,
    *,
    seed: int = 0,
    repeats: int = 3,
    progress: Progress = tell_nobody,
    physics: Physics | None = None,
    jobs: int = 1,
) -> Study:
    """Repeat a study several times, each with separate weather, noise and random draws.

    Parameters
    ----------
    physics : {'linear', 'nonlinear'}, optional
        See `run`.
    """
    if jobs != 1 or elsewhere.get() is not None:
        return _joined(_together(name, [seed + APART * k for k in range(repeats)], progress, physics, jobs), seed)
    found = []
    for k in range(repeats):
        word = f"run {k + 1} of {repeats}, " if repeats > 1 else ""
        found.append(
            run(
                name,
                seed=seed + APART * k,
                progress=lambda done, text: progress((k + done) / repeats, word + text),  # noqa: B023
                physics=physics,
            )
        )
    return _joined(found, seed)


def _together(name: str, seeds: Sequence[int], progress: Progress, physics: Physics | None, jobs: int) -> list[Study]:
    """Return the runs of a study, executed in parallel."""
    found: list[Study] = []
    for study in work_through(partial(_run, name, physics), seeds, _why, jobs=jobs):
        if isinstance(study, str):
            raise FitError(study)
        found.append(study)
        progress(len(found) / len(seeds), f"run {len(found)} of {len(seeds)}")
    return found


def _run(name: str, physics: Physics | None, seed: int) -> Study | str:
    return run(name, seed=seed, physics=physics)


def _why(_: int, why: str) -> Study | str:
    return why


def _joined(found: Sequence[Study], seed: int) -> Study:
    """Return the first run, with claims that include whether they hold in the other runs."""
    return replace(found[0], claims=tuple(_known(c, [s.claims for s in found[1:]], seed) for c in found[0].claims))


def not_redone(name: str, why: str) -> Study:
    """Return the substitute for a study that failed."""
    claim = Claim(
        ids=("-",), text="The study can be reproduced here", paper="", ours="it failed", holds=False, finding=why
    )
    return Study(
        name=name, title=f"{name}: not reproduced", claims=(claim,), tables=(), figures=(), numbers={}, ran=False
    )


def _known(claim: Claim, others: Sequence[Sequence[Claim]], seed: int) -> Claim:
    """Return a claim with the outcome of its other runs, and the finding where it does not hold.

    A run that cannot test the claim counts as one in which it does not hold, unless no run can test it.
    """
    runs = [claim, *(c for claims in others for c in claims if (c.ids, c.text) == (claim.ids, claim.text))]
    first = next((k for k, c in enumerate(runs) if c.testable), 0)
    base = runs[first]
    told = [k for k, c in enumerate(runs) if k != first and not c.testable] if base.testable else []
    if base.holds:
        told += [k for k, c in enumerate(runs) if c.holds is False or c.softer > base.softer][:1]
    finding = " ".join(filter(None, [base.finding, *(f"Seed {seed + APART * k}: {runs[k].finding}" for k in told)]))
    again = tuple(bool(c.holds) for k, c in enumerate(runs) if k != first) if base.holds is not None else ()
    return replace(base, finding=finding, again=again, softer=any(c.softer for c in runs))
