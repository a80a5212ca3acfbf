"""Limits on LinuxCNC's interpreter: no file outside the folders of the job, and no endless loops.

Part of the script `_rs274_child.py`: standard library only.
"""

import os
import re
import time
from collections import Counter
from collections.abc import Callable, Iterable

#: limits on the number of lines read, beyond those of the program: without motion of an axis, and in total. A line
#: takes 5 to 15 us, so either limit is reached within seconds
MOST_IDLE = 300_000
MOST = 1_200_000
#: processor time without a move [s], checked every `LOOK` lines once more lines have been read than the program
#: has: a line that changes the tool or calls a file takes much longer
MOST_SECONDS = 5.0
LOOK = 1024
#: limits on moves, dwells and the like: per line (a cycle may have many repeats); in total, beyond `CALLS` per line
MOST_OF_LINE = 100_000
MOST_CALLS = 5_000_000
CALLS = 20
#: processor time after which a program without output is refused [s]
MOST_SILENT = 20.0
#: number of lines then recorded to find the loop; fewer if lines are slow
WATCHED = 20_000
WATCHED_SLOW = 4_000
LOOP = re.compile(r"(?i)^[\s/N0-9.]*O.*[\]>0-9\s](WHILE|DO|REPEAT)\b")


class RefusedError(Exception):
    """Operation of the program that is not permitted: line and reason."""


class ProgramReading:
    """Limits on the lines and files read by a program.

    Parameters
    ----------
    home : str
        Folder of the runs: all files in it may be read and written.
    folders : iterable of str
        Folders of the program and of its subprograms: files in them may be read.
    lines : int
        Number of lines of the program.
    where : callable
        Returns the line being executed, and whether it belongs to the program itself.
    """

    def __init__(
        self, program: str, home: str, folders: Iterable[str], lines: int, where: Callable[[], tuple[int, bool]]
    ) -> None:
        self.program = program
        self.home = os.path.realpath(home)
        self.folders = [os.path.realpath(folder) for folder in folders]
        self.where = where
        self.idle, self.most = lines + MOST_IDLE, lines + MOST
        self.lines = self.moved = 0  # lines read, in total and at the last axis motion
        self.own = lines + LOOK
        self.looked, self.since, self.late = 0, time.process_time(), False  # line and time of last check after a move
        self.acted = self.calls = self.before = 0  # lines and calls before the latest acting line; total calls
        self.most_calls = CALLS * lines + MOST_CALLS
        self.watched: list[tuple[int, bool]] = []
        self.told, self.last = 0, 0.0  # number of records at the last check, and when it last changed [s]

    def check_file(self, name: bytes, *, write: bool) -> None:
        """Refuse a pipe, a device, or a file outside the folders, resolving links and ``..``."""
        path = os.path.realpath(os.fsdecode(name))
        if os.path.exists(path) and not (os.path.isfile(path) or os.path.isdir(path)):  # noqa: PTH110, PTH112, PTH113
            raise RefusedError(
                self.where()[0], f"{path} is a pipe or a device, which may have no end; replace it with a regular file"
            )
        folders = [self.home] if write else [self.home, *self.folders]
        if any(os.path.commonpath((path, folder)) == folder for folder in folders) or not os.path.exists(path):  # noqa: PTH110
            return
        raise RefusedError(
            self.where()[0],
            f"the program would write {path}, which is outside its own folder; write to a file in that folder"
            if write
            else f"the program would read {path}, which is outside its own folder and the --subroutines folders; copy "
            "the file into one of them, or add its folder with --subroutines and call it by file name only",
        )

    def count_line(self) -> None:
        """Count a line read; refuse a program with an endless loop."""
        self.lines += 1
        if not self.lines % LOOK:
            self.look_at_time()
        idle = self.lines >= self.moved + self.idle
        late = self.late and self.lines > self.moved + self.own
        if not (idle or late) and self.lines < self.most:
            return
        self.watched.append(self.where())
        if len(self.watched) < (WATCHED_SLOW if late else WATCHED):
            return
        count = f"{MOST_IDLE:,} lines" if idle else f"{MOST_SECONDS:g} s of processor time"
        what = f"{count} without a move of an axis" if idle or late else f"more than {MOST:,} lines"
        raise RefusedError(
            self.find_loop(),
            f"this loop has run {what}: it seems to have no end; write a condition that becomes false, or reduce the "
            "number of passes per program",
        )

    def look_at_time(self) -> None:
        """Note whether too much processor time has passed without motion of an axis."""
        now = time.process_time()
        if self.moved > self.looked:
            self.since = now
        self.looked = self.lines
        self.late = now - self.since > MOST_SECONDS

    def count_call(self, *, moved: bool) -> str | None:
        """Count an action of a line, and note axis motion; return the reason for refusal if there are too many."""
        if moved:
            self.moved = self.lines
        if self.acted != self.lines:
            self.acted, self.before = self.lines, self.calls
        self.calls += 1
        if self.calls - self.before > MOST_OF_LINE:
            return f"this line makes more than {MOST_OF_LINE:,} moves: write fewer repeats (L) or larger pecks (Q)"
        if self.calls > self.most_calls:
            return f"more than {self.most_calls:,} moves have been made up to here: divide the program"
        return None

    def check_output(self, told: int) -> str | None:
        """Return the reason for refusal if the number of records has not changed for too long."""
        now = time.process_time()
        if told != self.told:
            self.told, self.last = told, now
        elif now - self.last > MOST_SILENT:
            return f"it has run for {MOST_SILENT:.0f} s without output: check the program for an endless loop"
        return None

    def find_loop(self) -> int:
        """Return the first line of the outermost loop that contains the recorded lines."""
        # the recorded line was read last; the next one is being read
        passes = Counter(line + 1 for line, own in self.watched if own)
        if not passes:
            return min(line for line, _ in self.watched) + 1
        with open(self.program, encoding="latin-1") as file:  # noqa: PTH123
            heads = {n for n, text in enumerate(file, 1) if n in passes and LOOP.search(text)}
        again = [line for line in heads if passes[line] > 1]
        return min(again, key=lambda line: (passes[line], line), default=min(passes))
