"""The main job in Python: select, compare, fit, assess. The commands' words are the keywords."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from thermocomp.api.explain import models_of
from thermocomp.api.inputs import Given, LeaveOne, Starts, prepare, recordings_of, starts_of, trouble_of
from thermocomp.api.keywords import Listener, settings_of, silent
from thermocomp.api.results import Assessed, Compared, FittedModels
from thermocomp.api.selected import Selected
from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError
from thermocomp.core.inputs import Support
from thermocomp.core.model import ErrorModel
from thermocomp.core.zero import Zeroing
from thermocomp.judging import compare as comparing
from thermocomp.judging import do_no_harm, selecting
from thermocomp.judging import study as studies
from thermocomp.judging.choice import Settings
from thermocomp.judging.probing import Probings
from thermocomp.judging.results import Assessment, Rules
from thermocomp.judging.sharing import shared_among
from thermocomp.recordings.readers.mapping import Mapping

DEFAULT_MODELS = ("ols", "partial-f", "mra", "dynamic", "averaged")
SelectionMethod = Literal["pareto", "subsets", "grouping", "partial-f", "stepwise", "ace"]
Policy = Literal["clip", "hold", "fade"]
#: what `select` takes beside the recordings
SelectionSettings = Settings


def compare(
    recordings: Given,
    targets: str | Sequence[str] | None = None,
    models: Any = DEFAULT_MODELS,
    *,
    inputs: str | Sequence[str] | None = None,
    split: str | None = None,
    leave_one: LeaveOne | None = None,
    absolute: bool = False,
    starts: Starts = None,
    zero_over: float = Zeroing.at_rest,
    mapping: str | Path | Mapping | None = None,
    support: Policy = "clip",
    margin: float = Support.margin,
    robustness: bool = True,
    primary: str | None = None,
    harm_margin: float | None = None,
    limits: Limits | None = Limits(),
    jobs: int = -1,
    scheduler: str | None = None,
    progress: Callable[[str], None] = silent,
) -> Compared:
    """Compare methods on thermal cycles they have not seen, beside no compensation.

    Parameters
    ----------
    recordings : Recording, path, DataFrame, or sequence of them
        Files (CSV, XLSX, ODS or Parquet) or tables; each is one test.
    targets : str or sequence of str, optional
        Displacement channels to predict; all of the first recording if not given.
    models : str, estimator, or sequence of them
        Methods to compare, or all: ols, partial-f, mra, averaged, dynamic, grouping, subsets, ace, ace-monotone,
        mlp, mlp-sklearn, arx, arx-free-run, arx-net, ridge, pcr, pls, lasso, elastic-net, ppr, gp.

        In Python also estimators of any kind: one of thermocomp's with settings of its own, any regressor of
        scikit-learn, a Pipeline, a small class of one's own.
    inputs : str or sequence of str, optional
        Channels to predict from; all temperatures and the first spindle speed if not given.
    split : str, optional
        Judge by time: shares of the rows such as ``0.75/0.25``, or hours such as ``20h/8h``.
    leave_one : {'cycle', 'day', 'file'}, optional
        Judge on each thermal cycle in turn (the default), on each day (the recordings need time
        stamps), or on each recording.
    absolute : bool
        Take temperatures as they are; without it they are counted from the start of each test.
    starts : Start or sequence of Start, optional
        How all recordings begin, or each of them, such as ``Start("continued", earlier=(monday,))``; found out if not
        given. See `thermocomp.recordings.starts.Start`.
    zero_over : float
        Average the start of each test over this time, while the spindle is stopped [s]; 0: it is the first row.
    mapping : str, Path or Mapping, optional
        TOML file that says what the columns of files are.
    support : {'clip', 'hold', 'fade'}
        What a model does outside its trained range: clip its inputs, hold its last value, or fade to zero.
    margin : float
        Share of each input's trained span by which its range is widened.
    robustness : bool
        Also replay with noise and lost sensors: a model that they make worse than none is unproven. Without it, which
        is quicker, none is accepted.
    primary : str, optional
        Method that is named beforehand: it is judged as if it were the only one, the others are corrected for the
        number tried. Without it that goes for the recommended one, which is chosen again without each cycle.
    harm_margin : float, optional
        Tolerated degradation in a single cycle, day or file, stated before judging [um]. If not given: three times the
        probe's noise or 5 % of the largest drift, at most 2 um.
    limits : Limits or None
        Of the compensator that is judged with the models; None: the models alone.
    jobs : int
        Processes to share the work among; -1 takes all cores.
    scheduler : str, optional
        Dask scheduler whose workers do the work in place of these processes, such as ``tcp://192.168.1.20:8786``: see
        :doc:`/many_recordings`.
    progress : callable
        Called with a line of text after each piece of work; see `thermocomp.api.keywords.Listener`.

    Returns
    -------
    Compared

    Raises
    ------
    InputError
        A recording, channel or model cannot be used.

    Examples
    --------
    >>> import thermocomp as tc
    >>> days = tc.simulate("wessel-milling")
    >>> found = tc.compare(days, "s1_um", ["ols", "mra"], leave_one="file")
    >>> found.to_frame()[["model", "rms", "none_rms", "verdict"]].round(1)
      model  rms  none_rms   verdict
    0   mra  7.3      79.6  unproven
    1   ols  8.5      79.6  accepted
    >>> found.best  # the accepted model with the smallest error
    {'s1_um': 'ols'}
    """
    listener, rules = Listener(progress), Rules(harm_margin, primary)
    methods = list(models) if isinstance(models, Iterable) and not _single(models) else [models]
    ready = prepare(
        recordings_of(recordings, mapping),
        targets,
        inputs,
        absolute=absolute,
        starts=starts,
        zero_over=zero_over,
        split=split,
        leave_one=leave_one,
        jobs=jobs,
        listener=listener,
    )
    with shared_among(scheduler):
        listener.begin(lambda: comparing.n_pieces(ready.samples, methods, ready.judging, rules))
        found = comparing.compare(
            ready.samples,
            methods,
            ready.judging,
            rules=rules,
            support=Support(support, margin),
            robustness=robustness,
            limits=limits,
            jobs=jobs,
            progress=progress,
        )
    if not robustness:
        found = replace(found, assessments=tuple(_untried(a) for a in found.assessments))
    return Compared(found, ready.tests, tuple(ready.trouble), ready.samples)


def _single(models: Any) -> bool:
    """Return whether it is one method: a forest of scikit-learn has members to go through, too."""
    return isinstance(models, str) or hasattr(models, "fit")


def _untried(found: Assessment) -> Assessment:
    """Return an assessment in which nothing is accepted that was not tried with noise and lost sensors."""
    return replace(found, verdict=replace(found.verdict, caps=(do_no_harm.UNTRIED,))) if found.accepted else found


def fit(
    recordings: Given,
    targets: str | Sequence[str] | None = None,
    model: Any = "averaged",
    *,
    inputs: str | Sequence[str] | None = None,
    split: str | None = None,
    leave_one: LeaveOne | None = None,
    absolute: bool = False,
    starts: Starts = None,
    zero_over: float = Zeroing.at_rest,
    mapping: str | Path | Mapping | None = None,
    support: Policy = "clip",
    margin: float = Support.margin,
    harm_margin: float | None = None,
    tilt: Sequence[str] | None = None,
    limits: Limits = Limits(),
    accept_unproven: str | None = None,
    jobs: int = -1,
    scheduler: str | None = None,
    progress: Callable[[str], None] = silent,
) -> FittedModels:
    """Fit a model, judge it on thermal cycles it has not seen, and write it with its honest error.

    The method is first judged on unseen cycles, then fitted to everything. A refused model is written too, with the
    refusal inside: nothing will run it. An unproven one runs in shadow only.

    Parameters
    ----------
    recordings, targets
        As for `compare`.
    model : str or estimator
        A method as for ``thermocomp compare``, all but gp.

        In Python also an estimator that can be frozen: one of thermocomp's, or a Pipeline of selectors and one of them.
    inputs, split, leave_one, absolute, starts, zero_over, mapping, support, margin, harm_margin
        As for `compare`.
    tilt : sequence of str, optional
        Tilts to predict too, each of two probes and their distance, such as ``A0C=y1_um:y2_um:100mm`` (turn about X,
        the probe at the tip first) or ``B0C=x1_um:x2_um:100mm`` (about Y).
    limits : Limits
        Of the compensator that is judged with the models.
    accept_unproven : str, optional
        Person who approves the use of an unproven model, and the reason, such as ``"M. Weber, trial on machine 7"``.
        Kept in the model file, shown wherever the model is. A refused one never runs.
    jobs, scheduler, progress
        As for `compare`.

    Returns
    -------
    FittedModels

    Raises
    ------
    InputError
        A recording, channel or model cannot be used, or the model cannot be frozen.

    Examples
    --------
    >>> import thermocomp as tc
    >>> days = tc.simulate("wessel-milling")
    >>> fitted = tc.fit(days, "s1_um", "ols", leave_one="file")
    >>> fitted.model.honest_error.word, f"{fitted.model.honest_error.rms:.1f} um"  # on days it had not seen
    ('accepted', '8.5 um')
    >>> fitted.save("model.json").name
    'model.json'
    """
    listener = Listener(progress)
    ready = prepare(
        recordings_of(recordings, mapping),
        targets,
        inputs,
        absolute=absolute,
        starts=starts,
        zero_over=zero_over,
        tilt=tilt,
        split=split,
        leave_one=leave_one,
        jobs=jobs,
        listener=listener,
    )
    with shared_among(scheduler):
        listener.begin(lambda: comparing.n_pieces(ready.samples, [model], ready.judging) + len(ready.samples.targets))
        found = studies.fit(
            ready.samples,
            model,
            ready.judging,
            rules=Rules(harm_margin),
            support=Support(support, margin),
            recordings=ready.tests,
            limits=limits,
            jobs=jobs,
            progress=progress,
        )
    found = replace(found, models=tuple(m.taken(accept_unproven) for m in found.models))
    return FittedModels(found, ready.tests, tuple(ready.trouble))


def assess(
    model: ErrorModel | FittedModels | str | Path | Sequence[ErrorModel],
    recordings: Given,
    *,
    starts: Starts = None,
    mapping: str | Path | Mapping | None = None,
    harm_margin: float | None = None,
    limits: Limits = Limits(),
    probing: str | Probings | None = None,
    progress: Callable[[str], None] = silent,
) -> Assessed:
    """Judge a model file on recordings: per cycle, with noise, with each sensor lost, outside its range.

    Rows that a model has learned from are known again by their fingerprints, whatever file they stand in: they are left
    out and counted.

    Parameters
    ----------
    model : ErrorModel, FittedModels, path of a model file, or sequence of ErrorModel
        Model file, or models.
    recordings, starts, mapping, harm_margin
        As for `compare`.
    limits : Limits
        Of the compensator that is judged with the models.
    probing : str or Probings, optional
        The tool point is probed while it runs, such as ``every 2 h``, or ``every 30 min, 0.3 um`` with the probe's
        repeatability (standard deviation; 0.5 um if not given): each probing corrects the models from then on.
    progress : callable
        Called with a line of text per model.

    Returns
    -------
    Assessed

    Raises
    ------
    InputError
        There is no model, or a file or a channel the models need cannot be used.

    Examples
    --------
    >>> import thermocomp as tc
    >>> *days, new_day = tc.simulate("wessel-milling")
    >>> fitted = tc.fit(days, "s1_um", "ols", leave_one="file")
    >>> found = tc.assess(fitted, new_day)
    >>> found.to_frame()[["model", "block", "rms", "none_rms", "verdict"]].round(1)
      model       block  rms  none_rms   verdict
    0   ols  all cycles  9.3      77.5  unproven
    >>> print(found.to_frame()["reason"][0])
    judged on 2 units, at least 3 are needed; record 1 more thermal cycle, at other speeds or on other days
    """
    models = models_of(model)
    listener, tests = Listener(progress), recordings_of(recordings, mapping)
    begun, trouble = starts_of(starts, tests), trouble_of(tests)
    listener.warn(trouble)
    listener.begin(lambda: len(models))
    judged = studies.assess(
        models,
        tests,
        rules=Rules(harm_margin),
        limits=limits,
        starts=begun,
        probings=Probings.of(probing),
        progress=progress,
    )
    return Assessed(judged, tuple(tests), tuple(trouble))


def select(
    recordings: Given,
    targets: str | Sequence[str] | None = None,
    method: SelectionMethod = "pareto",
    *,
    inputs: str | Sequence[str] | None = None,
    split: str | None = None,
    leave_one: LeaveOne | None = None,
    absolute: bool = False,
    starts: Starts = None,
    zero_over: float = Zeroing.at_rest,
    mapping: str | Path | Mapping | None = None,
    jobs: int = -1,
    scheduler: str | None = None,
    progress: Callable[..., None] = silent,
    **settings: Any,
) -> Selected:
    """Choose the few temperature sensors that a model needs.

    Parameters
    ----------
    recordings, targets
        As for `compare`.
    method : {'pareto', 'subsets', 'grouping', 'partial-f', 'stepwise', 'ace'}
        How to choose (:doc:`/methods`). pareto: error on unseen cycles against the number of sensors; subsets: exact
        best subset of every size; grouping: correlation grouping (Hwang); partial-f and stepwise: by partial F
        (stepwise 2017, Chen); ace: by maximal correlation (Wessel).
    inputs, split, leave_one, absolute, starts, zero_over, mapping, jobs, scheduler, progress
        As for `compare`.
    **settings
        Of the method, see `thermocomp.judging.choice.Settings`: ``max_sensors=5``, ``threshold=0.95``.

    Returns
    -------
    Selected

    Raises
    ------
    InputError
        A recording, channel, method or setting cannot be used.

    Examples
    --------
    >>> import thermocomp as tc
    >>> chosen = tc.select(tc.simulate("hwang"), "z_um", "grouping")
    >>> chosen.sensors
    {'z_um': ('t_y_bearing_C', 't_rear_seat_C', 't_column_front_left_C')}
    >>> chosen
    <Selected: z_um: t_y_bearing_C, t_rear_seat_C, t_column_front_left_C (smallest residual mean square, 3.869 um^2,
    among the members of 3 of 4 groups).>
    """
    if method not in ("pareto", "subsets", "grouping", "partial-f", "stepwise", "ace"):
        raise InputError(f"method {method!r}: expected pareto, subsets, grouping, partial-f, stepwise or ace")
    chosen = settings_of(Settings, settings, "select")
    chosen.check(method)
    listener = Listener(progress)
    ready = prepare(
        recordings_of(recordings, mapping),
        targets,
        inputs,
        absolute=absolute,
        starts=starts,
        zero_over=zero_over,
        split=split,
        leave_one=leave_one,
        jobs=jobs,
        judged=method == "pareto",
        listener=listener,
    )
    with shared_among(scheduler):
        listener.begin(lambda: selecting.n_pieces(method, ready.samples, ready.judging, chosen))
        found = selecting.select(method, ready.samples, ready.judging, chosen, jobs=jobs, progress=progress)
    return Selected(found, tuple(ready.trouble), ready.tests)
