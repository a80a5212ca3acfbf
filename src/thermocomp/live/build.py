"""The service that a configuration describes."""

from collections.abc import Sequence
from importlib.resources import as_file, files
from pathlib import Path

from thermocomp.core.exceptions import InputError
from thermocomp.core.ports import Probe, Sink, Source
from thermocomp.files.machines import read_machine, read_models
from thermocomp.live.adapters.linuxcnc.sink import LinuxCncSink
from thermocomp.live.adapters.mqtt import MqttSink, MqttSource
from thermocomp.live.adapters.plain import FileSink, ReplaySource, SimulatedSource
from thermocomp.live.adapters.probes import MqttProbe, SimulatedProbe
from thermocomp.live.clock import Clock
from thermocomp.live.config import FileOut, In, LinuxCncOut, Out, Probings, ReplayIn, Settings
from thermocomp.live.findings import find_faults
from thermocomp.live.journal.journal import JournalLimits
from thermocomp.live.loop import Service
from thermocomp.live.network import MqttIn, MqttProbing
from thermocomp.live.recorder import Recorder
from thermocomp.runtime.compensator import Compensator
from thermocomp.virtual.protocol import Experiment
from thermocomp.virtual.protocolfile import read_protocol


def build(settings: Settings) -> Service:
    """Return the service of a configuration; nothing is connected yet.

    Parameters
    ----------
    settings : Settings

    Raises
    ------
    InputError
        A file or a folder is not there, a model file or an experiment cannot be used, or none of the models may run.
    """
    config, folder = settings
    if missing := list(find_faults(settings)):
        raise InputError("\n".join(["what the configuration names cannot be used:", *(f"  {m}" for m in missing)]))
    if (own := config.machine) is not None:
        machine = read_machine(folder / own.file)
        compensator = Compensator.of_machine(machine, own.at, own.tool, config.limits)
    else:
        models = [model for path in config.models for model in read_models(folder / path)]
        compensator = Compensator.of(models, config.limits, watching=config.shadow)
    for one in config.sinks:
        if isinstance(one, LinuxCncOut) and (unknown := one.axes.keys() - compensator.lines.keys()):
            known = ", ".join(compensator.lines)
            raise InputError(f"axes of LinuxCNC: no model for {', '.join(sorted(unknown))}; there are {known}")
    sources = [_source(one, folder, config.speed) for one in config.sources]
    service = Service(
        compensator,
        sources,
        [_sink(one, folder) for one in config.sinks],
        Clock(config.speed),
        folder / config.state if config.state else None,
        [_probe(one, sources, tuple(compensator.lines)) for one in config.probes],
    )
    if (kept := config.journal) is not None:
        room = JournalLimits(size_bytes=round(kept.size_mb * 2**20), files=kept.files)
        service.recorder = Recorder(
            folder / kept.file, compensator, config.own_compensation, service.clock, room, kept.channels
        )
        service.latest.used.update(kept.channels)
    if config.shadow:
        for target in compensator.lines.keys() - compensator.shadow.keys():
            service.watch_only(target)
    return service


def find_experiment(name: str, folder: Path) -> Experiment:
    """Return an experiment of the virtual machine: one that comes with the package, or a protocol of one's own.

    Raises
    ------
    InputError
        There is none, or it cannot be used.
    """
    if name.endswith(".toml"):
        return read_protocol(folder / name)
    home = files("thermocomp.virtual") / "protocols"
    known = sorted(p.name.removesuffix(".toml") for p in home.iterdir() if p.name.endswith(".toml"))
    if name not in known:
        raise InputError(f"experiment {name!r}: want a path that ends in .toml, or one of {', '.join(known)}")
    with as_file(home / f"{name}.toml") as path:
        return read_protocol(path)


def _source(one: In, folder: Path, speed: float) -> Source:
    if isinstance(one, MqttIn):
        return MqttSource(topic=one.topic, host=one.host, port=one.port, names=dict(one.names))
    if isinstance(one, ReplayIn):
        return ReplaySource(path=folder / one.file, speed=speed)
    return SimulatedSource(experiment=find_experiment(one.experiment, folder), seed=one.seed, speed=speed)


def _probe(one: Probings, sources: Sequence[Source], targets: tuple[str, ...]) -> Probe:
    if isinstance(one, MqttProbing):
        return MqttProbe(topic=one.topic, host=one.host, port=one.port)
    machine = next(s for s in sources if isinstance(s, SimulatedSource))
    return SimulatedProbe(machine=machine, targets=targets, every=one.every, repeatability=one.repeatability)


def _sink(one: Out, folder: Path) -> Sink:
    if isinstance(one, FileOut):
        return FileSink(path=folder / one.file)
    if isinstance(one, LinuxCncOut):
        return LinuxCncSink(path=folder / one.socket, axes=dict(one.axes))
    return MqttSink(topic=one.topic, host=one.host, port=one.port)
