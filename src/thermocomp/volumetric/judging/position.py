"""Judging of models of position-dependent errors: whole profiles, in unseen thermal cycles."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from joblib import Parallel, delayed

from thermocomp.core.exceptions import InputError
from thermocomp.judging.splits import Judging, Split, leave_one_cycle_out
from thermocomp.recordings.profiles import Profiles
from thermocomp.recordings.samples import Samples
from thermocomp.volumetric.judging.positionerrors import (
    ComponentStates,
    JudgedSplit,
    PositionAssessment,
    assess_together,
    judge_split,
)
from thermocomp.volumetric.models.position import PositionFit, fit_position, slope_samples
from thermocomp.volumetric.models.positionoptions import PositionOptions, Setting, fill_options

#: minimum number of thermal states for training and judging
FEWEST = 4


@dataclass(frozen=True, eq=False)
class PositionStudy:
    """A position model fitted to all data, with its error on unseen data.

    Parameters
    ----------
    fit : PositionFit
        The fit; the models of its factors carry the honest error.
    options : PositionOptions
        Options, with open settings filled in.
    dropped : str
        Reason why the thermal part was dropped, i.e. its own verdict; empty if it was not.
    """

    fit: PositionFit
    options: PositionOptions
    assessment: PositionAssessment
    dropped: str = ""


def study(
    profiles: Profiles | Sequence[Profiles],
    options: PositionOptions = PositionOptions(),  # noqa: B008 - frozen
    *,
    left_open: Sequence[Setting] = (),
    judging: Callable[[Samples], Judging] = leave_one_cycle_out,
    jobs: int = 1,
    progress: Callable[[str], None] = lambda _: None,
) -> PositionStudy:
    """Judge the modelling of a position-dependent error on unseen cycles, then fit it to all data.

    In each split everything is determined again: open settings, cold profile, its order, slopes. If only part of a test
    is left out, its cold profile is the zero of the test: it is used, and not judged. A test left out as a whole is
    judged with the cold profiles of the other tests.

    Parameters
    ----------
    left_open : sequence of {'slopes', 'offset', 'reference_position'}
        Settings to be determined from the profiles instead of from `options`; see
        `thermocomp.volumetric.models.positionoptions.fill_options`. If the number of slopes is open and the thermal
        part is refused, the cold profile alone is judged and used.
    """
    tests = (profiles,) if isinstance(profiles, Profiles) else profiles
    (found,) = study_all([tests], options, left_open=left_open, judging=judging, jobs=jobs, progress=progress)
    return found


def study_all(
    components: Sequence[Sequence[Profiles]],
    options: PositionOptions = PositionOptions(),  # noqa: B008 - frozen
    *,
    left_open: Sequence[Setting] = (),
    judging: Callable[[Samples], Judging] = leave_one_cycle_out,
    jobs: int = 1,
    progress: Callable[[str], None] = lambda _: None,
) -> tuple[PositionStudy, ...]:
    """Apply `study` to several components together."""
    whole = [ComponentStates(tuple(tests), *_splits(tests, options, judging)) for tests in components]
    found = _studies(whole, options, left_open, jobs, progress)
    if "slopes" not in left_open:
        return tuple(found)
    for k, (one, first) in enumerate(zip(whole, found, strict=True)):
        if first.assessment.accepted and first.options.powers:
            continue
        (alone,) = _studies([one], replace(first.options, slopes=0, offset=False), (), 1, lambda _: None)
        if alone.assessment.accepted:
            found[k] = replace(alone, dropped=first.assessment.reason if first.options.powers else "it is noise")
    return tuple(found)


def _studies(
    whole: Sequence[ComponentStates],
    options: PositionOptions,
    left_open: Sequence[Setting],
    jobs: int,
    progress: Callable[[str], None],
) -> list[PositionStudy]:
    work = [
        delayed(_piece)(one.tests, options, tuple(left_open), split)
        for one in whole
        for split in (*one.judging.splits, None)
    ]
    done: list[Any] = []
    for text, found in Parallel(n_jobs=jobs, return_as="generator")(work):
        progress(text)
        done.append(found)
    studies, start = [], 0
    for one in whole:
        stop = start + len(one.judging.splits)
        studies.append(_study(one, done[start:stop], *done[stop]))
        start = stop + 1
    return studies


def n_pieces(
    components: Sequence[Sequence[Profiles]], options: PositionOptions, judging: Callable[[Samples], Judging]
) -> int:
    """Return the number of tasks of `study_all`."""
    return sum(len(_splits(tests, options, judging)[1].splits) + 1 for tests in components)


def _splits(
    tests: Sequence[Profiles], options: PositionOptions, judging: Callable[[Samples], Judging]
) -> tuple[Samples, Judging]:
    if (states := sum(len(test) for test in tests)) < FEWEST:
        raise InputError(
            f"{tests[0].target}: {states} thermal state(s): one gives the cold profile, the others are needed to fit "
            f"and validate the slopes; measure at least {FEWEST} states, preferably 20"
        )
    samples, _ = slope_samples(tests, options)
    return samples, judging(samples)


def _piece(
    tests: tuple[Profiles, ...], options: PositionOptions, left_open: Sequence[Setting], split: Split | None
) -> tuple[str, Any]:
    """Judge one split; without a split, fit all data."""
    learn = None if split is None else split.learn
    chosen = fill_options(tests, options, left_open, learn=learn) if left_open else options
    fit = fit_position(tests, chosen, learn=learn)
    if split is None:
        return f"{tests[0].target} all states", (chosen, fit)
    return f"{tests[0].target} {split.block}", judge_split(tests, fit, chosen, split)


def _study(
    one: ComponentStates, parts: Sequence[JudgedSplit], options: PositionOptions, fit: PositionFit
) -> PositionStudy:
    assessment = assess_together(one, parts, options)
    honest = assessment.factors
    trained = tuple(
        replace(t, model=replace(t.model, honest_error=h)) for t, h in zip(fit.trained, honest, strict=True)
    )
    models = [t.model for t in trained]
    model = replace(
        fit.model, offset=models[0] if options.offset else None, slopes=tuple(models[1:] if options.offset else models)
    )
    return PositionStudy(replace(fit, model=model, trained=trained), options, assessment)
