"""Models of every method, with and without a spindle speed, and what the documentation says of where they go."""

import re
from dataclasses import dataclass, field, replace
from pathlib import Path

from smallmachine import small_machine
from spoiling import models_of

from thermocomp.core.model import ErrorModel
from thermocomp.files import modelfile
from thermocomp.recordings.readers import recordings
from thermocomp.recordings.recording import Recording

PAGE = Path(__file__).resolve().parents[2] / "docs" / "export.rst"
WHOLE = ("c99", "linuxcnc", "st", "st-twincat", "st-scl", "siemens", "beckhoff", "onnx")
REDUCED = ("klipper", "heidenhain", "fanuc", "haas", "okuma")


def without_speed(recording: Recording) -> Recording:
    """Return a recording in which nobody wrote the spindle speed down."""
    (speed,) = (c for c in recording.channels if c.quantity == "spindle_speed")
    channels = tuple(c for c in recording.channels if c != speed)
    return replace(recording, table=recording.table.drop(columns=speed.name), channels=channels)


@dataclass
class Fitted:
    """Model files, each made once.

    Parameters
    ----------
    folder : Path
    """

    folder: Path
    _known: dict[tuple[str, bool], ErrorModel] = field(default_factory=dict)

    def recording(self, *, speed: bool) -> Path:
        """Return the file of a recording."""
        path = self.folder / f"drift-{speed}.csv"
        if not path.exists():
            recordings.write(small_machine() if speed else without_speed(small_machine()), path)
        return path

    def model(self, method: str, *, speed: bool, watched: bool) -> Path:
        """Return the file of a model."""
        path = self.folder / f"{method}-{speed}-{watched}.json"
        if not path.exists():
            if (method, speed) not in self._known:
                recording = small_machine() if speed else without_speed(small_machine())
                (self._known[method, speed],) = models_of(recording, ["z_um"], method)
            model = self._known[method, speed]
            assert model.watch is not None
            modelfile.write([model if watched else replace(model, watch=None)], path)
        return path


def section() -> str:
    """Return what the documentation says of what goes where."""
    text = PAGE.read_text(encoding="utf-8")
    return text.partition("Models and targets\n")[2].partition("\nAs C\n")[0]


def documented() -> dict[str, tuple[str, str, str]]:
    """Return by method: without a speed, to a target that holds the whole model, to one that holds less."""
    found: dict[str, tuple[str, str, str]] = {}
    for names, alone, whole, less in re.findall(r"^(``.*``)\s+(yes|no)\s+(whole|no)\s+(reduced|no)$", section(), re.M):
        found |= dict.fromkeys(re.findall(r"``(.+?)``", names), (alone, whole, less))
    return found


def refusals() -> list[str]:
    """Return the messages of refusals that are documented."""
    return re.findall(r"^``(.+?)``", section().partition("\nmessage ")[2], re.M)
