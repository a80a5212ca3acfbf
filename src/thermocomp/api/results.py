"""Results for notebooks: tables, figures, and short text."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from thermocomp.api.assessments import describe, draw_run, frame_of, residuals_of, starts_content
from thermocomp.api.base import Paged, Result, told_trouble
from thermocomp.core.columns import Columns
from thermocomp.core.exceptions import InputError
from thermocomp.core.explained import Explanations, explain_all
from thermocomp.core.messages import join
from thermocomp.core.model import ErrorModel
from thermocomp.judging.assessing import Judged
from thermocomp.judging.faultlog import find_faults
from thermocomp.judging.results import Comparison
from thermocomp.judging.study import Fitted
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Compared(Result, Paged):
    """Validation results of several methods on unseen data.

    Parameters
    ----------
    comparison : Comparison
    recordings : tuple of Recording
    trouble : tuple of str
        Data-quality problems of the recordings.
    samples : Samples, optional
        Judged rows, for figures of the inputs.
    write : callable, optional
        `thermocomp.judging.study.fit` with the settings of the comparison.
    """

    comparison: Comparison
    recordings: tuple[Recording, ...]
    trouble: tuple[str, ...] = ()
    samples: Samples | None = None
    write: Callable[..., Fitted] | None = None

    def fit(self, model: Mapping[str, Any] | None = None, *, accept_unproven: str | None = None) -> "FittedModels":
        """Fit the recommended method of each target to all data, as `thermocomp.fit` does, without comparing again.

        Parameters
        ----------
        model : mapping of str to method, optional
            Methods to be written instead, by target, such as ``{"z_um": "dynamic"}``.
        accept_unproven : str, optional
            As for `thermocomp.fit`.

        Raises
        ------
        InputError
            No method could be fitted and stored for a target.
        """
        if self.write is None:
            raise InputError("this comparison has no recordings to fit: compare again")
        return FittedModels(self.write(model or {}), self.recordings, self.trouble).approved(accept_unproven)

    def to_dict(self) -> dict[str, Any]:
        """Return all results as a dict, as printed by ``--json``."""
        from thermocomp.report import records, summary

        found = self.comparison
        return {
            "judging": found.judging.name,
            "starts": starts_content(found.starts),
            "condition_number": found.collinearity.condition_number,
            "vif": dict(zip(found.collinearity.names, found.collinearity.vif, strict=True)),
            "trouble": self.trouble,
            "not_judged": found.left,
            "cautions": summary.cautions(found),
            "recommended": [
                {
                    "target": r.target,
                    "model": self.best[r.target],
                    "written": (written := found.written(r.target)) and written.model,
                    "error_in_use": written and records.in_use(found, written),
                    "chosen_per_unit": r.chosen,
                    "verdict": r.verdict.word,
                    "reason": r.verdict.told,
                }
                for r in found.recommended
            ],
            "results": [records.assessment(a) for a in found.assessments],
        }

    @property
    def best(self) -> dict[str, str | None]:
        """Recommended method by target: accepted, with the least error in use; None if there is none."""
        targets = dict.fromkeys(a.target for a in self.comparison.assessments)
        found = {t: self.comparison.best(t) for t in targets}
        return {t: None if a is None else str(a.model) for t, a in found.items()}

    def to_frame(self, *, blocks: bool = False) -> pd.DataFrame:
        """Return a row per target and model, the best first; with `blocks` also a row per unseen block.

        Parameters
        ----------
        blocks : bool

        Returns
        -------
        DataFrame
        """
        found = self.comparison.assessments if blocks else self.comparison.overall()
        table = frame_of(found)
        if blocks:
            return table
        order = {t: k for k, t in enumerate(dict.fromkeys(table["target"]))}
        return table.sort_values(
            ["target", "rms"], key=lambda c: c.map(order) if c.name == "target" else c, ignore_index=True
        )

    def residuals(self) -> pd.DataFrame:
        """Return a row per unseen row of each target and model: measured, predicted, residual [unit of the target]."""
        return residuals_of(self.comparison.assessments, self.recordings)

    def plot(self, target: str | None = None, model: str | None = None) -> "Figure":
        """Return a figure of the errors of all models; or of a model over time, for a target, on the unseen blocks.

        Parameters
        ----------
        target, model : str, optional
            Give both or neither.

        Returns
        -------
        Figure
        """
        from thermocomp.report import figures

        if target is None and model is None:
            return figures.overview(self.comparison).figure
        return draw_run(self.comparison.assessments, self.recordings, target, model)

    def page(self) -> str:
        """Return the page that ``thermocomp compare -o`` writes."""
        from thermocomp.report import html

        return html.render(self.comparison, self.recordings, self.samples)

    def __str__(self) -> str:
        from thermocomp.report.summary import verdict

        return join([verdict(self.comparison), *told_trouble(self.trouble)], " ")


@dataclass(frozen=True, eq=False, repr=False)
class FittedModels(Result):
    """A method fitted to all data, with its error on unseen data.

    Parameters
    ----------
    fitted : Fitted
    recordings : tuple of Recording
    trouble : tuple of str
    """

    fitted: Fitted
    recordings: tuple[Recording, ...]
    trouble: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return all results as a dict, as printed by ``--json``."""
        from thermocomp.report import records

        found, overall = self.fitted, self.fitted.comparison.overall()
        return {
            "judging": found.comparison.judging.name,
            "starts": starts_content(found.comparison.starts),
            "trouble": self.trouble,
            "models": [
                records.model(m, r2, a) for m, r2, a in zip(found.models, found.r_squared, overall, strict=True)
            ],
        }

    @property
    def models(self) -> dict[str, ErrorModel]:
        """Frozen models, by target."""
        return {m.target: m for m in self.fitted.models}

    @property
    def model(self) -> ErrorModel:
        """Frozen model, if there is a single target.

        Raises
        ------
        InputError
            There are several targets.
        """
        if len(self.fitted.models) > 1:
            raise InputError(f"there are several models, of {', '.join(self.models)}: use one of .models")
        return self.fitted.models[0]

    @property
    def coverage(self) -> dict[str, float]:
        """Fraction of the unseen rows inside the band, by target; nan without a band."""
        return {a.target: a.coverage for a in self.fitted.comparison.overall()}

    @property
    def half_width(self) -> dict[str, float]:
        """Mean half-width of the band over the unseen rows, by target [um]; nan without a band."""
        return {a.target: a.half_width for a in self.fitted.comparison.overall()}

    def approved(self, by: str | None) -> "FittedModels":
        """Return the models with a person's approval of the unproven ones, see `ErrorModel.taken`; None: unchanged."""
        models = tuple(m.taken(by) for m in self.fitted.models)
        return replace(self, fitted=replace(self.fitted, models=models))

    def explain(self) -> Explanations:
        """Return an explanation to print: the models, their accuracy, and the effect of a failure of each sensor."""
        return explain_all(self.fitted.models)

    def predict(self, table: Columns, time: ArrayLike | str | None = None) -> pd.DataFrame:
        """Replay a table through all models; see `thermocomp.core.model.ErrorModel.predict`.

        Parameters
        ----------
        table : DataFrame or mapping
        time : str or array-like, optional

        Returns
        -------
        DataFrame
            A column per target.
        """
        return pd.DataFrame({m.target: m.predict(table, time) for m in self.fitted.models})

    def save(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Write the model file for the compensator, ``assess`` and ``revise``; return its path."""
        from thermocomp.files import modelfile

        modelfile.write(self.fitted.models, Path(path), overwrite=overwrite)
        return Path(path)

    def to_frame(self) -> pd.DataFrame:
        """Return a row per model: its error on unseen blocks, its sensors and its formula."""
        table = frame_of(self.fitted.comparison.overall()).drop(columns=["block", "deployable", "sensors"])
        table.insert(2, "r_squared", self.fitted.r_squared)
        table["sensors"] = [" ".join(m.sensors) for m in self.fitted.models]
        table["formula"] = [m.formula() for m in self.fitted.models]
        return table

    def residuals(self) -> pd.DataFrame:
        """Return a row per unseen row of each target and model: measured, predicted, residual [unit of the target]."""
        return residuals_of(self.fitted.comparison.assessments, self.recordings)

    def plot(self, target: str | None = None) -> "Figure":
        """Return a figure of the method over time on the unseen blocks, for the first target or a given one."""
        first = self.fitted.models[0].target
        return draw_run(self.fitted.comparison.assessments, self.recordings, target or first, None)

    def __str__(self) -> str:
        told = map(describe, self.fitted.comparison.overall())
        return join([*told, *told_trouble(self.trouble)], " ")


@dataclass(frozen=True, eq=False, repr=False)
class Assessed(Result, Paged):
    """Frozen models judged on recordings.

    Parameters
    ----------
    judged : Judged
    recordings : tuple of Recording
    trouble : tuple of str
    """

    judged: Judged
    recordings: tuple[Recording, ...]
    trouble: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return all results as a dict, as printed by ``--json``."""
        from thermocomp.report import records

        judged = self.judged
        logs = find_faults(judged, self.recordings)
        return {
            "seen_in_training": judged.seen,
            "starts": starts_content(judged.starts),
            "start_offsets_degC": judged.offsets,
            "probing_every_2_h": {
                target: {"rms_um": gain.rms, "gain_um": gain.gain, "error_um": gain.error}
                for target, gain in judged.probing.items()
            },
            "rms_um_when_fitted": judged.stated,
            "verdict_when_fitted": {m.target: m.honest_error.word for m in judged.models if m.honest_error},
            "taken": {m.target: h.taken for m in judged.models if (h := m.honest_error) is not None and h.taken},
            "trouble": self.trouble,
            "validity": asdict(judged.validity) if judged.validity is not None else None,
            "validity_when_fitted": {m.target: asdict(m.validity) for m in judged.models if m.validity is not None},
            "failed_sensors": [{"recording": log.name, **f._asdict()} for log in logs for f in log.faults],
            "results": [records.assessment(a) for a in judged.assessments],
        }

    @property
    def coverage(self) -> dict[str, float]:
        """Fraction of the judged rows inside the band, by target; nan without a band."""
        return {a.target: a.coverage for a in self.judged.overall()}

    @property
    def half_width(self) -> dict[str, float]:
        """Mean half-width of the band over the judged rows, by target [um]; nan without a band."""
        return {a.target: a.half_width for a in self.judged.overall()}

    def to_frame(self, *, blocks: bool = False) -> pd.DataFrame:
        """Return a row per model, with the error stated in its file; with `blocks` also a row per thermal cycle."""
        table = frame_of(self.judged.assessments if blocks else self.judged.overall()).drop(columns="deployable")
        table.insert(4, "stated_rms", table["target"].map(self.judged.stated))
        return table

    def residuals(self) -> pd.DataFrame:
        """Return a row per judged row of each target and model: measured, predicted, residual [unit of the target]."""
        return residuals_of(self.judged.assessments, self.recordings)

    def plot(self, target: str | None = None) -> "Figure":
        """Return a figure of the model over time on the recordings, for the first target or a given one."""
        return draw_run(self.judged.assessments, self.recordings, target or self.judged.models[0].target, None)

    def page(self) -> str:
        """Return the page that ``thermocomp assess -o`` writes."""
        from thermocomp.report import assessed

        return assessed.render(self.judged, self.recordings)

    def __str__(self) -> str:
        return join([*map(describe, self.judged.overall()), *told_trouble(self.trouble)], " ")
