"""What all commands have in common with a shell."""

from pathlib import Path

#: exit code of a fault of the program itself
FAULT = 3
#: exit code of work that was stopped by the keyboard, as shells have it
STOPPED = 130
#: stands for standard input, which is ``-`` on the command line: cyclopts takes that for an option
STDIN = Path("<stdin>")
