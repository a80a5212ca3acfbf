"""Lines of a text file and their cells."""

import csv
import re
from pathlib import Path


def split_line(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line."""
    if delimiter == " ":
        return re.split("[ \t]+", line.strip(" \t\r\n"))  # str.split takes more for white space than pandas
    try:
        return next(csv.reader([line.rstrip("\r\n")], delimiter=delimiter, skipinitialspace=True))
    except csv.Error:  # a cell is larger than the reader takes: no number and no name is
        return line.rstrip("\r\n").split(delimiter)


def count_cells(line: bytes, delimiter: str) -> int:
    """Return how many cells a line has."""
    if delimiter == " " or b'"' in line:
        return len(split_line(line.decode("latin-1"), delimiter))
    return line.count(delimiter.encode()) + 1


def explain_ragged(path: Path, number: int, cells: int, width: int, line: bytes, delimiter: str) -> str:
    """Say what is wrong with a line that is too short or too long, and what to do.

    Parameters
    ----------
    path : Path
    number : int
        Of the line, from 1.
    cells, width : int
        How many cells it has, and how many the headings have.
    line : bytes
    delimiter : str
    """
    start = line[:60].decode("latin-1").strip()
    text = f"{path}: line {number} has {cells} cells where the heading has {width}: {start!r}"
    if delimiter == "," and cells > width:
        return f"{text}; if it has decimal commas, export with ';' between the columns"
    if not line.endswith(b"\n"):
        return f"{text}; it is the last line, perhaps cut off while it was written: complete or delete it"
    return f"{text}; complete or delete the line"


def is_utf8(line: bytes) -> bool:
    """Return whether a line is written in UTF-8."""
    try:
        line.decode("utf-8")
    except UnicodeDecodeError:
        return False
    return True
