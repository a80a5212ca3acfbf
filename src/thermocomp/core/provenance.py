"""Metadata of a model: its origin, and the results of judging."""

from dataclasses import dataclass, field
from statistics import median
from typing import Literal

from thermocomp.core.bounds import COEFFICIENT, check_between
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
        Its settings, as text.
    data_sha256 : tuple of str
        Hashes of the recordings it was fitted to.
    cycles : tuple of str
        Thermal cycles it was fitted to.
    rows : int
        Number of rows it was fitted to.
    version : str
        thermocomp version that fitted it.
    source : str
        A publication, for models taken from one.
    learned : Learned or None
        Training statistics of the target in those rows.
    prints : Prints or None
        Fingerprints of the rows it was fitted to: they are known again in another file.
    starts : tuple of str
        Initial state of each recording: cold, continued, rezeroed or known; in the order of `data_sha256`.
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

    def __post_init__(self) -> None:
        check_between("provenance", 0, COEFFICIENT, rows=self.rows)


#: version of the rules that a verdict is given by; files that do not say were judged by older ones
RULES = 1


@dataclass(frozen=True)
class HonestError:
    """Error on thermal cycles that the method had not seen.

    Parameters
    ----------
    protocol : str
        Method by which the unseen cycles were chosen.
    mae, rms, max_abs : float
        Figures of the residual over all unseen cycles [unit of the model].
    none_mae, none_rms : float
        The same without compensation.
    cycles : dict of str to float
        RMS of the residual per unseen cycle.
    verdict : {'accepted', 'unproven', 'refused'}
        Verdict of the do-no-harm gate.
    reason : str
        Reason, in words.
    units : int
        Independent cycles or files it was judged on.
    tried : int
        Methods that were tried for the target.
    rules : int
        By which it was judged, see `RULES`; older ones prove nothing.
    taken : str
        Person who approved the use of an unproven model, and the reason; empty without.
    harm_margin : float or None
        Tolerated degradation in a single cycle, as stated before judging; None: by rule.
    lost : dict of str to float
        RMS of the residual with a sensor, or with several of them (``t1_C, t2_C``, in the order of the inputs), read
        as their zero from the start on, the watch being there to find it [unit of the model].

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
    verdict: Literal["accepted", "unproven", "refused"]
    reason: str
    units: int = 0
    tried: int = 1
    rules: int = 0
    taken: str = ""
    harm_margin: float | None = None
    lost: dict[str, float] = field(default_factory=dict)

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
        )

    @property
    def typical(self) -> float:
        """RMS of the residual in most unseen cycles: the median over them."""
        return median(self.cycles.values()) if self.cycles else self.rms

    @property
    def current(self) -> bool:
        """True if it was judged by the rules of today."""
        return self.rules == RULES

    @property
    def word(self) -> Literal["accepted", "unproven", "refused"]:
        """The verdict as it counts today: accepted by other rules is unproven."""
        return self.verdict if self.current or self.verdict != "accepted" else "unproven"

    @property
    def why(self) -> str:
        """The reason as it counts today."""
        other = "" if self.current or self.word != "unproven" else "older" if self.rules < RULES else "newer"
        why = f"judged by {other} rules: {self.reason}" if other else self.reason
        return f"{why}. Taken by {self.taken}" if self.taken else why
