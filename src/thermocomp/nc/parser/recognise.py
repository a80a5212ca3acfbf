"""Recognition of the control from the first lines of a file; formats other than ISO 6983 are refused by name."""

import itertools
import re
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from thermocomp.core.exceptions import InputError

#: number of lines used to recognise the control of a program
FIRST = 200

_POST = "have the CAM system write the part for an ISO control (LinuxCNC or Fanuc)"
_GIVE = "give the NC program itself"


class _Kind(NamedTuple):
    name: str
    code: str  #: searched in the program text, with comments reduced to their brackets, and names of LinuxCNC to <>
    raw: str = r"\Z."  #: matched at the beginning of unmodified lines; the default never matches
    advice: str = _POST


# Patterns that no ISO program contains. The order matters: Gerber lines end with a star, as do Heidenhain ISO lines.
_KINDS = (
    _Kind(
        "Gerber (circuit boards)",
        code=r"^([GXYIJ][-0-9].*)?D0?[123]\*\s*$",
        raw=r"%(FS[LTD][AI]X|MO(MM|IN)\*|ADD[0-9]|LP[DC]\*|TF\.)",
        advice=_GIVE,
    ),
    _Kind("HPGL (plotters)", code=r"\Z.", raw=r"\s*(IN;|(PU|PD|PA|SP)[-0-9., ]*;)", advice=_GIVE),
    _Kind(
        "Heidenhain Klartext",
        code=r"\b(BEGIN|END|CALL) PGM\b|\bTOOL (CALL|DEF)\b|\bCYCL (DEF|CALL)\b|\bBLK FORM\b|\bCALL LBL\b|\bF ?MAX\b"
        r"|^\s*([0-9]+\s+)?(L|LN|C|CT|CR|CC|LP|CP|RND|CHF)\s+(I?[XYZABCUVW]|P[RA])[-+ 0-9Q]"
        r"|^\s*[0-9]+\s+(LBL|FN|STOP|M|L)\b",
    ),
    _Kind("Heidenhain DIN/ISO", code=r"^%.*\bG7[01]\s*\*|^N?[0-9]+\s.*\*\s*$|\bG7[01]\s*\*\s*$"),
    _Kind(
        "Okuma OSP",
        code=r"\bVC[0-9]+\s*=|\bV(ZOF|TOF|DOU|DIN|SIO|ATOL)[A-Z]?\[|\bCALL\s+O\S|\bMODOUT\b|\bMODIN\b|\bNOEX\b"
        r"|^\s*O[A-Z]{2,}[0-9]*\s*$|^(?!.*G4[34]).*\bG1[56]\s*H[0-9]",
        raw=r"\$\S+\.(MIN|SSB|SUB|LIB)%",
    ),
    _Kind(
        "Siemens Sinumerik (840D, 828D ...)",
        code=r"^\s*(N[0-9]+\s*)?(DEF\s+(REAL|INT|BOOL|CHAR|STRING|AXIS|FRAME|CHAN)\b|(EXTERN|PROC)\s+\w)"
        r"|\b(CYCLE|POCKET|SLOT|LONGHOLE|HOLES|MSG|WORKPIECE|TC|SETMS|GROUP_BEGIN)[0-9]*\(\)"
        r"|\b(R[0-9]+|[ABCFGHIJKMSTXYZ][0-9]*)\s*=(?!=)|=\s*(IC|AC|DC|ACP|ACN)\(\)"
        r"|\b(A?TRANS|A?ROT|A?SCALE|A?MIRROR)\b|\b(MCALL|SUPA|STOPRE|FFWON|FFWOF|BRISK|COMPOF|COMPON|COMPCAD|TRAORI)\b"
        r"|\b(TRAFOOF|DIAMON|DIAMOF|GOTOF|GOTOB|CFTCP|WALIMON|WALIMOF)\b",
        raw=r"%_N_\S+_(MPF|SPF|INI)|\s*;\s*\$PATH\s*=",
    ),
    _Kind(
        "for a control that reads G70 as inches and G71 as millimetres, such as a Siemens Sinumerik",
        # in other dialects, G70 and G71 are lathe cycles or hole patterns, with additional words
        code=r"^(?!.*[DIJKLPQRUW]\s*[-+.0-9#\[]).*(?<![A-Z#\[<])G7[01](?![0-9.])",
        advice="if all else in it is plain ISO, write G20 for G70 and G21 for G71; if not, " + _POST,
    ),
    _Kind(
        "G-code of a 3-D printer",
        code=r"^\s*M(10[49]|140|190)\s+S[0-9.]+\s*$|^\s*G92\s+E-?[0-9.]+\s*$",
        raw=r"\s*;\s*(FLAVOR:|LAYER_COUNT:|Generated (with|by) (Cura|PrusaSlicer|Slic3r|SuperSlicer|OrcaSlicer))",
        advice="only programs of machine tools can be revised",
    ),
    _Kind(
        "APT or CLDATA (the tool path of a CAM system)",
        code=r"^\s*(PARTNO|(GOTO|FEDRAT|SPINDL|LOADTL|CUTTER)\s*/)",
        advice="run it through the post-processor of an ISO control",
    ),
    _Kind("a web page or XML file", code=r"\Z.", raw=r"\s*<(\?xml|!DOCTYPE|html)\b", advice=_GIVE),
    _Kind("a STEP file (geometry)", code=r"\Z.", raw=r"ISO-10303-21;", advice=_GIVE),
)
_PATTERNS = [(kind, re.compile(kind.code, re.I), re.compile(kind.raw, re.I)) for kind in _KINDS]

_UTF_16 = "UTF-16 text, which controls cannot read; save it as plain text (ASCII)"
#: minimum fraction of NUL bytes in every second position of UTF-16 text without a byte order mark
_MOSTLY = 0.9

# first bytes of non-text files
_MAGIC = (
    ("%PDF-", "a PDF document"),
    ("PK\x03\x04", "a ZIP archive"),
    ("\x1f\x8b", "a gzip archive"),
    ("7z\xbc\xaf", "a 7z archive"),
    ("\x89PNG", "a PNG picture"),
    ("\xff\xd8\xff", "a JPEG picture"),
    ("GIF8", "a GIF picture"),
    ("\x7fELF", "an executable program"),
    ("MZ\x90", "an executable program"),
    ("\xff\xfe", _UTF_16),
    ("\xfe\xff", _UTF_16),
)
_COMMENT = re.compile(r"\([^()]*\)?")
_NAME = re.compile(r"<[^<>]*>")  # o<trans> call, #<rot>


def recognise(first_lines: Sequence[str]) -> str:
    """Return ``"iso"``, unless the lines are certainly something else."""
    if not any(line.strip() for line in first_lines):
        raise InputError("the file is empty: give an NC program")
    _refuse_binary(first_lines)
    for number, line in enumerate(first_lines, 1):
        code = _NAME.sub("<>", _COMMENT.sub("()", line).partition(";")[0].rstrip())
        for kind, in_code, in_raw in _PATTERNS:
            if in_code.search(code) or in_raw.match(line):
                raise InputError(
                    f"this is {kind.name}, not ISO 6983, as line {number} shows: '{line.strip()[:60]}'; "
                    f"it is not supported: {kind.advice}"
                )
    return "iso"


def recognised(texts: Iterable[str]) -> Iterator[str]:
    """Return the lines unchanged, if the control is a supported one."""
    rest = iter(texts)
    first = list(itertools.islice(rest, FIRST))
    recognise(first)
    return itertools.chain(first, rest)


def _refuse_binary(lines: Sequence[str]) -> None:
    text = "".join(lines)
    for half, other in ((text[::2], text[1::2]), (text[1::2], text[::2])):
        if "\0" not in half and other.count("\0") > _MOSTLY * len(other):
            raise InputError(f"the file is not an NC program but {_UTF_16}")
    for magic, name in _MAGIC:
        if lines[0].startswith(magic):
            raise InputError(f"the file is not an NC program but {name}")
    for number, line in enumerate(lines, 1):
        if "\0" in line:
            raise InputError(
                f"the file is binary (NUL byte in line {number}), such as a Mazatrol program or a backup: "
                "give the program as ISO text, which Mazak controls call EIA/ISO"
            )
