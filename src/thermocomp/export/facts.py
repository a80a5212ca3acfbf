"""Summary of an exported compensator: verdict, contents and origin."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from thermocomp.core.model import ErrorModel
from thermocomp.runtime.compensator import Compensator


@dataclass(frozen=True)
class Facts:
    """Origin of an export: model file, version and date.

    Parameters
    ----------
    source : str
        Model file.
    sha256 : str
        SHA-256 of that file.
    version : str
        thermocomp version that exports.
    date : str
        Date of the export.
    left_out : mapping of str to str
        Targets of the model file that were not exported, with the reason.
    """

    source: str
    sha256: str
    version: str
    date: str
    left_out: Mapping[str, str] = field(default_factory=dict)

    def origin(self) -> list[str]:
        """Return lines of text about the origin of the export: model file, version, date."""
        return [
            f"Model: {self.source}, SHA-256 {self.sha256}",
            f"Written by thermocomp {self.version} on {self.date}; do not edit, export again instead",
            *(f"Left out: {target}: {why}" for target, why in self.left_out.items()),
        ]

    def lines(self, compensator: Compensator) -> list[str]:
        """Return the summary of an export as lines of text, with the verdict first."""
        found, limits = [_verdict(compensator)], compensator.limits
        found += [f"{target}: {status.reason}" for target, status in compensator.shadow.items()]
        taken = {m.honest_error.taken for m in compensator.models if m.honest_error and m.honest_error.taken}
        found += [f"unproven, approved by {who}" for who in sorted(taken)]
        return [
            *found,
            *self.origin(),
            f"Limits: {limits.in_words()}; readings older than {limits.reading_age:g} s are not used; without readings "
            f"a correction is held for {limits.hold:g} s, then decays to zero with a time constant of {limits.fade:g} "
            "s",
            "Sign: a correction [um] is added to the commanded position by the controller; it is minus the deviation, "
            "which is actual minus commanded position",
            "Units: temperatures in degC, spindle speed in 1/min, positions in mm, time in s",
        ]


def _verdict(compensator: Compensator) -> str:
    shadow, lines = compensator.shadow, compensator.lines
    if len(shadow) == len(lines):
        return f"SHADOW ONLY, {', '.join(lines)}: not proven on unseen cycles; all corrections stay zero"
    said = dict[str, list[str]]()
    for target, line in lines.items():
        if target not in shadow:
            said.setdefault(tell_verdict(compensator.models[line.models]), []).append(target)
    words = [f"{', '.join(targets)}: {word}" for word, targets in said.items()]
    return "; ".join([*words, *([f"SHADOW ONLY, {', '.join(shadow)}: corrections stay zero"] if shadow else [])])


def tell_verdict(models: Sequence[ErrorModel]) -> str:
    """Return the verdict on models that run together, in words: that of the least certain one."""
    found = [m.honest_error for m in models if m.honest_error is not None]
    if any(h.taken for h in found):
        return "UNPROVEN, approved nevertheless"
    limited = any(h.word == "accepted for this duty" for h in found)
    return f"accepted on unseen cycles{', FOR THE DUTY OF ITS TRAINING ONLY' if limited else ''}"
