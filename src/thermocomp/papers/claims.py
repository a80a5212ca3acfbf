"""Claims of a paper as data: entries of ``claims.toml`` next to a study, filled in and judged with its results.

The file has a table per section, usually the name of the module with the results, and in it an entry per claim, in
order of presentation:

``ids``, ``text``, ``paper``
    See `thermocomp.papers.study.Claim`; several ids separated by spaces.
``ours``
    Our result.
``holds``
    Criterion: the name of a Boolean value, or two names and a comparison between them, such as ``"error <= LIMIT"``.
    Default: ``holds`` among the facts of the entry; if there is none, the claim is a number for information.
``softer``, ``whole``
    Why the criterion is softer than the paper's sentence or number: such a claim holds in part. If the second
    criterion, that of the paper, is also fulfilled, it holds.
``reading``
    How a word of the paper that has no number is read, such as ``"'close' as less than 5 %"``: such a claim holds in
    part at best.
``premise``, ``untestable``
    Criterion that the virtual machine has to fulfil for the claim to be testable, and the reason if it does not.
``note``, ``otherwise``
    Limitation, and the reason shown only if the claim does not hold.
``parts``
    Parts of the sentences, by name; see `thermocomp.papers.sentences.Sentences`. Those of a section ``parts`` are
    available to all entries.
``each``
    Repeats the entry for each of several values, available in its sentences as ``{each}``.

All texts are templates of `str.format`. A name in capitals is a constant of the module; any other name is a fact of the
entry or, if there is none, an attribute of the results.
"""

from collections.abc import Callable, Mapping
from types import ModuleType
from typing import Any, Generic, TypeVar

from thermocomp.papers.sentences import TextFile
from thermocomp.papers.study import Claim

# named values that the sentences of a claim need beside the attributes of the results
Facts = dict[str, Any]
#: type of the results by which claims are judged
_Found = TypeVar("_Found")


class Claims(Generic[_Found]):
    """Claims of one section, each judged by the results of a study.

    Parameters
    ----------
    module : str
        Name of the module that defines the constants; ``claims.toml`` is in its package.
    *others : module
        Modules with further constants.
    section : str
        Section of the file. Default: the last part of the name of the module.
    """

    def __init__(self, module: str, *others: ModuleType, section: str = "") -> None:
        self._file = TextFile("claims.toml", module, *others)
        self._entries: dict[str, dict[str, Any]] = self._file.content[section or module.rpartition(".")[2]]
        self._facts: dict[str, Callable[..., Facts]] = {}

    def facts(self, function: Callable[..., Facts]) -> Callable[..., Facts]:
        """Use a function of the results (and of `each`) for the facts of the entry of its name (decorator)."""
        key = function.__name__.strip("_")
        if key not in self._entries:
            raise KeyError(f"no claim is named {key}")
        self._facts[key] = function
        return function

    def __call__(self, found: _Found) -> tuple[Claim, ...]:
        """Return all claims, judged by the results."""
        return tuple(claim for key in self._entries for claim in self.judged(key, found))

    def judged(self, key: str, found: _Found) -> list[Claim]:
        """Return the claims of one entry of the file, judged by the results."""
        entry = self._entries[key]
        function = self._facts.get(key)
        claims = []
        for each in entry.get("each", [None]):
            given = () if each is None else (each,)
            facts = {"each": each} | (function(found, *given) if function else {})
            claims.append(self._claim(entry, facts, found))
        return claims

    def _claim(self, entry: Mapping[str, Any], facts: Facts, found: _Found) -> Claim:
        said = self._file.sentences(facts, found, entry.get("parts"))
        criterion = entry.get("holds", "holds" if "holds" in facts else "")
        testable = "premise" not in entry or said.judge(entry["premise"]) is not False
        holds = said.judge(criterion) if criterion and testable else None
        softer = bool(holds) and "softer" in entry and not (entry.get("whole") and said.judge(entry["whole"]))
        reasons = (
            f"The paper gives no number: we read {entry['reading']}." if "reading" in entry else "",
            entry["softer"] if softer else "",
            "" if testable else entry["untestable"],
            entry.get("note", ""),
            entry.get("otherwise", "") if holds is False else "",
        )
        return Claim(
            ids=tuple(entry["ids"].split()),
            text=said.fill(entry["text"]),
            paper=said.fill(entry.get("paper", "")),
            ours=said.fill(entry["ours"]),
            holds=holds,
            finding=" ".join(filter(None, map(said.fill, reasons))),
            softer=softer or (bool(holds) and "reading" in entry),
            testable=testable,
        )
