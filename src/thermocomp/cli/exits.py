"""Exit codes and standard input, shared by all commands."""

from pathlib import Path

#: exit code of an internal error of the program
FAULT = 3
#: exit code of work interrupted from the keyboard, as in shells
STOPPED = 130
#: denotes standard input, which is ``-`` on the command line: cyclopts reads that as an option
STDIN = Path("<stdin>")
