"""State stored in a controller and not in the program; random controllers without common data."""

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

HIGHEST_TOOL = 1000
#: work coordinate systems, G54 to G59.3
SYSTEMS = range(1, 10)


@dataclass(frozen=True)
class Stored:
    """State stored in the controller and not in the program.

    Parameters
    ----------
    origins : dict of int to sequence of float
        Origins of the work coordinate systems, 1 (G54) to 9 (G59.3), X to W [mm, deg]; the others are 0.
    rotations : dict of int to float
        Rotations of the work coordinate systems about Z [deg].
    shift : sequence of float
        G92 offset in force, X to W [mm, deg].
    lengths, diameters : dict of int to float
        Dimensions of the tools [mm]; all tools up to 1000 are included, those not listed with 0.
    active_length : float
        Tool length offset in force at the start [mm].
    spindle : int
        Number of the tool in the spindle at the start; 0: none.
    home28, home30 : sequence of float
        Positions approached by G28 and G30, X to W [mm, deg].
    startup : str
        Codes in force at the start that the end of a program does not reset, such as ``G64 P0.01 G98`` (mm).
    start : sequence of float or None
        Machine coordinates at the start, X to W [mm, deg]; None: the origin of the first work coordinate system.
    parameters : dict of int to float
        Other parameters, such as ``#100``.
    system : int
        Work coordinate system in force at the start: 1, G54, after the end of a program; any after an MDI command.
    """

    origins: Mapping[int, Sequence[float]] = field(default_factory=dict)
    rotations: Mapping[int, float] = field(default_factory=dict)
    shift: Sequence[float] = ()
    lengths: Mapping[int, float] = field(default_factory=dict)
    diameters: Mapping[int, float] = field(default_factory=dict)
    active_length: float = 0.0
    spindle: int = 0
    home28: Sequence[float] = ()
    home30: Sequence[float] = ()
    startup: str = "G64 G98"
    start: Sequence[float] | None = None
    parameters: Mapping[int, float] = field(default_factory=dict)
    system: int = 1

    def numbers(self) -> dict[int, float]:
        """Return all parameters as stored in the controller."""
        result = dict(self.parameters)
        result |= {5161 + i: value for i, value in enumerate(self.home28)}
        result |= {5181 + i: value for i, value in enumerate(self.home30)}
        result |= {5211 + i: value for i, value in enumerate(self.shift)}
        result[5210] = float(any(self.shift))
        result[5220] = float(self.system)
        for system, origin in self.origins.items():
            result |= {5201 + 20 * system + i: value for i, value in enumerate(origin)}
        result |= {5210 + 20 * system: angle for system, angle in self.rotations.items()}
        return result


@lru_cache(64)
def draw_controller(seed: int, startup: str = "") -> Stored:
    """Return a random controller; different seeds share only the codes in `startup`.

    Parameters
    ----------
    seed : int
        Random seed; selects G98 (even) or G99 (odd) unless `startup` specifies it.
    startup : str
        Specified codes in force at the start.

    Returns
    -------
    Stored
        Origins and homes within 300 mm, rotations within 20 degrees, a G92 shift within 10 mm, tools of 20 to 200 mm.
    """
    chance = random.Random(seed)

    def some(count: int, most: float = 300.0) -> tuple[float, ...]:
        return tuple(round(chance.uniform(-most, most), 6) for _ in range(count))

    codes = [startup]
    codes += [f"G64 P0.{seed}"] * ("G6" not in startup) + [f"G9{8 + seed % 2}"] * ("G9" not in startup)
    tools = range(1, HIGHEST_TOOL)
    return Stored(
        origins={system: some(9) for system in SYSTEMS},
        rotations={system: some(1, 20.0)[0] for system in SYSTEMS},
        shift=some(9, 10.0),
        lengths={tool: round(chance.uniform(20.0, 200.0), 6) for tool in tools},
        diameters={tool: round(chance.uniform(0.001, 0.1), 6) for tool in tools},
        active_length=round(chance.uniform(20.0, 200.0), 6),
        spindle=HIGHEST_TOOL - seed,
        home28=some(9),
        home30=some(9),
        startup=" ".join(codes),
        start=some(9),
        parameters=dict(zip(range(31, 5001), some(4970, 1000.0), strict=True)),
    )
