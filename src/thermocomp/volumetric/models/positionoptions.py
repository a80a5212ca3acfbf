"""Model options of a position-dependent error, and their determination from its profiles."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from thermocomp.core.arrays import BoolArray
from thermocomp.core.exceptions import FitError, InputError
from thermocomp.core.inputs import Support
from thermocomp.models.base import ThermalRegressor
from thermocomp.recordings.profiles import Profiles
from thermocomp.volumetric.models.geometric import Kind
from thermocomp.volumetric.models.shapes import Order

Setting = Literal["slopes", "offset", "reference_position"]

#: all settings that can be determined from profiles
SETTINGS: tuple[Setting, ...] = ("slopes", "offset", "reference_position")
#: powers for which the remainder is reported (C-05)
POWERS = (1, 2, 3)
#: minimum reduction for adding a power, as a share of the remainder and of the thermal part
WORTH_OF_REST, WORTH_OF_THERMAL = 0.1, 0.05


@dataclass(frozen=True, kw_only=True)
class PositionOptions:
    """Model options of a position-dependent error.

    Parameters
    ----------
    method : str or ThermalRegressor
        Method for the slopes: any of `thermocomp.models.methods`, or a custom estimator.
    inputs : sequence of str, optional
        Input channels of the models of the slopes. Default: all temperatures and the spindle speed.
    slopes : int
        Highest power m of the position; 1 is enough according to Chen (C-05). 0 without an offset: cold profile only.
    offset : bool
        Whether to model k_0(t); without it the thermal part is zero at the reference position, as in Chen's model.
    order : int, (int, int) or 'auto'
        Order of the profile; see `thermocomp.volumetric.models.geometric.fit_profile`.
    coordinates : str, optional
        Axes that the profile may depend on (C-06).
    reference : int or sequence of int
        States of each test that count as cold; the mean of several (C-07). Temperatures are relative to them too.
    reference_position : float, optional
        Position at which q is zero [mm]. Default: axis position 0, or the end of the measured travel nearest to it.
    rezero : bool
        False: all tests refer to one cold state, the mean of their reference states, as does the live model:
        temperatures are absolute. For a machine whose cold profile differs from morning to morning.
    support : Support
        Behaviour of the models of the slopes outside their training range.
    """

    method: str | ThermalRegressor = "mra"
    inputs: Sequence[str] | None = None
    slopes: int = 1
    offset: bool = False
    profile: Kind = "polynomial"
    order: int | Order | Literal["auto"] = "auto"
    coordinates: str | None = None
    reference: int | Sequence[int] = 0
    reference_position: float | None = None
    rezero: bool = True
    support: Support = Support()

    def __post_init__(self) -> None:
        if self.reference_position is not None and not np.isfinite(self.reference_position):
            raise InputError(f"reference position {self.reference_position} mm: must be a finite number")

    @property
    def powers(self) -> tuple[int, ...]:
        """Powers of q whose factors are modelled."""
        return tuple(range(0 if self.offset else 1, self.slopes + 1))


def fill_options(
    profiles: Profiles | Sequence[Profiles],
    options: PositionOptions = PositionOptions(),
    left_open: Sequence[Setting] = SETTINGS,
    *,
    learn: BoolArray | None = None,
) -> PositionOptions:
    """Determine open options from the profiles; temperatures are not used.

    - Reference position: the measured position where the thermal part is smallest, i.e. where powers that vanish there
      leave the smallest residual. A laser reads relative to its zeroing position, a screw grows from its fixed bearing.
    - Offset: used if the thermal part exceeds the noise even there: it must remove a tenth of the remainder after the
      powers.
    - Slopes: the fewest powers to which one more adds little, as in `PositionFit.enough`; none if the thermal part is
      noise.

    Parameters
    ----------
    learn : ndarray of bool of shape (n_states,), optional
        States that may be used; see `thermocomp.volumetric.models.position.fit_position`.
    """
    tests = set_cold_profiles((profiles,) if isinstance(profiles, Profiles) else tuple(profiles), options, learn)
    tests = blank_unlearned(tests, options, learn)
    thermal = remainder(tests, replace(options, offset=False), 0)
    shifted = {m: remainder(tests, replace(options, offset=True), m) for m in POWERS}
    if "reference_position" in left_open:
        m = choose_power(shifted, thermal) or 1 if "slopes" in left_open else options.slopes
        options = replace(options, reference_position=_quietest(tests, options, m))
    if "offset" in left_open:
        # with all powers, so that a curved profile is not mistaken for a shifted one
        known = [m for m in POWERS if np.isfinite(shifted[m])]
        m = max(known, default=1) if "slopes" in left_open else options.slopes
        without, with_it = (remainder(tests, replace(options, offset=o), m) for o in (False, True))
        options = replace(options, offset=is_worthwhile(without, with_it, 0.0))
    if "slopes" in left_open:
        rests = {m: remainder(tests, options, m) for m in (0, *POWERS)}
        options = replace(options, slopes=choose_power(rests, thermal) or 0)
    return options


def reference_position(tests: Sequence[Profiles], options: PositionOptions) -> float:
    """Return the reference position, at which q is zero [mm]: see `PositionOptions`."""
    if options.reference_position is not None:
        return options.reference_position
    low, high = min(t.position.min() for t in tests), max(t.position.max() for t in tests)
    return float(min(max(0.0, low), high))


def set_cold_profiles(
    tests: Sequence[Profiles], options: PositionOptions, learn: BoolArray | None = None
) -> tuple[Profiles, ...]:
    """Return the tests, each with its own cold profile, or all with the mean of these (`PositionOptions.rezero`).

    Parameters
    ----------
    learn : ndarray of bool of shape (n_states,), optional
        Training states: the mean is taken over tests with at least one; see `blank_unlearned`.
    """
    if options.rezero:
        return tuple(tests)
    for test in tests[1:]:
        if not np.array_equal(test.points, tests[0].points):
            raise InputError(
                f"profiles of {test.target}: to be relative to one cold state, all tests need the same positions"
            )
    zero = np.mean([test.cold(options.reference) for test in blank_unlearned(tests, options, learn)], axis=0)
    return tuple(replace(test, zero=zero) for test in tests)


def blank_unlearned(
    tests: Sequence[Profiles], options: PositionOptions, learn: BoolArray | None = None
) -> tuple[Profiles, ...]:
    """Return the training data: states not used for training are blank, tests without training states are omitted.

    Parameters
    ----------
    learn : ndarray of bool of shape (n_states,), optional
        Training states over all tests. Default: all.
    """
    if learn is None:
        return tuple(tests)
    found = []
    for test, mine in zip(tests, np.split(learn, np.cumsum([len(test) for test in tests])[:-1]), strict=True):
        if mine.any():
            kept = mine.copy()
            kept[test.reference_rows(options.reference)] = True
            found.append(replace(test, values=np.where(kept[:, None], test.values, np.nan)))
    if not found:
        raise FitError(f"{tests[0].target}: no thermal state is left for training")
    return tuple(found)


def remainder(tests: Sequence[Profiles], options: PositionOptions, m: int) -> float:
    """Return the residual of the thermal part after powers up to m, RMS per degree of freedom, no reference states.

    Returns
    -------
    float
        [unit]; nan if there are not enough positions.
    """
    if not m and not options.offset:
        warm = [np.delete(t.thermal(options.reference), t.reference_rows(options.reference), axis=0) for t in tests]
        thermal = np.concatenate([w[np.isfinite(w)] for w in warm])
        return float(np.sqrt(np.mean(thermal**2))) if thermal.size else 0.0
    turn = reference_position(tests, options)
    try:
        fits = [t.slopes(m, offset=options.offset, reference=options.reference, reference_position=turn) for t in tests]
    except InputError:
        return float("nan")
    return float(np.sqrt(np.mean([f.remainder**2 for f in fits])))


def is_worthwhile(before: float, after: float, thermal: float) -> bool:
    """Return whether a term is useful: it removes over a tenth of the remainder and a twentieth of the thermal part."""
    return before - after > max(WORTH_OF_REST * before, WORTH_OF_THERMAL * thermal)


def choose_power(remainders: Mapping[int, float], thermal: float) -> int | None:
    """Return the smallest m to which higher powers add little; None if unknown.

    Parameters
    ----------
    remainders : mapping of int to float
        Residual after powers up to m [unit], by m.
    thermal : float
        RMS of the thermal part [unit].
    """
    known = {m: rest for m, rest in remainders.items() if np.isfinite(rest)}
    return next(
        (m for m in known if not is_worthwhile(known[m], min(known[k] for k in known if k >= m), thermal)), None
    )


def _quietest(tests: Sequence[Profiles], options: PositionOptions, m: int) -> float:
    """Return the measured position relative to which powers up to m leave the smallest residual [mm]."""
    alone = replace(options, offset=False)
    places = np.unique(np.concatenate([test.position for test in tests])).tolist()
    return float(min(places, key=lambda p: remainder(tests, replace(alone, reference_position=p), m)))
