"""Error in use: error on unseen blocks with clean and with noisy readings, and with a sensor lost."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from thermocomp.core.learned import probe_noise
from thermocomp.judging.robustness import Robustness
from thermocomp.recordings.samples import Samples

#: weights of the mean squares with clean readings, with noise, and with one sensor lost; fixed before any evaluation
WEIGHTS = (1.0, 1.0, 1.0)
#: methods whose error in use exceeds the least by no more than this fraction are tied
TIE = 0.05


@dataclass(frozen=True)
class InUse:
    """Error of a model in use, and what decides between methods that are tied.

    Parameters
    ----------
    clean : float
        RMS on unseen blocks [um].
    noisy : float
        RMS with the noise in use on every temperature [um].
    lost : float
        RMS with one sensor lost, mean over the sensors [um].
    sensors : int
        Number of inputs that affect the result.
    numbers : int
        Number of coefficients.
    """

    clean: float
    noisy: float
    lost: float
    sensors: int = 0
    numbers: int = 0

    @classmethod
    def of(cls, clean: float, undisturbed: float, found: Robustness | None, noise: float, **ties: int) -> "InUse":
        """Return the error in use of a model replayed with disturbed readings.

        A model is replayed with a larger noise than that in use; the mean square that noise adds is proportional to the
        variance of the noise, exactly for a linear model.

        Parameters
        ----------
        undisturbed : float
            RMS of the model alone, to which `found` refers; `clean` is that of the compensator [um].
        noise : float
            Standard deviation of the noise in use [degC].
        """
        if found is None:
            return cls(clean, clean, clean, **ties)
        noisy = max(found.noise_rms.get("normal", (0.0,))[0] ** 2 - undisturbed**2, 0.0)
        lost = float(np.mean(list(found.lost_rms.values()))) if found.lost_rms else undisturbed
        added = max(lost**2 - undisturbed**2, 0.0)
        by_noise = float(np.hypot(clean, noise / found.noise * noisy**0.5))
        return cls(clean, by_noise, float(np.hypot(clean, added**0.5)), **ties)

    @property
    def rms(self) -> float:
        """Weighted root mean square of the three errors [um]."""
        return float(np.sqrt(np.average(np.square([self.clean, self.noisy, self.lost]), weights=WEIGHTS)))

    def about(self, clean: float) -> "InUse":
        """Return the same effects of noise and of lost sensors about another error with clean readings [um]."""
        if not np.isfinite(self.clean):
            return self  # it could not be fitted
        noisy, lost = (np.sqrt(max(x**2 - self.clean**2, 0.0)) for x in (self.noisy, self.lost))
        return replace(self, clean=clean, noisy=float(np.hypot(clean, noisy)), lost=float(np.hypot(clean, lost)))


def pool(parts: Sequence[tuple[InUse, int]]) -> InUse:
    """Return the error in use over several blocks, with their numbers of rows."""
    rows = [n for _, n in parts]
    errors = np.square([(p.clean, p.noisy, p.lost) for p, _ in parts])
    clean, noisy, lost = np.sqrt(np.average(errors, axis=0, weights=rows)).tolist()
    sensors, numbers = max(p.sensors for p, _ in parts), max(p.numbers for p, _ in parts)
    return InUse(clean, noisy, lost, sensors=sensors, numbers=numbers)


def least(errors: Mapping[str, InUse]) -> str:
    """Return the method with the least error in use; ties go to fewer sensors, then to fewer coefficients."""
    bound = (1.0 + TIE) * min(e.rms for e in errors.values())
    tied = [name for name, e in errors.items() if e.rms <= bound]
    return min(tied or errors, key=lambda name: (errors[name].sensors, errors[name].numbers, errors[name].rms))


def noise_of(samples: Samples) -> float:
    """Return the noise of the temperatures, estimated from second differences: root mean square over the sensors.

    Returns
    -------
    float
        Standard deviation [degC].
    """
    heat = samples.values[:, [c.quantity == "temperature" for c in samples.inputs]]
    tests = [samples.test == k for k in np.unique(samples.test)]
    found = [np.median([probe_noise(x[mine]) for mine in tests]) for x in heat.T]
    return float(np.sqrt(np.mean(np.square(found)))) if found else 0.0
