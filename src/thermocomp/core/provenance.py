"""Metadata of a model: its origin, and the results of judging."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from statistics import median
from typing import Literal

from thermocomp.core.bounds import COEFFICIENT, check_between
from thermocomp.core.exceptions import InputError
from thermocomp.core.fingerprints import Prints
from thermocomp.core.learned import Learned


@dataclass(frozen=True)
class Provenance:
    """Origin of a model.

    Parameters
    ----------
    method : str
        Name of the method, such as ``dynamic``.
    parameters : dict of str to str
        Settings of the method, as text.
    data_sha256 : tuple of str
        Hashes of the training recordings.
    cycles : tuple of str
        Thermal cycles in the training data.
    rows : int
        Number of training rows.
    version : str
        thermocomp version that fitted it.
    source : str
        Publication from which the model was taken, if any.
    learned : Learned or None
        Statistics of the target in the training rows.
    prints : Prints or None
        Fingerprints of the training rows, used to recognise them in another file.
    starts : tuple of str
        Initial state of each recording: cold, continued, rezeroed or known; in the order of `data_sha256`.
    clocks : tuple of str
        How the clocks of several loggers were brought together, for each recording made by ``thermocomp join``.
    tests : tuple of dict of str to str
        Header data of the recordings, as stated: machine, serial, place, date, operator, instrument; each once.
    """

    method: str
    parameters: dict[str, str] = field(default_factory=dict)
    data_sha256: tuple[str, ...] = ()
    cycles: tuple[str, ...] = ()
    rows: int = 0
    version: str = ""
    source: str = ""
    learned: Learned | None = None
    prints: Prints | None = field(default=None, repr=False)
    starts: tuple[str, ...] = ()
    clocks: tuple[str, ...] = ()
    tests: tuple[dict[str, str], ...] = ()

    def __post_init__(self) -> None:
        check_between("provenance", 0, COEFFICIENT, rows=self.rows)

    @property
    def headers(self) -> tuple[str, ...]:
        """Header data of the recordings as text."""
        return tuple(", ".join(f"{name} {text}" for name, text in test.items()) for test in self.tests)


#: version of the rules for verdicts; files without this number were judged by older rules
RULES = 2

#: largest error without several inputs as a multiple of that predicted from the effects of each alone; see decision 30
PREDICTED = 1.25
#: a correction is noisy if noise of the readings moves it by more than this fraction of the drift
NOISY = 0.1

Word = Literal["accepted", "accepted for this duty", "unproven", "refused"]


def accepted(word: str) -> bool:
    """Return whether a verdict permits a model to run."""
    return word in ("accepted", "accepted for this duty")


@dataclass(frozen=True)
class HonestError:
    """Error on thermal cycles not used for training.

    Parameters
    ----------
    protocol : str
        Method by which the unseen cycles were selected.
    mae, rms, max_abs : float
        Error metrics over all unseen cycles [unit of the model].
    none_mae, none_rms : float
        The same without compensation.
    cycles : dict of str to float
        RMS of the residual per unseen cycle.
    verdict : {'accepted', 'accepted for this duty', 'unproven', 'refused'}
        Verdict of the do-no-harm gate.
    reason : str
        Reason for the verdict, as text.
    units : int
        Number of independent cycles or files used for the evaluation.
    tried : int
        Number of methods tried for the target.
    rules : int
        Version of the rules used for judging, see `RULES`; verdicts by older rules are not valid.
    taken : str
        Person who approved the use of an unproven model, and the reason; empty if none.
    harm_margin : float or None
        Tolerated degradation in a single cycle, as set before the evaluation; None: calculated by
        `thermocomp.judging.judgedunits.margin_of`.
    lost : dict of str to float
        RMS of the residual when a sensor, or several of them (``t1_C, t2_C``, in the order of the inputs), reads its
        reference value from the start, with the watch (sensor monitoring) active [unit of the model].
    noise : float
        Standard deviation of the noise of the temperatures in use; 0: not known [degC].
    scatter : float
        RMS by which this noise moves the correction [unit of the model].

    Raises
    ------
    SettingError
        An error, a count or the margin is negative or not finite.
    """

    protocol: str
    mae: float
    rms: float
    max_abs: float
    none_mae: float
    none_rms: float
    cycles: dict[str, float]
    verdict: Word
    reason: str
    units: int = 0
    tried: int = 1
    rules: int = 0
    taken: str = ""
    harm_margin: float | None = None
    lost: dict[str, float] = field(default_factory=dict)
    noise: float = 0.0
    scatter: float = 0.0

    def __post_init__(self) -> None:
        check_between(
            "honest error",
            0,
            COEFFICIENT,
            mae=self.mae,
            rms=self.rms,
            max_abs=self.max_abs,
            none_mae=self.none_mae,
            none_rms=self.none_rms,
            cycles=list(self.cycles.values()),
            units=self.units,
            tried=self.tried,
            rules=self.rules,
            harm_margin=self.harm_margin or 0.0,
            lost=list(self.lost.values()),
            noise=self.noise,
            scatter=self.scatter,
        )

    @property
    def typical(self) -> float:
        """Median RMS of the residual over the unseen cycles."""
        return median(self.cycles.values()) if self.cycles else self.rms

    @property
    def current(self) -> bool:
        """True if the model was judged by the current rules."""
        return self.rules == RULES

    @property
    def word(self) -> Word:
        """The verdict under the current rules: accepted by other rules counts as unproven."""
        return self.verdict if self.current or not accepted(self.verdict) else "unproven"

    @property
    def why(self) -> str:
        """Reason for the verdict under the current rules."""
        other = "" if self.current or self.word != "unproven" else "older" if self.rules < RULES else "newer"
        why = f"judged by {other} rules: {self.reason}" if other else self.reason
        return f"{why}. Approved by {self.taken}" if self.taken else why

    @property
    def noisy(self) -> str:
        """Warning that the correction is noisy in comparison with the drift; empty if it is not, or not known."""
        if self.scatter <= NOISY * self.none_rms:
            return ""
        return (
            f"noisy correction: noise of {self.noise:.2g} degC moves it by {self.scatter:.2g} RMS, drift "
            f"{self.none_rms:.2g}: filter the readings, or use fewer sensors"
        )

    def may_lose(self, names: Sequence[str], most: int = 1) -> bool:
        """Return whether the error without these inputs is judged, or predicted, to be below that without compensation.

        This must hold for each input alone as well: a second failure must not re-enable a correction stopped by the
        first one.

        Parameters
        ----------
        names : sequence of str
            In their model order.
        most : int
            Largest number of inputs for which an error that was not judged is predicted from those with one lost.
        """
        if max((self.lost.get(n, math.inf) for n in names), default=math.inf) > self.none_rms:
            return False
        if (judged := self.lost.get(", ".join(names))) is not None:
            return judged <= self.none_rms
        return len(names) <= most and sum(map(self.effect, names)) <= self.most_effect

    def effect(self, name: str) -> float:
        """Return the error that the loss of an input adds, of which that without it is the root sum of squares."""
        return math.sqrt(max(self.lost[name] ** 2 - self.rms**2, 0.0))

    @property
    def most_effect(self) -> float:
        """Largest sum of effects with which a model may run; -1 if losses of several inputs were judged instead."""
        if any(", " in key for key in self.lost):
            return -1.0
        return math.sqrt(max((self.none_rms / PREDICTED) ** 2 - self.rms**2, 0.0))

    def widening(self, names: Sequence[str]) -> float:
        """Return the factor by which the error increases without these inputs, in their model order; at least 1."""
        if not self.rms or not names:
            return 1.0
        known = self.lost.get(", ".join(names))
        if known is None and len(names) > 1 and all(n in self.lost for n in names):
            known = PREDICTED * math.hypot(self.rms, sum(map(self.effect, names)))
        return max(1.0, (known or 0.0) / self.rms)

    def check_may_run(self, target: str) -> None:
        """Raise `InputError` if the model of a target must not run; see `ErrorModel.check_may_run`."""
        if accepted(self.word):
            return
        if self.word == "refused":
            raise InputError(f"model of {target} was refused and will not run: {self.reason}")
        if not self.current:
            raise InputError(f"model of {target} is unproven and runs in shadow only: {self.why}; fit it again")
        if not self.taken:
            raise InputError(
                f"model of {target} is unproven and runs in shadow only: {self.why}. To approve its use "
                'nevertheless: --accept-unproven "NAME, REASON", or model.taken("NAME, REASON") in Python'
            )


def read_approval(by: str) -> str:
    """Return name and reason of a person who approves an unproven model; raise `InputError` if one is missing."""
    name, _, reason = by.partition(",")
    if not (name.strip() and reason.strip()):
        raise InputError(
            f"{by!r}: expected a name and a reason for approving an unproven model, such as 'M. Weber, trial'"
        )
    return f"{name.strip()}, {reason.strip()}"
