"""``python -m thermocomp``: the command line."""

from thermocomp.cli.app import main

main()
