"""How a model is reduced to what a controller holds, in the words of ``thermocomp export``."""

from dataclasses import dataclass

from thermocomp.core.exceptions import InputError


@dataclass(frozen=True, kw_only=True)
class ReductionOptions:
    """How a model is reduced to what klipper, heidenhain and fanuc hold.

    Parameters
    ----------
    most_loss : float
        Largest loss that is let pass: RMS on unseen cycles over that of the full model.
    axes : list of str
        Which targets are written and along which axes they go, such as ch5_um=Z; by their names if not given: z_um is
        Z.
    sensors : list of str
        Temperatures that the controller has, to choose from; all of the recordings if not given.
    harm_margin : float
        Tolerated degradation in a single cycle [um]; as in ``thermocomp fit`` if not given.
    jobs : int
        Processes to share the work among; -1 takes all cores.
    """

    most_loss: float = 2.0
    axes: list[str] | None = None
    sensors: list[str] | None = None
    harm_margin: float | None = None
    jobs: int = -1

    def named(self) -> dict[str, str]:
        """Return the axes by target."""
        found = {}
        for text in self.axes or ():
            target, _, axis = text.rpartition("=")
            if not target or axis.upper() not in ("X", "Y", "Z"):
                raise InputError(f"--axes {text}: expected a target and X, Y or Z, such as z_um=Z")
            found[target] = axis.upper()
        return found
