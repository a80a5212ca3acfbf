"""Network settings of a configuration: brokers, topics, hosts."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from ipaddress import ip_address
from pathlib import Path
from typing import ClassVar, Literal

from thermocomp.core.exceptions import SettingError
from thermocomp.core.ports import Sink, Source

Names = dict[str, str]
#: maximum length of a topic [bytes in MQTT], of a host name and of one label of it [characters]
_TOPIC, _HOST, _LABEL = 65_535, 253, 63


@dataclass(frozen=True, kw_only=True)
class OnBroker:
    """Common part of the configuration of sources and sinks on an MQTT topic.

    Parameters
    ----------
    host, port : str, int
        Host and port of the broker.
    """

    published: ClassVar[bool] = False
    topic: str
    host: str = "127.0.0.1"
    port: int = 1883

    def __post_init__(self) -> None:
        if why := explain_topic(self.topic, published=self.published):
            raise SettingError(f"topic = {self.topic[:200]!r}: {why}")
        if why := explain_host_name(self.host):
            raise SettingError(f"host = {self.host[:200]!r}: {why}")
        if not 0 < self.port <= 65535:
            raise SettingError(f"port = {self.port}: expected a port from 1 to 65535")

    def hears(self, other: "OnBroker") -> bool:
        """Return whether messages that `other` publishes arrive on this topic, according to their names."""
        return self._hears(other, other.topic) or (other.published and self._hears(other, f"{other.topic}/status"))

    def _hears(self, other: "OnBroker", published: str) -> bool:
        levels, topic = self.topic.split("/"), published.split("/")
        levels = levels[2:] if levels[0] == "$share" else levels
        fits = all(level in ("+", "#", found) for level, found in zip(levels, topic, strict=False))
        long = len(topic) >= len(levels) - 1 if levels[-1] == "#" else len(topic) == len(levels)
        return (self.host, self.port) == (other.host, other.port) and fits and long


@dataclass(frozen=True, kw_only=True)
class MqttIn(OnBroker):
    """Configuration of an MQTT topic as a source of readings.

    Parameters
    ----------
    topic, host, port
        As for `OnBroker`.
    names : dict of str to str
        Channel by the name in the message, for names that differ.
    virtual : bool
        The publisher is a virtual machine, which may run faster than real time (`Config.speed`).
    repeats : {'watch', 'exception'}
        'exception': only changes are published, and `counter` shows that unchanged values are still measured.
    counter : str
        Name in the messages of a number that changes with each one, or with each heartbeat.
    """

    kind: Literal["mqtt"]
    names: Names = field(default_factory=dict)
    virtual: bool = False
    repeats: Literal["watch", "exception"] = "watch"
    counter: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        if bool(self.counter) != (self.repeats == "exception"):
            raise SettingError(
                f'repeats = "{self.repeats}", counter = {self.counter!r}: a source that publishes changes only '
                '(repeats = "exception") needs the name of a counter, and no other source has one'
            )
        if twice := [name for name, count in Counter(self.names.values()).items() if count > 1]:
            raise SettingError(
                f"names: several entries name the channel {', '.join(sorted(twice))}: keep one entry for each channel"
            )

    def open(self, folder: Path, speed: float) -> Source:  # noqa: ARG002 - part of the interface
        """Create the source; it connects later."""
        from thermocomp.live.adapters.mqtt import MqttSource

        of = {"topic": self.topic, "host": self.host, "counter": self.names.get(self.counter, self.counter)}
        return MqttSource(**of, port=self.port, names=dict(self.names))


@dataclass(frozen=True, kw_only=True)
class MqttProbing(OnBroker):
    """Configuration of an MQTT topic as a source of measurements of the tool point.

    Parameters
    ----------
    topic, host, port
        As for `OnBroker`.
    """

    kind: Literal["mqtt"]


@dataclass(frozen=True, kw_only=True)
class MqttOut(OnBroker):
    """Configuration of an MQTT topic as a sink.

    Parameters
    ----------
    topic, host, port
        As for `OnBroker`.
    confirm_topic : str
        Topic on which the controller reports the corrections in force, in the form of the published message; empty: it
        does not.
    """

    published: ClassVar[bool] = True
    kind: Literal["mqtt"]
    confirm_topic: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.confirm_topic:
            if why := explain_topic(self.confirm_topic, published=True):
                raise SettingError(f"confirm_topic = {self.confirm_topic[:200]!r}: {why}")
            if self.confirm_topic in (self.topic, f"{self.topic}/status"):
                raise SettingError(f"confirm_topic = {self.confirm_topic[:200]!r}: the service publishes to this topic")

    def open(self, folder: Path) -> Sink:  # noqa: ARG002 - part of the interface
        """Create the sink; it connects later."""
        from thermocomp.live.adapters.mqtt import ConfirmedMqttSink, MqttSink

        if not self.confirm_topic:
            return MqttSink(topic=self.topic, host=self.host, port=self.port)
        return ConfirmedMqttSink(topic=self.topic, host=self.host, port=self.port, confirm_topic=self.confirm_topic)


def explain_topic(topic: str, *, published: bool) -> str:
    """Return the reason why a topic is invalid; empty if it is valid."""
    return next(_faults_of_topic(topic, published=published), "")


def explain_host_name(host: str) -> str:
    """Return the reason why a host is invalid; empty if it is valid: an address or a name."""
    try:
        ip_address(host)
    except ValueError:
        return next(_faults_of_name(host), "")
    return ""


def _faults_of_topic(topic: str, *, published: bool) -> Iterator[str]:
    levels = topic.split("/")
    if not topic.strip():
        yield "name a topic, such as 'machine/7/temperatures'"
    if len(topic.encode()) > _TOPIC:
        yield f"longer than {_TOPIC:,} bytes"
    if published and set(topic) & set("+#"):
        yield "a topic to which the service publishes must not contain wildcards (+, #)"
    if published and topic.startswith("$"):
        yield "topics that begin with $ are reserved for the broker"
    if levels[0] == "$share":
        if len(levels) < 3 or not levels[1] or set(levels[1]) & set("+#") or not any(levels[2:]):
            yield "expected '$share/GROUP/TOPIC', with no wildcards in the group"
        levels = levels[2:]
    for level in levels:
        if len(level) > 1 and set(level) & set("+#"):
            yield f"a wildcard must be a whole level: {level!r} contains more; write it like 'machine/+/spindle'"
    if "#" in levels[:-1]:
        yield "the wildcard # covers all further levels: put it at the end, such as 'machine/#'"


def _faults_of_name(host: str) -> Iterator[str]:
    if not host.strip():
        yield "name a host, such as '127.0.0.1'"
    if "/" in host:
        yield "expected only the host, such as 'mill7' or '192.0.2.7'"
    if ":" in host:
        yield "expected only the host; give its port as port = ..."
    if host.replace(".", "").isdigit():
        yield "expected an address of four numbers from 0 to 255"
    try:
        labels = host.removesuffix(".").encode("idna").decode("ascii").split(".")
    except UnicodeError:
        labels = [""]
    if len(".".join(labels)) > _HOST or not all(0 < len(label) <= _LABEL for label in labels):
        yield "expected names of 1 to 63 characters, separated by dots"
    if not all(c.isalnum() or c in "-_" for label in labels for c in label):
        yield "a host name has letters, digits, '-' and '.' alone"
