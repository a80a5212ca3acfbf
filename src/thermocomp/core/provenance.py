"""What stands beside the numbers of a model: where it comes from, and how it was judged."""

from dataclasses import dataclass, field
from typing import Literal

from thermocomp.core.fingerprints import Prints
from thermocomp.core.learned import Learned


@dataclass(frozen=True)
class Provenance:
    """Where a model comes from.

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
        What those rows showed of the target.
    prints : Prints or None
        Fingerprints of the rows it was fitted to: they are known again in another file.
    starts : tuple of str
        How each of the recordings began: cold, continued, rezeroed or known; in the order of `data_sha256`.
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


#: version of the rules that a verdict is given by; files that do not say were judged by older ones
RULES = 1


@dataclass(frozen=True)
class HonestError:
    """Error on thermal cycles that the method had not seen.

    Parameters
    ----------
    protocol : str
        How the unseen cycles were chosen.
    mae, rms, max_abs : float
        Of the residual over all unseen cycles [unit of the model].
    none_mae, none_rms : float
        The same without compensation.
    cycles : dict of str to float
        RMS of the residual per unseen cycle.
    verdict : {'accepted', 'unproven', 'refused'}
        Of the do-no-harm gate.
    reason : str
        Why, in words.
    units : int
        Independent cycles or files it was judged on.
    tried : int
        Methods that were tried for the target.
    rules : int
        By which it was judged, see `RULES`; older ones prove nothing.
    taken : str
        Who takes an unproven model all the same, and why; empty without that.
    harm_margin : float or None
        Harm in a single cycle that was let pass, as it was stated before judging; None: by rule.
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

    @property
    def word(self) -> Literal["accepted", "unproven", "refused"]:
        """The verdict as it counts today: accepted by older rules is unproven."""
        return "unproven" if self.verdict == "accepted" and self.rules < RULES else self.verdict

    @property
    def why(self) -> str:
        """The reason as it counts today."""
        why = f"judged by older rules: {self.reason}" if self.word != self.verdict else self.reason
        return f"{why}. Taken by {self.taken}" if self.taken else why
