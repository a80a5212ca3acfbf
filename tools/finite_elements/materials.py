"""Materials of the virtual machine's parts: data with their sources in ``data/materials.toml``."""

import tomllib
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

from thermocomp.core.exceptions import InputError


@dataclass(frozen=True)
class Material:
    """An isotropic material near room temperature.

    Parameters
    ----------
    conductivity : float
        [W/(m K)]
    density : float
        [kg/m3]
    specific_heat : float
        [J/(kg K)]
    modulus : float
        Young's [Pa].
    poisson : float
        Poisson's ratio.
    expansion : float
        [1/K]
    """

    conductivity: float
    density: float
    specific_heat: float
    modulus: float
    poisson: float
    expansion: float

    @property
    def heat_capacity(self) -> float:
        """Density times specific heat [J/(m3 K)]."""
        return self.density * self.specific_heat


def data(name: str) -> dict[str, Any]:
    """Return the content of a file of ``data/``, such as ``"spindle.toml"``."""
    return tomllib.loads(files(__package__).joinpath("data", name).read_text(encoding="utf-8"))


@cache
def materials() -> dict[str, Material]:
    """Return the materials of ``data/materials.toml``, by name."""
    return {name: Material(**values) for name, values in data("materials.toml").items()}


def material(name: str) -> Material:
    """Return a material of ``data/materials.toml``."""
    known = materials()
    if name not in known:
        raise InputError(f"unknown material {name!r}; data/materials.toml has {', '.join(known)}")
    return known[name]
