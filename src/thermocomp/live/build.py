"""Construction of a service from its configuration."""

from collections.abc import Sequence
from dataclasses import replace

from thermocomp.core.exceptions import InputError
from thermocomp.core.ports import Probe, Source
from thermocomp.files.machines import read_machine, read_models
from thermocomp.live.adapters.network import MqttProbing
from thermocomp.live.adapters.plain import SimulatedSource
from thermocomp.live.adapters.probes import MqttProbe, SimulatedProbe
from thermocomp.live.adapters.sections import LinuxCncOut
from thermocomp.live.clock import ServiceClock
from thermocomp.live.config import Probings, ServiceSettings
from thermocomp.live.findings import find_faults
from thermocomp.live.journal.journal import JournalLimits
from thermocomp.live.loop import Service
from thermocomp.live.recorder import Recorder
from thermocomp.runtime.compensator import Compensator


def build(settings: ServiceSettings) -> Service:
    """Return the service of a configuration; nothing is connected yet."""
    config, folder = settings
    if missing := list(find_faults(settings)):
        raise InputError("\n".join(["invalid configuration:", *(f"  {m}" for m in missing)]))
    if (own := config.machine) is not None:
        machine = read_machine(folder / own.file)
        compensator = Compensator.of_machine(machine, own.at, own.tool, config.limits)
    else:
        models = [model for path in config.models for model in read_models(folder / path)]
        compensator = Compensator.of(models, config.limits, watching=config.shadow)
    if any(getattr(one, "repeats", "watch") == "exception" for one in config.sources):
        compensator = replace(compensator, repeats="exception")
    for one in config.sinks:
        if isinstance(one, LinuxCncOut) and (unknown := one.axes.keys() - compensator.lines.keys()):
            known = ", ".join(compensator.lines)
            raise InputError(f"axes of LinuxCNC: no model for {', '.join(sorted(unknown))}; there are {known}")
    sources = [one.open(folder, config.speed) for one in config.sources]
    service = Service(
        compensator=compensator,
        sources=sources,
        sinks=[one.open(folder) for one in config.sinks],
        clock=ServiceClock(config.speed),
        state_path=folder / config.state if config.state else None,
        first_start=config.first_start,
        at_unknown=config.at_unknown,
        probes=[_probe(one, sources, tuple(compensator.lines)) for one in config.probes],
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


def _probe(one: Probings, sources: Sequence[Source], targets: tuple[str, ...]) -> Probe:
    if isinstance(one, MqttProbing):
        return MqttProbe(topic=one.topic, host=one.host, port=one.port)
    machine = next(s for s in sources if isinstance(s, SimulatedSource))
    return SimulatedProbe(machine=machine, targets=targets, every=one.every, repeatability=one.repeatability)
