"""Unified diff generated while a program is revised: corresponding lines are known, so no search is needed."""

from collections import deque
from collections.abc import Iterable, Iterator

#: number of unchanged lines around a change
CONTEXT = 3
#: maximum number of lines of a hunk in memory: a longer one is divided into parts without context
LONGEST = 4000


def unified(pairs: Iterable[tuple[str, tuple[str, ...]]], name: str, revised: str) -> Iterator[str]:
    """Yield the lines of a unified diff."""
    head = [f"--- {name}\n", f"+++ {revised}\n"]
    waiting: deque[tuple[str, str]] = deque(maxlen=CONTEXT)  # unchanged lines that may precede a hunk
    hunk: list[tuple[str, str]] = []
    quiet = 0
    old = new = 0  # number of lines processed
    first = (0, 0)
    for text, texts in pairs:
        changed = texts != ((text,) if text else ())
        if changed and not hunk:
            first = (old - len(waiting), new - len(waiting))
            hunk = list(waiting)
        old += bool(text)
        new += len(texts)
        if changed:
            hunk += ([("-", text)] if text else []) + [("+", t) for t in texts]
            quiet = 0
            waiting.clear()
            if len(hunk) > LONGEST:
                # without trailing context, omit the leading context: patch would search for it at the end of the file
                before_change = next(k for k, (mark, _) in enumerate(hunk) if mark != " ")
                first = (first[0] + before_change, first[1] + before_change)
                yield from _hunk(head, hunk[before_change:], first)
                hunk = []
            continue
        if hunk:
            hunk.append((" ", text))
            quiet += 1
            if quiet > 2 * CONTEXT:
                yield from _hunk(head, hunk[: len(hunk) - CONTEXT - 1], first)
                waiting.extend(hunk[-CONTEXT:])
                hunk = []
        else:
            waiting.append((" ", text))
    if hunk:
        yield from _hunk(head, hunk[: len(hunk) - max(0, quiet - CONTEXT)], first)


def _hunk(head: list[str], lines: list[tuple[str, str]], first: tuple[int, int]) -> Iterator[str]:
    yield from head
    head.clear()
    old = sum(mark != "+" for mark, _ in lines)
    new = sum(mark != "-" for mark, _ in lines)
    yield f"@@ -{_range(first[0], old)} +{_range(first[1], new)} @@\n"
    for mark, text in lines:
        body = text.rstrip("\r\n")
        yield mark + (text if body != text else f"{text}\n\\ No newline at end of file\n")


def _range(seen: int, length: int) -> str:
    start = seen + 1 if length else seen
    return f"{start},{length}" if length != 1 else str(start)
