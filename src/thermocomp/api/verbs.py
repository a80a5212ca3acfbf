"""The main workflow in Python: compare, fit, assess. The keywords are the options of the commands."""

from collections.abc import Callable, Iterable, Sequence
from collections.abc import Mapping as ByTarget
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

from thermocomp.api.explain import models_of
from thermocomp.api.inputs import Given, LeaveOne, Starts, prepare, recordings_of, starts_of, trouble_of
from thermocomp.api.keywords import Listener, silent
from thermocomp.api.results import Assessed, Compared, FittedModels
from thermocomp.core.correction import Limits
from thermocomp.core.inputs import Support
from thermocomp.core.model import ErrorModel
from thermocomp.core.zero import Zeroing
from thermocomp.judging import assessing, do_no_harm
from thermocomp.judging import compare as comparing
from thermocomp.judging import study as studies
from thermocomp.judging.probing import Probings
from thermocomp.judging.results import Assessment, Rules, with_uncertainty
from thermocomp.judging.sharing import shared_among
from thermocomp.recordings.readers.mapping import Mapping

DEFAULT_MODELS = ("ols", "partial-f", "mra", "dynamic", "averaged")
Policy = Literal["clip", "hold", "fade"]


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
    noise: float | None = None,
    harm_margin: float | None = None,
    limits: Limits | None = Limits(),
    jobs: int = -1,
    scheduler: str | None = None,
    progress: Callable[[str], None] = silent,
) -> Compared:
    """Compare methods with each other and with no compensation, on unseen thermal cycles.

    Parameters
    ----------
    recordings : Recording, path, DataFrame, or sequence of them
        Files (CSV, XLSX, ODS, Parquet, TDMS, HDF5, MAT) or tables; each one is a separate test.
    targets : str or sequence of str, optional
        Displacement channels to predict. Default: all of the first recording.
    models : str, estimator, or sequence of them
        Methods to compare, or ``all``: ols, partial-f, mra, averaged, dynamic, grouping, subsets, ace, ace-monotone,
        mlp, mlp-sklearn, arx, arx-free-run, arx-net, ridge, pcr, pcr-traversal, sir, pls, lasso, elastic-net, ppr, gp.

        In Python also estimators of any kind: an estimator of thermocomp with custom settings, any regressor of
        scikit-learn, a Pipeline, a custom class.
    inputs : str or sequence of str, optional
        Channels used as model inputs. Default: all temperatures and the first spindle speed.
    split : str, optional
        Chronological train/test split: fractions of the rows such as ``0.75/0.25``, or durations such as ``20h/8h``.
    leave_one : {'cycle', 'day', 'file'}, optional
        What is left out of the fit and judged, in turn: each thermal cycle (default), each day (the recordings need
        time stamps), or each recording.
    absolute : bool
        Use absolute temperatures. Default: temperatures relative to the start of each test.
    starts : Start or sequence of Start, optional
        Initial thermal state of all recordings, or of each one, such as ``Start("continued", earlier=(monday,))``.
        Default: determined from the recordings. See `thermocomp.recordings.starts.Start`.
    zero_over : float
        Averaging time of the zero (reference temperatures) at the start of each test, with the spindle stopped [s]; 0:
        the first row is the zero.
    mapping : str, Path or Mapping, optional
        TOML mapping file: role and unit of each column.
    support : {'clip', 'hold', 'fade'}
        Behaviour of a model outside its training range: clip its inputs, hold its last output, or fade its output to
        zero. With ``clip``, a model accepted for its duty only fades.
    margin : float
        Margin by which the training range of each input is extended at both ends, as a fraction of the range.
    robustness : bool
        Also evaluate the models with added sensor noise and with failed sensors: a model that is then worse than no
        compensation gets the verdict ``unproven``. Without this check the command is faster, but accepts no model.
    primary : str, optional
        Primary method, chosen before the evaluation: its result is not corrected for multiple comparisons, those of the
        other methods are corrected for the number of methods tried. Default: the recommended method, selected again in
        each fold, with the left-out cycle excluded.
    noise : float, optional
        Noise of the temperatures in use, for the choice of the recommended method: standard deviation [degC]. Default:
        estimated from the recordings.
    harm_margin : float, optional
        Tolerated degradation in a single cycle, day or file, set before the evaluation [um]. Default: the larger of
        three times the probe's noise and 5 % of the largest drift, limited to 2 um.
    limits : Limits or None
        Limits of the corrections, applied while the models are judged; None: the models are judged without a
        compensator.
    jobs : int
        Number of parallel processes; -1: one per core.
    scheduler : str, optional
        Address of a Dask scheduler whose workers replace the local processes, such as ``tcp://192.168.1.20:8786``; see
        the page :doc:`/many_recordings` of the manual.
    progress : callable
        Called with a line of text after each task; see `thermocomp.api.keywords.Listener`.

    Returns
    -------
    Compared

    Raises
    ------
    InputError
        A recording, channel or model is invalid.

    Examples
    --------
    >>> import thermocomp as tc
    >>> days = tc.simulate("wessel-milling")
    >>> found = tc.compare(days, "s1_um", ["ols", "mra"], leave_one="file")
    >>> found.to_frame()[["model", "rms", "none_rms", "verdict"]].round(1)
      model  rms  none_rms   verdict
    0   mra  7.3      79.6  unproven
    1   ols  8.5      79.6  accepted
    >>> found.best  # the accepted model with the least error in use
    {'s1_um': 'ols'}
    """
    listener, rules = Listener(progress), Rules(harm_margin, primary, noise)
    methods = _listed(models)
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
    measured = with_uncertainty(found.assessments, ready.tests)
    found = replace(found, assessments=tuple(a if robustness else _untried(a) for a in measured))
    write = partial(
        studies.fit,
        ready.samples,
        judging=ready.judging,
        compared=found,
        rules=rules,
        support=Support(support, margin),
        recordings=ready.tests,
        limits=limits or Limits(),
        jobs=jobs,
    )
    return Compared(found, ready.tests, tuple(ready.trouble), ready.samples, write=write)


def _listed(models: Any) -> list[Any]:
    """Return the methods given as one or as several."""
    return list(models) if isinstance(models, Iterable) and not _single(models) else [models]


def _by_target(model: Any, targets: Sequence[str]) -> dict[str, list[Any]]:
    """Return the methods for each target, given by target, as ``TARGET=METHOD``, or for all other targets."""
    own, others = dict[str, list[Any]](), list[Any]()
    if isinstance(model, ByTarget):
        own = {target: _listed(m) for target, m in model.items()}
    else:
        for entry in _listed(model):
            target, _, name = entry.rpartition("=") if isinstance(entry, str) else ("", "", entry)
            (own.setdefault(target, []) if target else others).append(name)
    return {target: others or list(DEFAULT_MODELS) for target in targets} | own


def _single(models: Any) -> bool:
    """Return whether `models` is a single method: a forest of scikit-learn is iterable, too."""
    return isinstance(models, str) or hasattr(models, "fit")


def _untried(found: Assessment) -> Assessment:
    """Return an assessment that accepts no model, because noise and lost sensors were not tested."""
    return replace(found, verdict=replace(found.verdict, caps=(do_no_harm.UNTRIED,))) if found.accepted else found


def fit(
    recordings: Given,
    targets: str | Sequence[str] | None = None,
    model: Any = DEFAULT_MODELS,
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
    primary: str | None = None,
    noise: float | None = None,
    harm_margin: float | None = None,
    tilt: Sequence[str] | None = None,
    limits: Limits = Limits(),
    accept_unproven: str | None = None,
    jobs: int = -1,
    scheduler: str | None = None,
    progress: Callable[[str], None] = silent,
) -> FittedModels:
    """Fit a model, judge it on unseen thermal cycles, and write it with its honest error, the error on these cycles.

    The methods are first judged on unseen cycles; of several, that which `compare` recommends is written for each
    target. Then it is fitted to all data. A refused model is also written, but marked as refused, and cannot be run. An
    unproven one runs in shadow only: its corrections are computed but not applied. With several methods, such as the
    default, this takes as long as `compare`; `Compared.fit` reuses the result of a comparison.

    Parameters
    ----------
    recordings, targets
        As for `compare`.
    model : str, estimator, sequence or mapping of them
        Method to fit, or several: the recommended one of each target is written. ``z_um=dynamic`` is a method for one
        target. Any method of ``thermocomp compare`` except gp.

        In Python also an estimator that can be frozen (an estimator of thermocomp, or a Pipeline of selectors and such
        an estimator), and a mapping such as ``{"z_um": "dynamic"}``; for other targets, the default methods are
        compared.
    inputs, split, leave_one, absolute, starts, zero_over, mapping, support, margin, primary, noise, harm_margin
        As for `compare`.
    tilt : sequence of str, optional
        Tilts to predict as well, each defined by two probes and their distance, such as ``A0C=y1_um:y2_um:100mm``
        (rotation about X; the probe at the tip comes first) or ``B0C=x1_um:x2_um:100mm`` (about Y).
    limits : Limits
        Limits of the corrections, applied while the models are judged.
    accept_unproven : str, optional
        Person who approves the use of an unproven model, and the reason, such as ``"M. Weber, trial on machine 7"``.
        Stored in the model file and shown wherever the model is used. A refused model never runs.
    jobs, scheduler, progress
        As for `compare`.

    Returns
    -------
    FittedModels

    Raises
    ------
    InputError
        A recording, channel or model is invalid, or the model cannot be frozen.

    Examples
    --------
    >>> import thermocomp as tc
    >>> days = tc.simulate("wessel-milling")
    >>> fitted = tc.fit(days, "s1_um", "ols", leave_one="file")
    >>> fitted.model.honest_error.word, f"{fitted.model.honest_error.rms:.1f} um"  # on unseen days
    ('accepted', '8.5 um')
    >>> fitted.save("model.json").name
    'model.json'
    """
    listener, rules = Listener(progress), Rules(harm_margin, primary, noise)
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
    names = [t.name for t in ready.samples.targets]
    listed = comparing.methods_of(ready.samples, _by_target(model, names))
    methods = dict(zip(names, listed, strict=True))
    several = {t: m for t, m in methods.items() if len(m) > 1}
    settings: Any = {
        "rules": rules,
        "support": Support(support, margin),
        "limits": limits,
        "jobs": jobs,
        "progress": progress,
    }
    with shared_among(scheduler):
        listener.begin(lambda: comparing.n_pieces(ready.samples, methods, ready.judging, rules))
        compared = comparing.compare(ready.samples, several, ready.judging, **settings) if several else None
        found = studies.fit(
            ready.samples,
            {t: names[0] for t, names in methods.items() if t not in several},
            ready.judging,
            compared=compared,
            recordings=ready.tests,
            **settings,
        )
    return FittedModels(found, ready.tests, tuple(ready.trouble)).approved(accept_unproven)


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
    """Judge a model file on recordings: per cycle, with sensor noise, with each sensor lost, outside training range.

    Rows used to train a model are recognised by their fingerprints, whatever file they are in; they are excluded and
    counted.

    Parameters
    ----------
    model : ErrorModel, FittedModels, path of a model file, or sequence of ErrorModel
        Model file or models to judge.
    recordings, starts, mapping, harm_margin
        As for `compare`.
    limits : Limits
        Limits of the corrections, applied while the models are judged.
    probing : str or Probings, optional
        Simulated probing of the tool point during operation, such as ``"every 2 h"``, or ``"every 30 min, 0.3 um"`` to
        specify the repeatability of the probe (standard deviation; default 0.5 um). Each probing corrects the models
        from then on. Default: no probing.
    progress : callable
        Called with a line of text per model.

    Returns
    -------
    Assessed

    Raises
    ------
    InputError
        There is no model, or a file or a channel that the models need is invalid.

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
    judged on only 2 of 3 required cycles or files; record 1 more thermal cycle, at other speeds or on other days
    """
    models = models_of(model)
    listener, tests = Listener(progress), recordings_of(recordings, mapping)
    begun, trouble = starts_of(starts, tests), trouble_of(tests)
    listener.warn(trouble)
    listener.begin(lambda: len(models))
    judged = assessing.assess(
        models,
        tests,
        rules=Rules(harm_margin),
        limits=limits,
        starts=begun,
        probings=Probings.of(probing),
        progress=progress,
    )
    measured = with_uncertainty(judged.assessments, tests)
    return Assessed(replace(judged, assessments=measured), tuple(tests), tuple(trouble))
