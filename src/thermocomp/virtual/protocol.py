"""Protocols as data: commands to a virtual machine, and recorded channels.

Written protocols (`Experiment`, `PlannedTest`) may leave numbers and sequences open, to be selected at random from a
seed; executed ones (`Programme`) are fixed.
"""

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from typing import Literal, get_args

import numpy as np

from thermocomp.core.exceptions import SettingError, explain_unknown
from thermocomp.core.machine import Channel
from thermocomp.virtual.climate import Climate
from thermocomp.virtual.instruments import Instrument, Touch, displacement, thermometer
from thermocomp.virtual.kits import KITS, Kit, labelled
from thermocomp.virtual.segments import Path, SteadySegment, Stretch, values
from thermocomp.virtual.sensors import SensorFault

HOUR = 3600.0
#: recorded drive channels: speed for a machine with a spindle, feed if axes move
SPEED = Channel("spindle_rpm", "spindle_speed", "1/min", "spindle")
FEED = Channel("feed_mm_min", "feed", "mm/min", "of the axes, along the path")


#: machine model: constant conductances for heat and joints, or dependent on temperature and speed
Physics = Literal["linear", "nonlinear"]
#: limits of a protocol; more is an error, or would run indefinitely
MOST_ROWS, MOST_COPIES = 10_000_000, 10_000


@dataclass(frozen=True, kw_only=True)
class RecordingSetup:
    """Settings of the recording of a test: its channels, places and sampling.

    Parameters
    ----------
    sampling : float
        Time between two rows [s].
    places : tuple of str, or mapping of str to str
        Places of temperature sensors, see `thermocomp.virtual.kits`; a mapping assigns other channel names.
    probes : tuple of str, or mapping of str to str or mapping of str to float
        Displacements, in the same way; a mapping of observables of the machine to weights defines a custom probe.
    perfect : bool
        Sensors without lag, bias, drift, noise and quantisation: a calculation, not a measurement.
    touch : Touch, optional
        A probing cycle.
    mounting : str
        Chuck of the resting tool, see `thermocomp.virtual.kits.Kit.mountings`. Default: the usual one.
    foundation : float
        Temperature of the foundation of the resting tool relative to the room [K].
    """

    sampling: float
    climate: Climate = field(default_factory=Climate)
    places: tuple[str, ...] | Mapping[str, str] = ("all",)
    probes: tuple[str, ...] | Mapping[str, str | Mapping[str, float]] = ("nest",)
    perfect: bool = False
    touch: Touch | None = None
    faults: tuple[SensorFault, ...] = ()
    mounting: str = ""
    foundation: float = 0.0

    def __post_init__(self) -> None:
        if not self.sampling > 0:
            raise SettingError(f"expected a positive interval, found {self.sampling:g} s", ("sampling",))
        if not (self.places or self.probes or self.touch):
            raise SettingError("nothing is recorded: give at least one of places, probes and touch", ("places",))
        if not abs(self.foundation) <= 30.0:
            raise SettingError(f"{self.foundation:g} K: must be from -30 to 30", ("foundation",))

    def instruments(self, kit: Kit, noise: float | None = None) -> list[Instrument]:
        """Return the mounted instruments: temperatures, displacements, probed points.

        Parameters
        ----------
        noise : float, optional
            Standard deviation of the temperature noise [degC]. Default: as defined for each sensor.
        """
        perfect = self.perfect
        with add_path("places"):
            places = labelled(self.places, kit.outfits)
            found = [thermometer(kit, n, p, perfect=perfect, noise=noise) for n, p in places.items()]
        with add_path("probes"):
            probes = labelled(self.probes, kit.nests)
            found += [displacement(n, kit.probe(p), perfect=perfect) for n, p in probes.items()]
        if self.touch:
            if not kit.top_speed:
                raise SettingError("the machine has no axes", ("touch",))
            found += self.touch.instruments(perfect=perfect)
        names = [i.sensor.channel.name for i in found]
        for k, name in enumerate(names):
            if name in names[:k]:
                raise SettingError(f"two channels are named {name!r}: choose another name for one of them")
        return found


@dataclass(frozen=True, kw_only=True)
class Programme(RecordingSetup):
    """A test that is ready to run, with the settings of `RecordingSetup`.

    Parameters
    ----------
    segments : tuple of SteadySegment
        Each lasts an integer number of sampling intervals.
    soak : tuple of SteadySegment
        Segments before the test, from a machine that has been off for a long time; they define the initial state.
    """

    name: str
    segments: tuple[SteadySegment, ...]
    soak: tuple[SteadySegment, ...] = (SteadySegment(12 * HOUR),)

    def __post_init__(self) -> None:
        super().__post_init__()
        for k, segment in enumerate(self.segments):
            _check_duration((segment.duration,), ("segments", k, "duration"), self.sampling)


@dataclass(frozen=True, kw_only=True)
class PlannedTest(RecordingSetup, Stretch):
    """A test, or several of a kind, as written in a protocol; with the settings of `RecordingSetup` and `Stretch`.

    Parameters
    ----------
    name : str
        Suffix to the name of the experiment. Default: the test number, if there are several tests.
    copies : int
        Number of tests, each with separate random draws.
    soak : Stretch
        Stretch before the test, from a machine that has been off for a long time; it defines the initial state. The
        test's own speed, coolant etc. do not apply to it.
    """

    name: str = ""
    copies: int = 1
    soak: Stretch = field(default_factory=lambda: Stretch(duration=12 * HOUR))

    def __post_init__(self) -> None:
        RecordingSetup.__post_init__(self)
        Stretch.__post_init__(self)
        if not 1 <= self.copies <= MOST_COPIES:
            raise SettingError(f"expected 1 to {MOST_COPIES} copies, found {self.copies}", ("copies",))
        if self.weight != 1.0:
            raise SettingError('applies only inside segments whose order is "drawn"', ("weight",))
        for path, given in self.leaves():
            _check_duration(values(given.get("duration")), (*path, "duration"), self.sampling)
        for path, given in self.soak.leaves():
            _check_duration(values(given.get("duration")), ("soak", *path, "duration"))
        for k, fault in enumerate(self.faults):
            if not 0 <= fault.start <= self.longest:
                last = f"{self.longest:g} s"
                raise SettingError(
                    f"{fault.start:g} s: start of the fault: must be from 0 to the end of the test, {last}",
                    ("faults", k, "start"),
                )
        if self.longest / self.sampling > MOST_ROWS:
            rows = f"{self.longest / self.sampling:.3g} rows"
            raise SettingError(
                f"{self.longest:g} s sampled every {self.sampling:g} s give {rows}; at most {MOST_ROWS:,} are "
                "supported",
                ("segments",),
            )

    def programme(self, name: str, rng: np.random.Generator) -> Programme:
        """Return a test that is ready to run, with all open values selected at random."""
        setup = {f.name: getattr(self, f.name) for f in fields(RecordingSetup)}
        return Programme(name=name, segments=tuple(self.draw(rng)), soak=tuple(self.soak.draw(rng)), **setup)

    def check(self, kit: Kit) -> None:
        """Raise `SettingError` if the test requires something that the machine lacks."""
        for key in ("mounting", "foundation"):
            if getattr(self, key) and not kit.mountings:
                raise SettingError("only the resting tool has a choice of mountings and foundations", (key,))
        if self.mounting and self.mounting not in kit.mountings:
            raise explain_unknown("mounting", self.mounting, kit.mountings, ("mounting",))
        channels = [i.sensor.channel.name for i in self.instruments(kit)]
        channels += [c.name for c in (SPEED, FEED) if kit.top_speed]
        for k, fault in enumerate(self.faults):
            if fault.channel not in channels:
                raise explain_unknown("channel", fault.channel, channels, ("faults", k, "channel"))
        for path, given in (*self.leaves(), *((("soak", *path), given) for path, given in self.soak.leaves())):
            if given.get("speed") and not kit.top_speed:
                raise SettingError("the machine has no spindle", (*path, "speed"))
            for speed in values(given.get("speed")):
                if not abs(speed) <= kit.top_speed:
                    raise SettingError(
                        f"{speed:g} 1/min: the top speed of the spindle is {kit.top_speed:g} 1/min", (*path, "speed")
                    )
            if given.get("feed") and not kit.top_speed:
                raise SettingError("the machine has no axes", (*path, "feed"))
            for place in given.get("loads", {}):
                if place not in kit.loads:
                    raise explain_unknown("load", place, kit.loads, (*path, "loads"))


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """A named experiment: one test or several on one machine.

    Parameters
    ----------
    description : str
        One line.
    machine : str
        Key of `thermocomp.virtual.kits.KITS`: the machining ``centre``, or the resting ``tool``.
    physics : {'linear', 'nonlinear'}
        See `thermocomp.virtual.nonlinear`.
    """

    name: str
    tests: tuple[PlannedTest, ...]
    description: str = ""
    machine: str = "centre"
    physics: Physics = "linear"

    def __post_init__(self) -> None:
        if self.machine not in KITS:
            raise explain_unknown("machine", self.machine, KITS, ("machine",))
        if self.physics not in get_args(Physics):
            raise explain_unknown("physics", self.physics, get_args(Physics), ("physics",))
        if not self.tests:
            raise SettingError("an experiment needs at least one test", ("tests",))
        for k, plan in enumerate(self.tests):
            with add_path("tests", k):
                plan.check(self.kit)
        names = self.names
        for k, name in enumerate(names):
            if name in names[:k]:
                raise SettingError(f"two tests are named {name!r}: choose another name for one of them", ("tests",))

    @property
    def kit(self) -> Kit:
        """Equipment of the machine."""
        return KITS[self.machine]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the tests, in order."""
        found = []
        for number, plan in enumerate(self.tests, start=1):
            own = plan.name or (str(number) if len(self.tests) > 1 else "")
            for copy in range(1, plan.copies + 1):
                found.append("-".join(part for part in (self.name, own, str(copy) if plan.copies > 1 else "") if part))
        return tuple(found)

    def programmes(self, seed: int = 0) -> list[Programme]:
        """Return the tests with all open values selected at random, separately for each test."""
        plans = [plan for plan in self.tests for _ in range(plan.copies)]
        return [
            plan.programme(name, np.random.default_rng(make_seed(seed, name, "lots")))
            for name, plan in zip(self.names, plans, strict=True)
        ]


def make_seed(seed: int, test: str, what: str) -> list[int]:
    """Return the seed of one kind of randomness in one test, independent of other tests and kinds."""
    return [seed, *f"{test}/{what}".encode()]


@contextmanager
def add_path(*path: str | int) -> Iterator[None]:
    """Prefix the location to a `SettingError` raised inside."""
    try:
        yield
    except SettingError as e:
        raise SettingError(str(e), (*path, *e.path)) from None


def _check_duration(durations: tuple[float, ...], path: Path, sampling: float | None = None) -> None:
    """Raise an error for durations that are missing, not positive, or not an integer number of sampling intervals."""
    if not durations:
        raise SettingError('is missing: state how long it lasts, such as duration = "30 min"', path)
    for duration in durations:
        if not 0 < duration < math.inf:
            raise SettingError(f"{duration:g} s: must be positive", path)
        if sampling and abs(duration / sampling - round(duration / sampling)) > 1e-9:
            raise SettingError(f"{duration:g} s is not a multiple of the {sampling:g} s between two rows", path)
