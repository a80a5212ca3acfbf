"""Suggested mappings: the settings needed for reading or cleaning a file, filled in."""

import copy
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import tomlkit
from tomlkit.items import Table

from thermocomp.core.exceptions import InputError, RecordingError, Remedy, TwoReadingsError, UnitError
from thermocomp.core.messages import Message
from thermocomp.files.draft import write_text
from thermocomp.files.plaintext import read_text
from thermocomp.files.tomlfile import MOST
from thermocomp.recordings.checks.findings import Finding, cut
from thermocomp.recordings.checks.quality import check
from thermocomp.recordings.checks.timeunits import confirm
from thermocomp.recordings.readers.datecheck import holds_date, holds_own_date
from thermocomp.recordings.readers.guesses import guess_columns, understand_or_none
from thermocomp.recordings.readers.mapping import ADAPTER, ColumnMap, Mapping, check_content, read_mapping
from thermocomp.recordings.readers.opening import open_table
from thermocomp.recordings.readers.recordings import read
from thermocomp.recordings.recording import Recording

#: maximum number of questions on one file, mostly about individual rows to be skipped
MOST_QUESTIONS = 60
#: maximum number of rows skipped automatically: a file with more such rows is of another kind
MOST_SKIPPED = 5
#: maximum number of checks: correction of a unit may reveal further problems
_ROUNDS = 5
#: a table heading directly below a line that is not a comment
_TIGHT, _APART = re.compile(r"^([^#\n].*)\n(?=\[)", re.MULTILINE), r"\1\n\n"
#: maximum size of a file for which an error suggests a mapping [byte]: the file is read again for this
_LARGE = 50_000_000


_T = TypeVar("_T")


@dataclass(frozen=True)
class Question:
    """Decision to be made by the user.

    Parameters
    ----------
    text : str
        Finding.
    options : tuple of Remedy
        Possible parts of a mapping, most likely first.
    severity : {'error', 'column', 'trouble', 'warning', 'info'}
        Subject: the file cannot be read, a column is left out, or a finding of `check`.
    may_guess : bool
        False: the duration of the recording depends on the answer.
    """

    text: str
    options: tuple[Remedy, ...]
    severity: str
    may_guess: bool = True

    @property
    def others(self) -> tuple[str, ...]:
        """Other possible interpretations of an ambiguous file, one per line."""
        return tuple(to_toml(r).replace("\n", " ") for r in self.options[1:]) if self.severity == "error" else ()


#: decision: one of the options, or None for no change
Decide = Callable[[Question], Remedy | None]


def take_best(question: Question) -> Remedy | None:
    """Return the most likely option; None for warnings and infos, and where only the user can decide.

    The user decides on steps that shift, offset or exchange values, on times with several likely interpretations, and
    on units of time that are stated but implausible.
    """
    if not question.may_guess:
        return None
    best = question.options[0]
    moves = any(step["do"] in ("shift", "rezero", "swap") for step in best.get("clean", ()))
    return None if moves or question.severity in ("warning", "info") else best


class Draft:
    """A mapping that is being written.

    Parameters
    ----------
    text : str
        Initial TOML; its comments are kept.
    """

    def __init__(self, text: str = "") -> None:
        self.document = tomlkit.parse(text)
        #: names of the tables by column: a file may have thousands
        self._columns: dict[object, str] = {}
        tables = self.document.get("columns")
        for name, table in [*tables.items()][::-1] if isinstance(tables, dict) else ():
            place = table.get("column", name) if isinstance(table, dict) else name
            if isinstance(place, str | int):  # other places are refused when the mapping is read
                self._columns[place] = str(name)

    @property
    def text(self) -> str:
        """The mapping as TOML text."""
        written = tomlkit.dumps(self.document).strip()
        return f"{re.sub(_TIGHT, _APART, written)}\n" if written else ""

    def mapping(self, owner: str) -> Mapping:
        """Return the mapping that the draft defines."""
        return check_content(self.document.unwrap(), owner)

    def add(self, remedy: Remedy) -> bool:
        """Add a suggested entry to the mapping; return False if it is already there."""
        changed = False
        for key, content in remedy.items():
            changed |= key not in self.document
            if key == "clean":
                steps = self.document.setdefault(key, tomlkit.aot())
                for step in content:
                    if step not in steps.unwrap():
                        steps.append(_table(step))
                        changed = True
            elif key == "columns":
                tables = self.document.setdefault(key, tomlkit.table(is_super_table=True))
                for name, said in content.items():
                    named = self._named(name, said)
                    changed |= named not in tables
                    changed |= _update(table := tables.setdefault(named, tomlkit.table()), said)
                    self._columns[table.get("column", named)] = named
            else:
                changed |= _update(self.document.setdefault(key, tomlkit.table()), content)
        return changed

    def _named(self, name: str, said: Remedy) -> str:
        """Return the name of the existing table for a column, or the suggested name."""
        return self._columns.get(said.get("column", name), name)


@dataclass(frozen=True)
class Mended:
    """A completed mapping, and the recording that results from it.

    Parameters
    ----------
    text : str
        TOML of the mapping.
    """

    text: str
    recording: Recording
    decided: tuple[tuple[Question, Remedy | None], ...]

    def save(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Write the mapping to a TOML file and return its path."""
        return write_text(self.text, path, overwrite=overwrite)


def read_draft(mapping: str | Path | None) -> str:
    """Return the text of the mapping file to start from, after validation; empty if there is none."""
    if mapping is None:
        return ""
    read_mapping(mapping)  # raises an error if it is invalid
    return read_text(Path(mapping), "mapping file", MOST)


def mend(path: str | Path, text: str, decide: Decide, say: Callable[[str], str] = str) -> Mended:
    """Create a mapping with which a file can be read, and which repairs its data-quality problems.

    Parameters
    ----------
    path : str or Path
        Path of the file.
    text : str
        TOML of the mapping to start from.
    decide : callable
        Chooses an option of each question.
    say : callable
        Returns a finding in the language of the user: the reason in the mapping why a column is ignored.
    """
    owner = str(path)
    dialogue = _Dialogue(Draft(text), decide, path, say)
    table = dialogue.until(lambda: open_table(path, dialogue.draft.mapping(owner)))[0]
    mapping = dialogue.draft.mapping(owner)
    if not mapping.read.only_mapped:
        for shown, options in guess_columns(table, mapping):
            dialogue.ask(Question(f"column {shown}", tuple(options), "column"))
    recording = dialogue.until(lambda: read(path, dialogue.draft.mapping(owner)))
    for _ in range(_ROUNDS):
        before, mapping = dialogue.draft.text, dialogue.draft.mapping(owner)
        for f in check(recording):
            if f.remedy is not None:
                way = located(f, recording, mapping, table.headings)
                dialogue.ask_finding(f, way, recording.time_unit)
        if dialogue.draft.text == before:
            break
        recording = dialogue.until(lambda: read(path, dialogue.draft.mapping(owner)))
    # what only the user knows, such as the sensitivity of a probe
    open_ = [f"# {q.text}\n" for q, _ in dialogue.decided if q.severity == "column" and len(q.options) == 1]
    return Mended(dialogue.draft.text + "".join(open_), recording, tuple(dialogue.decided))


def read_or_offer(path: str | Path, mapping: Mapping | None = None) -> Recording:
    """Read one test from a file; on an error, a note on the exception suggests a filled-in mapping."""
    try:
        return read(path, mapping)
    except (RecordingError, UnitError) as e:
        if offered := _offer(Path(path), mapping or Mapping(), e):
            e.add_note(offered)
        raise


def located(finding: Finding, recording: Recording, mapping: Mapping, headings: Sequence[str]) -> Remedy:
    """Return the correction for a finding, as an entry of the mapping of its file."""
    remedy: dict[str, Any] = copy.deepcopy(dict(finding.remedy or {}))
    for step in remedy.get("clean", ()):
        if "times" in step:
            step["times"] = [
                [v + recording.origin for v in t] if isinstance(t, list) else t + recording.origin
                for t in step["times"]
            ]
        if "at" in step:
            step["at"] += recording.origin
    for name, said in list(remedy.get("columns", {}).items()):
        heading = next((h for h in headings if recording.aliases.get(h, h) == name), name)
        if "missing" in said and finding.rows is not None and not _holds_as_it_is(mapping.columns.get(name), heading):
            del remedy["columns"][name]  # the number in the file differs, but its rows are known
            remedy |= cut(name, finding.rows, recording.time + recording.origin, finding.kind)
        elif name not in mapping.columns and heading != name:
            said["column"] = heading
    return remedy


def to_toml(remedy: Remedy) -> str:
    """Return a suggested mapping entry as TOML text."""
    draft = Draft()
    draft.add(remedy)
    return draft.text.strip()


def _holds_as_it_is(rule: ColumnMap | None, heading: str) -> bool:
    """Return whether the numbers of a column equal the values of its channel."""
    rule, meaning = rule or ColumnMap(), understand_or_none(heading)
    unit = rule.conversion or (meaning.unit if meaning is not None else None)
    return unit is not None and (rule.scale, rule.zero, unit.scale, unit.shift) == (1.0, 0.0, 1.0, 0.0)


class _Dialogue:
    """A mapping that is created from questions and answers.

    Parameters
    ----------
    path : str or Path
        Path of the file.
    say : callable
        See `mend`.
    """

    def __init__(self, draft: Draft, decide: Decide, path: str | Path, say: Callable[[str], str] = str) -> None:
        self.draft = draft
        self.decide = decide
        self.path = path
        self.say = say
        self.first: RecordingError | UnitError | None = None  #: first error for which a row would be skipped
        self.decided: list[tuple[Question, Remedy | None]] = []

    def ask(self, question: Question) -> bool:
        """Ask a question, each only once, and add the answer to the mapping; return whether it has new entries."""
        if any(q.text == question.text and q.options == question.options for q, _ in self.decided):
            return False
        answer = self.decide(question)
        self.decided.append((question, answer))
        return answer is not None and self.draft.add(_explained(answer, self.say(question.text)))

    def ask_finding(self, finding: Finding, way: Remedy, unit: str) -> None:
        """Have a finding decided; a unit of time that is stated in the file is replaced or confirmed by the user only.

        Parameters
        ----------
        unit : str
            Unit that the file states for its times.
        """
        timed = "unit" in way.get("time", {})
        text = (
            Message("{channel} {text}", channel=finding.channel, text=finding.text) if finding.channel else finding.text
        )
        options = (way, confirm(unit)) if timed and way != confirm(unit) else (way,)
        self.ask(Question(text, options, finding.severity, may_guess=not timed))
        if timed and finding.severity == "trouble" and not self.draft.document.get("time", {}).get("unit"):
            raise TwoReadingsError(f"{self.path}: {text}", options)

    def _skipped(self) -> int:
        return sum(1 for _, answer in self.decided if answer is not None and _skips(answer))

    def _skips_date(self, error: InputError) -> bool:
        """Return whether the most likely remedy skips a row that contains the date of the following rows."""
        if not _skips(error.remedies[0]):
            return False
        try:
            table, _ = open_table(self.path, self.draft.mapping(str(self.path)))
        except InputError:  # a row with too many or too few cells, which the message contains
            return holds_date(str(error).removeprefix(str(self.path)))
        return holds_own_date(table, error.remedies[0]["read"]["skip"][-1])

    def until(self, action: Callable[[], _T]) -> _T:
        """Repeat an action until it succeeds; after each error, ask which of the suggested mapping entries to add."""
        for _ in range(MOST_QUESTIONS):
            try:
                return action()
            except (RecordingError, UnitError) as e:
                if not e.remedies:
                    raise
                if _skips(e.remedies[0]):
                    self.first = self.first or e
                    if self._skipped() >= MOST_SKIPPED:
                        raise self.first from None  # same error as without a mapping
                may_guess = not (isinstance(e, TwoReadingsError) or self._skips_date(e))
                if not self.ask(Question(str(e), e.remedies, "error", may_guess)):
                    raise
        return action()


def _explained(remedy: Remedy, reason: str) -> Remedy:
    """Return an entry of a mapping in which a column that is ignored has a reason."""
    columns = {
        name: {**said, "reason": reason} if said.get("role") == "ignore" else said
        for name, said in remedy.get("columns", {}).items()
    }
    return {**remedy, "columns": columns} if columns else remedy


def _skips(remedy: Remedy) -> bool:
    """Return whether a suggested mapping entry skips a row of the file; ranges of rows are other tests."""
    return any(isinstance(place, int) for place in remedy.get("read", {}).get("skip", ()))


def _offer(path: Path, mapping: Mapping, error: InputError) -> str:
    """Return text that suggests a mapping with which a file can be read; empty if there is none."""
    if not error.remedies or path.stat().st_size > _LARGE:
        return ""
    begun = tomlkit.dumps(ADAPTER.dump_python(mapping, mode="json", exclude_defaults=True))
    dialogue, name = _Dialogue(Draft(begun), take_best, path), _file_name(path)
    try:
        dialogue.until(lambda: read(path, dialogue.draft.mapping(str(path))))
        how = "this mapping reads it; check it"
    except InputError as e:
        if not dialogue.decided or any(map(_skips, e.remedies[:1])):
            return ""
        if isinstance(e, TwoReadingsError):
            return _offer_choice(dialogue.draft.text, e.remedies, name)
        how = f"this mapping resolves part of the problem ({str(e).removeprefix(f'{path}: ')}); complete it"
    other = "".join(f"\n# or: {way}" for q, _ in dialogue.decided for way in q.others)
    return f"{how}, save it as {name} and give it with --mapping {name}:\n\n{dialogue.draft.text.strip()}{other}"


def _offer_choice(text: str, remedies: Sequence[Remedy], name: str) -> str:
    """Return the message that lists the suggested mappings between which the user must choose."""
    ways = "\n# or:\n".join(re.sub(r"^", "# ", to_toml(way), flags=re.MULTILINE) for way in remedies)
    return f"choose one, save it as {name} without the # and give it with --mapping {name}:\n\n{text}{ways}"


def _file_name(path: Path) -> str:
    """Return a name of a mapping file that needs no quoting in a shell."""
    return f"{re.sub(r'[^A-Za-z0-9_.-]+', '_', path.stem).lstrip('-.') or 'recording'}.toml"


def _table(content: Remedy) -> Table:
    table = tomlkit.table()
    _update(table, content)
    return table


def _update(table: Any, content: Remedy) -> bool:
    """Add entries to a table; return whether it has changed."""
    before = table.unwrap()
    for key, value in content.items():
        if isinstance(value, list) and key in ("skip", "missing") and key in table:
            table[key] = [*table[key], *(v for v in value if v not in table[key])]
        else:
            table[key] = value
    return bool(before != table.unwrap())
