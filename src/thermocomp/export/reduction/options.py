"""Options of ``thermocomp export`` for the reduction of a model to a form the controller supports."""

from dataclasses import dataclass

from thermocomp.core.exceptions import InputError


@dataclass(frozen=True, kw_only=True)
class ReductionOptions:
    """Reduction of a model to a form that klipper, heidenhain, fanuc, haas and okuma support.

    Parameters
    ----------
    most_loss : float
        Largest tolerated loss of accuracy of the simpler model: its RMS on unseen cycles divided by that of the full
        model.
    axes : list of str
        Targets to export and their axes, such as ch5_um=Z. Default: the axes in the names of the targets, such as Z for
        z_um.
    sensors : list of str
        Temperatures available at the controller, from which the inputs are selected. Default: all temperatures of the
        recordings.
    harm_margin : float
        Tolerated degradation in a single cycle [um]. Default: as in ``thermocomp fit``.
    program : int
        Program number of a macro, 1 to 9999; from 8000 on, programs are usually protected.
    jobs : int
        Number of parallel processes; -1: one per core.
    """

    most_loss: float = 2.0
    axes: list[str] | None = None
    sensors: list[str] | None = None
    harm_margin: float | None = None
    program: int = 7701
    jobs: int = -1

    def named(self) -> dict[str, str]:
        """Return the axis letters given by the user, by target."""
        found = {}
        for text in self.axes or ():
            target, _, axis = text.rpartition("=")
            if not target or axis.upper() not in ("X", "Y", "Z"):
                raise InputError(f"--axes {text}: expected a target and X, Y or Z, such as z_um=Z")
            found[target] = axis.upper()
        return found
